"""Crooked flights, and where everything in them is by pymap3d and rotation matrices.

The ownship is banked and pitched, crabs, heads 217 deg and crosses the antimeridian south of the
equator; its targets roll, climb and point elsewhere than they fly. No two frames coincide, so a
quantity taken in the wrong one shows. Nothing here is computed by the project.
"""

import math
from typing import Any

import numpy as np
import pymap3d

Vector = Any

OWNSHIP: dict[str, Any] = {
    "lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0, "heading_deg": 217.0,
    "speed_mps": 70.0, "climb_mps": 3.0, "yaw_deg": 222.0, "pitch_deg": 8.0, "roll_deg": -27.0,
}  # fmt: skip

ROLLING: dict[str, Any] = {
    "name": "rolling", "east_m": -2349.0, "north_m": -855.0, "up_m": 420.0, "heading_deg": 35.0,
    "speed_mps": 60.0, "climb_mps": 7.0, "yaw_deg": 31.0, "pitch_deg": 11.0, "roll_deg": 38.0,
}  # fmt: skip
DIVING: dict[str, Any] = {
    "name": "diving", "east_m": -100.0, "north_m": -1900.0, "up_m": -510.0, "heading_deg": 290.0,
    "speed_mps": 85.0, "climb_mps": -9.0, "yaw_deg": 297.0, "pitch_deg": -14.0, "roll_deg": -52.0,
}  # fmt: skip
TARGETS = (ROLLING, DIVING)


def position(flight: dict[str, Any], time_s: float = 0.0, ownship: Any = None) -> Vector:
    """Return the ECEF position of a straight flight, good to millimetres for a few seconds."""
    start = ownship or OWNSHIP
    reference = start["lat_deg"], start["lon_deg"], start["alt_m"]
    if "lat_deg" in flight:
        place = flight["lat_deg"], flight["lon_deg"], flight["alt_m"]
    else:
        offset = flight["east_m"], flight["north_m"], flight["up_m"]
        place = pymap3d.enu2geodetic(*offset, *reference)
    heading = math.radians(flight["heading_deg"])
    along = flight["speed_mps"] * time_s
    moved = along * math.sin(heading), along * math.cos(heading), flight["climb_mps"] * time_s
    # The level path follows the Earth, the tangent does not.
    bent = moved[0], moved[1], moved[2] - along**2 / (2.0 * 6.371e6)
    return np.array(pymap3d.enu2ecef(*bent, *place))


def geodetic(ecef: Vector) -> tuple[float, float, float]:
    """Return latitude (deg), longitude (deg) and height above the ellipsoid (m)."""
    lat, lon, alt = pymap3d.ecef2geodetic(*ecef)
    return float(lat), float(lon), float(alt)


def ned(target: dict[str, Any], time_s: float = 0.0, ownship: Any = None) -> Vector:
    """Return the vector from the ownship to a target in the ownship's NED frame, m."""
    own = ownship or OWNSHIP
    here = geodetic(position(own, time_s, own))
    return np.array(pymap3d.ecef2ned(*position(target, time_s, own), *here))


def rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Vector:
    """Return the matrix that takes NED components into those along body axes."""
    y, p, r = np.radians([yaw_deg, pitch_deg, roll_deg])
    about_down = [[math.cos(y), math.sin(y), 0], [-math.sin(y), math.cos(y), 0], [0, 0, 1]]
    about_right = [[math.cos(p), 0, -math.sin(p)], [0, 1, 0], [math.sin(p), 0, math.cos(p)]]
    about_nose = [[1, 0, 0], [0, math.cos(r), math.sin(r)], [0, -math.sin(r), math.cos(r)]]
    return np.array(about_nose) @ np.array(about_right) @ np.array(about_down)


def attitude(flight: dict[str, Any]) -> Vector:
    """Return the rotation of an aircraft with fixed attitude."""
    return rotation(flight["yaw_deg"], flight["pitch_deg"], flight["roll_deg"])


def angles(vector: Vector) -> tuple[float, float]:
    """Return azimuth (clockwise from the first axis) and elevation of a vector, rad."""
    x, y, z = vector
    return math.atan2(y, x), math.asin(-z / float(np.linalg.norm(vector)))


def direction(azimuth_rad: float, elevation_rad: float) -> Vector:
    """Return the unit vector of azimuth and elevation."""
    level = math.cos(elevation_rad)
    return np.array(
        [level * math.cos(azimuth_rad), level * math.sin(azimuth_rad), -math.sin(elevation_rad)]
    )


def body(target: dict[str, Any], time_s: float = 0.0, ownship: Any = None) -> Vector:
    """Return the vector from the ownship to a target in the ownship's body axes, m."""
    return attitude(ownship or OWNSHIP) @ ned(target, time_s, ownship)


def aspect(target: dict[str, Any], time_s: float = 0.0, ownship: Any = None) -> Vector:
    """Return the vector from a target to the ownship in the target's body axes, m.

    The target's attitude is understood in the ownship's NED frame, as the project states it; the
    meridians of the two converge by 0.02 deg.
    """
    return attitude(target) @ -ned(target, time_s, ownship)
