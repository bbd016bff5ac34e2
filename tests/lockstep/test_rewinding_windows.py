"""In a feedback loop, looking ahead and going back records what scan by scan records."""

import pytest

from dsa_des.errors import BlockFailure
from dsa_des.record.recording import MemorySink, Recorder
from dsa_des.running.loops import cut_loops
from dsa_des.running.simulation import Simulation
from dsa_des.scene.graph import build_graph
from dsa_des.scene.scene import load_scene

SCENE = "configs/benchmark/manoeuvres.toml"


def run(scene, **kwargs):
    sink = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([sink]), **kwargs)
    simulation.run()
    return simulation, sink.tables()


@pytest.mark.parametrize(
    "sets",
    [
        [],
        ["blocks.avoidance.pause_s=7", "blocks.traffic.intruders=20"],
        ["blocks.avoidance.pause_s=0.9", "blocks.avoidance.turn_deg=2"],
        ["blocks.avoidance.range_km=0.001"],
    ],
)
def test_any_window_gives_the_same_rows(sets):
    scene = load_scene(SCENE, sets=["blocks.traffic.intruders=30", *sets], duration_s="90")
    _, scan_by_scan = run(scene, window=1)
    for window in (None, 64):
        simulation, tables = run(scene, window=window)
        assert all(node.windowed for node in simulation.nodes.values())
        for table, rows in scan_by_scan.items():
            assert tables[table].equals(rows), (window, table)
    if "range_km" not in str(sets):
        assert scan_by_scan["manoeuvres"].num_rows > 1


def test_windows_are_few_when_what_comes_back_is_regular():
    scene = load_scene(SCENE, sets=["blocks.traffic.intruders=30"], duration_s="600")
    windows = []

    class Counted(Simulation):
        def run_window(self, window):
            windows.append(window.end - window.start)
            return super().run_window(window)

    simulation = Counted(scene, recorder=Recorder([sink := MemorySink()]))
    simulation.run()
    turns = sink.tables()["manoeuvres"].num_rows
    assert turns >= 3
    assert len(windows) < 8 * turns + 8


def test_a_failure_after_a_rewound_instant_never_happened(monkeypatch):
    """A block that only fails on a path that is not flown does not fail."""
    from components.traffic.steered_flight import SteeredFlight

    scene = load_scene(SCENE, sets=["blocks.traffic.intruders=30"], duration_s="90")
    _, expected = run(scene)
    first_turn_s = expected["manoeuvres"]["time_s"][0].as_py() + 0.5
    straight = SteeredFlight.at

    def refuse_to_go_straight(self, time_s):
        if not self.parts and (time_s > first_turn_s + 1.0).any():
            raise RuntimeError("nobody flies here")
        return straight(self, time_s)

    monkeypatch.setattr(SteeredFlight, "at", refuse_to_go_straight)
    _, tables = run(scene)
    assert all(tables[name].equals(rows) for name, rows in expected.items())


def test_a_failure_that_happens_is_reported(monkeypatch):
    from components.tracking.stub import TrackerStub

    scene = load_scene(SCENE, sets=["blocks.traffic.intruders=30"], duration_s="90")
    track = TrackerStub.run

    def fails(self, wake):
        if wake.ticks[-1] >= 40 * 10**9:
            raise RuntimeError("out of tracks")
        return track(self, wake)

    monkeypatch.setattr(TrackerStub, "run", fails)
    with pytest.raises(BlockFailure, match="out of tracks") as caught:
        run(scene)
    assert "t = 40.000 s" in str(caught.value)


def test_loops_are_cut_where_an_input_can_be_done_without():
    scene = load_scene(SCENE)
    assert cut_loops(scene.graph, scene.classes) == {("avoidance", "traffic")}
    open_loop = [wire for wire in scene.wires if wire.source != "avoidance"]
    graph = build_graph(list(scene.blocks), open_loop)
    assert cut_loops(graph, scene.classes) == set()
