"""Ctrl-C is exit code 130 in every command, SIGTERM 143, and both clear up."""

import os
import re
import signal
from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from tests import warm_process
from tests.support.waiting import wait_for

#: A sensor that says when it is under way, and then takes as long as it is let.
SLOW = """
import os, time
from pathlib import Path
from components.sensor import Sensor

def wait(name):
    Path(name).touch()
    while True:
        time.sleep(0.01)

if os.environ.get("SLOW") == "import":
    wait("under way")

class Slow(Sensor):
    def look(self, cells):
        wait("under way")
"""

ENDS = [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]


@pytest.fixture(autouse=True)
def _usual_handlers():
    """The handlers of a fresh Python, whatever runs the tests has installed."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def under_way(place: Path, *words: object, wait_in: str = "look") -> warm_process.Process:
    """Start a command with a slow sensor and return when it waits."""
    (place / "slow.py").write_text(SLOW)
    sign = place / "under way"
    sign.unlink(missing_ok=True)
    path = os.pathsep.join(filter(None, [str(place), os.environ.get("PYTHONPATH")]))
    process = warm_process.start(
        ["-B", "-m", "dsa_des", *words],
        cwd=place,
        env={**os.environ, "PYTHONPATH": path, "SLOW": wait_in},
    )
    if wait_for(lambda: "waits" if sign.exists() else process.poll() is not None) != "waits":
        raise AssertionError(process.communicate())
    return process


def results_in(place: Path) -> list[str]:
    return sorted(
        path.name for path in place.iterdir() if path.name not in ("slow.py", "under way")
    )


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
@pytest.mark.parametrize("wait_in", ["import", "look"])
def test_a_run_that_is_stopped_leaves_nothing(
    wait_in: str, number: int, code: int, word: str, tmp_path: Path, configs: Path
) -> None:
    words = ("run", configs / "first_light.toml", "--swap", "radar=slow:Slow", "--out", "a/b")
    process = under_way(tmp_path, *words, wait_in=wait_in)
    assert len(list((tmp_path).glob("a/.*"))) == (wait_in == "look")
    process.send_signal(number)
    _, stderr = process.communicate()
    assert process.returncode == code, stderr
    assert [line for line in stderr.splitlines() if not re.match(r"note:|\d+ notes?: ", line)] == [
        f"stopped: {word}"
    ]
    assert results_in(tmp_path) == []


def test_what_a_killed_run_left_is_removed_by_the_next_one_and_a_living_one_is_not(
    tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("run", configs / "first_light.toml", "--swap", "radar=slow:Slow")
    killed = under_way(tmp_path, *words)
    killed.kill()
    killed.communicate()
    (left,) = os.listdir(tmp_path / "runs")
    living = under_way(tmp_path, *words)
    (at_work,) = os.listdir(tmp_path / "runs")
    assert left != at_work
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("dsa_des.running.recorded_run.load_reports", list)  # figures take long
    plain = ["run", str(configs / "first_light.toml"), "--duration", "1", "--quiet"]
    assert CliRunner().invoke(main, plain, catch_exceptions=False).exit_code == 0
    assert sorted(os.listdir(tmp_path / "runs")) == [at_work, "first_light-001"]
    living.send_signal(signal.SIGTERM)
    living.communicate()
    assert os.listdir(tmp_path / "runs") == ["first_light-001"]


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
@pytest.mark.parametrize("workers", [1, 2])
def test_a_study_that_is_stopped_says_how_to_go_on(
    workers: int, number: int, code: int, word: str, tmp_path: Path, configs: Path
) -> None:
    (tmp_path / "study.toml").write_text(
        f'scene = "{configs / "first_light.toml"}"\nreplicas = 2\nruns_per_chunk = 1\n'
        'metrics = ["fused_share"]\nswap.radar = "slow:Slow"\n'
    )
    words = ("study", "study.toml", "--out", "o", "--workers", workers)
    process = under_way(tmp_path, *words)
    process.send_signal(number)
    _, stderr = process.communicate()
    assert process.returncode == code, stderr
    assert "--resume" in stderr and "Traceback" not in stderr
    assert not list((tmp_path / "o" / "parts").iterdir())


@pytest.mark.parametrize(("number", "code", "word"), ENDS)
@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("dsa_des.commands.scene.load_scene_printing_notes", ["run", "{scene}"]),
        ("dsa_des.running.recorded_run.to_toml", ["run", "{scene}", "--duration", "1"]),
        ("dsa_des.commands.scene.load_scene_printing_notes", ["check", "{scene}"]),
        ("dsa_des.commands.graph._block_positions", ["graph", "{scene}", "--png"]),
        ("dsa_des.commands.scene.load_scene_printing_notes", ["explain", "{scene}"]),
        ("dsa_des.commands.cost.measure_rungs", ["cost", "{scene}", "--block", "transform"]),
        ("dsa_des.commands.catalogue.show_components", ["components"]),
        ("dsa_des.commands.study.read_study", ["study", "study.toml"]),
        ("dsa_des.commands.compare.run_study_into_folder", ["compare", "{scene}", "{scene}"]),
        ("components.thesis.reproduce.make_items", ["reproduce", "table-4.1"]),
        ("components.benchmark.run_benchmark.measure_in_new_process", ["benchmark", "--quick"]),
        ("dsa_des.commands.group.entry_points_of", ["--help"]),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_every_command(
    where: str,
    words: list[str],
    number: int,
    code: int,
    word: str,
    tmp_path: Path,
    configs: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(where, lambda *args, **kwargs: signal.raise_signal(number))
    scene = str(configs / "first_light.toml")
    if words[0] == "study":
        Path("study.toml").write_text("")
    words = [word.format(scene=scene) for word in words]
    result = CliRunner().invoke(main, words, catch_exceptions=False)
    assert result.exit_code == code, result.output
    assert result.stderr.splitlines()[-1] == f"stopped: {word}"
    assert results_in(tmp_path) == (["study.toml"] if words[0] == "study" else [])
