"""Where a detection would have been seen at another instant, as far as is known there."""

from typing import Any

import numpy as np

from components.geometry.attitude import (
    body_angles,
    body_to_ned,
    ned_to_body,
    unit_vector_unchecked,
)
from components.geometry.ellipsoid import line_of_sight_ned
from dsa_des.arrays.types import FloatArray, IntArray


class Carrier:
    """Carries detections of one sensor to the instants of another one's.

    What is known of the time between is how the ownship turned and moved, by the poses that it
    believed itself to have, and how the range changed, where its rate was measured. A target's
    own motion across the line of sight is not: the gates are there for it. A detection without
    a range is taken to be as far away as the one that it is compared with.

    Parameters
    ----------
    one, other : Detections
    one_ticks, other_ticks : (n,) and (m,) of int
        When their entries were measured.
    one_pose, other_pose : (6, n) and (6, m)
        The ownship's believed pose then: latitude, longitude, altitude, heading, pitch, roll.
    ticks_per_s : int
    """

    def __init__(
        self,
        one: Any,
        one_ticks: IntArray,
        one_pose: FloatArray,
        other: Any,
        other_ticks: IntArray,
        other_pose: FloatArray,
        ticks_per_s: int,
    ) -> None:
        self._one, self._other = one, other
        self._ticks = one_ticks, other_ticks
        self._poses = one_pose, other_pose
        self._ticks_per_s = ticks_per_s

    def __call__(
        self, mine: IntArray, theirs: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuth, elevation and range of entries `theirs` at the instants of `mine`."""
        other = self._other
        azimuth, elevation = other.azimuth_rad[theirs], other.elevation_rad[theirs]
        range_m = other.range_m[theirs]
        before, after = self._poses[1][:, theirs], self._poses[0][:, mine]
        ticks = self._ticks[0][mine] - self._ticks[1][theirs]
        known = np.isfinite(before).all(axis=0) & np.isfinite(after).all(axis=0)
        moved = np.flatnonzero((ticks != 0) & known)
        if len(moved) == 0:
            return azimuth, elevation, range_m
        before, after = before[:, moved], after[:, moved]
        line = unit_vector_unchecked(azimuth[moved], elevation[moved])
        seen = np.stack(body_to_ned(*line, *before[3:]))
        reach = range_m[moved]
        away = np.where(np.isnan(reach), self._one.range_m[mine[moved]], reach)
        step = np.stack(line_of_sight_ned(*before[:3], *after[:3], validate=False))
        # Without any range the parallax is not known.
        vector = np.where(np.isnan(away), seen, away * seen - step)
        length = np.sqrt((vector**2).sum(axis=0))
        ahead = ned_to_body(*(vector / np.maximum(length, 1e-9)), *after[3:])
        azimuth[moved], elevation[moved] = body_angles(*ahead)
        by_rate = reach + other.range_rate_m_s[theirs[moved]] * ticks[moved] / self._ticks_per_s
        by_step = np.where(np.isnan(reach), np.nan, length)
        range_m[moved] = np.where(np.isnan(by_rate), by_step, by_rate)
        return azimuth, elevation, range_m
