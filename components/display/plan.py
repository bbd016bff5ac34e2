"""``plan.png``: the run from above, and where each sensor detected what."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from components.display.figures import DPI, drawing, plain, style_of
from components.display.flights import Flights, Track
from components.display.labels import Labels
from components.display.marks import Detected
from components.display.terminal import distance_text
from components.display.thinning import by_target, evenly, staggered
from dsa_des.types import FloatArray

if TYPE_CHECKING:
    from dsa_des.simulation import Simulation

MOST_MARKS = 20_000
"""Detections whose position is worked out; fewer are drawn."""
MOST_NAMED = 8
_SIZE_IN = (9.6, 7.2)
_AXES = (0.075, 0.08, 0.635, 0.86)  # left, bottom, width, height as shares of the figure
_OWN = "#000000"
_TARGET = "#777777"

_SPACING_PX = 11.0  # between marks of different sensors on one track

#: Sensor → detections of one target: its track, and times, east and north of the detections.
Marks = dict[str, list[tuple[Track, FloatArray, FloatArray, FloatArray]]]


def draw_plan(
    path: Path,
    simulation: "Simulation",
    flights: Flights,
    detected: Detected,
    summary: dict[str, Any],
) -> Path:
    """Draw the plan view.

    Parameters
    ----------
    path : Path
        The PNG to write.
    simulation : Simulation
        For the sensors' fields of view.
    flights : Flights
    detected : Detected
    summary : dict
        For the numbers in the legend.
    """
    marks = _marks(flights, detected)
    reaches = {
        name: simulation.components[name].reach  # type: ignore[attr-defined]
        for name in detected.sensors
        if hasattr(simulation.components.get(name), "reach")
    }
    outlines = {
        name: _outline(flights.start_yaw_rad, reach)
        for name, reach in reaches.items()
        if reach.enabled
    }
    view = _View(flights, list(outlines.values()))
    with drawing(*_SIZE_IN, path) as figure:
        axes = figure.add_axes(_AXES)
        axes.set(xlim=view.x, ylim=view.y)
        axes.set_xlabel("east of the ownship's start [km]")
        axes.set_ylabel("north of the ownship's start [km]")
        axes.grid(color="#DDDDDD", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.ticklabel_format(useOffset=False, style="plain")
        for name, outline in outlines.items():
            _draw_reach(axes, view, outline, detected.sensors, name)
        _draw_tracks(axes, view, flights)
        for name in detected.sensors:
            _draw_marks(axes, view, marks[name], detected.sensors, name)
        named = _draw_closest(axes, view, flights)
        title = f"{simulation.scene.title}: plan view"
        if named < len(flights.targets):
            title += f" ({named} nearest of {len(flights.targets):,} targets named)"
        axes.set_title(plain(title), loc="left")
        handles = _legend(reaches, detected, summary)
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(_AXES[0] + _AXES[2] + 0.01, 0.95),
            frameon=False, labelspacing=0.9,
        )  # fmt: skip
    return path


class _View:
    """What part of the map is seen: everything that was flown, at one scale in both directions.

    Parameters
    ----------
    flights : Flights
    outlines : list of _Outline
        Fields of view: those with a range limit are shown in full unless they dwarf the flights.
    """

    def __init__(self, flights: Flights, outlines: list["_Outline"]) -> None:
        tracks = [flights.own, *flights.targets]
        points = np.column_stack(
            (
                np.concatenate([track.east_km for track in tracks]),
                np.concatenate([track.north_km for track in tracks]),
            )
        )
        points = points[np.isfinite(points).all(axis=1)]
        reach_km = float(np.hypot(*points.T).max(initial=0.0))
        shown = [o.corners_km for o in outlines if o.closed and o.radius_km <= 1.5 * reach_km]
        points = np.concatenate([np.zeros((1, 2)), points, *shown])
        low, high = points.min(axis=0), points.max(axis=0)
        # Nothing may have moved at all: 100 m is the least that is shown.
        inches = np.array([_SIZE_IN[0] * _AXES[2], _SIZE_IN[1] * _AXES[3]])
        self.km_per_px = float(np.max((high - low) * 1.1 / (inches * DPI)))
        self.km_per_px = max(self.km_per_px, 0.1 / (inches[0] * DPI))
        half = self.km_per_px * inches * DPI / 2
        centre = (low + high) / 2
        self.x = (float(centre[0] - half[0]), float(centre[0] + half[0]))
        self.y = (float(centre[1] - half[1]), float(centre[1] + half[1]))
        corners = [math.hypot(a, b) for a in self.x for b in self.y]
        #: No point of the map is farther than this from the ownship's start.
        self.farthest_km = max(corners)


def _marks(flights: Flights, detected: Detected) -> Marks:
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
    marks: Marks = {name: [] for name in detected.sensors}
    for target, parts in sorted(wanted.items()):
        # One call per target for all sensors together.
        times = np.concatenate([times for _, times in parts])
        east, north = flights.at(detected.names[target], times)
        start = 0
        for name, part in parts:
            here = slice(start, start + len(part))
            track = tracks[detected.names[target]]
            marks[name].append((track, part, east[here], north[here]))
            start += len(part)
    return marks


@dataclass
class _Outline:
    """A field of view from above.

    Parameters
    ----------
    corners_km : (corners, 2)
        East and north; unless `closed`, the two edges' directions.
    radius_km : float
    closed : bool
        Whether it has a range limit.
    """

    corners_km: FloatArray
    radius_km: float
    closed: bool


def _outline(yaw_rad: float, reach: Any) -> _Outline:
    low, high = reach.azimuth_rad
    width = high - low if high >= low else high - low + 2 * math.pi
    everywhere = width >= 2 * math.pi - 1e-9
    closed = math.isfinite(reach.range_max_m)
    angle = yaw_rad + low + np.linspace(0.0, min(width, 2 * math.pi), 181)
    if not closed:
        angle = angle[:0] if everywhere else angle[[0, -1]]
    radius_km = reach.range_max_m / 1000 if closed else 1.0
    corners = np.column_stack((np.sin(angle), np.cos(angle))) * radius_km
    if closed and not everywhere:
        corners = np.vstack((corners, [[0.0, 0.0]]))
    return _Outline(corners, radius_km, closed)


def _draw_reach(axes: Any, view: _View, outline: _Outline, sensors: list[str], name: str) -> None:
    """Draw a field of view: filled up to a range limit, or dashed edges without end."""
    from matplotlib.patches import Polygon

    colour = style_of(sensors, name)[0]
    corners = outline.corners_km
    if outline.closed:
        axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.06, zorder=0.5))
        axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, linewidth=1.0, zorder=0.6))
        return
    for edge in corners * view.farthest_km:
        # Shifted dashes keep two fields of view with the same edges apart.
        axes.plot(
            [0.0, edge[0]], [0.0, edge[1]], color=colour, linewidth=1.2,
            linestyle=(4 * sensors.index(name), (6, 5)), zorder=0.7, scalex=False, scaley=False,
        )  # fmt: skip


def _draw_tracks(axes: Any, view: _View, flights: Flights) -> None:
    from matplotlib.collections import LineCollection

    tracks = [*flights.targets, flights.own]
    many = len(tracks) > 20
    widths = [0.6 if many else 1.0] * (len(tracks) - 1) + [2.0]
    colours = [_TARGET] * (len(tracks) - 1) + [_OWN]
    lines = [np.column_stack((track.east_km, track.north_km)) for track in tracks]
    lines = [line[np.isfinite(line).all(axis=1)] for line in lines]
    starts = np.array([line[0] for line in lines if len(line)])
    axes.add_collection(
        LineCollection([line for line in lines if len(line)],
                       colors=[c for c, line in zip(colours, lines, strict=True) if len(line)],
                       linewidths=[w for w, line in zip(widths, lines, strict=True) if len(line)],
                       zorder=1.0), autolim=False,
    )  # fmt: skip
    heads, head_colours = [], []
    for line, colour in zip(lines, colours, strict=True):
        head = _arrow_head(line, (5.0 if many else 8.0) * view.km_per_px)
        if head is not None:
            heads.append(head)
            head_colours.append(colour)
    axes.add_collection(
        LineCollection(heads, colors=head_colours, linewidths=1.5, zorder=1.1), autolim=False
    )
    if len(starts):
        axes.plot(
            starts[:, 0], starts[:, 1], linestyle="none", marker="o", markersize=3 if many else 5,
            color="#333333", zorder=1.2, scalex=False, scaley=False,
        )  # fmt: skip


def _arrow_head(line: FloatArray, length_km: float) -> FloatArray | None:
    """Return the three points of an arrow head at a track's end; None if it hardly moves."""
    back = np.flatnonzero(np.hypot(*(line - line[-1:]).T) > length_km)
    if not len(back):
        return None
    along = line[-1] - line[back[-1]]
    along = along / np.hypot(*along) * length_km
    across = np.array([-along[1], along[0]]) * 0.5
    return np.array([line[-1] - along + across, line[-1], line[-1] - along - across])


