"""A run that kills its process is told apart, counted and tried again; others do not suffer."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from dsa_des.cli import main
from dsa_des.results.folder import StudyFolder, failure_counts_of_part
from dsa_des.results.record import CRASHED, DONE
from dsa_des.studies import executors
from dsa_des.studies.attempts import TRIES, Attempts, split_chunk
from dsa_des.studies.chunk import ChunkResult, join_chunk_results, make_chunk_result
from dsa_des.studies.executors import Local
from dsa_des.studies.runner import run_study
from dsa_des.studies.study import Chunk
from dsa_des.studies.study_digest import study_json_text
from dsa_des.studies.study_file import read_study

STUDY = """
scene = "small.toml"
seed = 1
replicas = 9
runs_per_chunk = 3
metrics = ["first_detection"]
set.duration_s = 2
[draws]
blocks.ir.flaw = { choice = ["none", "none", "none", "die once MARKER"] }
"""


def study(*words: str, code: int = 0) -> Result:
    result = CliRunner().invoke(main, ["study", *words])
    assert result.exit_code == code, result.output
    return result


def contents(folder: str) -> dict[str, bytes]:
    files = [*Path(folder, "parts").iterdir(), Path(folder, "summary.parquet")]
    return {path.name: path.read_bytes() for path in files}


def test_a_run_that_always_kills_is_charged_alone_and_tried_again_on_resume(small: Path) -> None:
    marker = small / "gone"
    text = STUDY.replace("die once MARKER", f"die unless {marker}")
    Path("study.toml").write_text(text)
    marker.touch()
    study("study.toml", "--workers", "1", "--out", "whole", "--quiet")
    marker.unlink()
    checked = read_study("study.toml")
    guilty = {k for k in range(9) if "die" in checked.replica(k).changes["blocks.ir.flaw"]}
    assert 0 < len(guilty) < 9
    ran = study("study.toml", "--workers", "2", "--out", "o", "--quiet", code=1)
    assert f"{len(guilty)} of 9 runs crashed" in ran.stderr and "--resume" in ran.stderr
    rows = StudyFolder(Path("o")).results().to_pylist()
    assert {row["replica"] for row in rows if row["status"] == CRASHED} == guilty
    assert {row["replica"] for row in rows if row["status"] == DONE} == set(range(9)) - guilty
    assert all((row["status"] == CRASHED) == (row["error"] is not None) for row in rows)
    assert all("died" in row["error"] for row in rows if row["error"])
    shown = CliRunner().invoke(main, ["study", "show", "o"])
    assert shown.exit_code == 0 and f"{len(guilty)} of them crashed" in shown.output
    marker.touch()  # whatever killed them is gone
    study("study.toml", "--workers", "2", "--out", "o", "--quiet", "--resume")
    assert contents("o") == contents("whole")


def test_a_run_that_kills_once_is_no_crash(small: Path) -> None:
    marker = small / "died"
    Path("study.toml").write_text(STUDY.replace("MARKER", str(marker)))
    marker.touch()
    study("study.toml", "--workers", "1", "--out", "whole", "--quiet")
    marker.unlink()
    ran = study("study.toml", "--workers", "2", "--out", "o", "--quiet")
    assert marker.exists() and "crashed" not in ran.output
    assert contents("o") == contents("whole")


def test_runs_that_failed_are_not_tried_again(small: Path) -> None:
    text = STUDY.replace("die once MARKER", "raise")
    Path("study.toml").write_text(text)
    study("study.toml", "--workers", "1", "--out", "o", "--quiet")
    times = {path: path.stat().st_mtime_ns for path in Path("o/parts").iterdir()}
    status = [row["status"] for row in StudyFolder(Path("o")).results().to_pylist()]
    assert "failed" in status and CRASHED not in status
    study("study.toml", "--workers", "1", "--out", "o", "--quiet", "--resume")
    assert times == {path: path.stat().st_mtime_ns for path in Path("o/parts").iterdir()}


def test_kills_from_outside_make_no_error_rows(small: Path) -> None:
    text = STUDY.replace('"none", "none", "none", "die once MARKER"', '"none"')
    Path("study.toml").write_text(text.replace("runs_per_chunk = 3", "runs_per_chunk = 1"))
    checked = read_study("study.toml")
    alone = StudyFolder(Path("alone"))
    alone.open(study_json_text(checked), resume=False)
    run_study(checked, alone, executors.Serial())
    folder = StudyFolder(Path("o"))
    folder.open(study_json_text(checked), resume=False)
    local = Local(2)
    killed = []

    def kill_all(progress: object) -> None:
        """After every result, kill all workers there are."""
        for worker in local._workers:
            pool = worker._pool
            for process in list((getattr(pool, "_processes", None) or {}).values()):
                if len(killed) < 3 and process.pid not in killed:
                    os.kill(process.pid, signal.SIGKILL)
                    killed.append(process.pid)

    try:
        progress = run_study(checked, folder, local, kill_all)
    finally:
        local.close()
    assert len(killed) >= 3 and progress.failed == progress.crashed == 0
    assert folder.results().equals(alone.results())


def test_a_block_that_leaves_ends_its_run_only(small: Path) -> None:
    Path("study.toml").write_text(STUDY.replace("die once MARKER", "leave"))
    for workers in ("1", "2"):
        study("study.toml", "--workers", workers, "--out", f"o{workers}", "--quiet")
        status = [row["status"] for row in StudyFolder(Path(f"o{workers}")).results().to_pylist()]
        assert 0 < status.count("failed") < 9 and status.count(DONE) + status.count("failed") == 9
    assert contents("o1") == contents("o2")


class _Process:
    """Runs pieces on paper: a piece with a guilty run is lost."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        module = "dsa_des.studies.attempts"
        monkeypatch.setattr(
            f"{module}.join_chunk_results", lambda name, parts: self.sum(name, parts)
        )
        monkeypatch.setattr(
            f"{module}.crashed_chunk_result",
            lambda study, chunk, tries: ChunkResult(chunk.name, b"", 1, 1, 1),
        )
        self.deaths: list[Chunk] = []

    @staticmethod
    def sum(name: str, parts: list[ChunkResult]) -> ChunkResult:
        return ChunkResult(name, b"", sum(p.runs for p in parts), 0, sum(p.crashed for p in parts))

    def all(self, *together: tuple[Chunk, ...], guilty: set[int]) -> list[ChunkResult]:
        attempts, found = Attempts(None, together), list[ChunkResult]()  # type: ignore[arg-type]
        while (piece := attempts.next_piece()) is not None:
            runs = [run for chunk in piece.chunks for run in chunk.runs]
            if {k for _, start, end in runs for k in range(start, end)} & guilty:
                self.deaths += piece.chunks
                found += attempts.retry_after_crash(piece)
            else:
                found += attempts.accept_results_return_complete(
                    piece, [ChunkResult(chunk.name, b"", len(chunk), 0) for chunk in piece.chunks]
                )
        return found


