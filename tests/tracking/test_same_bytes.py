"""Trackers record the same bytes whatever the window, the company and the names of targets."""

import pyarrow as pa
import pyarrow.compute as pc
import pytest

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.replicas.lockstep import lock_step
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

KINDS = {
    "ekf": ["tracker=tracking.ekf"],
    "nearest": ["tracker=tracking.ekf", "blocks.tracker.association='nearest'"],
    "ukf": ["tracker=tracking.ukf"],
    "imm": ["tracker=tracking.imm", "blocks.tracker.models=['velocity','turn','acceleration']"],
    # Detections fall beside the gates of tracks that company would have gone through again.
    "jpda": ["tracker=tracking.imm", "blocks.tracker.association='jpda'",
             "navigation.attitude_noise_deg=[0.3,0.3,0.3]"],
}  # fmt: skip
NEARER = [
    "blocks.traffic.intruders.0.north_m=4000", "blocks.traffic.intruders.1.north_m=3500",
    "blocks.traffic.intruders.1.east_m=3000", "blocks.radar.false_alarms=true",
    "blocks.radar.false_alarm_probability=1e-6",
    "blocks.eo.false_alarms_per_frame=0.3",
    "blocks.eo.latency_s=0.13",
]  # fmt: skip


def scene_with(kind, *sets, fusion="fusion.pass_through", duration_s="4"):
    swap, *more = KINDS[kind]
    swaps = [swap, f"fusion={fusion}"]
    return load_scene(
        "configs/first_light.toml", swaps=swaps, sets=[*NEARER, *more, *sets],
        duration_s=duration_s,
    )  # fmt: skip


def tracks_of(simulation_type, scene, **options):
    sink = MemorySink()
    simulation_type(scene, recorder=Recorder([sink]), **options).run()
    return sink.tables()["state_tracks"].combine_chunks()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_windows_and_company_change_no_byte(kind):
    scene = scene_with(kind, duration_s="3")
    alone = tracks_of(Simulation, scene)
    assert {"confirmed"} <= set(alone["track_status"].to_pylist())
    for window in (1, 7) if kind == "ekf" else (1,):
        assert tracks_of(Simulation, scene, window=window).equals(alone), window
    scenes = [
        scene_of(scene, Replica(scene.seed + i, {})) for i in range(3 if kind == "ekf" else 2)
    ]
    each = [alone, *(tracks_of(Simulation, one) for one in scenes[1:])]
    for window in (None, 40) if kind == "ekf" else (40,):
        together = tracks_of(lock_step, scenes, window=window)
        for number, expected in enumerate(each):
            mine = together.filter(pc.equal(together["replica"], number))
            mine = mine.drop_columns(["replica"]).combine_chunks()
            assert mine.equals(expected), number


def test_tracks_know_nothing_of_the_roster(monkeypatch):
    """Targets are renumbered, and all that is true is replaced, before the tracker sees it."""
    from components.tracking.filters import ExtendedKalman

    scene = scene_with("ekf")
    known = tracks_of(Simulation, scene)
    original = ExtendedKalman.run

    def blind(self, wake):
        fused, rows = wake._held["fused"]
        fused = fused.take(slice(0, len(fused)))
        wake._held = {"fused": (_relabelled(fused), rows)}
        return original(self, wake)

    monkeypatch.setattr(ExtendedKalman, "run", blind)
    assert tracks_of(Simulation, scene).equals(known)


def _relabelled(fused):
    from copy import copy

    other = copy(fused)
    other.target = -7 - fused.target
    other.roster = None
    for name in ("true_azimuth_rad", "true_elevation_rad", "true_range_m"):
        setattr(other, name, None)
    return other


def test_what_the_old_name_builds_is_the_same_block():
    scenes = [
        load_scene("configs/first_light.toml", swaps=[f"tracker={name}"], duration_s="3")
        for name in ("tracking.stub", "tracking.hold_last")
    ]
    sinks = [MemorySink() for _ in scenes]
    for scene, sink in zip(scenes, sinks, strict=True):
        Simulation(scene, recorder=Recorder([sink])).run()
    assert isinstance(sinks[0].tables()["tracks"], pa.Table)
    assert sinks[0].tables()["tracks"].equals(sinks[1].tables()["tracks"])
