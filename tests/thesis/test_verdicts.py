"""The five verdicts: what they are given for, and that a row's inputs are what it says they are."""

import importlib
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from components.thesis import cameras, systems, table
from components.thesis.rows import (
    VERDICTS,
    Printed,
    Row,
    calibrated,
    configured,
    predicted,
    tally_sentence,
)
from components.thesis.scenes import configs, read_thesis_csv
from dsa_des.scene.scene_file import read_scene_file
from tests.thesis.changed_inputs import FACTOR, change, changed, found, rewrite

PAGE = Path(__file__).parents[2] / "docs" / "thesis.md"
ITEMS = {item.name: item for item in table.ITEMS}
#: Item → name → number; empty where the item prints none.
PRINTED = {name: item.printed for name, item in ITEMS.items()}
#: Inputs that calibrated and configured rows of an item name; table-2.4 takes seconds and is made
#: once with all of them.
MOVING = [
    ("fig-3.11", ("silhouettes:BACK_M2",)),
    ("fig-3.11", ("silhouettes:FRONT_M2",)),
    ("sec-4.1.1", ("thesis/sec_4_1_1.toml:blocks.radar.calibrate.range_km",)),
    ("sec-4.1.1", ("radar:NAUTICAL_KM",)),
    ("sec-4.1.1", ("sensors/oasys_specification.toml:calibrate.pd",)),
    ("sec-4.1.1", ("sensors/oasys_specification.toml:calibrate.range_km",)),
    ("sec-4.1.3", ("sensors/oasys.toml:calibrate.pd",)),
    *(("table-4.1", (f"aircraft/{file}.toml:rcs_dbsm",))
      for file in PRINTED["table-4.1"]),
    ("table-4.2", ("thesis/table_4_2.csv:range_km",)),
    ("table-4.2", ("flight_tests:SCANS_IN_A_ROW",)),
    *(("fig-4.13", (f"aircraft/{name}_refined.toml:ir.{key}_m2",))
      for name, key in map(str.split, PRINTED["fig-4.13"])),
    ("table-4.4", ("cameras:CLIMB_DEG", "aircraft/boeing_787.toml:contrast")),
    ("table-4.4", ("aircraft/king_air.toml:contrast", "aircraft/king_air.toml:eo.front_m2")),
    ("table-4.4", ("aircraft/boeing_787.toml:contrast",)),
    ("fig-4.14", ("thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.east_m",
                  "thesis/fig_4_14.toml:blocks.traffic.intruders.overtaking.up_m")),
    *(("fig-4.17", (f"thesis/fig_4_17.toml:blocks.{name}.azimuth_deg",))
      for name in ("radar", "eo", "ir")),
    ("fig-4.19", ("maps:RESOLUTIONS_DEG",)),
    ("fig-4.21", ("thesis/fig_4_21.toml:duration_s",
                  "thesis/fig_4_21.toml:blocks.radar.scan_rate_hz")),
    ("fig-4.21", ("thesis/fig_4_21.toml:blocks.traffic.intruders",)),
    ("table-2.4", ()),
]  # fmt: skip


def rows_of(results):
    return [(item, row) for item, made in results.items() for row in made.rows]


def kinds(results, *names):
    return [
        (item, row)
        for item, row in rows_of(results)
        if row.printed is not None and row.basis is not None and row.basis.kind in names
    ]


def test_verdict_follows_from_the_numbers_and_the_basis() -> None:
    for make, name in ((predicted, "predicted"), (calibrated, "calibrated"),
                       (configured, "configured")):  # fmt: skip
        basis = make("a test")
        assert Row("q", 9.144, "", "", "9.14", basis=basis).verdict == name
        far = Row("q", 9.146, "", "", "9.14", None, "of a test", basis)
        assert (far.verdict, far.verdict_text) == ("differs because", "differs because of a test")
        assert Row("q", 9.2, "", "", "9.14", 0.1, basis=basis).verdict == name
        assert Row("q", 9.14, "", "", basis=basis).verdict == "no value printed"
        with pytest.raises(ValueError, match="no reason why"):
            _ = Row("q", 9.2, "", "", "9.14", basis=basis).verdict
    assert Row("q", 9.14, "", "", derived="9.14").verdict == "no value printed"
    with pytest.raises(ValueError, match="no basis"):
        _ = Row("q", 9.14, "", "", "9.14").verdict


