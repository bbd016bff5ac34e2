"""Messages of and after the sensors: detections, fused lines of sight, tracks.

All messages hold rows (one per scan, see `dsa_des.block.message`). Angles are in radians; azimuth
is clockwise and elevation upward.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import DESCRIBED
from components.messages.constant_columns import not_measured
from components.messages.every_look import look_columns
from components.messages.looks import Looks
from components.messages.reach import Reach
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.message import Columns, Message, Text, per_entry, per_entry_tick, per_row, static

_BITS_OF_INT64 = 63
_COUNTED_BITS = 12


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

#: What a block that takes fused detections requests if the ownship's pose is nothing to it.
WITHOUT_POSE = "without pose"

#: Columns of `Detections` that need not be given: NaN, not measured, where they are not.
MEASURED = (
    "range_rate_m_s",
    "azimuth_variance_rad2",
    "elevation_variance_rad2",
    "range_variance_m2",
    "range_rate_variance_m2_s2",
)


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


def _target_names(message: Any) -> Text:
    return Text(message.target, message.roster.names)


def _contributor_names(message: Any) -> Text:
    return combination_text(message.contributors, message.sensors)


def _measured() -> Any:
    return per_entry(column="float64", default=None, kw_only=True)


def _fill_measured(message: Any) -> None:
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
        grid's is step²/12. The cut at the edge of the field of view is not in it.
    range_variance_m2, range_rate_variance_m2_s2 : (entries,)
        The same of range and range rate; NaN where they are not measured.
    confidence : (entries,)
        Margin of the detection; its unit is the sensor's (dB for radar, signature for optics).
    true_azimuth_rad, true_elevation_rad, true_range_m : (entries,)
    extras : dict of (entries,)
        Only those in `EXTRAS` are recorded; a subclass may declare more.
        What the decision rested on, where a sensor has such a thing: ``snr_db``,
        ``detection_probability``, ``pixels``; and ``declared``, whether the target has enough
        detections to be declared (recorded as true where no rule is in force). A sweeping radar
        has ``illuminated_s``, when its beam passed; all of the entry is of that instant. Where the
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

    scan: IntArray = per_row(column="int64", in_entries=True)
    evaluated: IntArray = per_row(column="int64")
    offsets: IntArray = per_row(
        column="int64", name="detected", value=lambda message: np.diff(message.offsets)
    )
    skipped: dict[str, IntArray] = per_row(columns=_SKIPPED, value=lambda m: m.skipped_columns())
    target: IntArray = per_entry(column="text", value=_target_names)
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
    range_rate_m_s: FloatArray = _measured()
    azimuth_variance_rad2: FloatArray = _measured()
    elevation_variance_rad2: FloatArray = _measured()
    range_variance_m2: FloatArray = _measured()
    range_rate_variance_m2_s2: FloatArray = _measured()
    own_velocity: dict[str, FloatArray] | None = per_entry(
        columns=OWN_VELOCITY, value=lambda m: m.own_velocity or {}, default=None, kw_only=True
    )
    ticks_after: IntArray | None = per_entry(default=None, kw_only=True)
    looks: dict[str, AnyArray] | None = per_row(default=None, kw_only=True)

    def tables(self) -> dict[str, Columns]:
        """Return what is recorded: with the looks, where they are asked for."""
        tables = super().tables()
        return tables if self.looks is None else {**tables, "looks": look_columns(self)}

    def __post_init__(self) -> None:
        _fill_measured(self)

    def skipped_columns(self) -> dict[str, IntArray]:
        """Return how many targets were skipped, by column."""
        return {f"skipped_{reason}": count for reason, count in self.skipped.items()}

    def extra_columns(self) -> dict[str, AnyArray]:
        """Return the extras with ``declared``, which all detections have."""
        # A sensor without a rule declares whatever it reports: it knows of no false alarm.
        return {"declared": np.ones(len(self.target), dtype=bool), **self.extras}

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


@dataclass(eq=False)
class FusedDetections(Message):
    """One line of sight per target and instant, put together from the sensors.

    Parameters
    ----------
    offsets : (rows + 1,)
    target : (entries,) of int
    azimuth_rad, elevation_rad : (entries,)
        In the ownship's body axes.
    range_m : (entries,)
        NaN when no contributing sensor measures range.
    contributors : (entries,) of int
        Bit i is set when ``sensors[i]`` contributed; of the type `mask_type` gives.
    angle_source, range_source : (entries,) of int
        Index into `sensors`; -1 for none.
    true_azimuth_rad, true_elevation_rad, true_range_m : (entries,)
    measured_tick : (entries,) of int
        When the angles were measured, whenever that came here: pose, variances of the angles and
        everything true are of this instant. By default that of the row.
    own_of_entries : dict of (entries,), or None
        The ownship's pose as it believed it to be then, by column (`POSE`); None where nobody asks.
    range_rate_m_s, azimuth_variance_rad2, elevation_variance_rad2, range_variance_m2, \
    range_rate_variance_m2_s2 : (entries,)
        As the sensors that gave the values stated them; NaN where they did not.
    own_velocity : dict of (entries,), or None
        How the ownship moved (`OWN_VELOCITY`) when the range rate was
        measured; NaN where none was, None from a fusion of sensors that measure none.
    looks : Looks or None
        Which sensors looked when, also in vain; None from a fusion that does not say.
    roster : Roster
    sensors : tuple of str
        Those with range first, each group by name.
    """

    described = DESCRIBED
    entry_table = "fused"

    offsets: IntArray
    target: IntArray = per_entry(column="text", value=_target_names)
    contributors: IntArray = per_entry(column="text", name="sensors", value=_contributor_names)
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    range_m: FloatArray = per_entry(column="float64")
    angle_source: IntArray = per_entry(
        column="text", value=lambda message: Text(message.angle_source, message.sensors)
    )
    range_source: IntArray = per_entry(
        column="text", value=lambda message: Text(message.range_source, message.sensors)
    )
    true_azimuth_rad: FloatArray = per_entry(column="float64")
    true_elevation_rad: FloatArray = per_entry(column="float64")
    true_range_m: FloatArray = per_entry(column="float64")
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = per_entry_tick(name="measured_s", default=None, kw_only=True)
    ticks_per_s: int = static(default=10**9, kw_only=True)
    own_of_entries: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    range_rate_m_s: FloatArray = _measured()
    azimuth_variance_rad2: FloatArray = _measured()
    elevation_variance_rad2: FloatArray = _measured()
    range_variance_m2: FloatArray = _measured()
    range_rate_variance_m2_s2: FloatArray = _measured()
    own_velocity: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    looks: Looks | None = per_row(default=None, kw_only=True)

    def __post_init__(self) -> None:
        _fill_measured(self)
        if self.measured_tick is None:
            self.measured_tick = np.repeat(self.tick, np.diff(self.offsets))

    def pose_columns(self) -> dict[str, FloatArray]:
        """Return the ownship's believed pose at each entry, by column; empty where none is told."""
        return self.own_of_entries or {}


