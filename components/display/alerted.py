"""What pictures of a run show of its alerts and of the manoeuvres that followed."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables, read_table
from dsa_des.arrays.types import FloatArray

#: Colour and width of an alert by its level, from 1; levels beyond the last share its own. Each is
#: thicker than the one before, so that none is told by its colour alone.
_LEVELS = (("#d9b300", 3.0), ("#e07b00", 4.5), ("#c1121f", 6.0))
_MANOEUVRE: dict[str, Any] = {
    "linestyle": "none", "marker": "^", "markersize": 8, "markerfacecolor": "#ffffff",
    "markeredgecolor": "#000000", "markeredgewidth": 1.4,
}  # fmt: skip


@dataclass
class Alerted:
    """Alerts by target, level and time, and the times of commanded manoeuvres."""

    #: Target → level, and from when to when, s; of several alerting blocks the highest counts.
    stretches: dict[str, list[tuple[int, float, float]]] = field(default_factory=dict)
    #: By platform, where there are several; else of the ownship, the empty name.
    manoeuvres: dict[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> "Alerted":
        """Return a run folder's recorded alerts and manoeuvres; empty where not recorded."""
        names = [n for n in ("alerts", "manoeuvres") if (folder / f"{n}.parquet").is_file()]
        run = RecordedTables(folder, {n: read_table(folder / f"{n}.parquet") for n in names})
        result = cls()
        if "manoeuvres" in names:
            result.manoeuvres = _manoeuvre_times_by_platform(run)
        if "alerts" in names and run.tables["alerts"].num_rows:
            result.stretches = _alert_periods_by_target(run)
        return result

    @property
    def manoeuvres_s(self) -> FloatArray:
        """Times of the commanded manoeuvres of all platforms, s, ascending and each once."""
        return np.unique(np.concatenate([np.empty(0), *self.manoeuvres.values()]))

    @property
    def levels(self) -> list[int]:
        """Alert levels that occurred in the run, ascending."""
        return sorted({level for mine in self.stretches.values() for level, _, _ in mine})

    def legend_entries(self) -> list[Any]:
        """Return Matplotlib legend handles, one per occurred alert level, one for manoeuvres."""
        from matplotlib.lines import Line2D

        handles = []
        for level in self.levels:
            colour, width = alert_colour_and_width(level)
            line = Line2D([], [], color=colour, linewidth=width, label=f"alert {level}")
            line.set_solid_capstyle("butt")
            handles.append(line)
        if self.manoeuvres:
            handles.append(Line2D([], [], **_MANOEUVRE, label="manoeuvre"))
        return handles


def alert_colour_and_width(level: int) -> tuple[str, float]:
    """Return colour and line width in which an alert of this level is drawn."""
    return _LEVELS[min(level, len(_LEVELS)) - 1]


def _manoeuvre_times_by_platform(run: RecordedTables) -> dict[str, FloatArray]:
    """Return manoeuvre times, s, by name of the platform that flies; empty where not recorded."""
    time_s = run.numbers("manoeuvres", "time_s")
    on = np.full(len(time_s), "", dtype=object)
    if run.has_columns("manoeuvres", "platform"):
        on[:] = run.texts("manoeuvres", "platform")
    return {name: np.unique(time_s[on == name]) for name in sorted(set(on.tolist()))}


def _alert_periods_by_target(run: RecordedTables) -> dict[str, list[tuple[int, float, float]]]:
    """Return each target's alerts (level, begin, end in s), lasting to the alerter's next scan."""
    level = run.numbers("alerts", "level").astype(np.int64)
    time_s = run.numbers("alerts", "time_s")
    block = np.array(run.texts("alerts", "block") if run.has_columns("alerts", "block") else [""])
    block = np.broadcast_to(block, level.shape)
    each = {name: np.unique(time_s[block == name]) for name in np.unique(block).tolist()}
    last = {n: float(t[-1] + (np.median(np.diff(t)) if len(t) > 1 else 0)) for n, t in each.items()}
    looks = np.unique(np.append(time_s, [*last.values()]))
    ends = np.append(looks[1:], looks[-1])
    on = np.flatnonzero(level > 0)
    targets = np.array(run.tables["alerts"]["target"].take(on).to_pylist(), dtype=object)
    result: dict[str, list[tuple[int, float, float]]] = {}
    for target in sorted({name for name in targets.tolist() if name is not None}):
        highest = np.zeros(len(looks), dtype=np.int64)
        for name, mine in each.items():
            here = on[(targets == target) & (block[on] == name)]
            said = np.zeros(len(mine), dtype=np.int64)
            np.maximum.at(said, np.searchsorted(mine, time_s[here]), level[here])
            look = np.searchsorted(mine, looks, side="right") - 1
            stands = (look >= 0) & ((looks < last[name]) | (looks == mine[-1]))
            highest = np.maximum(highest, np.where(stands, said[look], 0))
        edges = np.flatnonzero(np.diff(highest, prepend=-1, append=-1))
        result[target] = [
            (int(highest[a]), float(looks[a]), float(ends[b - 1]))
            for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
            if highest[a] > 0
        ]
    return result


def draw_alerted_lines(
    axes: Any, alerted: Alerted, lines: dict[str, tuple[FloatArray, FloatArray, FloatArray]]
) -> None:
    """Draw, below targets' lines, parts flown under alert in its colour: times (s), x and y."""
    from matplotlib.collections import LineCollection

    segments, colours, widths = [], [], []
    for target, (time_s, x, y) in lines.items():
        for level, begin, end in alerted.stretches.get(target, ()):
            inside = time_s[(time_s > begin) & (time_s < end)]
            at = np.concatenate([[begin], inside, [end]])
            points = np.column_stack((np.interp(at, time_s, x), np.interp(at, time_s, y)))
            if not np.isfinite(points).all():
                points = points[np.isfinite(points).all(axis=1)]
            colour, width = alert_colour_and_width(level)
            segments.append(points)
            colours.append(colour)
            widths.append(width)
    if segments:
        axes.add_collection(
            LineCollection(segments, colors=colours, linewidths=widths, alpha=0.75, zorder=0.9,
                           capstyle="butt"), autolim=False,
        )  # fmt: skip


def draw_manoeuvres(axes: Any, x: FloatArray, y: FloatArray) -> None:
    """Mark where, or when, an aircraft was commanded a manoeuvre."""
    if len(x):
        axes.plot(x, y, **_MANOEUVRE, zorder=3.2, scalex=False, scaley=False, clip_on=False)
