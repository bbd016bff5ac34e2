"""Multirotors that tell each other where they are and steer by velocities (``avoidance.mvp``)."""

import math
from pathlib import Path

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.running.nodes import demands_of_clocks_downstream
from dsa_des.running.simulation import Simulation

SCENE = "configs/platforms/velocities.toml"


def scene(**keys):
    return replica_scene(dsa_des.load_scene(SCENE), Replica(1, {"duration_s": 30, **keys}))


def of_block(table, name):
    return [row for row in table.to_pylist() if row["block"] == name]


def rows(scene, name="avoidance"):
    return of_block(tables_of(scene)[1]["manoeuvres"], name)


@covers("position_m", "velocity_mps", of=("surveillance.exchange",))
def test_fixes_err_as_told_and_all_hear_the_same():
    exact = {f"blocks.exchange{s}.{key}": 0 for s in ("", "_b")
             for key in ("position_m", "velocity_mps")}  # fmt: skip
    told = [of_block(tables_of(scene(**keys))[1]["alerts"], "exchange") for keys in (exact, {})]
    # Without errors a closest approach of 0 in 70 s and 50 m; with them 1 and 2 times σ.
    first = told[0][0]
    assert first["closest_horizontal_m"] == pytest.approx(0.0, abs=0.1)
    assert first["time_to_closest_s"] == pytest.approx(70 + 50 / (10.2889 * math.sqrt(2)), abs=0.1)
    assert np.std([row["closest_horizontal_m"] for row in told[1]]) > 5.0


def test_relative_fixes_are_opposite_to_each_other_and_normal():
    """The 95th percentile of radial errors: of 600 pairs' sums, √2 times a single one's."""
    found = {}
    keys = {"duration_s": 60}
    keys |= {f"blocks.exchange{s}.scan_rate_hz": 10 for s in ("", "_b")}
    for name, (position_m, speed_mps) in {"exact": (0, 0), "noisy": (30, 3)}.items():
        both = {f"blocks.exchange{s}.position_m": position_m for s in ("", "_b")}
        both |= {f"blocks.exchange{s}.velocity_mps": speed_mps for s in ("", "_b")}
        found[name] = _relative(
            keys
            | both
            | {"blocks.avoidance.lookahead_s": 1e-3, "blocks.avoidance_b.lookahead_s": 1e-3}
        )
    ours, theirs = found["noisy"]
    np.testing.assert_allclose(ours, -theirs, rtol=1e-3, atol=0.2)  # in axes of two places
    errors = ours - found["exact"][0]
    position, velocity = np.hypot(*errors[:2]), np.hypot(*errors[2:])
    assert np.mean(position < 30 * math.sqrt(2)) == pytest.approx(0.95, abs=0.025)
    assert np.mean(velocity < 3 * math.sqrt(2)) == pytest.approx(0.95, abs=0.025)
    steps = errors[:, 1:] * errors[:, :-1]
    assert (np.abs(steps.mean(axis=1)) < 4 * errors.var(axis=1) / math.sqrt(599)).all()


def _relative(keys):
    simulation = Simulation(scene(**keys))
    heard = {"avoidance": [], "avoidance_b": []}
    for name, mine in heard.items():
        component = simulation.nodes[name].component
        run = component.run

        def tapped(wake, run=run, mine=mine):
            mine.append(wake["alerts"])
            return run(wake)

        component.run = tapped
    simulation.run()
    names = ("east_m", "north_m", "east_mps", "north_mps")
    return [
        np.array([np.concatenate([one.relative[n] for one in mine]) for n in names])
        for mine in heard.values()
    ]


@covers("radius_m", "margin", "lookahead_s", "most_mps", "acceleration_mps2", "speed_mps",
        of=("avoidance.mvp",))  # fmt: skip
