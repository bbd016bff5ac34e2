"""The base class of EO and IR cameras: pixels, signature, threshold (thesis §3.5.2)."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.aircraft import Roster
from components.aircraft.known_targets import offered_rosters
from components.optical.area_of_cells import area_fit_warnings, check_silhouette
from components.optical.contrast import CONTRAST
from components.optical.detection import (
    FAINTEST_DEVIATIONS,
    FAINTEST_PD,
    FrameFalseAlarms,
    detection_probability,
    noise_equivalent_pixels,
    pixels_for_filtered_count,
    point_filter_share,
)
from components.optical.detector import (
    CameraCalibration,
    CameraDetector,
    centroid_variance,
    derive_detector,
    detection_range_bound_m,
)
from components.optical.infrared_area import AREA
from components.optical.signature import SIGNATURE, DynamicSignature, pixels_of_cells
from components.optical.weather_effects import DARKNESS, ObscuringCells, Visibility
from components.sensor.cued_looks import CUE, CUED_LOOKS, cue_warnings
from components.sensor.look import Cells, CellValues, Look, effect_values_of_cells
from components.sensor.parameters import GlintParameters, SensorParameters
from components.sensor.sensor import CUED_INPUTS, Sensor
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect


class CameraParameters(GlintParameters, SensorParameters):
    """Parameters of a camera; the pixel grid follows from field of view and pixel counts."""

    may_change: ClassVar[tuple[str, ...]] = (
        "threshold", "cued_threshold", "noise_equivalent_contrast", "blur_pixels",
        "false_alarms_per_frame",
    )  # fmt: skip

    azimuth_pixels: int = Field(gt=0, description="Pixels across the field of view.")
    elevation_pixels: int = Field(gt=0, description="Pixels from its lower to its upper edge.")
    threshold: float | None = Field(
        default=None,
        description="Signature needed for a detection (eq. 19), of a point if there is noise: a "
        "target of many pixels needs more; by default 1, or what noise_equivalent_contrast, "
        "false_alarms_per_frame and calibrate say.",
    )
    cued_threshold: float | None = Field(
        default=None,
        ge=0,
        description="Signature needed within a cue cone; by default the same.",
    )
    static_weight: float = Field(default=0.3, ge=0, description="Weight a of eq. 18, per pixel.")
    dynamic_weight: float = Field(default=0.0, ge=0, description="Weight b of eq. 18, s/rad.")
    model: Literal["auto"] | None = Field(
        default=None,
        description="'auto' would pick a cheaper `silhouette` by its error; no bound is proven, so "
        "it stays, and `explain` says so.",
    )
    silhouette: Literal[
        "exact", "thesis", "convex_hull", "aspect_table", "sampled_table", "mesh"
    ] = Field(
        default="exact",
        description="How the area follows from the target's attitude: sum of the three bodies, "
        "thesis eq. 9-13, union of the bodies, each aircraft's silhouette_table, a table sampled "
        "from the union, or a mesh of the bodies (slow).",
    )
    rate: Literal["exact", "thesis"] = Field(
        default="exact",
        description="How the line of sight's rate is formed: turning angle, or eq. 16-17.",
    )
    errors: Literal["grid", "stated", "signal"] = Field(  # type: ignore[assignment]
        default="grid",
        description="What measured values err by: 'grid', rounding to the grid alone; 'stated', "
        "the standard deviations and biases that the scene gives; 'signal', those that follow from "
        "a target's pixels and contrast, beside the stated ones.",
    )
    noise_equivalent_contrast: float | None = Field(
        default=None,
        ge=0,
        description="Contrast gain of a target that stands out by as much as a pixel's noise; "
        "given alone, the threshold follows from 0.0001 false alarms a frame. By default the noise "
        "follows from the threshold and false_alarms_per_frame, or calibrate; 0 is the thesis's "
        "rule: what reaches the threshold is detected, nothing else is.",
    )
    calibrate: CameraCalibration | None = Field(
        default=None,
        description="A known detection range, from which noise or threshold, or both, follow.",
    )
    blur_pixels: float = Field(
        default=0.5, gt=0, description="Standard deviation of the picture's blur, pixels."
    )
    false_alarms_per_frame: float | None = Field(
        default=None,
        ge=0,
        le=1e5,
        description="False alarms expected in a frame, from which the noise follows at a given "
        "threshold, or the threshold at a given noise; by default 0.0001 where at most one of "
        "threshold, noise_equivalent_contrast and calibrate is given.",
    )
    false_alarms: bool | None = Field(
        default=None,
        description="Whether noise is reported too, anywhere in the picture; by default where "
        "false_alarms_per_frame is given, or two other keys say how many there are.",
    )
    marked_false_alarms: bool = Field(
        default=False,
        description="Whether false alarms can be told from targets: after them in their frame, "
        "with confidence 0 and no pixels.",
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key without effect as noise, false alarms or rates are off."""
        said = super().ineffective_key_notes()
        if self.noise_equivalent_contrast == 0 and self.errors != "signal":
            said += self.note_ineffective("blur_pixels", because="there is no noise")
        if not self.has_false_alarms:
            said += self.note_ineffective(
                "marked_false_alarms", because="no false alarms are reported"
            )
        if not self.dynamic_weight:
            said += self.note_ineffective("rate", because="dynamic_weight is 0")
        return said

    @model_validator(mode="after")
    def _check_angles_and_pixels(self) -> Self:
        keys = "threshold", "noise_equivalent_contrast", "false_alarms_per_frame", "calibrate"
        given = [key for key in keys if getattr(self, key) is not None]
        silent = self.noise_equivalent_contrast == 0
        if len(given) > 2 and not (silent and self.calibrate is None):
            raise ValueError(
                f"{', '.join(given[:-1])} and {given[-1]} are given, and any two of them say the "
                f"{'third' if len(given) == 3 else 'others'}: leave one out"
            )
        if silent and self.calibrate is not None:
            raise ValueError("noise_equivalent_contrast is 0: without noise calibrate has no Pd")
        if silent and self.errors == "signal":
            raise ValueError(
                "errors is 'signal' and noise_equivalent_contrast is 0: errors are a share of the "
                "picture by how much it stands out of noise"
            )
        return self

    @property
    def has_false_alarms(self) -> bool:
        """Return whether its reports contain false alarms."""
        if self.false_alarms is not None:
            return self.false_alarms
        if self.false_alarms_per_frame is not None:
            return self.false_alarms_per_frame > 0.0
        return self.has_implied_false_alarms

    @property
    def has_implied_false_alarms(self) -> bool:
        """Return whether other keys imply a number of false alarms, as threshold with noise."""
        others = self.threshold, self.noise_equivalent_contrast, self.calibrate
        if self.noise_equivalent_contrast == 0.0 or others.count(None) != 1:
            return False
        return self.threshold is None or self.threshold > 0.0  # else everything is seen


