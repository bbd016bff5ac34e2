"""Messages from the traffic to the sensors: where the aircraft are.

All messages hold rows (one per scan, see `dsa_des.block.message`). Angles are in radians; azimuth
is clockwise and elevation upward.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from components.aircraft.aircraft import Roster
from components.geometry import (
    POSE_FIELDS,
    POSITION_FIELDS,
    TrajectoryState,
    line_of_sight_ned,
)
from components.messages.columns import OWN_NED, TURNED, WGS84
from components.messages.known_flights import KnownFlights
from components.messages.reach import Decision
from dsa_des.arrays.run_ticks import is_shared_single_run
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.message import Column, Columns, Message, Text, per_row, static

#: Half of the time over which positions are compared for a velocity; a power of two, so that
#: times differ by it exactly.
STEP_S = 1.0 / 1024.0
# The same of the ownship's, as those measure who measure range rates.
_OWN_STEP_S = 1.0 / 64.0
# Aircraft and instants worked on together.
_AT_ONCE = 16384

_TURNED = {"yaw_rad": "heading_rad", "pitch_rad": "pitch_rad", "roll_rad": "roll_rad"}
_VELOCITY = ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")
_NUMBERS = (*POSITION_FIELDS, *_VELOCITY, *_TURNED.values())


@dataclass(eq=False)
class TrueStates(Message):
    """What a traffic block records where the truth is asked for; it goes over no wire."""

    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = {
        "truth": {
            "target": Column("", "", "name of the target; null for the ownship", "text"),
            "lat_deg": Column("deg", WGS84, "latitude"),
            "lon_deg": Column("deg", WGS84, "longitude"),
            "alt_m": Column("m", WGS84, "height above the ellipsoid"),
            "velocity_north_m_s": Column("m/s", OWN_NED, "velocity over ground, north"),
            "velocity_east_m_s": Column("m/s", OWN_NED, "east"),
            "velocity_down_m_s": Column("m/s", OWN_NED, "down"),
            "heading_rad": Column("rad", TURNED, "where the nose points, from north"),
            "pitch_rad": Column("rad", TURNED, "pitch, nose up"),
            "roll_rad": Column("rad", TURNED, "roll, right wing down"),
        }
    }


def truth_columns(states: Any) -> Columns:
    """Return the recorded truth: a row each for ownship and present targets at every instant.

    At each instant the ownship first (its ``target`` is null), then the targets as the roster has
    them, whatever the arrays of `states` hold. Velocities are those of the path in the aircraft's
    own NED frame, from positions 1/1024 s before and after: good to 1e-5 m/s where the path has no
    kink in between, by which they are the mean of both sides. Where an aircraft comes or goes, two
    positions on the one side stand in for them.
    """
    count = len(states.roster)
    step = max(1, _AT_ONCE // (1 + count))
    parts = [
        _truth_of_rows(
            states.true_flights.take_rows(rows), states.tick[rows], states.run_time_s[rows], count
        )
        for rows in (slice(i, i + step) for i in range(0, len(states), step))
    ]
    columns: Columns = {
        name: np.concatenate([part[name] for part in parts]) for name in ("tick", *_NUMBERS)
    }
    if not is_shared_single_run(states.run):
        counts = np.concatenate([part["counts"] for part in parts])
        columns["replica"] = np.repeat(states.run, counts)
    who = np.concatenate([part["who"] for part in parts])
    columns["target"] = Text(who, states.roster.names)
    return columns


def _truth_of_rows(flights: Any, tick: IntArray, time_s: FloatArray, count: int) -> dict[str, Any]:
    columns, rows = np.arange(count), len(time_s)
    # All three instants are asked for at once.
    times_s = np.concatenate([time_s, time_s + STEP_S, time_s - STEP_S])
    asked = flights.take_rows(np.tile(np.arange(rows), 3))(columns, times_s[:, np.newaxis])
    states = _states_with_ownship_first(asked)
    state, after, before = (
        {name: values[first : first + rows] for name, values in states.items()}
        for first in (0, rows, 2 * rows)
    )
    velocity = _ned_velocities(flights, columns, time_s, state, after, before)
    row, column = np.nonzero(state["present"])
    return {
        "tick": tick[row],
        "counts": np.bincount(row, minlength=len(tick)),
        "who": column - 1,
        **{name: state[name][row, column] for name in POSITION_FIELDS},
        **{name: v[row, column] for name, v in zip(_VELOCITY, velocity, strict=True)},
        **{name: state[key][row, column] for key, name in _TURNED.items()},
    }


_State = dict[str, Any]


def _ned_velocities(
    flights: Any, columns: IntArray, time_s: FloatArray, here: _State, after: _State, before: _State
) -> list[FloatArray]:
    """Return velocities north, east, down of ownship and targets, each (rows, 1 + targets), m/s."""
    there_after, there_before = after["present"], before["present"]
    way_after, way_before = _ned_offsets(here, after), _ned_offsets(here, before)
    velocity = (way_after - way_before) / (2.0 * STEP_S)
    one_sided = here["present"] & ~(there_after & there_before)
    rows = np.flatnonzero(one_sided.any(axis=1))
    if len(rows):
        part = flights.take_rows(rows)
        here = {name: values[rows] for name, values in here.items()}
        for near, there, step_s in (
            (way_after, there_after, STEP_S),
            (way_before, there_before, -STEP_S),
        ):
            far = _states_with_ownship_first(
                part(columns, (time_s[rows] + 2.0 * step_s)[:, np.newaxis])
            )
            slope = (4.0 * near[:, rows] - _ned_offsets(here, far)) / (2.0 * step_s)
            fits = one_sided[rows] & there[rows] & far["present"]
            velocity[:, rows] = np.where(fits, slope, velocity[:, rows])
            one_sided[rows] &= ~fits
        velocity[:, one_sided] = np.nan
    return list(velocity)


def _ned_offsets(here: _State, there: _State) -> FloatArray:
    """Return the positions in `there` relative to those in `here`: north, east and down, m."""
    ends = [*(here[name] for name in POSITION_FIELDS), *(there[name] for name in POSITION_FIELDS)]
    return np.stack(line_of_sight_ned(*ends, validate=False))


def _states_with_ownship_first(states: Any) -> dict[str, Any]:
    """Return the ownship's states (rows, 1) and the targets' (rows, n) side by side."""
    own, others = states
    return {
        name: np.concatenate([getattr(own, name), getattr(others, name)], axis=1)
        for name in (*POSITION_FIELDS, *_TURNED, "present")
    }


@dataclass(eq=False)
class TrafficStates(Message):
    """Where the ownship and all other aircraft are, and how they are turned.

    Parameters
    ----------
    own_lat_deg, own_lon_deg, own_alt_m, own_yaw_rad, own_pitch_rad, own_roll_rad : (rows,)
        WGS-84 geodetic position and NED-to-body attitude (yaw-pitch-roll) of the ownship.
    lat_deg, lon_deg, alt_m, yaw_rad, pitch_rad, roll_rad : (rows, targets)
    present : (rows, targets) of bool
        Whether both the ownship and the target are there; the other fields are finite anyway.
    roster : Roster
        What all targets of the run are.
    columns : (targets,) of int
        Which of them the arrays hold, ascending; the others are out of all sensors' reach.
    culled : (rows,) of int, or None
        How many of the roster are out of all sensors' reach at each instant; those among the
        columns are not `present`. None where all are moved.
    present_to : dict of (rows, targets) of bool, or None
        The same of other platforms by their names, where the ownship is in the place of that one.
    culled_to : dict of (rows,) of int, or None
        And how many are out of reach of what these carry.
    flights : KnownFlights or None
        The flights as each row knows them, for a beam that sweeps: it must know them at other
        instants. None where no block does.
    true_flights : KnownFlights or None
        The same for all targets, near or far, where the truth is recorded.
    run_time_s : (rows,) or None
        The instants since the start of the run, beside them.
    """

    own_lat_deg: FloatArray
    own_lon_deg: FloatArray
    own_alt_m: FloatArray
    own_yaw_rad: FloatArray
    own_pitch_rad: FloatArray
    own_roll_rad: FloatArray
    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    yaw_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray
    present: BoolArray
    roster: Roster = static()
    columns: IntArray = static()
    culled: IntArray | None = per_row(default=None, kw_only=True)
    present_to: dict[str, BoolArray] | None = per_row(default=None, kw_only=True)
    culled_to: dict[str, IntArray | None] | None = per_row(default=None, kw_only=True)
    flights: KnownFlights | None = per_row(default=None, kw_only=True)
    true_flights: KnownFlights | None = per_row(default=None, kw_only=True)
    run_time_s: FloatArray | None = per_row(default=None, kw_only=True)

    joins_static = frozenset({"columns"})
    may_hold = frozenset({"truth"})

    @classmethod
    def of(cls, tick: IntArray, own: TrajectoryState, others: TrajectoryState, **more: Any) -> Self:
        """Return the message of what an ownship and others fly; `more` are its other fields."""
        return cls(
            tick=tick,
            **{f"own_{name}": getattr(own, name) for name in POSE_FIELDS},
            **{name: getattr(others, name) for name in POSE_FIELDS},
            **more,
        )

    def seen_from(self, platform: str) -> Self:
        """Return the states seen from another platform, which swaps places with the ownship."""
        if platform == self.roster.own_name:
            return self
        target = self.roster.names.index(platform)
        place = int(np.searchsorted(self.columns, target))
        seen = self._copy()
        for name in POSE_FIELDS:
            values = getattr(self, name).copy()
            setattr(seen, f"own_{name}", values[:, place].copy())
            values[:, place] = getattr(self, f"own_{name}")
            setattr(seen, name, values)
        assert self.present_to is not None and self.culled_to is not None
        seen.present, seen.culled = self.present_to[platform], self.culled_to[platform]
        seen.roster = self.roster.seen_from(target)
        seen.present_to = seen.culled_to = seen.true_flights = None
        if self.flights is not None:
            seen.flights = self.flights.seen_from(target)
        return seen

    def check(self) -> None:
        """Raise ValueError if an array over targets has not one column for each target."""
        super().check()
        check_target_count(self)

    def tables(self) -> dict[str, Columns]:
        """Return the table ``truth`` if the truth is recorded; else an empty mapping."""
        return {} if self.true_flights is None else {"truth": truth_columns(self)}

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return one message with the rows of all parts, over the union of their targets."""
        return super().concatenate(widen_to_union_of_targets(parts))


