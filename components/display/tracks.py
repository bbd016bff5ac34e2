"""``tracks.png``: estimated tracks over the true flights.

Tracks are those that were confirmed and have a range.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.display.outcomes import (
    NEAR_M,
    TABLE,
    distances_to_targets,
    flights_of_other_aircraft,
)
from components.display.recorded_rows import iterate_row_groups, row_count
from components.display.symbols import DENSE, Labels, draw_line_density
from components.messages.columns import ORIGIN, STATE
from components.messages.state_tracks import COVARIANCE, is_confirmed_or_coasted
from components.metrics.true_states import TargetsInFrame
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.mark import PALETTE
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts
from dsa_des.running.simulation import Simulation

#: Of trackers and tracks, in turn; black is the truth.
COLOURS = PALETTE[:-1]
_FALSE, _TRUTH, _OWN = "#999999", "#000000", "#666666"
_COLUMNS = (
    "tick", "block", "state_s", "track", "track_status", "has_range", "nis", "nis_freedom", *STATE,
    *ORIGIN, *COVARIANCE.values(),
)  # fmt: skip
# Rows that are read of a table, at most; of a larger one, groups of rows spread over it.
_MOST_ROWS = 1_000_000
# Of each track so many first rows are kept, and of all others so many at most, at random instants:
# a figure shows no more of a longer run, and takes no more memory.
_FIRST_ROWS, _KEPT_ROWS = 200, 40_000
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
# Chi-square quantiles of 95 % in a plane and on a line.
_PLANE, _LINE = 5.991464547107979, 3.841458820694124
_MOST_POINTS, _ELLIPSES = 400, 8
#: More names and numbers than this cannot be told apart.
_MOST_NAMED = 12
#: Of more tracks than this, no ellipses and bands are drawn, which would cover each other.
MOST_SPREADS = 40
#: A target that moves less is a dot on the plan.
_STILL_M = 10.0


@dataclass(frozen=True, eq=False)
class DrawnTrack:
    """One track's rows in order of time; it counts as false if it is never near any target."""

    block: str
    number: int
    columns: dict[str, Any]
    false: bool
    #: That of its tracker where several are compared, else its own, in all figures.
    colour: str


class Thinning:
    """Chooses rows of tracks to keep: all of short tracks, at random instants of long ones."""

    def __init__(self, rows: int) -> None:
        self._each = np.uint64(max(1, math.ceil(rows / _KEPT_ROWS)))
        self._seen: dict[tuple[str, int], int] = {}

    def __call__(self, tick: IntArray, block: Any, track: IntArray) -> BoolArray:
        """Return whether each row is kept; rows follow those of the calls before."""
        kept = (tick.astype(np.uint64) * _SPREAD >> np.uint64(32)) % self._each == 0
        for name in np.unique(block[~kept].astype(str)).tolist():
            mine = block == name
            for number in np.unique(track[mine & ~kept]).tolist():
                rows = np.flatnonzero(mine & (track == number))
                known = self._seen.get((name, number), 0)
                self._seen[name, number] = known + len(rows)
                kept[rows[: max(_FIRST_ROWS - known, 0)]] = True
        return np.asarray(kept)


