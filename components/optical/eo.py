"""The electro-optical camera (``optical.eo``, thesis §3.5.2)."""

from typing import Literal

from pydantic import Field

from components.optical.area_of_cells import area_of_cells
from components.optical.background import Background
from components.optical.camera import Camera, CameraParameters
from components.optical.ladder import VISIBLE
from components.optical.weather_effects import Night
from components.sensor.look import Cells
from components.sensor.marks import EO
from dsa_des.arrays.types import FloatArray


class ElectroOpticalParameters(CameraParameters):
    """Parameters of an electro-optical camera; sun and reflectances matter with a background.

    Haze is the scene's, not the camera's: ``visibility_km`` in the table ``[weather]``.
    """

    background: Literal["none", "auto", "sky", "ground"] = Field(
        default="none",
        description="What targets are seen against by daylight: sky, ground, or auto, sky from the "
        "horizon up; 'none' takes each aircraft's constant contrast.",
    )
    sky: Literal["clear", "partly_cloudy", "overcast"] = Field(
        default="clear", description="State of the sky."
    )
    sun_azimuth_deg: float = Field(
        default=180.0, ge=-360, le=360, description="Bearing of the sun, deg from north."
    )
    sun_elevation_deg: float = Field(
        default=45.0, gt=0, le=90, description="Elevation of the sun, deg."
    )
    sun_exclusion_deg: float = Field(
        default=0.0,
        ge=0,
        le=180,
        description="Half angle of the cone round the sun in which the camera is blind, deg.",
    )
    ground_reflectance: float = Field(
        default=0.2, gt=0, le=1, description="Diffuse reflectance of the ground; 0.2 is grass."
    )

    def without_effect(self) -> list[str]:
        """Say which keys belong to daylight, where no background is asked for."""
        said = super().without_effect()
        if self.background == "none":
            sun = "sun_azimuth_deg", "sun_elevation_deg", "sun_exclusion_deg"
            said += self.idle("sky", *sun, "ground_reflectance", because="background is 'none'")
        return said


class ElectroOptical(Camera):
    """An electro-optical camera that sees a target's silhouette against its background."""

    mark = EO
    Parameters = ElectroOpticalParameters
    lockstep = True
    areas, contrasts = "eo", "contrast"
    effects = (Background(), Night(), *Camera.effects)
    ladders = (VISIBLE,)

    def area(self, cells: Cells) -> FloatArray:
        """Return the silhouette of sphere, cylinder and plane (eq. 9-13, errata 9), m²."""
        return area_of_cells(cells, "eo", self.p.silhouette)

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's own contrast gain, before background and weather."""
        return cells.of_target(cells.roster.column("contrast"))
