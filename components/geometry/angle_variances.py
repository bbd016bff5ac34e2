"""Variances of azimuth and elevation in axes that are turned against those they are stated in."""

import math

import numpy as np

from components.arguments.checks import FloatArray
from components.geometry.attitude import (
    body_angles_unchecked,
    body_to_ned,
    unit_vector_unchecked,
)

# Of an azimuth of which nothing is known: uniform over the circle.
_ANY_AZIMUTH_RAD2 = math.pi**2 / 3.0


def turned_variances(
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    azimuth_variance_rad2: FloatArray,
    elevation_variance_rad2: FloatArray,
    mounting_rad: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray]:
    """Return the variances of a direction's azimuth and elevation in the axes it is turned into.

    Small errors turn with the tangent plane: those of the elevation and, shortened by the cosine
    of the elevation, of the azimuth are turned by the angle between the two verticals there. What
    the turn leaves correlated is not returned.

    Parameters
    ----------
    azimuth_rad, elevation_rad : (n,) arrays
        Direction in the sensor's axes.
    azimuth_variance_rad2, elevation_variance_rad2 : (n,) arrays
        In the sensor's axes, uncorrelated.
    mounting_rad : (azimuth, elevation, roll)
        Turn from body axes to the sensor's, ZYX.

    Returns
    -------
    azimuth_variance_rad2, elevation_variance_rad2 : (n,) arrays
        In body axes; that of the azimuth at most π²/3, any azimuth, which straight up it is.
    """
    body = body_to_ned(*unit_vector_unchecked(azimuth_rad, elevation_rad), *mounting_rad)
    p, q = body_angles_unchecked(*(np.ascontiguousarray(axis) for axis in body))
    # The direction a quarter turn above another is the upward tangent there.
    up = body_to_ned(
        *unit_vector_unchecked(azimuth_rad, elevation_rad + 0.5 * np.pi), *mounting_rad
    )
    level_up = unit_vector_unchecked(p, q + 0.5 * np.pi)
    cosine2 = (up[0] * level_up[0] + up[1] * level_up[1] + up[2] * level_up[2]) ** 2
    sine2 = (up[1] * np.cos(p) - up[0] * np.sin(p)) ** 2
    across = np.cos(elevation_rad) ** 2 * azimuth_variance_rad2
    level2 = np.cos(q) ** 2
    sideways = cosine2 * across + sine2 * elevation_variance_rad2
    azimuth = np.full(len(level2), _ANY_AZIMUTH_RAD2)
    known = sideways < level2 * _ANY_AZIMUTH_RAD2
    np.divide(sideways, level2, out=azimuth, where=known)
    return azimuth, sine2 * across + cosine2 * elevation_variance_rad2
