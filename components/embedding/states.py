"""From the arrays of a host program to the traffic message of one instant."""

import math

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.aircraft import Roster
from components.arguments.checks import HIGHEST_ALTITUDE_M, LARGEST, LOWEST_ALTITUDE_M
from components.geometry import POSE_FIELDS
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import shortened_repr

_NAMES = ("latitude", "longitude", "altitude", "yaw", "pitch", "roll")
# A latitude of 90° that came through radians may be a last digit above pi/2.
_LOW = np.array([-math.pi / 2, -LARGEST, LOWEST_ALTITUDE_M, -LARGEST, -LARGEST, -LARGEST])
_HIGH = np.array([math.pi / 2, LARGEST, HIGHEST_ALTITUDE_M, LARGEST, LARGEST, LARGEST])


def to_numbers(label: str, value: object) -> FloatArray:
    """Return a host's value as a float64 array; ValueError, naming it, if not numbers or masked."""
    mask = getattr(value, "mask", None)
    if mask is not None and np.any(mask):  # what a mask hides would be taken for a number
        raise ValueError(f"{label} has masked values: what is not there is NaN")
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{label} is {shortened_repr(value)}: it must hold numbers") from error


def checked_pose_rows(
    who: str, lla: ArrayLike, att: ArrayLike, count: int, *, missing: bool = True
) -> FloatArray:
    """Return latitude, longitude, altitude, yaw, pitch, roll as rows (count, 6), checked.

    `lla` (rad, rad, m) and `att` (rad) are (count, 3), (3,) for one row, and anything empty for
    none; `who` names them in messages. With `missing` a row may be NaN, all of its position: that
    plane is not there, and its row is NaN throughout. ValueError if a shape does not fit or a
    number is out of range.
    """
    rows = np.empty((count, 6))
    for label, value, columns in (
        (f"lla_{who}", lla, slice(0, 3)),
        (f"att_{who}", att, slice(3, 6)),
    ):
        array = to_numbers(label, value)
        if array.shape != (count, 3) and not (array.shape == (3,) and count == 1):
            if array.size == 0 and count == 0:
                continue
            allowed = "(3,)" if who == "ownship" else f"({count}, 3), a row for each plane"
            raise ValueError(f"{label} has the shape {array.shape}: it must be {allowed}")
        rows[:, columns] = array
    inside = np.asarray((rows >= _LOW) & (rows <= _HIGH))
    if not inside.all():
        absent = np.asarray(np.isnan(rows[:, :3]).all(axis=1) & missing)
        wrong = np.argwhere(~inside & ~absent[:, np.newaxis])
        if len(wrong):
            row, column = wrong[0].tolist()
            label = f"{'lla' if column < 3 else 'att'}_{who}"
            which = f" of row {row}" if count > 1 else ""
            low, high = _LOW[column], _HIGH[column]
            unit = "m" if column == 2 else "rad"
            raise ValueError(
                f"{label}: {_NAMES[column]}{which} is {rows[row, column]:g}: it must lie in "
                f"[{low:g}, {high:g}] {unit}"
            )
        rows[absent] = np.nan
    return rows


def traffic_states(
    own: FloatArray, rows: FloatArray, tick: int, roster: Roster, chosen: list[int] | None
) -> TrafficStates:
    """Return one tick's traffic message, of the ownship's row and rows from `checked_pose_rows`.

    `chosen` are the planes of the roster that the rows are; None for all.
    """
    present = np.ones((1, len(rows)), dtype=bool)
    there = rows[:, 0] == rows[:, 0]
    if not there.all():
        present[0] = there
        # Arithmetic on who is not there must be safe: far enough from us to have a direction.
        rows = np.where(there[:, np.newaxis], rows, own)
    # Rows (1,) of the ownship and (1, planes) of the others: a state's six numbers each.
    own_values, values = own.T.copy(), rows.T.copy()[:, np.newaxis]
    for angles in (own_values[:2], values[:2]):
        np.degrees(angles, out=angles)
    return TrafficStates(
        tick=np.array([tick], dtype=np.int64),
        **{f"own_{name}": row for name, row in zip(POSE_FIELDS, own_values, strict=True)},
        **dict(zip(POSE_FIELDS, values, strict=True)),
        present=present,
        roster=roster,
        columns=np.arange(len(roster)) if chosen is None else np.array(chosen, dtype=np.int64),
    )
