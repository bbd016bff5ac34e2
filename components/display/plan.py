"""``plan.png``: the run from above, altitudes below it, and where each sensor detected what."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from components.display.alerted import Alerted, draw_alerted_lines, draw_manoeuvres
from components.display.flights import Flights, Positions, Track, detection_positions
from components.display.map_view import (
    MAP_WIDTH_IN,
    MapView,
    draw_outline,
    field_of_view_text,
    outline_of,
)
from components.display.outcomes import platform_by_block
from components.display.recorded_rows import Detected
from components.display.symbols import (
    DENSE,
    MANY,
    MOST_NAMED,
    OWN,
    TARGET,
    Labels,
    add_grid,
    alternating_mark_indices,
    draw_lines,
    draw_marks,
    label_line_ends,
    platform_colours,
    plot_arguments_of_mark,
    set_time_axis,
    targets_legend_entry,
)
from components.display.terminal import distance_text
from components.messages.reach import Reach
from components.sensor.mounting import SensorAxes
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import Mark
from dsa_des.record.drawing import DPI, draw_to_png, figure_text
from dsa_des.running.simulation import Simulation

# Inches around the map.
_LEFT_IN, _BOTTOM_IN, _TOP_IN, _LEGEND_IN = 0.75, 0.55, 0.35, 2.35
_LEGEND_LETTERS = 30  # of a line beside the map
# The panel of altitudes below it, and what is between the two.
_ALTITUDES_IN, _BETWEEN_IN = 1.15, 0.62

#: Least span of altitudes that is shown, m: level flights are level lines.
_LEAST_SPAN_M = 40.0


def draw_plan(
    path: Path,
    simulation: Simulation,
    flights: Flights,
    detected: Detected,
    summary: dict[str, Any],
    alerted: Alerted,
) -> Path:
    """Draw flights, fields of view and detections from above, and altitudes over time, as PNG."""
    marks, carrying = detection_positions(flights, detected), platform_by_block(simulation)
    looks = {
        name: getattr(simulation.components.get(name), "stated_reach", None)
        for name in detected.sensors
    }
    reaches = {name: reach for name, reach in looks.items() if isinstance(reach, Reach)}
    mounted = {name: getattr(simulation.components[name], "axes", SensorAxes()) for name in reaches}
    outlines = {
        name: outline_of(yaw_rad, reach, mounted[name], start_km)
        for name, reach in reaches.items()
        if reach.enabled
        for yaw_rad, start_km in [
            flights.start_yaw_and_position(simulation.components[name].context.platform)
        ]
    }
    view = MapView(flights, marks, list(outlines.values()))
    width_in = _LEFT_IN + MAP_WIDTH_IN + _LEGEND_IN
    below_in = _BOTTOM_IN + _ALTITUDES_IN + _BETWEEN_IN
    height_in = below_in + view.height_in + _TOP_IN
    left, right = _LEFT_IN / width_in, (_LEFT_IN + MAP_WIDTH_IN) / width_in
    bottom, high = below_in / height_in, view.height_in / height_in
    with draw_to_png(width_in, height_in, path) as figure:
        axes = figure.add_axes((left, bottom, right - left, high))
        axes.set(xlim=view.x, ylim=view.y)
        axes.set_xlabel("east of the ownship's start (km)")
        axes.set_ylabel("north of the ownship's start (km)")
        add_grid(axes)
        for name, outline in outlines.items():
            draw_outline(axes, outline, detected.styles, name, view.farthest_km)
        _draw_tracks(axes, view, flights)
        own = {flights.own_name: flights.own}
        tracks = {t.name: t for t in flights.targets} | own
        above = {name: (t.time_s, t.east_km, t.north_km) for name, t in tracks.items()}
        draw_alerted_lines(axes, alerted, above)
        for name, when_s in alerted.manoeuvres.items():
            draw_manoeuvres(axes, *flights.east_north_km(name or flights.own_name, when_s))
        drawn = {
            name: _draw_detection_marks(axes, view, marks[name], detected.styles, name)
            for name in detected.sensors
        }
        colours = platform_colours(carrying.values())
        named = _draw_closest(axes, view, flights, colours)
        title = f"{figure_text(simulation.scene.title, 60)}: plan view"
        if named < flights.all_targets:
            title += f" ({named} nearest of {flights.all_targets:,} targets named"
            drawn_tracks = len(flights.targets)
            title += f", {drawn_tracks:,} drawn)" if drawn_tracks < flights.all_targets else ")"
        if view.cropped:
            title += "; flights go on outside"
        axes.set_title(title, loc="left")
        heights = figure.add_axes(
            (left, _BOTTOM_IN / height_in, right - left, _ALTITUDES_IN / height_in)
        )
        px_per_s = MAP_WIDTH_IN * DPI / max(flights.duration_s, 1e-9)
        _draw_altitudes(heights, flights, marks, detected.styles, px_per_s)
        beside = {name: (t.time_s, t.time_s, t.alt_m) for name, t in tracks.items()}
        draw_alerted_lines(heights, alerted, beside)
        for name, when_s in alerted.manoeuvres.items():
            if flown := tracks.get(name or flights.own_name):  # of very many some have no track
                draw_manoeuvres(heights, when_s, np.interp(when_s, flown.time_s, flown.alt_m))
        texts = {name: field_of_view_text(reach, mounted[name]) for name, reach in reaches.items()}
        dense = len(flights.targets) >= DENSE
        handles = _legend_entries(texts, detected, drawn, summary, carrying, dense)
        handles[4:4] = alerted.legend_entries()
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(right + 0.005, bottom + high),
            frameon=False, labelspacing=0.9, borderaxespad=0.0,
        )  # fmt: skip
    return path


def _draw_tracks(axes: Any, view: MapView, flights: Flights) -> None:
    from matplotlib.collections import LineCollection

    tracks = [*flights.targets, flights.own]
    many = len(flights.targets) >= MANY
    lines = [np.column_stack((track.east_km, track.north_km)) for track in tracks]
    draw_lines(axes, lines[:-1], lines[-1])
    # Drawn with their gaps; ends are sought without them.
    known = [line[np.isfinite(line).all(axis=1)] for line in lines]
    starts = np.array([line[0] for line in known if len(line)])
    if len(flights.targets) >= DENSE:  # their density says it; the ownship alone has an arrow
        known, starts = known[-1:], np.array([line[0] for line in known[-1:] if len(line)])
    arrows = [_arrow_head(line, (5.0 if many else 8.0) * view.km_per_px) for line in known]
    colours = [TARGET] * (len(known) - 1) + [OWN]
    shown = [(arrow, c) for arrow, c in zip(arrows, colours, strict=True) if arrow is not None]
    axes.add_collection(
        LineCollection([arrow for arrow, _ in shown], colors=[colour for _, colour in shown],
                       linewidths=1.5, zorder=1.1), autolim=False,
    )  # fmt: skip
    if len(starts):
        axes.plot(
            starts[:, 0], starts[:, 1], linestyle="none", marker="o", markersize=3 if many else 5,
            color="#333333", zorder=1.2, scalex=False, scaley=False,
        )  # fmt: skip


def _arrow_head(line: FloatArray, length_km: float) -> FloatArray | None:
    """Return an arrow head's three points at a flight's end; None if the flight is shorter."""
    if not len(line):
        return None
    back = np.flatnonzero(np.hypot(*(line - line[-1:]).T) > length_km)
    if not len(back):
        return None
    along = line[-1] - line[back[-1]]
    along = along / np.hypot(*along) * length_km
    across = np.array([-along[1], along[0]]) * 0.5
    return np.array([line[-1] - along + across, line[-1], line[-1] - along - across])


def _draw_detection_marks(
    axes: Any,
    view: MapView,
    paths: list[tuple[Track, FloatArray, FloatArray, FloatArray]],
    styles: Mapping[str, Mark],
    name: str,
) -> int:
    """Draw a sensor's detections, thinned so that marks do not overlap; return how many."""
    if not paths:
        return 0
    points = []
    for track, time_s, east, north in paths:
        along_px = np.interp(time_s, track.time_s, track.along_km) / view.km_per_px
        points.append(
            np.column_stack((east, north))[alternating_mark_indices(along_px, styles, name)]
        )
    return draw_marks(axes, styles[name], np.concatenate(points))


