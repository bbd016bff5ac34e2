"""The tables of docs/performance.md are made of the rows of one measurement."""

from pathlib import Path

import pytest

from components.benchmark.pairs import PAIRS
from components.benchmark.rates import RATES
from components.benchmark.scenes import CASES
from docs.make import performance as made
from docs.make.performance_queues import VARIANTS

PAGE = Path(__file__).parents[3] / "docs" / "performance.md"


def measured(monkeypatch):
    """Rows as `measured` gathers them, where each process gives numbers of its own."""
    asked = []

    def fresh(*arguments):
        asked.append(arguments)
        k = float(len(asked))
        calls = {key: {"p50": 10 * k, "p99": 20 * k} for key in ("wall_us", "undisturbed_us",
                                                                "fixed_us")}  # fmt: skip
        return {
            "target_scans_per_s": k * 1e6, "ratio_to_yardstick": k + 0.25, "build_s": k / 100,
            "cpu_s": k / 8, "peak_memory_mb": 100 * k, "parquet_adds": k / 100, "times": k / 16,
            "times_quartiles": [k, k + 1], "per_s": 1000 * k, "wanted": 500.0,
            "beside": {"a plain loop": 250.0 * k}, "simulated_s_per_s": 6000.0 / k, **calls,
        }  # fmt: skip

    monkeypatch.setattr(made, "measure_in_new_process", fresh)
    monkeypatch.setattr(
        made.performance_queues, "measure_in_new_process", lambda *of: fresh("queues", *of)
    )
    return made.measured(3, quick=False), asked


def block(page, name):
    return page.split(f"<!-- {name} -->\n")[1].split(f"\n<!-- end of {name} -->")[0].splitlines()


def test_every_table_has_a_row_of_each_thing_that_was_measured(monkeypatch):
    rows, asked = measured(monkeypatch)
    things = [("scenes", CASES), ("pairs", PAIRS), ("rates", RATES), ("queues", VARIANTS)]
    wanted = [(kind, item.name, False, 3) for kind, items in things for item in items]
    assert asked == [*wanted, ("calls", "embed", False, 3)]
    page = made.filled(PAGE.read_text(encoding="utf-8"), rows)
    assert f"at commit {rows['commit']} on {rows['date']}" in block(page, "measured")[0]
    scenes = block(page, "scenes")[2:]
    assert [line.split("`")[1] for line in scenes] == [case.name for case in CASES]
    # The seventh thing that was measured.
    assert [cell.strip() for cell in scenes[6].split("|")[2:-1]] == [
        "7 M", "7.2", "10", "0.07 s", "0.875 s", "700 MB", "7 %"
    ]  # fmt: skip
    assert "| 0.562 | 9.000 to 10.000 |" in block(page, "pairs")[3]
    assert "| 13,000 | 500 |" in block(page, "rates")[3]
    assert "| 14,000 | 3,500 (4 times) |  |" in block(page, "track updates")[2]
    assert "| 0.06 ms | 2 ms |" in block(page, "encounters")[2]
    assert "| 214 | 1.3 |" in block(page, "queues")[-1]
    assert block(page, "calls")[2] == "| wall time of a call | 0.29 | 0.58 |"
    assert made.filled(page, rows) == page


def test_a_table_that_the_page_lacks_is_said(monkeypatch):
    rows, _ = measured(monkeypatch)
    page = PAGE.read_text(encoding="utf-8").replace("<!-- queues -->", "")
    with pytest.raises(ValueError, match="0 tables 'queues'"):
        made.filled(page, rows)
