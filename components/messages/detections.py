"""The message of sensors: detections, scan by scan, and what a sensor says of them beforehand.

Rows are scans (see `dsa_des.block.message`). Angles are in radians; azimuth is clockwise and
elevation upward.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import DESCRIBED
from components.messages.constant_columns import not_measured
from components.messages.every_look import look_columns
from components.messages.reach import Reach
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.message import Columns, Message, Text, per_entry, per_row, static
from dsa_des.time.clock import ClockSpec

#: Columns of ``scans`` for targets that were not evaluated, by reason.
_SKIPPED = {
    "skipped_absent": "int64",
    "skipped_off": "int64",
    "skipped_field_of_view": "int64",
    "skipped_range": "int64",
    "skipped_hidden": "int64",
    "skipped_culled": "int64",
}
#: Columns of ``detections`` that only some sensors fill. For others, a subclass has a field
#: ``extras: dict[str, AnyArray] = per_entry(columns={**EXTRAS, "name": "float64"}, ...)``.
EXTRAS = {
    "snr_db": "float64",
    "detection_probability": "float64",
    "pixels": "float64",
    "declared": "bool",
    "illuminated_s": "float64",
    "ned_azimuth_rad": "float64",
    "ned_elevation_rad": "float64",
}
#: An extra too, recorded behind all other columns.
CUED = {"cued": "bool"}
#: The ownship's pose as it believes it to be: columns of ``detections``, and fields of
#: `Detections`.
POSE = {
    "own_lat_deg": "float64",
    "own_lon_deg": "float64",
    "own_alt_m": "float64",
    "own_heading_rad": "float64",
    "own_pitch_rad": "float64",
    "own_roll_rad": "float64",
}

#: The ownship's velocity over ground, north, east and down of its own place: columns of
#: ``detections``, and what `Detections.own_velocity` holds.
OWN_VELOCITY = {
    "own_velocity_north_m_s": "float64",
    "own_velocity_east_m_s": "float64",
    "own_velocity_down_m_s": "float64",
}

#: Columns of `Detections` that need not be given: NaN, not measured, where they are not.
MEASURED = (
    "range_rate_m_s",
    "azimuth_variance_rad2",
    "elevation_variance_rad2",
    "range_variance_m2",
    "range_rate_variance_m2_s2",
)


@dataclass(frozen=True)
class LastingPart:
    """An error that is forgotten with a time constant.

    Parameters
    ----------
    variance : float
    lasts_s : float
        Infinite for what stays the same throughout a run.
    across_m2 : float
        Variance of a place across the line of sight: that of an angle is it over the range squared.
    """

    variance: float = 0.0
    lasts_s: float = math.inf
    across_m2: float = 0.0


@dataclass(frozen=True)
class LastingError:
    """What of a quantity's error is not new at every look; all parts are in its variance.

    Parameters
    ----------
    step : float
        Of the grid to which the quantity is rounded; 0 for none.
    parts : tuple of LastingPart
    """

    step: float = 0.0
    parts: tuple[LastingPart, ...] = ()


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
        Whether range rates beyond what is unambiguous are told as ones within.
    reach : Reach or None
        Where it looks, in the ownship's body axes; None where it does not say.
    lasting : mapping of LastingError, or None
        What of its errors lasts from look to look, by quantity (``azimuth``, ``elevation``,
        ``range``, ``range_rate``), those without are new at every look; None where it does not say.
    clock : callable or None
        Returns when it looks. Asked only where it matters, and no part of the word that replicas
        compare: whoever reads clocks that differ cannot be shared by them.
    latest_s, jitter_s : Fraction
        How late its looks come at most to whom a fusion offers them, and how much of that is by
        chance; None where nobody says.
    unforeseen : bool
        Whether they may come later still, as they queue.
    untold_across_m2 : float
        Variance of the ownship's own place across the line of sight that its angles' variances
        leave out, as it knows no range: who knows one adds it over the range squared.
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
    lasting: Mapping[str, LastingError] | None = None
    clock: Callable[[], ClockSpec] | None = field(default=None, compare=False)
    latest_s: Fraction | None = None
    jitter_s: Fraction = Fraction(0)
    unforeseen: bool = False
    untold_across_m2: float = 0.0


def target_names(message: Any) -> Text:
    """Return the names of a message's targets, entry by entry."""
    return Text(message.target, message.roster.names)


