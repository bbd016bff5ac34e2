"""Parameters of a tracker, and the rules that follow from them and from what sensors offer.

Part of a measurement's error was in the same sensor's last one already. A value on a grid is off by
the same as long as it stays in its cell, a bias throughout a run, an error with a correlation time
for that long. A filter that takes such errors for new ones at every look is too sure; what is new
in a measurement is worked out by `components.estimation.kalman.equivalent_independent_variance`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from components.estimation.estimator import Estimator
from components.messages.detections import SensorOffer
from components.messages.reach import Reach
from components.tracking.due_detections import LIVES_S, Promises
from components.tracking.reported_errors import CarriedErrors
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import NonNegativeRational, Parameters

_QUANTITIES = ("azimuth", "elevation", "range", "range_rate", "velocity")
# Which of these each row of `Scans.measured` is.
_OF_ROW = np.array([0, 1, 2, 3, 4, 4, 4])


@dataclass(frozen=True, eq=False)
class LastingErrors:
    """The part of each sensor's errors that is correlated from look to look."""

    step: FloatArray  # (5 quantities, sensors), of the grid; 0 for none
    # (parts, 5 quantities, sensors), as in `LastingPart`; 0 where there is none
    variance: FloatArray
    lasts_s: FloatArray
    across_m2: FloatArray
    share: FloatArray

    @classmethod
    def of(cls, offers: Mapping[str, Any], sensors: tuple[str, ...]) -> "LastingErrors | None":
        """Return the correlated errors that named sensors state; None if new at every look."""
        known = {
            (_QUANTITIES.index(quantity), j): one
            for j, name in enumerate(sensors)
            if isinstance(offer := offers.get(name), SensorOffer)
            for quantity, one in (offer.lasting or {}).items()
        }
        if not known:
            return None
        most = max(len(one.parts) for one in known.values())
        step = np.zeros((len(_QUANTITIES), len(sensors)))
        variance, across_m2, share = np.zeros((3, most, *step.shape))
        lasts_s = np.full(variance.shape, np.inf)
        for cell, one in known.items():
            step[cell] = one.step
            for k, part in enumerate(one.parts):
                variance[k][cell], across_m2[k][cell] = part.variance, part.across_m2
                lasts_s[k][cell], share[k][cell] = part.lasts_s, part.share
        return cls(step, variance, lasts_s, across_m2, share)

    @cached_property
    def is_correlated(self) -> BoolArray:
        """Mask over sensors: any error is correlated between looks; a last False for no sensor."""
        parts = (self.variance != 0.0) | (self.across_m2 != 0.0) | (self.share != 0.0)
        return np.append((self.step != 0.0).any(axis=0) | parts.any(axis=(0, 1)), False)

    @cached_property
    def correlated_sensors_mask(self) -> int:
        """Bit mask, as one integer, of the sensors that have a correlated error."""
        return sum(1 << i for i in np.flatnonzero(self.is_correlated).tolist())

    @cached_property
    def _has_crosswise_parts(self) -> bool:
        return bool(self.across_m2.any())

    @cached_property
    def _has_share_parts(self) -> bool:
        return bool(self.share.any())

    def covariance_with_last_errors(
        self,
        rows: list[int],
        source: IntArray,
        variance: FloatArray,
        moved: FloatArray,
        since_s: FloatArray,
        range_m: FloatArray,
    ) -> FloatArray:
        """Return error covariances with those of the sensor's last measurement of that track."""
        at = _OF_ROW[rows][:, np.newaxis] * self.step.shape[1] + source
        step, seen = self.step.take(at), np.isfinite(since_s)
        rounding = step * step / 12.0
        white, remembered = variance - rounding, 0.0
        if len(self.variance):
            lasting = _values_at_flat_positions(self.variance, at)
            if self._has_crosswise_parts:
                lasting = (
                    lasting
                    + _values_at_flat_positions(self.across_m2, at) / np.maximum(range_m, 1.0) ** 2
                )
            if self._has_share_parts:
                share = _values_at_flat_positions(self.share, at)
                stated = np.maximum(lasting + share * variance, 0.0)
                lasting = np.where(share > 0.0, stated, lasting)
            white = white - lasting.sum(axis=0)
            # Time over an infinite time constant is 0: nothing is forgotten.
            forgotten = np.exp(
                -np.where(seen, since_s, 0.0) / _values_at_flat_positions(self.lasts_s, at)
            )
            remembered = (lasting * forgotten).sum(axis=0)
        safe = np.where(step > 0.0, step, 1.0)
        white = np.maximum(white, 0.0)
        # A variance that comes out as 1e-20 of a step has none of its own.
        white = np.where(white > 1e-9 * rounding, white, 0.0)
        rounding = rounding * np.exp(-6.0 * moved / safe - 4.0 * np.pi**2 * white / (safe * safe))
        return np.where(seen, rounding + remembered, 0.0)


