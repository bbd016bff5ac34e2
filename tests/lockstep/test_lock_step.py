"""Replicas in lock step record what each would record by itself, to the bit."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from same_runs import same_as_alone, tables_of

from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import NotInLockStep, make_lockstep_simulation
from dsa_des.replicas.replicas import Failed, Recorded, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

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
    return [replica_scene(scene, Replica(seed + i, change)) for i, change in enumerate(fine)]


@pytest.mark.parametrize("window", [None, 50])
def test_other_seeds_and_offsets(window):
    scene = load_scene(FIRST_LIGHT, duration_s="70")
    simulation = same_as_alone(variants(scene), window=window)
    assert not simulation.timeline.split


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
    same_as_alone(variants(scene))


def test_traffic_that_differs_is_flown_together():
    scene = load_scene(FIRST_LIGHT, duration_s="60")
    changes = [{}, {"blocks.traffic.intruders[0].east_m": 900}]
    simulation = same_as_alone(variants(scene, changes))
    assert list(simulation.timeline.together) == ["traffic"]
    assert not simulation.timeline.split


def test_traffic_that_is_asked_for_other_instants_is_flown_together_too():
    scene = load_scene(FIRST_LIGHT, duration_s="20", sets=["blocks.radar.beam_sweep=true"])
    changes = [{}, {"blocks.traffic.intruders[0].east_m": 900}]
    simulation = same_as_alone(variants(scene, changes))
    assert list(simulation.timeline.together) == ["traffic"]
    assert not simulation.timeline.split


def test_random_traffic_is_drawn_from_each_seed():
    scene = load_scene("configs/benchmark/clocks.toml", duration_s="30")
    same_as_alone(variants(scene))


def test_wires_that_lose_and_delay_rows():
    scene = load_scene(FIRST_LIGHT, duration_s="20")
    wires = [
        replace(wire, drop_probability=0.2, jitter_s=Fraction(3, 10))
        if wire.source in ("eo", "radar", "traffic")
        else wire
        for wire in scene.wires
    ]
    scene = replace(scene, wires=wires)
    for window in (None, 7):
        same_as_alone(variants(scene), window=window)


def test_shared_processors_are_refused_by_name():
    sets = ["processors.gpu.service_s=0.01", "blocks.eo.processor=gpu"]
    scene = load_scene(FIRST_LIGHT, sets=sets)
    with pytest.raises(NotInLockStep, match="shared processors"):
        make_lockstep_simulation([scene, scene])


def test_aircraft_that_differ_are_refused_not_mixed():
    scene = load_scene(FIRST_LIGHT, duration_s="20")
    changes = [{}, {"blocks.traffic.intruders[0].contrast_ir": 0.5}]
    scenes = [replica_scene(scene, Replica(1, change)) for change in changes]
    with pytest.raises(NotInLockStep, match="differs between replicas"):
        tables_of(scenes)
    # They run all the same, one by one.
    outcomes = run_replicas(scene, [Replica(1, change) for change in changes])
    assert all(isinstance(outcome, Recorded) for outcome in outcomes)
    _, alone = tables_of(scenes[1])
    assert len(outcomes[1].tables["detections"]["tick"]) == alone["detections"].num_rows


def test_targets_whose_radar_cross_sections_differ_run_together():
    sets = ["blocks.radar.swerling=1", "blocks.radar.losses_db=12"]
    scene = load_scene(FIRST_LIGHT, duration_s="60", sets=sets)
    changes = [{"blocks.traffic.intruders[0].rcs_dbsm": rcs} for rcs in (-12.0, 3.0, 20.0)]
    scenes = [replica_scene(scene, Replica(1, change)) for change in changes]
    same_as_alone(scenes)
    # Only the cross-section differs: with all draws the same, a larger one is seen more often.
    seen = [sum(tables_of(one)[1]["scans"]["detected"].to_pylist()) for one in scenes]
    assert seen == sorted(seen) and seen[0] < seen[2]


def test_a_message_that_comes_after_the_end_comes_in_no_replica():
    """A wire may take longer than the run and the gap to the next replica together."""
    for delay_s in (2, 3, 4.3, 5, 9, 20):
        scene = load_scene(FIRST_LIGHT, duration_s="2", sets=[f"blocks.radar.latency_s={delay_s}"])
        replicas = [Replica(seed) for seed in range(4)]
        same_as_alone([replica_scene(scene, replica) for replica in replicas])


def test_a_block_that_never_runs_has_its_say():
    """The radar never scans; but switched on it asks for farther targets than the others do."""
    far = [
        "blocks.radar.offset_s=100", "blocks.radar.range_km=30", "blocks.ir.range_km=3",
        "blocks.eo.range_km=3", "blocks.traffic.intruders[0].north_m=9000",
    ]  # fmt: skip
    scene = load_scene(FIRST_LIGHT, duration_s="5", sets=far)
    for first in (True, False):
        changes = [{"blocks.radar.enabled": first}, {"blocks.radar.enabled": not first}]
        replicas = [Replica(1, change) for change in changes]
        scenes = [replica_scene(scene, replica) for replica in replicas]
        with pytest.raises(NotInLockStep, match="block radar asks for something else"):
            tables_of(scenes)
        # They run all the same, one by one; and what they count differs.
        culled = []
        for one, outcome in zip(scenes, run_replicas(scene, replicas), strict=True):
            _, alone = tables_of(one)
            counts = outcome.tables["scans"]["skipped_culled"]
            assert counts.tolist() == alone["scans"]["skipped_culled"].to_pylist()
            culled.append(counts.sum())
        assert culled[0] != culled[1]


@pytest.mark.parametrize("first", [True, False])
def test_replicas_that_record_other_columns_run_as_they_do_alone(first):
    """A radar that is off asks for nothing, sweeping or not; but a sweep has columns of its own."""
    scene = load_scene(FIRST_LIGHT, duration_s="2", sets=["blocks.radar.enabled=false"])
    replicas = [Replica(1, {"blocks.radar.beam_sweep": sweeps}) for sweeps in (first, not first)]
    with pytest.raises(NotInLockStep, match="block radar records something else"):
        tables_of([replica_scene(scene, replica) for replica in replicas])
    swept = []
    for replica, together in zip(replicas, run_replicas(scene, replicas), strict=True):
        (alone,) = run_replicas(scene, [replica])
        columns = {table: list(values) for table, values in together.tables.items()}
        assert columns == {table: list(values) for table, values in alone.tables.items()}
        swept.append("own_lat_deg" in columns["detections"])
    assert swept == [first, not first]


def test_a_block_that_never_runs_reports():
    scene = load_scene(FIRST_LIGHT, duration_s="5")
    for key in ("radar", "eo", "ir"):
        scene = replica_scene(scene, Replica(1, {f"blocks.{key}.offset_s": 100}))
    change = {"blocks.traffic.ownship.heading_deg": 3.0}
    scenes = [
        replica_scene(scene, Replica(seed, change if seed == 3 else {})) for seed in (1, 2, 3)
    ]
    found = {}
    make_lockstep_simulation(
        scenes, report=lambda number, report: found.update({number: report})
    ).run()
    for number, one in enumerate(scenes):
        alone = Simulation(one).run().report
        assert found[number]["targets"] == alone["targets"]


def test_replicas_whose_line_of_sight_rests_on_where_their_own_traffic_is(tmp_path):
    """[accuracy] lets the transform choose by the traffic's envelope, which the seed decides."""
    path = tmp_path / "scene.toml"
    path.write_text(
        f"""
        extends = "{Path(FIRST_LIGHT).resolve()}"
        duration_s = 3
        accuracy = {{ angle_deg = 0.03, range_m = 20 }}
        blocks.radar.range_km = 3
        blocks.eo.range_km = 1
        blocks.ir.range_km = 1
        [blocks.traffic]
        type = "traffic.random"
        intruders = 2
        radius_km = 3
        ownship = {{ lat_deg = 60, lon_deg = 4, alt_m = 1000, speed_mps = 50 }}
        altitude_spread_m = 2000
        """
    )
    scene = load_scene(path)
    replicas = [Replica(seed) for seed in range(8)]
    outcomes = run_replicas(scene, replicas)
    models, rows = set(), 0
    for replica, outcome in zip(replicas, outcomes, strict=True):
        simulation, alone = tables_of(replica_scene(scene, replica))
        models.add(simulation.components["transform"].rung.earth)
        wanted = alone["detections"]["true_azimuth_rad"].to_pylist()
        assert outcome.tables["detections"]["true_azimuth_rad"].tolist() == wanted
        rows += len(wanted)
    assert len(models) > 1
    assert rows > 0


def test_a_bad_replica_leaves_the_others_alone():
    scene = load_scene(FIRST_LIGHT, duration_s="20")
    outcomes = run_replicas(
        scene, [Replica(1), Replica(2, {"blocks.radar.scan_rate_hz": -1}), Replica(3)]
    )
    assert [type(outcome) for outcome in outcomes] == [Recorded, Failed, Recorded]


def test_each_replica_draws_with_its_own_seed():
    seeds = [5, 6, 7]
    stream = Streams(seeds).stream("radar", "detection")
    scans = np.arange(10)
    for number, seed in enumerate(seeds):
        own = Streams(seed).stream("radar", "detection")
        mine = stream.of_runs(np.full(10, number))
        for draw in (mine.uniform, mine.normal):
            got = draw(np.uint64(9), scans, 3)
            assert np.array_equal(got, getattr(own, draw.__name__)(np.uint64(9), scans, 3))
