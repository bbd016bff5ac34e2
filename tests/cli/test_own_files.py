"""Classes of one's own: beside the scene, in a file by its path, and a package that hides ours."""

import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dsa_des.block.shadowed_packages import NotImportable, import_named_object, refuse_hidden_module
from dsa_des.cli import main
from dsa_des.errors import UsageError
from tests import warm_process

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "configs" / "first_light.toml"
GATE = "from components.gate import Gate\nclass Mine(Gate):\n    pass\n"
METRIC = """
import numpy as np
from dsa_des.studies.metric import Metric, Result

class Seven(Metric):
    def results(self): return [Result("seven", "number", "always seven")]
    def measure(self, group): return {"seven": np.full(len(group), 7.0)}
"""

Call = Callable[..., Result]


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """Forget what a test imported."""
    before = dict(sys.modules)
    yield
    for name in set(sys.modules) - set(before):
        if "own_" in name:
            del sys.modules[name]


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Call the command line in a folder ``here`` beside a folder ``scenes``."""
    for name in ("here", "scenes"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return lambda *words: CliRunner().invoke(main, list(map(str, words)))


def scene_with(folder: Path, gate: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(f'extends = "{SCENE}"\nduration_s = 1\nblocks.gate.type = "{gate}"\n')
    return path


def test_a_module_lies_beside_the_scene(call: Call, tmp_path: Path) -> None:
    (tmp_path / "scenes/own_gates.py").write_text(GATE)
    scene = scene_with(tmp_path / "scenes", "own_gates:Mine")
    before = list(sys.path)
    done = call("check", scene)
    assert done.exit_code == 0, done.output
    assert f"imports the module own_gates: {tmp_path / 'scenes/own_gates.py'}" in done.output
    assert sys.path == before


def test_a_swap_looks_beside_the_scene_too(call: Call, tmp_path: Path) -> None:
    (tmp_path / "scenes/own_swapped.py").write_text(GATE)
    scene = scene_with(tmp_path / "scenes", "gate")
    done = call("check", scene, "--swap", "gate=own_swapped:Mine")
    assert done.exit_code == 0, done.output


def test_the_working_directory_comes_before_the_scenes_folder(call: Call, tmp_path: Path) -> None:
    (tmp_path / "scenes/own_both.py").write_text("raise ImportError('of the scene')")
    (tmp_path / "here/own_both.py").write_text(GATE)
    done = call("check", scene_with(tmp_path / "scenes", "own_both:Mine"))
    assert done.exit_code == 0, done.output


def test_a_second_module_of_the_same_name_is_not_taken_for_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "own_twin.py").write_text(f"class Mine:\n    of = {name!r}\n")
    monkeypatch.chdir(tmp_path)
    assert import_named_object("own_twin:Mine", beside=(tmp_path / "a",)).of == "a"
    assert import_named_object("own_twin:Mine", beside=(tmp_path / "a",)).of == "a"
    with pytest.raises(NotImportable) as caught:
        import_named_object("own_twin:Mine", beside=(tmp_path / "b",))
    assert str(tmp_path / "a/own_twin.py") in str(caught.value)
    assert str(tmp_path / "b/own_twin.py") in str(caught.value)
    assert import_named_object("./a/own_twin.py:Mine").of == "a"
    assert import_named_object("./b/own_twin.py:Mine").of == "b"


def test_a_file_is_relative_to_what_names_it(call: Call, tmp_path: Path) -> None:
    (tmp_path / "scenes/own_file.py").write_text(f"import own_beside\n{GATE}")
    (tmp_path / "scenes/own_beside.py").touch()
    scene = scene_with(tmp_path / "scenes", "./own_file.py:Mine")
    assert call("check", scene).exit_code == 0
    plain = scene_with(tmp_path, "gate")
    refused = call("check", plain, "--swap", "gate=./own_file.py:Mine")
    assert refused.exit_code == 2
    assert f"there is no file {tmp_path / 'here/own_file.py'}" in refused.output
    assert call("check", plain, "--swap", "gate=../scenes/own_file.py:Mine").exit_code == 0


def test_a_file_may_have_the_name_of_an_installed_module(call: Call, tmp_path: Path) -> None:
    (tmp_path / "here/numpy.py").write_text(GATE)
    import numpy as before

    done = call("check", SCENE, "--swap", "gate=./numpy.py:Mine")
    assert done.exit_code == 0, done.output
    assert sys.modules["numpy"] is before


def test_what_ran_says_which_file_it_was(call: Call, tmp_path: Path) -> None:
    (tmp_path / "here/own_run.py").write_text(GATE)
    done = call("run", SCENE, "--swap", "gate=./own_run.py:Mine", "--duration", "1", "--quiet",
                "--out", "out")  # fmt: skip
    assert done.exit_code == 0, done.output
    written = tomllib.loads((tmp_path / "here/out/scene.toml").read_text())
    assert written["blocks"]["gate"]["type"] == f"{tmp_path / 'here/own_run.py'}:Mine"
    assert call("check", "out/scene.toml").exit_code == 0


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("./own_gate.py:Mine", "did you mean own_gates.py?"),
        ("./own_gates.py:Nine", "own_gates.py has no 'Nine'; did you mean 'Mine'?"),
        ("./own_gates.py:", "must have the form module:Class or ./file.py:Class"),
        ("./own_broken.py:Mine", "own_broken.py cannot be imported: ZeroDivisionError"),
        ("./own_leaves.py:Mine", "own_leaves.py cannot be imported: it left with SystemExit"),
        ("./folder.py:Mine", "is no regular file"),
    ],
)
def test_a_wrong_file_is_one_error(call: Call, tmp_path: Path, name: str, says: str) -> None:
    here = tmp_path / "here"
    (here / "own_gates.py").write_text(GATE)
    (here / "own_broken.py").write_text("1 / 0")
    (here / "own_leaves.py").write_text("raise SystemExit")
    (here / "folder.py").mkdir()
    done = call("check", SCENE, "--swap", f"gate={name}")
    assert done.exit_code == 2
    errors = [line for line in done.output.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and says in errors[0], done.output
    again = call("check", SCENE, "--swap", f"gate={name}")  # nothing half imported is left
    assert errors[0] in again.output


STUDY = """
scene = "../scenes/scene.toml"
replicas = 4
runs_per_chunk = 1
metrics = ["./own_metrics.py:Seven", "own_metrics:Seven"]
swap.gate = "./own_gates.py:Mine"
axes.swap.radar = ["radar.swerling", "./own_radar.py:Mine"]
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_a_study_and_its_workers_find_them(tmp_path: Path, workers: int) -> None:
    for name in ("scenes", "studies", "here"):
        (tmp_path / name).mkdir()
    (tmp_path / "scenes/own_scene.py").write_text(GATE)
    scene_with(tmp_path / "scenes", "own_scene:Mine")
    studies = tmp_path / "studies"
    (studies / "own_gates.py").write_text(GATE)
    (studies / "own_metrics.py").write_text(METRIC)
    (studies / "own_radar.py").write_text(
        "from components.radar.swerling import SwerlingRadar\nclass Mine(SwerlingRadar): pass\n"
    )
    study = STUDY.replace('"own_metrics:Seven"', '{metric = "first_detection"}')
    (studies / "study.toml").write_text(study)
    done = command(tmp_path / "here", "study", "../studies/study.toml", "--workers", workers,
                   "--out", "out")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "seven" in done.stdout


