"""Parameters of every sensor: clock, field of view, grid, errors, mounting and declaration."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from components.geometry import TWO_PI, unwrap_sector
from components.messages.reach import Reach
from components.sensor.grid import Grid, rounding_variance_of_step
from dsa_des.block.component import ClockedParameters
from dsa_des.errors import Disagreements
from dsa_des.time.gauss_markov import LONGEST_S

CorrelationTime = Annotated[float, Field(gt=0, le=LONGEST_S)]


@dataclass(frozen=True)
class StatedError:
    """Stated error of one measured quantity, in radians, metres and m/s, beside its grid's step.

    The deviation is of what changes from look to look, for a correlation time (None where it is new
    at every look); the bias stays throughout a run, or is the largest that may where it is drawn.
    Of a `share`, deviation and bias are shares of the value.
    """

    step: float
    deviation: float
    bias: float
    correlation_time_s: float | None
    drawn_bias: bool
    share: bool

    @property
    def mean_square_of_bias(self) -> float:
        """Mean square of the bias: its square, or a third of that if drawn for each run."""
        return self.bias**2 / (3.0 if self.drawn_bias else 1.0)

    @property
    def mean_square_without_rounding(self) -> float:
        """Mean square error without rounding: deviation² plus the mean square of the bias."""
        return self.deviation**2 + self.mean_square_of_bias

    @property
    def variance(self) -> float:
        """Rounding variance, plus mean square error unless the error is a share of the value."""
        return rounding_variance_of_step(self.step) + (
            0.0 if self.share else self.mean_square_without_rounding
        )


class ErrorParameters(ClockedParameters):
    """Errors of measured angles, in the sensor's own axes; radars add range and range rate."""

    may_change: ClassVar[tuple[str, ...]] = ("azimuth_error_deg", "elevation_error_deg")

    #: Measured quantities, and the unit in which scenes give their errors.
    quantities: ClassVar[Mapping[str, str]] = {"azimuth": "deg", "elevation": "deg"}

    errors: Literal["grid", "stated"] = Field(
        default="grid",
        description="What measured values err by: 'grid', rounding to the grid alone; 'stated', "
        "the standard deviations and biases that the scene gives.",
    )
    quantised: bool = Field(
        default=True,
        description="Whether values with errors other than 'grid' are rounded to the grid too.",
    )
    biases: Literal["drawn", "fixed"] = Field(
        default="drawn",
        description="Whether a bias is drawn once for a run, uniformly between minus and plus the "
        "value given, or is that value.",
    )
    azimuth_error_deg: float = Field(
        default=0.0, ge=0, le=180, description="Standard deviation of measured azimuth, deg."
    )
    azimuth_bias_deg: float = Field(
        default=0.0, ge=-180, le=180, description="Bias of measured azimuth, deg; see biases."
    )
    azimuth_correlation_time_s: CorrelationTime | None = Field(
        default=None,
        description="Time after which azimuth_error_deg has forgotten all but 1/e, s; by default "
        "it is new at every look.",
    )
    elevation_error_deg: float = Field(
        default=0.0, ge=0, le=90, description="Standard deviation of measured elevation, deg."
    )
    elevation_bias_deg: float = Field(
        default=0.0, ge=-90, le=90, description="Bias of measured elevation, deg; see biases."
    )
    elevation_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of elevation_error_deg, s."
    )

    @model_validator(mode="after")
    def _check_error_keys(self) -> Self:
        wrong = []
        for name, unit in self.quantities.items():
            deviation, bias, lasts = self._error_key_names(name, unit)
            wrong += [
                f"{key} is {getattr(self, key):g} and errors is 'grid', which knows no errors but "
                f"rounding: set errors to 'stated', or leave {key} out"
                for key in (deviation, bias)
                if self.errors == "grid" and getattr(self, key)
            ]
            if getattr(self, lasts) is not None and not getattr(self, deviation):
                wrong.append(
                    f"{lasts} is given and {deviation} is 0: there is nothing that lasts; give "
                    f"both or neither"
                )
        Disagreements.raise_if_any(wrong)
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of errors that are switched off."""
        said = super().ineffective_key_notes()
        if self.errors == "grid":
            return said + self.note_ineffective("quantised", "biases", because="errors is 'grid'")
        biases = [self._error_key_names(name, unit)[1] for name, unit in self.quantities.items()]
        if not any(getattr(self, key) for key in biases):
            said += self.note_ineffective("biases", because=f"none of {', '.join(biases)} is given")
        return said

    @staticmethod
    def _error_key_names(name: str, unit: str) -> tuple[str, str, str]:
        return f"{name}_error_{unit}", f"{name}_bias_{unit}", f"{name}_correlation_time_s"

    def stated_errors(self, steps: Mapping[str, float]) -> dict[str, StatedError]:
        """Return stated errors by quantity (step, deviation, bias, correlation time; rad, m, m/s).

        Nothing of a quantity for which a user's sensor has no such parameters.
        """
        rounded, drawn = self.errors == "grid" or self.quantised, self.biases == "drawn"
        stated = {}
        for name, step in steps.items():
            deviation, bias, lasts_s = 0.0, 0.0, None
            if unit := self.quantities.get(name, ""):
                deviation, bias, lasts_s = (
                    getattr(self, key) for key in self._error_key_names(name, unit)
                )
            if unit == "deg":
                deviation, bias = math.radians(deviation), math.radians(bias)
            share = unit == "share" and self.errors != "grid"
            step = step if rounded else 0.0
            stated[name] = StatedError(step, deviation, bias, lasts_s, drawn, share)
        return stated


class RangeErrorParameters(ErrorParameters):
    """Grid and errors of a measured range."""

    may_change: ClassVar[tuple[str, ...]] = ("range_resolution_m", "range_error_m")

    quantities: ClassVar[Mapping[str, str]] = {**ErrorParameters.quantities, "range": "m"}

    range_resolution_m: float = Field(
        default=0.0, ge=0, description="Grid step of measured range, m; 0 measures exactly."
    )
    range_error_m: float = Field(
        default=0.0, ge=0, description="Standard deviation of measured range, m."
    )
    range_bias_m: float = Field(default=0.0, description="Bias of measured range, m; see biases.")
    range_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of range_error_m, s."
    )


class GlintParameters(ErrorParameters):
    """How far the centre of a target that is seen wanders over it, beside errors by signal."""

    glint_share: float = Field(
        default=0.2,
        ge=0,
        le=1,
        description="Standard deviation of where a target seems to be, as a share of its extent, "
        "for errors = 'signal': glint of radars, the centroid's wander of cameras; 0.15 to 0.25 is "
        "measured of aircraft.",
    )
    glint_correlation_time_s: CorrelationTime = Field(
        default=0.2, description="Time after which that has forgotten all but 1/e, s."
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a glint that is switched off."""
        said = super().ineffective_key_notes()
        if self.errors != "signal":
            return said + self.note_ineffective(
                "glint_share", "glint_correlation_time_s", because=f"errors is '{self.errors}'"
            )
        if not self.glint_share:
            said += self.note_ineffective("glint_correlation_time_s", because="glint_share is 0")
        return said


