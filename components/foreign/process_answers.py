"""Messages out of the tables that a program answers, and all that is wrong with those."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from components.aircraft.aircraft import Roster
from components.estimation.measurement import azimuth_elevation_and_variances
from components.foreign.reported_look import detections_of_reports
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import (
    CONFIRMED,
    COVARIANCE,
    EXTRAS,
    STATUSES,
    StateTracks,
    covariance_matrices,
)
from components.messages.steering import Manoeuvres
from components.messages.tracks import Tracks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message
from dsa_des.errors import did_you_mean

_LINE = ("azimuth_rad", "elevation_rad", "range_m")
_DIRECTION = (
    "azimuth_rad", "elevation_rad", "azimuth_variance_rad2", "elevation_variance_rad2"
)  # fmt: skip
#: The tables that a program may answer, and the columns that each needs.
NEEDED: Mapping[str, tuple[str, ...]] = {
    "manoeuvres": ("turn_rad", "rate_rad_s"),
    "detections": _LINE[:2],
    "tracks": ("target", *_LINE),
    "state_tracks": ("track", *STATE, *COVARIANCE.values(), *ORIGIN, *OWN_POSITION),
}
_TEXTS = ("target", "track_status", "block", "contributors", "updated_by")


def message_of_table(
    name: str, table: Any, tick: IntArray, roster: Roster, block: str, ticks_per_s: int
) -> Message:
    """Return the message that a table of the program's answer describes.

    Parameters
    ----------
    name : str
        Of the table; one of `NEEDED`.
    table : pyarrow.Table
    tick : (1,) of int
        The instant of the call.
    roster : Roster
        The targets that it may name.
    block : str
        Who it comes from.
    ticks_per_s : int

    Raises
    ------
    ValueError
        If a column is missing, or holds what it cannot.
    """
    if name not in NEEDED:
        raise ValueError(f"no such table is known{did_you_mean(name, NEEDED)}")
    for column in NEEDED[name]:
        if column not in table.column_names:
            hint = did_you_mean(column, table.column_names)
            raise ValueError(f"there is no column {column!r}{hint}")
    numbers = {c: _numbers(table, c) for c in table.column_names if c not in _TEXTS}
    count = table.num_rows
    if name == "manoeuvres":
        return _manoeuvres(numbers, tick, count)
    if name == "state_tracks":
        return _state_tracks(numbers, table, tick, block, ticks_per_s)
    target = _target_indices(table, roster)
    if name == "detections":
        looks = {n: v[:1] if count else np.full(1, np.nan) for n, v in numbers.items()
                 if n.startswith("own_")}  # fmt: skip
        scan = np.full(1, -1, dtype=np.int64)
        return detections_of_reports(
            tick, scan, np.array([0, count]), numbers, looks, target, roster
        )
    return Tracks(
        tick=tick, offsets=np.array([0, count]), target=target,
        **{column: numbers[column] for column in _LINE},
        age_s=numbers.get("age_s", np.zeros(count)),
        contributors=np.zeros(count, dtype=np.int64), roster=roster, sensors=(),
        ticks_per_s=ticks_per_s,
    )  # fmt: skip


def _manoeuvres(numbers: Mapping[str, Any], tick: IntArray, count: int) -> Manoeuvres:
    known = [column for column in Manoeuvres.manoeuvre_field_names() if column in numbers]
    told = Manoeuvres(np.repeat(tick, count), **{column: numbers[column] for column in known})
    if not all(
        np.isfinite(getattr(told, column)).all() for column in Manoeuvres.manoeuvre_field_names()
    ):
        raise ValueError("finite numbers are needed")
    return told


def _state_tracks(
    numbers: Mapping[str, FloatArray], table: Any, tick: IntArray, block: str, ticks_per_s: int
) -> StateTracks:
    """Return tracks from a table of states; lacking directions are computed from the states."""
    count, now_s = table.num_rows, float(tick[0]) / ticks_per_s
    state = np.stack([numbers[name] for name in STATE])
    covariance = covariance_matrices(numbers, slice(None))
    ranged: BoolArray = np.asarray(np.isfinite(state).all(axis=0))
    for name in (*ORIGIN, *OWN_POSITION):
        if not np.isfinite(numbers[name]).all():
            raise ValueError(f"column {name!r}: finite numbers are needed")
    for (i, j), name in COVARIANCE.items():
        bad = ~np.isfinite(covariance[i, j]) | (covariance[i, j] < 0.0 if i == j else False)
        if (bad & ranged).any():
            what = "a variance of at least 0" if i == j else "a finite number"
            raise ValueError(f"column {name!r}: {what} is needed where there is a state")
    own = np.stack([numbers[name] for name in OWN_POSITION])
    with np.errstate(invalid="ignore"):
        line = azimuth_elevation_and_variances(state[:3] - own, covariance)
        seen: dict[str, Any] = dict(zip(_DIRECTION, line, strict=True))
    seen |= {name: np.where(ranged, seen[name], np.nan) for name in _DIRECTION}
    seen |= {name: numbers[name] for name in _DIRECTION if name in numbers}
    for name in _DIRECTION[:2]:
        if not np.isfinite(seen[name]).all():
            raise ValueError(f"column {name!r}: a track without a state needs a direction")
    seen["azimuth_rad"] = seen["azimuth_rad"] % (2.0 * np.pi)
    one = np.ones(count, dtype=np.int64)
    return StateTracks(
        tick=tick, offsets=np.array([0, count]), track=_checked_track_numbers(numbers["track"]),
        track_status=_statuses(table), existence=numbers.get("existence", np.ones(count)),
        has_range=ranged, age_s=numbers.get("age_s", np.zeros(count)),
        state_s=numbers.get("state_s", np.full(count, now_s)),
        updated_s=numbers.get("updated_s", np.full(count, now_s)),
        contributors=one, updated_by=one, sensors=(block,), **seen,
        **cast("dict[str, Any]", {n: numbers[n] for n in (*STATE, *ORIGIN, *OWN_POSITION)}),
        covariance={name: numbers[name] for name in COVARIANCE.values()},
        extras={name: numbers[name] for name in EXTRAS if name in numbers},
        nis=np.full(count, np.nan), nis_freedom=np.zeros(count, dtype=np.int64),
    )  # fmt: skip


def _checked_track_numbers(values: FloatArray) -> IntArray:
    if not ((values >= 1) & (values < 2**36) & (values == np.floor(values))).all():
        raise ValueError("column 'track': whole numbers from 1 are needed")
    numbers = values.astype(np.int64)
    if len(np.unique(numbers)) < len(numbers):
        raise ValueError("column 'track': each track is told once")
    return numbers


def _statuses(table: Any) -> IntArray:
    if "track_status" not in table.column_names:
        return np.full(table.num_rows, CONFIRMED, dtype=np.int64)
    said = table.column("track_status").to_pylist()
    for word in said:
        if word not in STATUSES:
            raise ValueError(
                f"track_status {word!r} is none of {', '.join(STATUSES)}"
                f"{did_you_mean(str(word), STATUSES)}"
            )
    return np.array([STATUSES.index(word) for word in said], dtype=np.int64)


def _numbers(table: Any, column: str) -> Any:
    import pyarrow as pa

    try:
        return table.column(column).combine_chunks().cast(pa.float64()).to_numpy(
            zero_copy_only=False
        ).copy()  # fmt: skip
    except pa.ArrowException:
        kind = table.column(column).type
        raise ValueError(f"column {column!r} is of {kind}: numbers are needed") from None


def _target_indices(table: Any, roster: Roster) -> IntArray:
    place = {name: number for number, name in enumerate(roster.names)}
    if "target" not in table.column_names:
        return np.full(table.num_rows, -1, dtype=np.int64)
    names = table.column("target").to_pylist()
    for name in names:
        if name is not None and name not in place:
            raise ValueError(f"target {name!r} is not in the scene{did_you_mean(str(name), place)}")
    return np.array([place.get(name, -1) for name in names], dtype=np.int64)
