"""``tracks.png``: estimated tracks with their 95 % ellipses over the true flights."""

from pathlib import Path
from typing import Any

import numpy as np

from components.display.drawn_tracks import DrawnTrack, DrawnTracks
from components.display.labels import Labels
from dsa_des.arrays.types import FloatArray
from dsa_des.record.drawing import drawing, figure_text, tight

#: Okabe and Ito's colours, as in all figures, in turn.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_FALSE, _TRUTH, _OWN = "#999999", "#000000", "#666666"
# Chi-square quantiles of 95 % in a plane and on a line.
_PLANE, _LINE = 5.991464547107979, 3.841458820694124
_MOST_POINTS, _ELLIPSES = 400, 8
#: More names and numbers than this cannot be told apart.
_MOST_NAMED = 12


def draw_tracks(path: Path, told: DrawnTracks) -> Path:
    """Draw confirmed tracks that have a range, on the plan and by height.

    Parameters
    ----------
    path : Path
        The PNG to write.
    told : DrawnTracks
    """
    grid = np.linspace(*told.time_s, _MOST_POINTS)
    places, own = told.targets.at(grid), told.targets.own(grid)
    with drawing(7.5, 8.4, path) as figure:
        plan, height = figure.subplots(2, 1, height_ratios=(3, 1))
        _flight(plan, height, grid, own, told.origin[2], {"color": _OWN, "linestyle": "--"})
        for place in places:
            _flight(plan, height, grid, place, told.origin[2], {"color": _TRUTH})
        for one in told.tracks:
            _draw_one(plan, height, one, told.origin[2])
        plan.set_aspect("equal", adjustable="datalim")
        plan.set_xlabel("east of the origin [km]")
        plan.set_ylabel("north of the origin [km]")
        height.set_xlabel("time [s]")
        height.set_ylabel("height in the frame [m]")
        false = sum(one.false for one in told.tracks)
        many = len(told.tracks) - false
        plan.set_title(
            f"{many} confirmed track{'s' * (many != 1)} near targets, {false} false", loc="left"
        )
        _legend(figure, false > 0)
        tight(figure)
        figure.subplots_adjust(top=0.93)
        _names(figure, plan, told, places, own)
    return path


def _flight(
    plan: Any, height: Any, time_s: FloatArray, place: FloatArray, alt_m: float, style: Any
) -> None:
    plan.plot(place[1] / 1e3, place[0] / 1e3, linewidth=0.7, zorder=1, **style)
    height.plot(time_s, alt_m - place[2], linewidth=0.7, zorder=1, **style)


def _draw_one(plan: Any, height: Any, track: DrawnTrack, origin_alt_m: float) -> None:
    every = track.columns
    rows = np.arange(len(every["state_s"]))[:: max(1, len(every["state_s"]) // _MOST_POINTS)]
    one = {name: values[rows] for name, values in every.items()}
    colour = colour_of(track)
    style = {"color": colour, "linestyle": ":" if track.false else "-", "linewidth": 1.4}
    east, north = one["east_m"] / 1e3, one["north_m"] / 1e3
    plan.plot(east, north, zorder=2, **style)
    if track.false:
        plan.plot(east[:1], north[:1], color=colour, marker="x", markersize=6, zorder=2)
    above = origin_alt_m - one["down_m"]
    spread = np.sqrt(_LINE * one["covariance_22_m2"])
    height.plot(one["state_s"], above, zorder=2, **style)
    height.fill_between(
        one["state_s"], above - spread, above + spread, color=colour, alpha=0.2, linewidth=0
    )
    turn = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = np.sqrt(_PLANE) * np.stack([np.cos(turn), np.sin(turn)])
    for row in range(0, len(east), max(1, len(east) // _ELLIPSES)):
        nn, ne, ee = (one[f"covariance_{ij}_m2"][row] for ij in ("00", "01", "11"))
        edge = np.linalg.cholesky(np.array([[nn, ne], [ne, ee]])) @ circle / 1e3
        x, y = east[row] + edge[1], north[row] + edge[0]
        plan.fill(x, y, facecolor=colour, alpha=0.2, linewidth=0, zorder=1)
        plan.plot(x, y, color=colour, linewidth=0.6, zorder=1)


def colour_of(track: DrawnTrack) -> str:
    """Return a track's colour in all figures."""
    return _FALSE if track.false else COLOURS[(track.number - 1) % len(COLOURS)]


def _legend(figure: Any, false: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries = [
        Line2D([], [], color=_TRUTH, linewidth=0.7, label="truth"),
        Line2D([], [], color=_OWN, linewidth=0.7, linestyle="--", label="ownship"),
        Line2D([], [], color=COLOURS[0], linewidth=1.4, label="track, by its number"),
        Patch(facecolor=COLOURS[0], alpha=0.3, label="95 %"),
    ]
    if false:
        entries.append(
            Line2D([], [], color=_FALSE, linestyle=":", marker="x", label="never near a target")
        )
    figure.legend(handles=entries, loc="upper center", ncols=len(entries), frameon=False)


def _names(figure: Any, plan: Any, told: DrawnTracks, places: FloatArray, own: FloatArray) -> None:
    """Write names of aircraft at their ends and numbers of tracks at their beginnings."""
    plan.apply_aspect()
    x, y = plan.get_xlim(), plan.get_ylim()
    plan.set(xlim=x, ylim=y)
    per_px = (x[1] - x[0]) / plan.get_window_extent().width
    lines = [place[[1, 0]].T / 1e3 for place in (*places, own)]
    lines += [
        np.column_stack([one.columns["east_m"], one.columns["north_m"]]) / 1e3
        for one in told.tracks
    ]
    points = np.concatenate(lines)
    labels = Labels(plan, x, y, per_px, points[~np.isnan(points).any(axis=1)])
    for name, line in zip((*told.targets.names, "ownship"), lines, strict=False):
        there = line[~np.isnan(line).any(axis=1)]
        if len(there) and len(told.targets.names) <= _MOST_NAMED:
            labels.add(figure_text(name), float(there[-1][0]), float(there[-1][1]))
    if len(told.tracks) > _MOST_NAMED:
        return
    blocks = {one.block for one in told.tracks}
    for one, line in zip(told.tracks, lines[len(places) + 1 :], strict=True):
        text = f"{one.number}" if len(blocks) == 1 else f"{figure_text(one.block)} {one.number}"
        labels.add(text, float(line[0][0]), float(line[0][1]), colour_of(one), "bold")
