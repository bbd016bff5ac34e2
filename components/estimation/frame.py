"""The frame of tracks: north, east, down at a point that is written down, and poses in it.

The frame is Cartesian: its axes are those of the horizon at the origin and stay parallel to
themselves, so that straight flight stays straight and the Earth's curvature enters exactly, by the
place and the axes of the sensor in the frame. Level flight away from the origin sinks in it.
"""

from dataclasses import dataclass

import numpy as np

from components.geometry.angles import local_axes
from components.geometry.attitude import ned_to_body_unchecked
from components.geometry.ellipsoid import north_east_up
from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Place:
    """Where sensors are and how they are turned, in frames.

    Parameters
    ----------
    position_m : (3, n)
        Of the sensor in the frame.
    to_body : (3, 3, n)
        Turns a vector of the frame into body axes: nose, right wing, floor.
    velocity_m_s : (3, n) or None
        Of the sensor in the frame; needed where range rates are measured.
    """

    position_m: FloatArray
    to_body: FloatArray
    velocity_m_s: FloatArray | None = None

    def take(self, which: IntArray) -> "Place":
        """Return some of the places."""
        moves = self.velocity_m_s
        return Place(
            self.position_m.take(which, axis=-1), self.to_body.take(which, axis=-1),
            None if moves is None else moves.take(which, axis=-1),
        )  # fmt: skip


def place_in_frame(
    origin_deg_m: tuple[FloatArray, FloatArray, FloatArray],
    position_deg_m: tuple[FloatArray, FloatArray, FloatArray],
    attitude_rad: tuple[FloatArray, FloatArray, FloatArray],
    velocity_m_s: FloatArray | None = None,
) -> Place:
    """Return where poses are in frames.

    Parameters
    ----------
    origin_deg_m : three arrays (n,)
        Latitude and longitude (deg) and height above the ellipsoid (m) of each frame's origin.
    position_deg_m : three arrays (n,)
        The same of the aircraft that bears the sensor.
    attitude_rad : three arrays (n,)
        Its heading, pitch and roll, in the north, east, down of its own place.
    velocity_m_s : (3, n), optional
        Its velocity over ground there.

    Returns
    -------
    Place
    """
    lat, lon, alt = position_deg_m
    # np.array joins a few short arrays in a fifth of the time that np.stack takes.
    north, east, up = north_east_up(*origin_deg_m, lat, lon, alt)
    there, here = ned_axes(lat, lon), ned_axes(origin_deg_m[0], origin_deg_m[1])
    turned = np.empty((3, 3, np.size(lat)))
    for j in range(3):
        # Axis j of the frame, along the axes of the aircraft's own horizon.
        n, e, d = (_dot(axis, here[j]) for axis in there)
        turned[:, j] = np.array(ned_to_body_unchecked(n, e, d, *attitude_rad))
    moves = None
    if velocity_m_s is not None:
        # Along the axes of the frame, whose components in the Earth's axes are `here`.
        in_space = sum(v * axis for v, axis in zip(velocity_m_s, there, strict=True))
        moves = np.array([_dot(in_space, axis) for axis in here])
    return Place(np.array([north, east, -up]), turned, moves)


def ned_axes(lat_deg: FloatArray, lon_deg: FloatArray) -> list[FloatArray]:
    """Return north, east and down of places, in Earth-centred axes, each (3, n)."""
    east, north, up = (np.array(axis) for axis in local_axes(lat_deg, lon_deg))
    return [north, east, -up]


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
