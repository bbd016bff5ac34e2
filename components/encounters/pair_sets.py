"""Paired tracks as a set of encounters: initial states, and events where commands change."""

import numpy as np

from components.encounters.encounter_set import EVENTS, EncounterSet
from components.encounters.pairing import Pairs
from components.well_clear.volume import FOOT_M
from dsa_des.arrays.types import AnyArray, FloatArray

NAMES = ("ownship", "intruder")


def set_of_pairs(
    pairs: Pairs, closest_s: int, reference_deg: tuple[float, float], source: str
) -> EncounterSet:
    """Return a set with one encounter per pair.

    Parameters
    ----------
    pairs : Pairs
    closest_s : int
        When the pairs are closest.
    reference_deg : (latitude, longitude)
        Where the ownship is at the closest approach.
    source : str
    """
    count = len(pairs.numbers)
    commands = np.stack([pairs.climb_ft_s, pairs.turn_rad_s, pairs.acceleration_ft_s2])
    # (quantity, pair, aircraft, second): rows of the file in their order.
    commands = np.ascontiguousarray(commands.transpose(0, 3, 1, 2))
    changed: AnyArray = np.ones(commands.shape[1:], dtype=np.bool_)
    changed[..., 1:] = (np.diff(commands, axis=-1) != 0.0).any(axis=0)
    # The last instant commands nothing any more.
    changed[..., -1] = False
    seconds = commands.shape[-1] - 1
    starts = np.concatenate([[0], np.cumsum(changed.reshape(2 * count, -1).sum(axis=1))])
    climb, turn, acceleration = (values[changed] for values in commands)

    def both(values: FloatArray) -> FloatArray:
        return np.ascontiguousarray(values[:, 0].T).reshape(-1)

    course = np.degrees(pairs.course_rad) % 360.0
    north = pairs.north_ft[1, 0] - pairs.north_ft[0, 0]
    east = pairs.east_ft[1, 0] - pairs.east_ft[0, 0]
    bearing = np.degrees(np.arctan2(east, north) - pairs.heading_rad[0, 0]) % 360.0
    return EncounterSet(
        source,
        EVENTS,
        pairs.numbers,
        pairs.weight,
        2 * np.arange(count + 1),
        NAMES * count,
        {
            "north_m": both(pairs.north_ft) * FOOT_M,
            "east_m": both(pairs.east_ft) * FOOT_M,
            "altitude_m": both(pairs.up_ft) * FOOT_M,
            "speed_mps": both(pairs.speed_ft_s) * FOOT_M,
            "heading_rad": both(pairs.heading_rad),
            "duration_s": np.full(2 * count, float(seconds)),
        },
        starts,
        {
            "time_s": np.nonzero(changed)[-1].astype(float),
            "climb_mps": climb * FOOT_M,
            "turn_rad_s": turn,
            "acceleration_mps2": acceleration * FOOT_M,
        },
        reference_deg,
        {
            "horizontal_miss_m": pairs.horizontal_ft * FOOT_M,
            "vertical_miss_m": pairs.vertical_ft * FOOT_M,
            "closest_s": np.full(count, float(closest_s)),
            "course_deg": course,
            "bearing_deg": bearing,
            "geometry": geometry_class(course),
        },
    )


#: What `geometry_class` gives.
GEOMETRIES = ("head-on", "overtaking", "crossing from the left", "crossing from the right")


def geometry_class(course_deg: FloatArray) -> AnyArray:
    """Return how each intruder's course lies to the ownship's.

    Within 20° of opposite it is ``head-on``, within 70° of the same ``overtaking`` (either may be
    the one that overtakes), else ``crossing from the left`` (its course leads to the right) or
    ``crossing from the right``; the sectors are those of the rules of the air (14 CFR 91.113), the
    widths ours for head-on.
    """
    off = np.abs((course_deg + 180.0) % 360.0 - 180.0)
    side = np.where(course_deg % 360.0 < 180.0, "crossing from the left", "crossing from the right")
    found: AnyArray = np.where(off >= 160.0, "head-on", np.where(off <= 70.0, "overtaking", side))
    return found
