"""Many flights without legs, prepared together from columns of where and how they start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, inf, isnan, radians
from typing import Any

import numpy as np

from components.flights.geodesic_motion import geodesic_parameter_table
from components.flights.leg_motion import KINDS
from components.flights.scripted_flights import MOST_ALT_M, ScriptedFleet, ScriptedTrajectory
from components.geometry.angles import heading_from_deg, wrap_longitude_deg
from dsa_des.arrays.types import FloatArray


@dataclass(eq=False)
class Starts:
    """Where and how straight flights start, as columns (flights,); units of `ScriptedTrajectory`.

    `fixed_deg` is (3, flights): yaw, pitch and roll, NaN where they follow from the motion.
    """

    names: Sequence[str]
    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    heading_deg: FloatArray
    speed_mps: FloatArray
    climb_mps: FloatArray
    start_time_s: FloatArray
    end_time_s: FloatArray
    fixed_deg: FloatArray

    def flight(self, number: int) -> ScriptedTrajectory:
        """Return one of the flights, made by itself."""
        names = ("lat_deg", "lon_deg", "alt_m", "heading_deg", "speed_mps", "climb_mps")
        columns: dict[str, Any] = {name: float(getattr(self, name)[number]) for name in names}
        yaw, pitch, roll = (None if isnan(a) else a for a in self.fixed_deg[:, number].tolist())
        end_s = float(self.end_time_s[number])
        return ScriptedTrajectory(
            self.names[number], **columns, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll,
            start_time_s=float(self.start_time_s[number]),
            end_time_s=None if end_s == inf else end_s,
        )  # fmt: skip

    def are_plain(self) -> bool:
        """Return whether all flights move, and have no value that `ScriptedTrajectory` refuses."""
        others = (self.lon_deg, self.heading_deg, self.climb_mps, self.start_time_s)
        return bool(
            np.all(np.isfinite(self.speed_mps) & (self.speed_mps > 0.0))
            and np.all(np.abs(self.lat_deg) <= 90.0)
            and np.all(np.abs(self.alt_m) <= MOST_ALT_M)
            and np.all(self.end_time_s >= self.start_time_s)
            and all(np.isfinite(column).all() for column in others)
            and not np.isinf(self.fixed_deg).any()
        )

    def fleet(self) -> ScriptedFleet:
        """Return the flights, prepared together where that can be."""
        count = len(self.names)
        if not self.are_plain() or not count:
            return ScriptedFleet([self.flight(number) for number in range(count)])
        lon = self.lon_deg
        lon = np.where((lon >= -180.0) & (lon < 180.0), lon, wrap_longitude_deg(lon))
        speeds, climbs = self.speed_mps.tolist(), self.climb_mps.tolist()
        headings = [heading_from_deg(heading) for heading in self.heading_deg.tolist()]
        table = geodesic_parameter_table(self.lat_deg, lon, self.alt_m, headings, speeds, climbs)
        pitches = list(map(atan2, climbs, speeds))
        path_mps = self.speed_mps / np.array(list(map(cos, pitches)))
        yaw, pitch, roll = self.fixed_deg.tolist()
        fixed = [list(map(heading_from_deg, yaw)), *(list(map(radians, a)) for a in (pitch, roll))]
        zero, straight = np.zeros(count), KINDS.index("geodesic")
        return ScriptedFleet.of_columns(
            self.names,
            np.stack((self.start_time_s, self.end_time_s)),
            np.array(fixed),
            np.ones(count, dtype=np.int64),
            np.stack((zero, pitches, zero, path_mps)),
            np.full(count, straight, dtype=np.int64),
            {straight: table},
        )