def test_a_row_beside_a_printed_number_takes_what_is_said_of_it_but_for_what_it_says() -> None:
    basis = configured("a test")
    number = Printed("9.14", 0.1, "of a test")
    assert number.compare("q", 9.2, "", "", basis).verdict == "configured"
    assert number.compare("q", 9.2, "", "", basis, tolerance=0.0).verdict_text.endswith("of a test")
    far = number.compare("q", 9.3, "km", "So.", basis, because="of the row", again="p")
    assert far == Row("q", 9.3, "km", "So.", "9.14", 0.1, "of the row", basis, again="p")
    assert Printed("9.14").compare("q", 9.144, "", "", basis).is_within_tolerance
    assert not Printed("9.14").compare("q", 9.146, "", "", basis).is_within_tolerance


def test_only_a_prediction_counts_and_only_once() -> None:
    rows = [
        Row("a", 1.0, "", "", "1", basis=predicted("x")),
        Row("again", 1.0, "", "", "1", basis=predicted("x"), again="a"),
        Row("b", 2.0, "", "", "1", None, "it does", predicted("x")),
        Row("c", 1.0, "", "", "1", basis=calibrated("x")),
        Row("d", 1.0, "", "", "1", basis=configured("x")),
        Row("e", 1.0, "", ""),
    ]
    assert tally_sentence(rows) == (
        "6 rows: 2 predicted, 1 calibrated, 1 configured, 1 differs because, 1 no value printed. "
        "Only a prediction counts as agreement: of 2 printed numbers that are predicted, "
        "1 agree: a."
    )


def test_the_first_ten_lines_of_the_page_count_its_rows() -> None:
    """Counted from the tables of the page itself."""
    text = PAGE.read_text(encoding="utf-8")
    counts = dict.fromkeys(VERDICTS, 0)
    column = 0
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if "verdict" in cells:
            column = cells.index("verdict")
        elif not line.startswith("| "):
            column = 0
        elif column and not line.startswith("| ---"):
            (verdict,) = [name for name in VERDICTS if cells[column].startswith(name)]
            counts[verdict] += 1
    head = "\n".join(text.splitlines()[:10])
    assert all(f"{count} *{name}*" in head for name, count in counts.items())
    assert f"{sum(counts.values())} rows:" in head
    agree = re.search(r"of (\d+) printed numbers that are predicted, (\d+) agree", head)
    assert agree is not None and 0 < int(agree[2]) <= counts["predicted"]


def test_every_row_has_one_of_the_five_and_says_from_what(results) -> None:
    for item, row in rows_of(results):
        assert row.verdict in VERDICTS, (item, row.quantity)
        if row.printed is not None:
            assert row.basis is not None and row.basis.words, (item, row.quantity)
            texts = {number.text for number in PRINTED[item].values()}
            assert row.printed in texts, (item, row.printed)
        else:
            assert row.basis is None and row.why, (item, row.quantity)


def test_every_printed_number_is_compared(results) -> None:
    for item, numbers in PRINTED.items():
        used = {row.printed for row in results[item].rows}
        assert {number.text for number in numbers.values()} <= used, item
    assert sum(map(len, PRINTED.values())) > 80


def test_every_input_exists(results) -> None:
    for item, row in rows_of(results):
        for name in row.basis.inputs if row.basis else ():
            file, key = name.split(":")
            if file.endswith(".csv"):
                assert key in read_thesis_csv(Path(file).name)[0]
            elif file.endswith(".toml"):
                found(read_scene_file(configs() / file).data, key)
            else:
                module = importlib.import_module(f"components.thesis.{file}")
                assert hasattr(module, key), (item, name)


def test_a_prediction_shares_no_input_with_what_was_set_from_the_same_number(results) -> None:
    known = kinds(results, "predicted")
    assert len(known) > 40
    for _, row in known:
        for _, other in kinds(results, "calibrated", "configured"):
            shared = set(row.basis.inputs) & set(other.basis.inputs)
            assert not shared or row.printed != other.printed, (row.quantity, other.quantity)


def test_the_page_says_which_predictions_agree(results) -> None:
    """Of all that the thesis prints, these are what a model gave that was not told."""
    assert {row.quantity for _, row in rows_of(results) if row.is_agreeing_prediction} == {
        "Pd of the medium class at 7.31 km",
        "share of IR detections fused with the radar's",
        "simulated average, declared by 10 detections in 10 scans, medium",
        "simulated average, declared by 10 detections in 10 scans, large",
    }


