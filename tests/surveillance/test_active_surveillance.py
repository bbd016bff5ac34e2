"""Who answers interrogations, how often, and how well it is measured."""

import numpy as np
import pyarrow.compute as pc
import pytest

import dsa_des
from components.surveillance.interrogation import (
    answer_probability_per_round,
    bearing_deviation_rad,
    is_met_within,
    sine_of_elevation,
    transponder_reach_m,
)
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """\
duration_s = 60
seed = 5
wires = ["traffic -> transform -> gate -> asker -> fusion -> tracker"]
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = -42.0, lon_deg = 179.99, alt_m = 1200, heading_deg = 217, speed_mps = 55, roll_deg = {roll} }}
[[blocks.traffic.intruders]]
name = "TRF3"
east_m = {east}
north_m = {north}
up_m = 300
heading_deg = {heading}
speed_mps = {speed}
climb_mps = 5
{craft}
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.gate]
type = "gate"
[blocks.asker]
type = "surveillance.active"
scan_rate_hz = 1
{asker}
[blocks.fusion]
type = "fusion.pass_through"
[blocks.tracker]
type = "tracking.ekf"
"""  # noqa: E501


@pytest.fixture
def scene(tmp_path):
    def load(craft="", asker="", place=(-6000, -8000), heading=37, speed=0, roll=25, **options):
        path = tmp_path / "scene.toml"
        text = SCENE.format(
            craft=craft, asker=asker, north=place[1], east=place[0], heading=heading, speed=speed,
            roll=roll,
        )  # fmt: skip
        path.write_text(text, encoding="utf-8")
        return load_scene(path, **options)

    return load


def recorded(scene, **options):
    sink = MemorySink()
    Simulation(scene, recorder=Recorder([sink]), **options).run()
    return sink.tables()["detections"]


def column(table, name):
    return table[name].to_numpy(zero_copy_only=False).astype(float)


def test_only_transponders_answer_and_mode_c_without_a_name(scene):
    assert recorded(scene("ads_b = {}")).num_rows == 0
    known = recorded(scene('mode_s = true\nicao_address = "4840D6"'))
    assert set(known["address"].to_pylist()) == {0x4840D6}
    assert set(recorded(scene("mode_c = true"))["address"].to_pylist()) == {-1}


def test_exact_measurements_are_the_true_line_of_sight(scene):
    asker = 'replies = "certain"\nmeasurement = "exact"'
    for place in ((-6000, -8000), (-7000, -7500)):
        seen = recorded(scene("mode_s = true", asker, place))
        assert seen.num_rows > 10
        assert np.abs(column(seen, "range_m") - column(seen, "true_range_m")).max() < 1e-6
        for angle in ("azimuth", "elevation"):
            off = column(seen, f"{angle}_rad") - column(seen, f"true_{angle}_rad")
            assert np.abs(off).max() < 2e-6
    assert column(seen, "reported_climb_m_s")[-1] == pytest.approx(5.0, abs=1e-6)


def test_altitude_and_climb_are_reported_in_steps(scene):
    for craft, step_ft in (("mode_s = true", 25.0), ("mode_c = true", 100.0)):
        seen = recorded(scene(craft, speed=90, place=(-3000, -4000)))
        feet = column(seen, "reported_alt_m") / 0.3048
        assert np.abs(feet / step_ft - np.round(feet / step_ft)).max() < 1e-6
        climb = column(seen, "reported_climb_m_s")
        known = climb[~np.isnan(climb)]
        assert len(known) > 20 and np.abs(known - 5.0).max() <= step_ft * 0.3048 / 5.0 + 1e-6


def test_who_is_far_is_asked_at_one_scan_in_five(scene):
    certain = 'replies = "certain"'
    away = recorded(scene("mode_s = true", certain, heading=217, speed=90))
    scans = column(away, "scan")
    # Who is new is asked until there were two turns to measure its range rate from.
    assert set(np.diff(scans[scans < 4])) == {1.0} and set(np.diff(scans[scans > 10])) == {5.0}
    # 13 km head-on at 145 m/s: 90 s to go, so from 30 s on it is near, as ranges say 5 s late.
    far = (-7800, -10_400)
    near = recorded(scene("mode_s = true", certain, far, heading=37, speed=90))
    scans = column(near, "scan")
    assert set(np.diff(scans[(scans > 10) & (scans < 24)])) == {5.0}
    assert set(np.diff(scans[scans > 38])) == {1.0}


