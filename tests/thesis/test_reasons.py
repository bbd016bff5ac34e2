"""What is allowed for, and what follows from a printed value, is said in the row itself."""

import pytest

from components.thesis.rows import Row


def half_a_digit(row: Row) -> float:
    return 0.5 * 10.0 ** -len((row.printed or "").partition(".")[2])


@pytest.mark.parametrize("item", ["eq-34", "table-4.4", "table-4.2", "fig-4.14", "sec-4.1.3"])
def test_more_than_the_last_digit_is_said(results, item) -> None:
    for row in results[item].rows:
        if row.is_within_tolerance and abs(row.difference or 0.0) > half_a_digit(row):
            assert "allow" in row.source_text, row.quantity


def test_a_climb_that_follows_from_a_cell_says_so(results) -> None:
    rows = {row.quantity: row for row in results["table-4.4"].rows}
    for name in ("King Air", "Convair"):
        why = rows[f"Ascending head-on, {name}, thesis's eq. 9-13"].why
        assert "follows from the Convair's cell" in why and "cuts" not in why
