"""Detections, states and instants as Stone Soup's objects; importing this imports Stone Soup.

The frame has x east, y north and z up at an origin, and axes that stay parallel to themselves. A
state is ``[x, vx, y, vy, z, vz]``. A measurement is ``[elevation, bearing]``, then the range where
there is one, then its rate, in the axes nose, left wing, roof: the elevation is ours, the bearing
is counter-clockwise and so our azimuth with the other sign.
"""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from stonesoup.models.measurement.nonlinear import (
    CartesianToElevationBearing,
    CartesianToElevationBearingRange,
    CartesianToElevationBearingRangeRate,
)
from stonesoup.types.angle import Bearing, Elevation
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection

from components.estimation.frame import SensorPose
from dsa_des.arrays.types import FloatArray

#: A run has no date: its second 0 is put here.
START = datetime(2000, 1, 1)
#: Where position and velocity stand in a state.
POSITION, VELOCITY = (0, 2, 4), (1, 3, 5)


def to_datetime(time_s: float) -> datetime:
    """Return the time of a run (s) as a datetime, rounded to the microsecond."""
    return START + timedelta(microseconds=round(1e6 * time_s))


def state_vectors(position_ned_m: FloatArray, velocity_ned_m_s: FloatArray) -> list[StateVector]:
    """Return Stone Soup state vectors (east, north, up, velocities) from (3, n) in NED axes."""
    result = np.empty((6, position_ned_m.shape[1]))
    for part, ned in ((POSITION, position_ned_m), (VELOCITY, velocity_ned_m_s)):
        result[list(part)] = ned[1], ned[0], -ned[2]
    return [StateVector(column) for column in result.T]


class Poses:
    """Positions, orientations, velocities of sensors as Stone Soup's measurement models take."""

    def __init__(
        self, pose: SensorPose, mapping: Sequence[int] = POSITION, state_size: int = 6
    ) -> None:
        self._mapping, self._size = tuple(mapping), state_size
        north, east, down = pose.position_m
        self._offset = np.stack([east, north, -down])
        self._angles = roll_pitch_yaw_rad(pose.to_body)
        moves = np.full_like(pose.position_m, np.nan)
        if pose.velocity_m_s is not None:
            moves = pose.velocity_m_s
        self._velocity = np.stack([moves[1], moves[0], -moves[2]])

    def position(self, i: int) -> StateVector:
        """Return the position of sensor i along east, north, up, m."""
        return StateVector(self._offset[:, i])

    def orientation(self, i: int) -> StateVector:
        """Return roll, pitch and yaw of sensor i in rad, in Stone Soup's convention."""
        return StateVector(self._angles[:, i])

    def measurement_model(self, i: int, variances: FloatArray) -> Any:
        """Return Stone Soup's measurement model of sensor i with noise of these variances."""
        common = {
            "ndim_state": self._size,
            "mapping": self._mapping,
            "noise_covar": np.diag(variances),
            "translation_offset": self.position(i),
            "rotation_offset": self.orientation(i),
        }
        if len(variances) == 4:
            return CartesianToElevationBearingRangeRate(
                **common, velocity_mapping=VELOCITY, velocity=StateVector(self._velocity[:, i])
            )
        if len(variances) == 3:
            return CartesianToElevationBearingRange(**common)
        return CartesianToElevationBearing(**common)

    def has_velocity(self, i: int) -> bool:
        """Return whether sensor i's velocity is known; without it no range rate can be used."""
        return bool(np.isfinite(self._velocity[:, i]).all())


class NumberedDetection(Detection):
    """A detection whose place in a set follows from a number and not from where it lies in memory.

    Trackers walk through sets of detections, and what comes of a tie, or of a sum, must not differ
    from one run to the next.
    """

    number: int = 0

    def __hash__(self) -> int:
        return self.number


def make_detections(
    poses: Poses,
    which: "list[int]",
    when: datetime,
    measured: FloatArray,
    variance: FloatArray,
    metadata: "list[dict[str, Any]]",
) -> set[Detection]:
    """Return a look's Stone Soup detections, with measured values and measurement models.

    Parameters
    ----------
    which : list of int
        Of each detection, which of the poses it was made from.
    measured, variance : (4 or more, n)
        Azimuth, elevation, range and range rate, NaN where not measured. What follows, such as the
        velocity that a target tells (`Scans.measured`), none of the measurement models has.
    """
    result = set()
    for k, i in enumerate(which):
        azimuth, elevation, range_m, rate = measured[:4, k].tolist()
        ranged = range_m == range_m
        vector: list[Any] = [Elevation(elevation), Bearing(-azimuth)]
        rows = [1, 0]
        if ranged:
            vector.append(range_m)
            rows.append(2)
            if rate == rate and variance[3, k] > 0.0 and poses.has_velocity(i):
                vector.append(rate)
                rows.append(3)
        one = NumberedDetection(
            StateVector(vector),
            timestamp=when,
            measurement_model=poses.measurement_model(i, variance[rows, k]),
            metadata=metadata[k],
        )
        one.number = k
        result.add(one)
    return result


# Nearer to straight up or down than this, yaw and roll are one and the same turn.
_UPRIGHT = 1e-9


def roll_pitch_yaw_rad(to_body: FloatArray) -> FloatArray:
    """Return (roll, pitch, yaw) (3, n), rad, as Stone Soup's, of NED-to-body matrices (3, 3, n)."""
    # Columns along east, north, up; rows along nose, left wing, roof.
    turned = to_body[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])[np.newaxis, :, np.newaxis]
    turned *= np.array([1.0, -1.0, -1.0])[:, np.newaxis, np.newaxis]
    level = np.hypot(turned[0, 0], turned[0, 1])
    upright = level < _UPRIGHT
    roll = np.arctan2(turned[1, 2], turned[2, 2])
    yaw = np.arctan2(turned[0, 1], turned[0, 0])
    return np.stack(
        [
            np.where(upright, np.arctan2(-turned[2, 1], turned[1, 1]), roll),
            np.arctan2(turned[0, 2], level),
            np.where(upright, 0.0, yaw),
        ]
    )