def _values_at_flat_positions(values: FloatArray, at: IntArray) -> FloatArray:
    """Return values (parts, quantities, sensors) at flat positions in the last two axes."""
    return values.reshape(len(values), values[0].size).take(at, axis=1)


#: Looks that a track's history can hold.
LONGEST_WINDOW = 62
# What a sensor that states no reach is taken to see: all around, as far as this.
_FARTHEST_M = 20_000.0
_WHOLE_RATE_M_S = 600.0


class TrackerParameters(Parameters):
    """Parameters of every tracker that estimates states."""

    may_change: ClassVar[tuple[str, ...]] = (
        "gate_probability", "start_gate_probability", "detection_probability",
        "false_alarms_per_scan", "delete_misses", "delete_after_s", "delete_above_m",
    )  # fmt: skip

    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration that targets are taken to have, m²/s³.",
    )  # fmt: skip
    association: Literal["nearest", "gnn", "jpda"] = Field(
        default="gnn",
        description="Which detection is whose: the nearest in turn, the least sum over all "
        "(global nearest neighbour), or all of them weighed (joint probabilistic).",
    )
    gate_probability: float = Field(
        default=0.997, gt=0, lt=1,
        description="Probability that a target's detection lies in its gate.",
    )  # fmt: skip
    start_gate_probability: float = Field(
        default=0.999999, ge=0, lt=1,
        description="Probability of a wider gate about confirmed tracks: a detection in it "
        "starts no new track; 0 for none.",
    )  # fmt: skip
    detection_probability: float = Field(
        default=0.9, gt=0, lt=1, description="Probability that a look at a target detects it."
    )
    false_alarms_per_scan: float = Field(
        default=0.1, gt=0,
        description="False alarms that a sensor is taken to have in a scan of its whole field.",
    )  # fmt: skip
    jpda_exact_detections: int = Field(
        default=10, ge=1, le=16,
        description="Detections in a cluster up to which `jpda` is exact; belief propagation "
        "beyond.",
    )  # fmt: skip
    initiation: Literal["m_of_n", "likelihood_ratio"] = Field(
        default="m_of_n", description="The rule that confirms a track."
    )
    confirm_m: int = Field(default=3, ge=1, description="Hits that confirm a track (`m_of_n`).")
    confirm_n: int = Field(
        default=5, ge=1, le=LONGEST_WINDOW, description="Expected looks in which they must fall."
    )
    false_confirmation: float = Field(
        default=1e-4, gt=0, lt=0.5,
        description="Share of false tracks that `likelihood_ratio` confirms.",
    )  # fmt: skip
    missed_confirmation: float = Field(
        default=0.01, gt=0, lt=0.5, description="Share of true tracks that it drops."
    )
    start_existence: float = Field(
        default=0.2, gt=0, lt=1,
        description="Probability that a detection that belongs to no track is of a target.",
    )  # fmt: skip
    start_speed_m_s: float = Field(
        default=70.0, gt=0,
        description="Standard deviation of a new track's velocity along each axis, m/s.",
    )  # fmt: skip
    start_climb_m_s: float | None = Field(
        default=None, gt=0,
        description="That of its vertical speed, m/s: aircraft climb slower than they fly. By "
        "default the same.",
    )  # fmt: skip
    assumed_range_m: float | None = Field(
        default=None, gt=0,
        description="Assumed range of detections without one, m; its inverse has a standard "
        "deviation of 50 %. By default a quarter of the farthest reach of the sensors.",
    )  # fmt: skip
    passive_range_share: float | None = Field(
        default=None, gt=0, le=10,
        description="Standard deviation of the range, as a share of it, from which on a track of "
        "directions alone is reported with its range: what the ownship's manoeuvres tell of it. "
        "By default never.",
    )  # fmt: skip
    use_range_rate: bool = Field(
        default=True,
        description="Whether range rates, and velocities that aircraft tell, are used where a "
        "sensor states them with a variance; not those that fold, or that are exact.",
    )
    delete_misses: int | None = Field(
        default=None, ge=1,
        description="Misdetections (expected looks without a detection) in a row that end a "
        "confirmed track. By default no number of them: looks come as often as sensors look, and "
        "time decides.",
    )  # fmt: skip
    delete_after_s: float | None = Field(
        default=None, gt=0,
        description="Time without a detection after which any track ends, s. By default 6 s, or "
        "three times as long as the soonest of those that see it promises a report in, if that is "
        "more.",
    )  # fmt: skip
    delete_above_m: float = Field(
        default=3000.0, gt=0,
        description="How much a position may become less certain since the last detection, as a "
        "standard deviation, before a track with a range ends, m.",
    )  # fmt: skip

    late: Literal["drop", "one_step", "rerun"] = Field(
        default="one_step",
        description="What becomes of a look that comes after a later one: tracks that the later "
        "one updated do without it (`drop`), tracks are corrected by one step back and forth "
        "(`one_step`), or all looks since it are worked on again in order (`rerun`).",
    )
    lag_s: NonNegativeRational | None = Field(
        default=None,
        description="How much older than the newest a look may be to be worked on after all, s; "
        "older ones are left out and counted. By default as late as the scene says that one may "
        "come, and 1 s at least.",
    )

    @model_validator(mode="after")
    def _check_confirmation(self) -> Any:
        if self.confirm_m > self.confirm_n:
            raise ValueError(
                f"confirm_m = {self.confirm_m} hits cannot fall in confirm_n = {self.confirm_n} "
                "looks; allowed: at most as many"
            )
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of an association, rule or lateness that is not chosen."""
        said = super().ineffective_key_notes()
        if self.association != "jpda":
            because = f"association is '{self.association}'"
            said += self.note_ineffective("jpda_exact_detections", because=because)
        unused = {
            "m_of_n": ("false_confirmation", "missed_confirmation"),
            "likelihood_ratio": ("confirm_m", "confirm_n"),
        }
        said += self.note_ineffective(
            *unused[self.initiation], because=f"initiation is '{self.initiation}'"
        )
        if self.start_gate_probability <= self.gate_probability:
            because = f"gate_probability is {self.gate_probability:g}"
            said += self.note_ineffective("start_gate_probability", because=because)
        return said


@dataclass(frozen=True, eq=False)
class TrackerRules:
    """Everything a tracker decides by: its parameters, filter, and sensors' offers."""

    p: Any  # TrackerParameters, or those of a subclass
    estimator: Estimator
    ticks_per_s: int
    fields: tuple[Reach | None, ...]  # where each sensor looks; None is everywhere
    # (8, sensors): logarithm of the false alarms in a scan per unit of measured volume, by kind
    log_density: FloatArray
    start_range_m: tuple[float, float]  # mean and deviation assumed of what is seen angle-only
    rates_of: int  # mask of the sensors whose range rates are used
    lasting: LastingErrors | None  # what of the sensors' errors is not new at every look
    unstated_across_m2: FloatArray | None  # (sensors,), as in `SensorOffer`
    carried: CarriedErrors | None  # what of it the filter carries as states
    promises: Promises  # where sensors do not report at every look

    @classmethod
    def of(
        cls,
        p: TrackerParameters,
        estimator: Estimator,
        offers: Mapping[str, Any],
        sensors: tuple[str, ...],
        ticks_per_s: int,
    ) -> "TrackerRules":
        """Return the rules of a tracker for the named sensors, given their offers by name."""
        known = [offers.get(name) for name in sensors]
        fields = tuple(o.reach if isinstance(o, SensorOffer) else None for o in known)
        farthest = max(
            (f.range_max_m for f in fields if f is not None and f.range_max_m < math.inf),
            default=_FARTHEST_M,
        )
        assumed = p.assumed_range_m or 0.25 * farthest
        unstated = [o.unstated_across_m2 if isinstance(o, SensorOffer) else 0.0 for o in known]
        used = [not why_range_rates_unused(p, offer) for offer in known]
        return cls(
            p, estimator, ticks_per_s, fields, log_false_alarm_densities(fields,
            p.false_alarms_per_scan),
            (assumed, 0.5 * assumed), sum(1 << i for i, one in enumerate(used) if one),
            LastingErrors.of(offers, sensors), np.array(unstated) if any(unstated) else None,
            CarriedErrors.of(offers, sensors) if estimator.error_count else None,
            Promises.of(offers, sensors, ticks_per_s),
        )  # fmt: skip

    @property
    def initial_track_score(self) -> float:
        """Initial score of a track: log odds that a first detection is of a target."""
        return math.log(self.p.start_existence / (1.0 - self.p.start_existence))

    @property
    def widest_gate_probability(self) -> float:
        """The widest gate's probability: detections outside are never compared with tracks."""
        return max(self.p.gate_probability, self.p.start_gate_probability)

    @property
    def default_life_ticks(self) -> int:
        """Ticks that a track lives without detections if its sensors report at every look."""
        return int(LIVES_S * self.ticks_per_s)

    def track_life_ticks(self, sees: BoolArray, range_m: FloatArray) -> IntArray:
        """Return how many ticks tracks live undetected; `sees` (sensors, n): who sees one."""
        if self.p.delete_after_s is not None:
            return np.full(len(range_m), int(self.p.delete_after_s * self.ticks_per_s))
        return self.promises.track_life_ticks(sees, range_m)

    def initial_extra_state_deviation(self, size: int) -> float:
        """Return the initial deviation of turn rate (rad/s; 7 states) or acceleration (m/s²)."""
        if size == 7:
            return math.radians(getattr(self.p, "start_turn_deg_s", 3.0))
        return float(getattr(self.p, "start_acceleration_m_s2", 3.0))


