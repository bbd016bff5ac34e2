"""The kit of symbols of all pictures: marks of sensors, marks left out, and names beside them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from components.sensor.palette import COOPERATIVE, EO, FUSION, IR, LASER, RADAR, TRACKER
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.mark import Mark, distinguish_marks, plot_mark_by_name
from dsa_des.record.drawing import figure_text

FONT_SIZE = 8
#: From so many lines on their density is drawn, in so many cells across and up.
DENSE = 100
#: From so many on they are thinner, and at most so many are named.
MANY, MOST_NAMED = 20, 8
OWN, TARGET = "#000000", "#777777"
_CELLS = (160, 100)
_LINE_PX = FONT_SIZE * 1.9
_LETTER_PX = FONT_SIZE * 0.95
_GAP_PX = 8.0
_CELL_PX = 6.0
# Between marks of different sensors on one path, and how many are drawn of one sensor.
_SPACING_PX, _MOST_MARKS = 9.0, 5000

#: How far the second and the third of a kind are from its colour towards white, or black if minus;
#: of a light colour the other way round.
_SHADES = (0.0, 0.4, -0.35)
_LIGHT = 0.25
#: What is on board of each of several platforms, the ownship's first: told apart also without hues.
_PLATFORMS = ("#0072B2", "#D55E00", "#009E73", "#7B3294", "#8C6D00", "#3A3A3A")
_KINDS = (
    ("radar", RADAR), ("laser", LASER), ("optical.ir", IR), ("optical", EO),
    ("surveillance", COOPERATIVE), ("tracking", TRACKER), ("fusion", FUSION),
    ("track_fusion", FUSION),
)  # fmt: skip
#: On the dark ground of globes, and of pages of that theme: aircraft, and levels of alerts.
ON_DARK = {"own": "#eeeeee", "truth": "#a0a0a0"}
LEVELS_ON_DARK = ("#f0d040", "#ff9c4a", "#ff7a7a")

_NAME_PT = FONT_SIZE - 1
Box = tuple[float, float, float, float]


def sensor_marks(
    names: Iterable[str], blocks: Mapping[str, Any], carrying: Mapping[str, str] | None = None
) -> dict[str, Mark]:
    """Return marker, size and colour of each sensor by name, the same in every figure of a run.

    Where several platforms are `carrying` blocks, the colour is that of the platform.
    """
    classes = {name: type(blocks[name]) if name in blocks else None for name in names}
    carrying = carrying or {}
    return recolour_by_platform(
        plot_mark_by_name(classes), carrying, platform_colours(carrying.values())
    )


def platform_colours(platforms: Iterable[str]) -> dict[str, str]:
    """Return a colour for each platform by name; empty for a single platform."""
    names = list(dict.fromkeys(platforms))
    colours = {name: _PLATFORMS[k % len(_PLATFORMS)] for k, name in enumerate(names)}
    return colours if len(names) > 1 else {}


def recolour_by_platform(
    marks: Mapping[str, Mark], carrying: Mapping[str, str], colours: Mapping[str, str]
) -> dict[str, Mark]:
    """Return the marks with the colour of each block's platform, where there is one."""
    return {
        name: replace(mark, colour=colours.get(carrying.get(name, ""), mark.colour))
        for name, mark in marks.items()
    }


def plot_arguments_of_mark(style: Mark) -> dict[str, Any]:
    """Return a mark as keywords of Matplotlib's plot: large markers open, small ones filled."""
    big = style.size_pt > 7
    return {
        "linestyle": "none",
        "marker": style.marker,
        "markersize": style.size_pt,
        "markeredgecolor": style.colour,
        "markerfacecolor": "none" if big else style.colour,
        "markeredgewidth": 1.2 if big else 0.4,
    }


def block_marks(types: Mapping[str, str]) -> dict[str, Mark]:
    """Return each block's marker, size, colour by name, from its type; blocks of a kind differ.

    Markers are those of figures. Lines of sight and scans have none: colours differ too, in shades
    of that of the kind.
    """
    kinds = {
        name: next((mark for start, mark in _KINDS if kind.startswith(start)), None)
        for name, kind in types.items()
    }
    result = distinguish_marks(kinds)
    before: dict[Mark, int] = {}
    for name, kind in sorted(kinds.items()):
        if kind is not None:
            again = before.get(kind, 0)
            before[kind] = again + 1
            result[name] = replace(result[name], colour=_shade_colour(kind.colour, again))
    return result


def _shade_colour(colour: str, again: int) -> str:
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    share = _SHADES[again % len(_SHADES)] * (1 if _luminance(parts) < _LIGHT else -1)
    towards = 255 if share > 0 else 0
    mixed = [round(part + abs(share) * (towards - part)) for part in parts]
    return "#" + "".join(f"{part:02X}" for part in mixed)