@dataclass(eq=False)
class RelativeTargets(Message):
    """The targets as seen from the ownship.

    Parameters
    ----------
    azimuth_rad, elevation_rad, range_m : (rows, targets)
        Line of sight in the ownship's NED frame; azimuth in [0, 2 pi).
    body_azimuth_rad, body_elevation_rad : (rows, targets)
        The thesis's p and q: line of sight in the ownship's body axes; p in (-pi, pi].
    relative_heading_rad : (rows, targets)
        Target's heading minus bearing of the line of sight: 0 when it flies away from us.
    own_alt_m, alt_m : (rows,) and (rows, targets)
        Altitudes above the ellipsoid, for what changes with height.
    own_lat_deg, own_lon_deg : (rows,), or None
        Where the ownship truly is, for weather; None from a block that does not say.
    roster, columns, culled, present
        As in `TrafficStates`.
    believed : dict of (rows,), or None
        What the ownship believes of itself: ``lat_deg``, ``lon_deg``, ``alt_m``, ``yaw_rad``,
        ``pitch_rad``, ``roll_rad``; the truth where its navigation has no error. None from a
        block that does not say.
    own_attitude : dict of (rows,), or None
        How the ownship is truly turned: ``yaw_rad``, ``pitch_rad``, ``roll_rad``, NED to body; for
        what is not a target. None from a block that does not say.
    revisit : KnownFlights or None
        The targets at other instants than those of the rows, as each row knows their flights.
    hidden : (rows, targets) of bool, or None
        Whether the Earth or its ground stands before the target; None where neither is there.
    state_tick : (rows,) of int, or None
        The instant at which the aircraft were there: earlier than `tick` where the traffic's
        message took its time. None where it is `tick`.
    """

    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    range_m: FloatArray
    body_azimuth_rad: FloatArray
    body_elevation_rad: FloatArray
    relative_heading_rad: FloatArray
    target_pitch_rad: FloatArray
    target_roll_rad: FloatArray
    own_alt_m: FloatArray
    alt_m: FloatArray
    present: BoolArray
    roster: Roster = static()
    columns: IntArray = static()
    culled: IntArray | None = per_row(default=None, kw_only=True)
    believed: dict[str, FloatArray] | None = per_row(default=None, kw_only=True)
    own_attitude: dict[str, FloatArray] | None = per_row(default=None, kw_only=True)
    revisit: KnownFlights | None = per_row(default=None, kw_only=True)
    state_tick: IntArray | None = per_row(default=None, kw_only=True)
    hidden: BoolArray | None = per_row(default=None, kw_only=True)
    own_lat_deg: FloatArray | None = per_row(default=None, kw_only=True)
    own_lon_deg: FloatArray | None = per_row(default=None, kw_only=True)

    joins_static = frozenset({"columns"})

    @property
    def position_ticks(self) -> IntArray:
        """Tick at which the aircraft had the positions in each row, (rows,)."""
        return self.tick if self.state_tick is None else self.state_tick

    def check(self) -> None:
        """Raise ValueError if an array over targets has not one column for each target."""
        super().check()
        check_target_count(self)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return one message with the rows of all parts, over the union of their targets."""
        return super().concatenate(widen_to_union_of_targets(parts))


@dataclass(eq=False)
class GatedTargets(RelativeTargets):
    """Relative targets, with each sensor's decision which it skips, by name (thesis §3.4)."""

    decisions: dict[str, Decision] = per_row()


