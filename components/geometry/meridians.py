"""North and east near a pole, where they turn about from place to place, and what does not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dsa_des.arrays.types import FloatArray

Place = tuple[ArrayLike, ArrayLike]
#: Nearer to a pole meridians turn by more than a milliradian over an error of 100 m.
NEAR_A_POLE_DEG = 89.0


def north_east_parts(
    axis: FloatArray, sideways: FloatArray, outward: FloatArray, lat_deg: ArrayLike,
    lon_deg: ArrayLike,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return vectors' north and east parts at a place, given along three Earth-fixed axes.

    These are the Earth's axis, east of Greenwich at the equator, and outwards there. Of three
    independent numbers of one deviation both parts have it, and they are independent too.
    """
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    east = np.cos(lon) * sideways - np.sin(lon) * outward
    level = np.cos(lon) * outward + np.sin(lon) * sideways
    return np.cos(lat) * axis - np.sin(lat) * level, east


def meridian_convergence_rad(here_deg: Place, there_deg: Place) -> FloatArray:
    """Return how much larger (rad) a direction's heading is at a nearby place than here.

    Places are latitude and longitude. Of a mean sphere; near a pole, where it matters, exact.
    """
    (lat, lon), (other_lat, other_lon) = (map(np.asarray, place) for place in (here_deg, there_deg))
    along = np.radians((other_lon - lon + 180.0) % 360.0 - 180.0)
    return np.asarray(along * np.sin(np.radians(0.5 * (lat + other_lat))))


def rotate_to_meridian(north_east_up: FloatArray, here_deg: Place, there_deg: Place) -> FloatArray:
    """Return vectors (3, n) of north, east and up here, by north, east and up nearby."""
    angle = meridian_convergence_rad(here_deg, there_deg)
    north, east, up = north_east_up
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * north - sine * east, sine * north + cosine * east, up])
