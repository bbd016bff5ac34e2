"""Two straight flights over the ellipsoid that are closest at an instant, as far apart as said.

At the instant of the closest approach the intruder stands at a horizontal distance in the
ownship's level plane and at a difference of altitude; where around the ownship follows from the
condition that the distance changes no more, Δr · Δv = 0, with both velocities in Earth-centred
axes. From there both fly back and on along geodesics. What is left is rounding: micrometres, and
microseconds at ordinary speeds.
"""

from dataclasses import dataclass

import numpy as np

from components.flights.geodesic_motion import geodesic_parameters, position_and_yaw_on_geodesic
from components.geometry import east_north_up_axes, enu_to_geodetic, line_of_sight_ned
from dsa_des.arrays.types import BoolArray, FloatArray

#: In which sense the aircraft are closest: by the slant range, or by the horizontal distance.
SENSES = ("slant", "horizontal")
_ROUNDS = 6


@dataclass(frozen=True)
class Approach:
    """Two aircraft's motion at closest approach; arrays are (2, encounters), the ownship first.

    The position is the ownship's, altitude alone counts. Miss distances (encounters,): to the
    right of the intruder's relative way where positive, seen from above; intruder above ownship.
    """

    lat_deg: float
    lon_deg: float
    altitude_m: FloatArray
    heading_rad: FloatArray
    speed_mps: FloatArray
    climb_mps: FloatArray
    horizontal_m: FloatArray
    vertical_m: FloatArray
    sense: str = "slant"


def both_intruder_headings_rad(
    own_heading_rad: FloatArray,
    own_speed: FloatArray,
    intruder_speed: FloatArray,
    bearing_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return both headings (rad) in which an intruder can close in from a bearing, or NaN.

    The bearing is that of the line on which it closes in, clockwise from the ownship's nose, rad.
    """
    along = -own_speed * np.cos(bearing_rad)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(along**2 - own_speed**2 + intruder_speed**2)
        sizes = (-along + root, -along - root)
        headings = []
        for size in sizes:
            good = size > 1e-9
            north = own_speed - size * np.cos(bearing_rad)
            east = -size * np.sin(bearing_rad)
            headings.append(np.where(good, own_heading_rad + np.arctan2(east, north), np.nan))
    return headings[0], headings[1]


def solve_intruder_positions(
    approach: Approach,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return the intruders' latitudes, longitudes (deg) and altitudes (m) at the closest approach,
    and a mask of encounters that are possible.

    One that climbs or sinks too fast past so small a distance, or does not move against the
    ownship, cannot be closest there.
    """
    a = approach
    north, east = (
        a.speed_mps[1] * f(a.heading_rad[1]) - a.speed_mps[0] * f(a.heading_rad[0])
        for f in (np.cos, np.sin)
    )
    across = np.hypot(north, east)
    rise = a.climb_mps[1] - a.climb_mps[0]
    distance = np.abs(a.horizontal_m)
    lift = a.vertical_m * rise if a.sense == "slant" else np.zeros_like(rise)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.where(lift == 0.0, 0.0, -lift / (distance * across))
    possible = (across > 1e-6) & (np.abs(cosine) < 1.0)
    off = np.arccos(np.where(possible, cosine, 0.0))
    # Right of the way that the intruder takes past the ownship is where it leads to, less 90°.
    side = np.where(a.horizontal_m < 0.0, 1.0, -1.0)
    angle = np.arctan2(east, north) + side * off
    for _ in range(_ROUNDS):
        lat, lon, altitude = _intruder_positions_at_angle(a, angle)
        value = _relative_position_dot_velocity(a, lat, lon, altitude)
        # The derivative in the plane: Newton on the angle converges at once.
        slope = distance * (east * np.cos(angle) - north * np.sin(angle))
        step = np.where(possible & (np.abs(slope) > 0.0), value / np.where(slope, slope, 1.0), 0.0)
        angle = angle - step
    lat, lon, altitude = _intruder_positions_at_angle(a, angle)
    return lat, lon, altitude, possible


def _intruder_positions_at_angle(
    a: Approach, angle: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    distance = np.abs(a.horizontal_m)
    altitude = a.altitude_m[0] + a.vertical_m
    up = a.vertical_m.copy()
    for _ in range(3):  # until the point has its altitude, and its position in the level plane
        lat, lon, got = enu_to_geodetic(
            distance * np.sin(angle), distance * np.cos(angle), up, reference_lat_deg=a.lat_deg,
            reference_lon_deg=a.lon_deg, reference_alt_m=a.altitude_m[0],
        )  # fmt: skip
        up = up + altitude - got
    return lat, lon, altitude


def _relative_position_dot_velocity(
    a: Approach, lat: FloatArray, lon: FloatArray, altitude: FloatArray
) -> FloatArray:
    """Return relative position dot velocity, horizontal only if ``sense`` is horizontal."""
    own_lat, own_lon = np.full_like(lat, a.lat_deg), np.full_like(lat, a.lon_deg)
    n, e, d = line_of_sight_ned(own_lat, own_lon, a.altitude_m[0], lat, lon, altitude)
    own, other = east_north_up_axes(own_lat, own_lon), east_north_up_axes(lat, lon)
    relative = np.zeros((3, len(lat)))
    for k, axes, sign in ((0, own, -1.0), (1, other, 1.0)):
        parts = (
            a.speed_mps[k] * np.sin(a.heading_rad[k]),
            a.speed_mps[k] * np.cos(a.heading_rad[k]),
            a.climb_mps[k],
        )
        for part, axis in zip(parts, axes, strict=True):
            relative += sign * part * np.array(axis)
    v_east, v_north, v_up = ((relative * np.array(axis)).sum(axis=0) for axis in own)
    level: FloatArray = n * v_north + e * v_east
    return level if a.sense == "horizontal" else level - d * v_up


def fly_paths(
    approach: Approach, closest_s: FloatArray, time_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return latitudes, longitudes (deg) and altitudes (m) of both flights, each (2, n, instants),
    and a mask of encounters that are possible.
    """
    a = approach
    lat, lon, altitude, possible = solve_intruder_positions(a)
    paths = []
    for k, (at_lat, at_lon, at_alt) in enumerate(
        (
            (np.full_like(lat, a.lat_deg), np.full_like(lat, a.lon_deg), a.altitude_m[0]),
            (lat, lon, altitude),
        )
    ):
        table = geodesic_parameters(
            at_lat, at_lon, at_alt, a.heading_rad[k], a.speed_mps[k], a.climb_mps[k]
        )
        elapsed = time_s[np.newaxis] - closest_s[:, np.newaxis]
        state = position_and_yaw_on_geodesic(
            np.repeat(table, len(time_s), axis=1), elapsed.reshape(-1)
        )
        paths.append([values.reshape(elapsed.shape) for values in state[:3]])
    lats, lons, alts = (np.array(values) for values in zip(*paths, strict=True))
    return lats, lons, alts, possible


def project_to_north_east_m(
    lat_deg: FloatArray, lon_deg: FloatArray, reference_deg: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return north and east (m) of points in the plane that touches the ellipsoid at a reference.

    `enu_to_geodetic` with up 0 leads back to the same latitude and longitude.
    """
    altitude = np.zeros_like(lat_deg)
    for _ in range(5):  # each brings the point 10⁻⁵ nearer to the plane, over tens of kilometres
        north, east, down = line_of_sight_ned(
            reference_deg[0], reference_deg[1], 0.0, lat_deg, lon_deg, altitude, validate=False
        )
        altitude = altitude + down
    return north, east
