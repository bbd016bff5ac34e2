"""Blocks that remember, and effects that do, serve all replicas at once: none is split."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pyarrow.compute as pc
import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from dsa_des.replicas.replicas import Failed, Recorded, Replica, run_replicas
from dsa_des.scene.scene import load_scene

#: Each sensor has a tracker of its own, and their tracks are fused.
DISTRIBUTED = """\
extends = "{cueing}"
wires = [
  "traffic -> transform -> gate", "gate -> radar -> fusion -> tracker -> whole",
  "gate -> eo -> other -> second -> whole", "whole -> cues",
  {{ from = "cues", to = "radar", delay_s = 0.5, holds = {{}} }},
]
blocks.other.type = "fusion.pass_through"
blocks.second.type = "tracking.ekf"
blocks.whole.type = "fusion.covariance_intersection"
"""
#: A camera that looks seldom, and noise enough for tracks of it.
NEAR = "blocks.traffic.intruders[0].north_m=6000"
SELDOM = "blocks.eo.scan_rate_hz=4"
SEEN_SOON = [SELDOM, NEAR, "blocks.radar.false_alarm_probability=0.02"]
#: Scene, length in s, what is set, and the table in which every replica has something.
SCENES = {
    "alerts of tracks": ("avoidance/crossing_tracked.toml", "8", [
        "blocks.traffic.intruders[0].east_m=2600", "blocks.traffic.intruders[0].north_m=2000",
    ], "alerts"),
    "cues of tracks": ("tracking/cueing.toml", "7", [
        *SEEN_SOON,
    ], "cues"),
    "navigation errors": ("systems/tecvol.toml", "6", [], "detections"),
    "declaration by place": ("tracking/cueing.toml", "5", [
        SELDOM, NEAR, 'blocks.radar.declare_by="place"', "blocks.radar.false_alarm_probability=0.4",
        "blocks.radar.declare_m=2", "blocks.eo.declare_m=2", "blocks.eo.declare_n=3",
    ], "detections"),
    "a sweeping beam": ("avoidance/crossing.toml", "10", [
        "blocks.traffic.intruders[0].east_m=2200", "blocks.traffic.intruders[0].north_m=1700",
        "blocks.radar.beam_sweep=true", "blocks.radar.measures_range_rate=true",
        "blocks.avoidance.pause_s=2",
    ], "manoeuvres"),
    "what aircraft broadcast": ("surveillance/ads_b.toml", "8", [], "detections"),
    "a camera that weighs motion": ("first_light.toml", "5", [
        "blocks.eo.dynamic_weight=20", "blocks.traffic.intruders[0].north_m=3000",
    ], "detections"),
}  # fmt: skip


@pytest.mark.parametrize("name", list(SCENES))
def test_one_block_serves_all(name):
    path, duration_s, sets, table = SCENES[name]
    scene = load_scene(f"configs/{path}", duration_s=duration_s, sets=sets)
    scenes = replicas_of(scene, {}, {})
    assert not same_as_alone(scenes, window=11).timeline.split
    _, tables = tables_of(scenes)
    assert len({*tables[table]["replica"].to_pylist()}) == 2


def test_flights_over_terrain():
    """Each is checked to stay above it, and one that does not fails by itself."""
    sets = ["terrain.height_m=900", "blocks.radar.enabled=false"]  # whose clutter asks as well
    scene = load_scene("configs/first_light.toml", duration_s="5", sets=sets)
    own = "blocks.traffic.ownship.alt_m"
    good = replicas_of(scene, {own: 950}, {own: 1050})
    simulation = same_as_alone(good)
    assert list(simulation.timeline.together) == ["traffic"]
    one, other = run_replicas(scene, [Replica(1, {own: 950}), Replica(1, {own: 850})])
    assert isinstance(one, Recorded)
    assert isinstance(other, Failed) and "must be below the ownship" in other.error


@pytest.mark.parametrize("closed", [True, False])
def test_the_tracks_of_two_trackers_are_fused_together(tmp_path, closed):
    """In a loop all runs go side by side; without one they come one after the other."""
    path = tmp_path / "distributed.toml"
    cueing = Path("configs/tracking/cueing.toml").resolve()
    text = DISTRIBUTED.format(cueing=cueing)
    if not closed:
        text = "\n".join(line for line in text.splitlines() if "holds" not in line)
    path.write_text(text, encoding="utf-8")
    rates = ["blocks.radar.scan_rate_hz=1", "blocks.eo.scan_rate_hz=1"]
    dwell = [] if closed else ["blocks.radar.cued_dwell_factor=1"]
    scene = load_scene(path, duration_s="8", sets=[*SEEN_SOON[1:], *rates, *dwell])
    late = [
        replace(wire, jitter_s=Fraction(2, 5)) if wire.source == "second" else wire
        for wire in scene.wires
    ]
    # Half a second at a time, some of them tell nothing.
    phases = [
        {f"blocks.{sensor}.offset_s": Fraction(tenths, 10) for sensor in ("radar", "eo")}
        for tenths in (1, 6, 2)
    ]
    scenes = replicas_of(replace(scene, wires=late), *phases)
    simulation = same_as_alone(scenes, window=11)
    assert not simulation.timeline.split
    assert (simulation.runs.going == range(3)) == closed
    _, tables = tables_of(scenes)
    fused = tables["state_tracks"].filter(pc.equal(tables["state_tracks"]["block"], "whole"))
    assert len({*fused["replica"].to_pylist()}) == 3


#: Pilots tell nobody.
OPEN = """\
extends = "{tracked}"
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
  "radar -> fusion", "eo -> fusion", "ir -> fusion", "fusion -> tracker -> alerting",
  "traffic -> alerting -> pilot", "traffic -> true_alerting",
]
"""


@pytest.mark.parametrize("closed", [True, False])
def test_alerts_of_tracks_at_instants_of_their_own(tmp_path, closed):
    """In some stretches of time only some replicas have scans; or one lasts for several windows."""
    name, _, sets, _ = SCENES["alerts of tracks"]
    path = Path("configs", name)
    if not closed:
        path = tmp_path / "open.toml"
        path.write_text(OPEN.format(tracked=Path("configs", name).resolve()), encoding="utf-8")
        # Its first scans in a window rest on what came in the one before.
        seen = [f"blocks.{name}.offset_s=0.5" for name in ("radar", "eo", "ir")]
        sets = [*sets, *seen, "blocks.alerting.scan_rate_hz=5"]
    scene = load_scene(path, duration_s="7", sets=sets)
    phases = [{"blocks.alerting.offset_s": Fraction(tenths, 10)} for tenths in (1, 6, 2)]
    scenes = replicas_of(scene, *phases)
    simulation = same_as_alone(scenes, window=None if closed else 2)
    assert (simulation.runs.going == range(3)) == closed
    assert not simulation.timeline.split


def test_what_was_measured_in_a_run_that_has_ended_is_in_no_gate_of_the_next():
    """Each run goes through several windows, and they run one after the other."""
    scene = load_scene("configs/systems/tecvol_tracked.toml", duration_s="6")
    simulation = same_as_alone(replicas_of(scene, {}, {}, {}), window=9)
    assert simulation.runs.going == range(2, 3)


@pytest.mark.parametrize("late", ["rerun", "one_step"])
def test_looks_that_come_late_in_a_loop_are_remembered_by_run(late):
    sets = [f"blocks.tracker.late={late}", "blocks.tracker.lag_s=2"]
    scene = load_scene("configs/avoidance/crossing_tracked.toml", duration_s="8", sets=sets)
    wires = [
        replace(wire, latency_s=Fraction(6, 10), jitter_s=Fraction(1, 2))
        if (wire.source, wire.target) == ("radar", "fusion")
        else wire
        for wire in scene.wires
    ]
    simulation = same_as_alone(replicas_of(replace(scene, wires=wires), {}, {}, {}))
    assert not simulation.timeline.split
    assert len(simulation.runs.going) == 3
    assert simulation.components["tracker"]._past
