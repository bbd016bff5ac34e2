"""Replicas that end early record the same together and alone, and cost nothing after their end."""

from pathlib import Path

import numpy as np
import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from components.encounters.ending import ClosestApproachPassed
from dsa_des.errors import SceneError
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Replica, replica_scene, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

CONFIGS = Path("configs").resolve()
SPEED = "blocks.traffic.intruders[0].speed_mps"
CROSSING = """
extends = "{configs}/avoidance/crossing.toml"
duration_s = 45
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
  "radar -> fusion", "eo -> fusion", "ir -> fusion", "fusion -> tracker -> alerting",
  "traffic -> alerting -> avoidance",
  {{ from = "avoidance", to = "traffic", delay_s = 0.5, holds = "nothing" }},
  "traffic -> over",
]
[blocks.over]
type = "{kind}"
after_s = 2
"""
HEAD_ON = """
extends = "{configs}/benchmark/monte_carlo.toml"
duration_s = 40
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
  "radar -> fusion", "eo -> fusion", "ir -> fusion", "fusion -> tracker", "traffic -> over",
]
[blocks.over]
type = "{kind}"
after_s = 3
"""
SLOW = ("eo.scan_rate_hz=2", "radar.scan_rate_hz=1", "ir.scan_rate_hz=1")
OURS = "encounters.closest_approach_passed"
NEAR = {
    CROSSING: (*SLOW, "traffic.intruders[0].east_m=1300", "traffic.intruders[0].north_m=1000"),
    HEAD_ON: (*SLOW, "traffic.intruders[0].north_m=1300"),
}


class OfAStranger(ClosestApproachPassed):
    """Knows nothing of replicas."""


def loaded(tmp_path, text, kind=OURS):
    path = tmp_path / "scene.toml"
    path.write_text(text.format(configs=CONFIGS, kind=kind), encoding="utf-8")
    return load_scene(path, sets=[f"blocks.{key}" for key in NEAR[text]])


@pytest.mark.parametrize(
    ("text", "kind", "window"),
    [(text, kind, window) for text, window in ((CROSSING, None), (HEAD_ON, None), (HEAD_ON, 9))
     for kind in (OURS, f"{__name__}:OfAStranger")],
)  # fmt: skip
def test_replicas_end_by_themselves(tmp_path, text, kind, window):
    scene = loaded(tmp_path, text, kind)
    scenes = replicas_of(scene, {SPEED: 40.0}, {SPEED: 90.0}, {SPEED: 0.0})
    simulation = same_as_alone(scenes, window=window)
    assert (simulation.runs.going.start == 0) == (text is CROSSING or window is None)
    assert ("over" in simulation.timeline.split) == (kind != OURS)
    assert len(set(simulation.runs.ends.tolist())) == 3
    assert simulation.runs.ended_by.keys() >= {0, 1}


def test_a_replica_s_record_says_how_long_it_was(tmp_path):
    scene = loaded(tmp_path, CROSSING)
    replicas = [Replica(k, {SPEED: speed}) for k, speed in enumerate((40.0, 90.0))]
    together = run_replicas(scene, replicas)
    for replica, found in zip(replicas, together, strict=True):
        alone = Simulation(replica_scene(scene, replica))
        assert found.duration_s == alone.run().duration_s == float(alone.duration_s) < 45
        assert found.ended_early
        assert max(found.tables["scans"]["time_s"]) < found.duration_s
        assert found.report() == run_replicas(scene, [replica])[0].report()


def test_what_has_ended_runs_no_more(tmp_path):
    """Rows of replicas that have ended come to no block, and a batch ends with its last."""
    scene = loaded(tmp_path, CROSSING)
    scenes = [replica_scene(scene, Replica(k, {SPEED: v})) for k, v in enumerate((40.0, 90.0))]
    simulation = make_lockstep_simulation(scenes)
    seen = []
    node = simulation.nodes["tracker"]
    runner = node.runner

    class Watching:
        @staticmethod
        def run(wake):
            seen.extend(zip(wake.run.tolist(), wake.time_s.tolist(), strict=True))
            return runner.run(wake)

    node.runner = Watching
    windows = []
    simulation.run(windows.append)
    ends_s = simulation.runs.ends / simulation.ticks_per_s
    for number in (0, 1):
        # What is behind the end in the window in which it came is not run either.
        assert max(t for r, t in seen if r == number) < ends_s[number]
    assert windows[-1] - 0.5 <= max(ends_s) <= windows[-1] < 45


@pytest.mark.parametrize("options", [{"window": 2, "shuffle_ties": 3}, {"window": 31}])
@pytest.mark.parametrize("text", [CROSSING, HEAD_ON], ids=["closed", "open"])
def test_a_single_run_ends_at_the_same_tick_in_any_window(tmp_path, text, options):
    scene = loaded(tmp_path, text)
    one, first = tables_of(scene)
    other, second = tables_of(scene, **options)
    assert one.runs.ends.tolist() == other.runs.ends.tolist() < [one.runs.run_ticks]
    assert first == second


def test_what_is_under_way_at_the_end_does_not_come(tmp_path):
    """Messages are under way for a second: some would come at the very end, others later."""
    text = HEAD_ON
    for source, target in (("radar", "fusion"), ("fusion", "tracker")):
        wire = f'{{{{ from = "{source}", to = "{target}", delay_s = 1 }}}}'
        text = text.replace(f'"{source} -> {target}"', wire)
    text += (
        '[blocks.fusion]\ntype = "fusion.pass_through"\n[blocks.tracker]\ntype = "tracking.ekf"\n'
    )
    NEAR[text] = NEAR[HEAD_ON]
    scene = loaded(tmp_path, text)
    scenes = replicas_of(scene, {SPEED: 40.0}, {SPEED: 90.0})
    simulation = same_as_alone(scenes)
    together = make_lockstep_simulation(scenes)
    fusion = together.nodes["fusion"]
    came, runner = [], fusion.runner

    class Watching:
        @staticmethod
        def run(wake):
            came.extend(
                together.runs.is_before_ends(new.instants) for new in wake.arrivals("detections")
            )
            return runner.run(wake)

    fusion.runner = Watching
    together.run()
    assert np.concatenate(came).all()
    assert simulation.runs.early
    one, first = tables_of(scene)
    assert first["state_tracks"].num_rows > 0
    _, second = tables_of(scene, window=1)
    assert first == second
    assert one.recorder.rows == {name: table.num_rows for name, table in first.items()}


def test_an_end_in_a_loop_is_the_same_in_any_window(tmp_path):
    """An end that was found in a window that is undone does not count."""
    text = HEAD_ON.replace(
        '"fusion -> tracker"',
        '"fusion -> tracker -> avoidance", '
        '{{from = "avoidance", to = "traffic", delay_s = 1, holds = "nothing"}}',
    )
    text = text + '\n[blocks.avoidance]\ntype = "avoidance.turn_away"\nrange_km = 1\n'
    NEAR[text] = NEAR[HEAD_ON]
    scene = loaded(tmp_path, text)
    plain, short = Simulation(scene), Simulation(scene, window=1)
    assert plain.run().duration_s == short.run().duration_s < 40
    assert plain.runs.ended_by == {0: "over"}


def test_a_host_is_told_that_it_ends_its_runs_itself(tmp_path):
    from dsa_des.embed.host_driven import HostDriven

    with pytest.raises(SceneError, match=r"blocks\.over: it ends its run"):
        HostDriven(loaded(tmp_path, HEAD_ON), "traffic")
