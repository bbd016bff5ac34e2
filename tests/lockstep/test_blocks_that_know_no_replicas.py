"""A block whose author never heard of replicas gives, among replicas, what it gives by itself."""

from pathlib import Path

import numpy as np
import pytest
from same_runs import same_as_alone

from components.radar.swerling import SwerlingRadar
from components.radar.weather import Rain
from components.tracking.stub import TrackerStub
from dsa_des.arrays.run_ticks import shared_zero_run_numbers
from dsa_des.block.component import Component, Input
from dsa_des.block.entry_points import entry_points_of
from dsa_des.errors import BlockFailure
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

FIRST_LIGHT = "configs/first_light.toml"
WITH_ECHO = """wires = [
    "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "gate -> ir",
    "radar -> fusion", "eo -> fusion", "ir -> fusion", "fusion -> tracker -> echo",
]"""
SOUTH = [
    "blocks.traffic.ownship.heading_deg=217",
    "blocks.traffic.ownship.lat_deg=-33.9",
    "blocks.traffic.intruders[0].north_m=-3000",
    "blocks.traffic.intruders[0].east_m=-2300",
    "blocks.traffic.intruders[0].heading_deg=37",
]


class CountingTracker(TrackerStub):
    """Forgets every track but each third: state in an attribute, of a block that has none."""

    seen = 0

    def run(self, wake):
        tracks = super().run(wake)
        if tracks is None:
            return None
        numbers = self.seen + np.arange(1, len(tracks) + 1)
        self.seen += len(tracks)
        return tracks.take(np.flatnonzero(numbers % 3 == 0))


class TiringRadar(SwerlingRadar):
    """Sees every other scan only."""

    scans = 0

    def run(self, wake):
        sent = super().run(wake)
        if sent is None:
            return None
        numbers = self.scans + np.arange(len(sent))
        self.scans += len(sent)
        return sent.take(np.flatnonzero(numbers % 2 == 0))


class MyRain(Rain):
    """Knows nothing of replicas."""


class WetRadar(SwerlingRadar):
    """Lists an effect of its own, and says nothing of replicas."""

    effects = tuple(MyRain() if type(e) is Rain else e for e in SwerlingRadar.effects)


class Echo(Component):
    """Declares nothing but that it takes windows: sends its tracks on, numbered from 1."""

    inputs = {"tracks": Input(TrackerStub.outputs["tracks"].message, "trigger")}
    outputs = {"tracks": TrackerStub.outputs["tracks"]}
    windowed = True

    def setup(self):
        self.last_s = None

    def run(self, wake):
        tracks = wake["tracks"]
        kept = []
        for row, time_s in enumerate(wake.time_s):
            if self.last_s is None or time_s - self.last_s >= 0.7:
                self.last_s, _ = time_s, kept.append(row)
        return tracks.take(np.array(kept)) if kept else None


@pytest.mark.parametrize(
    ("block", "kind", "sets"),
    [
        ("tracker", CountingTracker, []),
        ("radar", TiringRadar, []),
        ("radar", WetRadar, ["weather.rain_rate_mm_h=8"]),
        ("echo", Echo, []),
    ],
)
@pytest.mark.parametrize("window", [None, 90])
def test_state_of_an_ordinary_block_stays_with_its_replica(tmp_path, block, kind, sets, window):
    path = tmp_path / "scene.toml"
    path.write_text(
        f"""
        extends = "{Path(FIRST_LIGHT).resolve()}"
        {WITH_ECHO if kind is Echo else ""}
        blocks.{block}.type = "{__name__}:{kind.__name__}"
        """
    )
    scene = load_scene(path, sets=[*SOUTH, *sets], duration_s="12")
    scenes = [replica_scene(scene, Replica(seed)) for seed in (3, 4, 5)]
    simulation = same_as_alone(scenes, window=window)
    assert list(simulation.timeline.split) == [block]


class CountingByRun(TrackerStub):
    """Forgets every track but each third of its run."""

    lockstep = True

    def setup(self):
        super().setup()
        self.seen = {}

    def run(self, wake):
        tracks, kept = super().run(wake), []
        for row, run in enumerate([] if tracks is None else tracks.run.tolist()):
            self.seen[run] = self.seen.get(run, 0) + 1
            kept += [row] if self.seen[run] % 3 == 0 else []
        return tracks.take(np.array(kept)) if kept else None


