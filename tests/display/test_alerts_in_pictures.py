"""Pictures of a run show its alerts, by level, and where the ownship was told to manoeuvre."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

from components.display.alerted import (
    Alerted,
    alert_colour_and_width,
    draw_alerted_lines,
    draw_manoeuvres,
)

ROWS = [  # time, block, target, level
    (0.0, "one", "a", 0), (0.0, "one", "b", 1), (1.0, "one", "a", 2), (1.0, "two", "a", 1),
    (1.0, "one", "b", 1), (2.0, "one", "a", 2), (2.0, "one", "b", 0), (3.0, "one", "a", 3),
    (4.0, "one", "a", 0), (4.0, "one", None, 3), (5.0, "one", "a", 1),
]  # fmt: skip


@pytest.fixture
def alerted(tmp_path):
    time_s, block, target, level = map(list, zip(*ROWS, strict=True))
    columns = {"time_s": time_s, "block": block, "target": target, "level": level}
    pq.write_table(pa.table(columns), tmp_path / "alerts.parquet")
    pq.write_table(pa.table({"time_s": [2.5, 2.5, 4.0]}), tmp_path / "manoeuvres.parquet")
    return Alerted.read(tmp_path)


def test_an_alert_lasts_until_the_alerting_looks_again(alerted):
    """Of two blocks the higher level counts; what belongs to no target is drawn nowhere."""
    assert alerted.stretches == {
        "a": [(2, 1.0, 3.0), (3, 3.0, 4.0), (1, 5.0, 6.0)], "b": [(1, 0.0, 2.0)],
    }  # fmt: skip
    assert alerted.manoeuvres_s.tolist() == [2.5, 4.0] and alerted.levels == [1, 2, 3]
    assert [line.get_label() for line in alerted.legend_entries()] == [
        "alert 1", "alert 2", "alert 3", "manoeuvre",
    ]  # fmt: skip


def test_an_alert_goes_on_while_another_block_looks(tmp_path):
    """Two that look in turn, half a second apart, of which each knows one target."""
    rows = [(t + late, name, of, 2) for t in (0.0, 1.0, 2.0)
            for late, name, of in ((0.0, "one", "a"), (0.5, "two", "b"))]  # fmt: skip
    time_s, block, target, level = map(list, zip(*rows, strict=True))
    columns = {"time_s": time_s, "block": block, "target": target, "level": level}
    pq.write_table(pa.table(columns), tmp_path / "alerts.parquet")
    found = Alerted.read(tmp_path).stretches
    assert found == {"a": [(2, 0.0, 3.0)], "b": [(2, 0.5, 3.5)]}


def test_lines_are_thicker_where_there_is_an_alert(alerted):
    axes = Figure().add_subplot()
    time_s = np.array([0.0, 2.0, 10.0])
    draw_alerted_lines(axes, alerted, {"a": (time_s, 10.0 * time_s, 5.0 - time_s)})
    (drawn,) = axes.collections
    ends = [(line[0].tolist(), line[-1].tolist()) for line in drawn.get_segments()]
    assert ends == [
        ([10.0, 4.0], [30.0, 2.0]), ([30.0, 2.0], [40.0, 1.0]), ([50.0, 0.0], [60.0, -1.0]),
    ]  # fmt: skip
    assert list(drawn.get_linewidths()) == [alert_colour_and_width(level)[1] for level in (2, 3, 1)]
    assert alert_colour_and_width(1)[1] < alert_colour_and_width(2)[1] < alert_colour_and_width(3)[
        1
    ] and alert_colour_and_width(4) == alert_colour_and_width(3)
    draw_manoeuvres(axes, np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    (marks,) = axes.lines
    assert marks.get_xydata().tolist() == [[1.0, 3.0], [2.0, 4.0]]


def test_a_run_without_alerts_has_none(tmp_path):
    none = Alerted.read(tmp_path)
    assert none.stretches == {} and len(none.manoeuvres_s) == 0 and none.legend_entries() == []
