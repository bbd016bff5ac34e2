"""The line of sight over a plane scaled by the ellipsoid's radii at the ownship."""

from __future__ import annotations

import numpy as np

from components.arguments.checks import FloatArray
from components.geometry.angles import RAD_PER_DEG, longitude_difference_rounded
from components.geometry.ellipsoid import radii_of_curvature


def north_east_up(
    lat1: FloatArray,
    lon1: FloatArray,
    alt1: FloatArray,
    lat2: FloatArray,
    lon2: FloatArray,
    alt2: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the target's north, east and up offsets in m, without checks.

    Parameters
    ----------
    lat1, lon1, alt1, lat2, lon2, alt2 : ndarray
        The observer and the target, in degrees and m: contiguous, at least one axis, in bounds.

    Notes
    -----
    north = (M + h)·dlat, east = (N + h)·cos(lat)·dlon, up = dh, with the meridian radius M and
    the prime vertical radius N of WGS-84 at the ownship's latitude, and h the ownship's altitude.

    Measured against `ellipsoid.line_of_sight`, worst of 20,000 pairs with latitudes within ±60
    degrees, 0-12 km altitude and slopes within ±0.1:

    ======== ============ ============== ==========
    distance azimuth, deg elevation, deg range
    ======== ============ ============== ==========
    1 km     0.0084       0.0048         0.006 %
    10 km    0.084        0.048          0.058 %
    50 km    0.42         0.24           0.29 %
    ======== ============ ============== ==========

    What is left is the turning of the vertical (0.0048 degrees per km) and the convergence of the
    meridians, which grows with tan(latitude): 1.4 degrees in azimuth at 50 km and 80 degrees of
    latitude. Useless at the poles. 30 ns per pair in blocks of 10,000.
    """
    meridian, prime_vertical = radii_of_curvature(lat1)
    north = (lat2 - lat1) * RAD_PER_DEG * (meridian + alt1)
    parallel = (prime_vertical + alt1) * np.sin((90.0 - np.abs(lat1)) * RAD_PER_DEG)
    east = longitude_difference_rounded(lon1, lon2) * RAD_PER_DEG * parallel
    return north, east, alt2 - alt1
