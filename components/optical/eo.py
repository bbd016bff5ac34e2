"""The electro-optical camera (``optical.eo``, thesis §3.5.2)."""

from components.optical.camera import Camera
from components.optical.silhouette import visible_area
from components.sensor import Cells
from dsa_des.types import FloatArray


class ElectroOptical(Camera):
    """An electro-optical camera that sees a target's silhouette against its background."""

    def area(self, cells: Cells) -> FloatArray:
        """Return the silhouette of sphere, cylinder and plane (eq. 9-13, errata 9), m²."""
        return visible_area(
            cells.relative_heading_rad,
            cells.target_pitch_rad,
            cells.target_roll_rad,
            cells.elevation_rad,
            front_m2=cells.of_target(cells.roster.column("eo.front_m2")),
            side_m2=cells.of_target(cells.roster.column("eo.side_m2")),
            horizontal_m2=cells.of_target(cells.roster.column("eo.horizontal_m2")),
            model=self.p.silhouette,
        )

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's contrast gain for EO."""
        return cells.of_target(cells.roster.column("contrast"))
