"""Attitude as Stone Soup takes it: three angles about east, north and up.

Its measurement models turn a vector of the frame (x east, y north, z up) into the sensor's axes by
``rotx(-roll) @ roty(pitch) @ rotz(-yaw)`` (`stonesoup.functions.build_rotation_matrix`): yaw is
counter-clockwise from east, pitch nose up, roll right wing down. Axes of the sensor are then nose,
left wing, roof. Any rotation can be written so; that of a nose straight up is written with yaw 0.
"""

import numpy as np

from dsa_des.arrays.types import FloatArray

# Nearer to straight up or down than this, yaw and roll are one and the same turn.
_UPRIGHT = 1e-9


def rotation_offsets(to_body: FloatArray) -> FloatArray:
    """Return the angles that stand for rotations.

    Parameters
    ----------
    to_body : (3, 3, n)
        Turns vectors along north, east, down into those along nose, right wing, floor.

    Returns
    -------
    (3, n) array
        Roll, pitch and yaw as Stone Soup has them, rad.
    """
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
