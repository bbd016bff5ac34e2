"""The figure and the table of `dsa-des cost`: every rung's name and cost can be read."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.costs.climb import Comparison, RungCost
from dsa_des.costs.cost_report import (
    _cost_cells,
    draw_error_against_cost,
    place_labels_without_overlap,
)
from dsa_des.costs.replay import Spread
from dsa_des.record.drawing import collect_drawn_figures


def test_labels_cover_neither_each_other_nor_a_point():
    figure = Figure(figsize=(4.3, 3.5), dpi=110)
    renderer = FigureCanvasAgg(figure).get_renderer()
    axes = figure.add_axes((0.15, 0.15, 0.8, 0.8))
    axes.set(xscale="log", yscale="log", xlim=(0.05, 1e4), ylim=(1e-2, 2e2))
    points = {
        "range_boundary": (0.15, 26.0), "projection": (0.19, 51.0), "thesis": (0.26, 33.0),
        "exact (scene)": (0.36, 20.0), "sampled_table": (0.62, 0.36), "mesh": (700.0, 0.6),
        "union: 5e-15 m²": (0.62, 0.03), "window": (0.62, 0.37), "far right of all": (8e3, 1.0),
    }  # fmt: skip
    place_labels_without_overlap(
        axes, [(name, at, 0.1 * at[0], "black") for name, at in points.items()]
    )
    boxes = {text.get_text(): text.get_window_extent(renderer) for text in axes.texts}
    assert boxes.keys() == points.keys()
    for one, other in combinations(boxes, 2):
        assert not boxes[one].overlaps(boxes[other]), (one, other)
    for place in axes.transData.transform(np.array(list(points.values()))):
        assert not [name for name, box in boxes.items() if box.contains(*place)]
    for name, box in boxes.items():
        assert axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1, name


def _costs(block: str) -> list[RungCost]:
    rungs = (Rung("crude", "less"), Rung("exact", "more"))
    errors = Quantity("detection_probability", "Pd")
    ladder = Ladder("detection", rungs, "exact", (errors,), lambda *_: {})
    return [
        RungCost(block, ladder, rung.name, "exact", cpu_us_per_target_scan=place + 1.0,
                 cpu_spread_us=0.1, errors={"detection_probability": Spread(0.1, 0.2, 0.3, 9)})
        for place, rung in enumerate(rungs)
    ]  # fmt: skip


@pytest.mark.parametrize("panels", [1, 2])
def test_the_title_is_whole_and_off_the_panels(panels, tmp_path):
    costs = [cost for panel in range(panels) for cost in _costs(f"block_{panel}")]
    with collect_drawn_figures() as kept:
        draw_error_against_cost(tmp_path / "cost.png", "A lookout who sees another aircraft", costs)
    figure = kept["cost"]
    renderer = FigureCanvasAgg(figure).get_renderer()
    box = figure._suptitle.get_window_extent(renderer)
    assert box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
    for axes in figure.axes:
        assert not box.overlaps(axes.title.get_window_extent(renderer))


def test_large_numbers_of_the_table_have_no_power_of_ten():
    cost = _costs("tracker")[0]
    cost.cpu_us_per_target_scan, cost.cpu_spread_us = 1236.4, 12.3
    cost.errors = {"detection_probability": Spread(2e-12, 999.7, 3e4, 9)}
    assert _cost_cells(cost, Comparison([]))[1:5] == ["1,240 ± 10", "2e-12", "1,000", "30,000"]
    cost.cpu_us_per_target_scan, cost.cpu_spread_us = 0.8644, 0.074
    assert _cost_cells(cost, Comparison([]))[1] == "0.864 ± 0.07"
