"""A folder of a stranger: nothing of it is imported, nothing is written outside of it."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dsa_des.cli import main
from dsa_des.files.output_names import make_numbered_folder
from dsa_des.results.figures import safe_file_name
from dsa_des.results.folder import StudyFolder, latest_folder
from dsa_des.studies.study_digest import study_json_text
from dsa_des.studies.study_file import read_study

STUDY = """
scene = "small.toml"
replicas = 2
metrics = ["fused_share"]
set.duration_s = 2
[axes]
blocks.radar.scan_rate_hz = [1, 5]
swap.transform = ["geometry.flat_earth", "geometry.ellipsoid"]
[[figures]]
metric = "fused_share.ir_with_radar"
axis = "blocks.radar.scan_rate_hz"
[[figures]]
kind = "heat"
metric = "fused_share.ir_with_radar"
[[figures]]
kind = "polar"
metric = "fused_share.ir_with_radar"
axis = "blocks.radar.scan_rate_hz"
"""
RUN = """
[[figures]]
kind = "run"
"""
MINE = b"mine"


def dsa_des(*words: str, code: int | None = 0) -> Result:
    result = CliRunner().invoke(main, words)
    assert code is None or result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study that was run into ``o``."""
    from tests.studies.conftest import FRAGILE, SCENE

    home = tmp_path_factory.mktemp("made")
    (home / "small.toml").write_text(SCENE)
    (home / "fragile.py").write_text(FRAGILE)
    (home / "study.toml").write_text(STUDY)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        patch.syspath_prepend(str(home))
        dsa_des("study", "study.toml", "--workers", "1", "--out", "o", "--quiet")
    return home