def check_target_count(message: Any) -> None:
    """Raise ValueError unless the arrays over targets have as many columns as there are targets."""
    count = len(message.columns)
    for name, values in vars(message).items():
        if values.__class__ is np.ndarray and values.ndim == 2 and values.shape[1] != count:
            raise ValueError(
                f"{type(message).__qualname__}.{name} has shape {values.shape} where the message "
                f"has {count} targets"
            )


def widen_to_union_of_targets(parts: Sequence[Any]) -> list[Any]:
    """Return messages widened to the union of their targets; added ones are not present."""
    first = parts[0].columns
    if all(part.columns is first or np.array_equal(part.columns, first) for part in parts):
        return list(parts)
    columns = np.unique(np.concatenate([part.columns for part in parts]))
    return [_widen(part, columns) for part in parts]


def _widen(part: Any, columns: IntArray) -> Any:
    index = np.searchsorted(columns, part.columns)
    result = copy(part)

    def widened(values: AnyArray) -> AnyArray:
        wide = np.zeros((len(values), len(columns)), dtype=values.dtype)
        wide[:, index] = values
        return wide

    for name, values in vars(part).items():
        if isinstance(values, np.ndarray) and values.ndim == 2:
            setattr(result, name, widened(values))
    if getattr(part, "present_to", None):
        result.present_to = {name: widened(there) for name, there in part.present_to.items()}
    if isinstance(part, GatedTargets):
        result.decisions = {
            sensor: decision.widen(index, len(columns))
            for sensor, decision in part.decisions.items()
        }
    result.columns = columns
    return result


def own_velocity_ned_m_s(targets: RelativeTargets, row: IntArray, time_s: FloatArray) -> FloatArray:
    """Return the ownship's ground velocity (north, east, down) at rows and times, (3, n), m/s.

    From positions 1/64 s before and after, of which one is replaced by the position itself where
    the flight begins or ends between; NaN where no flights are known.
    """
    if targets.revisit is None or not len(targets.roster) or not len(row):
        return np.full((3, len(row)), np.nan)
    at_s = np.concatenate([time_s, time_s - _OWN_STEP_S, time_s + _OWN_STEP_S])
    own = targets.revisit.viewer_states(np.tile(row, 3), at_s)
    place = [getattr(own, name) for name in POSITION_FIELDS]
    here = [np.tile(values[: len(row)], 2) for values in place]
    there = own.present[len(row) :]
    way = np.stack(line_of_sight_ned(*here, *(v[len(row) :] for v in place), validate=False))
    before, after = np.hsplit(np.where(there, way, 0.0), 2)
    span_s = np.where(there, _OWN_STEP_S, 0.0).reshape(2, -1).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((after - before) / span_s)
