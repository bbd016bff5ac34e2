"""Every row of a steered flight knows the manoeuvres that have come by its own instant, no others.

The ownship is told to turn hard 0.4 ms after a scan, so that a row that knew it too early, or an
ownship that flew by another one's word, would show.
"""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from wired import chain, rows, run, sensor

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Replica, replica_scene

DELAY_S, REACH_M = "4.0004", 2000.0
#: Straight ahead of the ownship and coming nearer, somewhat above.
AHEAD = {
    **crooked.ROLLING, "east_m": -980.0, "north_m": -1300.0, "up_m": 90.0, "heading_deg": 40.0,
}  # fmt: skip
OWN_VELOCITY = ("own_velocity_north_m_s", "own_velocity_east_m_s", "own_velocity_down_m_s")


def scene(duration_s=11, **radar):
    # The first word comes in the middle of a stretch of time that is worked on at once.
    looks = {"range_km": REACH_M / 1e3, "offset_s": 1, "azimuth_deg": [-180.0, 180.0],
             "elevation_deg": [-90.0, 90.0]}  # fmt: skip
    own = {key: value for key, value in crooked.OWNSHIP.items()
           if key not in ("yaw_deg", "pitch_deg", "roll_deg", "climb_mps")}  # fmt: skip
    found = chain(
        {"radar": sensor("radar.range_boundary", **looks, **radar)},
        ownship=own, targets=[AHEAD], duration_s=duration_s, fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.stub"}, record={"truth": True},
    )  # fmt: skip
    found["blocks"]["avoidance"] = {
        "type": "avoidance.turn_away", "turn_deg": 25, "rate_deg_s": 60, "pause_s": 100,
    }  # fmt: skip
    found["wires"] += ["tracker -> avoidance", {
        "from": "avoidance", "to": "traffic", "delay_s": DELAY_S, "holds": "nothing",
    }]  # fmt: skip
    return found


#: The second ownship flies three times as fast, elsewhere.
CHANGES = ({}, {"blocks.traffic.ownship.speed_mps": 210.0,
                "blocks.traffic.ownship.heading_deg": 207.0})  # fmt: skip


@pytest.fixture(scope="module")
def together():
    """Tables of both replicas, flown together."""
    loaded = dsa_des.load_scene(scene())
    scenes = [replica_scene(loaded, Replica(4 + i, change)) for i, change in enumerate(CHANGES)]
    sink = MemorySink()
    simulation = make_lockstep_simulation(scenes, recorder=Recorder([sink]))
    simulation.run()
    assert len(simulation.runs.going) > 1
    return {name: table.to_pylist() for name, table in sink.tables().items()}


def of(found, replica, table):
    return [row for row in found[table] if row["replica"] == replica]


@pytest.mark.parametrize(("replica", "speed", "heading_deg"), [(0, 70.0, 217.0), (1, 210.0, 207.0)])
def test_the_row_before_a_manoeuvre_flies_straight_on(together, replica, speed, heading_deg):
    """Over a great circle north turns evenly; half a millisecond of the turn would be 6 mm/s."""
    assert [row["time_s"] for row in of(together, replica, "manoeuvres")] == [1.0]
    own = {row["time_s"]: row for row in of(together, replica, "truth") if row["target"] is None}
    motion = {
        time_s: np.array([row["velocity_north_m_s"], row["velocity_east_m_s"]])
        for time_s, row in own.items()
    }
    heading = math.radians(heading_deg)
    straight = speed * np.array([math.cos(heading), math.sin(heading)])
    for time_s in (3.0, 4.0, 5.0):
        bends = motion[time_s] - 2.0 * motion[time_s - 1.0] + motion[time_s - 2.0]
        assert np.linalg.norm(bends) < 3e-4
        assert motion[time_s] == pytest.approx(straight, abs=0.02)
    turned = np.linalg.norm(motion[7.0] - straight)
    assert turned == pytest.approx(2.0 * speed * math.sin(math.radians(12.5)), rel=0.01)


@pytest.mark.parametrize("replica", [0, 1])
def test_who_is_in_reach_of_a_steered_ownship_is_seen(together, replica):
    """By the truth, in which nobody is left out because he is far away."""
    truth = {(row["time_s"], row["target"]): row for row in of(together, replica, "truth")}
    near = set()
    for (time_s, target), row in truth.items():
        if target is not None:
            own = truth[time_s, None]
            places = [[one[key] for key in ("lat_deg", "lon_deg", "alt_m")] for one in (row, own)]
            if np.linalg.norm(pymap3d.geodetic2ned(*places[0], *places[1])) <= REACH_M:
                near.add(time_s)
    assert len(near) > 5
    assert {row["time_s"] for row in of(together, replica, "detections")} == near


def test_range_rates_come_with_the_velocity_of_their_own_row():
    found = run(scene(8, measures_range_rate=True, range_rate_resolution_m_s=0.5))
    own = {row["time_s"]: row for row in rows(found, "truth") if row["target"] is None}
    seen = rows(found)
    assert [row["time_s"] for row in seen] == [float(t) for t in range(1, 8)]
    for row in seen:
        there = own[row["time_s"]]
        for name in OWN_VELOCITY:
            assert row[name] == pytest.approx(there[name.removeprefix("own_")], abs=1e-3)
    turned = np.subtract(*([row[name] for name in OWN_VELOCITY] for row in (seen[-1], seen[0])))
    assert np.linalg.norm(turned) > 25.0