def _luminance(parts: list[int]) -> float:
    """Return the relative luminance of sRGB (WCAG 2.2)."""
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4
              for p in (part / 255 for part in parts)]  # fmt: skip
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def staggered_mark_indices(along_px: FloatArray, spacing_px: float, phase: float) -> IntArray:
    """Return the indices of marks about `spacing_px` apart along a path, ascending.

    Several sensors that mark the same path take turns on it, each at its `phase`, a share of the
    spacing, so that their marks alternate instead of covering each other; every mark stays where it
    belongs. The first point is always kept, a gap stays a gap, and NaN is left out.
    """
    known = np.flatnonzero(np.isfinite(along_px))
    bins = np.floor(along_px[known] / spacing_px - phase)
    return known[np.diff(bins, prepend=-np.inf) > 0]


def spread_indices(count: int, most: int) -> IntArray:
    """Return at most `most` indices spread over ``range(count)``, with both ends."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.int64)


def alternating_mark_indices(
    along_px: FloatArray, styles: Mapping[str, Mark], name: str, shift: float = 0.0
) -> IntArray:
    """Return indices along a path at which this sensor is marked, so that sensors take turns."""
    phase = list(styles).index(name) / len(styles) + shift
    return staggered_mark_indices(along_px, _SPACING_PX * len(styles), phase)


def draw_marks(axes: Any, style: Mark, points: FloatArray) -> int:
    """Draw detections (n, 2), thinned if many, keeping axes' limits; return the number drawn."""
    few = points[spread_indices(len(points), _MOST_MARKS)]
    axes.plot(
        few[:, 0], few[:, 1], **plot_arguments_of_mark(style), zorder=2.0 + 1.0 / style.size_pt,
        scalex=False, scaley=False,
    )  # fmt: skip
    return len(few)


def rows_by_target(target: IntArray) -> list[tuple[int, IntArray]]:
    """Return each target number that occurs, ascending, with the indices of its rows."""
    order = np.argsort(target, kind="stable")
    starts = np.flatnonzero(np.diff(target[order], prepend=-1))
    return [(int(target[rows[0]]), rows) for rows in np.split(order, starts[1:]) if len(rows)]


def label_line_ends(axes: Any, lines: Mapping[str, FloatArray], colour: str) -> None:
    """Write line names at their last points within the axes, shifted so as not to overlap."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    ends = []
    for name, line in lines.items():
        x, y = line.T
        seen = np.flatnonzero((x >= left) & (x <= right) & (y >= low) & (y <= high))
        if len(seen):
            ends.append((float(y[seen[-1]]), float(x[seen[-1]]), name))
    height_pt = axes.get_window_extent().height * 72 / axes.figure.dpi
    step = 1.25 * _NAME_PT / height_pt * (high - low)
    heights: list[float] = []
    for y, _, _ in sorted(ends):
        heights.append(max(y, heights[-1] + step) if heights else y)
    over = max(0.0, heights[-1] - high) if heights else 0.0
    for (y, x, name), at in zip(sorted(ends), heights, strict=True):
        axes.annotate(
            figure_text(name, 14), (x, y), xytext=(4.0, (at - over - y) * height_pt / (high - low)),
            textcoords="offset points", fontsize=_NAME_PT, color=colour, va="center",
            annotation_clip=False, zorder=5.0,
            bbox={"facecolor": "white", "alpha": 0.65, "edgecolor": "none", "pad": 0.4},
        )  # fmt: skip


def draw_lines(axes: Any, targets: Sequence[FloatArray], own: FloatArray | None = None) -> None:
    """Draw targets' lines (points, 2), or density if very many, and the thicker ownship line."""
    from matplotlib.collections import LineCollection

    if dense := len(targets) >= DENSE:
        draw_line_density(axes, targets)
    lines = (
        [] if dense else [(line, TARGET, 0.6 if len(targets) >= MANY else 1.0) for line in targets]
    )
    lines += [] if own is None else [(own, OWN, 2.0)]
    if lines:
        points, colours, widths = zip(*lines, strict=True)
        drawn = LineCollection(points, colors=colours, linewidths=widths, zorder=1.0)
        axes.add_collection(drawn, autolim=False)


def targets_legend_entry(dense: bool) -> Any:
    """Return the entry of a legend for lines of targets."""
    from matplotlib.lines import Line2D

    label = "targets (darker: more)" if dense else "target"
    return Line2D(
        [], [], color=TARGET, lw=5.0 if dense else 1.0, solid_capstyle="butt", label=label
    )


def set_time_axis(axes: Any, start_s: float, end_s: float, what: str) -> None:
    """Set the x axis to time in s from start to end, label the y axis, and draw a grid."""
    axes.set_xlim(start_s, max(end_s, start_s + 1e-9))
    axes.set(xlabel="time (s)", ylabel=what)
    add_grid(axes)


