"""Modules and classes that a file names: from where they are imported, and what they may do."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dsa_des
from tests import warm_process

CONFIGS = Path(__file__).parent.parent.parent / "configs"
SCENE = CONFIGS / "first_light.toml"
LEAVE = {
    "sys.exit(0)": "import sys\nsys.exit(0)",
    "SystemExit with text": "raise SystemExit('\\x1b[31m gone\\nerror: forged')",
    "KeyboardInterrupt": "raise KeyboardInterrupt",
    "of its own": "class Gone(BaseException): pass\nraise Gone",
    "an error": "1 / 0",
    "a syntax error": "def f(:",
    "a missing module": "import there_is_none_such",
    "by way of another": "import other",
}
CLASS = """
import sys
from fractions import Fraction
from pydantic import field_validator
from components.radar.radar import RangeBoundary
from dsa_des import Component, Parameters

class Plain(RangeBoundary): pass
class Init(Plain):
    def __init__(self, *given): sys.exit(0)
class Raising(Plain):
    def __init__(self, *given): raise KeyError("x")
class Setup(Plain):
    def setup(self): sys.exit(0)
class Clock(Plain):
    @classmethod
    def clock_of(cls, parameters): sys.exit(0)
class NoClock(Plain):
    @classmethod
    def clock_of(cls, parameters): return 5
class Asking(Plain):
    def request(self, port): raise KeyError(port)
class Validator(Plain):
    class Parameters(RangeBoundary.Parameters):
        @field_validator("range_km")
        @classmethod
        def leave(cls, value): sys.exit(0)
class Odd(Plain):
    class Parameters(RangeBoundary.Parameters):
        other: "NothingOfThisName" = 1
class Inputs(Plain):
    inputs = 5
class Ports(Plain):
    inputs = {"a": 5}
class Table(Plain):
    Parameters = dict
"""


def call(home: Path, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command as a user does, in a folder of somebody's files.

    With an environment of its own it starts from nothing: what Python imports first may matter.
    """
    if not environment:
        words = ["-P", "-c", "from dsa_des.cli import main; main()", *arguments]
        safe = {**os.environ, "PYTHONSAFEPATH": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        return warm_process.run(words, cwd=home, env=safe, timeout=300)
    return subprocess.run(
        [sys.executable, "-P", "-c", "from dsa_des.cli import main; main()",
         *map(str, arguments)],
        cwd=home, capture_output=True, text=True, timeout=300,
        env={**os.environ, "PYTHONSAFEPATH": "1", "PYTHONDONTWRITEBYTECODE": "1", **environment},
        check=False,
    )  # fmt: skip


def one_error(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    errors = [
        line for line in done.stderr.splitlines() if not re.match(r"note: |\d+ notes?: ", line)
    ]
    assert len(errors) == 1 and errors[0].startswith("error: "), done.stderr
    return errors[0]


@pytest.mark.parametrize("kind", LEAVE)
def test_a_module_that_leaves_is_one_error(tmp_path: Path, kind: str) -> None:
    (tmp_path / "leaver.py").write_text(LEAVE[kind])
    (tmp_path / "other.py").write_text("raise SystemExit")
    error = one_error(call(tmp_path, "check", SCENE, "--set", "blocks.radar.type=leaver:X"))
    assert "blocks.radar.type" in error
    assert "'leaver'" in error and str(tmp_path / "leaver.py") in error


@pytest.mark.parametrize(
    "name",
    ["Init", "Raising", "Setup", "Clock", "NoClock", "Asking", "Validator", "Odd", "Inputs",
     "Ports", "Table"],
)  # fmt: skip
def test_a_class_that_cannot_be_used_is_one_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "mine.py").write_text(CLASS)
    swap = ("--swap", f"radar=mine:{name}", "--set", "blocks.radar.range_km=20")
    error = one_error(call(tmp_path, "check", SCENE, *swap))
    assert "radar" in error and f"mine:{name}" in error
    assert "cannot be imported" not in error


def test_a_block_that_leaves_while_it_runs_has_failed(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        CLASS
        + """
class Runs(Plain):
    def run(self, wake): sys.exit(0)
"""
    )
    swap = ("--swap", "radar=mine:Runs", "--set", "blocks.radar.range_km=20")
    done = call(tmp_path, "run", SCENE, *swap, "--duration", "1", "--out", "o", "--quiet")
    assert done.returncode == 1
    assert "radar (mine:Runs) failed at t = 0.000 s, scan 0: SystemExit: 0" in done.stderr
    assert not (tmp_path / "o").exists()


def test_a_metric_that_leaves_does_not_end_a_study_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import sys\nfrom components.metrics.detection import FirstDetection\n"
        "class Left(FirstDetection):\n    def results(self): sys.exit(0)\n"
    )
    (tmp_path / "study.toml").write_text(
        f'scene = "{SCENE}"\nreplicas = 1\nmetrics = ["mine:Left"]\nset.duration_s = 1\n'
    )
    done = call(tmp_path, "study", "study.toml", "--workers", "1", "--out", "s")
    assert "'mine' left with SystemExit: 0" in one_error(done)


