"""Blocks of optical sensors: EO, IR, projection on pixels, boundary of range; their ladders."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.optical.area_of_cells import area_of_cells
from components.optical.camera import Camera, CameraParameters
from components.optical.contrast import Background
from components.optical.infrared_area import AREA, Plume
from components.optical.silhouette import exact_area_of_bodies_union
from components.optical.weather_effects import BandExtinction, Night
from components.sensor.cued_looks import refuse_if_cued
from components.sensor.ladder_values import over_cells
from components.sensor.look import Cells, Look, aspect_pitch_roll_elevation_rad
from components.sensor.palette import EO, IR
from components.sensor.parameters import CorrelationTime, ErrorParameters, SensorParameters
from components.sensor.sensor import CUED_INPUTS, Sensor
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable
from dsa_des.block.wake import Wake

_AREA = Quantity("area", "m²")


def measured_areas(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Run a camera on a wake and return the visible area of every (scan, target), m².

    A range boundary sees none: it decides as a camera would whose every target shows the area that
    is just detected at the boundary. That area is taken, for the pixels, weights and threshold of
    the reference.
    """
    camera: Any = block
    if not hasattr(camera, "visible_area_m2"):
        as_camera: Any = reference

        def values(cells: Cells) -> dict[str, FloatArray]:
            contrast = np.maximum(as_camera.contrast(cells), 1e-12)
            pixel_m2 = (
                camera.reach.range_max_m**2
                * as_camera.pixel_azimuth_rad
                * as_camera.pixel_elevation_rad
            )
            needed = as_camera.signal_from_signature(as_camera.detector.threshold, contrast)[
                "pixels"
            ]
            return {_AREA.name: pixel_m2 * needed}

    else:

        def values(cells: Cells) -> dict[str, FloatArray]:
            return {_AREA.name: camera.visible_area_m2(cells)}

    return dict(over_cells(camera, wake, values))


