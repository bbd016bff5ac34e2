"""Who is left out around an ownship that is steered: nobody in reach, and nothing else changes."""

import math

import numpy as np
import pytest

from components.flights.culling import SHORTEST_EPOCH_S, SteeredCulling
from components.flights.many_flights import SteeredFleet
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight
from components.messages.steering import Manoeuvre
from components.messages.targets import TrafficStates
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "configs/benchmark/manoeuvres.toml"


def flight(name, lat_deg, lon_deg, heading_deg, speed_mps):
    return ScriptedTrajectory(
        name, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=1000.0, heading_deg=heading_deg,
        speed_mps=speed_mps,
    )  # fmt: skip


def near(culling, own, times):
    """Return which targets may be in reach of one ownship at times, (times, targets)."""
    return culling.own_states_and_near_mask(own, np.zeros(len(times), dtype=np.int64), times)[1]


@pytest.mark.parametrize(("seed", "reach_m"), [(1, 8000.0), (2, 2000.0), (3, 40_000.0)])
def test_whoever_is_in_reach_is_near(seed, reach_m):
    draw = np.random.default_rng(seed)
    targets = [
        flight(f"t{i}", 52 + draw.uniform(-0.4, 0.4), 4 + draw.uniform(-0.6, 0.6),
               draw.uniform(0, 360), draw.uniform(0, 250))
        for i in range(60)
    ]  # fmt: skip
    fleet = ScriptedFleet(targets)
    own = SteeredFleet(ScriptedFleet([flight("own", 52.0, 4.0, 20.0, 70.0)]))
    culling = SteeredCulling(own, fleet, reach_m, 1000.0)
    assert culling.epoch_s[0] >= SHORTEST_EPOCH_S
    in_reach = left_out = 0
    now = 0.0
    for _ in range(12):
        later = now + draw.uniform(1.0, 60.0)
        times = np.sort(draw.uniform(now, later, 40))
        whole = near(culling, own, times)
        here, there = own[0].at(times), fleet.at(times)
        _, _, range_m = line_of_sight(
            here.lat_deg[:, None], here.lon_deg[:, None], here.alt_m[:, None],
            there.lat_deg, there.lon_deg, there.alt_m,
        )  # fmt: skip
        assert not (~whole & (range_m <= reach_m)).any()
        in_reach += (range_m <= reach_m).sum()
        left_out += (~whole).sum()
        for row in (0, 17):  # an instant alone says the same
            alone = near(culling, own, times[row : row + 1])
            assert alone.tolist() == whole[row : row + 1].tolist()
        turn = Manoeuvre(math.radians(draw.uniform(-170, 170)), math.radians(3.0))
        own = own.add_manoeuvres(np.array([0]), np.array([later]), [turn])
        culling.forget_ranges_from(0, later)
        assert own[0].max_speed_mps < 70.0 * 1.01
        now = later
    assert in_reach > 0
    assert left_out > 0


def test_what_was_known_of_a_later_time_is_forgotten_at_a_turn():
    # As when a run looked ahead and goes back: beyond the turn nothing is as it was.
    draw = np.random.default_rng(4)
    targets = [
        flight(f"t{i}", -43 + draw.uniform(-0.4, 0.4), 172 + draw.uniform(-0.6, 0.6),
               draw.uniform(0, 360), draw.uniform(0, 250))
        for i in range(80)
    ]  # fmt: skip
    before = SteeredFleet(ScriptedFleet([flight("own", -43.0, 172.0, 217.0, 90.0)]))
    times = np.arange(0.0, 300.0, 7.0)
    turned = before.add_manoeuvres(np.array([0]), np.array([40.0]), [Manoeuvre(math.pi, 0.05)])
    looked_ahead, fresh = (
        SteeredCulling(before, ScriptedFleet(targets), 9000.0, 300.0) for _ in "ab"
    )
    straight = near(looked_ahead, before, times)
    looked_ahead.forget_ranges_from(0, 40.0)
    whole = near(looked_ahead, turned, times)
    assert whole.tolist() == near(fresh, turned, times).tolist()
    assert (straight[times > 40.0] != whole[times > 40.0]).any()


def test_leaving_out_changes_nothing_but_the_counts():
    # Twice the 21.4 km at which the electro-optical camera, whose signatures are noisy, may detect.
    sets = ["blocks.avoidance.pause_s=20", "blocks.traffic.radius_km=43"]
    scene = load_scene(SCENE, sets=sets, duration_s="150")

    def run(**options):
        sink, moved = MemorySink(), [0]

        class Counting(Recorder):
            def record(self, block, message):
                if isinstance(message, TrafficStates):
                    moved[0] += message.lat_deg.size
                super().record(block, message)

        Simulation(scene, recorder=Counting([sink]), **options).run()
        return sink.tables(), moved[0]

    planned, cells = run()
    whole, all_cells = run(simulate_everything=True)
    assert cells < 0.7 * all_cells
    assert planned["manoeuvres"].num_rows > 2
    for name in ("detections", "fused", "tracks", "manoeuvres"):
        assert planned[name].equals(whole[name]), name
    counts = [c for c in whole["scans"].column_names if c.startswith("skipped_")]
    for tables in (planned, whole):
        total = sum(np.array(tables["scans"][c]) for c in [*counts, "evaluated"])
        assert (total == 100).all()


def test_whoever_comes_in_reach_of_an_ownship_that_was_told_to_fly_faster_is_near():
    """Four times as fast as it was: 40 of some 1,900 were left out by its speed at the start."""
    left_out = in_reach = 0
    for seed in range(6):
        draw = np.random.default_rng(seed)
        targets = [
            flight(f"t{i}", 52 + draw.uniform(-0.4, 0.4), 4 + draw.uniform(-0.6, 0.6),
                   draw.uniform(0, 360), draw.uniform(0, 60))
            for i in range(200)
        ]  # fmt: skip
        fleet = ScriptedFleet(targets)
        own = SteeredFleet(ScriptedFleet([flight("own", 52.0, 4.0, 20.0, 40.0)]))
        culling = SteeredCulling(own, fleet, 3000.0, 200.0)
        faster = Manoeuvre(speed_mps=130.0, acceleration_mps2=3.0)
        own = own.add_manoeuvres(np.array([0]), np.array([5.0]), [faster])
        times = np.arange(6.0, 200.0, 0.5)
        whole = near(culling, own, times)
        here, there = own[0].at(times), fleet.at(times)
        _, _, range_m = line_of_sight(
            here.lat_deg[:, None], here.lon_deg[:, None], here.alt_m[:, None],
            there.lat_deg, there.lon_deg, there.alt_m,
        )  # fmt: skip
        left_out += (~whole & (range_m <= 3000.0)).sum()
        in_reach += (range_m <= 3000.0).sum()
    assert in_reach > 1000 and left_out == 0
