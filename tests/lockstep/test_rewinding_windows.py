"""In a feedback loop, looking ahead and going back records what scan by scan records."""

from pathlib import Path

import pytest
from same_runs import tables_of

from dsa_des.errors import BlockFailure
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.loops import loop_cut_edges
from dsa_des.running.simulation import Simulation
from dsa_des.scene.graph import build_graph
from dsa_des.scene.scene import load_scene

SCENE = "configs/benchmark/manoeuvres.toml"
MANY = "blocks.traffic.intruders=30"


@pytest.mark.parametrize(
    "sets",
    [
        [MANY],
        ["blocks.avoidance.pause_s=7", "blocks.traffic.intruders=20"],
        [MANY, "blocks.avoidance.pause_s=0.9", "blocks.avoidance.turn_deg=2"],
        [MANY, "blocks.avoidance.range_km=0.001"],
    ],
)
def test_any_window_gives_the_same_rows(sets):
    scene = load_scene(SCENE, sets=sets, duration_s="90")
    _, scan_by_scan = tables_of(scene, window=1)
    for window in (None, 64):
        simulation, tables = tables_of(scene, window=window)
        assert all(node.windowed for node in simulation.nodes.values())
        for table, rows in scan_by_scan.items():
            assert tables[table].equals(rows), (window, table)
    if "range_km" not in str(sets):
        assert scan_by_scan["manoeuvres"].num_rows > 1


def test_windows_are_few_when_what_comes_back_is_regular():
    scene = load_scene(SCENE, sets=[MANY], duration_s="600")
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
    from components.flights.many_flights import SteeredFleet

    scene = load_scene(SCENE, sets=[MANY], duration_s="90")
    _, expected = tables_of(scene)
    first_turn_s = expected["manoeuvres"]["time_s"][0].as_py() + 0.5
    straight = SteeredFleet.each

    def refuse_to_go_straight(self, aircraft, time_s, known=None):
        if not self.manoeuvre_count.any() and (time_s > first_turn_s + 1.0).any():
            raise RuntimeError("nobody flies here")
        return straight(self, aircraft, time_s, known)

    monkeypatch.setattr(SteeredFleet, "each", refuse_to_go_straight)
    _, tables = tables_of(scene)
    assert all(tables[name].equals(rows) for name, rows in expected.items())


def test_a_failure_that_happens_is_reported(monkeypatch):
    from components.tracking.stub import TrackerStub

    scene = load_scene(SCENE, sets=[MANY], duration_s="90")
    track = TrackerStub.run

    def fails(self, wake):
        if wake.ticks[-1] >= 40 * 10**9:
            raise RuntimeError("out of tracks")
        return track(self, wake)

    monkeypatch.setattr(TrackerStub, "run", fails)
    with pytest.raises(BlockFailure, match="out of tracks") as caught:
        tables_of(scene)
    assert "t = 40.000 s" in str(caught.value)


def test_loops_are_cut_where_an_input_can_be_done_without():
    scene = load_scene(SCENE)
    assert loop_cut_edges(scene.graph, scene.classes) == {("avoidance", "traffic")}
    open_loop = [wire for wire in scene.wires if wire.source != "avoidance"]
    graph = build_graph(list(scene.blocks), open_loop)
    assert loop_cut_edges(graph, scene.classes) == set()


CUED = "configs/tracking/cueing.toml"


BEHIND = """
extends = "{cued}"
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "radar -> fusion",
  "eo -> fusion", "fusion -> tracker -> cues", "fusion -> behind",
  {{ from = "cues", to = "radar", delay_s = 0.5, holds = {{}} }},
]
[blocks.behind]
type = "tracking.ekf"
"""


@pytest.fixture
def cued(tmp_path):
    """A cue loop, with another tracker behind it."""
    path = tmp_path / "scene.toml"
    path.write_text(BEHIND.format(cued=Path(CUED).resolve()), encoding="utf-8")
    sets = ["blocks.eo.scan_rate_hz=4", "blocks.traffic.intruders[0].north_m=9000"]
    return load_scene(path, sets=sets, duration_s="14")


def failing_from(monkeypatch, block, time_s):
    """Let a type of block fail at its first instant from a time on."""
    runs = block.run

    def run(self, wake):
        if (wake.time_s >= time_s).any():
            raise RuntimeError("not any longer")
        return runs(self, wake)

    monkeypatch.setattr(block, "run", run)


def test_blocks_that_no_loop_leads_to_run_ahead(cued):
    """Few long windows for them, and those of the delay for the loop; the rows are the same."""
    _, scan_by_scan = tables_of(cued, window=1)
    calls = dict.fromkeys(("traffic", "gate", "eo", "radar", "tracker", "cues"), 0)

    class Counted(Simulation):
        def run_window(self, window):
            found = super().run_window(window)
            for name in calls:
                node = self.nodes[name]
                calls[name] += node._window_end(window) > window.start
            return found

    simulation = Counted(cued, recorder=Recorder([sink := MemorySink()]))
    simulation.run()
    assert all(sink.tables()[name].equals(rows) for name, rows in scan_by_scan.items())
    assert scan_by_scan["state_tracks"].num_rows > 20
    assert calls["traffic"] == calls["gate"] == calls["eo"] == 1
    assert calls["radar"] == calls["tracker"] == calls["cues"] >= 14 / 0.5


@pytest.mark.parametrize(
    ("gate_s", "cues_s", "said"),
    [(9.0, 6.0, "cues .* t = 6.0"), (9.0, 99.0, "gate .* t = 9.0"), (6.0, 9.0, "gate .* t = 6.0")],
)
def test_who_runs_ahead_fails_when_its_time_has_come(cued, monkeypatch, gate_s, cues_s, said):
    """What fails first in simulated time counts, however far others had run ahead."""
    from components.gate import Gate
    from components.tracking.cues import Cues

    failing_from(monkeypatch, Gate, gate_s)
    failing_from(monkeypatch, Cues, cues_s)
    with pytest.raises(BlockFailure, match=said):
        tables_of(cued)