def check_field_of_view_azimuths(value: tuple[float, float]) -> tuple[float, float]:
    """Return the pair of azimuths (deg, clockwise) unchanged; ValueError if not a field of view."""
    if not all(-360 <= angle <= 360 for angle in value):
        raise ValueError("must hold two angles in [-360, 360], clockwise from the first")
    if value[0] == value[1] or not -360 < value[1] - value[0] <= 360:
        raise ValueError("must hold a field above 0 and up to 360 deg wide; all round is -180, 180")
    return value


def check_field_of_view_elevations(value: tuple[float, float]) -> tuple[float, float]:
    """Return the elevations (deg, lower first) unchanged; ValueError if no valid field of view."""
    if not -90 <= value[0] < value[1] <= 90:
        raise ValueError("must hold two angles in [-90, 90], the lower one first")
    return value


MisalignmentAngle = Annotated[float, Field(ge=-45, le=45)]


class SensorParameters(ErrorParameters):
    """Parameters of every sensor; angles in degrees in the sensor's axes.

    Those are the ownship's body axes unless the sensor is mounted otherwise.
    """

    may_change: ClassVar[tuple[str, ...]] = (
        "enabled", "azimuth_deg", "elevation_deg", "range_km", "azimuth_resolution_deg",
        "elevation_resolution_deg", "misalignment_deg",
    )  # fmt: skip

    enabled: bool = Field(default=True, description="Whether the sensor is switched on.")
    azimuth_deg: Annotated[tuple[float, float], AfterValidator(check_field_of_view_azimuths)] = (
        Field(
            default=(-180.0, 180.0),
            description="Field of view in azimuth, clockwise from the first to the second, deg.",
        )
    )
    elevation_deg: Annotated[
        tuple[float, float], AfterValidator(check_field_of_view_elevations)
    ] = Field(
        default=(-90.0, 90.0), description="Field of view in elevation, lowest and highest, deg."
    )
    range_km: float | None = Field(
        default=None, gt=0, description="Farthest range that is looked at, km; none by default."
    )
    azimuth_resolution_deg: float = Field(
        default=0.0, ge=0, description="Grid step of measured azimuth, deg; 0 measures exactly."
    )
    elevation_resolution_deg: float = Field(
        default=0.0, ge=0, description="Grid step of measured elevation, deg; 0 measures exactly."
    )

    mount_azimuth_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Boresight, clockwise from the nose, deg."
    )
    mount_elevation_deg: float = Field(
        default=0.0, ge=-90, le=90, description="Boresight above the plane of the wings, deg."
    )
    mount_roll_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Roll about the boresight, deg."
    )
    misalignment_deg: tuple[MisalignmentAngle, MisalignmentAngle, MisalignmentAngle] = Field(
        default=(0.0, 0.0, 0.0),
        description="Mounting as believed minus as it is (azimuth, elevation, roll), deg: reports "
        "are off by it.",
    )
    declare_m: int | None = Field(
        default=None, ge=1, description="Detections that declare a target; by default one does."
    )
    declare_n: int | None = Field(
        default=None, ge=1, le=1000, description="Last looks at a target that they are counted in."
    )
    declare_by: Literal["target", "place"] | None = Field(
        default=None,
        description="Whether looks at one 'target' are counted, as if the sensor knew whom it "
        "sees, or scans with detections at one measured 'place'; by default 'place' where there "
        "are false alarms.",
    )
    declare_speed_m_s: float = Field(
        default=300.0,
        ge=0,
        description="How fast a declared place may come nearer or move away, m/s.",
    )
    declare_rate_deg_s: float = Field(
        default=5.0,
        ge=0,
        le=180,
        description="How fast a declared place may move across the line of sight, deg/s.",
    )

    @model_validator(mode="after")
    def _check_declaration_rule(self) -> Self:
        if (self.declare_m is None) != (self.declare_n is None):
            raise ValueError("declare_m and declare_n belong together: give both or neither")
        if (self.declare_m or 0) > (self.declare_n or 0):
            raise ValueError(
                f"declare_m is {self.declare_m}: it must be at most declare_n, {self.declare_n}"
            )
        return self

    @model_validator(mode="after")
    def _check_grid_in_field(self) -> Self:
        reach = self.reach()
        for angle, (low, high) in (
            ("azimuth", unwrap_sector(*reach.azimuth_rad)),
            ("elevation", reach.elevation_rad),
        ):
            step_deg = getattr(self, f"{angle}_resolution_deg")
            if not step_deg or high - low >= TWO_PI:
                continue
            try:
                Grid(math.radians(step_deg), limit_low=low, limit_high=high)
            except ValueError as error:
                edges = ", ".join(f"{edge:g}" for edge in getattr(self, f"{angle}_deg"))
                raise ValueError(
                    f"{angle}_resolution_deg is {step_deg:g}: a multiple of it must lie in the "
                    f"field of view, {angle}_deg = [{edges}], or nothing could be reported"
                ) from error
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a declaration rule that is switched off."""
        said, places = super().ineffective_key_notes(), ("declare_speed_m_s", "declare_rate_deg_s")
        if self.declare_m is None:
            return said + self.note_ineffective(
                "declare_by", *places, because="declare_m is not given"
            )
        if self.declares_by_target_or_place == "target":
            said += self.note_ineffective(
                *places, because="looks at targets are counted (declare_by)"
            )
        return said

    @property
    def declares_by_target_or_place(self) -> Literal["target", "place"]:
        """Return whether detections are counted by target or by place."""
        if self.declare_by is not None:
            return self.declare_by
        # Radars and cameras that can have false alarms say so by these.
        noisy = getattr(self, "has_false_alarms", getattr(self, "false_alarms", False))
        return "place" if noisy else "target"

    def reach(self) -> Reach:
        """Return the sensor's reach."""
        return Reach(
            (math.radians(self.azimuth_deg[0]), math.radians(self.azimuth_deg[1])),
            (math.radians(self.elevation_deg[0]), math.radians(self.elevation_deg[1])),
            math.inf if self.range_km is None else self.range_km * 1000.0,
            self.enabled,
        )
