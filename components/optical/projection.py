"""A camera that reduces a target to a line (``optical.projection``, thesis §2.2.2)."""

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from components.optical.camera import Camera, CameraParameters
from components.optical.ladder import INFRARED, VISIBLE
from components.optical.weather_effects import Night
from components.sensor.look import Cells
from components.sensor.marks import EO
from dsa_des.arrays.types import FloatArray
from dsa_des.block.ladder import Ladder


class ProjectionParameters(CameraParameters):
    """Parameters of a one-dimensional projection."""

    band: Literal["eo", "ir"] = Field(
        default="eo", description="Whose areas and contrast of an aircraft are taken."
    )


class Projection(Camera):
    """Sees a target as a line one pixel high, by its size, range and colour contrast.

    The DUT/NLDA simulator took size and colour of the intruder from its database and compared them
    "in a one-dimensional space"; the thesis says no more. Assumption: the size is the length of the
    fuselage, whatever the aspect, and the signature counts the pixels along it.
    """

    mark = EO
    Parameters = ProjectionParameters
    lockstep = True
    effects = (Night(), *Camera.effects)
    ladders = (VISIBLE,)

    @classmethod
    def ladders_for(cls, parameters: Any) -> tuple[Ladder, ...]:
        """Return the ladder of the cameras of its band."""
        return (INFRARED,) if parameters.band == "ir" else cls.ladders

    @property
    def contrast_column(self) -> str:
        """Column of the roster that holds the contrast it sees, by its band."""
        return "contrast_ir" if self.p.band == "ir" else "contrast"

    def area(self, cells: Cells) -> FloatArray:
        """Return the area of the line: the target's length times one pixel's height there, m²."""
        band = self.p.band
        length_m = cells.of_target(
            fuselage_length_m(
                cells.roster.column(f"{band}.front_m2"), cells.roster.column(f"{band}.side_m2")
            )
        )
        area: FloatArray = length_m * (cells.range_m * self.pixel_elevation_rad)
        return area

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's colour contrast."""
        return cells.of_target(cells.roster.column(self.contrast_column))


def fuselage_length_m(front_m2: FloatArray, side_m2: FloatArray) -> FloatArray:
    """Return the length of the cylinder and its two half spheres (thesis §3.5.2), m.

    The radius follows from the front, the cylinder's length from its side; without a front it is a
    square plate as long as its edge.
    """
    radius = np.sqrt(front_m2 / math.pi)
    thin = radius <= 0.0
    length = side_m2 / (2.0 * np.where(thin, 1.0, radius)) + 2.0 * radius
    result: FloatArray = np.where(thin, np.sqrt(side_m2), length)
    return result
