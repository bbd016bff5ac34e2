"""A study on a cluster whose scheduler, workers and client are processes of their own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dsa_des.cli import main
from dsa_des.results.folder import StudyFolder
from tests.support.waiting import wait_for

SCENE = Path(__file__).parents[2] / "configs" / "benchmark" / "closed_loop_risk.toml"
WAITING = '''
import os, time
from components.radar.radar import RangeBoundary


class WaitingParameters(RangeBoundary.Parameters):
    unless: str = ""


class Waiting(RangeBoundary):
    """Looks at nobody before a file is there."""

    Parameters = WaitingParameters
    lockstep = True

    def look(self, cells):
        while self.p.unless and not os.path.exists(self.p.unless.removeprefix("unless ")):
            time.sleep(0.05)
        return super().look(cells)
'''
STUDY = f"""
scene = "{SCENE}"
replicas = 10_000
runs_per_chunk = 500
metrics = ["risk_ratio"]
[swap]
radar = "waiting:Waiting"
[set]
duration_s = 4
"blocks.radar.range_km" = 16
[axes]
"blocks.radar.unless" = ["", "unless FILE"]
[draws]
"blocks.traffic.encounter" = {{ sequence = [0, 1] }}
"""


def contents(folder: str) -> dict[str, bytes]:
    """Everything that a study's folder holds, by name; what it is made by is said otherwise."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(Path(folder).rglob("*"))
        if path.is_file() and path.name not in (".lock", "study.json")
    }


@contextmanager
def processes() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Programs to be added; none outlives the test."""
    started: list[subprocess.Popen[bytes]] = []
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_kills_of_a_worker_and_of_the_client_lose_nothing_and_count_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(SCENE.parents[2]), str(tmp_path)]))
    released = tmp_path / "released"
    Path("waiting.py").write_text(WAITING)
    Path("study.toml").write_text(STUDY.replace("FILE", str(released)))
    quiet = ["--quiet", "--no-figures"]
    released.touch()
    main(["study", "study.toml", "--workers", "1", "--out", "alone", *quiet], standalone_mode=False)
    whole = contents("alone")
    released.unlink()
    with processes() as started:

        def start(*words: str) -> subprocess.Popen[bytes]:
            started.append(subprocess.Popen([sys.executable, *words]))
            return started[-1]

        def worker() -> subprocess.Popen[bytes]:
            return start("-m", "dask", "worker", "--scheduler-file", "where.json", "--no-nanny",
                         "--nthreads", "1", "--no-dashboard", "--memory-limit", "0")  # fmt: skip

        def client(*more: str) -> subprocess.Popen[bytes]:
            return start("-c", "from dsa_des.cli import main; main()", "study", "study.toml",
                         "--executor", "dask", "--scheduler", address, "--out", "o", *quiet,
                         *more)  # fmt: skip

        start("-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
              "--no-jupyter", "--scheduler-file", "where.json")  # fmt: skip
        text = wait_for(lambda: Path("where.json").exists() and Path("where.json").read_text())
        address = json.loads(text)["address"]
        first, _ = worker(), worker()
        alone = client()
        parts = Path("o/parts")
        # Those of the second value wait, so that whoever is killed is killed before the end.
        wait_for(lambda: len(list(parts.glob("part-*.parquet"))) >= 2)
        first.send_signal(signal.SIGKILL)
        first.wait()
        worker()
        # Which piece comes next is the scheduler's: both workers may wait from here on.
        assert alone.poll() is None
        alone.send_signal(signal.SIGKILL)
        alone.wait()
        there = {path.name: path.read_bytes() for path in parts.glob("part-*.parquet")}
        assert 2 <= len(there) < 40
        released.touch()
        assert client("--resume").wait() == 0
    after = contents("o")
    assert {name: after[f"parts/{name}"] for name in there} == there
    assert after == whole
    rows = StudyFolder(Path("o")).results()
    assert (
        rows.num_rows == 20_000
        and rows.group_by(["cell", "replica"]).aggregate([]).num_rows == 20_000
    )
