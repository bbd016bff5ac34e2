"""The positions of the targets when they were detected."""

import numpy as np

from components.display.flights import Flights, Track
from components.display.marks import Detected
from components.display.thinning import by_target, evenly
from dsa_des.arrays.types import FloatArray

MOST_MARKS = 20_000
"""Detections whose position is worked out; fewer are drawn."""

#: Sensor → detections of one target: its track, and times, east and north of the detections.
Positions = dict[str, list[tuple[Track, FloatArray, FloatArray, FloatArray]]]


def positions(flights: Flights, detected: Detected) -> Positions:
    """Return for each sensor and target the true positions of its detections."""
    tracks = {track.name: track for track in flights.targets}
    wanted: dict[int, list[tuple[str, FloatArray]]] = {}
    grouped = {name: by_target(detected.target[name]) for name in detected.sensors}
    most = max(10, MOST_MARKS // max(1, sum(len(groups) for groups in grouped.values())))
    for name, groups in grouped.items():
        for target, rows in groups:
            if detected.names[target] in tracks:
                rows = rows[evenly(len(rows), most)]
                wanted.setdefault(target, []).append((name, detected.time_s[name][rows]))
    found: Positions = {name: [] for name in detected.sensors}
    for target, parts in sorted(wanted.items()):
        # One call per target for all sensors together.
        times = np.concatenate([times for _, times in parts])
        east, north = flights.at(detected.names[target], times)
        start = 0
        for name, part in parts:
            here = slice(start, start + len(part))
            track = tracks[detected.names[target]]
            found[name].append((track, part, east[here], north[here]))
            start += len(part)
    return found


def where_detected(flights: Flights, found: Positions) -> FloatArray:
    """Return the start, the detections and the ownship at their times, shape (points, 2)."""
    points = [np.zeros((1, 2))]
    own = flights.own
    for paths in found.values():
        for _, time_s, east, north in paths:
            points.append(np.column_stack((east, north)))
            own_east = np.interp(time_s, own.time_s, own.east_km)
            own_north = np.interp(time_s, own.time_s, own.north_km)
            points.append(np.column_stack((own_east, own_north)))
    together = np.concatenate(points)
    return together[np.isfinite(together).all(axis=1)]
