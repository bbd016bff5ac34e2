"""`dsa-des reproduce`: choosing items, output, exit codes, and the page in docs."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from components.thesis.reproduce import (
    four_digit_text,
    letters_of_repeated_texts,
    markdown_table_row,
)
from components.thesis.rows import Made, Row, predicted
from components.thesis.table import ITEMS, Item, select_items
from dsa_des.cli import main
from dsa_des.errors import UsageError
from dsa_des.scene.scene import load_scene

ROOT = Path(__file__).parents[2]
FRAGMENTS = ("one_radar", "base", "two_intruders")
SCENES = sorted(
    path
    for folder in ("thesis", "systems")
    for path in (ROOT / "configs" / folder).glob("*.toml")
    if path.stem not in FRAGMENTS
)
KEYS = ["item", "quantity", "printed", "derived", "ours", "unit", "difference", "verdict",
        "because", "from", "inputs"]  # fmt: skip


def call(*arguments):
    return CliRunner().invoke(
        main, ["reproduce", *(str(a) for a in arguments)], catch_exceptions=False
    )


def test_json_rows_figures_and_data(tmp_path):
    out = tmp_path / "new" / "out"
    result = call("fig-3.11", "4.22", "--json", "--out", out)
    assert result.exit_code == 0
    rows = json.loads(result.stdout)
    assert [list(row) for row in rows] == [KEYS] * len(rows)
    assert {row["item"] for row in rows} == {"fig-3.11", "fig-4.22"}
    first = rows[0]
    assert (first["printed"], first["ours"], first["difference"]) == (1.0, 1.0, 0.0)
    assert (first["verdict"], first["inputs"]) == ("configured", "silhouettes:BACK_M2")
    silent = next(row for row in rows if row["verdict"] == "no value printed")
    assert silent["printed"] is None and silent["difference"] is None
    assert json.loads((out / "run.json").read_text(encoding="utf-8"))["rows"] == rows
    for name in ("fig_3_11", "fig_4_22"):
        assert (out / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (out / "data" / f"{name}.csv").read_text(encoding="utf-8").count("\n") > 10
    page = (out / "thesis.md").read_text(encoding="utf-8")
    assert "](figures/fig_3_11.png)" in page


def test_table_on_the_terminal_and_replacing_an_earlier_run(tmp_path):
    out = tmp_path / "out"
    for _ in range(2):
        result = call("table-4.1", "--out", out)
        assert result.exit_code == 0
    assert "7 rows: 0 predicted, 0 calibrated, 7 configured, 0 differs because" in result.stdout
    assert "of 0 printed numbers that are predicted, 0 agree" in result.stdout
    assert (out / "rows.csv").read_text(encoding="utf-8").startswith(",".join(KEYS))


def test_unknown_items_are_all_named(tmp_path):
    result = call("fig-4.99", "tabel-4.4", "fig-4.14", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "ITEM 'fig-4.99': there is no such item; did you mean 'fig-4.9'?" in result.stderr
    assert "ITEM 'tabel-4.4': there is no such item; did you mean 'table-4.4'?" in result.stderr
    assert "Traceback" not in result.stderr and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "spelling", ["fig-4.14", "Fig. 4.14", "figure 4.14", "FIG_4_14", "4.14", "fig4.14"]
)
def test_spellings_of_one_item(spelling):
    assert [item.name for item in select_items([spelling])] == ["fig-4.14"]


def test_an_item_may_cover_several_equations():
    assert [item.name for item in select_items(["eq. 33", "eq-33-34"])] == ["eq-34"]


def test_items_come_in_the_order_of_the_thesis_and_once():
    assert [item.name for item in select_items(["fig-4.5", "fig-4.3", "Fig. 4.5"])] == [
        "fig-4.3",
        "fig-4.5",
    ]
    assert select_items([]) == list(ITEMS)
    with pytest.raises(UsageError, match=r"there are several; say fig-4.3 or table-4.3"):
        select_items(["4.3"])  # a figure and a table have this number


def test_wrong_calls_leave_nothing_behind(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep me", encoding="utf-8")
    result = call("fig-3.11", "--out", tmp_path / "mine")
    assert result.exit_code == 2 and "holds something other than a run" in result.stderr
    result = call("fig-3.11", "--page", tmp_path / "page.md", "--out", tmp_path / "out")
    assert result.exit_code == 2 and "--page shows all items" in result.stderr
    result = call("--page", tmp_path / "no" / "page.md", "--out", tmp_path / "out")
    assert result.exit_code == 2 and "there is no folder" in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine"]


def test_a_row_that_cannot_be_computed_is_exit_code_1(tmp_path, monkeypatch):
    def broken(self):
        if self.name == "fig-3.11":
            raise ValueError("no such luck")
        one = Row("one", 1.0, "", "So.", "1", basis=predicted("a test"))
        return Made([Row("a number", math.nan, "km", "A test."), one])

    monkeypatch.setattr(Item, "make", broken)
    result = call("fig-3.11", "eq-34", "--json", "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "error: fig-3.11 could not be computed: no such luck" in result.stderr
    assert "error: eq-34 could not be computed: a number is nan" in result.stderr
    rows = json.loads(result.stdout)
    assert [row["ours"] for row in rows] == [None, 1.0]


def test_short_numbers():
    assert [four_digit_text(x) for x in (0.91164, 120456.0, 1e-12, 3.0)] == [
        "0.9116",
        "120456",
        "1e-12",
        "3",
    ]
    assert four_digit_text(0.5, sign=True) == "+0.5"


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_scene_loads(scene):
    loaded = load_scene(scene)
    assert loaded.title and loaded.description and loaded.duration_s


def test_page_holds_every_row_with_its_verdict(results):
    """docs/thesis.md is what the command writes; times of a run are not compared."""
    page = (ROOT / "docs" / "thesis.md").read_text(encoding="utf-8")
    for made in results.values():
        said = letters_of_repeated_texts(made.rows)
        assert all(f"{letter} {text}" in page for text, letter in said.items())
        for row in made.rows:
            if row.unit in ("s", "1/s"):
                continue
            known = markdown_table_row(row, any(one.derived for one in made.rows), said)
            # The last bits of errors near 0 are the machine's.
            assert (known if abs(row.ours) > 1e-6 else f"| {row.quantity} |") in page
        for picture in made.pictures:
            assert f"](images/thesis/{picture.name}.png)" in page
            assert (ROOT / "docs" / "images" / "thesis" / f"{picture.name}.png").is_file()


def test_help_does_not_import_the_simulator():
    code = (
        "import sys; from components.thesis.command import reproduce; "
        "print([m for m in ('numpy', 'scipy', 'matplotlib', 'simpy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
