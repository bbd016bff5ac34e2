"""Wind: noses that do not point along the track, by vectors over the ground and through the air."""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from test_avoidance_by_bands import scene as steered_scene
from wired import chain, first_look, rows, run, sensor

from components.flights.attitude import Wind, ground_speed_mps, heading_and_airspeed
from components.flights.legs import Climb, Straight, Turn
from components.flights.many_flights import SteeredFleet, straight_fleet
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.traffic.flown_flights import FlownFlights
from components.traffic.wind_effect import Crabbing
from dsa_des.errors import SceneError

G = 9.80665
WIND = {"wind_mps": 21.0, "wind_from_deg": 305.0}
# The air goes where the wind does not come from.
AIR = np.array([-21.0 * math.sin(math.radians(305.0)), -21.0 * math.cos(math.radians(305.0))])
OWN = {
    "lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0, "heading_deg": 217.0,
    "speed_mps": 70.0, "climb_mps": 3.0,
}  # fmt: skip
TARGET = {
    "name": "one", "east_m": -2349.0, "north_m": -855.0, "up_m": 420.0, "heading_deg": 35.0,
    "speed_mps": 60.0, "climb_mps": 7.0,
    "eo": {"front_m2": 3.0, "side_m2": 40.0, "horizontal_m2": 90.0},
}  # fmt: skip
RADAR = sensor("radar.range_boundary", scan_rate_hz=2)


def through_air(track_deg, speed_mps):
    """Heading (deg) and level airspeed of who flies so over the ground."""
    track = math.radians(track_deg)
    air = speed_mps * np.array([math.sin(track), math.cos(track)]) - AIR
    return math.degrees(math.atan2(*air)) % 360.0, float(np.hypot(*air))


def pose(row):
    return [math.degrees(row[f"own_{name}_rad"]) for name in ("heading", "pitch", "roll")]


@covers("wind_mps", "wind_from_deg", of=("[weather]",))
def test_the_nose_turns_into_the_wind_and_the_flight_stays_where_it_was():
    still = first_look(chain({"radar": RADAR}, ownship=OWN, targets=[TARGET]), "radar")["one"]
    blown = first_look(
        chain({"radar": RADAR}, ownship=OWN, targets=[TARGET], weather=WIND), "radar"
    )["one"]
    heading, airspeed = through_air(217.0, 70.0)
    assert abs(heading - 217.0) > 10
    climb = math.degrees(math.atan2(3.0, airspeed))
    assert pose(blown) == pytest.approx([heading, climb, 0.0], abs=1e-9)
    assert pose(still) == pytest.approx([217.0, math.degrees(math.atan2(3.0, 70.0)), 0.0], abs=1e-9)
    assert blown["true_range_m"] == still["true_range_m"]
    # What is seen in body axes follows: by matrices.
    vector = crooked.rotation(heading, climb, 0.0) @ crooked.ned(TARGET, 0.0, OWN)
    p, q = crooked.angles(vector)
    assert blown["true_azimuth_rad"] == pytest.approx(p, abs=1e-7)
    assert blown["true_elevation_rad"] == pytest.approx(q, abs=1e-7)


@covers("wind_from_deg", of=("[weather]",))
@pytest.mark.parametrize(
    "legs", [[], [{"kind": "straight", "duration_s": 99}, {"kind": "straight"}]]
)
def test_a_target_shows_the_side_that_its_heading_gives(legs):
    eo = sensor("optical.eo", azimuth_pixels=9000, elevation_pixels=4500)
    scene = chain({"eo": eo}, ownship=OWN, targets=[{**TARGET, "legs": legs}], weather=WIND)
    row = first_look(scene, "eo")["one"]
    heading, airspeed = through_air(35.0, 60.0)
    turned = crooked.rotation(heading, math.degrees(math.atan2(7.0, airspeed)), 0.0)
    u = turned @ crooked.ned(TARGET, 0.0, OWN)
    u = u / np.linalg.norm(u)
    area = 3.0 + 40.0 * math.sqrt(1 - u[0] ** 2) + 90.0 * abs(u[2])
    pixel_rad = math.radians(360.0 / 9000)
    assert row["pixels"] == pytest.approx(area / (row["true_range_m"] * pixel_rad) ** 2, rel=1e-6)


def test_a_turn_in_wind_banks_for_what_is_across_the_nose():
    own = {**OWN, "climb_mps": 0.0, "legs": [{"kind": "turn", "rate_deg_s": 3.0}]}
    scene = chain({"radar": RADAR}, ownship=own, targets=[TARGET], weather=WIND, duration_s=20)
    for row in rows(run(scene))[1::7]:
        track = 217.0 + 3.0 * row["time_s"]
        heading, _ = through_air(track, 70.0)
        crab = math.radians(heading - track)
        bank = math.atan(70.0 * math.radians(3.0) / G * math.cos(crab))
        found = pose(row)
        assert (found[0] - heading + 180) % 360 - 180 == pytest.approx(
            0.0, abs=0.02
        )  # meridians converge
        assert found[1:] == pytest.approx([0.0, math.degrees(bank)], abs=1e-3)