def add_grid(axes: Any) -> None:
    """Draw a grid behind the curves."""
    axes.grid(color="#DDDDDD", linewidth=0.5)
    axes.set_axisbelow(True)


def draw_line_density(axes: Any, lines: Sequence[FloatArray]) -> None:
    """Draw how many lines (points, 2) cross each cell of the axes as a shade of grey."""
    from matplotlib.colors import LogNorm

    x, y = axes.get_xlim(), axes.get_ylim()
    edges = [np.linspace(low, high, n + 1) for (low, high), n in zip((x, y), _CELLS, strict=True)]
    count = np.zeros(_CELLS)
    for line in lines:
        # So close that a line leaves out no cell that it crosses in its length.
        at = np.linspace(0.0, len(line) - 1.0, 8 * max(_CELLS))
        across, up = (np.interp(at, np.arange(len(line)), line[:, k]) for k in (0, 1))
        count += np.histogram2d(across, up, bins=edges)[0] > 0
    axes.pcolormesh(
        *edges, np.where(count > 0, count, np.nan).T, cmap="Greys", zorder=0.5,
        norm=LogNorm(0.3, max(2.0, float(count.max())) * 2.0),
    )  # fmt: skip
    axes.set(xlim=x, ylim=y)


class Labels:
    """Puts each label beside its point on axes, where there is room.

    Limits are (low, high), `unit_per_px` the scale of both axes, and obstacles (points, 2) places
    that are better left free, in units of the axes.
    """

    def __init__(
        self,
        axes: Any,
        x: tuple[float, float],
        y: tuple[float, float],
        unit_per_px: float,
        obstacles: FloatArray,
    ) -> None:
        self._axes = axes
        self._x = x
        self._y = y
        self._unit_per_px = unit_per_px
        self._taken: list[Box] = []
        cells = np.floor((obstacles - (x[0], y[0])) / (unit_per_px * _CELL_PX))
        # One number per cell: sorting rows is ten times slower. Cells out of sight do not matter.
        cells = cells[(cells >= 0).all(axis=1) & (cells < 10_000).all(axis=1)]
        numbers = np.unique(cells[:, 0] * 10_000 + cells[:, 1])
        self._obstacles = (np.column_stack(np.divmod(numbers, 10_000)) + 0.5) * _CELL_PX

    def add(
        self, text: str, x: float, y: float, colour: str = "#000000", weight: str = "normal"
    ) -> None:
        """Write `text` beside the point (x, y), in the first free place of eight around it."""
        px = (x - self._x[0]) / self._unit_per_px
        py = (y - self._y[0]) / self._unit_per_px
        width, height = len(text) * _LETTER_PX, _LINE_PX
        right = (self._x[1] - self._x[0]) / self._unit_per_px
        top = (self._y[1] - self._y[0]) / self._unit_per_px
        best: tuple[float, Box] | None = None
        for distance in (1.0, 2.5, 4.5):
            gap = _GAP_PX * distance
            for left, bottom in (
                (px + gap, py - height / 2),
                (px - gap - width, py - height / 2),
                (px + gap, py + gap / 2),
                (px + gap, py - gap / 2 - height),
                (px - gap - width, py + gap / 2),
                (px - gap - width, py - gap / 2 - height),
                (px - width / 2, py + gap),
                (px - width / 2, py - gap - height),
            ):
                box = (left, bottom, left + width, bottom + height)
                cost = sum(_overlap_area(box, other) for other in self._taken)
                cost += 2 * (width * height - _overlap_area(box, (0.0, 0.0, right, top)))
                # A free place must not seem taken by the rounding of its corners.
                cost = round(cost + self._covered_area(box), 6)
                if best is None or cost < best[0]:
                    best = (cost, box)
            if best is not None and best[0] == 0:
                break
        assert best is not None
        box = best[1]
        self._taken.append(box)
        self._axes.text(
            self._x[0] + box[0] * self._unit_per_px,
            self._y[0] + (box[1] + box[3]) / 2 * self._unit_per_px,
            text, fontsize=FONT_SIZE, color=colour, weight=weight, va="center", clip_on=True,
            bbox={"facecolor": "white", "alpha": 0.65, "edgecolor": "none", "pad": 0.8}, zorder=4.0,
        )  # fmt: skip

    def _covered_area(self, box: Box) -> float:
        """Return roughly the area, square pixels, of obstacles that a box would cover."""
        x, y = self._obstacles.T
        inside = (x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])
        return 0.5 * _CELL_PX**2 * int(np.count_nonzero(inside))


def _overlap_area(one: Box, other: Box) -> float:
    """Return the area that two boxes share."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, wide) * max(0.0, high)
