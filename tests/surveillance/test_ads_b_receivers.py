"""A receiver of ADS-B in a scene: who is seen, where, by the quality that is sent."""

from math import sqrt
from statistics import NormalDist

import numpy as np
import pyarrow.compute as pc
import pytest
from same_runs import tables_of

import dsa_des
from components.surveillance.ads_b import ERRORS
from dsa_des.costs.replay import replay_values, run_rung
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """\
duration_s = 60
seed = 3
wires = ["traffic -> transform -> gate -> ether -> fusion -> tracker"]
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = -42.0, lon_deg = 179.99, alt_m = 1200, heading_deg = 217, speed_mps = 55, roll_deg = 25 }}
[[blocks.traffic.intruders]]
name = "kea"
east_m = {east}
north_m = 4000
up_m = 90
heading_deg = 20
speed_mps = 70
{kea}
[[blocks.traffic.intruders]]
name = "moa"
east_m = -3000
north_m = -6000
heading_deg = 100
speed_mps = 90
{moa}
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.gate]
type = "gate"
[blocks.ether]
type = "surveillance.ads_b"
scan_rate_hz = 1
{ether}
[blocks.fusion]
type = "fusion.pass_through"
[blocks.tracker]
type = "tracking.ekf"
"""  # noqa: E501


@pytest.fixture
def scene(tmp_path):
    def load(kea="", moa="", ether="", east=2500, **options):
        path = tmp_path / "scene.toml"
        path.write_text(SCENE.format(kea=kea, moa=moa, ether=ether, east=east), encoding="utf-8")
        return load_scene(path, **options)

    return load


def recorded(scene, **options):
    sink = MemorySink()
    Simulation(scene, recorder=Recorder([sink]), **options).run()
    return sink.tables()


def reports(tables, target):
    table = tables["detections"]
    return table.filter(pc.equal(table["target"], target))


def column(table, name):
    return table[name].to_numpy(zero_copy_only=False).astype(float)


def test_only_who_broadcasts_is_seen(scene):
    tables = recorded(scene(kea="ads_b = {}", moa="mode_s = true\nmode_c = true"))
    assert reports(tables, "kea").num_rows > 20 and reports(tables, "moa").num_rows == 0
    silent = recorded(scene(kea="ads_b = { silent_after_s = 20 }"))
    assert 19.0 <= column(reports(silent, "kea"), "time_s").max() <= 20.0


@pytest.mark.parametrize("nav", [0.0, 4.0])
def test_exact_broadcasts_give_the_true_line_of_sight(scene, nav):
    ether = 'position_errors = "none"\ncompact = false\nreception = "certain"'
    sets = [f"navigation.attitude_bias_deg=[{nav}, -{nav}, 1.0]"] if nav else []
    seen = reports(recorded(scene(kea="ads_b = {}", ether=ether, sets=sets)), "kea")
    assert seen.num_rows == 59  # all but that at 0 s
    assert np.abs(column(seen, "range_m") - column(seen, "true_range_m")).max() < 0.01
    if nav:  # where it says that it is, however the ownship believes to be turned
        assert np.abs(column(seen, "azimuth_rad") - column(seen, "true_azimuth_rad")).max() > 0.01
        return
    for angle in ("azimuth", "elevation"):
        off = column(seen, f"{angle}_rad") - column(seen, f"true_{angle}_rad")
        assert np.abs(off).max() < 2e-6
    rate = np.gradient(column(seen, "true_range_m"), 1.0)
    assert np.abs(column(seen, "range_rate_m_s") - rate)[1:-1].max() < 0.05


def test_latency_that_is_not_compensated_lags(scene):
    ether = 'position_errors = "none"\ncompact = false\nreception = "certain"'
    lags = {}
    for said in (0.0, 0.4):
        kea = f"ads_b = {{ latency_s = 0.6, compensated_s = {said} }}"
        seen = reports(recorded(scene(kea=kea, ether=ether)), "kea")
        lat = np.radians(column(seen, "reported_lat_deg"))
        way_m = 6.357e6 * lat / np.cos(np.radians(20.0))
        start = (way_m - 70.0 * column(seen, "reported_s")).mean()
        lags[said] = start
    assert lags[0.4] - lags[0.0] == pytest.approx(0.4 * 70.0, abs=0.3)


def test_spoofed_aircraft_are_where_they_say(scene):
    ether = 'position_errors = "none"\nreception = "certain"'
    said = [
        column(reports(recorded(scene(kea=f"ads_b = {{ {key} }}", ether=ether)), "kea"), name)
        for key in ("", "spoofed_north_m = 3000, spoofed_up_m = 300")
        for name in ("reported_lat_deg", "reported_alt_m")
    ]
    assert np.radians(said[2] - said[0]) * 6.37e6 == pytest.approx(3000.0, abs=15.0)
    assert said[3] - said[1] == pytest.approx(300.0, abs=7.7)


