"""Encounters of a study are made once each, however many a chunk of it holds."""

from collections import Counter
from typing import Any

import pytest
from wired import chain, sensor

import dsa_des
from components.encounters import encounter_traffic
from components.encounters.encounter_traffic import MadeTogether
from dsa_des.replicas import lock_step_size
from tests.encounters.test_pairing import GAS

RUNS = 1300


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> dict[str, Counter[Any]]:
    """How often the encounter of each number was drawn, and flown."""
    count: dict[str, Counter[Any]] = {"_PAIRS": Counter(), "_FLIGHTS": Counter()}
    for name, of in count.items():
        make = getattr(encounter_traffic, name)._make

        def counted(keys: list[Any], make: Any = make, of: Counter[Any] = of) -> Any:
            of.update(int(key[0].numbers[key[1]]) if len(key) == 3 else key[1] for key in keys)
            return make(keys)

        monkeypatch.setattr(encounter_traffic, name, MadeTogether(counted))
    return count


def test_a_chunk_beyond_any_cache_makes_each_encounter_once(
    made: dict[str, Counter[Any]], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 1,300 runs in one chunk, 650 of which run together; then the metrics ask again."""
    monkeypatch.setattr(lock_step_size.RunSize, "largest_run_count", 1024)
    scene = chain({"radar": sensor("radar.range_boundary", scan_rate_hz=1)}, duration_s=1)
    (tmp_path / "model.txt").write_text(GAS, encoding="utf-8")
    scene["blocks"]["traffic"] = {
        "type": "traffic.encounter_model", "file": str(tmp_path / "model.txt"),
        "lat_deg": 52, "lon_deg": 4,
    }  # fmt: skip
    assert not lock_step_size.surely_fit_in_memory(dsa_des.load_scene(scene), RUNS)
    study = dsa_des.study(
        scene, metrics=["encounter_weight", "closest_approach"], replicas=RUNS, workers=1,
        draws={"blocks.traffic.encounter": {"sequence": [0, 1]}}, runs_per_chunk=RUNS,
    )  # fmt: skip
    assert study.runs["status"].to_pylist() == ["done"] * RUNS
    for of in made.values():
        assert set(of) == set(range(RUNS))
        # The first two and the last are looked at when the study is checked, before anything runs,
        # and the first of a lock step by itself, before those that lie together with it
        # (two or three: what a run records is known from those that ran before).
        again = {number for number, many in of.items() if many > 1}
        assert {0, RUNS - 1} <= again and len(again - {0, 1, RUNS - 1}) <= 2
        assert max(of.values()) <= 3


def test_a_batch_is_kept_whole_and_then_forgotten() -> None:
    asked: list[list[int]] = []
    squares = MadeTogether(lambda keys: asked.append(keys) or [key**2 for key in keys])
    squares.prepare(range(5000))
    assert [squares[key] for key in (0, 4999, 7)] == [0, 4999**2, 49]
    assert squares[-3] == 9 and squares[4999] == 4999**2
    squares.prepare(range(4990, 5010))
    assert squares[4995] == 4995**2 and squares[0] == 0
    assert asked == [list(range(5000)), [-3], list(range(5000, 5010)), [0]]
