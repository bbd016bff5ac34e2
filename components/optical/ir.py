"""The infrared camera (``optical.ir``, thesis §3.5.3)."""

from components.optical.camera import Camera
from components.optical.infrared_area import infrared_area
from components.sensor import Cells
from dsa_des.types import FloatArray


class Infrared(Camera):
    """An infrared camera that sees a target's warm areas, its front and back unequal."""

    def area(self, cells: Cells) -> FloatArray:
        """Return the warm silhouette with its own back (eq. 20-21, errata 12), m²."""
        return infrared_area(
            cells.relative_heading_rad,
            cells.target_pitch_rad,
            cells.target_roll_rad,
            cells.elevation_rad,
            front_m2=cells.of_target(cells.roster.column("ir.front_m2")),
            back_m2=cells.of_target(cells.roster.column("ir.back_m2")),
            side_m2=cells.of_target(cells.roster.column("ir.side_m2")),
            horizontal_m2=cells.of_target(cells.roster.column("ir.horizontal_m2")),
            model=self.p.silhouette,
        )

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's contrast gain for IR."""
        return cells.of_target(cells.roster.column("contrast_ir"))
