"""``dsa-des encounters risk``: what it prints, and what it says of damaged tables."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from components.encounters.command import encounters
from tests.encounters.reference_data import reference_file

TABLE = """\
encounter,w,without,with,bearing_deg
11,1,1,0,10
12,2,1,1,95
13,3,0,1,170
14,4,0,0,20
"""
COLUMNS = ("--nominal", "without", "--mitigated", "with", "--weight", "w")


def call(*arguments: object) -> Result:
    words = ["risk", *(str(a) for a in arguments)]
    return CliRunner().invoke(encounters, words, catch_exceptions=False)


def table(folder: Path, text: str = TABLE) -> Path:
    path = folder / "pairs.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_published_ratio_on_the_command_line() -> None:
    path = reference_file("degas_sample/sample_results.csv")
    names = ("--nominal", "nmac_nominal", "--mitigated", "nmac_mitigated", "--weight", "weight")
    found = json.loads(call(path, *names, "--json").stdout)
    assert abs(found["ratio"] - 0.126765133837) < 1e-12


def told(rows: list[str], tmp_path: Path, *more: str) -> dict[str, str]:
    """Return what is printed: how a line begins → what stands behind two blanks."""
    text = "\n".join(["n,m", *rows]) + "\n"
    done = call(table(tmp_path, text), "--nominal", "n", "--mitigated", "m", *more)
    return {
        words[0]: words[-1]
        for words in (re.split(r"  +", line.strip()) for line in done.stdout.splitlines())
    }


def test_printed_numbers_have_no_more_digits_than_their_interval_gives_sense(
    tmp_path: Path,
) -> None:
    few = told(["1,1", "1,0", "1,0", "0,0"], tmp_path)
    assert few["risk ratio"] == few["unresolved"] == "0.333"
    assert re.fullmatch(r"0\.\d{3,4} to \d\.\d\d \(gamma\)", few["95 % interval"])
    delta = told(["1,1", "1,0", "1,0", "0,0"], tmp_path, "--interval", "delta")
    assert delta["95 % interval"].endswith(" (delta)")
    many = told(["1,1"] * 30_000 + ["1,0"] * 60_000, tmp_path)
    low, high = map(float, many["95 % interval"].split(" (")[0].split(" to "))
    assert many["risk ratio"] == "0.3333" and 0.001 < (high - low) / 2 < 0.01


def test_numbers_as_json_and_by_class(tmp_path: Path) -> None:
    done = call(table(tmp_path), *COLUMNS, "--by", "bearing_deg", "--edges", "60,120", "--json")
    found = json.loads(done.stdout)
    assert found["ratio"] == pytest.approx(5 / 3) and found["skipped"] == 0
    classes = found["classes"]
    assert list(classes) == ["1: below 60", "2: 60 to 120", "3: 120 and above"]
    assert (classes["1: below 60"]["ratio"], classes["2: 60 to 120"]["ratio"]) == (0.0, 1.0)
    assert classes["3: 120 and above"]["reason"]


def test_parquet_gives_the_same(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {"w": [1.0, 2.0, 3.0], "without": [True, True, False], "with": [0, 1, 1]}
    pq.write_table(pa.table(columns), tmp_path / "pairs.parquet")
    found = json.loads(call(tmp_path / "pairs.parquet", *COLUMNS, "--json").stdout)
    assert found["ratio"] == pytest.approx(5 / 3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("12,2,", "12,,", "pairs.csv: encounter 12 (line 3): w is missing: must be a number"),
        ("12,2,", "12,-2,", "encounter 12 (line 3): w = '-2': must be a number of 0 or more"),
        ("13,3,0,", "13,3,2,", "encounter 13 (line 4): without = '2': must be 0 or 1"),
        ("14,4,0,0,20", "14,4", "line 5: has 2 values, but there are 5 columns"),
        ("without", "witout", "--nominal without: there is no such column; did you mean 'witout'"),
        ("1,1,0,10\n12,2,1", "1,0,0,10\n12,2,0", "no risk ratio: no encounter has a nominal"),
    ],
)
def test_one_error_without_a_traceback(tmp_path: Path, old: str, new: str, said: str) -> None:
    done = call(table(tmp_path, TABLE.replace(old, new)), *COLUMNS)
    assert done.exit_code == 2
    assert said in done.stderr and "Traceback" not in done.stderr


def test_damaged_encounters_are_skipped_and_counted_on_request(tmp_path: Path) -> None:
    path = table(tmp_path, TABLE.replace("13,3,", "13,nan,"))
    done = call(path, *COLUMNS, "--skip-damaged")
    assert done.exit_code == 0
    assert "1 damaged encounters were skipped" in done.stdout
    assert re.search(r"^risk ratio +0\.667$", done.stdout, re.MULTILINE)


def test_rows_that_hang_together_are_told_apart_from_encounters(tmp_path: Path) -> None:
    rows = ["encounter,copy,n,m,kind"]
    rows += [f"{k},{c},{int(k % 2)},{int(k % 4 == 1)},x" for k in range(80) for c in range(3)]
    (tmp_path / "t.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    words = (tmp_path / "t.csv", "--nominal", "n", "--mitigated", "m", "--json")
    loose = json.loads(call(*words).stdout)
    found = json.loads(call(*words, "--cluster", "encounter").stdout)
    assert (found["clusters"], loose["clusters"], found["ratio"]) == (80, 240, loose["ratio"])
    assert found["standard_error"] == pytest.approx(loose["standard_error"] * 3**0.5)
    classes = json.loads(call(*words, "--cluster", "encounter", "--by", "kind").stdout)["classes"]
    assert classes["x"]["standard_error"] == pytest.approx(found["standard_error"])
    told = call(*words[:-1], "--cluster", "encounter", "--by", "encounter").stdout
    assert "240 encounters in 80 clusters" in told
