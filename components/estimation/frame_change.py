"""From one frame of tracks to another: two local level frames with origins of their own.

Both frames are Cartesian and fixed to the Earth (`components.estimation.frame`), so the change is
one shift and one turn, exact however far the origins are apart.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import product, product_transposed, times
from components.estimation.frame import ned_axes
from components.geometry.ellipsoid import north_east_up
from dsa_des.arrays.types import FloatArray


@dataclass(frozen=True, eq=False)
class FrameChange:
    """The way from frames to others.

    Parameters
    ----------
    shift_m : (3, n)
        Where the old frame's origin is in the new frame.
    turn : (3, 3, n)
        Turns a vector of the old frame into the new one's axes.
    """

    shift_m: FloatArray
    turn: FloatArray

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
                turned[i : i + 3, j : j + 3] = product_transposed(block, self.turn)
        return turned


def frame_change(old_deg_m: FloatArray, new_deg_m: FloatArray) -> FrameChange:
    """Return the way from frames with some origins to frames with others.

    Parameters
    ----------
    old_deg_m, new_deg_m : (3, n)
        Latitude and longitude (deg) and height above the ellipsoid (m) of the origins.

    Returns
    -------
    FrameChange
    """
    old, new = (tuple(np.ascontiguousarray(row) for row in rows) for rows in (old_deg_m, new_deg_m))
    north, east, up = north_east_up(*new, *old)
    there, here = ned_axes(old[0], old[1]), ned_axes(new[0], new[1])
    turn = np.empty((3, 3, np.size(north)))
    for i, to in enumerate(here):
        for j, along in enumerate(there):
            turn[i, j] = to[0] * along[0] + to[1] * along[1] + to[2] * along[2]
    return FrameChange(np.stack([north, east, -up]), turn)
