"""Replicas in lock step record what each would record by itself, to the bit."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pyarrow.compute as pc
import pytest

from dsa_des.lockstep import LockStep, NotInLockStep
from dsa_des.randomness import Streams
from dsa_des.recording import MemorySink, Recorder
from dsa_des.replica_streams import ReplicaStreams
from dsa_des.replica_time import first_scan
from dsa_des.replicas import Failed, Recorded, Replica, run_replicas, scene_of
from dsa_des.scene import load_scene
from dsa_des.simulation import Simulation

FIRST_LIGHT = "configs/first_light.toml"
OFFSETS = (
    {},
    {"blocks.radar.offset_s": Fraction(1, 7 * 2**6)},
    {"blocks.ir.offset_s": Fraction(3, 8)},
)


def variants(scene, changes=OFFSETS, seed=40):
    fine = [
        {key: Fraction(int(value * 10**9), 10**9) for key, value in change.items()}
        for change in changes
    ]
    return [scene_of(scene, Replica(seed + i, change)) for i, change in enumerate(fine)]


def recorded(simulation_type, scenes, **kwargs):
    sink = MemorySink()
    simulation = simulation_type(scenes, recorder=Recorder([sink]), **kwargs)
    simulation.run()
    return simulation, sink.tables()


def assert_equal_to_separate_runs(scenes, **kwargs):
    simulation, together = recorded(LockStep, scenes, **kwargs)
    rows = 0
    for number, scene in enumerate(scenes):
        _, alone = recorded(Simulation, scene)
        for table, wanted in alone.items():
            got = together[table].filter(pc.equal(together[table]["replica"], number))
            assert got.drop_columns(["replica"]).combine_chunks().equals(wanted), (number, table)
            rows += wanted.num_rows
    assert rows == sum(table.num_rows for table in together.values()) > 0
    return simulation


@pytest.mark.parametrize("window", [None, 50])
def test_other_seeds_and_offsets(window):
    scene = load_scene(FIRST_LIGHT, duration_s="70")
    simulation = assert_equal_to_separate_runs(variants(scene), window=window)
    assert not simulation.split


@pytest.mark.parametrize(
    "sets",
    [
        ["blocks.radar.declare_m=2", "blocks.radar.declare_n=3"],
        ["blocks.eo.dynamic_weight=0.5"],
        ["navigation.position_noise_m=[5,5,3]", "navigation.attitude_noise_deg=[0.1,0.1,0.2]"],
        ["blocks.radar.jitter_s=0.01", "blocks.eo.rate_error_ppm=300"],
        ["blocks.radar.latency_s=0.05", "blocks.fusion.coincidence_s=0.2"],
        ["blocks.radar.false_alarms=true", "blocks.radar.false_alarm_probability=1e-5"],
        ["blocks.traffic.update_rate_hz=3"],
        ["blocks.tracker.drop_after_s=1.5", "blocks.radar.beam_sweep=true"],
    ],
)
def test_effects_that_remember_or_draw(sets):
    scene = load_scene(FIRST_LIGHT, sets=sets, duration_s="40")
    assert_equal_to_separate_runs(variants(scene))


def test_traffic_that_differs_is_split():
    scene = load_scene(FIRST_LIGHT, duration_s="60")
    changes = [{}, {"blocks.traffic.intruders[0].east_m": 900}]
    simulation = assert_equal_to_separate_runs(variants(scene, changes))
    assert list(simulation.split) == ["traffic"]


def test_random_traffic_is_drawn_from_each_seed():
    scene = load_scene("configs/benchmark/clocks.toml", duration_s="30")
    assert_equal_to_separate_runs(variants(scene))


@pytest.mark.parametrize(
    ("sets", "what"),
    [
        (["wires[4]={from='radar', to='fusion', drop_probability=0.1}"], "loses"),
        (["processors.gpu.service_s=0.01", "blocks.eo.processor=gpu"], "scan by scan"),
    ],
)
def test_what_cannot_run_together_says_so(sets, what):
    scene = load_scene(FIRST_LIGHT, sets=sets[:1] if "wires" not in sets[0] else [])
    if "wires" in sets[0]:
        wires = [replace(w, drop_probability=0.1) if w.source == "eo" else w for w in scene.wires]
        scene = replace(scene, wires=wires)
    else:
        scene = load_scene(FIRST_LIGHT, sets=sets)
    with pytest.raises(NotInLockStep, match=what):
        LockStep([scene, scene])


def test_aircraft_that_differ_are_refused_not_mixed():
    scene = load_scene(FIRST_LIGHT, duration_s="20")
    changes = [{}, {"blocks.traffic.intruders[0].rcs_dbsm": 20.0}]
    scenes = [scene_of(scene, Replica(1, change)) for change in changes]
    with pytest.raises(NotInLockStep, match="differs between replicas"):
        recorded(LockStep, scenes)
    # They run all the same, one by one.
    outcomes = run_replicas(scene, [Replica(1, change) for change in changes])
    assert all(isinstance(outcome, Recorded) for outcome in outcomes)
    _, alone = recorded(Simulation, scenes[1])
    assert len(outcomes[1].tables["detections"]["tick"]) == alone["detections"].num_rows


def test_a_bad_replica_leaves_the_others_alone():
    scene = load_scene(FIRST_LIGHT, duration_s="20")
    outcomes = run_replicas(
        scene, [Replica(1), Replica(2, {"blocks.radar.scan_rate_hz": -1}), Replica(3)]
    )
    assert [type(outcome) for outcome in outcomes] == [Recorded, Failed, Recorded]


def test_each_replica_draws_with_its_own_seed():
    seeds = [5, 6, 7]
    stream = ReplicaStreams(seeds).stream("radar", "detection")
    scans = np.arange(10)
    for number, seed in enumerate(seeds):
        own = Streams(seed).stream("radar", "detection")
        for draw in (stream.uniform, stream.normal):
            got = draw(np.uint64(9), scans + first_scan(number), 3)
            assert np.array_equal(got, getattr(own, draw.__name__)(np.uint64(9), scans, 3))
