"""Tables on a narrow terminal keep their column names and all that stands in them."""

import io
import re

import pytest

from dsa_des.terminal.safe_console import SafeConsole
from dsa_des.terminal.tables import fold, print_table

HEADINGS = ["radar.scan_rate_hz", "wires[4].drop_probability", "result", "mean or share",
            "95 % interval", "replicas", "without"]  # fmt: skip
ROWS = [
    ["0.5", "0.1", "first_detection_range_m.radar", "11787", "11535 to 12040 *", "4", ""],
    ["2", "0.1", "first_detection_range_m.radar", "11874", "-11765.5 to -0.25 *", "4", "1"],
    ["0.5", "0.1", "declaration_delay_s.any", "4", "3 to 5", "60", ""],
]


def printed(width: int, headings: list[str], rows: list[list[str]], group: int | None = 2) -> str:
    out = io.StringIO()
    print_table(SafeConsole(file=out, width=width), "A study", headings, rows, group=group)
    return out.getvalue()


@pytest.mark.parametrize("width", [160, 100, 80, 60, 40, 24])
def test_no_line_is_wider_and_nothing_is_lost(width: int) -> None:
    text = printed(width, HEADINGS, ROWS)
    assert max(map(len, text.splitlines())) <= width
    squeezed = re.sub(r"\s", "", text)
    assert "…" not in text
    for cell in {cell for row in ROWS for cell in row}:
        assert width < 80 or re.sub(r"\s", "", cell) in squeezed, cell


def test_at_80_columns_headings_are_folded_between_words_and_numbers_never() -> None:
    lines = printed(80, HEADINGS, ROWS).splitlines()
    assert any("11535 to 12040 *" in line and line.startswith("0.5") for line in lines)
    assert any("-11765.5 to -0.25 *" in line for line in lines)
    head = " ".join(" ".join(lines[3:6]).split())
    assert "drop_" in head and "probability" in head and "replicas" in head
    assert not any(re.fullmatch(r"\s*\w\s*", line) for line in lines)


def test_results_become_lines_above_their_rows_only_where_the_table_is_too_wide() -> None:
    assert "first_detection_range_m.radar" in printed(160, HEADINGS, ROWS).splitlines()[2]
    assert "first_detection_range_m.radar" in printed(80, HEADINGS, ROWS).splitlines()


def test_a_table_of_too_many_columns_becomes_lists() -> None:
    headings = [f"blocks.block_{k}.scan_rate_hz" for k in range(12)]
    text = printed(60, headings, [[str(k) for k in range(12)]] * 2, None)
    assert text.count("blocks.block_7.scan_rate_hz: 7\n") == 2


def test_a_column_without_any_value_is_left_out() -> None:
    rows = [[*row[:-1], ""] for row in ROWS]
    assert "without" not in printed(160, HEADINGS, rows)
    assert "without" in printed(160, HEADINGS, ROWS)


def test_a_long_word_is_cut_into_lines_and_a_short_one_stays() -> None:
    assert fold("abcdefghij", 4) == ["abcd", "efgh", "ij"]
    assert fold("first_detection", 9) == ["first_", "detection"]
    assert fold("-1.25 to 3.5 *", 8) == ["-1.25 to", "3.5 *"]
    assert fold("飛行機飛行機", 5) == ["飛行", "機飛", "行機"]


def test_what_names_a_row_is_cut_last() -> None:
    out = io.StringIO()
    rows = [["great_circle (scene)", "0.0523 ± 0.02", "1.23e-05", "2.34e-05"]]
    console = SafeConsole(file=out, width=40)
    print_table(console, "rungs", ["rung", "us", "mean", "p95"], rows, right=[1, 2, 3])
    assert [line[:12].rstrip() for line in out.getvalue().splitlines()] == [
        "rungs", "rung", "great_circle", "(scene)",
    ]  # fmt: skip


def test_remarks_stand_below_their_rows_where_there_is_no_room_beside_them() -> None:
    out = io.StringIO()
    rows = [["exact", "1.5", "nothing is cheaper " * 3], ["table", "22.25", ""]]
    console = SafeConsole(file=out, width=40)
    print_table(console, "rungs", ["rung", "cost", "remark"], rows, below=2, right=[1])
    assert out.getvalue().splitlines() == [
        "rungs", "rung    cost", "exact    1.5", "    nothing is cheaper nothing is",
        "    cheaper nothing is cheaper", "table  22.25",
    ]  # fmt: skip
