"""The plane in which the alerting logic of DO-365 compares aircraft: a sphere, projected.

One minute of arc of the sphere is a nautical mile. Positions are projected orthographically onto
the plane that touches it below the ownship; heights are altitudes, without curvature. Against
WGS 84 a range of 7 nmi may be some 0.3 % off: differences of alerts to those of an exact Earth
are those of this plane.
"""

import math

import numpy as np

from components.geometry.angles import RAD_PER_DEG, longitude_difference_rounded
from components.geometry.normals import FloatArray

#: Radius of the sphere, m.
RADIUS_M = 1852.0 * 60.0 * 180.0 / math.pi
# Velocities are projected as the difference of positions this far apart in time.
_AHEAD_S = 10.0


def east_north_m(
    lat_rad: FloatArray, lon_rad: FloatArray, own_lat_rad: FloatArray, own_lon_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a position in the plane that touches the sphere below the ownship.

    Parameters
    ----------
    lat_rad, lon_rad, own_lat_rad, own_lon_rad : (n,)

    Returns
    -------
    tuple of (n,)
        East and north of the ownship, m.
    """
    away = lon_rad - own_lon_rad
    east = RADIUS_M * np.cos(lat_rad) * np.sin(away)
    north = RADIUS_M * (
        np.cos(own_lat_rad) * np.sin(lat_rad) - np.sin(own_lat_rad) * np.cos(lat_rad) * np.cos(away)
    )
    return east, north


def east_north_mps(
    lat_rad: FloatArray,
    lon_rad: FloatArray,
    east_mps: FloatArray,
    north_mps: FloatArray,
    own_lat_rad: FloatArray,
    own_lon_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return a velocity in the plane that touches the sphere below the ownship.

    Parameters
    ----------
    lat_rad, lon_rad : (n,)
        Where the aircraft is, the ownship itself too.
    east_mps, north_mps : (n,)
        Its velocity over ground there.
    own_lat_rad, own_lon_rad : (n,)

    Returns
    -------
    tuple of (n,)
        East and north in the plane, m/s: the mean over the next ten seconds along a great circle.
    """
    track = np.arctan2(east_mps, north_mps)
    arc = _AHEAD_S * np.hypot(east_mps, north_mps) / RADIUS_M
    sin_lat = np.sin(lat_rad) * np.cos(arc) + np.cos(lat_rad) * np.sin(arc) * np.cos(track)
    later_lat = np.arcsin(np.clip(sin_lat, -1.0, 1.0))
    later_lon = lon_rad + np.arctan2(
        np.sin(track) * np.sin(arc) * np.cos(lat_rad),
        np.cos(arc) - np.sin(lat_rad) * sin_lat,
    )
    now = east_north_m(lat_rad, lon_rad, own_lat_rad, own_lon_rad)
    later = east_north_m(later_lat, later_lon, own_lat_rad, own_lon_rad)
    return (later[0] - now[0]) / _AHEAD_S, (later[1] - now[1]) / _AHEAD_S


def north_east_up(
    lat1: FloatArray,
    lon1: FloatArray,
    alt1: FloatArray,
    lat2: FloatArray,
    lon2: FloatArray,
    alt2: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the target's north, east and up offsets in the plane in m, without checks.

    Parameters
    ----------
    lat1, lon1, alt1, lat2, lon2, alt2 : ndarray
        The observer and the target, in degrees and m: contiguous, at least one axis, in bounds.

    Notes
    -----
    As `east_north_m`, in a form that does not cancel for targets close by. Beyond a quarter of the
    way around the Earth the projection comes back: what is there seems nearer than it is.
    """
    away = longitude_difference_rounded(lon1, lon2) * RAD_PER_DEG
    own, other = lat1 * RAD_PER_DEG, lat2 * RAD_PER_DEG
    # sin(b - a) + sin(a) cos(b) (1 - cos c) is cos(a) sin(b) - sin(a) cos(b) cos(c).
    east = RADIUS_M * np.cos(other) * np.sin(away)
    bulge = 2.0 * np.sin(own) * np.cos(other) * np.sin(0.5 * away) ** 2
    north = RADIUS_M * (np.sin((lat2 - lat1) * RAD_PER_DEG) + bulge)
    return north, east, alt2 - alt1
