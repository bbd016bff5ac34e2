"""The state of aircraft at some times, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import FloatArray, IntArray

#: Where an aircraft is (WGS 84) and how it is turned, in the order of `TrajectoryState`.
POSITION_FIELDS = ("lat_deg", "lon_deg", "alt_m")
POSE_FIELDS = (*POSITION_FIELDS, "yaw_rad", "pitch_rad", "roll_rad")


@dataclass(frozen=True)
class TrajectoryState:
    """Position and attitude of one or many aircraft at some times, as arrays of one shape.

    Parameters
    ----------
    lat_deg, lon_deg : ndarray
        Geodetic, WGS-84; longitude in [-180, 180).
    alt_m : ndarray
        Height above the ellipsoid, metres.
    yaw_rad : ndarray
        Clockwise from true north, [0, 2 pi).
    pitch_rad, roll_rad : ndarray
        Nose up and right wing down are positive.
    present : ndarray of bool
        False where the aircraft is not there. All other fields then hold its nearest known
        state: finite, so that arithmetic on them is safe, but not to be used.
    """

    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    yaw_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray
    present: npt.NDArray[np.bool_]

    def reshape(self, shape: tuple[int, ...]) -> TrajectoryState:
        """Return the same state with its arrays in another shape."""
        return TrajectoryState(*(array.reshape(shape) for array in self.arrays()))

    def taken(self, which: IntArray) -> TrajectoryState:
        """Return the states at the given indices, for arrays with one axis."""
        return TrajectoryState(*(array.take(which) for array in self.arrays()))

    def arrays(self) -> tuple[np.ndarray, ...]:
        """Return latitude, longitude, altitude, yaw, pitch, roll and presence, an array each."""
        return tuple(getattr(self, name) for name in (*POSE_FIELDS, "present"))
