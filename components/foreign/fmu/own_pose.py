"""What messages say of the ownship, held until news come, and where targets truly are."""

from typing import Any

import numpy as np

from components.geometry import POSE_FIELDS
from components.messages.columns import OWN_VELOCITY, POSE
from components.messages.targets import RelativeTargets, TrafficStates, own_velocity_ned_m_s
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.wake import Wake

_LEVEL_OF_TRUST = (TrafficStates, RelativeTargets)


def ownship_motion_and_latest(
    wake: Wake, port: str, held: dict[tuple[int, str], FloatArray], *, moves: bool
) -> tuple[FloatArray, dict[tuple[int, str], FloatArray]]:
    """Return the ownship's pose and velocity (9, rows), and each source's latest for the next.

    What a line of sight was made with (the belief) goes before the traffic's truth.

    Parameters
    ----------
    wake : Wake
    port : str
        Over which the messages come.
    held : dict of (9,)
    moves : bool
        Whether the velocity is wanted as well.

    Returns
    -------
    own : (9, rows)
        `POSE` and `OWN_VELOCITY`; NaN where nothing has come yet.
    held : dict of (9,)
    """
    came = {}
    for arrivals in wake.arrivals(port):
        trust = next(
            (k for k, kind in enumerate(_LEVEL_OF_TRUST) if isinstance(arrivals.message, kind)), -1
        )
        if trust >= 0 and len(arrivals.message):
            came[trust, arrivals.source] = arrivals
    found = np.full((len(POSE) + len(OWN_VELOCITY), len(wake)), np.nan)
    after = dict(held)
    for key in sorted({*came, *held}):
        mine = np.repeat(held.get(key, np.full(len(found), np.nan))[:, np.newaxis], len(wake), 1)
        if key in came:
            place = np.searchsorted(came[key].tick, wake.ticks, side="right") - 1
            said = _pose_and_velocity_rows(came[key].message, wake, moves)
            mine[:, place >= 0] = said[:, place[place >= 0]]
        after[key] = mine[:, -1].copy()
        found = np.where(np.isnan(mine), found, mine)
    return found, after


def _pose_and_velocity_rows(message: Any, wake: Wake, moves: bool) -> FloatArray:
    """Return the pose and velocity (9, rows) that a message's rows state; NaN where none."""
    rows = len(message)
    found = np.full((len(POSE) + len(OWN_VELOCITY), rows), np.nan)
    if isinstance(message, TrafficStates):
        found[: len(POSE)] = [getattr(message, f"own_{name}") for name in POSE_FIELDS]
        return found
    if message.believed is not None:
        found[: len(POSE)] = [message.believed[name] for name in POSE_FIELDS]
    if moves:
        state: IntArray = message.position_ticks
        time_s = state / wake.ticks_per_s
        found[len(POSE) :] = own_velocity_ned_m_s(message, np.arange(rows), time_s)
    return found


def true_lines_of_sight(wake: Wake, port: str, targets: int) -> FloatArray:
    """Return true lines of sight, (3, rows, targets); NaN if none came at the row's instant.

    Azimuth and elevation in the ownship's body axes, and range.
    """
    found = np.full((3, len(wake), targets), np.nan)
    for arrivals in wake.arrivals(port):
        message = arrivals.message
        if not isinstance(message, RelativeTargets):
            continue
        row, place = np.nonzero(wake.ticks[:, np.newaxis] == arrivals.tick)
        lines = (message.body_azimuth_rad, message.body_elevation_rad, message.range_m)
        for k, values in enumerate(lines):
            seen = np.where(message.present[place], values[place], np.nan)
            found[k][row[:, np.newaxis], message.columns] = seen
    return found