@pytest.mark.parametrize("asked", [False, True])
def test_a_prediction_stays_when_the_printed_number_is_changed(results, monkeypatch, asked) -> None:
    """All printed numbers, but Pd of the large class, which two rows ask where it is; then that."""
    monkeypatch.setattr(systems, "REPLICAS", 3)  # of which nothing is predicted
    for item, names in PRINTED.items():
        for name, number in list(names.items()):
            if ((item, name) == ("sec-4.1.3", "pd_large")) == asked:
                other = replace(number, text=f"{FACTOR * number.value:.6g}")
                monkeypatch.setitem(names, name, other)
    known = kinds(results, "predicted")
    compared = 0
    for item in dict.fromkeys(item for item, _ in known) if not asked else ["sec-4.1.3"]:
        again = {row.quantity: row for row in ITEMS[item].make().rows}
        for owner, row in known:
            if owner != item or row.unit == "s" or (asked and row.again):
                continue
            assert again[row.quantity].ours == row.ours, row.quantity
            compared += 1
            if not asked and row.printed != PRINTED["sec-4.1.3"]["pd_large"].text:
                assert again[row.quantity].printed != row.printed
    assert compared >= (2 if asked else 40)


@pytest.mark.parametrize("item", ["sec-4.1.3", "fig-4.22"])
def test_what_agrees_stays_wherever_its_number_stands_in_the_files(
    results, monkeypatch, item
) -> None:
    """Every value of ``configs`` that equals the printed number is changed."""
    (row,) = [row for row in results[item].rows if row.is_agreeing_prediction]
    here = float(row.printed)

    def swapped(value):
        if isinstance(value, dict):
            return {key: swapped(one) for key, one in value.items()}
        if isinstance(value, list):
            return [swapped(one) for one in value]
        alike = isinstance(value, (int, float)) and not isinstance(value, bool) and value == here
        return changed(value) if alike else value

    def apply(path, scene_file):
        scene_file.data.update(swapped(scene_file.data))

    rewrite(monkeypatch, apply)
    again = {one.quantity: one for one in ITEMS[item].make().rows}
    assert again[row.quantity].ours == row.ours
    # The same for a number that was calibrated: it does move.
    if item == "sec-4.1.3":
        here = 0.9114
        moved = {one.quantity: one for one in ITEMS[item].make().rows}
        assert moved["Pd of the small class at 6.91 km"].ours < 0.9


def test_the_list_of_what_moves_is_whole(results) -> None:
    named = {
        (item, row.basis.inputs)
        for item, row in kinds(results, "calibrated", "configured")
        if row.basis.inputs and item != "table-2.4"
    }
    covered = {(item, name) for item, inputs in MOVING for name in inputs}
    assert {(item, name) for item, inputs in named for name in inputs} == covered


@pytest.mark.parametrize(("item", "inputs"), MOVING, ids=lambda value: str(value)[:60])
def test_calibrated_and_configured_numbers_move_with_their_inputs(
    results, monkeypatch, item, inputs
) -> None:
    monkeypatch.setattr(systems, "REPLICAS", 3)
    known = [row for _, row in kinds({item: results[item]}, "calibrated", "configured")]
    if not inputs:
        inputs = tuple({name for row in known for name in row.basis.inputs})
    change(monkeypatch, inputs)
    moved = 0
    for row, again in zip(results[item].rows, ITEMS[item].make().rows, strict=True):
        if row in known and row.basis.inputs and set(row.basis.inputs) <= set(inputs):
            assert again.ours != row.ours, row.quantity
            moved += 1
    assert moved


def test_what_is_set_from_several_numbers_at_once_says_so(results) -> None:
    """No parameter file holds the four cells of Table 4.4; three constants were set from them."""
    beech = tomllib.loads((configs() / "aircraft/beech_99.toml").read_text(encoding="utf-8"))
    assert (beech["contrast"], beech["eo"]["front_m2"], cameras.CLIMB_DEG) == (1.0, 12.0, 1.4)
    cells = [row for row in results["table-4.4"].rows if row.verdict == "calibrated"]
    assert len(cells) == 4
