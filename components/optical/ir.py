"""The infrared camera (``optical.ir``, thesis §3.5.3)."""

from typing import Literal

from pydantic import Field

from components.optical.area_of_cells import area_of_cells
from components.optical.camera import Camera, CameraParameters
from components.optical.ladder import INFRARED
from components.optical.plume import Plume
from components.optical.weather_effects import BandExtinction
from components.sensor.look import Cells
from components.sensor.marks import IR
from dsa_des.arrays.types import FloatArray


class InfraredParameters(CameraParameters):
    """Parameters of an infrared camera."""

    plume: bool = Field(
        default=False,
        description="Whether to add the exhaust plume of each aircraft's engine. The areas of "
        "Tables 3.2 and 4.6 hold it already, as a doubled back; pair it with one that is not.",
    )
    extinction_band: Literal["visible", "mwir", "lwir"] = Field(
        default="visible",
        description="Whose air the contrast passes: that of visible light, as in the thesis, or of "
        "3-5 µm or 8-12 µm, where clear air absorbs by its humidity and haze takes less.",
    )


class Infrared(Camera):
    """An infrared camera that sees a target's warm areas, its front and back unequal."""

    mark = IR
    Parameters = InfraredParameters
    lockstep = True
    areas, contrasts = "ir", "contrast_ir"
    effects = (Plume(), BandExtinction(), *Camera.effects)
    ladders = (INFRARED,)

    def area(self, cells: Cells) -> FloatArray:
        """Return the warm silhouette with its own back (eq. 20-21, errata 12), m²."""
        return area_of_cells(cells, "ir", self.p.silhouette)

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's contrast gain for IR."""
        return cells.of_target(cells.roster.column("contrast_ir"))
