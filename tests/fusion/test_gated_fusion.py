"""`fusion.gated`: what lies close in time and place is put together, whoever it is."""

from types import SimpleNamespace

import numpy as np
import pytest

from components.fusion.gated import Entries, Gates, nearest_in_gate
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
