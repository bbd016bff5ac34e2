"""``timeline.png``: the sensors' scans on their own clocks, and what was detected when."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from components.display.alerted import Alerted, draw_alerted_lines, draw_manoeuvres
from components.display.flights import Flights
from components.display.recorded_rows import (
    Detected,
    ScansShown,
    SensorScans,
    iterate_fused,
    read_scans,
    scan_period_s,
    scans_between,
)
from components.display.symbols import (
    DENSE,
    MOST_NAMED,
    alternating_mark_indices,
    draw_lines,
    draw_marks,
    label_line_ends,
    plot_arguments_of_mark,
    rows_by_target,
    set_time_axis,
    targets_legend_entry,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import Mark
from dsa_des.record.drawing import DPI, draw_to_png, figure_text
from dsa_des.replicas.outage_times import outage_times_of_seeds
from dsa_des.running.simulation import Simulation

Scans = dict[str, SensorScans]

MOST_SCANS_SHOWN = 90
"""Scans of the fastest sensor in the close-up."""
_SIZE_IN = (9.6, 7.0)
_LEFT, _WIDTH, _BELOW = 0.105, 0.87, 0.785  # beside the whole run are names of targets
_GOLDEN = 0.618  # keeps the marks of many targets from lining up


@dataclass
class CloseUp:
    """The part of a run shown scan by scan, why it was chosen, and the instants of fusion in it."""

    start_s: float
    end_s: float
    what: str
    joined: list[tuple[float, list[str]]]


def draw_timeline(
    path: Path,
    simulation: Simulation,
    flights: Flights | None,
    detected: Detected,
    folder: Path,
    alerted: Alerted,
) -> Path:
    """Draw a close-up of single scans, and range over time for the whole run."""
    duration_s = float(simulation.duration_s)
    scans = read_scans(folder)
    title = figure_text(simulation.scene.title, 80)
    with draw_to_png(*_SIZE_IN, path) as figure:
        if not scans:  # a scene without sensors has ranges only
            whole = figure.add_axes((_LEFT, 0.1, _BELOW, 0.8))
            _draw_ranges(whole, flights, detected, duration_s, alerted)
            whole.set_title(f"{title}: no sensor scans", loc="left")
            return path
        close_up = find_close_up(scans, folder, duration_s)
        shown = scans_between(folder, close_up.start_s, close_up.end_s, scans)
        share = min(0.42, 0.14 + 0.07 * max(1, len(detected.sensors)))
        above = figure.add_axes((_LEFT, 0.94 - share, _WIDTH, share))
        _draw_scans(above, scans, shown, detected.styles, close_up)
        # The legend stands beside the lower line.
        above.set_title(f"{title}\n{close_up.what}", loc="left")
        below = figure.add_axes((_LEFT, 0.08, _BELOW, 0.94 - share - 0.08 - 0.15))
        _draw_ranges(below, flights, detected, duration_s, alerted)
        below.axvspan(close_up.start_s, close_up.end_s, color="#000000", alpha=0.12, linewidth=0)
        scene = simulation.scene
        out_s = outage_times_of_seeds(scene, [scene.seed], np.array([duration_s]))
        bars = _draw_outages(below, {n: s for n, (s,) in out_s.items()}, detected.styles)
        below.set_title(f"Whole run (shaded: the part above{bars})", loc="left")
    return path


def find_close_up(scans: Scans, folder: Path, duration_s: float) -> CloseUp:
    """Return the part shown scan by scan: at the first fusion, else first detection, else start.

    It lies around the first instant at which the most sensors were fused, else around the first
    detection, else at the start. It is four periods of the slowest sensor long, but has at most
    `MOST_SCANS_SHOWN` scans of the fastest.
    """
    periods = [one.period_s for one in scans.values() if one.period_s is not None]
    length_s = duration_s
    if periods:
        length_s = min(4.2 * max(periods), MOST_SCANS_SHOWN * min(periods), duration_s)
    anchor_s, what = 0.0, "At the start of the run"
    first = [one.first_hit_s for one in scans.values() if one.first_hit_s is not None]
    if first:
        anchor_s, what = min(first), "Around the first detection"
    together = _first_fusion_of_most_sensors(folder, len(scans))
    if together is not None:
        anchor_s, number = together
        word = {2: "two", 3: "three", 4: "four"}.get(number, str(number))
        what = f"Around the first fusion of {word} sensors"
    start_s = max(0.0, min(anchor_s - 0.3 * length_s, duration_s - length_s))
    end_s = start_s + length_s
    return CloseUp(start_s, end_s, what, _fused_combinations(folder, start_s, end_s))


def _first_fusion_of_most_sensors(folder: Path, sensors: int) -> tuple[float, int] | None:
    """Return the first time at which most sensors were fused, s, and how many; None if never."""
    best: tuple[float, int] | None = None
    for time_s, code, names in iterate_fused(folder):
        size = np.array([name.count("+") + 1 for name in names])[code]
        largest = int(size.max())
        if largest > (1 if best is None else best[1]):
            best = float(time_s[np.argmax(size == largest)]), largest
        if best is not None and best[1] >= sensors:
            break
    return best


def _fused_combinations(
    folder: Path, start_s: float, end_s: float
) -> list[tuple[float, list[str]]]:
    result: set[tuple[float, str]] = set()
    for time_s, code, names in iterate_fused(folder):
        low, high = np.searchsorted(time_s, [start_s, end_s])
        for row in range(int(low), int(high)):
            if "+" in names[code[row]]:
                result.add((float(time_s[row]), names[code[row]]))
        if len(time_s) and time_s[-1] > end_s:
            break
    return [(time_s, name.split("+")) for time_s, name in sorted(result)]


def _draw_scans(
    axes: Any,
    scans: Scans,
    shown: dict[str, ScansShown],
    styles: Mapping[str, Mark],
    close_up: CloseUp,
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    sensors = list(styles)
    # The first sensor on top, as in the legend of the plan.
    height = {name: len(sensors) - 1 - i for i, name in enumerate(sensors)}
    names = []
    nothing = ScansShown(np.empty(0), np.empty(0))
    for name in sensors:
        here = shown.get(name, nothing)
        style = styles[name]
        period_s = scans[name].period_s if name in scans else None
        if len(here.time_s) > 2:  # the rate may change while a run lasts
            period_s = scan_period_s(here.time_s)
        label = figure_text(name, 16)
        names.append(f"{label}\n{1.0 / period_s:.4g} Hz" if period_s else label)
        size = min(7.0, _mark_size(len(here.time_s)))
        axes.plot(
            here.time_s, np.full(len(here.time_s), height[name]), linestyle="none", marker="|",
            markersize=20, markeredgewidth=1.0, color=style.colour, clip_on=False,
        )  # fmt: skip
        hit_s = here.hit_s[here.hit_s >= close_up.start_s]
        mark = plot_arguments_of_mark(style) | {"markersize": size, "markerfacecolor": style.colour}
        axes.plot(hit_s, np.full(len(hit_s), height[name]), **mark, zorder=3.0, clip_on=False)
    segments: list[Any] = []
    dots: list[tuple[float, float]] = []
    for fused_s, together in close_up.joined:
        points = []
        for name in sorted((n for n in together if n in height), key=lambda n: height[n]):
            # Fused within a gate: the scan meant is the latest one with a detection.
            hit_s = shown.get(name, nothing).hit_s
            at = int(np.searchsorted(hit_s, fused_s, side="right")) - 1
            points.append((float(hit_s[at]) if at >= 0 else fused_s, float(height[name])))
        segments += pairwise(points)
        dots += points
    if segments:
        axes.add_collection(LineCollection(segments, colors="#000000", linewidths=1.6, zorder=1.5))
        where = np.array(sorted(set(dots)))
        size = min(11.0, _mark_size(len(close_up.joined)) * 1.4)
        axes.plot(
            where[:, 0], where[:, 1], linestyle="none", marker="o", markersize=size,
            markeredgecolor="#000000", markerfacecolor="none", markeredgewidth=1.4, zorder=4.0,
            clip_on=False,
        )  # fmt: skip
    axes.set_yticks([height[name] for name in sensors], names)
    axes.tick_params(axis="y", length=0, pad=9)
    axes.spines["left"].set_visible(False)
    axes.set_ylim(-0.6, max(1, len(sensors)) - 0.4)
    axes.set_xlim(close_up.start_s, max(close_up.end_s, close_up.start_s + 1e-9))
    axes.set_xlabel("time (s)")
    handles = [
        Line2D([], [], linestyle="none", marker="|", markersize=10, color="#555555", label="scan"),
        Line2D([], [], linestyle="none", marker="s", markersize=6, color="#555555",
               label="scan with a detection"),
        Line2D([], [], color="#000000", marker="o", markersize=9, markerfacecolor="none",
               label="fused"),
    ]  # fmt: skip
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False,
        borderaxespad=0.1,
    )  # fmt: skip


def _draw_outages(axes: Any, out_s: Mapping[str, FloatArray], styles: Mapping[str, Mark]) -> str:
    """Draw a bar at the bottom where a sensor was off or failed; return its words for the title."""
    out = [name for name in styles if len(out_s.get(name, ()))]
    for number, name in enumerate(out):
        from_s, to_s = out_s[name].T
        axes.broken_barh(
            np.column_stack((from_s, to_s - from_s)), (0.005 + 0.025 * number, 0.02),
            color=styles[name].colour, transform=axes.get_xaxis_transform(), zorder=4.0, label=name,
        )  # fmt: skip
    names = ", ".join(figure_text(name, 16) for name in out)
    return f"; bars: {names} off or failed" if out else ""


def _mark_size(count: int) -> float:
    """Return the size in points at which `count` marks in a row do not touch."""
    return 0.65 * _SIZE_IN[0] * _WIDTH * 72 / max(1, count)


def _draw_ranges(
    axes: Any,
    flights: Flights | None,
    detected: Detected,
    duration_s: float,
    alerted: Alerted,
) -> None:
    from matplotlib.lines import Line2D

    top_km = max(
        (float(np.nanmax(r)) / 1000 for r in detected.range_m.values() if np.isfinite(r).any()),
        default=0.0,
    )
    handles = []
    lines: list[Any] = []
    if flights is not None:
        lines = [np.column_stack((t.time_s, t.range_m / 1000)) for t in flights.targets]
        farthest = max((float(np.nanmax(line[:, 1], initial=0.0)) for line in lines), default=0.0)
        # A target that stays far beyond anything detected would flatten all the rest.
        top_km = min(farthest, 1.6 * top_km) if top_km else farthest
    top_km = max(1.05 * top_km, 0.1)
    axes.set_ylim(0.0, top_km)
    set_time_axis(axes, 0.0, duration_s, "true slant range (km)")
    if lines:
        draw_lines(axes, lines)
        handles.append(targets_legend_entry(len(lines) >= DENSE))
        if flights is not None and len(lines) <= MOST_NAMED:
            names = [target.name for target in flights.targets]
            label_line_ends(axes, dict(zip(names, lines, strict=True)), "#333333")
        if flights is not None:
            ranges = {t.name: (t.time_s, t.time_s, t.range_m / 1000) for t in flights.targets}
            draw_alerted_lines(axes, alerted, ranges)
    draw_manoeuvres(axes, alerted.manoeuvres_s, np.zeros(len(alerted.manoeuvres_s)))
    handles += alerted.legend_entries()
    width_px = _SIZE_IN[0] * _BELOW * DPI
    for name in detected.sensors:
        _draw_detections(axes, detected, name, width_px / duration_s)
        label = figure_text(name, 16)
        handles.append(Line2D([], [], **plot_arguments_of_mark(detected.styles[name]), label=label))
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles),
        frameon=False, borderaxespad=0.1, columnspacing=1.2, handletextpad=0.3,
    )  # fmt: skip


def _draw_detections(axes: Any, detected: Detected, name: str, px_per_s: float) -> None:
    points = np.column_stack((detected.time_s[name], detected.range_m[name] / 1000))
    kept = [
        rows[
            alternating_mark_indices(
                points[rows, 0] * px_per_s, detected.styles, name, _GOLDEN * target
            )
        ]
        for target, rows in rows_by_target(detected.target[name])
    ]
    if kept:
        draw_marks(axes, detected.styles[name], points[np.concatenate(kept)])
