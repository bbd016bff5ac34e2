"""Lines of sight by five models of the Earth, in NED and in the ownship's body axes.

Each model but the geodesic is a function of `lat1, lon1, alt1, lat2, lon2, alt2`: the observer and
the target, in degrees and m, contiguous arrays of at least one axis, within bounds. It returns the
target's offsets north, east and up in m, without checks. `LineOfSight` is their front.

Measured against `ellipsoid.line_of_sight`, worst of 20,000 pairs with latitudes within ±60 degrees,
0-12 km altitude and slopes within ±0.1, azimuth and elevation in degrees:

=========== ====================== ===================== ==================== ================
model       1 km                   10 km                 50 km                time per pair
=========== ====================== ===================== ==================== ================
flat Earth  0.19, 0.034, 0.56 %    0.20, 0.075, 0.56 %   0.47, 0.27, 0.77 %   20 ns
local radii 0.0084, 0.0048, 0.006% 0.084, 0.048, 0.058 % 0.42, 0.24, 0.29 %   30 ns
geodesic    0.0004, 0.015, 0.19 %  0.0004, 0.056, 0.19 % 0.0005, 0.24, 0.22 % 32 us (0.45 us)
=========== ====================== ===================== ==================== ================

Planes leave out that the vertical turns (0.0045 degrees per km) and that meridians converge, which
grows with tan(latitude): 1.4 degrees in azimuth at 50 km and 80 degrees of latitude; they are
useless at the poles. The flat Earth's sphere is not the ellipsoid (0.19 degrees and 0.5 % at any
distance). The geodesic's 0.19 % is 12 km of altitude over the Earth's radius.

The sphere of DAIDALUS is the plane in which the alerting logic of DO-365 compares aircraft. One
minute of arc is a nautical mile. Positions are projected orthographically onto the plane that
touches it below the ownship; heights are altitudes, without curvature. Against WGS 84 a range of
7 nmi may be some 0.3 % off: alerts differ from those of an exact Earth by that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from components.arguments.checks import broadcast_results, check_positions
from components.geometry.angles import (
    RAD_PER_DEG,
    longitude_difference_rounded,
    wrap_negative_to_positive_rad,
)
from components.geometry.ellipsoid import (
    azimuth_elevation_range_from_neu,
    north_east_up_offsets_m,
    radii_of_curvature,
)
from components.geometry.sensor_axes import MODELS as ATTITUDE_MODELS
from components.geometry.sensor_axes import body_angles_of_offsets, body_angles_of_sight_line
from dsa_des.arrays.types import FloatArray

METRES_PER_DEGREE = 111195.0
"""Thesis §3.3: one degree on a sphere of radius 6371 km."""
#: Radius of the sphere, m.
RADIUS_M = 1852.0 * 60.0 * 180.0 / math.pi
# Velocities are projected as the difference of positions this far apart in time.
_AHEAD_S = 10.0

BACKENDS = ("geographiclib", "pyproj")


def flat_earth_offsets(
    lat1: FloatArray,
    lon1: FloatArray,
    alt1: FloatArray,
    lat2: FloatArray,
    lon2: FloatArray,
    alt2: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return north, east and up offsets (m) of point 2 from point 1 on a flat Earth of 111,195 m
    per degree (thesis eq. 1-5, corrected).

    Thesis eq. 2 exchanges X and Y and takes the cosine of a longitude; eq. 5 has asin(h/R). Here
    east = wrap(dlon)·111195·cos(latitude of the ownship), north = dlat·111195 and
    elevation = atan2(dh, hypot(east, north)).
    """
    north = (lat2 - lat1) * METRES_PER_DEGREE
    # cos(latitude) as the sine of the distance from the pole, exactly 0 at the pole
    shrink = np.sin((90.0 - np.abs(lat1)) * RAD_PER_DEG) * METRES_PER_DEGREE
    return north, longitude_difference_rounded(lon1, lon2) * shrink, alt2 - alt1


