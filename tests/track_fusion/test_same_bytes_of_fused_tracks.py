"""Fused tracks are the same bytes whatever the window and the company."""

import pyarrow.compute as pc

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.replicas.lockstep import lock_step
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

NEARER = [
    "blocks.traffic.intruders.0.north_m=2500", "blocks.traffic.intruders.1.north_m=2000",
    "blocks.traffic.intruders.1.east_m=1500", "blocks.radar.scan_rate_hz=4",
    "blocks.eo.latency_s=0.13",
]  # fmt: skip


def tracks_of(simulation_type, scene, **options):
    sink = MemorySink()
    simulation_type(scene, recorder=Recorder([sink]), **options).run()
    table = sink.tables()["state_tracks"].combine_chunks()
    return table.filter(pc.equal(table["block"], "distributed"))


def test_windows_and_company_change_no_byte():
    scene = load_scene("configs/tracking/architectures.toml", sets=NEARER, duration_s="2")
    alone = tracks_of(Simulation, scene)
    contributors = " ".join(set(alone["contributors"].to_pylist()))
    assert "radar" in contributors and "eo" in contributors
    for window in (1,):
        assert tracks_of(Simulation, scene, window=window).equals(alone), window
    scenes = [scene_of(scene, Replica(scene.seed + i, {})) for i in range(2)]
    for window in (40,):
        together = tracks_of(lock_step, scenes, window=window)
        for number, one in enumerate(scenes):
            mine = together.filter(pc.equal(together["replica"], number))
            mine = mine.drop_columns(["replica"]).combine_chunks()
            assert mine.equals(tracks_of(Simulation, one).combine_chunks()), number