def _draw_altitudes(
    axes: Any,
    flights: Flights,
    marks: Positions,
    styles: Mapping[str, Mark],
    px_per_s: float,
) -> None:
    """Draw altitude above the ellipsoid over time, with marks where sensors detected targets."""
    tracks = [*flights.targets, flights.own]
    lines = {track.name: np.column_stack((track.time_s, track.alt_m)) for track in tracks}
    every = np.concatenate([track.alt_m for track in tracks])
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)
    half = max(high - low, _LEAST_SPAN_M) * 0.58
    axes.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
    set_time_axis(axes, 0.0, flights.duration_s, "altitude (m)")
    *others, own = lines.values()
    draw_lines(axes, others, own)
    if len(tracks) <= MOST_NAMED:
        label_line_ends(axes, lines, "#333333")
    for name, style in styles.items():
        points = []
        for track, time_s, _, _ in marks.get(name, []):
            kept = time_s[alternating_mark_indices(time_s * px_per_s, styles, name)]
            points.append(np.column_stack((kept, np.interp(kept, track.time_s, track.alt_m))))
        if points:
            draw_marks(axes, style, np.concatenate(points))


def _draw_closest(axes: Any, view: MapView, flights: Flights, colours: Mapping[str, str]) -> int:
    """Mark closest approaches, name the nearest targets and return how many were named.

    Platforms have colours, if there are several.
    """
    from matplotlib.collections import LineCollection

    obstacles = np.concatenate(
        [np.column_stack((t.east_km, t.north_km)) for t in (flights.own, *flights.targets)]
    )
    labels = Labels(axes, view.x, view.y, view.km_per_px, obstacles)
    own_colour = colours.get(flights.own_name, OWN)
    labels.add("ownship", 0.0, 0.0, colour=own_colour, weight="bold")
    met = _closest_approaches(flights)
    if met:
        there = np.array([[east, north] for _, _, _, east, north in met])
        own = np.column_stack(
            flights.own_east_north_km(np.array([time_s for _, _, time_s, _, _ in met]))
        )
        axes.add_collection(
            LineCollection(list(np.stack((own, there), axis=1)), colors="#333333", linewidths=0.7,
                           linestyles=":", zorder=3.0), autolim=False,
        )  # fmt: skip
        axes.plot(
            there[:, 0], there[:, 1], linestyle="none", marker="x", markersize=7, color="#000000",
            markeredgewidth=1.3, zorder=3.1, scalex=False, scaley=False,
        )  # fmt: skip
    others = [t.name for t in flights.targets if flights.closest_approach_s(t.name) is None]
    named = set([*(name for _, name, *_ in met), *others][:MOST_NAMED])
    for track in flights.targets:
        seen = np.flatnonzero(np.isfinite(track.east_km))
        if track.name in named and len(seen):
            labels.add(
                figure_text(track.name, 24),
                float(track.east_km[seen[0]]),
                float(track.north_km[seen[0]]),
                colour=colours.get(track.name, "#000000"),
                weight="bold" if track.name in colours else "normal",
            )
    if len(flights.targets) <= MOST_NAMED:
        for range_m, _, time_s, east, north in met:
            text = f"{distance_text(range_m)} at {time_s:.6g} s"
            labels.add(text, east, north, colour="#333333")
    return len(named)