def test_each_key_of_the_potential_changes_what_is_commanded():
    exact = {f"blocks.exchange{s}.{key}": 0 for s in ("", "_b")
             for key in ("position_m", "velocity_mps")}  # fmt: skip

    def told(**keys):
        return rows(scene(**exact, **{f"blocks.avoidance.{k}": v for k, v in keys.items()}))

    first = told()[0]
    assert first["time_s"] == 0.0 and first["acceleration_mps2"] == 5.0
    # At once, with a miss of 0: 52.5 m and the radius's share of the way, in 73.4 s.
    push = math.hypot(first["velocity_east_mps"], first["velocity_north_mps"] - 10.2889)
    closest_s = 70 + 50 / (10.2889 * math.sqrt(2))
    assert push == pytest.approx(52.5 / closest_s, rel=0.01)
    for keys in ({"radius_m": 80.0}, {"radius_m": 50.0, "margin": 1.6}):
        wider = told(**keys)[0]
        more = math.hypot(wider["velocity_east_mps"], wider["velocity_north_mps"] - 10.2889)
        assert more == pytest.approx(
            80.0 * keys.get("margin", 1.05) * (50 / 80 if "margin" in keys else 1) / closest_s,
            rel=0.02,
        )
    assert told(acceleration_mps2=2.0)[0]["acceleration_mps2"] == 2.0
    slow = told(most_mps=4.0)[0]
    assert math.hypot(slow["velocity_east_mps"], slow["velocity_north_mps"]) == pytest.approx(4.0)
    assert all(row["time_s"] > 9.0 for row in told(lookahead_s=60.0))
    # After the pair is past it flies its own way, at its own speed.
    last = rows(scene(duration_s=120, **exact, **{"blocks.avoidance.speed_mps": 9.0}))[-1]
    assert (last["velocity_east_mps"], last["velocity_north_mps"]) == pytest.approx((0.0, 9.0))


@covers("goal_m", of=("avoidance.mvp",))
def test_it_flies_to_its_goal_and_stops_there():
    alone = {f"blocks.avoidance{s}.lookahead_s": 1e-3 for s in ("", "_b")}
    alone |= {"blocks.avoidance.goal_m": 300.0, "blocks.avoidance.speed_mps": 12.0}
    told = rows(scene(duration_s=60, **alone))
    speeds = [math.hypot(row["velocity_east_mps"], row["velocity_north_mps"]) for row in told]
    assert speeds[0] == pytest.approx(12.0) and min(speeds) < 0.5
    truth = [r for r in tables_of(scene(duration_s=60, **alone))[1]["truth"].to_pylist()
             if r["target"] is None]  # fmt: skip
    ahead_m = (truth[-1]["lat_deg"] - 52.0) * 111_267.0
    assert ahead_m == pytest.approx(300.0, abs=1.5)


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s", of=("surveillance.exchange",))
def test_fixes_are_told_by_the_clock():
    def told(**keys):
        clock = {f"blocks.exchange.{key}": value for key, value in keys.items()}
        alerts = tables_of(scene(duration_s=3, **clock))[1]["alerts"]
        return [row["time_s"] for row in of_block(alerts, "exchange")]

    assert told(scan_rate_hz=2, offset_s=0.25) == [0.25, 0.75, 1.25, 1.75, 2.25, 2.75]
    assert told(rate_error_ppm=-100_000) == pytest.approx([0.0, 1.0 / 0.9, 2.0 / 0.9])
    late = np.array(told(jitter_s=0.1))
    assert len(late) == 3 and (late != np.round(late)).any() and np.ptp(late - [0, 1, 2]) < 0.6


def test_they_are_the_same_in_any_window_and_beside_other_runs():
    same_in_any_window(scene(duration_s=20))
    same_as_alone(replicas_of(scene(duration_s=12), {}, {"blocks.exchange.position_m": 10}))
    # Behind a tracker that a radar's false alarms give many tracks, which come and go.
    noise = {
        "scan_rate_hz": 2,
        "false_alarms": True,
        "false_alarm_probability": 2e-3,
        "range_km": 2,
    }
    noisy = ghost(15, 0.5).resolved()
    noisy["blocks"]["ads_b"] = {"extends": "configs/sensors/oasys.toml", **noise}
    noisy["blocks"]["tracker"] |= {"confirm_m": 2, "confirm_n": 3}
    alerts = same_in_any_window(dsa_des.load_scene(noisy), (3,))["alerts"]
    assert len(set(alerts["track"].to_pylist())) > 5
    same_as_alone(replicas_of(dsa_des.load_scene(noisy), {}, {}))


