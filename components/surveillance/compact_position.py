"""Compact position reports of airborne aircraft: 17 bits each of latitude and longitude.

RTCA DO-260B, appendix A.1.7 (ICAO Doc 9871, C.2.6): the globe is cut into zones, and a report says
where in its zone the aircraft is. Even reports have 60 zones of latitude, odd ones 59.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_ZONES = 15
#: Parts of a zone.
PARTS = 2**17

# Latitudes at which a circle of latitude has one zone fewer, descending from 87 degrees (2 zones).
_NUMBERS = np.arange(2, 60)
_FEWER = np.degrees(
    np.arccos(
        np.minimum(
            np.sqrt((1.0 - np.cos(np.pi / (2 * _ZONES))) / (1.0 - np.cos(2.0 * np.pi / _NUMBERS))),
            1.0,
        )
    )
)
_FEWER[0] = 87.0
_RISING = _FEWER[::-1]


def number_of_longitude_zones(lat_deg: npt.ArrayLike) -> IntArray:
    """Return the number of zones of longitude at latitudes, 59 at the equator to 1 at the poles.

    At 87 degrees itself there are 2. The latitude of each change is that of the closed form.
    """
    lat = np.abs(np.asarray(lat_deg, dtype=np.float64))
    zones: IntArray = 59 - np.searchsorted(_RISING, lat, side="left")
    return zones


def encode(
    lat_deg: npt.ArrayLike, lon_deg: npt.ArrayLike, odd: npt.ArrayLike
) -> tuple[IntArray, IntArray]:
    """Return positions (deg) as CPR latitude, longitude, integers 0 to 131071; odd format if `odd`.

    `odd` says which format each report has. ValueError if a latitude lies beyond a pole or a number
    is not finite.
    """
    lat, lon, odd = np.broadcast_arrays(
        np.asarray(lat_deg, np.float64), np.asarray(lon_deg, np.float64), np.asarray(odd, bool)
    )
    if not (np.abs(lat) <= 90.0).all():
        wrong = lat[~(np.abs(lat) <= 90.0)].flat[0]
        raise ValueError(f"lat_deg is {wrong:g}: it must lie in [-90, 90] degrees")
    if not np.isfinite(lon).all():
        raise ValueError("lon_deg must be finite")
    height = _latitude_zone_deg(odd)
    zone, share = _zone_and_share(lat, height)
    y = np.floor(PARTS * share + 0.5)
    believed = height * (y / PARTS + zone)
    width = _longitude_zone_deg(believed, odd)
    x = np.floor(PARTS * _zone_and_share(lon, width)[1] + 0.5)
    return y.astype(np.int64) % PARTS, x.astype(np.int64) % PARTS


def decode_near(
    y: IntArray, x: IntArray, odd: BoolArray, near_lat_deg: Any, near_lon_deg: Any
) -> tuple[FloatArray, FloatArray]:
    """Return latitude and longitude (deg) of single CPR reports, nearest to a known position.

    Unambiguous within half a zone, 180 nmi, of the position; longitude in [-180, 180).
    """
    height = _latitude_zone_deg(odd)
    lat = _angle_nearest_to(y / PARTS, np.asarray(near_lat_deg, np.float64), height)
    width = _longitude_zone_deg(lat, odd)
    lon = _angle_nearest_to(x / PARTS, np.asarray(near_lon_deg, np.float64), width)
    return lat, _wrap_longitude(lon)


def decode_newer_of_pair(
    even: tuple[IntArray, IntArray], odd: tuple[IntArray, IntArray], odd_is_newer: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the latitude and longitude (deg) of the newer of an even and an odd CPR report.

    Reports are pairs of encoded latitude and longitude. NaN where the two lie on either side of a
    change of the number of zones, which no pair tells apart.
    """
    (y0, x0), (y1, x1) = even, odd
    newer = np.asarray(odd_is_newer, bool)
    zone = np.floor((59 * y0 - 60 * y1) / PARTS + 0.5)
    lat0 = 6.0 * (np.mod(zone, 60) + y0 / PARTS)
    lat1 = 360.0 / 59.0 * (np.mod(zone, 59) + y1 / PARTS)
    lat0, lat1 = (np.where(lat >= 270.0, lat - 360.0, lat) for lat in (lat0, lat1))
    zones = number_of_longitude_zones(lat0)
    fits = (
        (zones == number_of_longitude_zones(lat1)) & (np.abs(lat0) <= 90.0) & (np.abs(lat1) <= 90.0)
    )
    count = np.maximum(zones - newer, 1)
    zone = np.floor((x0 * (zones - 1) - x1 * zones) / PARTS + 0.5)
    lon = 360.0 / count * (np.mod(zone, count) + np.where(newer, x1, x0) / PARTS)
    lat = np.where(newer, lat1, lat0)
    return np.where(fits, lat, np.nan), np.where(fits, _wrap_longitude(lon), np.nan)


def _latitude_zone_deg(odd: BoolArray) -> FloatArray:
    return np.asarray(360.0 / (4 * _ZONES - np.asarray(odd, bool)))


def _longitude_zone_deg(lat_deg: FloatArray, odd: BoolArray) -> FloatArray:
    return np.asarray(360.0 / np.maximum(number_of_longitude_zones(lat_deg) - odd, 1))


def _angle_nearest_to(share: FloatArray, near: FloatArray, width: FloatArray) -> FloatArray:
    zone, near_share = _zone_and_share(near, width)
    return np.asarray(width * (zone + np.floor(0.5 + near_share - share) + share))


def _zone_and_share(angle_deg: FloatArray, width_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each angle's zone of `width_deg` by number, and its fraction from the lower edge."""
    zones = angle_deg / width_deg
    number = np.floor(zones)
    return number, zones - number


def _wrap_longitude(lon_deg: FloatArray) -> FloatArray:
    return np.asarray(np.mod(lon_deg + 180.0, 360.0) - 180.0)
