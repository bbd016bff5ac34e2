"""Blocks that remember, and effects that do, serve all replicas at once: none is split."""

import pytest

from dsa_des.replicas.lockstep import lock_step
from dsa_des.scene.scene import load_scene

#: Scene, length in s, what is set, and the table in which every replica has something.
SCENES = {
    "alerts of tracks": ("avoidance/crossing_tracked.toml", "8", [
        "blocks.traffic.intruders[0].east_m=2600", "blocks.traffic.intruders[0].north_m=2000",
    ], "alerts"),
    "cues of tracks": ("tracking/cueing.toml", "7", [
        "blocks.eo.scan_rate_hz=4", "blocks.radar.false_alarm_probability=0.02",
        "blocks.traffic.intruders[0].north_m=7000",
    ], "cues"),
    "navigation errors": ("systems/tecvol.toml", "6", [], "detections"),
    "declaration by place": ("tracking/cueing.toml", "5", [
        "blocks.eo.scan_rate_hz=4", "blocks.radar.false_alarm_probability=0.02",
        "blocks.traffic.intruders[0].north_m=6000", 'blocks.radar.declare_by="place"',
    ], "detections"),
    "a sweeping beam": ("avoidance/crossing.toml", "10", [
        "blocks.traffic.intruders[0].east_m=2200", "blocks.traffic.intruders[0].north_m=1700",
        "blocks.radar.beam_sweep=true", "blocks.radar.measures_range_rate=true",
        "blocks.avoidance.pause_s=2",
    ], "manoeuvres"),
    "a camera that weighs motion": ("first_light.toml", "5", [
        "blocks.eo.dynamic_weight=20", "blocks.traffic.intruders[0].north_m=3000",
    ], "detections"),
}  # fmt: skip


@pytest.mark.parametrize("name", list(SCENES))
def test_one_block_serves_all(lock, name):
    path, duration_s, sets, table = SCENES[name]
    scene = load_scene(f"configs/{path}", duration_s=duration_s, sets=sets)
    scenes = lock.replicas_of(scene, {}, {})
    assert not lock.same_as_alone(scenes, window=11).timeline.split
    _, tables = lock.tables_of(lock_step, scenes)
    assert len({*tables[table]["replica"].to_pylist()}) == 2
