"""The frame of tracks: north, east, down at a point that is written down, and poses in it.

The frame is Cartesian: its axes are those of the horizon at the origin and stay parallel to
themselves, so that straight flight stays straight and the Earth's curvature enters exactly, by the
place and the axes of the sensor in the frame. Level flight away from the origin sinks in it.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import Batch, multiply_by_transpose, product, times
from components.geometry import local_axes, ned_to_body_unchecked, north_east_up
from dsa_des.arrays.types import FloatArray

#: Three rows (n,), such as those of an array (3, n).
Three = FloatArray | tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SensorPose(Batch):
    """Where sensors are and how they are turned, in frames."""

    position_m: FloatArray  # (3, n), of the sensor in the frame
    # (3, 3, n), turns a vector of the frame into body axes: nose, right wing, floor
    to_body: FloatArray
    # (3, n) or None: Of the sensor in the frame; needed where range rates are measured
    velocity_m_s: FloatArray | None = None


def pose_in_frame(
    origin_deg_m: Three,
    position_deg_m: Three,
    attitude_rad: Three,
    velocity_m_s: FloatArray | None = None,
) -> SensorPose:
    """Return where poses are in frames."""
    lat, lon, alt = position_deg_m
    from_lat, from_lon, from_alt = origin_deg_m
    # np.array joins a few short arrays in a fifth of the time that np.stack takes.
    north, east, up = north_east_up(from_lat, from_lon, from_alt, lat, lon, alt)
    there, here = ned_axes(lat, lon), ned_axes(from_lat, from_lon)
    # The frame's axes (the last but one) along each axis of the aircraft's own horizon.
    horizon = [dot(axis[:, np.newaxis], np.array(here).swapaxes(0, 1)) for axis in there]
    turned = np.array(ned_to_body_unchecked(*horizon, *attitude_rad)).reshape(3, 3, np.size(lat))
    moves = None
    if velocity_m_s is not None:
        moves = _change_axes(velocity_m_s, there, here)
    return SensorPose(np.array([north, east, -up]), turned, moves)


def vectors_in_frame(
    origin_deg_m: FloatArray, position_deg_m: FloatArray, vector: FloatArray
) -> FloatArray:
    """Return vectors along the horizon's axes at places, (3, n), along those of frames."""
    here, there = ned_axes(*origin_deg_m[:2]), ned_axes(*position_deg_m[:2])
    return _change_axes(vector, there, here)


def _change_axes(vector: FloatArray, old: list[FloatArray], new: list[FloatArray]) -> FloatArray:
    """Return vectors along new axes, of those along old ones, both in the Earth's axes."""
    in_space = sum(v * axis for v, axis in zip(vector, old, strict=True))
    return np.array([dot(in_space, axis) for axis in new])


def ned_axes(lat_deg: FloatArray, lon_deg: FloatArray) -> list[FloatArray]:
    """Return north, east and down of places, in Earth-centred axes, each (3, n)."""
    east, north, up = (np.array(axis) for axis in local_axes(lat_deg, lon_deg))
    return [north, east, -up]


def dot(one: FloatArray, other: FloatArray) -> FloatArray:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@dataclass(frozen=True, eq=False)
class FrameChange:
    """The way from frames to others."""

    shift_m: FloatArray  # (3, n), where the old frame's origin is in the new frame
    turn: FloatArray  # (3, 3, n), turns a vector of the old frame into the new one's axes

    def positions(self, position_m: FloatArray) -> FloatArray:
        """Return positions (3, n) of the old frame in the new one."""
        return self.shift_m + times(self.turn, position_m)

    def vectors(self, vector: FloatArray) -> FloatArray:
        """Return vectors (3, n) of the old frame along the new one's axes."""
        return times(self.turn, vector)

    def states(self, state: FloatArray) -> FloatArray:
        """Return positions and velocities (6, n) of the old frame in the new one."""
        return np.concatenate([self.positions(state[:3]), self.vectors(state[3:])])

    def covariances(self, covariance: FloatArray) -> FloatArray:
        """Return covariances of position and velocity (6, 6, n) along the new frame's axes."""
        turned = np.empty_like(covariance)
        for i in (0, 3):
            for j in (0, 3):
                block = product(self.turn, covariance[i : i + 3, j : j + 3])
                turned[i : i + 3, j : j + 3] = multiply_by_transpose(block, self.turn)
        return turned


def frame_change(old_deg_m: FloatArray, new_deg_m: FloatArray) -> FrameChange:
    """Return the way from frames with some origins to frames with others."""
    old, new = (tuple(np.ascontiguousarray(row) for row in rows) for rows in (old_deg_m, new_deg_m))
    north, east, up = north_east_up(*new, *old)
    there, here = ned_axes(old[0], old[1]), ned_axes(new[0], new[1])
    turn = np.empty((3, 3, np.size(north)))
    for i, to in enumerate(here):
        for j, along in enumerate(there):
            turn[i, j] = dot(to, along)
    return FrameChange(np.stack([north, east, -up]), turn)