class Unsaid(CountingByRun):
    """Takes rows of its own, and does not say of which runs they are."""

    lockstep = True

    def run(self, wake):
        tracks = super().run(wake)
        return None if tracks is None else tracks.with_runs(shared_zero_run_numbers(len(tracks)))


def with_tracker(tmp_path, kind):
    path = tmp_path / "scene.toml"
    path.write_text(
        f'extends = "{Path(FIRST_LIGHT).resolve()}"\n'
        f'blocks.tracker.type = "{__name__}:{kind.__name__}"\n'
    )
    scene = load_scene(path, sets=SOUTH, duration_s="12")
    return [replica_scene(scene, Replica(seed)) for seed in (3, 4, 5)]


@pytest.mark.parametrize("window", [None, 90])
def test_one_that_serves_all_keeps_what_it_remembers_by_run(tmp_path, window):
    simulation = same_as_alone(with_tracker(tmp_path, CountingByRun), window=window)
    assert not simulation.timeline.split


def test_one_that_serves_all_says_of_which_run_its_rows_are(tmp_path):
    scenes = with_tracker(tmp_path, Unsaid)
    Simulation(scenes[0]).run()
    with pytest.raises(BlockFailure, match=r"tracker.*must say of which run each is"):
        make_lockstep_simulation(scenes).run()


def test_a_subclass_says_for_itself_that_it_serves_all_replicas():
    assert TrackerStub.lockstep
    assert not type("Silent", (TrackerStub,), {}).lockstep
    outspoken = type("Outspoken", (TrackerStub,), {"lockstep": True})
    assert outspoken.lockstep


def test_a_class_speaks_for_those_of_its_package():
    def derived(base, module, **says):
        return type("Derived", (base,), {"__module__": module, **says})

    assert derived(TrackerStub, "components.tracking.other").lockstep
    assert not derived(TrackerStub, "components_of_mine.other").lockstep
    mine = derived(TrackerStub, "mine.trackers", lockstep=True)
    assert derived(mine, "mine.more").lockstep
    assert not derived(mine, "components.tracking.other").lockstep
    silent = derived(TrackerStub, "components.tracking.other", lockstep=False)
    assert not derived(silent, "components.tracking.more").lockstep


def test_no_block_repeats_what_its_base_says_of_replicas():
    for point in entry_points_of().values():
        for cls in point.load().__mro__:
            said = [vars(base)["lockstep"] for base in cls.__mro__ if "lockstep" in vars(base)]
            assert said[:2] != [True, True] or not cls.__module__.startswith("components"), cls


class DrawsOnce(TrackerStub):
    """Says that it serves all, and draws how many of its tracks it forgets when it is set up."""

    lockstep = True

    def setup(self):
        super().setup()
        self.each = 2 + int(5.0 * self.stream("how many").uniform(np.uint64(0), np.int64(0)))

    def run(self, wake):
        tracks = super().run(wake)
        kept = [] if tracks is None else np.flatnonzero(tracks.tick // 10**9 % self.each)
        return tracks.take(kept) if len(kept) else None


class DrawsForAll(TrackerStub):
    """Says that it serves all, and forgets by draws that say nothing of runs."""

    lockstep = True

    def run(self, wake):
        self.stream("forgets").uniform(np.uint64(0), wake.scans)
        return super().run(wake)


def test_who_draws_when_set_up_draws_in_each_replica(tmp_path):
    simulation = same_as_alone(with_tracker(tmp_path, DrawsOnce))
    assert list(simulation.timeline.split) == ["tracker"]


def test_who_does_not_say_of_which_run_it_draws_is_told(tmp_path):
    scenes = with_tracker(tmp_path, DrawsForAll)
    Simulation(scenes[0]).run()
    with pytest.raises(BlockFailure, match=r"tracker.*'forgets'.*several runs.*of_runs"):
        make_lockstep_simulation(scenes).run()