def test_a_beam_that_sweeps_meets_noses_in_the_wind():
    radar = sensor("radar.threshold", beam_sweep=True, scan_rate_hz="1/2")
    own = {**OWN, "climb_mps": 0.0, "legs": [{"kind": "turn", "rate_deg_s": 3.0}]}
    (row,) = rows(run(chain({"radar": radar}, ownship=own, targets=[TARGET], weather=WIND)))
    heading, _ = through_air(217.0 + 3.0 * row["illuminated_s"], 70.0)
    assert row["illuminated_s"] > 0.1
    assert pose(row)[0] == pytest.approx(heading, abs=0.02)


def test_the_truth_in_the_run_folder_is_a_wind_triangle():
    own = {**OWN, "legs": [{"kind": "turn", "rate_deg_s": 2.0}]}
    scene = chain({"radar": RADAR}, ownship=own, targets=[TARGET], weather=WIND, duration_s=3)
    found = rows(run(scene), "truth")
    assert len(found) >= 6
    for row in found:
        through = np.array([row["velocity_east_m_s"], row["velocity_north_m_s"]]) - AIR
        turned = row["heading_rad"] - math.atan2(*through)
        assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=2e-4)


def test_a_fixed_attitude_stays_and_so_do_who_stand():
    fixed = {**OWN, "yaw_deg": 100.0, "roll_deg": 5.0}
    row = rows(run(chain({"radar": RADAR}, ownship=fixed, targets=[TARGET], weather=WIND)))[0]
    # Where the yaw says nothing of the track, the pitch is that over the ground.
    assert pose(row) == pytest.approx([100.0, math.degrees(math.atan2(3.0, 70.0)), 5.0])
    # Each angle that is fixed stays alone.
    heading, airspeed = through_air(217.0, 70.0)
    derived = {"yaw_deg": heading, "pitch_deg": math.degrees(math.atan2(3.0, airspeed)),
               "roll_deg": 0.0}  # fmt: skip
    for angle in ("pitch_deg", "roll_deg"):
        part = {**OWN, angle: 9.0}
        row = rows(run(chain({"radar": RADAR}, ownship=part, targets=[TARGET], weather=WIND)))[0]
        assert pose(row) == pytest.approx([*{**derived, angle: 9.0}.values()])
    hovering = {**OWN, "speed_mps": 0.0, "climb_mps": 0.0}
    row = rows(run(chain({"radar": RADAR}, ownship=hovering, targets=[TARGET], weather=WIND)))[0]
    assert pose(row) == pytest.approx([217.0, 0.0, 0.0])


@covers("ownship.airspeed_mps", of=("traffic.scripted", "traffic.random"))
@covers("intruders.airspeed_mps", of=("traffic.scripted",))
def test_an_airspeed_gives_the_speed_over_the_ground():
    own = {key: value for key, value in OWN.items() if key != "speed_mps"} | {"airspeed_mps": 65.0}
    target = {k: v for k, v in TARGET.items() if k != "speed_mps"} | {"airspeed_mps": 50.0}
    scene = chain({"radar": RADAR}, ownship=own, targets=[target], weather=WIND, duration_s=3)
    seen = rows(run(scene))
    first, last = seen[0], seen[-1]
    heading = math.radians(pose(first)[0])
    over_ground = 65.0 * np.array([math.sin(heading), math.cos(heading)]) + AIR
    assert math.degrees(math.atan2(*over_ground)) % 360 == pytest.approx(217.0)
    moved = pymap3d.geodetic2enu(
        last["own_lat_deg"], last["own_lon_deg"], 2400.0, OWN["lat_deg"], OWN["lon_deg"], 2400.0
    )
    assert math.hypot(*moved[:2]) / last["time_s"] == pytest.approx(
        np.hypot(*over_ground), rel=1e-6
    )
    # The target's ground speed: positions rebuilt from what the ownship sees.
    speed = ground_speed_mps(math.radians(35.0), 50.0, Wind(*AIR))
    there = crooked.ned(
        {**TARGET, "speed_mps": speed},
        last["time_s"],
        {**OWN, "speed_mps": float(np.hypot(*over_ground))},
    )
    assert last["true_range_m"] == pytest.approx(float(np.linalg.norm(there)), abs=0.02)
    still = {"type": "traffic.random", "ownship": own, "intruders": 3, "radius_km": 3}
    scene["blocks"]["traffic"] = still
    row = rows(run({**scene, "weather": {}}))[-1]
    moved = pymap3d.geodetic2enu(
        row["own_lat_deg"], row["own_lon_deg"], 2400.0, OWN["lat_deg"], OWN["lon_deg"], 2400.0
    )
    assert math.hypot(*moved[:2]) / row["time_s"] == pytest.approx(65.0, rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"airspeed_mps": 15.0, "speed_mps": 0.0}, r"ownship\.airspeed_mps = 15\.0: .*across"),
        ({"airspeed_mps": 20.5, "speed_mps": 0.0, "heading_deg": 310.0}, "wind of 21 m/s against"),
        ({"airspeed_mps": 50.0}, "airspeed_mps is 50 and speed_mps is 70: only one"),
        ({"airspeed_mps": 50.0, "speed_mps": 0, "legs": [{"kind": "straight"}]}, "are legs"),
        ({"airspeed_mps": -1.0, "speed_mps": 0.0}, "airspeed_mps"),
    ],
)  # fmt: skip
def test_impossible_winds_are_one_clear_error(changes, says):
    scene = chain({"radar": RADAR}, ownship={**OWN, **changes}, targets=[TARGET], weather=WIND)
    with pytest.raises(SceneError, match=says) as caught:
        run(scene)
    assert len(caught.value.problems) == 1