class Camera(Sensor):
    """A camera: a target is detected when its signature, as measured, reaches the threshold.

    E = a·Q·P + b·V with Q pixels covered, P contrast gain and V the rate of the line of sight
    (eq. 18). Each look measures E once with Gaussian noise, as a filter does that fits the target:
    of Q pixels the share sqrt(s / (s + Q)) counts, in the noise of a point, whose picture takes s
    pixels (`point_filter_share`). Confidence is C = sample - threshold, in the threshold's unit
    (eq. 19); pixels are those that a target of contrast 1 covers whose signature is the sample.
    ``looks`` has the pixels that are covered, and Pd.
    """

    Parameters = CameraParameters
    #: Columns of the roster that hold the areas and the contrast it sees.
    areas: ClassVar[str] = ""
    contrasts: ClassVar[str] = ""
    hooks = (AREA, CONTRAST, SIGNATURE, DARKNESS)
    inputs = CUED_INPUTS
    effects: ClassVar[tuple[Effect, ...]] = (
        DynamicSignature(),
        Visibility(),
        ObscuringCells(),
        FrameFalseAlarms(),
        CUED_LOOKS,
    )

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        width, height = self.reach.width_rad
        self.pixel_azimuth_rad = width / parameters.azimuth_pixels
        self.pixel_elevation_rad = height / parameters.elevation_pixels
        # Reports come on the pixel grid unless the scene gives a coarser one.
        if not parameters.azimuth_resolution_deg:
            self.azimuth_step_rad = self.pixel_azimuth_rad
        if not parameters.elevation_resolution_deg:
            self.elevation_step_rad = self.pixel_elevation_rad
        self.all_pixels = float(self.p.azimuth_pixels * self.p.elevation_pixels)
        self._noise = self.stream("signature noise")
        self._areas: list[CellValues] = []
        self._contrast_factors: list[CellValues] = []
        self._signatures: list[CellValues] = []

    @cached_property
    def detector(self) -> CameraDetector:
        """The camera's threshold and noise, derived from those keys that the scene states."""
        places = max(1, round(self.all_pixels / self.point_spread_pixels))
        return derive_detector(
            self, places, self._static_weight_or_one * math.sqrt(self.point_spread_pixels)
        )

    @cached_property
    def point_spread_pixels(self) -> float:
        """Number of pixels over which the picture of a point is spread."""
        return noise_equivalent_pixels(self.p.blur_pixels)

    @property
    def _static_weight_or_one(self) -> float:
        # Without a weight of its own, size says nothing: as much as if it had the unit one.
        return float(self.p.static_weight or 1.0)

    def setup(self) -> None:
        """Check the targets' silhouettes, and take what effects do to area, signature, contrast."""
        for roster in offered_rosters(self.context) if self.areas else ():
            check_silhouette(roster, self.areas, self.p.silhouette)
        self._areas = self.built(AREA)
        self._contrast_factors = self.built(CONTRAST)
        self._signatures = self.built(SIGNATURE)
        if self.p.errors == "signal" and self.detector.noise == 0.0:
            raise ValueError(
                "errors is 'signal' and noise_equivalent_contrast is not given, and neither do a "
                "threshold above 0 and false alarms say how large the noise is"
            )
        if self.built_one(DARKNESS):
            self.reach = replace(self.reach, enabled=False)
        if not self.context.simulate_everything:
            farthest_m = detection_range_bound_m(self, self.areas, self.contrasts)
            nearer_m = min(self.reach.range_max_m, farthest_m)
            self.reach = replace(self.reach, range_max_m=nearer_m)

    def why_exact_line_of_sight(self) -> str:
        """Return why this camera needs an exact line of sight; an empty string if it does not."""
        if self.detector.noise and "detection_probability" in self.context.tolerance:
            return f"no bound is proven for the Pd of {self.name}"
        if not self._signatures:
            return ""
        weight = self.p.dynamic_weight
        return f"{self.name} weighs the line of sight's rate (dynamic_weight is {weight:g})"

    def skipped_work_notes(self) -> list[str]:
        """Return sentences on the range beyond which nothing is detected, and on `auto` choices."""
        said = [*super().skipped_work_notes()]
        if self.reach.range_max_m < self.stated_reach.range_max_m:
            range_km = self.reach.range_max_m / 1000.0
            said.append(
                f"targets beyond {range_km:.2f} km: not looked at, even the largest of them, seen "
                f"from its largest side, {self._describe_faint_range()} there"
            )
        if self.p.model == "auto":
            said.append(
                f"silhouette: {self.p.silhouette}, as the scene says: for no other model is an "
                "error bound proven"
            )
        return said

    def _describe_faint_range(self) -> str:
        if self.detector.noise:
            return f"has a Pd below {FAINTEST_PD:g}, which counts as none,"
        return "cannot reach the threshold"

    @property
    def pixel_rad(self) -> tuple[float, float]:
        """Width and height of a pixel."""
        return self.pixel_azimuth_rad, self.pixel_elevation_rad

    @property
    def contrast_column_name(self) -> str:
        """Name of the roster column with the contrast that this camera uses."""
        return self.contrasts

    def area(self, cells: Cells) -> FloatArray:
        """Return the area that shows in each cell, m²."""
        raise TypeError(f"{type(self).__name__} has no area(cells)")

    def visible_area_m2(self, cells: Cells) -> FloatArray:
        """Return the area visible in each cell, including effects such as a plume, m²."""
        area = self.area(cells)
        for added in self._areas:
            area = area + effect_values_of_cells(self, added, cells)
        return area

    def contrast(self, cells: Cells) -> FloatArray:
        """Return the contrast gain P of each cell."""
        raise TypeError(f"{type(self).__name__} has no contrast(cells)")

    def look(self, cells: Cells) -> Look:
        """Return which cells' signatures reach the threshold, with their margin above it."""
        area = self.visible_area_m2(cells)
        pixels = pixels_of_cells(
            area,
            cells.range_m,
            self.pixel_azimuth_rad,
            self.pixel_elevation_rad,
            self.all_pixels,
        )
        contrast = self.contrast(cells)
        for factor in self._contrast_factors:
            contrast = contrast * effect_values_of_cells(self, factor, cells)
        # Eq. 18, by hand: total_signature adds the rate of the line of sight, here an effect.
        signature = self.p.static_weight * pixels * contrast
        for added in self._signatures:
            signature = signature + effect_values_of_cells(self, added, cells)
        signature = signature * self.counted_signature_share(pixels)
        threshold = self._threshold_of(cells)
        noise = self.detector.noise
        if not noise:
            margin = signature - threshold
            signal = {"pixels": pixels, "contrast": contrast}
            return Look(margin >= 0.0, margin, {"pixels": pixels}, signal)
        keys = cells.roster.draw_keys_of(cells.target)
        drawn = self._noise.of_runs(cells.run, cells.instant_ns).normal(keys, cells.scan)
        sample = signature + noise * drawn
        margin = sample - threshold
        seen = (margin >= 0.0) & (signature > threshold - FAINTEST_DEVIATIONS * noise)
        extras = {"pixels": pixels}
        if self._is_every_look_recorded:
            extras["detection_probability"] = detection_probability(signature, threshold, noise)
        return Look(seen, margin, extras, self.signal_from_signature(sample, np.ones(len(cells))))

    def counted_signature_share(self, pixels: FloatArray) -> FloatArray:
        """Return the share of a signature that is left after the filter; 1 without noise."""
        silent = self.p.noise_equivalent_contrast == 0.0
        return (
            np.ones_like(pixels) if silent else point_filter_share(pixels, self.point_spread_pixels)
        )

    def _extra_columns(self, cells: Cells, look: Look) -> Mapping[str, Any]:
        """Return the columns recorded by detection; with noise, measured pixels and no Pd."""
        extras = dict(super()._extra_columns(cells, look))
        if self.detector.noise:
            extras["pixels"] = look.signal["pixels"]
            extras.pop("detection_probability", None)
        return extras

    def report(self) -> dict[str, Any]:
        """Return threshold, noise and false alarms per frame in use, for the summary."""
        found = self.detector
        used = {
            "threshold": found.threshold,
            "noise": found.noise,
            "false_alarms_per_frame": found.false_alarms,
        }
        return {**super().report(), "cameras": {self.name: used}}

    def _threshold_of(self, cells: Cells) -> Any:
        """Return the threshold: one for all, or each cell's own where some are cued."""
        if cells.cued is None or self.p.cued_threshold is None:
            return self.detector.threshold
        return np.where(cells.cued, self.p.cued_threshold, self.detector.threshold)

    def lowest_threshold(self) -> float:
        """Return the least signature that is ever detected."""
        if self.p.cued_threshold is None or not self.built(CUE):
            return self.detector.threshold
        return float(min(self.detector.threshold, self.p.cued_threshold))

    def warnings(self) -> list[str]:
        """Return a warning for each cue without effect and each area of another silhouette."""
        said = [*super().warnings(), *cue_warnings(self)]
        for roster in offered_rosters(self.context) if self.areas else ():
            said += area_fit_warnings(roster, self.areas, self.p.silhouette)
        return said

    def signal_variances(self, signal: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return the variances of the measured azimuth and elevation of a target's centre, rad²."""
        of_contrast = self._static_weight_or_one * math.sqrt(self.point_spread_pixels)
        ratio = signal["contrast"] * (of_contrast / self.detector.noise)
        variance = centroid_variance(signal["pixels"], ratio, self.p.blur_pixels)
        return {
            "azimuth": self.pixel_azimuth_rad**2 * variance,
            "elevation": self.pixel_elevation_rad**2 * variance,
        }

    def possible_false_alarm_contrasts(self, roster: Roster) -> FloatArray:
        """Return the distinct contrasts above 0 that a false alarm may have; [1] if noise is
        measured or no target has one.

        A signature that is measured with noise does not say of which contrast it is.
        """
        if self.detector.noise or not self.contrast_column_name or not len(roster):
            return np.ones(1)
        found = np.unique(roster.column(self.contrast_column_name))
        return found[found > 0.0] if (found > 0.0).any() else np.ones(1)

    def signal_from_signature(
        self, signature: FloatArray, contrast: FloatArray
    ) -> dict[str, FloatArray]:
        """Return the targets' pixels and contrast, if size alone made the signatures (eq. 18)."""
        pixels = np.maximum(signature, 0.0) / (self._static_weight_or_one * contrast)
        if self.p.noise_equivalent_contrast != 0.0:
            pixels = pixels_for_filtered_count(pixels, self.point_spread_pixels)
        return {"pixels": np.minimum(pixels, self.all_pixels), "contrast": contrast}