def ghost(duration_s=30, delay_s=0, **equipage):
    """Return a multirotor whose receiver hears an aircraft come head-on, from 600 m ahead.

    It is 2 km beside where it says to be: the track is near no target.
    """
    wires = [
        "traffic -> transform -> gate -> ads_b -> fusion -> tracker",
        "traffic -> alerting -> avoidance", "traffic -> avoidance",
        {"from": "tracker", "to": "alerting", "delay_s": delay_s, "holds": "nothing"},
        {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"},
    ]  # fmt: skip
    heard = {"spoofed_east_m": 2000, "nacv": 4, "nacp": 11, **equipage}
    other = {"name": "other", "east_m": -2000, "north_m": 600, "up_m": 0, "heading_deg": 180,
             "speed_mps": 10, "ads_b": heard}  # fmt: skip
    own = {"lat_deg": 52, "lon_deg": 4, "alt_m": 100, "heading_deg": 0, "speed_mps": 10}
    ads_b = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "position_errors": "none"}
    types = {"transform": "geometry.ellipsoid", "gate": "gate", "fusion": "fusion.pass_through"}
    tracker = {"type": "tracking.ekf", "acceleration_intensity_m2_s3": 0.5}
    blocks = {
        "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": [other]},
        **{name: {"type": kind} for name, kind in types.items()},
        "ads_b": ads_b, "tracker": tracker,
        "alerting": {"type": "alerting.daidalus", "scan_rate_hz": 1,
                     "conf": "configs/alerting/do365b.conf"},
        "avoidance": {"type": "avoidance.mvp", "speed_mps": 10},
    }  # fmt: skip
    return dsa_des.load_scene(
        {"duration_s": duration_s, "seed": 1, "wires": wires, "blocks": blocks}
    )


def test_it_keeps_away_from_what_its_tracker_says_though_nobody_is_there():
    found = tables_of(ghost(35, delay_s=1.5))[1]
    assert {(row["target"], row["track"]) for row in found["alerts"].to_pylist()} == {(None, 1)}
    own = [row for row in found["truth"].to_pylist() if row["target"] is None]
    apart_m = [
        math.hypot((row["lon_deg"] - 4) * 68_677.0, (row["lat_deg"] - 52) * 111_267.0
                   - (600 - 10 * row["time_s"])) for row in own
    ]  # fmt: skip
    assert 45.0 < min(apart_m) < 65.0
    # Past it, the first track again.
    told = of_block(found["manoeuvres"], "avoidance")
    assert told[0]["time_s"] == 5.0 and 29.0 < told[-1]["time_s"] < 33.0
    assert (told[-1]["velocity_east_mps"], told[-1]["velocity_north_mps"]) == (0.0, 10.0)


def test_who_is_heard_no_more_is_kept_in_mind_for_half_a_minute():
    """Its broadcasts end in the conflict, then its track: the way out is flown on for 30 s."""
    found = tables_of(ghost(60, silent_after_s=6))[1]
    last_s = max(row["time_s"] for row in found["alerts"].to_pylist())
    told = of_block(found["manoeuvres"], "avoidance")
    assert 6.0 < last_s < 25.0
    assert [row["time_s"] for row in told if row["velocity_east_mps"] == 0.0] == [last_s + 32.0]
    # Its own velocity, as it knows it, is that over the ground: nothing is lost from look to look.
    held = [
        row["velocity_east_mps"] for row in told if last_s + 2.0 < row["time_s"] < last_s + 32.0
    ]
    assert held[0] > 1.5 and held == pytest.approx([held[0]] * len(held), rel=1e-4)


def test_a_demand_that_comes_back_around_a_loop_asks_nothing_new():
    """Else each turn of the loop asked for rows one delay earlier, a thousand of them."""
    simulation = Simulation(scene())
    demands = demands_of_clocks_downstream(simulation.nodes, "traffic")
    assert [(d.block, d.lead_ticks) for d in demands] == [
        ("exchange", 0),
        ("exchange_b", 0),
        ("over", 0),
    ]
    assert len(tables_of(scene(duration_s=10))[1]["truth"]) == 2 * 10


def test_the_fleet_keeps_apart_without_errors():
    fleet = Path("configs/platforms/fleet.toml")
    names = ["", *(f"_{k}" for k in range(2, 9))]
    exact = {
        f"blocks.exchange{s}.{key}": 0 for s in names for key in ("position_m", "velocity_mps")
    }
    simulation = Simulation(replica_scene(dsa_des.load_scene(fleet), Replica(1, exact)))
    simulation.run()
    traffic, times = simulation.nodes["traffic"].component, np.arange(0.0, 200.0, 0.5)
    states = [traffic.own.at(times), *(flight.at(times) for flight in traffic.targets)]
    places = np.array(
        [[(of.lat_deg - 52) * 111_267.0, (of.lon_deg - 4) * 68_677.0] for of in states]
    ).transpose(2, 0, 1)
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    apart[:, range(8), range(8)] = np.inf
    assert 45.0 < apart.min() < 120.0
    # All are past the middle.
    assert np.linalg.norm(places[-1] - places[0], axis=-1).min() > 1550.0
