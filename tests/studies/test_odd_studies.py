"""Long, strange and extreme values in a study: it runs, or one error says what is allowed."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.block.component import SourcedText
from dsa_des.cli import main
from dsa_des.studies.axes import Axis
from dsa_des.studies.draws import parse_draw
from dsa_des.studies.study import Study
from dsa_des.studies.study_tables import resolve_tables

STUDY = """
scene = "small.toml"
replicas = 1
metrics = ["first_detection"]
set.duration_s = 2
"""


def dsa_des(*words: str, code: int) -> Result:
    result = CliRunner().invoke(main, [*words])
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


TEXTS = [
    "[/]",
    "~10 runs",
    "~nosuchuser/x",
    "long text " * 40,
    "x" * 5000,
    "why? a*b",
    "$x^{$",
    "\\u0000",
    "\\u001b[31m \\u202e",
    "small.toml",
    "",
]


@pytest.mark.parametrize("text", TEXTS)
def test_any_text_is_a_title_and_a_description(small: Path, text: str) -> None:
    extra = f'title = "{text}"\ndescription = "{text}"\n'
    figure = f'[[figures]]\nmetric = "detected.radar"\ntitle = "{text}"\n'
    draws = f'[draws]\nblocks.ir.flaw = {{choice = ["{text}"]}}\n'
    axis = "[axes]\nblocks.radar.scan_rate_hz = [1, 2]\n"
    Path("study.toml").write_text(extra + STUDY + draws + axis + figure)
    dsa_des("study", "study.toml", "--workers", "1", "--out", "o", code=0)
    told = json.loads(Path("o/study.json").read_text())
    assert told["title"] == json.loads(f'"{text}"') == told["tables"]["description"]
    dsa_des("study", "show", "o", code=0)


REFUSED = {
    "axes.duration_s = {from = 1, to = 2, steps = 100_000}": "has 100,000 values; at most 10,000",
    "axes.duration_s = {from = 0, to = 1e300, step = 1e-300}": "at most 60 digits",
    "axes.duration_s = [" + "1," * 20_000 + "]": "has 20,000 values; at most 10,000",
    "axes.blocks.ir.offset_s = {beat_with = 'radar', steps = 1_000_000}": "at most 10,000",
    "axes.duration_s = {from = 1, to = 2, steps = 9000}\n"
    "axes.blocks.ir.offset_s = {from = 0, to = 1, steps = 9000}":
        "make 81,000,000 cells; at most 1,000,000",
    "axes.duration_s = [1, nan]": "must be finite",
    "axes.duration_s = [1, 12345678901234567890123]": "beyond 2^63",
    "draws.blocks.radar.offset_s = {uniform = [-1e308, 1e308]}": "are too large",
    "draws.blocks.radar.offset_s = {uniform = [0, 1e307]}": "are too large",
    "draws.blocks.radar.offset_s = {normal = [0, 1e308]}": "are too large",
    "draws.blocks.radar.offset_s = {choice = [9999999999999999999]}": "beyond 2^63",
    "stop_when = {metric = 5, half_width = 1}": "must be the name of a result",
    "stop_when = {metric = 'detected.radar', half_width = 1" + "0" * 400 + "}": "too many digits",
    "axes.blocks.radar.flaw = {files = '~nosuchuser/*'}": "home directory",
    "axes.blocks.radar.flaw = {files = '" + "x" * 5000 + "'}": "there is no file",
}  # fmt: skip


@pytest.mark.parametrize("line", REFUSED)
def test_what_is_too_much_is_refused_in_one_line(small: Path, line: str) -> None:
    Path("study.toml").write_text(STUDY + line + "\n")
    error = dsa_des("study", "study.toml", "--workers", "1", "--out", "o", code=2).stderr
    assert REFUSED[line] in error and error.count("\n") == 1
    assert not Path("o").exists()


def test_more_scans_than_a_thousand_processors_make_are_refused(small: Path) -> None:
    """Each of the runs would be begun, and so many of them too; all together are not."""
    many = STUDY.replace("replicas = 1", "replicas = 100_000_000").replace("s = 2", "s = 1e9")
    Path("study.toml").write_text(many)
    error = dsa_des("study", "study.toml", "--workers", "1", "--out", "o", code=2).stderr
    assert "replicas: 100,000,000 runs of " in error and error.count("\n") == 1
    assert "scans in all: at most 1e+15 are begun" in error and not Path("o").exists()


def test_what_json_cannot_hold_is_text_there(small: Path) -> None:
    odd = "description = [nan, -inf, 2020-01-01, 99999999999999999999999]\n"
    choice = "draws.blocks.ir.flaw = {choice = ['a', 'b']}\n"
    Path("study.toml").write_text(odd + STUDY + choice)
    dsa_des("study", "study.toml", "--workers", "1", "--out", "o", code=0)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    told = json.loads(Path("o/study.json").read_text(), parse_constant=refuse)
    assert told["tables"]["description"][:3] == ["nan", "-inf", "2020-01-01"]
    dsa_des("study", "show", "o", code=0)


def test_a_choice_of_lists_is_a_text(small: Path) -> None:
    assert not parse_draw("x", {"choice": [[1, 2], [3]]}).is_numeric
    assert parse_draw("x", {"choice": [1, 2.5, True]}).is_numeric


def test_compare_with_bad_input_is_2(small: Path) -> None:
    Path("bad.toml").write_text("[")
    Path("blocked").write_text("")
    Path("link").symlink_to("nowhere")
    for words in (
        ("small.toml", "bad.toml"),
        ("small.toml", "--swap", "radar"),
        ("small.toml", "small.toml", "--replicas", "1000000000000"),
        ("small.toml", "small.toml", "--out", "blocked"),
        ("small.toml", "small.toml", "--out", "blocked/x", "--replicas", "1"),
        ("small.toml", "small.toml", "--out", "link"),
        ("small.toml", "small.toml", "--workers", "1000000"),
        ("small.toml", "--swap", "radar=nowhere:X"),
    ):
        error = dsa_des("compare", *words, code=2).stderr
        assert "error:" in error
    left = {path.name for path in Path().iterdir()} - {"__pycache__"}
    assert left == {"bad.toml", "blocked", "link", "small.toml", "study.toml", "fragile.py"}


def test_a_scene_compared_with_itself_is_run_once(small: Path) -> None:
    words = ("small.toml", "small.toml", "--replicas", "1", "--workers", "1", "--out", "o")
    assert "pair by pair" in dsa_des("compare", *words, "--metric", "detected.ir", code=0).output


def test_cells_are_counted_like_a_product() -> None:
    import itertools

    axes = tuple(Axis(f"a{size}", tuple(range(size)), ((),) * size, ((),) * size)
                 for size in (2, 3, 1, 4))  # fmt: skip
    study = object.__new__(Study)
    study.axes = axes
    every = list(itertools.product(range(2), range(3), range(1), range(4)))
    assert [study.axis_value_indices(cell) for cell in study.cells] == every and len(
        study.cells
    ) == 24
    assert [study.cell_at(indices) for indices in every] == list(range(24))
    with pytest.raises(ValueError, match="24"):
        study.axis_value_indices(24)
    study.axes = ()
    assert list(study.cells) == [0] and study.axis_value_indices(0) == () and study.cell_at(()) == 0


@pytest.mark.parametrize("value", ["what?", "a*b", "[c]"])
def test_text_that_looks_like_a_pattern_of_files_stays_text(tmp_path: Path, value: str) -> None:
    (tmp_path / "a*b").mkdir()
    tables = {"axes": {"title": [SourcedText.from_text(value, tmp_path)]}}
    assert resolve_tables(tables, []) == {"axes": {"title": [value]}}
    files = {"axes": {"file": {"files": SourcedText.from_text("a*.daa", tmp_path)}}}
    assert resolve_tables(files, [])["axes"]["file"]["files"] == str(tmp_path.resolve() / "a*.daa")


def test_a_study_none_of_whose_runs_gives_a_result_is_an_error(small: Path) -> None:
    """Where one run has a result the others are counted: `test_study_survives`."""
    broken = 'set.blocks.radar.flaw = "raise"\n'
    Path("study.toml").write_text(STUDY.replace("replicas = 1", "replicas = 3") + broken)
    words = ["study", "study.toml", "--workers", "1", "--out", "o"]
    done = dsa_des(*words, code=2)
    said = "error: study.toml: none of its 3 runs gave a result; the first: radar (fragile:Fragile)"
    assert done.stdout == "" and done.stderr.startswith(said)
    assert dsa_des(*words, "--resume", code=2).stderr == done.stderr
    assert "3 runs failed" in dsa_des("study", "show", "o", code=0).stdout