def _draw_marks(
    axes: Any,
    view: _View,
    paths: list[tuple[Track, FloatArray, FloatArray, FloatArray]],
    sensors: list[str],
    name: str,
) -> None:
    if not paths:
        return
    kept_east, kept_north = [], []
    for track, time_s, east, north in paths:
        along_px = np.interp(time_s, track.time_s, track.along_km) / view.km_per_px
        keep = staggered(along_px, _SPACING_PX * len(sensors), sensors.index(name), len(sensors))
        kept_east.append(east[keep])
        kept_north.append(north[keep])
    east, north = np.concatenate(kept_east), np.concatenate(kept_north)
    few = evenly(len(east), 5000)
    style = style_of(sensors, name)
    axes.plot(
        east[few], north[few], **mark_of(style), zorder=2.0 + 1.0 / style[2],
        scalex=False, scaley=False,
    )  # fmt: skip


def mark_of(style: tuple[str, str, float]) -> dict[str, Any]:
    """Return how a sensor's detections are marked: big ones open, small ones filled."""
    colour, marker, size = style
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": size,
        "markeredgecolor": colour,
        "markerfacecolor": "none" if size > 7 else colour,
        "markeredgewidth": 1.2 if size > 7 else 0.4,
    }


def _draw_closest(axes: Any, view: _View, flights: Flights) -> int:
    """Mark closest approaches, name the nearest targets and return how many were named."""
    from matplotlib.collections import LineCollection

    labels = Labels(axes, view.x, view.y, view.km_per_px)
    labels.add("ownship", 0.0, 0.0, weight="bold")
    met: list[tuple[float, str, float, float, float]] = []
    for track in flights.targets:
        time_s = flights.closest_s(track.name)
        if time_s is not None:
            at = int(np.searchsorted(track.time_s, time_s))
            if at < len(track.time_s) and np.isfinite(track.range_m[at]):
                east, north = float(track.east_km[at]), float(track.north_km[at])
                met.append((float(track.range_m[at]), track.name, time_s, east, north))
    met.sort()
    if met:
        own_east, own_north = flights.own_at(np.array([item[2] for item in met]))
        own = np.column_stack((own_east, own_north))
        there = np.array([item[3:] for item in met])
        axes.add_collection(
            LineCollection(np.stack((own, there), axis=1), colors="#333333", linewidths=0.7,
                           linestyles=":", zorder=3.0), autolim=False,
        )  # fmt: skip
        axes.plot(
            there[:, 0], there[:, 1], linestyle="none", marker="x", markersize=7, color="#000000",
            markeredgewidth=1.3, zorder=3.1, scalex=False, scaley=False,
        )  # fmt: skip
    nearest = [name for _, name, *_ in met] + [
        track.name for track in flights.targets if flights.closest_s(track.name) is None
    ]
    named = set(nearest[:MOST_NAMED])
    for track in flights.targets:
        at = np.flatnonzero(np.isfinite(track.east_km))
        if track.name in named and len(at):
            labels.add(track.name, float(track.east_km[at[0]]), float(track.north_km[at[0]]))
    for range_m, name, time_s, east, north in met[:MOST_NAMED]:
        if len(flights.targets) <= MOST_NAMED:
            labels.add(f"{distance_text(range_m)} at {time_s:g} s", east, north, colour="#333333")
    return len(named)