class DrawnTracks:
    """Confirmed tracks of all trackers in a run, and the true flights in their frame."""

    def __init__(self, simulation: Simulation, columns: dict[str, Any]) -> None:
        self.origin = tuple(float(columns[name][0]) for name in ORIGIN)
        self.time_s = float(columns["state_s"].min()), float(columns["state_s"].max())
        sources = [b for b in simulation.components.values() if isinstance(b, TrafficSource)]
        self.own = sources[0].own if sources else None
        targets = [target for source in sources for target in source.targets]
        self.targets = TargetsInFrame(targets, self.origin)
        self.tracks = []
        self.blocks = sorted(set(columns["block"].tolist()))
        #: What each tracker may see.
        self.seen_by = {
            block: TargetsInFrame(flights_of_other_aircraft(simulation, block), self.origin)
            for block in self.blocks
        }
        several = len(self.blocks) > 1
        for index, block in enumerate(self.blocks):
            turn = index
            mine = columns["block"] == block
            for number in np.unique(columns["track"][mine]).tolist():
                rows = np.flatnonzero(mine & (columns["track"] == number))
                one = {name: columns[name][rows] for name in columns}
                near = distances_to_targets(
                    one, slice(None), self.seen_by[block].positions_at(one["state_s"])
                )
                # A comparison with nothing, as with what is not there, is false.
                false = bool(len(targets)) and not bool((near < NEAR_M).any())
                colour = _FALSE if false else COLOURS[turn % len(COLOURS)]
                turn += not (false or several)
                self.tracks.append(DrawnTrack(block, number, one, false, colour))

    @classmethod
    def read(cls, simulation: Simulation, folder: Path) -> "DrawnTracks | None":
        """Return a run's confirmed and coasted tracks with a range, thinned; None if none."""
        path, rows = folder / f"{TABLE}.parquet", []
        thinning = Thinning(min(row_count(path), _MOST_ROWS))
        for group in iterate_row_groups(path, _COLUMNS, _MOST_ROWS):
            group["block"] = np.array(group["block"].names, dtype=object)[group["block"].codes]
            wanted = np.flatnonzero(
                is_confirmed_or_coasted(group["track_status"]) & group["has_range"]
            )
            kept = wanted[thinning(*(group[n][wanted] for n in ("tick", "block", "track")))]
            rows.append({n: group[n][kept] for n in _COLUMNS if n not in ("track_status", "tick")})
        if not any(len(part["block"]) for part in rows):
            return None
        names = list(rows[0])
        return cls(simulation, {n: np.concatenate([part.pop(n) for part in rows]) for n in names})


def draw_tracks(path: Path, drawn: DrawnTracks) -> Path:
    """Draw tracks with 95 % ellipses from above, and their heights over time, as PNG."""
    grid = np.linspace(*drawn.time_s, _MOST_POINTS)
    positions, own = drawn.targets.positions_at(grid), drawn.targets.position(drawn.own, grid)
    with draw_to_png(7.5, 8.4, path) as figure:
        plan, height = figure.subplots(2, 1, height_ratios=(3, 1))
        _draw_flight(plan, height, grid, own, drawn.origin[2], {"color": _OWN, "linestyle": "--"})
        dense = len(positions) >= DENSE
        for position in positions:  # under a density their lines only make room
            style = {"color": _TRUTH, "alpha": 0.0 if dense else 1.0}
            _draw_flight(plan, height, grid, position, drawn.origin[2], style)
            if np.nanmax(np.ptp(position, axis=1), initial=0.0) < _STILL_M:
                plan.scatter(position[1, :1] / 1e3, position[0, :1] / 1e3, s=6, color=_TRUTH)
        spreads = len(drawn.tracks) <= MOST_SPREADS
        for one in drawn.tracks:
            _draw_track(plan, height, one, drawn.origin[2], spreads)
        plan.set_aspect("equal", adjustable="datalim")
        plan.set_xlabel("east of the origin (km)")
        plan.set_ylabel("north of the origin (km)")
        height.set_xlabel("time (s)")
        height.set_ylabel("height in the frame (m)")
        false = sum(one.false for one in drawn.tracks)
        many = len(drawn.tracks) - false
        plan.set_title(
            f"{many} confirmed track{'s' * (many != 1)} near targets, {false} false", loc="left"
        )
        _draw_legend(figure, drawn, false > 0, dense)
        fit_axes_to_texts(figure)
        figure.subplots_adjust(top=0.93)
        _label_flights_and_tracks(figure, plan, drawn, positions, own)
        if dense:
            draw_line_density(plan, [ned_m[[1, 0]].T / 1e3 for ned_m in positions])
            above = drawn.origin[2] - positions[:, 2]
            draw_line_density(height, [np.column_stack([grid, line]) for line in above])
    return path


