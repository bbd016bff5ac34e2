"""The true states of all aircraft, as a run folder's table ``truth`` has them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from components.geometry.ellipsoid import line_of_sight_ned
from components.messages.columns import OWN_NED, TURNED, WGS84
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Column, Columns, Message, Text

#: Half of the time over which positions are compared for a velocity; a power of two, so that
#: times differ by it exactly.
STEP_S = 1.0 / 1024.0
# Aircraft and instants worked on together.
_AT_ONCE = 16384

_PLACE = ("lat_deg", "lon_deg", "alt_m")
_TURNED = {"yaw_rad": "heading_rad", "pitch_rad": "pitch_rad", "roll_rad": "roll_rad"}
_VELOCITY = ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")
_NUMBERS = (*_PLACE, *_VELOCITY, *_TURNED.values())


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
    """Return the ownship and every target that is there at each instant of a message.

    Parameters
    ----------
    states : TrafficStates
        With ``true_flights`` and ``run_time_s``. All targets of the roster count, whatever its
        arrays hold.

    Returns
    -------
    dict of columns
        At each instant the ownship first (its ``target`` is null), then the targets as the roster
        has them. Velocities are those of the path in the aircraft's own NED frame, from positions
        1/1024 s before and after: good to 1e-5 m/s where the path has no kink in between, by
        which they are the mean of both sides. Where an aircraft comes or goes, two positions on
        the one side take their place.
    """
    count = len(states.roster)
    step = max(1, _AT_ONCE // (1 + count))
    parts = [
        _part(
            states.true_flights.take_rows(rows), states.tick[rows], states.run_time_s[rows], count
        )
        for rows in (slice(i, i + step) for i in range(0, len(states), step))
    ]
    columns: Columns = {
        name: np.concatenate([part[name] for part in parts]) for name in ("tick", *_NUMBERS)
    }
    who = np.concatenate([part["who"] for part in parts])
    columns["target"] = Text(who, states.roster.names)
    return columns


def _part(flights: Any, tick: IntArray, time_s: FloatArray, count: int) -> dict[str, Any]:
    columns = np.arange(count)
    state = _together(flights(columns, time_s[:, np.newaxis]))
    row, column = np.nonzero(state["present"])
    velocity = _velocity(flights, columns, time_s, state)
    return {
        "tick": tick[row],
        "who": column - 1,
        **{name: state[name][row, column] for name in _PLACE},
        **{name: v[row, column] for name, v in zip(_VELOCITY, velocity, strict=True)},
        **{name: state[key][row, column] for key, name in _TURNED.items()},
    }


def _velocity(flights: Any, columns: IntArray, time_s: FloatArray, here: Any) -> list[FloatArray]:
    """Return the velocity north, east and down of everybody at each time, (rows, 1 + targets)."""
    after, there_after = _moved(flights, columns, time_s + STEP_S, here)
    before, there_before = _moved(flights, columns, time_s - STEP_S, here)
    velocity = (after - before) / (2.0 * STEP_S)
    one_sided = here["present"] & ~(there_after & there_before)
    rows = np.flatnonzero(one_sided.any(axis=1))
    if len(rows):
        part = flights.take_rows(rows)
        here = {name: values[rows] for name, values in here.items()}
        for near, there, step_s in (
            (after, there_after, STEP_S),
            (before, there_before, -STEP_S),
        ):
            far, still_there = _moved(part, columns, time_s[rows] + 2.0 * step_s, here)
            slope = (4.0 * near[:, rows] - far) / (2.0 * step_s)
            fits = one_sided[rows] & there[rows] & still_there
            velocity[:, rows] = np.where(fits, slope, velocity[:, rows])
            one_sided[rows] &= ~fits
        velocity[:, one_sided] = np.nan
    return list(velocity)


def _moved(
    flights: Any, columns: IntArray, time_s: FloatArray, here: Any
) -> tuple[FloatArray, Any]:
    """Return where everybody is at other times, north, east and down of where they are here."""
    there = _together(flights(columns, time_s[:, np.newaxis]))
    places = [*(here[name] for name in _PLACE), *(there[name] for name in _PLACE)]
    return np.stack(line_of_sight_ned(*places, validate=False)), there["present"]


def _together(states: Any) -> dict[str, Any]:
    """Return the ownship's states (rows, 1) and the targets' (rows, n) side by side."""
    own, others = states
    return {
        name: np.concatenate([getattr(own, name), getattr(others, name)], axis=1)
        for name in (*_PLACE, *_TURNED, "present")
    }