@pytest.fixture
def ready(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it: the working directory."""
    shutil.copytree(made, tmp_path / "home", dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path / "home")
    monkeypatch.syspath_prepend(str(tmp_path / "home"))
    return tmp_path / "home"


def names(folder: Path) -> list[str]:
    """Return every name that a study wrote, and those it writes them under first."""
    found = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]
    beside = [Path(name) for name in found]
    pid = os.getpid()
    found += [str(path.with_name(f".{path.name}.{pid}.{k}")) for path in beside for k in (0, 1)]
    return found


def test_no_name_that_a_study_writes_is_followed(ready: Path) -> None:
    written = names(Path("o"))
    kinds = ("study.json", ".lock", "summary.parquet", "differences.parquet",
             "figure-01-axis.png", "figure-02-heat.png", "figure-03-polar.png",
             "parts/part-000-000000.parquet")  # fmt: skip
    assert {*kinds} <= {*written} and any(name.startswith("scatter-") for name in written)
    outside = ready / "outside"
    outside.mkdir()
    for number, name in enumerate(written):
        if name == "study.json":  # a link there is no study
            continue
        place, target = Path("o", name), outside / name.replace("/", "_")
        place.unlink(missing_ok=True)
        if number % 2:  # every other link leads to nothing
            target.write_bytes(MINE)
        place.symlink_to(target)
    before = {path.name: path.read_bytes() for path in outside.iterdir()}
    dsa_des("study", "show", "o", code=2)  # no part is left
    resume = ("study", "study.toml", "--workers", "1", "--out", "o", "--quiet", "--resume")
    assert "o/.lock: cannot be written" in dsa_des(*resume, code=2).stderr
    Path("o/.lock").unlink()
    dsa_des(*resume)
    for path in [*Path("o").glob("*.png"), *Path("o").glob("*.parquet")]:
        path.unlink()
        path.symlink_to(outside / path.name)
    dsa_des("study", "show", "o")
    assert {path.name: path.read_bytes() for path in outside.iterdir()} == before
    links = [path.name for path in Path("o").rglob("*") if path.is_symlink()]
    assert all(name.startswith(".") for name in links)


def test_folders_behind_links_are_refused(ready: Path) -> None:
    outside = ready / "outside"
    shutil.move("o/parts", outside)
    Path("o/parts").symlink_to(outside)
    before = {path.name: path.read_bytes() for path in outside.iterdir()}
    words = ("study", "study.toml", "--workers", "1", "--out", "o", "--quiet", "--resume")
    for command in (words, ("study", "show", "o"), ("compare", "o")):
        assert "parts: is a link" in dsa_des(*command, code=2).stderr
    assert {path.name: path.read_bytes() for path in outside.iterdir()} == before
    Path("study.toml").write_text(STUDY + RUN)
    Path("new/parts").mkdir(parents=True)
    Path("new/run-cell-0-replica-0").symlink_to(outside)
    error = dsa_des(*words[:5], "new", "--quiet", code=2).stderr
    assert "something other than a study" in error
    Path("new/run-cell-0-replica-0").unlink()
    folder = StudyFolder(Path("new"))
    folder.open(study_json_text(read_study("study.toml")), resume=False)
    folder.close()
    Path("new/run-cell-0-replica-0").symlink_to(outside)
    error = dsa_des(*words[:5], "new", "--quiet", "--resume", code=2).stderr
    assert "run-cell-0-replica-0: is a link" in error
    assert {path.name: path.read_bytes() for path in outside.iterdir()} == before
    Path("dangling").symlink_to("nothing")
    assert "link to nothing" in dsa_des(*words[:5], "dangling", code=2).stderr


def test_a_pipe_is_not_waited_for(ready: Path) -> None:
    part = next(Path("o/parts").glob("*.parquet"))
    part.unlink()
    os.mkfifo(part)
    assert part.name in dsa_des("study", "show", "o", code=2).stderr
    Path("o/study.json").unlink()
    os.mkfifo("o/study.json")
    assert "cannot be read" in dsa_des("study", "show", "o", code=2).stderr


def test_show_imports_nothing_of_the_folder(ready: Path) -> None:
    module = "from pathlib import Path\nPath('imported').touch()\n"
    Path("trap.py").write_text(module)
    Path("small.toml").write_text('[blocks.radar]\ntype = "trap:Trap"\n')
    Path("study.toml").write_text('scene = "small.toml"\nmetrics = ["trap:Trap"]\n')
    content = Path("o/study.json").read_text()
    content = content.replace("geometry.ellipsoid", "trap:Trap").replace("fused_share", "trap:Trap")
    Path("o/study.json").write_text(content)
    dsa_des("study", "show", "o", code=None)
    dsa_des("compare", "o", code=None)
    shutil.copytree("o", "p")
    dsa_des("compare", "o", "p", code=None)
    assert not Path("imported").exists()


def test_show_reads_the_tables_only(ready: Path) -> None:
    before = Path("o/summary.parquet").read_bytes()
    for path in ("small.toml", "fragile.py", "study.toml"):
        Path(path).unlink()
    shown = dsa_des("study", "show", "o").output
    assert "fused_share.ir_with_radar" in shown and "figure-01-axis.png" in shown
    assert Path("o/summary.parquet").read_bytes() == before  # with its analytic answers
    shutil.copytree("o", "p")
    assert "pair by pair" in dsa_des("compare", "o", "p").output


def _without(key: str) -> Any:
    def change(content: dict[str, Any]) -> str:
        return json.dumps({name: value for name, value in content.items() if name != key})

    return change


def _with(key: str, value: Any) -> Any:
    return lambda content: json.dumps({**content, key: value})


WRONG = {
    "no text": lambda content: b"\xff\xfe",
    "no JSON": lambda content: "{",
    "nothing": lambda content: "",
    "a list": lambda content: "[]",
    "deep": lambda content: "[" * 100_000,
    "deep tables": lambda content: '{"study":' * 50_000,
    "a huge number": lambda content: '{"seed": ' + "9" * 100_000 + "}",
    "no title": _without("title"),
    "no axes": _without("axes"),
    "no results": _without("results"),
    "no sha": _without("study_sha256"),
    "title": _with("title", 5),
    "study": _with("study", None),
    "sha": _with("study_sha256", "../../x"),
    "cells": _with("cells", -1),
    "NaN": _with("confidence", float("nan")),
    "axes": _with("axes", [{"column": "x"}]),
    "figures": _with("figures", [{"kind": "../../x", "metric": "y"}]),
    "a figure of no axis": _with("figures", [{"kind": "axis", "metric": "y", "axis": "z"}]),
    "compare": _with("compare", ["nothing", 1]),
    "two columns": _with("results", [{"name": "cell", "kind": "number", "meaning": ""}]),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_malformed_study_json_is_one_error(ready: Path, name: str) -> None:
    path = Path("o/study.json")
    text = WRONG[name](json.loads(path.read_text()))
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    for command in (("study", "show", "o"), ("compare", "o"), ("compare", "o", "o")):
        error = dsa_des(*command, code=2).stderr
        assert error.count("\n") == 1 and "o/study.json: is damaged, or not of a study" in error
        assert len(error) < 300


def test_temporary_files_of_a_running_study_are_left_alone(ready: Path) -> None:
    study = read_study("study.toml")
    running = StudyFolder(Path("o"))
    running.open(study_json_text(study), resume=True)
    left = Path("o/parts/.part-000-000000.parquet.7.0")
    left.write_bytes(b"half")
    words = ("study", "study.toml", "--workers", "1", "--out", "o", "--quiet", "--resume")
    assert "another process is running this study" in dsa_des(*words, code=2).stderr
    assert left.exists()
    running.close()
    dsa_des(*words)
    assert not left.exists()


def test_two_studies_at_once_have_two_folders(ready: Path) -> None:
    assert make_numbered_folder(Path("studies"), "x") == Path("studies/x-001")
    assert make_numbered_folder(Path("studies"), "x") == Path("studies/x-002")
    Path("studies/x-003").symlink_to("nowhere")
    assert make_numbered_folder(Path("studies"), "x") == Path("studies/x-004")
    for name in ("x-1000", "x-y-2000", "x-"):
        Path("studies", name).mkdir()
    assert latest_folder(Path("studies"), "x") == Path("studies/x-1000")
    assert latest_folder(Path("studies"), "[x]") is None
    Path("file").touch()
    words = ("study", "study.toml", "--workers", "1", "--quiet")
    shutil.rmtree("studies")
    Path("studies").touch()
    assert "studies" in dsa_des(*words, code=2).stderr


def test_names_of_figures_stay_in_the_folder() -> None:
    assert "/" not in safe_file_name("../../etc/passwd") and safe_file_name("a-b_c.d") == "a-b_c.d"
    long = [safe_file_name("x" * 5000 + end) for end in "ab"] + [safe_file_name("ü" * 300)]
    assert all(len(name.encode()) <= 200 for name in long) and long[0] != long[1]
