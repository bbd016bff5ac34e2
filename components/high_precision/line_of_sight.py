"""Lines of sight at 40 digits, through Earth-centred coordinates.

The yardstick for the reference rungs of ladders. It is slow and needs mpmath.
"""

from typing import Any

from components.high_precision.multiprecision import mpmath_library

DIGITS = 40


def line_of_sight_errors(
    own: tuple[float, float, float],
    other: tuple[float, float, float],
    attitude: tuple[float, float, float],
    given: tuple[float, float, float],
) -> tuple[float, float, float, float]:
    """Return absolute errors against many digits: direction, azimuth, elevation (rad), range (m).

    Through Earth-centred coordinates, the textbook way that loses digits in doubles.

    Parameters
    ----------
    own, other : latitude and longitude in degrees, altitude in metres (WGS-84)
    attitude : yaw, pitch and roll of the ownship (ZYX), rad
    given : azimuth and elevation in body axes in rad and slant range in m, to be judged

    Returns
    -------
    direction, azimuth, elevation : float, rad
    range : float, m

    Raises
    ------
    ImportError
        If mpmath is not installed.
    """
    mp = mpmath_library()
    with mp.workdps(DIGITS):
        here, there = _to_earth_centred(mp, *own), _to_earth_centred(mp, *other)
        apart = [t - h for t, h in zip(there, here, strict=True)]
        body = _to_body(mp, _to_ned(mp, apart, own[0], own[1]), attitude)
        distance = mp.sqrt(sum(part * part for part in body))
        azimuth = mp.atan2(body[1], body[0])
        elevation = mp.atan2(-body[2], mp.hypot(body[0], body[1]))
        p, q = mp.mpf(float(given[0])), mp.mpf(float(given[1]))
        seen = (mp.cos(q) * mp.cos(p), mp.cos(q) * mp.sin(p), -mp.sin(q))
        across = _cross(seen, body)
        along = sum(s * b for s, b in zip(seen, body, strict=True))
        off = mp.atan2(mp.sqrt(sum(part * part for part in across)), along)
        turn = p - azimuth
        turn -= 2 * mp.pi * mp.nint(turn / (2 * mp.pi))
        return (
            float(off),
            float(abs(turn)),
            float(abs(q - elevation)),
            float(abs(mp.mpf(float(given[2])) - distance)),
        )


def _to_earth_centred(mp: Any, lat_deg: float, lon_deg: float, alt_m: float) -> tuple[Any, ...]:
    flattening = 1 / mp.mpf("298.257223563")
    e2 = flattening * (2 - flattening)
    lat, lon = mp.radians(mp.mpf(float(lat_deg))), mp.radians(mp.mpf(float(lon_deg)))
    height = mp.mpf(float(alt_m))
    normal = mp.mpf(6378137) / mp.sqrt(1 - e2 * mp.sin(lat) ** 2)
    level = (normal + height) * mp.cos(lat)
    return level * mp.cos(lon), level * mp.sin(lon), (normal * (1 - e2) + height) * mp.sin(lat)


def _to_ned(mp: Any, vector: list[Any], lat_deg: float, lon_deg: float) -> tuple[Any, ...]:
    lat, lon = mp.radians(mp.mpf(float(lat_deg))), mp.radians(mp.mpf(float(lon_deg)))
    x, y, z = vector
    outward = mp.cos(lon) * x + mp.sin(lon) * y
    return (
        -mp.sin(lat) * outward + mp.cos(lat) * z,
        -mp.sin(lon) * x + mp.cos(lon) * y,
        -(mp.cos(lat) * outward + mp.sin(lat) * z),
    )


def _to_body(mp: Any, ned: tuple[Any, ...], attitude: tuple[float, float, float]) -> Any:
    yaw, pitch, roll = (mp.mpf(float(angle)) for angle in attitude)
    north, east, down = ned
    x, y = mp.cos(yaw) * north + mp.sin(yaw) * east, mp.cos(yaw) * east - mp.sin(yaw) * north
    x, z = mp.cos(pitch) * x - mp.sin(pitch) * down, mp.sin(pitch) * x + mp.cos(pitch) * down
    return x, mp.cos(roll) * y + mp.sin(roll) * z, mp.cos(roll) * z - mp.sin(roll) * y


def _cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