def test_who_is_near_is_told_by_what_is_measured(scene):
    """At 60 s by the truth, the errors of two ranges, 4.3 m/s, make some early and some late."""
    far = (-7800, -10_400)
    sets = ["blocks.asker.replies='certain'"]
    first = []
    for seed in range(12):
        near = scene("mode_s = true", "", far, heading=37, speed=90, seed=seed, sets=sets)
        scans = column(recorded(near), "scan")
        first.append(scans[:-1][(np.diff(scans) == 1.0) & (scans[:-1] > 10)].min())
    assert len(set(first)) > 1 and 24.0 < np.mean(first) < 36.0


def test_reach_is_by_sector():
    bearing = np.radians([0.0, 45.0, 46.0, -135.0, 136.0, 180.0])
    nmi = transponder_reach_m(bearing, np.zeros(6, dtype=bool)) / 1852.0
    assert nmi == pytest.approx([20.6, 20.6, 14.3, 14.3, 8.0, 8.0])
    assert transponder_reach_m(bearing, np.ones(6, dtype=bool)) / 1852.0 == pytest.approx(
        [15.6] * 6
    )


def test_a_scene_without_a_reach_asks_as_far_as_anybody_answers(scene):
    """Straight ahead, 33 km away: Mode C answers up to 20.6 nmi there, Mode S up to 15.6."""
    ahead = (33_000.0 * np.sin(np.radians(217.0)), 33_000.0 * np.cos(np.radians(217.0)))
    asker = 'replies = "certain"\nfar_every = 1'
    found = {
        craft: recorded(scene(f"{craft} = true", asker, ahead, duration_s="5")).num_rows
        for craft in ("mode_c", "mode_s")
    }
    assert found["mode_c"] > 0 and found["mode_s"] == 0


def test_who_is_asked_in_turn_is_asked_at_a_scan_of_his_own(scene):
    """Of thirty who are far some are asked at each scan, and each at one in five."""
    aircraft = "\n".join(
        f'[[blocks.traffic.intruders]]\nname = "f{i}"\neast_m = -6000\nnorth_m = -8000\n'
        "up_m = 300\nheading_deg = 217\nspeed_mps = 90\nmode_s = true"
        for i in range(30)
    )
    found = recorded(
        scene("mode_s = true\n" + aircraft, 'replies = "certain"', heading=217, speed=90)
    )
    late = found.filter(pc.greater(found["time_s"], 20.0))
    asked = [sum(1 for t in column(late, "time_s") if t == second) for second in range(30, 40)]
    assert min(asked) >= 1 and max(asked) <= 15


def test_bearings_are_off_the_nose_whatever_the_heading_is_believed_to_be(scene):
    asker = 'measurement = "exact"\nreplies = "certain"\nfar_every = 1'
    sets = ["navigation.attitude_bias_deg=[3, 0, 0]"]
    seen = recorded(scene("mode_s = true", asker, roll=0, sets=sets, duration_s="6"))
    off = column(seen, "azimuth_rad") - column(seen, "true_azimuth_rad")
    assert len(off) > 3 and np.abs(off).max() < 1e-3


def test_pure_functions():
    assert 1.0 - (1.0 - answer_probability_per_round(np.array([0.95]))[0]) ** 10 == pytest.approx(
        0.95
    )
    assert np.degrees(bearing_deviation_rad(np.radians([9.9, -10.1]))) == pytest.approx([9.0, 15.0])
    near = is_met_within(np.array([3000.0, 3000.0, 100.0]), np.array([-51.0, -49.0, 5.0]), 60.0)
    assert near.tolist() == [True, False, False]
    # At the ownship's own altitude an aircraft 30 km away lies below the horizontal.
    assert np.degrees(sine_of_elevation(np.zeros(1), np.array([30e3])))[0] == pytest.approx(
        -np.degrees(30e3 / (2 * 6.371e6)), rel=1e-3
    )


def test_windows_and_a_latency_change_nothing_of_the_draws(scene):
    loaded = scene("mode_s = true", heading=37, speed=90)
    whole = recorded(loaded)
    assert whole.num_rows > 20
    for window in (1, 7):
        assert recorded(loaded, window=window).equals(whole)
    late = recorded(scene("mode_s = true", "latency_s = 0.3", heading=37, speed=90))
    names = ["scan", "range_m", "reported_alt_m"]
    assert late.select(names).equals(whole.select(names))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("range_km = 50", "range_km = 50: no transponder answers beyond 38.2 km"),
        ("elevation_deg = [20, -15]", "elevation_deg"),
        ("azimuth_error_deg = 3", "azimuth_error_deg = 3: a cooperative sensor"),
        ("far_every = 0", "far_every"),
        ("mode_s_step_ft = 50", "mode_s_step_ft"),
    ],
)
def test_impossible_reaches_and_steps_are_refused(scene, wrong, said):
    with pytest.raises(dsa_des.SceneError) as caught:
        scene("mode_s = true", wrong)
    assert said in str(caught.value)
