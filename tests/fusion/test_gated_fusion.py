"""`fusion.gated`: what lies close in time and place is put together, whoever it is."""

from types import SimpleNamespace

import numpy as np
import pytest

from components.fusion.gated import Entries, Gates, extrapolate_entries, nearest_in_gate
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "configs/first_light.toml"
SWAP = ["fusion=fusion.gated"]


def report(azimuth_deg, range_m=None):
    azimuth = np.radians(azimuth_deg)
    unknown = np.full(len(azimuth), np.nan)
    return SimpleNamespace(
        azimuth_rad=azimuth,
        elevation_rad=np.zeros(len(azimuth)),
        range_m=unknown if range_m is None else np.array(range_m, dtype=float),
    )


def match(one, ticks, other, other_ticks, gate_ticks=10, angle_deg=2.0, range_gate_m=100.0):
    mine, others = (
        Entries(
            message, np.zeros(len(when), int), np.array(when, int), np.array(when, int),
            np.full((6, len(when)), np.nan),
        )
        for message, when in ((one, ticks), (other, other_ticks))
    )  # fmt: skip
    gates = Gates(gate_ticks, 1 << 40, np.radians(angle_deg), range_gate_m, 1)
    return nearest_in_gate(mine, np.arange(len(ticks)), others, gates).tolist()


def test_gates_of_time_are_inclusive_and_look_back_only():
    mine = report([0.0])
    others = report([0.5])
    assert match(mine, [100], others, [90]) == [0]
    assert match(mine, [100], others, [89]) == [-1]
    assert match(mine, [100], others, [101]) == [-1]
    assert match(mine, [100], report([]), []) == [-1]


def test_the_latest_counts_and_then_the_nearest():
    others = report([0.1, 1.0, -0.5, 3.0])
    assert match(report([0.0]), [100], others, [95, 99, 99, 100]) == [2]
    assert match(report([0.9]), [100], others, [95, 99, 99, 100]) == [1]


def test_gates_of_place():
    assert match(report([179.5]), [0], report([-179.5]), [0]) == [0]  # one degree across ±180
    assert match(report([0.0]), [0], report([2.5]), [0]) == [-1]
    assert match(report([0.0], [1000]), [0], report([0.0], [1150]), [0]) == [-1]
    assert match(report([0.0], [1000]), [0], report([0.0], [1050]), [0]) == [0]
    assert match(report([0.0], [1000]), [0], report([0.0]), [0]) == [0]  # no range: gate open


def entry(azimuth_deg, range_m, made, came, pose, rate_mps=np.nan):
    message = report([azimuth_deg], [range_m])
    message.range_rate_m_s = np.array([rate_mps])
    return Entries(message, *(np.array([n]) for n in (0, made, came)), np.array(pose)[:, None])


def test_who_came_too_long_ago_is_not_gathered_though_measured_in_time():
    still = np.full(6, np.nan)
    one = entry(0.0, 1000.0, 100, 100, still)
    for came, wanted in ((100, 0), (95, 0), (94, -1), (101, -1)):
        other = entry(0.0, 1100.0, 90, came, still)
        gates = Gates(10, 5, np.radians(2.0), 100.0, 5)
        assert nearest_in_gate(one, np.array([0]), other, gates).tolist() == [wanted]
    far = entry(0.0, 1100.5, 90, 100, still)
    assert nearest_in_gate(one, np.array([0]), far, gates).tolist() == [-1]