def test_a_metric_lies_beside_the_study(call: Call, tmp_path: Path) -> None:
    scene_with(tmp_path / "scenes", "gate")
    (tmp_path / "scenes/own_seven.py").write_text(METRIC)
    (tmp_path / "scenes/study.toml").write_text(
        'scene = "scene.toml"\nreplicas = 2\nmetrics = ["own_seven:Seven"]\n'
    )
    done = call("study", "../scenes/study.toml", "--workers", "1", "--out", "out")
    assert done.exit_code == 0, done.output
    assert "seven" in done.output


def command(
    home: Path, *words: object, module: bool = False, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the program as a user does."""
    start = ["-m", "dsa_des"] if module else ["-P", "-c", "from dsa_des.cli import main; main()"]
    if not environment:
        safe = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
        return warm_process.run([*start, *words], cwd=home, env=safe, timeout=300)
    return subprocess.run(
        [sys.executable, *start, *map(str, words)], cwd=home, capture_output=True, text=True,
        timeout=300, check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment},
    )  # fmt: skip


@pytest.mark.parametrize("as_folder", [True, False])
def test_a_package_that_hides_ours_is_named(tmp_path: Path, as_folder: bool) -> None:
    theirs = tmp_path / ("components/__init__.py" if as_folder else "components.py")
    theirs.parent.mkdir(exist_ok=True)
    theirs.touch()
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", str(ROOT))])
    every = ("components",), ("--help",), ("benchmark", "--help"), ("check", "first_light")
    for words in (("check", SCENE), *(every if as_folder else ())):
        done = command(tmp_path, *words, PYTHONPATH=path)
        assert done.returncode == 2, (words, done.stdout, done.stderr)
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: the module 'components' is ")
        assert str(theirs) in line and str(ROOT / "components") in line


def test_python_m_looks_into_the_working_directory_last(tmp_path: Path) -> None:
    (tmp_path / "components").mkdir()
    (tmp_path / "components/__init__.py").write_text("1 / 0")
    (tmp_path / "own_gate.py").write_text(GATE)
    path = os.environ.get("PYTHONPATH", str(ROOT))
    done = command(tmp_path, "check", SCENE, "--swap", "gate=own_gate:Mine", module=True,
                   PYTHONPATH=path, PYTHONSAFEPATH="")  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_ours_is_not_hidden_and_others_are_no_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_hidden_module("components.gate")
    refuse_hidden_module("there_is_none_such.at_all")
    refuse_hidden_module("json.decoder")
    monkeypatch.setitem(sys.modules, "components", sys.modules["json"])
    with pytest.raises(UsageError, match="json"):
        refuse_hidden_module("components.gate")