def _closest_approaches(flights: Flights) -> list[tuple[float, str, float, float, float]]:
    """Return range (m), target, time (s), east, north (km) of the nearest approaches, ascending."""
    met = []
    for track in flights.targets:
        time_s = flights.closest_approach_s(track.name)
        at = len(track.time_s) if time_s is None else int(np.searchsorted(track.time_s, time_s))
        if time_s is not None and at < len(track.time_s) and np.isfinite(track.range_m[at]):
            east, north = float(track.east_km[at]), float(track.north_km[at])
            met.append((float(track.range_m[at]), track.name, time_s, east, north))
    return sorted(met)[:MOST_NAMED]


def _legend_entries(
    reaches: dict[str, str], detected: Detected, drawn: dict[str, int], summary: dict[str, Any],
    carrying: Mapping[str, str], dense: bool,
) -> list[Any]:  # fmt: skip
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=OWN, linewidth=2.0, label="ownship"),
        targets_legend_entry(dense),
        Line2D([], [], linestyle="none", marker="o", markersize=5, color="#333333", label="start"),
        Line2D([], [], linestyle=":", marker="x", linewidth=0.7, color="#000000",
               label="closest approach"),
    ]  # fmt: skip
    for name in detected.sensors:
        count = summary.get("sensors", {}).get(name, {}).get("detections")
        count = len(detected.time_s[name]) if count is None else count
        label = figure_text(name, 24)
        if name in carrying:
            label += f" on {figure_text(carrying[name], 16)}"
        # A number stays with what it counts.
        text = f"{label}: {f'{count:,}' if count else 'no'}\N{NO-BREAK SPACE}detections"
        text = textwrap.fill(text, _LEGEND_LETTERS).replace("\N{NO-BREAK SPACE}", " ")
        if drawn[name] < count:
            text += f"\n({drawn[name]:,} of them marked)"
        if name in reaches:
            text += f"\n{reaches[name]}"
        handles.append(Line2D([], [], **plot_arguments_of_mark(detected.styles[name]), label=text))
    return handles
