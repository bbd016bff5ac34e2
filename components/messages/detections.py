"""The message of sensors: detections, scan by scan, and what a sensor says of them beforehand.

Rows are scans (see `dsa_des.block.message`). Angles are in radians; azimuth is clockwise and
elevation upward.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import (
    NED,
    OWN_VELOCITY,
    POSE,
    MeasuredLine,
    StatedErrors,
    TrueLine,
    target_name_of_each_entry,
)
from components.messages.looks import look_columns
from components.messages.reach import Reach
from components.messages.targets import RelativeTargets
from dsa_des.arrays.column_values import take_rows
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Hook
from dsa_des.block.message import (
    PER_ROW,
    Column,
    Columns,
    Message,
    column,
    columns,
    per_entry,
    per_row,
    static,
)
from dsa_des.time.clock import ClockSpec

#: Columns of ``scans`` for targets that were not evaluated, by reason.
_SKIPPED = {
    f"skipped_{reason}": Column("targets", "", f"left out: {why}", "int64")
    for reason, why in {
        "absent": "not there",
        "off": "the sensor is off",
        "field_of_view": "outside the field of view",
        "range": "beyond the range",
        "hidden": "the Earth or its ground stands before it",
        "culled": "too far away for any sensor",
    }.items()
}
#: Index into the roster of a detection without a target; it is recorded as null.
FALSE_TARGET = -1
#: Extras that are instants, which a sensor stamps anew (`Detections.repeat_rows`).
_INSTANTS = ("illuminated_s", "reported_s", "velocity_s")
#: Columns of ``detections`` that only some sensors fill. For others, a subclass has a field
#: ``extras: dict[str, AnyArray] = columns({**EXTRAS, "name": Column("m", "", "meaning")}, ...)``.
EXTRAS = {
    "snr_db": Column(
        "dB", "", "signal-to-noise ratio that a radar measured; the mean stands in looks"
    ),
    "detection_probability": Column(
        "", "", "probability of it, where a sensor of one's own says it; looks has that of all"
    ),
    "pixels": Column("pixels", "", "pixels that the target covers in a camera"),
    "declared": Column("", "", "whether there are enough detections; true without a rule", "bool"),
    "illuminated_s": Column("s", "", "when a sweeping beam lit the target"),
    "ned_azimuth_rad": Column("rad", NED, "azimuth from north, by the believed attitude"),
    "ned_elevation_rad": Column("rad", NED, "elevation, by the believed attitude"),
    "cued": Column(
        "", "", "whether the target lay in a cue cone; false where no cues come", "bool"
    ),
}


@dataclass(frozen=True)
class LastingPart:
    """A measurement error's part that is correlated between looks: variance, time constant.

    Parameters
    ----------
    variance : float
    lasts_s : float
        Infinite for what stays the same throughout a run.
    across_m2 : float
        Variance of a position across the line of sight: over the range squared that of an angle.
    share : float
        Share of the variance that a report states, where that differs from report to report;
        `variance` is added to it, and may be below 0 then: what of it is no part of this one.
    """

    variance: float = 0.0
    lasts_s: float = math.inf
    across_m2: float = 0.0
    share: float = 0.0


@dataclass(frozen=True)
class LastingError:
    """A quantity's correlated errors, which never average out; its stated variance has them all.

    Parameters
    ----------
    step : float
        Of the grid to which the quantity is rounded; 0 for none.
    parts : tuple of LastingPart
    """

    step: float = 0.0
    parts: tuple[LastingPart, ...] = ()


@dataclass(frozen=True)
class ToldError:
    """A Gauss-Markov error whose standard deviation is reported with each detection.

    Parameters
    ----------
    way : int
        Which way it goes (`components.estimation.carried_errors`).
    deviation : str
        Which of `TOLD` is its deviation.
    lasts_s : float
        Infinite for what stays the same, 0 for what is new at every instant.
    of_aircraft : bool
        Whether it is the aircraft's own, the same for all that hear it.
    """

    way: int
    deviation: str
    lasts_s: float
    of_aircraft: bool = True


@dataclass(frozen=True)
class SensorOffer:
    """What a sensor says of its detections to the blocks that receive them.

    Parameters
    ----------
    measures_range : bool
    resolution_rad : float
        Coarser of the two angular grid steps, for choosing between sensors.
    measures_range_rate : bool
    azimuth_variance_rad2, elevation_variance_rad2 : float or None
        Of the columns of the same names in `Detections`, where all entries have one value; None
        where it differs from detection to detection.
    range_variance_m2, range_rate_variance_m2_s2 : float or None
        None where it differs, or is not measured.
    folds_range_rate : bool
        Whether range rates beyond what is unambiguous are reported as ones within.
    ambiguous_m : float
        Ranges are reported modulo this; infinite where none is ambiguous, or several PRFs resolve
        them.
    reach : Reach or None
        Where it looks, in the ownship's body axes; None where it does not say.
    lasting : mapping of LastingError, or None
        What of its errors lasts from look to look, by quantity (``azimuth``, ``elevation``,
        ``range``, ``range_rate``), those without are new at every look;
        None where it does not say.
    clock : callable or None
        Returns when it looks. Asked only where it matters, and no part of the word that replicas
        compare: whoever reads clocks that differ cannot be shared by them.
    latest_s, jitter_s : Fraction
        How late its looks come at most to whom a fusion offers them, and how much of that is by
        chance; None where nobody says.
    unforeseen : bool
        Whether they may come later still, as they queue.
    unstated_across_m2 : float
        Variance of the ownship's own position across the line of sight that its angles' variances
        leave out, as it knows no range: who knows one adds it over the range squared.
    promises : tuple of (float, float)
        Where it does not report every target at every look: up to which range, m, it reports one
        again within which time, s, 19 times in 20; ascending, the last one holds beyond too. Less
        than that is no miss. Where it looks less often than every 2 s: that time, at any range.
    tells : bool
        Whether its detections may have something that is `told_by_target`.
    told_errors : tuple of ToldError
        Errors whose deviations differ from detection to detection, as `told_by_target` has them.
        What carries them needs no `lasting` of the same.
    platform : str
        What carries it, to whom a fusion offers it.
    """

    measures_range: bool
    resolution_rad: float
    measures_range_rate: bool = False
    azimuth_variance_rad2: float | None = None
    elevation_variance_rad2: float | None = None
    range_variance_m2: float | None = None
    range_rate_variance_m2_s2: float | None = None
    reach: Reach | None = None
    folds_range_rate: bool = False
    ambiguous_m: float = math.inf
    lasting: Mapping[str, LastingError] | None = None
    clock: Callable[[], ClockSpec] | None = field(default=None, compare=False)
    latest_s: Fraction | None = None
    jitter_s: Fraction = Fraction(0)
    unforeseen: bool = False
    unstated_across_m2: float = 0.0
    promises: tuple[tuple[float, float], ...] = ()
    tells: bool = False
    told_errors: tuple[ToldError, ...] = ()
    platform: str = ""


#: A sensor that looks at least so often promises no time: it reports at every look, s.
_OFTEN_S = 2.0


def range_and_report_interval_pairs(
    period_s: float, promises: Iterable[tuple[float, float]] = ()
) -> tuple[tuple[float, float], ...]:
    """Return (range m, time s) pairs: up to that range 19 of 20 are reported again within the time.

    `promises` are those that it makes whatever its looks. Of a sensor that looks often nothing is
    said of its looks, so that replicas may differ in their rates.
    """
    if period_s <= _OFTEN_S:
        return tuple(promises)
    return tuple((far, max(s, period_s)) for far, s in promises) or ((math.inf, period_s),)


def offers_of_fused_sensors(producers: Iterable[Any]) -> dict[str, Any]:
    """Return the offers of all sensors that producers pass on, such as fusions, by name."""
    offers: dict[str, Any] = {}
    for producer in producers:
        if isinstance(producer.offer, dict):
            offers |= producer.offer
    return offers


def joined_names_if_all_rangeless(producers: Iterable[Any]) -> str:
    """Return sensor names joined by `and` if known and none measures range; else empty string."""
    offers = offers_of_fused_sensors(producers)
    if not offers or any(
        not isinstance(one, SensorOffer) or one.measures_range for one in offers.values()
    ):
        return ""
    return " and ".join(sorted(offers))


def declare_pose_column(name: str) -> Any:
    """Return a message column for one quantity of ownship pose, shared by a scan's detections."""
    unit, frame, meaning, _ = POSE[name]
    return column(unit, frame, meaning, of=PER_ROW, for_entries=True, default=None, kw_only=True)


