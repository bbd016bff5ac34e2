"""Labels stand in the first free of the places around their points."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from components.display import symbols as module
from components.display.symbols import Labels

LETTER, LINE, GAP, CELL = module._LETTER_PX, module._LINE_PX, module._GAP_PX, module._CELL_PX
UNIT = 0.01  # per pixel, on a map of 800 by 600 pixels
X, Y = (-3.0, 5.0), (10.0, 16.0)


def boxes(text, x, y):
    """The places in pixels, in the order in which they are tried."""
    px, py = (x - X[0]) / UNIT, (y - Y[0]) / UNIT
    wide, high = len(text) * LETTER, LINE
    for gap in (GAP, 2.5 * GAP, 4.5 * GAP):
        right, left, middle = px + gap, px - gap - wide, px - wide / 2
        above, below = py + gap / 2, py - gap / 2 - high
        yield from ((a, b, a + wide, b + high) for a, b in (
            (right, py - high / 2), (left, py - high / 2), (right, above), (right, below),
            (left, above), (left, below), (middle, py + gap), (middle, py - gap - high),
        ))  # fmt: skip


def placed(points, obstacles):
    """Where texts were written: left edges and middles, in pixels."""
    axes = Figure().add_subplot()
    labels = Labels(axes, X, Y, UNIT, np.array(obstacles, dtype=float).reshape(-1, 2))
    for text, x, y in points:
        labels.add(text, x, y)
    return [
        ((one.get_position()[0] - X[0]) / UNIT, (one.get_position()[1] - Y[0]) / UNIT)
        for one in axes.texts
    ]


def in_the_way(box):
    """An obstacle in the middle of a place, on the map."""
    column, row = np.floor([(box[0] + box[2]) / 2 / CELL, (box[1] + box[3]) / 2 / CELL])
    return X[0] + (column + 0.5) * CELL * UNIT, Y[0] + (row + 0.5) * CELL * UNIT


@pytest.mark.parametrize("number", range(24))
def test_the_first_free_place_is_taken(number):
    places = list(boxes("a name", 1.0, 13.0))
    blocked = [in_the_way(box) for box in places[:number]]
    inside = [
        all(
            not (box[0] < (x - X[0]) / UNIT < box[2] and box[1] < (y - Y[0]) / UNIT < box[3])
            for x, y in blocked
        )
        for box in places
    ]
    wanted = places[inside.index(True)] if any(inside) else places[0]
    ((left, middle),) = placed([("a name", 1.0, 13.0)], blocked)
    assert (left, middle) == pytest.approx((wanted[0], (wanted[1] + wanted[3]) / 2))


def test_nothing_is_written_across_the_edge_or_over_another():
    for x, y, place in ((4.9, 13.0, 1), (1.0, 15.99, 3), (1.0, 10.01, 2), (-2.95, 13.0, 0),
                        (4.9, 15.99, 5), (4.9, 10.01, 4)):  # fmt: skip
        box = list(boxes("a name", x, y))[place]
        ((left, middle),) = placed([("a name", x, y)], [])
        assert (left, middle) == pytest.approx((box[0], (box[1] + box[3]) / 2))
    points = [("a name", 1.0, 13.0)] * 3
    wanted = [list(boxes("a name", 1.0, 13.0))[place] for place in (0, 1, 6)]
    for (left, middle), box in zip(placed(points, []), wanted, strict=True):
        assert (left, middle) == pytest.approx((box[0], (box[1] + box[3]) / 2))


def test_where_all_is_covered_the_least_covered_place_is_taken():
    places = list(boxes("a name", 1.0, 13.0))
    grid = np.stack(np.meshgrid(np.arange(0, 800, CELL), np.arange(0, 600, CELL)), axis=-1)
    centres = grid.reshape(-1, 2) + 0.5 * CELL
    free = places[11]
    kept = [
        (X[0] + a * UNIT, Y[0] + b * UNIT)
        for a, b in centres
        if not (free[0] + CELL < a < free[2] and free[1] < b < free[3])
    ]
    ((left, middle),) = placed([("a name", 1.0, 13.0)], kept)
    assert (left, middle) == pytest.approx((free[0], (free[1] + free[3]) / 2))
