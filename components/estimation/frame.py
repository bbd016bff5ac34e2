"""The frame of tracks: north, east, down at a point that is written down, and poses in it.

The frame is Cartesian: its axes are those of the horizon at the origin and stay parallel to
themselves, so that straight flight stays straight and the Earth's curvature enters exactly, by the
place and the axes of the sensor in the frame. Level flight away from the origin sinks in it.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import (
    Batch,
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
)
from components.geometry import east_north_up_axes, ned_to_body_unchecked, north_east_up_offsets_m
from dsa_des.arrays.types import FloatArray

#: Three rows (n,), such as those of an array (3, n).
Three = FloatArray | tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SensorPose(Batch):
    """Position, axes and perhaps velocity of sensors in the frames of tracks."""

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
    """Return sensors' positions (m) and axes in NED frames with these origins (deg, deg, m)."""
    lat, lon, alt = position_deg_m
    from_lat, from_lon, from_alt = origin_deg_m
    # np.array joins a few short arrays in a fifth of the time that np.stack takes.
    north, east, up = north_east_up_offsets_m(from_lat, from_lon, from_alt, lat, lon, alt)
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
    """Return NED vectors at places (3, n) in the NED axes of frames with these origins."""
    here, there = ned_axes(*origin_deg_m[:2]), ned_axes(*position_deg_m[:2])
    return _change_axes(vector, there, here)


def _change_axes(vector: FloatArray, old: list[FloatArray], new: list[FloatArray]) -> FloatArray:
    """Return vectors (3, n) along new axes, given those along old ones; all axes Earth-centred."""
    in_space = sum(v * axis for v, axis in zip(vector, old, strict=True))
    return np.array([dot(in_space, axis) for axis in new])


def ned_axes(lat_deg: FloatArray, lon_deg: FloatArray) -> list[FloatArray]:
    """Return unit vectors north, east and down at places, in Earth-centred axes, each (3, n)."""
    east, north, up = (np.array(axis) for axis in east_north_up_axes(lat_deg, lon_deg))
    return [north, east, -up]


def dot(one: FloatArray, other: FloatArray) -> FloatArray:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@dataclass(frozen=True, eq=False)
class FrameChange:
    """The change of coordinates between two frames for each track: a shift and a rotation."""

    shift_m: FloatArray  # (3, n), where the old frame's origin is in the new frame
    turn: FloatArray  # (3, 3, n), turns a vector of the old frame into the new one's axes

    def positions(self, position_m: FloatArray) -> FloatArray:
        """Return positions (3, n) of the old frame in the new one."""
        return self.shift_m + matrix_times_vector(self.turn, position_m)

    def vectors(self, vector: FloatArray) -> FloatArray:
        """Return vectors (3, n) of the old frame along the new one's axes."""
        return matrix_times_vector(self.turn, vector)

    def states(self, state: FloatArray) -> FloatArray:
        """Return positions and velocities (6, n) of the old frame in the new one."""
        return np.concatenate([self.positions(state[:3]), self.vectors(state[3:])])

    def covariances(self, covariance: FloatArray) -> FloatArray:
        """Return covariances of position and velocity (6, 6, n) along the new frame's axes."""
        turned = np.empty_like(covariance)
        for i in (0, 3):
            for j in (0, 3):
                block = matrix_product(self.turn, covariance[i : i + 3, j : j + 3])
                turned[i : i + 3, j : j + 3] = multiply_by_transpose(block, self.turn)
        return turned


def frame_change(old_deg_m: FloatArray, new_deg_m: FloatArray) -> FrameChange:
    """Return the change from frames with old origins to frames with new ones, each (3, n):
    latitude, longitude (deg) and height (m).
    """
    old, new = (tuple(np.ascontiguousarray(row) for row in rows) for rows in (old_deg_m, new_deg_m))
    north, east, up = north_east_up_offsets_m(*new, *old)
    there, here = ned_axes(old[0], old[1]), ned_axes(new[0], new[1])
    turn = np.empty((3, 3, np.size(north)))
    for i, to in enumerate(here):
        for j, along in enumerate(there):
            turn[i, j] = dot(to, along)
    return FrameChange(np.stack([north, east, -up]), turn)
