"""The part of the map that the plan shows, and its scale."""

import math

import numpy as np

from components.display.fields_of_view import Outline
from components.display.flights import Flights
from components.display.positions import Positions, where_detected
from dsa_des.record.drawing import DPI

# Inches: the map is as wide as it may be, and as high as the flights need.
MAP_WIDTH_IN, _MAP_HEIGHTS_IN = 6.4, (3.8, 6.6)


class MapView:
    """What part of the map is seen, at one scale in both directions.

    It is everything that was flown; but if all detections lie in a small part of that, the
    surroundings of that part.

    Parameters
    ----------
    flights : Flights
    positions : Positions
    outlines : list of Outline
        Fields of view; as much of them is shown as does not dwarf the flights.
    """

    def __init__(self, flights: Flights, positions: Positions, outlines: list[Outline]) -> None:
        tracks = [flights.own, *flights.targets]
        points = np.column_stack(
            (
                np.concatenate([track.east_km for track in tracks]),
                np.concatenate([track.north_km for track in tracks]),
            )
        )
        points = points[np.isfinite(points).all(axis=1)]
        points = np.concatenate([np.zeros((1, 2)), points])
        #: Whether flights leave the map.
        self.cropped = False
        seen = where_detected(flights, positions)
        if np.ptp(seen, axis=0).max() < 0.2 * np.ptp(points, axis=0).max() and len(seen) > 1:
            self.cropped = True
            spare = max(0.05, 0.5 * float(np.ptp(seen, axis=0).max()))
            points = np.stack((seen.min(axis=0) - spare, seen.max(axis=0) + spare))
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.35 * float(np.max(high - low))
        for outline in outlines:
            if outline.closed:
                low_of, high_of = outline.corners_km.min(axis=0), outline.corners_km.max(axis=0)
                low = np.minimum(low, np.maximum(low_of, points.min(axis=0) - margin))
                high = np.maximum(high, np.minimum(high_of, points.max(axis=0) + margin))
        # Nothing may have moved at all: 100 m is the least that is shown.
        extent = np.maximum((high - low) * 1.1, 0.1)
        self.height_in = float(np.clip(MAP_WIDTH_IN * extent[1] / extent[0], *_MAP_HEIGHTS_IN))
        inches = np.array([MAP_WIDTH_IN, self.height_in])
        self.km_per_px = float(np.max(extent / (inches * DPI)))
        half = self.km_per_px * inches * DPI / 2
        centre = (low + high) / 2
        self.x = (float(centre[0] - half[0]), float(centre[0] + half[0]))
        self.y = (float(centre[1] - half[1]), float(centre[1] + half[1]))
        corners = [math.hypot(a, b) for a in self.x for b in self.y]
        #: No point of the map is farther than this from the ownship's start.
        self.farthest_km = max(corners)