def test_nothing_beside_the_scene_stands_in_for_an_installed_package(tmp_path: Path) -> None:
    for name in ("pyarrow", "numpy", "components", "rich", "optional_and_not_installed"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w')")
    (tmp_path / "components").mkdir()
    (tmp_path / "components" / "__init__.py").write_text("open('ran', 'w')")
    (tmp_path / "s.toml").write_text(
        f'extends = "{SCENE}"\nduration_s = 1\nblocks.gate.type = "components.gate:Gate"\n'
    )
    (tmp_path / "study.toml").write_text(
        'scene = "s.toml"\nreplicas = 2\nmetrics = ["first_detection"]\n'
    )
    for arguments in (
        ("check", "s.toml"),
        ("run", "s.toml", "--quiet", "--out", "o"),
        ("study", "study.toml", "--workers", "2", "--quiet", "--out", "s"),
    ):
        # As a console script: nothing tells Python to keep the working directory off the path.
        done = call(tmp_path, *arguments, PYTHONSAFEPATH="")
        assert done.returncode == 0, done.stderr
        assert not (tmp_path / "ran").exists(), arguments


def test_a_module_beside_the_scene_is_found_also_by_workers(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        f'scene = "{SCENE}"\nreplicas = 2\nmetrics = ["first_detection"]\nset.duration_s = 1\n'
        '[set.blocks.gate]\ntype = "mine:Gate"\n'
    )
    (tmp_path / "mine.py").write_text("import beside\nclass Gate(beside.Gate): pass\n")
    (tmp_path / "beside.py").write_text("from components.gate import Gate\n")
    done = call(
        tmp_path,
        "study",
        "study.toml",
        "--workers",
        "2",
        "--quiet",
        "--out",
        "s",
        PYTHONSAFEPATH="",
    )
    assert done.returncode == 0, done.stderr


def test_the_working_directory_is_on_the_path_only_meanwhile(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import os, sys\nassert sys.path[-1] == os.getcwd() != sys.path[0]\n"
        "from components.gate import Gate\n"
    )
    script = (
        "import os, sys; from dsa_des.block.registry import find_component; before = "
        "list(sys.path)\n"
        "find_component('mine:Gate'); assert sys.path == before and os.getcwd() not in before"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", script], cwd=tmp_path, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_folder_of_the_name_of_an_installed_package_is_said(tmp_path: Path) -> None:
    (tmp_path / "components").mkdir()
    (tmp_path / "components" / "mine.py").write_text("class X: pass")
    error = one_error(call(tmp_path, "check", SCENE, "--swap", "radar=components.mine:X"))
    assert str(tmp_path / "components") in error and "installed" in error


def test_check_says_what_it_imports_before_it_does(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("import os\nos._exit(0)")
    done = call(tmp_path, "check", SCENE, "--swap", "gate=mine:Gate")
    assert f"blocks.gate.type = mine:Gate imports the module mine: {tmp_path / 'mine.py'}" in (
        done.stdout
    )


def test_check_imports_nothing_foreign_when_told_so(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("open('ran', 'w')\nfrom components.gate import Gate\n")
    done = call(tmp_path, "check", SCENE, "--swap", "gate=mine:Gate", "--no-import")
    assert done.returncode == 0, done.stderr
    line, summary = done.stdout.splitlines()
    assert line.startswith("blocks.gate.type = mine:Gate does not import the module mine: ")
    assert "ok" not in summary and "were not checked" in summary
    assert not (tmp_path / "ran").exists()
    wrong = ("--set", "blocks.radar.scan_rate_hz=-1")
    error = one_error(call(tmp_path, "check", SCENE, "--swap", "gate=mine:Gate", "--no-import",
                           *wrong))  # fmt: skip
    assert "blocks.radar.scan_rate_hz" in error
    assert call(tmp_path, "check", SCENE, "--no-import").stdout.startswith(f"{SCENE}: ok. ")


def test_what_a_module_prints_does_not_spoil_json(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("print('\\x1b[31mhello')\nfrom components.gate import Gate\n")
    done = call(tmp_path, "run", SCENE, "--swap", "gate=mine:Gate", "--duration", "1", "--json",
                "--out", "o")  # fmt: skip
    assert json.loads(done.stdout)["simulated_s"] == 1
    assert done.stderr.splitlines()[0] == "mine: \\x1b[31mhello"
    assert "\x1b" not in done.stderr


STUDY = f"scene = '{SCENE}'\nreplicas = 2\nruns_per_chunk = 1\nmetrics = ['first_detection']\n"
#: Written over every module that Python's part of a worker's start and ours import.
SHADOW = "open(__file__ + '.ran', 'w')\n"
STARTED = "import dsa_des.studies.executors, multiprocessing.forkserver, sys; print(*sys.modules)"


@pytest.fixture(scope="module")
def shadows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study, and a file named like each module that a worker imports."""
    home = tmp_path_factory.mktemp("shadows")
    found = subprocess.run([sys.executable, "-P", "-c", STARTED], capture_output=True, text=True,
                           check=True)  # fmt: skip
    tops = {name.partition(".")[0] for name in found.stdout.split()} - {"__main__"}
    assert {"multiprocessing", "re", "signal", "numpy", "dsa_des", "socket"} <= tops
    for name in tops:
        (home / f"{name}.py").write_text(SHADOW)
    (home / "s.toml").write_text(f"{STUDY}set.duration_s = 1\n")
    return home


def ran(home: Path) -> list[str]:
    return sorted(path.name for path in home.glob("*.ran"))


@pytest.mark.parametrize("method", ["", "m.get_all_start_methods = lambda: ['spawn']\n"])
def test_workers_run_nothing_of_the_working_directory(
    shadows: Path, tmp_path: Path, method: str
) -> None:
    """Nor does the server that forks them, nor the tracker of what they share."""
    program = tmp_path / "program.py"  # as ``dsa-des`` is: a script in a folder of its own
    program.write_text(
        f"import multiprocessing as m\n{method}from dsa_des.cli import main\n"
        "if __name__ == '__main__': main()\n"
    )
    command = [sys.executable, str(program), "study", "s.toml", "--workers", "2", "--quiet"]
    plain = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    done = subprocess.run([*command, "--out", str(tmp_path / "o")], cwd=shadows, env=plain,
                          capture_output=True, text=True, timeout=300, check=False)  # fmt: skip
    assert (done.returncode, ran(shadows)) == (0, []), done.stderr


def test_workers_run_nothing_that_lies_beside_a_script(tmp_path: Path) -> None:
    """Of modules that the script itself has not imported, and a metric of its own is found."""
    (tmp_path / "own_sensor.py").write_text(
        "from components.radar.swerling import SwerlingRadar\nclass Own(SwerlingRadar): pass\n"
    )
    (tmp_path / "script.py").write_text(f"""
import sys, pathlib
here = sys.path.pop(0)
import dsa_des, dsa_des.library.study, dsa_des.studies.executors, multiprocessing.forkserver
import concurrent.futures.process, multiprocessing.spawn, dsa_des.studies.runner
sys.path.insert(0, here)
for name in {{name.partition('.')[0] for name in sys.modules}} - {{'__main__'}}:
    pathlib.Path(here, name + '.py').write_text({SHADOW!r})
scene = dsa_des.load_scene({str(SCENE)!r}, duration_s=1, swaps=['radar=own_sensor:Own'])
print(len(dsa_des.study(scene, metrics=['first_detection'], replicas=2, workers=2).runs))
""")
    (tmp_path / "elsewhere").mkdir()
    plain = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    done = subprocess.run([sys.executable, str(tmp_path / "script.py")], cwd=tmp_path / "elsewhere",
                          capture_output=True, text=True, timeout=300, env=plain,
                          check=False)  # fmt: skip
    assert (done.stdout, ran(tmp_path)) == ("2\n", []), done.stderr


def test_the_program_run_as_a_module_runs_nothing_of_the_working_directory(shadows: Path) -> None:
    # What Python itself looks for before it comes to us.
    command = [sys.executable, "-P", "-c", "import runpy, sys; print(*sys.modules)"]
    found = subprocess.run(command, capture_output=True, text=True, check=True)
    for name in ("dsa_des", *found.stdout.split()):
        (shadows / f"{name}.py").unlink(missing_ok=True)
    plain = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    done = subprocess.run([sys.executable, "-m", "dsa_des", "check", "first_light"], cwd=shadows,
                          capture_output=True, text=True, timeout=300, env=plain,
                          check=False)  # fmt: skip
    assert (done.returncode, ran(shadows)) == (0, []), done.stderr


@pytest.mark.parametrize(
    ("argv", "orig", "first", "is_left_out"),
    [
        (["-m"], ["python", "-m", "dsa_des"], "here", True),
        (["-m"], ["python", "-mdsa_des"], "here", True),
        (["-m"], ["python", "-m", "pytest"], "here", False),
        (["run.py"], ["python", "run.py", "dsa_des"], "here", False),
        (["-m"], ["python", "-m", "dsa_des"], "elsewhere", False),
        (["-m"], ["python", "-m", "dsa_des"], "home", False),
    ],
)
def test_only_as_a_program_the_working_directory_is_no_place_of_modules(
    argv, orig, first, is_left_out, monkeypatch, tmp_path
):
    home = str(Path(dsa_des.__file__).parents[1])
    monkeypatch.chdir(home if first == "home" else tmp_path)
    place = {"here": os.getcwd(), "elsewhere": "/nowhere", "home": home}[first]
    monkeypatch.setattr(sys, "path", [place, "/other"])
    monkeypatch.setattr(sys, "argv", argv)
    monkeypatch.setattr(sys, "orig_argv", orig)
    dsa_des._drop_working_directory_from_path()
    assert sys.path == (["/other"] if is_left_out else [place, "/other"])