def test_what_was_measured_earlier_is_carried_by_how_the_ownship_moved():
    """Two seconds earlier, at the equator, where 100 m north are so many degrees."""
    north_deg = np.degrees(100.0 / 6_335_439.327)
    before, turned = np.zeros(6), np.array([0.0, 0.0, 0.0, np.radians(10.0), 0.0, 0.0])
    moved = np.array([north_deg, 0.0, 0.0, 0.0, 0.0, 0.0])
    for azimuth_deg, range_m, after, rate_mps, wanted in (
        (30.0, 1000.0, turned, np.nan, (20.0, 1000.0)),
        (30.0, 1000.0, turned, -50.0, (20.0, 900.0)),
        (0.0, 1000.0, moved, np.nan, (0.0, 900.0)),
        (90.0, 1000.0, moved, np.nan, (90.0 + np.degrees(np.arctan(0.1)), np.hypot(1000.0, 100.0))),
        (
            90.0,
            np.nan,
            moved,
            np.nan,
            (90.0 + np.degrees(np.arctan(0.05)), np.nan),
        ),  # as far as one
        (30.0, 1000.0, np.full(6, np.nan), -50.0, (30.0, 1000.0)),
    ):
        one = entry(0.0, 2000.0, 110, 110, after)
        other = entry(azimuth_deg, range_m, 100, 100, before, rate_mps)
        azimuth, elevation, found_m = extrapolate_entries(
            one, np.zeros(1, int), other, np.zeros(1, int), 5
        )
        np.testing.assert_allclose(
            [np.degrees(azimuth[0]), found_m[0]], wanted, rtol=1e-6, atol=1e-6
        )
        assert abs(elevation[0]) < 1e-5
    same = extrapolate_entries(
        one, np.zeros(1, int), entry(30.0, 7.0, 110, 110, before, 9.0), np.zeros(1, int), 5
    )
    assert [part.tolist() for part in same] == [[np.radians(30.0)], [0.0], [7.0]]


def test_detections_are_kept_as_long_as_others_may_come_late():
    latency = ["blocks.radar.latency_s=0.35", "blocks.fusion.time_gate_s=0.2"]
    simulation = Simulation(load_scene(SCENE, swaps=SWAP, sets=latency))
    fusion = simulation.components["fusion"]
    per_s = fusion.context.ticks_per_s
    assert (fusion.gate_ticks, fusion.keep_ticks) == (0.2 * per_s, 0.55 * per_s)


def tables(window=None, shuffle=None, duration_s=90, **options):
    sink = MemorySink()
    scene = load_scene(SCENE, swaps=SWAP, duration_s=duration_s, **options)
    Simulation(scene, recorder=Recorder([sink]), window=window, shuffle_ties=shuffle).run()
    return sink.tables()


@pytest.mark.parametrize("window", [1, 7, 500])
def test_rows_do_not_depend_on_the_window(window):
    early = {"duration_s": 15, "sets": ["blocks.eo.threshold=0.1"]}
    whole = tables(**early)
    cut = tables(**early, window=window, shuffle=3)
    assert whole["fused"].num_rows > 100
    assert cut["fused"].equals(whole["fused"])
    assert cut["tracks"].equals(whole["tracks"])


def test_the_thesis_scene_is_fused_as_by_targets_that_are_known():
    """The two intruders are far apart, so gates find what pick-best knows."""
    gated = tables()["fused"]
    sink = MemorySink()
    known = load_scene(SCENE, sets=["blocks.fusion.coincidence_s=0.1"], duration_s=90)
    Simulation(known, recorder=Recorder([sink])).run()
    best = sink.tables()["fused"]
    same = set(zip(*(best[c].to_pylist() for c in ("tick", "target", "sensors")), strict=True))
    mine = set(zip(*(gated[c].to_pylist() for c in ("tick", "target", "sensors")), strict=True))
    assert len(same & mine) > 0.98 * len(same | mine)
    assert len(mine) == gated.num_rows  # no detection is reported twice


def test_false_alarms_may_be_gathered_but_bear_no_target():
    loud = tables(sets=["blocks.eo.false_alarms_per_frame=0.5", "blocks.fusion.angle_gate_deg=20"])
    names = loud["fused"]["target"].to_pylist()
    assert None in names and {"head_on", "crossing"} <= set(names)
    alarms = loud["detections"]["target"].to_pylist().count(None)
    assert 0 < names.count(None) < alarms