@covers("wind_mps", of=("[weather]",))
def test_replayed_flights_turn_into_the_wind_too(tmp_path):
    lines = ["time,id,lat,lon,alt"]
    for t in range(8):
        for name, east, north in (("own", 60.0 * t, 0.0), ("it", 900.0, 50.0 * t - 1500.0)):
            lat, lon, _ = pymap3d.enu2geodetic(east, north, 0.0, -41.0, 172.0, 900.0)
            lines.append(f"{t},{name},{float(lat)!r},{float(lon)!r},900")
    path = tmp_path / "f.csv"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    scene = chain({"radar": RADAR}, duration_s=6, weather=WIND)
    scene["blocks"]["traffic"] = {"type": "traffic.csv", "file": str(path)}
    for row in rows(run(scene)):
        expected, _ = through_air(90.0, 60.0)
        assert pose(row)[0] == pytest.approx(expected, abs=0.01)
    path.write_text(
        path.read_text("utf-8").replace("alt\n", "alt,heading\n").replace(",900\n", ",900,80\n"),
        "utf-8",
    )
    for row in rows(run(scene)):
        assert pose(row)[0] == pytest.approx(80.0, abs=1e-9)


def test_a_replayed_ownship_turns_into_the_wind_where_it_is_steered(tmp_path):
    """What it flies by itself was turned when it was read; what it is told is turned as it goes."""
    lines = ["time,id,lat,lon,alt"]
    for t in range(0, 41, 2):
        for name, north, east in (("own", 60.0 * t, 0.0), ("it", 2600.0 - 50.0 * t, 90.0)):
            lat, lon, _ = pymap3d.enu2geodetic(east, north, 0.0, -41.0, 172.0, 900.0)
            lines.append(f"{t},{name},{float(lat)!r},{float(lon)!r},900")
    path = tmp_path / "f.csv"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    loop = chain({"radar": RADAR}, duration_s=36, weather=WIND, fusion={"type": "fusion.pick_best"},
                 tracker={"type": "tracking.stub"})  # fmt: skip
    loop["blocks"]["traffic"] = {"type": "traffic.csv", "file": str(path), "ownship": "own"}
    loop["blocks"]["avoidance"] = {
        "type": "avoidance.turn_away", "range_km": 1.5, "turn_deg": 60, "rate_deg_s": 6
    }  # fmt: skip
    loop["wires"] += [
        "tracker -> avoidance",
        {"from": "avoidance", "to": "traffic", "holds": "nothing", "delay_s": 0.5},
    ]
    found = run(loop)
    own = [row for row in rows(found, "truth") if row["target"] is None]
    turns = 0
    for row in own:
        velocity = row["velocity_east_m_s"], row["velocity_north_m_s"]
        turned = row["heading_rad"] - math.atan2(*(np.array(velocity) - AIR))
        assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=2e-2)
        turns += abs(math.atan2(*velocity)) > math.radians(50.0)
    assert turns > 5


