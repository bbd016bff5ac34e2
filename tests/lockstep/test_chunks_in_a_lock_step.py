"""Chunks are what is written at once; the lock steps that their runs share are another size."""

import gc
import io
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pyarrow.parquet as pq
import pytest
from lab import CONFIGS

from dsa_des.errors import SceneError
from dsa_des.replicas import lock_step_size, replicas
from dsa_des.replicas.lock_step_size import RunSize, surely_fit_in_memory
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.results.folder import failure_counts_of_part
from dsa_des.scene.scene import load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies import attempts
from dsa_des.studies.attempts import group_chunks
from dsa_des.studies.chunk import ChunkResult, run_chunk, run_chunks
from dsa_des.studies.study import Chunk, Study
from dsa_des.studies.study_file import study_of_tables

RUNS = 10


def study(per_chunk: int, runs: int = RUNS, **more: Any) -> Study:
    """Encounters in a closed loop that is over before most of them see anybody."""
    tables = {
        "replicas": runs, "runs_per_chunk": per_chunk, "metrics": ["risk_ratio"],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}}, **more,
    }  # fmt: skip
    scene = read_scene_file(CONFIGS / "benchmark" / "closed_loop_risk.toml")
    return study_of_tables(tables, scene, (), [("duration_s", 4), ("blocks.radar.range_km", 16)])


def run_all(one: Study, chunks: Sequence[Chunk]) -> list[ChunkResult]:
    return [done for some in group_chunks(one, chunks, 1) for done in run_chunks(one, some)]


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many runs each lock step held."""
    sizes: list[int] = []

    def noted(scenes: Sequence[Any], **how: Any) -> Any:
        sizes.append(len(scenes))
        return make_lockstep_simulation(scenes, **how)

    monkeypatch.setattr(replicas, "make_lockstep_simulation", noted)
    return sizes


def test_chunks_of_any_size_share_lock_steps_and_have_the_bytes_of_each_alone(
    shared: list[int],
) -> None:
    rows = []
    for per_chunk in (4, RUNS):
        of_size = study(per_chunk)
        chunks = list(of_size.chunks(0, [0]))
        del shared[:]
        parts = run_all(of_size, chunks)
        assert shared == [RUNS]
        assert [part.content for part in parts] == [run_chunk(of_size, c).content for c in chunks]
        assert [part.runs for part in parts] == [len(chunk) for chunk in chunks]
        tables = [pq.read_table(io.BytesIO(part.content)) for part in parts]
        rows.append([row for table in tables for row in table.to_pylist()])
        said = [failure_counts_of_part(table) for table in tables]
        if per_chunk == 4:  # what each lacked is its own
            assert len({str(one) for one in said}) == 3
    assert rows[0] == rows[1]


def test_lock_steps_hold_what_memory_does_and_each_about_as_many(
    shared: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock_step_size, "FEW", 0)
    monkeypatch.setattr(lock_step_size.RunSize, "largest_run_count", 4)
    whole = run_all(one := study(RUNS), list(one.chunks(0, [0])))
    assert shared == [4, 3, 3]
    del shared[:]
    parts = run_all(one := study(2), list(one.chunks(0, [0])))
    assert shared == [4, 2, 4]
    tables = [pq.read_table(io.BytesIO(part.content)).to_pylist() for part in [*whole, *parts]]
    assert tables[0] == [row for table in tables[1:] for row in table]


def test_a_run_holds_about_what_it_is_taken_for() -> None:
    """Of the benchmark's `risk`, whole: what more runs in a lock step hold more at its peak."""
    one = study(1, 96, set={"duration_s": 180, "blocks.radar.range_km": 8})
    scene, peaks = one.scene(0), list[int]()
    replicas.run_replicas(scene, [one.replica(k) for k in range(2)], wanted={})
    tracemalloc.start()
    try:
        for count in (32, 96):
            some = [one.replica(k) for k in range(count)]
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            with_flights: Any = replicas.make_lockstep_simulation(
                replicas.replica_scenes(scene, some)
            )
            tracemalloc.reset_peak()
            with_flights.run()
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
            del with_flights
            gc.collect()
    finally:
        tracemalloc.stop()
    assert scene.duration_s == 180
    assert peaks[1] - peaks[0] == pytest.approx(64 * RunSize.estimate(scene, {}).held, rel=0.4)


def test_a_lock_step_of_many_aircraft_holds_as_many_fewer_runs() -> None:
    """Two and nine aircraft; columns hold 8 bytes at each scan of each target."""
    aircraft = ", ".join(
        f"{{name='{k}', east_m={99 * k}, north_m=3000, heading_deg=180, speed_mps=60}}"
        for k in range(8)
    )
    sets = (f"blocks.traffic.intruders=[{aircraft}]",)
    few, crowd = (
        load_scene(CONFIGS / "avoidance" / "crossing_tracked.toml", sets=some, duration_s="60")
        for some in ((), sets)
    )
    two, nine = (RunSize.estimate(scene, {}) for scene in (few, crowd))
    assert (nine.held, nine.recorded) == (4.5 * two.held, 0.0)
    assert nine.largest_run_count == int(360e6 / nine.held)
    wide = RunSize.estimate(crowd, {"tracks": ("tick", "range_m")})
    scans = wide.recorded / (8 * 2 * 8)
    assert scans == int(scans) > 60
    told = RunSize.estimate(crowd, {"manoeuvres": ("tick", "turn_rad")})
    assert told.recorded == wide.recorded / 8  # a row for all of them
    limited = replace(wide, recorded=1e6)
    assert wide.largest_run_count == nine.largest_run_count
    assert limited.largest_run_count == int(360e6 / 2.4e6)
    assert surely_fit_in_memory(crowd, 64) and not surely_fit_in_memory(crowd, 65)


def test_every_worker_has_about_as_much() -> None:
    one = study(1, 24)
    chunks = list(one.chunks(0, [0]))
    for workers in (1, 2, 3):
        sizes = [len(some) for some in group_chunks(one, chunks, workers)]
        assert sizes == [24 // workers] * workers


def test_cells_without_a_loop_and_single_chunks_are_run_as_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    two = study(4, 8, axes={"blocks.radar.scan_rate_hz": [1, 2]})
    chunks = list(two.chunks(0, [0, 1]))
    assert [len(some) for some in group_chunks(two, chunks, 1)] == [2, 2]  # a cell each
    for broken in (lambda scene: set(), _refused):
        monkeypatch.setattr(attempts, "longest_delay_cut_edges", broken)
        assert [len(some) for some in group_chunks(two, chunks, 1)] == [1] * 4
    assert list(group_chunks(two, chunks[:1], 8)) == [(chunks[0],)]
    assert list(group_chunks(two, [], 8)) == []


def _refused(scene: Any) -> Any:
    raise SceneError(["a reason"])


def test_runs_that_are_not_next_to_each_other_share_a_lock_step_too(shared: list[int]) -> None:
    """As those do that crashed, and are run again."""
    one = study(RUNS)
    some = [Chunk("a", ((0, 0, 2), (0, 5, 6))), Chunk("b", ((0, 9, 11),))]
    parts = run_chunks(one, some)
    assert shared == [5]
    assert [part.content for part in parts] == [run_chunk(one, chunk).content for chunk in some]
