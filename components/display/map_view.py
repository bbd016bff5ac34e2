"""What the plan shows: the part of the map that is seen, and the sensors' fields of view on it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.display.flights import Flights, Positions, plot_extent_points
from components.geometry import sector_width_rad
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import Mark
from dsa_des.record.drawing import DPI

# Inches: the map is as wide as it may be, and as high as the flights need.
MAP_WIDTH_IN, _MAP_HEIGHTS_IN = 6.4, (3.8, 6.6)


@dataclass
class Outline:
    """Field of view from above: corners (n, 2) east and north, km, if closed, else edge directions.

    One without a limit has the directions of its two edges from where it begins, `start_km`.
    """

    corners_km: FloatArray
    radius_km: float
    closed: bool
    start_km: FloatArray


def outline_of(
    yaw_rad: float, reach: Any, axes: Any, start_km: tuple[float, float] = (0.0, 0.0)
) -> Outline:
    """Return a field of view's outline at elevation 0, ownship level at `start_km` (east, north).

    It is drawn as the plane of elevation 0 of the sensor's axes; a tilted sensor foreshortens it.
    """
    width = sector_width_rad(*reach.azimuth_rad)
    everywhere = width >= 2 * math.pi - 1e-9
    closed = math.isfinite(reach.range_max_m)
    angle = reach.azimuth_rad[0] + np.linspace(0.0, min(width, 2 * math.pi), 181)
    if not closed:
        angle = angle[:0] if everywhere else angle[[0, -1]]
    radius_km = reach.range_max_m / 1000 if closed else 1.0
    azimuth, elevation = axes.true_direction_in_body(angle, np.zeros(len(angle)))
    bearing = yaw_rad + azimuth
    level_km = radius_km * np.cos(elevation) if closed else np.ones(len(angle))
    corners = np.column_stack((np.sin(bearing), np.cos(bearing))) * level_km[:, np.newaxis]
    if closed and not everywhere:
        corners = np.vstack((corners, [[0.0, 0.0]]))
    corners = corners + start_km if closed else corners
    return Outline(corners, radius_km, closed, np.array(start_km))


def draw_outline(
    axes: Any, outline: Outline, styles: Mapping[str, Mark], name: str, far_km: float
) -> None:
    """Draw a sensor's field of view: filled up to a range limit, or dashed edges without end.

    No corner of the plot is farther away than `far_km`.
    """
    from matplotlib.patches import Polygon

    colour = styles[name].colour
    corners = outline.corners_km
    if outline.closed:
        axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.06, zorder=0.5))
        axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, linewidth=1.0, zorder=0.6))
        return
    shift = 4 * list(styles).index(name)
    for edge in corners * far_km:
        # Shifted dashes keep two fields of view with the same edges apart.
        axes.plot(
            *np.stack([outline.start_km, outline.start_km + edge], axis=1),
            color=colour, linewidth=1.2,
            linestyle=(shift, (6, 5)), zorder=0.7, scalex=False, scaley=False,
        )  # fmt: skip


def field_of_view_text(reach: Any, axes: Any) -> str:
    """Return a sensor's field of view and range limit in words, with a boresight off the nose."""
    if not reach.enabled:
        return "switched off"
    low, high = (math.degrees(angle) for angle in reach.azimuth_rad)
    field = f"±{high:.4g}°" if low == -high else f"{low:.4g}° to {high:.4g}°"
    azimuth, elevation = (
        round(math.degrees(angle[0]), 6) for angle in axes.true_direction_in_body(*np.zeros((2, 1)))
    )
    if azimuth or elevation:
        field += f"\nround {azimuth:.4g}°"
        field += f", {abs(elevation):.4g}° {'up' if elevation > 0 else 'down'}" if elevation else ""
    if math.isfinite(reach.range_max_m):
        return f"field of view {field},\nto {reach.range_max_m / 1000:g} km"
    return f"field of view {field},\nno range limit (dashed)"


class MapView:
    """The section of the map that is drawn, with one scale for both directions.

    It is everything that was flown; but if all detections lie in a small part of that, the
    surroundings of that part. Of fields of view as much is shown as does not dwarf the flights.
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
        seen = plot_extent_points(flights, positions)
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
