"""The flights of a run on a map, east and north of where the ownship starts, and what was seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.display.recorded_rows import Detected
from components.display.symbols import rows_by_target, spread_indices
from components.geometry import line_of_sight_ned, slant_range_m
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import FloatArray
from dsa_des.running.simulation import Simulation

MOST_POINTS = 30_000
"""Points of all tracks together."""
MOST_TRACKS = 1000
"""Of more targets than this, those that come nearest are drawn."""
MOST_MARKS = 20_000
"""Detections whose position is worked out; fewer are drawn."""


@dataclass
class Track:
    """One aircraft's flight, (points,) each; NaN where it is not there.

    The range is the true slant range from the ownship, the altitude that above the ellipsoid.
    """

    name: str
    time_s: FloatArray
    east_km: FloatArray
    north_km: FloatArray
    range_m: FloatArray
    alt_m: FloatArray

    @property
    def along_km(self) -> FloatArray:
        """Length of the path flown so far, seen from above, shape (points,)."""
        steps = np.nan_to_num(np.hypot(np.diff(self.east_km), np.diff(self.north_km)))
        return np.concatenate(([0.0], np.cumsum(steps)))


class Flights:
    """Positions of all aircraft over time, east and north in km in the plane at the own start.

    The time of a target's closest approach becomes a point of its track; of very many targets only
    the nearest have tracks.
    """

    def __init__(
        self,
        source: TrafficSource,
        duration_s: float,
        closest_s: dict[str, float],
        nearest_m: dict[str, float] | None = None,
    ) -> None:
        self._source = source
        chosen = _targets_to_draw(source.targets, nearest_m or {})
        self._targets = {target.name: target for target in chosen}
        #: How many targets there are, with a track or without.
        self.all_targets = len(source.targets)
        self._closest_s = closest_s
        self.duration_s = duration_s
        count = int(np.clip(MOST_POINTS // (len(self._targets) + 1), 60, 600))
        times = _times_present(source.own, duration_s, count)
        own = source.own_states_at(times)
        start = int(np.argmax(own.present))
        #: Latitude and longitude in degrees and altitude in metres of the map's origin.
        self.origin = float(own.lat_deg[start]), float(own.lon_deg[start]), float(own.alt_m[start])
        self.start_s = float(times[start])
        #: Where the ownship's nose points at its start, clockwise from north.
        self.start_yaw_rad = float(own.yaw_rad[start])
        east, north = self._project_km(own)
        self.own = Track("ownship", times, east, north, np.zeros(len(times)), _altitude_or_nan(own))
        self.targets = [self._make_track(target, count) for target in chosen]

    @classmethod
    def from_simulation(cls, simulation: Simulation, summary: dict[str, Any]) -> "Flights | None":
        """Return the flights of a run, or None if it has no `TrafficSource`."""
        met = {
            name: entry["closest_approach"]
            for name, entry in summary.get("targets", {}).items()
            if entry.get("closest_approach")
        }
        closest_s = {name: approach["time_s"] for name, approach in met.items()}
        nearest_m = {name: approach["range_m"] for name, approach in met.items()}
        for _, component in sorted(simulation.components.items()):
            if isinstance(component, TrafficSource):
                return cls(component, float(simulation.duration_s), closest_s, nearest_m)
        return None

    def east_north_km(self, name: str, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return an aircraft's east and north, km, at these times; NaN if unknown or absent."""
        target = self._targets.get(name)
        if target is None and name == self._source.roster.own_name:
            return self.own_east_north_km(time_s)
        if target is None:
            nothing = np.full(len(time_s), np.nan)
            return nothing, nothing
        return self._project_km(target.at(time_s))

    @property
    def own_name(self) -> str:
        """Name by which other platforms know the ownship."""
        return self._source.roster.own_name

    def own_east_north_km(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return east and north of the ownship in km at these times."""
        return self._project_km(self._source.own.at(time_s))

    def start_yaw_and_position(self, name: str) -> tuple[float, tuple[float, float]]:
        """Return an aircraft's start: yaw (rad), east, north (km); the ownship's if unknown."""
        flight = self._targets.get(name)
        if flight is None:
            return self.start_yaw_rad, (0.0, 0.0)
        state = flight.at(_times_present(flight, self.duration_s, 2)[:1])
        east, north = self._project_km(state)
        return float(state.yaw_rad[0]), (float(east[0]), float(north[0]))

    @property
    def tracks(self) -> dict[str, Track]:
        """Flights of the targets that are drawn and of the ownship, by name."""
        own = {self._source.roster.own_name: self.own}
        return {**own, **{track.name: track for track in self.targets}}

    def closest_approach_s(self, name: str) -> float | None:
        """Return when a target is closest to the ownship, s; None if they never meet."""
        return self._closest_s.get(name)

    def _make_track(self, target: Any, count: int) -> Track:
        times = _times_present(target, self.duration_s, count)
        if target.name in self._closest_s:
            times = np.union1d(times, [self._closest_s[target.name]])
        state, own = target.at(times), self._source.own.at(times)
        range_m = slant_range_m(
            own.lat_deg, own.lon_deg, own.alt_m, state.lat_deg, state.lon_deg, state.alt_m
        )
        range_m = np.where(own.present & state.present, range_m, np.nan)
        return Track(target.name, times, *self._project_km(state), range_m, _altitude_or_nan(state))

    def _project_km(self, state: Any) -> tuple[FloatArray, FloatArray]:
        north, east, _ = line_of_sight_ned(
            *self.origin, state.lat_deg, state.lon_deg, state.alt_m, validate=False
        )
        there = state.present
        return np.where(there, east / 1000, np.nan), np.where(there, north / 1000, np.nan)


def _altitude_or_nan(state: Any) -> FloatArray:
    return np.where(state.present, state.alt_m, np.nan)


def _targets_to_draw(targets: Sequence[Any], nearest_m: dict[str, float]) -> list[Any]:
    """Return the targets to draw, in their order: all, or the `MOST_TRACKS` that come nearest."""
    if len(targets) <= MOST_TRACKS:
        return list(targets)
    range_m = np.array([nearest_m.get(target.name, math.inf) for target in targets])
    return [targets[i] for i in np.sort(np.argsort(range_m, kind="stable")[:MOST_TRACKS]).tolist()]


def _times_present(flight: Any, duration_s: float, count: int) -> FloatArray:
    """Return `count` times, s, spread over the part of a run in which an aircraft is present."""
    start, end = flight.interval_present() if hasattr(flight, "interval_present") else (0, math.inf)
    start = min(max(0.0, start), duration_s)
    end = max(start, min(duration_s, end))
    # One instant is enough for a flight of no length.
    return np.linspace(start, end, count if end > start else 1)


#: Sensor → detections of one target: its track, and times, east and north of the detections.
Positions = dict[str, list[tuple[Track, FloatArray, FloatArray, FloatArray]]]


def detection_positions(flights: Flights, detected: Detected) -> Positions:
    """Return by sensor, for each target, its flight and the times (s), true east and north (km) of
    the detections to mark.
    """
    tracks = flights.tracks
    wanted: dict[int, list[tuple[str, FloatArray]]] = {}
    grouped = {name: rows_by_target(detected.target[name]) for name in detected.sensors}
    most = max(10, MOST_MARKS // max(1, sum(len(groups) for groups in grouped.values())))
    for name, groups in grouped.items():
        for target, rows in groups:
            if detected.names[target] in tracks:
                rows = rows[spread_indices(len(rows), most)]
                wanted.setdefault(target, []).append((name, detected.time_s[name][rows]))
    result: Positions = {name: [] for name in detected.sensors}
    for target, parts in sorted(wanted.items()):
        # One call per target for all sensors together.
        times = np.concatenate([times for _, times in parts])
        east, north = flights.east_north_km(detected.names[target], times)
        start = 0
        for name, part in parts:
            here = slice(start, start + len(part))
            track = tracks[detected.names[target]]
            result[name].append((track, part, east[here], north[here]))
            start += len(part)
    return result


def plot_extent_points(flights: Flights, result: Positions) -> FloatArray:
    """Return the points a plan must show: start, detections, ownship at those times; km, (n, 2)."""
    points = [np.zeros((1, 2))]
    own = flights.own
    for paths in result.values():
        for _, time_s, east, north in paths:
            points.append(np.column_stack((east, north)))
            own_east = np.interp(time_s, own.time_s, own.east_km)
            own_north = np.interp(time_s, own.time_s, own.north_km)
            points.append(np.column_stack((own_east, own_north)))
    together = np.concatenate(points)
    return together[np.isfinite(together).all(axis=1)]