def test_many_flights_together_by_differences_of_their_positions():
    wind = Wind(9.0, -14.0)
    rng = np.random.default_rng(4)
    straight = straight_fleet(
        [str(i) for i in range(20)], lat_deg=rng.uniform(-60, 60, 20),
        lon_deg=rng.uniform(-180, 180, 20), alt_m=rng.uniform(0, 5e3, 20),
        heading_deg=rng.uniform(0, 360, 20), speed_mps=rng.uniform(30, 120, 20),
        climb_mps=rng.uniform(-8, 8, 20), start_time_s=np.zeros(20), end_time_s=np.full(20, np.inf),
        fixed_deg=np.full((3, 20), np.nan),
    )  # fmt: skip
    turning = ScriptedTrajectory(
        "t", lat_deg=50, lon_deg=8, alt_m=500, heading_deg=80, speed_mps=55,
        legs=[Straight(duration_s=10), Turn(rate_deg_s=-2, duration_s=20), Climb(climb_mps=4)],
    )  # fmt: skip
    for targets in (straight, ScriptedFleet([*(straight[k] for k in range(3)), turning])):
        time_s = np.array([4.0, 17.0, 25.0, 61.0])
        shape = len(time_s), len(targets)
        own = SteeredFleet(ScriptedFleet([turning]))
        which = np.tile(np.arange(shape[1]), shape[0])
        times = np.repeat(time_s, shape[1])
        found = FlownFlights(own, (-1,), targets, [Crabbing(wind)]).target_states_at(which, times)
        found = found.reshape(shape)
        for place, flight in enumerate(targets):
            a, b = flight.at(time_s - 0.05), flight.at(time_s + 0.05)
            east, north, up = pymap3d.geodetic2enu(
                b.lat_deg, b.lon_deg, b.alt_m, a.lat_deg, a.lon_deg, a.alt_m
            )
            through = np.array([east, north]) / 0.1 - np.array([[9.0], [-14.0]])
            heading = np.arctan2(*through)
            error = (found.yaw_rad[:, place] - heading + np.pi) % (2 * np.pi) - np.pi
            np.testing.assert_allclose(error, 0.0, atol=2e-5)
            pitch = np.arctan2(up / 0.1, np.hypot(*through))
            np.testing.assert_allclose(found.pitch_rad[:, place], pitch, atol=2e-5)


def test_who_drifts_with_the_air_points_along_the_track():
    air = Wind(10 * math.sin(0.5), 10 * math.cos(0.5))
    heading, airspeed = heading_and_airspeed(np.array([0.5]), np.array([10.0]), air)
    assert heading[0] == 0.5 and airspeed[0] == pytest.approx(0.0, abs=1e-12)


def test_who_is_culled_changes_nobody_s_nose():
    """Flights of many speeds and of fixed attitudes, with others first that nobody looks at."""
    legs = {"climb_mps": 0.0, "legs": [{"kind": "turn", "rate_deg_s": 3.0, "duration_s": 2},
                                       {"kind": "straight"}]}  # fmt: skip
    near = [
        {**TARGET, **legs, "name": "turns"}, {**TARGET, "name": "rolled", "roll_deg": 33.0},
        {**TARGET, "name": "slow", "speed_mps": 35.0},
    ]  # fmt: skip
    far = [
        {**TARGET, "name": "far", "north_m": 90_000.0, "yaw_deg": 10.0, "speed_mps": 99.0},
        {**TARGET, **legs, "name": "fast", "north_m": -90_000.0, "speed_mps": 120.0},
    ]
    eo = sensor("optical.eo", scan_rate_hz=2, range_km=5.0)
    seen = []
    for targets in (near, [*far, *near]):
        found = rows(run(chain({"eo": eo}, ownship=OWN, targets=targets, weather=WIND,
                               duration_s=4)))  # fmt: skip
        seen.append({(row["scan"], row["target"]): row["pixels"] for row in found})
    assert seen[0] == seen[1] and len(seen[0]) == 24


def test_a_steered_ownship_leaves_its_fixed_attitude_and_turns_into_the_wind(tmp_path):
    loop = steered_scene(tmp_path, level=1)
    loop["blocks"]["traffic"]["ownship"] |= {"roll_deg": 5.0}
    loop["weather"] = WIND
    loop["duration_s"] = 60
    found = run(loop)
    told_s = rows(found, "manoeuvres")[0]["time_s"]
    own = [row for row in rows(found, "truth") if row["target"] is None]
    assert {row["time_s"] > told_s + 1.0 for row in own} == {True, False}
    for row in own:
        through = np.array([row["velocity_east_m_s"], row["velocity_north_m_s"]]) - AIR
        turned = row["heading_rad"] - math.atan2(*through)
        assert math.remainder(turned, 2 * math.pi) == pytest.approx(0.0, abs=2e-2)
        track = math.atan2(row["velocity_east_m_s"], row["velocity_north_m_s"])
        # Of the turn's acceleration, what is across the nose.
        bank = math.tan(row["roll_rad"]) / math.cos(row["heading_rad"] - track)
        if row["time_s"] <= told_s:
            assert row["roll_rad"] == pytest.approx(math.radians(5.0))
        elif abs(bank) > 1e-9:
            assert abs(bank) == pytest.approx(50.0 * math.radians(3.0) / G, rel=0.02)
    assert own[-1]["roll_rad"] == pytest.approx(0.0, abs=1e-9)
    assert any(abs(row["roll_rad"]) > 0.15 for row in own)