def silhouette_truth_errors(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return cells' rounding errors of visible area, against extended precision, m²."""
    if np.finfo(np.longdouble).eps >= np.finfo(np.float64).eps:
        raise Unavailable("not measured: this machine has no extended precision")
    camera: Any = block
    if getattr(camera.p, "silhouette", "") != "convex_hull" or camera.built(AREA):
        raise Unavailable("nothing more exact is known")

    def values(cells: Cells) -> dict[str, FloatArray]:
        roster = cells.roster
        names = ["front_m2", "side_m2", "horizontal_m2"]
        names += ["back_m2"] if camera.areas == "ir" else []
        bodies = [
            cells.column_at_targets(roster.column(f"{camera.areas}.{name}")) for name in names
        ]
        wide = [
            array.astype(np.longdouble)
            for array in (*aspect_pitch_roll_elevation_rad(cells), *bodies)
        ]
        areas: Any = (*wide, None)[:8]
        exact = exact_area_of_bodies_union(*areas)
        error = np.abs(camera.visible_area_m2(cells).astype(np.longdouble) - exact)
        return {_AREA.name: error.astype(np.float64)}

    found = over_cells(camera, wake, values)
    return {_AREA.name: found[_AREA.name][cells[:, 0], cells[:, 1]]}


def _ladder(band: str, type_name: str, *top: Rung) -> Ladder:
    def silhouette(name: str) -> Mapping[str, Any]:
        return {"silhouette": name}

    return Ladder(
        "silhouette",
        (
            Rung("range_boundary", "all inside 3 km (TECVOL, section 2.3.1)",
                 "optical.range_boundary", {"range_km": 3.0}),
            Rung("projection", "a line: size, range, colour (section 2.2.2)",
                 "optical.projection", {"band": band}),
            Rung("thesis", "thesis eq. 9-13", type_name, silhouette("thesis")),
            Rung("exact", "sum of the three bodies, each exact", type_name, silhouette("exact")),
            Rung("sampled_table", "the union in a table of 5 degrees", type_name,
                 silhouette("sampled_table")),
            Rung("aspect_table", "each aircraft's measured silhouette_table", type_name,
                 silhouette("aspect_table")),
            Rung("mesh", "a mesh of the three bodies, projected", type_name, silhouette("mesh")),
            Rung("union", "union of the three bodies, closed form", type_name,
                 silhouette("convex_hull")),
            *top,
        ),
        "union",
        (_AREA,),
        measured_areas,
        silhouette_truth_errors,
        clears=("model",),
    )  # fmt: skip


#: Pictures show what a signature leaves out: the same area, found otherwise, at its price.
VISIBLE = _ladder(
    "eo",
    "optical.eo",
    Rung(
        "image", "rendered, searched (extra image)", "optical.image", {"silhouette": "convex_hull"}
    ),
)
INFRARED = _ladder("ir", "optical.ir")


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

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of daylight, where no background is given."""
        said = super().ineffective_key_notes()
        if self.background == "none":
            sun = "sun_azimuth_deg", "sun_elevation_deg", "sun_exclusion_deg"
            said += self.note_ineffective(
                "sky", *sun, "ground_reflectance", because="background is 'none'"
            )
        return said


class ElectroOptical(Camera):
    """An electro-optical camera that sees a target's silhouette against its background."""

    mark = EO
    Parameters = ElectroOpticalParameters
    areas, contrasts = "eo", "contrast"
    effects = (Background(), Night(), *Camera.effects)
    ladders = (VISIBLE,)

    def area(self, cells: Cells) -> FloatArray:
        """Return the silhouette of sphere, cylinder and plane (eq. 9-13, errata 9), m²."""
        return area_of_cells(cells, "eo", self.p.silhouette)

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's own contrast gain, before background and weather."""
        return cells.column_at_targets(cells.roster.column("contrast"))


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
    areas, contrasts = "ir", "contrast_ir"
    effects = (Plume(), BandExtinction(), *Camera.effects)
    ladders = (INFRARED,)

    def area(self, cells: Cells) -> FloatArray:
        """Return the warm silhouette with its own back (eq. 20-21, errata 12), m²."""
        return area_of_cells(cells, "ir", self.p.silhouette)

    def contrast(self, cells: Cells) -> FloatArray:
        """Return each target's contrast gain for IR."""
        return cells.column_at_targets(cells.roster.column("contrast_ir"))


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
    effects = (Night(), *Camera.effects)
    ladders = (VISIBLE,)

    @classmethod
    def ladders_for(cls, parameters: Any) -> tuple[Ladder, ...]:
        """Return the ladder (models from crude to exact) of the cameras of its band."""
        return (INFRARED,) if parameters.band == "ir" else cls.ladders

    @property
    def contrast_column_name(self) -> str:
        """Column of the roster that holds the contrast it sees, by its band."""
        return "contrast_ir" if self.p.band == "ir" else "contrast"

    def area(self, cells: Cells) -> FloatArray:
        """Return the area of the line: the target's length times one pixel's height there, m²."""
        band = self.p.band
        length_m = cells.column_at_targets(
            fuselage_length_m(
                cells.roster.column(f"{band}.front_m2"), cells.roster.column(f"{band}.side_m2")
            )
        )
        area: FloatArray = length_m * (cells.range_m * self.pixel_elevation_rad)
        return area

    def contrast(self, cells: Cells) -> FloatArray:
        """Return the colour contrast of each cell's target."""
        return cells.column_at_targets(cells.roster.column(self.contrast_column_name))


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


class CameraBoundaryParameters(SensorParameters):
    """Parameters of a range boundary camera; the defaults are TECVOL's."""

    quantities: ClassVar[Mapping[str, str]] = {**ErrorParameters.quantities, "range": "share"}

    range_km: float = Field(
        default=3.0, gt=0, description="Range inside which every target is detected, km."
    )
    azimuth_resolution_deg: float = Field(
        default=0.1, ge=0, description="Grid step of measured azimuth, deg; 0 measures exactly."
    )
    elevation_resolution_deg: float = Field(
        default=0.1, ge=0, description="Grid step of measured elevation, deg; 0 measures exactly."
    )
    range_error_share: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="Standard deviation of the range that passive ranging gives, as a share of it; "
        "0: no range is measured.",
    )
    range_bias_share: float = Field(
        default=0.0, ge=-1, le=1, description="Bias of that range, as a share of it; see biases."
    )
    range_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of range_error_share, s."
    )

    @model_validator(mode="after")
    def _check_error_model(self) -> Self:
        if self.range_bias_share and not self.range_error_share:
            raise ValueError(
                f"range_bias_share is {self.range_bias_share:g} and range_error_share is 0: no "
                "range is measured; give range_error_share too, or leave range_bias_share out"
            )
        return self


class OpticalRangeBoundary(Sensor):
    """Detects every target inside its range, as TECVOL's simulated EO system did.

    Confidence is (range limit / range)² - 1, the margin over a threshold of 1 that a camera would
    have whose target is just detected at the limit.
    """

    mark = EO
    Parameters = CameraBoundaryParameters
    inputs = CUED_INPUTS
    ladders = (VISIBLE,)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.measures_range = parameters.range_error_share > 0.0

    def setup(self) -> None:
        """Refuse cues: everything inside the range is seen anyway."""
        refuse_if_cued(self)

    def look(self, cells: Cells) -> Look:
        """Return all cells as detected, targets out of range being skipped before, with margin."""
        # A metre is closer than any camera looks; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        return Look(np.ones(len(cells), dtype=bool), np.square(ratio) - 1.0)