def local_radii_offsets(
    lat1: FloatArray,
    lon1: FloatArray,
    alt1: FloatArray,
    lat2: FloatArray,
    lon2: FloatArray,
    alt2: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return north, east, up offsets (m) of point 2 from point 1, by the radii at point 1.

    north = (M + h)·dlat, east = (N + h)·cos(lat)·dlon, up = dh, with the meridian radius M and
    the prime vertical radius N of WGS-84 at the ownship's latitude, and h the ownship's altitude.
    """
    meridian, prime_vertical = radii_of_curvature(lat1)
    north = (lat2 - lat1) * RAD_PER_DEG * (meridian + alt1)
    parallel = (prime_vertical + alt1) * np.sin((90.0 - np.abs(lat1)) * RAD_PER_DEG)
    east = longitude_difference_rounded(lon1, lon2) * RAD_PER_DEG * parallel
    return north, east, alt2 - alt1


def east_north_m(
    lat_rad: FloatArray, lon_rad: FloatArray, own_lat_rad: FloatArray, own_lon_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far east and north (m) of the ownship a position lies, all of one shape.

    In the plane that touches the sphere below the ownship.
    """
    away = lon_rad - own_lon_rad
    east = RADIUS_M * np.cos(lat_rad) * np.sin(away)
    north = RADIUS_M * (
        np.cos(own_lat_rad) * np.sin(lat_rad) - np.sin(own_lat_rad) * np.cos(lat_rad) * np.cos(away)
    )
    return east, north


def find_plane_scale(lat_deg: FloatArray, alt_m: FloatArray) -> FloatArray:
    """Return metres over the ground per metre in `east_north_m`'s plane, east and north (2, n)."""
    meridian_m, prime_vertical_m = radii_of_curvature(lat_deg)
    return (np.stack([prime_vertical_m, meridian_m]) + alt_m) / RADIUS_M


def east_north_mps(
    lat_rad: FloatArray,
    lon_rad: FloatArray,
    east_mps: FloatArray,
    north_mps: FloatArray,
    own_lat_rad: FloatArray,
    own_lon_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return a velocity's east and north (m/s) in the sphere's tangent plane at the ownship.

    Its position and its velocity over ground there are given, of one shape, the ownship itself too.
    The result is the mean over the next ten seconds along a great circle.
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


def daidalus_sphere_offsets(
    lat1: FloatArray,
    lon1: FloatArray,
    alt1: FloatArray,
    lat2: FloatArray,
    lon2: FloatArray,
    alt2: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return north, east, up (m) of point 2 from 1 in `east_north_m`'s plane, accurate also nearby.

    Beyond a quarter of the way around the Earth the projection comes back: what is there seems
    nearer than it is.
    """
    away = longitude_difference_rounded(lon1, lon2) * RAD_PER_DEG
    own, other = lat1 * RAD_PER_DEG, lat2 * RAD_PER_DEG
    # sin(b - a) + sin(a) cos(b) (1 - cos c) is cos(a) sin(b) - sin(a) cos(b) cos(c).
    east = RADIUS_M * np.cos(other) * np.sin(away)
    bulge = 2.0 * np.sin(own) * np.cos(other) * np.sin(0.5 * away) ** 2
    north = RADIUS_M * (np.sin((lat2 - lat1) * RAD_PER_DEG) + bulge)
    return north, east, alt2 - alt1


def geodesic_line_of_sight(
    own_lat_deg: npt.ArrayLike,
    own_lon_deg: npt.ArrayLike,
    own_alt_m: npt.ArrayLike,
    lat_deg: npt.ArrayLike,
    lon_deg: npt.ArrayLike,
    alt_m: npt.ArrayLike,
    *,
    validate: bool = True,
    backend: str = "geographiclib",
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a target's azimuth, elevation (rad), range (m) by geodesic distance and altitude.

    Parameters
    ----------
    own_lat_deg, own_lon_deg, own_alt_m, lat_deg, lon_deg, alt_m, validate
        As for `components.geometry.ellipsoid.line_of_sight`.
    backend : {"geographiclib", "pyproj"}
        GeographicLib in Python, or the same algorithm compiled, through pyproj's `Geod`
        (an extra: `pip install 'dsa-des[geodesic]'`).

    Returns
    -------
    azimuth_rad, elevation_rad, range_m : ndarray
        Azimuth of the geodesic at the ownship in [0, 2 pi), atan2(dh, s) and hypot(s, dh), where
        s is the ground distance along the geodesic; all 0 at the same point.

    Raises
    ------
    ValueError
        An unknown backend, or as for `components.geometry.ellipsoid.line_of_sight`.
    ImportError
        backend="pyproj" without pyproj.

    Notes
    -----
    Karney, "Algorithms for geodesics", Journal of Geodesy 87 (2013). Distance over the ground
    and azimuth are right to 15 nm, but that is another question than a line of sight: it knows
    neither the curvature in elevation nor the growth of distances with altitude. 32 us per pair
    with GeographicLib's Python, 0.45 us with pyproj; the two agree to 2 nm in range and 3e-14 rad.
    """
    if backend not in BACKENDS:
        allowed = " or ".join(repr(name) for name in BACKENDS)
        raise ValueError(f"backend is {backend!r}: it must be {allowed}")
    arrays, shape = check_positions(
        own_lat_deg, own_lon_deg, own_alt_m, lat_deg, lon_deg, alt_m, validate
    )
    lat1, lon1, alt1, lat2, lon2, alt2 = (
        np.ascontiguousarray(x).reshape(-1) for x in np.broadcast_arrays(*arrays)
    )
    inverse = _inverse_pyproj if backend == "pyproj" else _inverse_geographiclib
    azimuth_deg, ground = inverse(lat1, lon1, lat2, lon2)
    # For coincident points the geodesic's azimuth is a convention (180 in PROJ); ours is 0.
    azimuth = wrap_negative_to_positive_rad(np.where(ground == 0.0, 0.0, azimuth_deg) * RAD_PER_DEG)
    rise = alt2 - alt1
    with np.errstate(under="ignore"):
        result = azimuth, np.arctan2(rise, ground), np.hypot(ground, rise)
    azimuth, elevation, slant_range = (broadcast_results(shape, x)[0] for x in result)
    return azimuth, elevation, slant_range


def _inverse_geographiclib(
    lat1: FloatArray, lon1: FloatArray, lat2: FloatArray, lon2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    from geographiclib.geodesic import Geodesic

    wgs84, wanted = Geodesic.WGS84, Geodesic.AZIMUTH | Geodesic.DISTANCE
    azimuth, ground = np.empty(lat1.size), np.empty(lat1.size)
    rows = zip(lat1.tolist(), lon1.tolist(), lat2.tolist(), lon2.tolist(), strict=True)
    for index, row in enumerate(rows):
        solution = wgs84.Inverse(*row, wanted)
        azimuth[index], ground[index] = solution["azi1"], solution["s12"]
    return azimuth, ground


def _inverse_pyproj(
    lat1: FloatArray, lon1: FloatArray, lat2: FloatArray, lon2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    geod = _pyproj_geod()
    azimuth, _, ground = geod.inv(lon1, lat1, lon2, lat2)
    return np.asarray(azimuth), np.asarray(ground)


def _pyproj_geod() -> Any:
    try:
        from pyproj import Geod
    except ImportError as error:
        raise ImportError(
            "backend='pyproj' needs the library pyproj: pip install 'dsa-des[geodesic]'"
        ) from error
    return Geod(ellps="WGS84")


# Those that find offsets; the directions' angles in body axes then need no sines of angles.
_OFFSETS: dict[str, Callable[..., tuple[FloatArray, FloatArray, FloatArray]]] = {
    "flat_earth": flat_earth_offsets,
    "local_radii": local_radii_offsets,
    "daidalus_sphere": daidalus_sphere_offsets,
    "ellipsoid": north_east_up_offsets_m,
}

EARTH_MODELS = ("flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid")
"""Models of the Earth, crude to exact."""


class SeenFromOwnship(NamedTuple):
    """Lines of sight in the ownship's NED frame and in its body axes; arrays of one shape.

    Parameters
    ----------
    azimuth_rad, elevation_rad : ndarray
        In NED: clockwise from true north in [0, 2 pi), above the horizontal.
    range_m : ndarray
        Slant range.
    body_azimuth_rad, body_elevation_rad : ndarray
        In body axes: from the nose towards the right wing in (-pi, pi], above the wings' plane.
    """

    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    range_m: FloatArray
    body_azimuth_rad: FloatArray
    body_elevation_rad: FloatArray


class LineOfSight:
    """Lines of sight by one model of the Earth and one of the ownship's attitude.

    Parameters
    ----------
    earth : {"flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid"}
        See the module.
    attitude : {"exact", "small_angle"}
        As for `components.geometry.sensor_axes`.

    Raises
    ------
    ValueError
        An unknown model.
    """

    def __init__(self, earth: str = "ellipsoid", attitude: str = "exact") -> None:
        for name, value, models in (
            ("earth", earth, EARTH_MODELS),
            ("attitude", attitude, ATTITUDE_MODELS),
        ):
            if value not in models:
                allowed = ", ".join(map(repr, models))
                raise ValueError(f"{name} is {value!r}: it must be one of {allowed}")
        self.earth, self.attitude = earth, attitude
        self._offsets = _OFFSETS.get(earth)

    def in_ned(
        self,
        own_lat_deg: Any,
        own_lon_deg: Any,
        own_alt_m: Any,
        lat_deg: Any,
        lon_deg: Any,
        alt_m: Any,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuth, elevation (rad), slant range (m) in the NED frame, as `line_of_sight`."""
        coordinates = own_lat_deg, own_lon_deg, own_alt_m, lat_deg, lon_deg, alt_m
        return self._in_ned(coordinates, validate=True)

    def from_ownship(self, own: Any, other: Any) -> SeenFromOwnship:
        """Return targets' azimuth, elevation, range (NED), azimuth, elevation (body), unchecked.

        Both have ``lat_deg``, ``lon_deg`` and ``alt_m``, the ownship ``yaw_rad``, ``pitch_rad`` and
        ``roll_rad`` as well: finite doubles of one axis up that broadcast, the targets' of the
        broadcast shape.
        """
        coordinates = own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m
        attitude = own.yaw_rad, own.pitch_rad, own.roll_rad
        if self._offsets is None or self.attitude != "exact":
            seen = self._in_ned(coordinates, validate=False)
            body = body_angles_of_sight_line(
                *seen[:2], *attitude, model=self.attitude, validate=False
            )
            return SeenFromOwnship(*seen, *body)
        with np.errstate(under="ignore"):  # what is too small for a double is zero
            offsets = self._offsets(*coordinates)
            return SeenFromOwnship(
                *azimuth_elevation_range_from_neu(*offsets),
                *body_angles_of_offsets(*offsets, *attitude),
            )

    def _in_ned(
        self, coordinates: tuple[Any, Any, Any, Any, Any, Any], *, validate: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        if self._offsets is None:
            return geodesic_line_of_sight(*coordinates, validate=validate)
        arrays, shape = check_positions(*coordinates, validate=validate)
        with np.errstate(under="ignore"):  # offsets below 1e-150 m square to zero
            seen = azimuth_elevation_range_from_neu(*self._offsets(*arrays))
        azimuth, elevation, range_m = broadcast_results(shape, *seen)
        return azimuth, elevation, range_m