@dataclass(eq=False)
class FusedWithPose(FusedDetections):
    """The same where navigation errs: the ownship's believed pose is recorded beside each line."""

    own_of_entries: dict[str, FloatArray] | None = per_entry(
        columns=POSE, value=lambda m: m.pose_columns(), default=None, kw_only=True
    )


@dataclass(eq=False)
class Tracks(Message):
    """What a tracker holds of each target, at each instant it was updated.

    Parameters
    ----------
    offsets : (rows + 1,)
    target : (entries,) of int
    azimuth_rad, elevation_rad, range_m : (entries,)
        Held measurement, ownship's body axes; range NaN when it had none.
    age_s : (entries,)
        Time since what is held was measured.
    contributors : (entries,) of int
        Sensors of the last update, as in `FusedDetections`.
    roster : Roster
    sensors : tuple of str
    measured_tick : (entries,) of int
        When it was measured. By default the row's tick.
    updated : (entries,) of bool
        Whether it came at this row's instant; others were held. By default what has no age.
    """

    described = DESCRIBED
    entry_table = "tracks"

    offsets: IntArray
    target: IntArray = per_entry(column="text", value=_target_names)
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    range_m: FloatArray = per_entry(column="float64")
    age_s: FloatArray = per_entry(column="float64")
    contributors: IntArray = per_entry(column="text", name="updated_by", value=_contributor_names)
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = per_entry_tick(name="measured_s", default=None, kw_only=True)
    ticks_per_s: int = static(default=10**9, kw_only=True)
    updated: BoolArray = per_entry(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.measured_tick is None:
            self.measured_tick = np.repeat(self.tick, np.diff(self.offsets))
        if self.updated is None:
            self.updated = self.age_s <= 0.0

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without tracks; the scene's table must be empty."""
        if values:
            raise ValueError("tracks before the first message can only be an empty table, {}")
        none, zero = np.empty(0), np.empty(0, dtype=np.int64)
        offsets = np.zeros(2, dtype=np.int64)
        return cls(
            np.zeros(1, dtype=np.int64), offsets, zero, none, none, none, none, zero,
            Roster.of([]), (),
        )  # fmt: skip


@dataclass(eq=False)
class TracksWithPose(Tracks):
    """The same where navigation errs.

    Parameters
    ----------
    own_of_entries : dict of (entries,)
        The ownship's pose as it believed it to be when what is held was measured.
    """

    own_of_entries: dict[str, FloatArray] = per_entry(columns=POSE, kw_only=True)


def mask_type(sensors: int) -> type:
    """Return the NumPy type of masks with a bit for each sensor.

    Beyond 63 sensors masks are Python's integers, which hold any number of bits.
    """
    return np.int64 if sensors <= _BITS_OF_INT64 else object


def combination_text(contributors: IntArray, sensors: tuple[str, ...]) -> Text:
    """Return the names behind bit masks, joined by ``+``."""
    if len(sensors) <= _COUNTED_BITS:  # counting was measured to be the fastest
        used = np.bincount(contributors, minlength=1)
        masks = np.flatnonzero(used)
        codes = (np.cumsum(used > 0) - 1).take(contributors)
    else:
        masks, codes = np.unique(contributors, return_inverse=True)
    names = tuple("+".join(_names_in(int(mask), sensors)) for mask in masks)
    return Text(codes, names)


def _names_in(mask: int, sensors: tuple[str, ...]) -> list[str]:
    return [name for i, name in enumerate(sensors) if mask >> i & 1]
