"""The errors against measured tables, made again where the tables are."""

import os
from pathlib import Path

import pytest

from components.aircraft.aspect_tables import read_silhouette_table
from components.optical.silhouette import visible_area
from components.thesis.scenes import silhouette_area_keywords as areas_of
from components.thesis.silhouette_comparison import AXES, compare_silhouettes
from components.thesis.silhouettes import ERRORS, MEASURED_ON, TABLES

SHARED = Path(os.environ.get("DSA_DES_SHARED", Path(__file__).parents[3] / "shared"))
FOLDER = SHARED / "data" / "projected_area"


@pytest.mark.parametrize("file", TABLES)
def test_the_errors_are_those_of_the_tables(file) -> None:
    path = FOLDER / TABLES[file]
    if not path.is_file():
        pytest.skip(f"{TABLES[file]} of degas-surveillance-jwandrews is not at {FOLDER}")
    table = read_silhouette_table(path)
    areas = areas_of(file)
    found = compare_silhouettes(
        {"thesis": lambda *view: visible_area(*view, **areas, model="thesis")},
        {"table": lambda *view: visible_area(*view, table=table, model="aspect_table")},
    )
    assert [one.axis for one in found] == list(AXES)
    for one in found:
        mean, most = ERRORS[file][one.axis]
        assert one.mean_error == pytest.approx(mean, abs=1e-6)
        assert one.max_error == pytest.approx(most, abs=1e-6)


def test_rows_and_page_say_that_they_are_not_made_again(results) -> None:
    rows = [row for row in results["table-4.3"].rows if "measured table" in row.quantity]
    assert len(rows) == 2 * 3 * 2
    for row in rows:
        assert (
            f"Measured on {MEASURED_ON}" in row.source_text and "not made again" in row.source_text
        )
        assert not row.is_agreeing_prediction and row.again in {
            one.quantity for one in results["table-4.3"].rows
        }
    assert all(file in results["table-4.3"].note for file in TABLES.values())