def test_stated_variances_are_those_of_the_errors(scene):
    quality = "ads_b = {{ nacp = {}, nacv = 2 }}"
    off = {"azimuth": [], "elevation": [], "range": []}
    loaded = scene(kea=quality.format(7), moa=quality.format(9), duration_s="6")
    found = tables_of([replica_scene(loaded, Replica(seed)) for seed in range(60)])[1]
    for seed in range(60):
        mine = {
            "detections": found["detections"].filter(pc.equal(found["detections"]["replica"], seed))
        }
        for name in ("kea", "moa"):
            seen = reports(mine, name)[-1:]
            for quantity, unit in (("azimuth", "rad"), ("elevation", "rad"), ("range", "m")):
                apart = column(seen, f"{quantity}_{unit}") - column(seen, f"true_{quantity}_{unit}")
                square = column(seen, f"{quantity}_variance_{unit}2")
                off[quantity] += (apart**2 / square).tolist()
    for quantity, ratios in off.items():
        # Of a normal error's square the variance is 2; a Laplacian's, in the elevation, 5.
        spread = (5.0 if quantity == "elevation" else 2.0) / len(ratios)
        assert abs(np.mean(ratios) - 1.0) < NormalDist().inv_cdf(0.9995) * sqrt(spread), quantity


@pytest.mark.parametrize(
    ("where", "wrong", "said"),
    [
        ("ether", "range_km = 600", "range_km = 600: nothing is received beyond 537.1 km"),
        ("ether", 'range_km = 40\nreception = "do_365"', "nothing is received beyond 37.0 km"),
        ("ether", "azimuth_resolution_deg = 1", "azimuth_resolution_deg = 1: a cooperative"),
        ("kea", "ads_b = { nacp = 12 }", "nacp"),
        (
            "kea",
            "ads_b = { compensated_s = 1 }",
            "compensated_s = 1: it must be at most latency_s, 0",
        ),
        ("kea", 'icao_address = "xyz"', "icao_address = 'xyz': must be six hexadecimal digits"),
        ("kea", 'icao_address = "000000"', "neither all 0 nor all F"),
        ("kea", 'icao_address = "FFFFFF"', "neither all 0 nor all F"),
        ("kea", "ads_b = { nacv = 0 }", "nacv = 0: must be greater than or equal to 1"),
        ("kea", "ads_b = true", "ads_b = True: must be a table"),
        ("kea", "ads_b = { silent_after_s = -1 }", "silent_after_s = -1: must be greater than"),
        ("ether", "velocity_age_s = 9", "velocity_age_s = 9: must be less than or equal to 5"),
        ("ether", 'reception = "certian"', "did you mean 'certain'?"),
        ("kea", "ads_b = { nacpp = 3 }", "nacp"),
        ("kea", "mode_s = 1", "mode_s = 1: must be true or false"),
        ("kea", "ads_b = { nacp = true }", "ads_b.nacp = True: must be a number"),
        ("kea", 'ads_b = { nacp = "8" }', "ads_b.nacp = '8': must be a number"),
        ("kea", "ads_b = { latency_s = false }", "ads_b.latency_s = False: must be a number"),
        ("ether", "range_km = true", "blocks.ether.range_km = True: must be a number"),
        ("ether", "elevation_deg = [false, 20]", "elevation_deg[0] = False: must be a number"),
        ("kea", 'mode_c = "yes"', "mode_c = 'yes': must be true or false"),
    ],
)
def test_bad_equipage_and_reach_are_refused(scene, where, wrong, said):
    with pytest.raises(dsa_des.SceneError) as caught:
        scene(**{where: wrong})
    assert said in str(caught.value)


ADDRESS = 'mode_s = true\nicao_address = "4840D6"'


@pytest.mark.parametrize("other", ['ads_b = {}\nicao_address = "4840d6"', ADDRESS])
def test_two_aircraft_with_one_address_are_refused(scene, other):
    with pytest.raises(dsa_des.SceneError) as caught:
        Simulation(scene(kea=ADDRESS, moa=other))
    assert "6' is that of 'kea' and of 'moa': each aircraft has one" in str(caught.value)
    assert Simulation(scene(kea=ADDRESS, moa='mode_c = true\nicao_address = "4840D6"'))


def test_costs_count_how_far_reports_lie_off_all_of_which_come(scene):
    """However few are received: as far as is spoofed, less the way since the last squitter."""
    kea = "ads_b = { spoofed_north_m = 3000, spoofed_east_m = -400 }"
    ether = 'position_errors = "none"\ncompact = false'
    here = run_rung(scene(kea=kea, ether=ether, moa="ads_b = {}", duration_s=6), "ether")
    _, off = replay_values(ERRORS, here, here)
    north_m, east_m = off["north"].T, off["east"].T
    flown = (((3000.0, -400.0), 70.0, 20.0), ((0.0, 0.0), 90.0, 100.0))
    for index, (spoofed_m, speed_mps, heading_deg) in enumerate(flown):
        known = np.isfinite(north_m[index])
        assert known.sum() >= 5  # all looks but that at 0 s
        heading = np.radians(heading_deg)
        age_s = (spoofed_m[0] - north_m[index, known]) / (speed_mps * np.cos(heading))
        assert ((age_s > -0.01) & (age_s < 0.61)).all() and np.ptp(age_s) > 0.05
        other_s = (spoofed_m[1] - east_m[index, known]) / (speed_mps * np.sin(heading))
        assert other_s == pytest.approx(age_s, abs=0.03)