def _legend(reaches: dict[str, Any], detected: Detected, summary: dict[str, Any]) -> list[Any]:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=_OWN, linewidth=2.0, label="ownship"),
        Line2D([], [], color=_TARGET, linewidth=1.0, label="target"),
        Line2D([], [], linestyle="none", marker="o", markersize=5, color="#333333", label="start"),
        Line2D([], [], linestyle=":", marker="x", linewidth=0.7, color="#000000",
               label="closest approach"),
    ]  # fmt: skip
    for name in detected.sensors:
        count = summary.get("sensors", {}).get(name, {}).get("detections")
        count = len(detected.time_s[name]) if count is None else count
        text = f"{name}: {count:,} detections" if count else f"{name}: no detections"
        if name in reaches:
            text += f"\n{_reach_text(reaches[name])}"
        handles.append(
            Line2D([], [], **mark_of(style_of(detected.sensors, name)), label=plain(text))
        )
    return handles


def _reach_text(reach: Any) -> str:
    if not reach.enabled:
        return "switched off"
    low, high = (f"{math.degrees(angle):.4g}°" for angle in reach.azimuth_rad)
    if math.isfinite(reach.range_max_m):
        return f"field of view {low} to {high},\nto {reach.range_max_m / 1000:g} km"
    return f"field of view {low} to {high},\nno range limit (dashed)"
