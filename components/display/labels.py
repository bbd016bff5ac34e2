"""Names on a map that do not cover each other."""

from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray

FONT_SIZE = 8
_LINE_PX = FONT_SIZE * 1.9
_LETTER_PX = FONT_SIZE * 0.95
_GAP_PX = 8.0
_CELL_PX = 6.0

Box = tuple[float, float, float, float]


class Labels:
    """Puts each label beside its point, where there is room.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    x, y : (low, high)
        Limits of the axes.
    unit_per_px : float
        Scale of both axes.
    obstacles : (points, 2)
        Places that are better left free, in units of the axes.
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
                cost = sum(_overlap(box, other) for other in self._taken)
                cost += 2 * (width * height - _overlap(box, (0.0, 0.0, right, top)))
                # A free place must not seem taken by the rounding of its corners.
                cost = round(cost + self._covered(box), 6)
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

    def _covered(self, box: Box) -> float:
        """Return about the area of the obstacles that a box would cover."""
        x, y = self._obstacles.T
        inside = (x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])
        return 0.5 * _CELL_PX**2 * int(np.count_nonzero(inside))


def _overlap(one: Box, other: Box) -> float:
    """Return the area that two boxes share."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, wide) * max(0.0, high)
