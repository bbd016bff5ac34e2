"""What blocks remember of replicas whose instants differ, and what they report of each."""

from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from components.alerting.believed_tracks import BelievedTracks
from components.alerting.memory import LevelMemory, MemoryRule
from components.alerting.others_tracks import OthersTracks
from components.estimation.motion import ConstantVelocity
from components.messages.detections import Detections
from components.sensor.declaration import DeclaredPlaces
from components.tracking.stub import TrackerStub
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Replica, replica_scene
from dsa_des.scene.scene import load_scene

SETS = [
    "blocks.eo.scan_rate_hz=4", "blocks.traffic.intruders[0].north_m=6000",
    'blocks.radar.declare_by="place"', "blocks.radar.false_alarm_probability=0.4",
    "blocks.radar.declare_m=2", "blocks.radar.declare_n=4", "blocks.radar.scan_rate_hz=1",
]  # fmt: skip

OVER = {"type": "encounters.closest_approach_passed", "after_s": 2}
WIRES = """\
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
  "radar -> fusion", "eo -> fusion", "ir -> fusion", "fusion -> tracker", "traffic -> over",
]
"""


def test_places_of_a_replica_that_has_no_scan_for_a_while():
    """Half a second at a time; the first replica is the one that is left out at first."""
    scene = load_scene("configs/tracking/cueing.toml", duration_s="5", sets=SETS)
    phases = [{"blocks.radar.offset_s": Fraction(tenths, 10)} for tenths in (7, 1, 6)]
    scenes = replicas_of(scene, *phases)
    assert not same_as_alone(scenes, window=11).timeline.split
    _, tables = tables_of(scenes)
    found = tables["detections"].to_pylist()
    mine = [row["declared"] for row in found if row["block"] == "radar" and row["replica"] == 0]
    assert {*mine} == {True, False}


def seen_at(run, scan, number):
    """A report of rows of (run, scan), each with one place of some number, at a second a scan."""
    value, none = 0.5 * number, np.full(len(run), np.nan)
    return Detections(
        tick=scan, scan=scan, run=run, evaluated=np.ones(len(run), int), skipped={},
        offsets=np.arange(len(run) + 1), target=np.full(len(run), -1), azimuth_rad=value,
        elevation_rad=0.0 * value, range_m=none, confidence=value, true_azimuth_rad=value,
        true_elevation_rad=value, true_range_m=value, extras={},
        roster=SimpleNamespace(names=()),
    )  # fmt: skip


def test_places_are_remembered_run_by_run():
    """A place seen twice in five scans is declared; scans of runs have numbers far apart."""
    rule = SimpleNamespace(declare_m=2, declare_n=5, declare_speed_m_s=50.0, declare_rate_deg_s=5.0)
    judge = DeclaredPlaces(SimpleNamespace(p=rule, context=SimpleNamespace(ticks_per_s=1)))
    draws, seen, declared = np.random.default_rng(4), {}, []
    for window in range(40):
        which = [r for r in range(3) if draws.random() < 0.6] or [1]
        run = np.repeat(which, 2)
        scan = 2 * window + 100 * (2 - run) + np.tile([0, 1], len(which))
        number = draws.integers(0, 6, len(run))
        found = judge(seen_at(run, scan, number), None, None).extras["declared"]
        for r, s, k, said in zip(*map(np.ndarray.tolist, (run, scan, number, found)), strict=True):
            before = [seen.get((r, s - back)) for back in (1, 2, 3, 4)]
            assert said == (k in before), (window, r)
            seen[r, s] = k
            declared.append(said)
    assert 20 < sum(declared) < len(declared) - 20


def test_a_track_is_named_by_where_the_targets_are_at_that_instant():
    """Two targets change places from one look to the next."""
    others = OthersTracks(frozenset(), 0.9999, ConstantVelocity(4.0), (0.0, 0.0, 0.0))
    tracks = BelievedTracks(2, others)
    here, there = [0.0, 0.0, 0.0], [500.0, 0.0, 0.0]
    tracks.add_truth(
        RunTicks.of_run(0, np.array([10, 20, 30])),
        np.array([1.0, 2.0, 3.0]),
        np.array([[here, there], [there, here], [here, there]]),
    )  # fmt: skip
    now = RunTicks.of_run(0, np.array([10, 15, 20, 29, 30]))
    named = tracks._nearest_target(now, np.full((5, 3), 10.0))
    assert named.tolist() == [0, 0, 1, 1, 0]


@pytest.mark.parametrize(
    ("times_s", "left"), [((3.0, 14.0), 2), ((3.0, 12.0), 3), ((9.0, 12.0), 2)]
)
def test_tracks_are_gone_by_the_time_of_their_own_run(times_s, left):
    """A run is at 0 s when another one is at 8 s, and a third has no scan at all."""
    memory = LevelMemory(MemoryRule(hysteresis_s=5.0, persistence_s=0.0, m=0, n=1))
    due = np.ones((3, 2), dtype=bool)
    memory.update_levels(np.array([0, 1, 2]), np.full(3, 7), np.array([0.0, 8.0, 0.0]), due, due)
    memory.forget_absent(np.array([0, 1]), np.array(times_s))
    assert len(memory) == left


class OfAStranger(TrackerStub):
    """Knows nothing of replicas, and reports how long its run was."""

    def report(self):
        return {"lasted_s": {"here": float(self.context.duration_s)}}


def test_each_of_split_blocks_reports_of_its_own_length(tmp_path):
    extended = str(Path("configs/benchmark/monte_carlo.toml").resolve())
    kinds = {"over": OVER, "tracker": {"type": f"{__name__}:OfAStranger"}}
    text = to_toml({"extends": extended, "duration_s": 40, "blocks": kinds})
    text = text.replace("[blocks", f"{WIRES}\n[blocks", 1)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    near = ["blocks.traffic.intruders[0].north_m=1300"]
    base, told = load_scene(tmp_path / "scene.toml", sets=near), {}
    rules = [{"blocks.over.after_s": Fraction(after_s)} for after_s in (2, 5, 300)]
    simulation = make_lockstep_simulation(
        [replica_scene(base, Replica(4 + k, rule)) for k, rule in enumerate(rules)],
        report=lambda number, said: told.update({(number, *said): said}) if said else None,
    )
    simulation.run()
    assert "tracker" in simulation.timeline.split
    ends_s = (simulation.runs.ends / simulation.ticks_per_s).tolist()
    assert len({*ends_s}) == 3
    lasted = {key[0]: said["lasted_s"]["here"] for key, said in told.items() if "lasted_s" in said}
    assert lasted == dict(enumerate(ends_s))