def measured_column() -> Any:
    """Declare one of the columns `MEASURED`."""
    return per_entry(column="float64", default=None, kw_only=True)


def fill_measured(message: Any) -> None:
    """Let columns `MEASURED` that a message was not given be those of nothing measured."""
    for name in MEASURED:
        if getattr(message, name) is None:
            setattr(message, name, not_measured(len(message.target)))


@dataclass(eq=False)
class Detections(Message):
    """What one sensor reports, scan by scan.

    Parameters
    ----------
    scan : (rows,)
        Scan number of the sensor's clock.
    evaluated : (rows,)
        Targets whose physics was evaluated.
    skipped : dict of (rows,)
        Targets that were not, by reason.
    offsets : (rows + 1,)
        Entries ``offsets[i]:offsets[i + 1]`` belong to row i.
    target : (entries,) of int
        Index into the roster.
    azimuth_rad, elevation_rad : (entries,)
        Measured, in the ownship's body axes, on the sensor's grid.
    range_m : (entries,)
        Measured slant range; NaN for a sensor that has none.
    range_rate_m_s : (entries,)
        Measured rate of the slant range, positive when it opens; NaN where it is not measured.
    azimuth_variance_rad2, elevation_variance_rad2 : (entries,)
        Mean square of the error of the measured angles, in body axes, as the sensor states it: a
        grid's is step²/12. The cut at the edge of the field of view is not in it. Where the
        ownship's navigation has noise, that of the pose they are turned by is.
    range_variance_m2, range_rate_variance_m2_s2 : (entries,)
        The same of range and range rate; NaN where they are not measured. A range's has that of
        the place it is counted from.
    confidence : (entries,)
        Margin of the detection; its unit is the sensor's (dB for radar, signature for optics).
    true_azimuth_rad, true_elevation_rad, true_range_m : (entries,)
    extras : dict of (entries,)
        Only those in `EXTRAS` are recorded; a subclass may declare more.
        What the decision rested on, where a sensor has such a thing: ``snr_db``,
        ``detection_probability``, ``pixels``; and ``declared``, whether the target has enough
        detections to be declared (recorded as true where no rule is in force). A sweeping radar
        has ``illuminated_s``, when its beam passed; all of the entry is of that instant. A sensor
        that is cued has ``cued``, whether the target lay in a cone. Where the
        ownship's navigation errs, there is the line of sight in NED by what it believes of its
        attitude, ``ned_azimuth_rad`` and ``ned_elevation_rad``.
    own_lat_deg, own_lon_deg, own_alt_m : (rows,), or None
        Where the ownship believes to be at each scan (WGS 84); the truth where its navigation has
        no error. None from a sensor that does not say; recorded with every detection.
    own_heading_rad, own_pitch_rad, own_roll_rad : (rows,), or None
        How it believes to be turned, NED to body (yaw-pitch-roll).
    own_of_entries : dict of (entries,), or None
        The same six where entries were measured at instants of their own within the scan;
        `pose_columns` gives those of every entry in any case.
    own_velocity : dict of (entries,), or None
        How the ownship moved at each entry (`OWN_VELOCITY`), where a sensor measures range rates.
    ticks_after : (entries,) of int, or None
        How long after its row's tick each entry was measured, where that differs: a beam that
        sweeps. `measured_ticks` gives the instants in any case.
    looks : dict of (rows, targets), or None
        Every look at every target (`components.messages.every_look`), where they are recorded.
    roster : Roster
    """

    row_table = "scans"
    described = DESCRIBED
    entry_table = "detections"
    may_hold = frozenset({"looks"})

    scan: IntArray = per_row(column="int64", in_entries=True)
    evaluated: IntArray = per_row(column="int64")
    offsets: IntArray = per_row(
        column="int64", name="detected", value=lambda message: np.diff(message.offsets)
    )
    skipped: dict[str, IntArray] = per_row(columns=_SKIPPED, value=lambda m: m.skipped_columns())
    target: IntArray = per_entry(column="text", value=target_names)
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    range_m: FloatArray = per_entry(column="float64")
    confidence: FloatArray = per_entry(column="float64")
    true_azimuth_rad: FloatArray = per_entry(column="float64")
    true_elevation_rad: FloatArray = per_entry(column="float64")
    true_range_m: FloatArray = per_entry(column="float64")
    extras: dict[str, AnyArray] = per_entry(columns=EXTRAS, value=lambda m: m.extra_columns())
    roster: Roster = static()
    own_lat_deg: FloatArray | None = per_row(default=None, kw_only=True)
    own_lon_deg: FloatArray | None = per_row(default=None, kw_only=True)
    own_alt_m: FloatArray | None = per_row(default=None, kw_only=True)
    own_heading_rad: FloatArray | None = per_row(default=None, kw_only=True)
    own_pitch_rad: FloatArray | None = per_row(default=None, kw_only=True)
    own_roll_rad: FloatArray | None = per_row(default=None, kw_only=True)
    own_of_entries: dict[str, FloatArray] | None = per_entry(
        columns=POSE, value=lambda m: m.pose_columns(), default=None, kw_only=True
    )
    range_rate_m_s: FloatArray = measured_column()
    azimuth_variance_rad2: FloatArray = measured_column()
    elevation_variance_rad2: FloatArray = measured_column()
    range_variance_m2: FloatArray = measured_column()
    range_rate_variance_m2_s2: FloatArray = measured_column()
    own_velocity: dict[str, FloatArray] | None = per_entry(
        columns=OWN_VELOCITY, value=lambda m: m.own_velocity or {}, default=None, kw_only=True
    )
    cued_of_entries: dict[str, AnyArray] | None = per_entry(
        columns=CUED, value=lambda m: m.cued_column(), default=None, kw_only=True
    )
    ticks_after: IntArray | None = per_entry(default=None, kw_only=True)
    looks: dict[str, AnyArray] | None = per_row(default=None, kw_only=True)

    def tables(self) -> dict[str, Columns]:
        """Return what is recorded: with the looks, where they are asked for."""
        tables = super().tables()
        return tables if self.looks is None else {**tables, "looks": look_columns(self)}

    def __post_init__(self) -> None:
        fill_measured(self)

    def skipped_columns(self) -> dict[str, IntArray]:
        """Return how many targets were skipped, by column."""
        return {f"skipped_{reason}": count for reason, count in self.skipped.items()}

    def extra_columns(self) -> dict[str, AnyArray]:
        """Return the extras with ``declared``, which all detections have."""
        # A sensor without a rule declares whatever it reports: it knows of no false alarm.
        extras = {name: values for name, values in self.extras.items() if name not in CUED}
        return {"declared": np.ones(len(self.target), dtype=bool), **extras}

    def cued_column(self) -> dict[str, AnyArray]:
        """Return the extra that says whether each lay in a cue cone, where the sensor says so."""
        return {name: self.extras[name] for name in CUED if name in self.extras}

    def pose_columns(self) -> dict[str, FloatArray]:
        """Return the ownship's believed pose at each entry, by column; empty where none is told."""
        if self.own_of_entries is not None:
            return self.own_of_entries
        counts = np.diff(self.offsets)
        pose = {name: getattr(self, name) for name in POSE}
        return {n: np.repeat(v, counts) for n, v in pose.items() if v is not None}

    def measured_ticks(self) -> IntArray:
        """Return the instant at which each entry was measured."""
        ticks = np.repeat(self.tick, np.diff(self.offsets))
        return ticks if self.ticks_after is None else ticks + self.ticks_after
