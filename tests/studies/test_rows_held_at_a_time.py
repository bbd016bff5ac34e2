"""A chunk whose rows do not fit in memory at once is run in parts, with the same bytes."""

import weakref
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from dsa_des.replicas import lock_step_size
from dsa_des.replicas import replicas as in_lock_step
from dsa_des.replicas.replicas import make_lockstep_simulation, run_replicas
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies import chunk as chunks
from dsa_des.studies.chunk import run_chunk
from dsa_des.studies.metric import Group, measure_one_by_one
from dsa_des.studies.study import Chunk
from dsa_des.studies.study_file import study_of_tables


def test_parts_of_a_chunk_give_its_bytes(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flaw = {"choice": ["none", "none", "raise"]}
    tables = {
        "replicas": 16,
        "metrics": ["first_detection"],
        "draws": {"blocks": {"radar": {"flaw": flaw}}},
    }
    study = study_of_tables(tables, read_scene_file("small.toml"), (), ())
    recorded, measured = list[int](), list[int]()
    simulations, still_there = list[Any](), list[int]()

    def run(scene: Any, replicas: Any, **how: Any) -> Any:
        recorded.append(len(replicas))
        still_there.append(sum(one() is not None for one in simulations))
        return run_replicas(scene, replicas, **how)

    def noted(*given: Any, **how: Any) -> Any:
        simulations.append(weakref.ref(one := make_lockstep_simulation(*given, **how)))
        return one

    def made(*given: Any) -> Group:
        group = Group(*given)
        measured.append(len(group))
        if any(replica.seed % 3 == 0 for replica in group.replicas):
            raise ValueError("threes break")  # of their metrics
        return group

    def broken(scene: Any, metrics: Any, runs: Any) -> Any:
        try:
            return plain(scene, metrics, runs)
        except ValueError as error:
            if len(runs) == 1:
                return {}, {0: str(error)}
            return measure_one_by_one(partial(broken, scene, metrics), runs)

    plain = chunks._measure_metrics
    monkeypatch.setattr(chunks, "run_replicas", run)
    monkeypatch.setattr(chunks, "Group", made)
    monkeypatch.setattr(chunks, "_measure_metrics", broken)
    whole = run_chunk(study, Chunk("part", ((0, 0, 16),)))
    assert recorded == [16] and 0 < whole.failed < 16
    monkeypatch.setattr(lock_step_size, "MOST_BYTES", 300e3)
    monkeypatch.setattr(chunks, "_MANY_RUNS", 2)
    monkeypatch.setattr(in_lock_step, "make_lockstep_simulation", noted)
    chunks._size_of_a_run.clear()
    del recorded[:]
    parts = run_chunk(study, Chunk("part", ((0, 0, 16),)))
    assert parts.content == whole.content
    # By the scans and targets of the scene fewer than all at once, and more than few.
    assert 1 < recorded[0] < 16 and max(recorded[1:]) < 16 and sum(recorded) == 16
    assert max(measured[-len(recorded) :]) < 16
    # Nothing of the part before stands beside the next.
    assert len(simulations) > 1 and set(still_there) == {0}
    # What was learnt holds for the next chunk of the cell.
    del recorded[:]
    run_chunk(study, Chunk("next", ((0, 0, 16),)))
    assert recorded[0] == max(recorded)
