"""A replica is the run that the scene file would give with its seed and values written in."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dsa_des.block.message import Text
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.replicas import Failed, Recorded, reason_against_lock_step, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene


def recorded(scene: Scene) -> dict[str, dict[str, object]]:
    sink = ColumnSink()
    Simulation(scene, recorder=Recorder([sink])).run()
    return sink.tables()  # type: ignore[return-value]


def same(one: object, other: object) -> bool:
    if isinstance(one, Text) and isinstance(other, Text):
        return [one.names[c] if c >= 0 else None for c in one.codes] == [
            other.names[c] if c >= 0 else None for c in other.codes
        ]
    a, b = np.asarray(one), np.asarray(other)
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


CHANGES = [
    ({}, []),
    ({"blocks.radar.offset_s": Fraction(1, 7)}, ['blocks.radar.offset_s="1/7"']),
    ({"blocks.traffic.intruders[0].east_m": -40.5}, ["blocks.traffic.intruders[0].east_m=-40.5"]),
    ({"blocks.radar.latency_s": 0.02}, ["blocks.radar.latency_s=0.02"]),
    ({"duration_s": 4, "weather.rain_rate_mm_h": 5}, ["duration_s=4", "weather.rain_rate_mm_h=5"]),
    ({"blocks.radar.azimuth_deg": [-60, 60]}, ["blocks.radar.azimuth_deg=[-60, 60]"]),
]


@pytest.mark.parametrize(("changes", "sets"), CHANGES, ids=lambda item: str(item)[:40])
def test_a_replica_is_a_run_of_its_own(
    small: Path, changes: dict[str, object], sets: list[str]
) -> None:
    base = load_scene("small.toml")
    found = run_replicas(base, [Replica(7, changes), Replica(8, changes)])
    for seed, run in zip((7, 8), found, strict=True):
        assert isinstance(run, Recorded)
        alone = recorded(load_scene("small.toml", sets=sets, seed=seed))
        assert run.tables.keys() == alone.keys()
        for table, columns in alone.items():
            assert columns.keys() == run.tables[table].keys()
            for name, values in columns.items():
                assert same(values, run.tables[table][name]), (table, name)


def test_wanted_columns_are_the_same_as_when_all_are_recorded(small: Path) -> None:
    base = load_scene("small.toml")
    (everything,) = run_replicas(base, [Replica(7)])
    (part,) = run_replicas(base, [Replica(7)], wanted={"fused": ("tick", "target")})
    assert isinstance(everything, Recorded) and isinstance(part, Recorded)
    assert list(part.tables) == ["fused"] and set(part.tables["fused"]) == {"tick", "target"}
    for name, values in part.tables["fused"].items():
        assert same(values, everything.tables["fused"][name])
    assert part.report()["targets"]["one"]["closest_approach"]["range_m"] > 0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("blocks.radar.ofset_s", 1, "did you mean 'offset_s'?"),
        ("blocks.rader.offset_s", 1, "did you mean 'blocks.radar'?"),
        ("blocks.radar.offset_s", -1, "must be greater than or equal to 0"),
        ("blocks.traffic.intruders[3].east_m", 1, "the list has 1"),
        ("weathr.rain_rate_mm_h", 1, "is no key of this scene"),
        ("seed", 3, "cannot be drawn: every replica has a seed of its own"),
        ("wires[0].delay_s", 3, "cannot be drawn: wires are the same in all replicas"),
        ("blocks.radar.scan_rate_hz", Fraction(10**25 + 7, 10**24 + 9), "no common tick"),
    ],
)
def test_a_wrong_change_fails_its_own_replica(
    small: Path, key: str, value: object, message: str
) -> None:
    base = load_scene("small.toml")
    good, bad = run_replicas(base, [Replica(1), Replica(1, {key: value})])
    assert isinstance(good, Recorded) and isinstance(bad, Failed)
    assert message in bad.error
    with pytest.raises(SceneError):
        replica_scene(base, Replica(1, {key: value}))


def test_drawn_targets_run_one_by_one_and_it_is_said(small: Path) -> None:
    base = load_scene("small.toml")
    seen = [Replica(k, {"blocks.traffic.intruders[0].contrast": float(k)}) for k in (1, 2)]
    assert "what block traffic tells its neighbours" in (reason_against_lock_step(base, seen) or "")
    for key in ("rcs_dbsm", "east_m"):
        where = [Replica(k, {f"blocks.traffic.intruders[0].{key}": float(k)}) for k in (1, 2)]
        assert reason_against_lock_step(base, where) is None
