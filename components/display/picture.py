"""What pictures of a run have in common: a plane, and where what was measured lies on the Earth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry import body_to_ned, enu_to_geodetic, line_of_sight_ned
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray


@dataclass(frozen=True)
class TangentPlane:
    """The tangent plane at a place of the Earth (WGS 84): east and north of it, m."""

    lat_deg: float
    lon_deg: float

    def east_north_m(
        self, lat_deg: AnyArray, lon_deg: AnyArray, alt_m: AnyArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return where positions lie in the plane; NaN where they are not known."""
        known = np.isfinite(lat_deg) & np.isfinite(lon_deg) & np.isfinite(alt_m)
        east, north = np.full(known.shape, np.nan), np.full(known.shape, np.nan)
        if known.any():
            north[known], east[known], _ = line_of_sight_ned(
                self.lat_deg, self.lon_deg, 0.0, lat_deg[known], lon_deg[known], alt_m[known]
            )
        return east, north


def offset_positions(ned_m: FloatArray, origin: Sequence[FloatArray]) -> FloatArray:
    """Return latitude, longitude (deg) and altitude (m), (3, n), of offsets from origins alike.

    NaN where the offset (3, n) north, east and down is not known.
    """
    result = np.full(ned_m.shape, np.nan)
    known = np.isfinite(ned_m[0])
    if known.any():
        north_m, east_m, down_m = ned_m[:, known]
        lat_deg, lon_deg, alt_m = (part[known] for part in origin)
        result[:, known] = enu_to_geodetic(
            east_m, north_m, -down_m,
            reference_lat_deg=lat_deg, reference_lon_deg=lon_deg, reference_alt_m=alt_m,
        )  # fmt: skip
    return result


def sights(
    azimuth_rad: FloatArray, elevation_rad: FloatArray, range_m: FloatArray, pose: Sequence[Any]
) -> tuple[FloatArray, FloatArray]:
    """Return bearings of measured lines of sight, rad from north, and where they end, (3, n).

    A pose is latitude, longitude (deg), altitude (m), heading, pitch and roll (rad). What is not
    known is NaN.
    """
    known = np.flatnonzero(np.isfinite(pose[0]) & np.isfinite(azimuth_rad))
    ranged = known[np.isfinite(range_m[known])]

    def ned(rows: IntArray, far_m: Any) -> FloatArray:
        result = np.full((3, len(azimuth_rad)), np.nan)
        if len(rows):
            azimuth, elevation = azimuth_rad[rows], elevation_rad[rows]
            level = np.cos(elevation) * far_m
            body = level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation) * far_m
            result[:, rows] = body_to_ned(*body, *(angle[rows] for angle in pose[3:]))
        return result

    north, east, _ = ned(known, 1.0)
    return np.arctan2(east, north), offset_positions(ned(ranged, range_m[ranged]), pose[:3])
