"""The infrared camera (``optical.ir``, thesis §3.5.3)."""

import numpy as np
from pydantic import Field

from components.optical.camera import Camera, CameraParameters
from components.optical.infrared_area import infrared_area
from components.optical.plume import Plume
from components.optical.tabulated_area import tabulated_area
from components.sensor import Cells
from dsa_des.types import FloatArray


class InfraredParameters(CameraParameters):
    """Parameters of an infrared camera."""

    plume: bool = Field(
        default=False,
        description="Whether to add the exhaust plume of each aircraft's engine. The areas of "
        "Tables 3.2 and 4.6 hold it already, as a doubled back; pair it with one that is not.",
    )


class Infrared(Camera):
    """An infrared camera that sees a target's warm areas, its front and back unequal."""

    Parameters = InfraredParameters
    areas, contrasts = "ir", "contrast_ir"
    effects = (Plume(), *Camera.effects)

    def area(self, cells: Cells) -> FloatArray:
        """Return the warm silhouette with its own back (eq. 20-21, errata 12), m²."""
        if self.p.silhouette == "aspect_table":
            return tabulated_area(cells, "ir.silhouette_table")
        area = infrared_area(
            cells.relative_heading_rad,
            cells.target_pitch_rad,
            cells.target_roll_rad,
            cells.elevation_rad,
            front_m2=cells.of_target(cells.roster.column("ir.front_m2")),
            back_m2=cells.of_target(cells.roster.column("ir.back_m2")),
            side_m2=cells.of_target(cells.roster.column("ir.side_m2")),
            horizontal_m2=cells.of_target(cells.roster.column("ir.horizontal_m2")),
            model=self.p.silhouette,
            validate=False,
        )
        return np.asarray(area)

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's contrast gain for IR."""
        return cells.of_target(cells.roster.column("contrast_ir"))