def why_range_rates_unused(p: TrackerParameters, offer: Any) -> str:
    """Return why this sensor's range rates are not used; an empty string if they are."""
    if not p.use_range_rate:
        return "use_range_rate is false"
    if not isinstance(offer, SensorOffer) or not offer.measures_range_rate:
        return "it measures none"
    if offer.folds_range_rate:
        return "they fold, and are ambiguous"
    if offer.range_rate_variance_m2_s2 == 0.0:
        return "they are exact, and a tracker weighs measurements by their variances"
    return ""


def log_false_alarm_densities(fields: tuple[Reach | None, ...], per_scan: float) -> FloatArray:
    """Return ln of expected false alarms per unit of measured volume, (8 measurements, sensors)."""
    density = np.empty((8, len(fields)))
    for i, field in enumerate(fields):
        width, height, far = 2.0 * math.pi, math.pi, _FARTHEST_M
        if field is not None:
            low, high = field.azimuth_rad
            width = (high - low) % (2.0 * math.pi) or 2.0 * math.pi
            height = field.elevation_rad[1] - field.elevation_rad[0] or math.pi
            far = min(field.range_max_m, _FARTHEST_M)
        for code in range(8):
            volume = width * height * (far if code & 1 else 1.0)
            volume *= _WHOLE_RATE_M_S if code & 2 else 1.0
            volume *= _WHOLE_RATE_M_S**3 if code & 4 else 1.0
            density[code, i] = math.log(per_scan / volume)
    return density
