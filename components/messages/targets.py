"""Messages from the traffic to the sensors: where the aircraft are.

All messages hold rows (one per scan, see `dsa_des.block.message`). Angles are in radians; azimuth
is clockwise and elevation upward.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from components.aircraft.aircraft import Roster
from components.geometry.state import TrajectoryState
from components.messages.known_flights import KnownFlights
from components.messages.reach import Decision
from components.messages.true_states import truth_columns
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Columns, Message, per_row, static


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
            own_lat_deg=own.lat_deg,
            own_lon_deg=own.lon_deg,
            own_alt_m=own.alt_m,
            own_yaw_rad=own.yaw_rad,
            own_pitch_rad=own.pitch_rad,
            own_roll_rad=own.roll_rad,
            lat_deg=others.lat_deg,
            lon_deg=others.lon_deg,
            alt_m=others.alt_m,
            yaw_rad=others.yaw_rad,
            pitch_rad=others.pitch_rad,
            roll_rad=others.roll_rad,
            **more,
        )

    def check(self) -> None:
        """Refuse arrays without a column for each of the targets, too."""
        super().check()
        check_columns(self)

    def tables(self) -> dict[str, Columns]:
        """Return the table of the truth where it is recorded."""
        return {} if self.true_flights is None else {"truth": truth_columns(self)}

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all parts, over the targets of any of them."""
        return super().concatenate(over_same_targets(parts))


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
    target_pitch_rad, target_roll_rad : (rows, targets)
    own_alt_m : (rows,)
    alt_m : (rows, targets)
        Altitudes above the ellipsoid, for what changes with height.
    present : (rows, targets) of bool
    roster : Roster
    columns : (targets,) of int
        Which targets of the roster the arrays hold.
    culled : (rows,) of int, or None
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
    state_tick: IntArray | None = per_row(is_tick=True, default=None, kw_only=True)
    hidden: BoolArray | None = per_row(default=None, kw_only=True)

    joins_static = frozenset({"columns"})

    def check(self) -> None:
        """Refuse arrays without a column for each of the targets, too."""
        super().check()
        check_columns(self)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all parts, over the targets of any of them."""
        return super().concatenate(over_same_targets(parts))


@dataclass(eq=False)
class GatedTargets(RelativeTargets):
    """Relative targets with the simulation decision for each sensor (thesis §3.4).

    Parameters
    ----------
    decisions : dict of Decision
        By sensor name.
    """

    decisions: dict[str, Decision] = per_row()


def check_columns(message: Any) -> None:
    """Raise ValueError unless the arrays over targets have as many columns as there are targets."""
    count = len(message.columns)
    for name, values in vars(message).items():
        if values.__class__ is np.ndarray and values.ndim == 2 and values.shape[1] != count:
            raise ValueError(
                f"{type(message).__qualname__}.{name} has shape {values.shape} where the message "
                f"has {count} targets"
            )


def over_same_targets(parts: Sequence[Any]) -> list[Any]:
    """Return messages widened to the union of their targets; added ones are not present."""
    first = parts[0].columns
    if all(part.columns is first or np.array_equal(part.columns, first) for part in parts):
        return list(parts)
    columns = np.unique(np.concatenate([part.columns for part in parts]))
    return [_widened(part, columns) for part in parts]


def _widened(part: Any, columns: IntArray) -> Any:
    place = np.searchsorted(columns, part.columns)
    result = copy(part)
    for name, values in vars(part).items():
        if isinstance(values, np.ndarray) and values.ndim == 2:
            wide = np.zeros((len(values), len(columns)), dtype=values.dtype)
            wide[:, place] = values
            setattr(result, name, wide)
    if isinstance(part, GatedTargets):
        result.decisions = {
            sensor: decision.widened(place, len(columns))
            for sensor, decision in part.decisions.items()
        }
    result.columns = columns
    return result