def _draw_flight(
    plan: Any, height: Any, time_s: FloatArray, ned_m: FloatArray, alt_m: float, style: Any
) -> None:
    plan.plot(ned_m[1] / 1e3, ned_m[0] / 1e3, linewidth=0.7, zorder=1, **style)
    height.plot(time_s, alt_m - ned_m[2], linewidth=0.7, zorder=1, **style)


def _draw_track(
    plan: Any, height: Any, track: DrawnTrack, origin_alt_m: float, spreads: bool
) -> None:
    every = track.columns
    rows = np.arange(len(every["state_s"]))[:: max(1, len(every["state_s"]) // _MOST_POINTS)]
    one = {name: values[rows] for name, values in every.items()}
    colour = track.colour
    style = {"color": colour, "linestyle": ":" if track.false else "-",
             "linewidth": 1.4 if spreads else 0.8}  # fmt: skip
    east, north = one["east_m"] / 1e3, one["north_m"] / 1e3
    plan.plot(east, north, zorder=2, **style)
    if track.false:
        plan.plot(east[:1], north[:1], color=colour, marker="x", markersize=6, zorder=2)
    above = origin_alt_m - one["down_m"]
    spread = np.sqrt(_LINE * one["covariance_22_m2"])
    height.plot(one["state_s"], above, zorder=2, **style)
    if not spreads:
        return
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


def _draw_legend(figure: Any, drawn: DrawnTracks, false: bool, dense: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    blocks, many = drawn.blocks, len(drawn.tracks)
    alone = "track, by its number" if many <= _MOST_NAMED else "track"
    entries = [
        Patch(facecolor="#777777", label="truth (darker: more)")
        if dense
        else Line2D([], [], color=_TRUTH, linewidth=0.7, label="truth"),
        Line2D([], [], color=_OWN, linewidth=0.7, linestyle="--", label="ownship"),
        *(
            Line2D(
                [],
                [],
                color=COLOURS[index % len(COLOURS)],
                linewidth=1.4,
                label=figure_text(block, 16) if blocks[1:] else alone,
            )
            for index, block in enumerate(blocks)
        ),
    ]
    if many <= MOST_SPREADS:
        shade = _FALSE if blocks[1:] else COLOURS[0]
        entries.append(Patch(facecolor=shade, alpha=0.3, label="95 %"))
    if false:
        entries.append(
            Line2D([], [], color=_FALSE, linestyle=":", marker="x", label="never near a target")
        )
    figure.legend(handles=entries, loc="upper center", ncols=min(len(entries), 7), frameon=False)


def _label_flights_and_tracks(
    figure: Any, plan: Any, drawn: DrawnTracks, positions: FloatArray, own: FloatArray
) -> None:
    """Write aircraft names at the ends of flights and track numbers at their beginnings."""
    plan.apply_aspect()
    x, y = plan.get_xlim(), plan.get_ylim()
    plan.set(xlim=x, ylim=y)
    per_px = (x[1] - x[0]) / plan.get_window_extent().width
    lines = [ned_m[[1, 0]].T / 1e3 for ned_m in (*positions, own)]
    lines += [
        np.column_stack([one.columns["east_m"], one.columns["north_m"]]) / 1e3
        for one in drawn.tracks
    ]
    points = np.concatenate(lines)
    labels = Labels(plan, x, y, per_px, points[~np.isnan(points).any(axis=1)])
    for name, line in zip((*drawn.targets.names, "ownship"), lines, strict=False):
        there = line[~np.isnan(line).any(axis=1)]
        if len(there) and len(drawn.targets.names) <= _MOST_NAMED:
            labels.add(figure_text(name), float(there[-1][0]), float(there[-1][1]))
    if len(drawn.tracks) > _MOST_NAMED:
        return
    for one, line in zip(drawn.tracks, lines[len(positions) + 1 :], strict=True):
        labels.add(f"{one.number}", float(line[0][0]), float(line[0][1]), one.colour, "bold")
