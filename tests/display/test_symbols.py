"""Symbols: colours of kinds, marks that are left out, and labels in the first free place."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from components.display import symbols as module
from components.display.symbols import (
    OWN,
    TARGET,
    Labels,
    draw_line_density,
    draw_lines,
    rows_by_target,
    sensor_marks,
    spread_indices,
    staggered_mark_indices,
    targets_legend_entry,
)
from components.fusion.gated import Gated
from components.optical.sensors import ElectroOptical, Infrared, Projection
from components.radar.radar import RangeBoundary
from components.radar.swerling import SwerlingRadar
from components.sensor import palette
from components.tracking.stub import TrackerStub
from dsa_des.block.component import Component
from dsa_des.block.mark import NEUTRAL, plot_mark_by_name

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


def test_marks_keep_their_distance_and_the_first_one():
    along = np.linspace(0.0, 100.0, 1001)
    kept = staggered_mark_indices(along, 10.0, 0.0)
    assert kept[0] == 0
    assert np.allclose(np.diff(along[kept]), 10.0)


def test_two_sensors_take_turns():
    along = np.linspace(0.0, 100.0, 1001)
    one, other = (along[staggered_mark_indices(along, 10.0, phase)[1:]] for phase in (0.0, 0.5))
    assert np.abs(one[:, None] - other).min() >= 4.9


def test_gaps_stay_gaps_and_unknown_places_are_left_out():
    along = np.array([np.nan, 0.0, 1.0, 80.0, 81.0, np.nan])
    assert staggered_mark_indices(along, 10.0, 0.0).tolist() == [1, 3]
    assert staggered_mark_indices(np.full(3, np.nan), 10.0, 0.0).tolist() == []
    assert staggered_mark_indices(np.zeros(5), 10.0, 0.3).tolist() == [0]


def test_evenly_keeps_both_ends():
    assert spread_indices(3, 5).tolist() == [0, 1, 2]
    kept = spread_indices(1000, 7)
    assert (kept[0], kept[-1], len(kept)) == (0, 999, 7)


def test_rows_by_target():
    groups = rows_by_target(np.array([2, 0, 2, 5, 0]))
    assert [(target, rows.tolist()) for target, rows in groups] == [
        (0, [1, 4]),
        (2, [0, 2]),
        (5, [3]),
    ]
    assert rows_by_target(np.empty(0, dtype=np.int64)) == []


KINDS = [palette.RADAR, palette.EO, palette.IR, palette.FUSION, palette.TRACKER]


def test_every_block_of_a_kind_has_the_colour_of_its_kind() -> None:
    for cls, kind in ((SwerlingRadar, palette.RADAR), (RangeBoundary, palette.RADAR),
                      (ElectroOptical, palette.EO), (Projection, palette.EO), (Infrared,
                      palette.IR),
                      (Gated, palette.FUSION), (TrackerStub, palette.TRACKER)):  # fmt: skip
        for names in (["a", "b", "z"], ["z"]):
            classes: dict[str, type | None] = dict.fromkeys(names, Component) | {"z": cls}
            assert plot_mark_by_name(classes)["z"] == kind, cls


def test_two_of_a_kind_share_the_colour_and_not_the_marker() -> None:
    found = plot_mark_by_name({"front": SwerlingRadar, "aft": RangeBoundary})
    assert found["front"].colour == found["aft"].colour == palette.RADAR.colour
    assert found["front"].marker != found["aft"].marker


def test_a_block_that_says_nothing_is_neutral_and_a_missing_one_too() -> None:
    found = sensor_marks(["gone", "mine"], {"mine": object()})
    assert list(found.values()) == list(NEUTRAL[:2])


def test_no_two_colours_are_close_to_eyes_without_red_or_green() -> None:
    """Distances in what is left when red and green are one (Vienot, Brettel and Mollon 1999)."""
    to_lms = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714],
                       [0.0299566, 0.184309, 1.46709]])  # fmt: skip
    for blind in ([[0, 2.02344, -2.52581], [0, 1, 0], [0, 0, 1]],
                  [[1, 0, 0], [0.494207, 0, 1.24827], [0, 0, 1]]):  # fmt: skip
        seen = {}
        for mark in KINDS:
            rgb = np.array([int(mark.colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
            linear = rgb**2.2
            left = np.linalg.inv(to_lms) @ np.array(blind) @ to_lms @ linear
            seen[mark.colour] = np.clip(left, 0, 1) ** (1 / 2.2)
        for one, other in combinations(seen, 2):
            assert np.linalg.norm(seen[one] - seen[other]) > 0.1, (one, other)


def test_density_counts_each_line_once_in_every_cell_that_it_crosses():
    axes = Figure().subplots()
    axes.set(xlim=(0.0, 160.0), ylim=(0.0, 100.0))
    level = np.array([[0.0, 10.5], [160.0, 10.5]])
    gap = np.array([[0.0, 20.5], [np.nan, np.nan], [160.0, 20.5]])
    draw_line_density(axes, [level, level, gap, np.array([[5.5, 30.5]])])
    cells = np.ma.filled(axes.collections[0].get_array().reshape(100, 160), 0.0)
    assert (cells[10] == 2.0).all()
    assert cells[20, 80] == 0.0 and cells[30, 5] == 1.0
    assert cells.sum() == 2 * 160 + cells[20].sum() + 1
    assert axes.get_xlim() == (0.0, 160.0) and axes.get_ylim() == (0.0, 100.0)


@pytest.mark.parametrize(("targets", "wide"), [(0, 1.0), (2, 1.0), (module.MANY, 0.6)])
def test_the_ownship_s_line_is_drawn_over_those_of_targets_if_there_is_one(targets, wide):
    lines = [np.array([[0.0, k], [1.0, k]]) for k in range(targets)]
    own = np.array([[0.0, 0.5], [9.0, 0.5]])
    axes = Figure().add_subplot()
    draw_lines(axes, lines, own)
    (drawn,) = axes.collections
    assert [part.tolist() for part in drawn.get_segments()] == [p.tolist() for p in [*lines, own]]
    assert drawn.get_linewidths() == [wide] * targets + [2.0]
    assert drawn.get_colors() == pytest.approx(
        np.array([to_rgba(TARGET)] * targets + [to_rgba(OWN)])
    )
    draw_lines(axes, lines)
    assert [len(one.get_segments()) for one in axes.collections[1:]] == [targets] * (targets > 0)


def test_the_key_of_targets_says_what_is_dense():
    dense, thin = targets_legend_entry(True), targets_legend_entry(False)
    assert (dense.get_label(), dense.get_linewidth()) == ("targets (darker: more)", 5.0)
    assert (thin.get_label(), thin.get_linewidth()) == ("target", 1.0)
    assert dense.get_color() == thin.get_color() == TARGET
