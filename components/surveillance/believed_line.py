"""The line of sight to where an aircraft says it is, as the ownship believes it, and its errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from components.geometry import body_angles_unchecked, line_of_sight_ned, ned_to_body_unchecked
from components.sensor.grid import VARIANCE_OF
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray

# Nearer to the vertical of the body an azimuth says nothing; nearer than this a range is none.
_LEAST_COS, _NEAREST_M = 1e-3, 1e-3


@dataclass(frozen=True)
class OwnBelief:
    """The ownship's position and attitude as it believes them, (n,) each."""

    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    yaw_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray

    @classmethod
    def from_cells(cls, cells: Cells, which: IntArray) -> OwnBelief:
        """Return the position and attitude that the ownship believes at chosen cells' scans."""
        return cls(*(cells.believed_pose_component(name)[which] for name in cls.__annotations__))

    @property
    def attitude(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Believed yaw, pitch and roll in rad, each (n,)."""
        return self.yaw_rad, self.pitch_rad, self.roll_rad


def ned_from_believed_position_m(
    own: OwnBelief, lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray
) -> FloatArray:
    """Return positions relative to the believed own one, along north, east, down, (3, n), m."""
    return np.stack(
        line_of_sight_ned(
            own.lat_deg, own.lon_deg, own.alt_m, lat_deg, lon_deg, alt_m, validate=False
        )
    )


def ned_to_azimuth_elevation_range(
    own: OwnBelief, ned: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return believed-body azimuth, elevation (rad) and range (m) of relative positions (3, n)."""
    body = ned_to_body_unchecked(ned[0], ned[1], ned[2], *own.attitude)
    azimuth, elevation = body_angles_unchecked(*body)
    range_m = np.maximum(np.sqrt((ned**2).sum(axis=0)), _NEAREST_M)
    return np.asarray(azimuth), np.asarray(elevation), range_m


def line_of_sight_variances(
    own: OwnBelief,
    ned: FloatArray,
    variance: tuple[FloatArray, FloatArray, FloatArray],
    off_m: FloatArray | None = None,
) -> dict[str, FloatArray]:
    """Return body-axis variances of azimuth, elevation (rad²), range (m²), by column name.

    `variance` holds those of the position along three directions at right angles, m²: across the
    line of sight in the horizontal, along it in the horizontal, and vertical. `off_m` (3, n) is
    one standard deviation of an error besides, north, east and down.
    """
    ground = np.maximum(np.hypot(ned[0], ned[1]), _NEAREST_M)
    range_m = np.maximum(np.hypot(ground, ned[2]), _NEAREST_M)
    zero, one = np.zeros_like(ground), np.ones_like(ground)
    side = np.stack([-ned[1] / ground, ned[0] / ground, zero])
    ahead = np.stack([ned[0] / ground, ned[1] / ground, zero])
    body = [
        np.stack(ned_to_body_unchecked(axis[0], axis[1], axis[2], *own.attitude))
        for axis in (side, ahead, np.stack([zero, zero, one]), *(() if off_m is None else (off_m,)))
    ]
    azimuth, elevation, _ = ned_to_azimuth_elevation_range(own, ned)
    level = np.maximum(np.cos(elevation), _LEAST_COS)
    flat = np.cos(elevation)
    along = np.stack([np.cos(azimuth) * flat, np.sin(azimuth) * flat, -np.sin(elevation)])
    across = np.stack([-np.sin(azimuth), np.cos(azimuth), zero])
    upward = np.cross(across, along, axis=0)
    turned = [zero, zero, zero]
    for axis, square in zip(body, (*variance, one), strict=False):
        for number, direction in enumerate((across, upward, along)):
            turned[number] = turned[number] + (axis * direction).sum(axis=0) ** 2 * square
    return {
        VARIANCE_OF["azimuth"]: turned[0] / (range_m * level) ** 2,
        VARIANCE_OF["elevation"]: turned[1] / range_m**2,
        VARIANCE_OF["range"]: turned[2],
    }
