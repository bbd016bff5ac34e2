"""The area in which separation would be lost, were the ownship to turn there at once."""

import math
from typing import NamedTuple

import numpy as np

from components.well_clear.detection import violation_or_advisory_span
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.arrays.types import FloatArray

#: Directions that are looked at, all around the ownship.
STEP_RAD = math.radians(3.0)
DIRECTIONS_RAD = np.arange(0.0, 2.0 * math.pi - 0.5 * STEP_RAD, STEP_RAD)


class Reached(NamedTuple):
    """The distances where a loss begins and ends, by direction of flight clockwise from north."""

    direction_rad: FloatArray
    near_m: FloatArray
    far_m: FloatArray


def predicted_loss_area(
    volume: Volume | TcasAdvisory,
    own_alt_m: float,
    own_mps: FloatArray,
    relative: FloatArray,
    lookahead_s: float,
) -> Reached:
    """Return by direction of a turn now, from which to which distance it would violate a volume.

    It keeps its speed and its vertical speed, and the others their flights; how long it takes to
    turn is left out. What an operator sees is where not to fly to, as the thesis has it (section
    2.2: the area where the loss of separation occurs).
    Velocities are east, north and upward; `relative` (6, targets) is east, north, up in m and their
    rates, ownship less target. There is one entry for each target and direction with a loss.
    """
    speed_mps = math.hypot(own_mps[0], own_mps[1])
    east = speed_mps * np.sin(DIRECTIONS_RAD)[:, np.newaxis] - own_mps[0]
    north = speed_mps * np.cos(DIRECTIONS_RAD)[:, np.newaxis] - own_mps[1]
    turned = [*relative[:3], relative[3] + east, relative[4] + north, relative[5]]
    parts = [part.reshape(-1) for part in np.broadcast_arrays(*turned)]
    own_up = np.full(len(parts[0]), own_alt_m), np.full(len(parts[0]), own_mps[2])
    span = violation_or_advisory_span(volume, parts, own_up, None, 0.0, lookahead_s)
    lost = np.flatnonzero(span.begin_s < span.end_s)
    direction = np.repeat(DIRECTIONS_RAD, relative.shape[1])[lost]
    return Reached(direction, speed_mps * span.begin_s[lost], speed_mps * span.end_s[lost])