def test_the_guilty_run_of_a_large_chunk_is_found_by_halving(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    process = _Process(monkeypatch)
    (done,) = process.all((Chunk("one", ((0, 0, 100), (1, 100, 128))),), guilty={77})
    assert (done.runs, done.crashed) == (128, 1)
    assert len(process.deaths) <= 2 + 7 + TRIES
    assert [chunk.runs for chunk in process.deaths[-TRIES:]] == [((0, 77, 78),)] * TRIES


def test_chunks_that_were_run_together_are_run_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    process = _Process(monkeypatch)
    chunks = tuple(Chunk(name, ((0, 4 * k, 4 * k + 4),)) for k, name in enumerate("abc"))
    found = process.all(chunks, guilty={6})
    assert sorted((done.name, done.runs, done.crashed) for done in found) == [
        ("a", 4, 0), ("b", 4, 1), ("c", 4, 0),
    ]  # fmt: skip
    assert [chunk.name for chunk in process.deaths[:3]] == ["a", "b", "c"]
    assert {chunk.name for chunk in process.deaths[3:]} == {"b"}


def test_a_last_try_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    attempts = Attempts(None, [(Chunk("a", ((0, 0, 1),)),), (Chunk("b", ((0, 1, 2),)),)])  # type: ignore[arg-type]
    first, second = attempts.next_piece(), attempts.next_piece()
    assert first is not None and second is not None
    attempts.retry_after_crash(first)
    assert attempts.next_piece() is None  # the other one is still under way
    attempts.accept_results_return_complete(second, [ChunkResult("b", b"", 1, 0)])
    again = attempts.next_piece()
    assert again is not None and again.chunks[0].name == "a" and attempts.next_piece() is None


def test_halves_hold_each_run_once() -> None:
    chunk = Chunk("one", ((0, 3, 5), (1, 0, 4), (2, 7, 8)))
    first, second = split_chunk(chunk)
    runs = [(c, k) for part in (first, second) for c, a, b in part.runs for k in range(a, b)]
    assert runs == [(c, k) for c, a, b in chunk.runs for k in range(a, b)]
    assert (len(first), len(second)) == (3, 4)


def test_a_part_says_what_its_runs_are_and_what_blocks_could_not_do() -> None:
    """Of four runs one failed and one crashed; what is joined adds up, in order of cells."""

    def part(cells: list[int], status: list[str], undone: dict) -> ChunkResult:
        rows = {"cell": cells, "replica": [0] * len(cells), "status": status}
        return make_chunk_result("part", pa.table(rows), undone)

    what = {"tracker": {"it never had a track": (1, 4)}}
    first = part([3, 1, 2, 0], ["done", "failed", "crashed", "done"], what)
    assert (first.runs, first.failed, first.crashed) == (4, 2, 1)
    assert failure_counts_of_part(pq.read_table(pa.BufferReader(first.content))) == what
    silent = part([4], ["done"], {})
    table = pq.read_table(pa.BufferReader(silent.content))
    assert (silent.runs, silent.failed, silent.crashed, failure_counts_of_part(table)) == (
        1,
        0,
        0,
        {},
    )
    whole = join_chunk_results("whole", [silent, replace(first, cpu_s=2.5), first])
    table = pq.read_table(pa.BufferReader(whole.content))
    assert table["cell"].to_pylist() == [0, 0, 1, 1, 2, 2, 3, 3, 4]
    assert (whole.name, whole.runs, whole.failed, whole.crashed) == ("whole", 9, 4, 2)
    assert failure_counts_of_part(table) == {"tracker": {"it never had a track": (2, 8)}}
    assert whole.cpu_s == 2.5