@dataclass(eq=False)
class Detections(MeasuredLine, TrueLine, StatedErrors, Message):
    """What one sensor reports, scan by scan.

    Parameters
    ----------
    skipped : dict of (rows,)
        Targets that were not evaluated, by reason.
    offsets : (rows + 1,)
        Entries ``offsets[i]:offsets[i + 1]`` belong to row i.
    target : (entries,) of int
        Index into the roster.
    confidence : (entries,)
        Margin of the detection; its unit is the sensor's (dB for radar, signature for optics).
    extras : dict of (entries,)
        Those of `EXTRAS` that the sensor has; a subclass may declare more. ``declared`` is recorded
        as true where no rule is in force; with ``illuminated_s`` all of the entry is of that
        instant; ``ned_azimuth_rad`` and ``ned_elevation_rad`` are there where navigation errs.
    own_lat_deg, own_lon_deg, own_alt_m, own_heading_rad, own_pitch_rad, own_roll_rad : (rows,)
        The ownship's pose as it believes it to be at each scan (WGS 84; NED to body,
        yaw-pitch-roll); the truth where its navigation has no error. None from a sensor that does
        not say.
    own_of_entries : dict of (entries,), or None
        The same six where entries were measured at instants of their own within the scan;
        `pose_columns` gives those of every entry in any case.
    own_velocity : dict of (rows,), or None
        How the ownship moved (`OWN_VELOCITY`), where a sensor measures range rates; NaN at scans
        without detections. `own_velocity_columns` gives it of every entry.
    own_velocity_of_entries : dict of (entries,), or None
        The same at instants of their own.
    ticks_after : (entries,) of int, or None
        How long after its row's tick each entry was measured, where that differs: a beam that
        sweeps. `measured_ticks` gives the instants in any case.
    told_by_target : dict of (entries,), or None
        What aircraft tell (`TOLD`): velocity over ground, along the axes of the horizon where the
        ownship believes to be, and how much errs of it and of the position; NaN where nothing is
        reported.
    looks : dict of (rows, targets), or None
        Every look at every target (`components.messages.looks`), where they are recorded.
    """

    row_table = "scans"
    entry_table = "detections"
    may_hold = frozenset({"looks"})
    may_stick = ("range_m", "azimuth_deg")

    scan: IntArray = column("", "", "number of the scan", "int64", of=PER_ROW, in_entries=True)
    evaluated: IntArray = column(
        "targets", "", "targets whose physics was evaluated", "int64", of=PER_ROW
    )
    offsets: IntArray = column(
        "", "", "detections, false alarms included", "int64",
        of=PER_ROW, name="detected", value=lambda message: np.diff(message.offsets),
    )  # fmt: skip
    skipped: dict[str, IntArray] = columns(
        _SKIPPED, of=PER_ROW, value=lambda m: m.skipped_count_columns()
    )
    target: IntArray = column(
        "",
        "",
        "name of the target; null for a false alarm",
        "text",
        value=target_name_of_each_entry,
    )
    confidence: FloatArray = column(
        "dB or signature", "", "margin of the detection, by the kind of sensor"
    )
    extras: dict[str, AnyArray] = columns(EXTRAS, value=lambda m: m.extra_columns())
    roster: Roster = static()
    own_lat_deg: FloatArray | None = declare_pose_column("own_lat_deg")
    own_lon_deg: FloatArray | None = declare_pose_column("own_lon_deg")
    own_alt_m: FloatArray | None = declare_pose_column("own_alt_m")
    own_heading_rad: FloatArray | None = declare_pose_column("own_heading_rad")
    own_pitch_rad: FloatArray | None = declare_pose_column("own_pitch_rad")
    own_roll_rad: FloatArray | None = declare_pose_column("own_roll_rad")
    own_of_entries: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    own_velocity: dict[str, FloatArray] | None = columns(
        OWN_VELOCITY, of=PER_ROW, for_entries=True, default=None, kw_only=True
    )
    own_velocity_of_entries: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    ticks_after: IntArray | None = per_entry(default=None, kw_only=True)
    told_by_target: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    looks: dict[str, AnyArray] | None = per_row(default=None, kw_only=True)

    def tables(self) -> dict[str, Columns]:
        """Return the recorded tables: ``detections``, and ``looks`` where they are recorded."""
        tables = super().tables()
        for own in (self.own_of_entries, self.own_velocity_of_entries):
            tables["detections"].update(own or {})
        return tables if self.looks is None else {**tables, "looks": look_columns(self)}

    def repeat_rows(self, of: Self, source: IntArray, later_s: FloatArray) -> Self:
        """Return these scans filled with detections of earlier rows `source` of the message `of`;
        those that are late become false detections without truth.
        """
        result = super().repeat_rows(of, source, later_s)
        row = result.row_of_entries
        old = (later_s > 0.0)[row]
        result.target = np.where(old, FALSE_TARGET, result.target)
        for name in TrueLine.__dataclass_fields__:
            setattr(result, name, np.where(old, np.nan, getattr(result, name)))
        result.extras = {
            name: values + later_s[row] if name in _INSTANTS else values
            for name, values in result.extras.items()
        }
        if result.own_of_entries is not None:  # the pose is none of the sensor's own values
            result.own_of_entries = {
                name: np.where(old, getattr(self, name)[row], values)
                for name, values in result.own_of_entries.items()
            }
        return result

    def with_stuck_bit(self, rows: BoolArray, quantity: str, worth: float) -> Self:
        """Return a copy with bit `worth` (m or deg) set in each range or azimuth of masked rows."""
        name, unit = "range_m", 1.0
        if quantity == "azimuth_deg":
            name, unit = "azimuth_rad", math.pi / 180.0
        values = getattr(self, name)
        unset = rows[self.row_of_entries] & (np.floor(values / (worth * unit)) % 2.0 == 0.0)
        result = self._copy()
        stuck = np.where(unset, values + worth * unit, values)
        if quantity == "azimuth_deg":
            stuck = np.where(stuck > math.pi, stuck - 2.0 * math.pi, stuck)
        setattr(result, name, stuck)
        return result

    def skipped_count_columns(self) -> dict[str, IntArray]:
        """Return how many targets each scan skipped, in a column ``skipped_…`` for each reason."""
        return {f"skipped_{reason}": count for reason, count in self.skipped.items()}

    def extra_columns(self) -> dict[str, AnyArray]:
        """Return the extra columns by name, and ``declared``: True for all if there is no rule."""
        # A sensor without a rule declares whatever it reports: it knows of no false alarm.
        return {"declared": np.ones(len(self.target), dtype=bool), **self.extras}

    def pose_columns(self) -> dict[str, FloatArray]:
        """Return the ownship's believed pose at each entry, by column; empty without one."""
        if self.own_of_entries is not None:
            return self.own_of_entries
        row, pose = self.row_of_entries, {name: getattr(self, name) for name in POSE}
        return {name: take_rows(v, row) for name, v in pose.items() if v is not None}

    def own_velocity_columns(self) -> dict[str, FloatArray] | None:
        """Return the ownship's velocity at each entry, by column; None if it is not known."""
        if self.own_velocity is None:
            return self.own_velocity_of_entries
        row = self.row_of_entries
        return {name: values.take(row) for name, values in self.own_velocity.items()}

    def measured_ticks(self) -> IntArray:
        """Return the instant at which each entry was measured."""
        ticks = self.tick.take(self.row_of_entries)
        return ticks if self.ticks_after is None else ticks + self.ticks_after


@dataclass(eq=False)
class OwnOfEntries(Message):
    """More recorded columns of a sweeping beam: the ownship's pose at each detection's instant."""

    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = {
        "detections": {
            name: one._replace(meaning=f"{one.meaning}; a beam that sweeps has such a column")
            for name, one in (POSE | OWN_VELOCITY).items()
        }
    }


class ReportTransform(Protocol):
    """Adds to what a sensor reports, or changes it."""

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray, /
    ) -> Detections:
        """Return what is sent; `rows` is the row of `targets` at each scan."""


REPORT = Hook("report", ReportTransform, "detections: what is sent")
