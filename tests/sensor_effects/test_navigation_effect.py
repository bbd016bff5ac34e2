"""A navigation error turns what is reported in the horizon's axes and nothing else."""

import math

import numpy as np
import pytest

from components.environment.tables import Navigation
from components.navigation.errors import NavigationErrors, displaced_position
from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene

NED = ["ned_azimuth_rad", "ned_elevation_rad"]
POSE = [*(f"own_{name}" for name in ("lat_deg", "lon_deg", "alt_m")),
        *(f"own_{angle}_rad" for angle in ("heading", "pitch", "roll"))]  # fmt: skip
OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000.0}
BIASED = "[navigation]\nattitude_bias_deg = [1.5, 0, 0]\nposition_bias_m = [30, -20, 5]\n"
NOISY = (
    "[navigation]\nattitude_noise_deg = [0.5, 0.2, 0.3]\nposition_noise_m = [8, 8, 12]\n"
    "position_correlation_time_s = 0\nattitude_correlation_time_s = 0\n"
)


def test_windows_do_not_change_a_bit(scene, runs):
    alarms = "false_alarms_per_frame = 0.2"
    run = runs.assert_grain_changes_nothing(scene(alarms, alarms, tables=NOISY))
    rows = run["detections"].to_pylist()
    assert {row["block"] for row in rows} >= {"eo", "ir", "radar"}
    assert all(row[name] is not None for row in rows for name in NED + POSE)


def test_body_angles_and_detections_are_physical(scene, runs):
    truth, erring = runs.run(scene()), runs.run(scene(tables=BIASED))
    left_out = NED + POSE
    assert truth["detections"].drop(left_out) == erring["detections"].drop(left_out)
    assert truth["scans"].drop(POSE) == erring["scans"].drop(POSE)
    for name in NED:
        assert truth["detections"][name].null_count == len(truth["detections"])
    for name in POSE:
        assert truth["detections"][name].null_count == 0


def test_a_yaw_bias_turns_every_bearing(scene, runs):
    """Level flight north: bearing is body azimuth, so the error is the bias itself."""
    for row in runs.detections(runs.run(scene(tables=BIASED)), "radar").values():
        bearing = row["azimuth_rad"] + math.radians(1.5)
        assert math.remainder(row["ned_azimuth_rad"] - bearing, math.tau) == pytest.approx(
            0.0, abs=1e-12
        )
        assert 0.0 <= row["ned_azimuth_rad"] < math.tau
        assert row["ned_elevation_rad"] == pytest.approx(row["elevation_rad"], abs=1e-12)


def test_a_pitch_bias_lifts_what_is_ahead_and_a_roll_bias_what_is_abeam(scene, runs):
    for bias, axis in (("[0, 1, 0]", math.cos), ("[0, 0, 1]", lambda p: -math.sin(p))):
        run = runs.run(scene(tables=f"[navigation]\nattitude_bias_deg = {bias}\n"))
        for row in runs.detections(run, "radar").values():
            lifted = row["ned_elevation_rad"] - row["elevation_rad"]
            expected = math.radians(1.0) * axis(row["azimuth_rad"])
            assert lifted == pytest.approx(expected, abs=1e-3)


def test_position_bias(scene, runs):
    run = runs.run(scene(tables=BIASED))
    first = min(runs.detections(run, "radar").values(), key=lambda row: row["tick"])
    assert first["time_s"] == 0.0
    lat, lon, alt = displaced_position(*OWN.values(), 30, -20, 5)
    assert first["own_lat_deg"] == pytest.approx(float(lat), abs=1e-12)
    assert first["own_lon_deg"] == pytest.approx(float(lon), abs=1e-12)
    assert first["own_alt_m"] == pytest.approx(float(alt), abs=1e-9)


def test_noise_has_the_given_spread_and_is_white(scene, runs):
    run = runs.run(scene(tables=NOISY, duration=60))
    by_time = {}
    for row in run["detections"].to_pylist():
        error = math.remainder(row["ned_azimuth_rad"] - row["azimuth_rad"], math.tau)
        by_time.setdefault(row["tick"], {}).setdefault("alt", row["own_alt_m"])
        if row["block"] == "radar":
            by_time[row["tick"]].setdefault("yaw", error)
    alt = np.array([item["alt"] for _, item in sorted(by_time.items())]) - 1000.0
    yaw = np.degrees([item["yaw"] for _, item in sorted(by_time.items()) if "yaw" in item])
    assert len(alt) > 300 and len(yaw) > 100
    # Four standard deviations of a sample's standard deviation.
    assert alt.std() == pytest.approx(12.0, rel=4 / math.sqrt(2 * len(alt)))
    assert yaw.std() == pytest.approx(0.5, rel=4 / math.sqrt(2 * len(yaw)))
    assert abs(alt.mean()) < 4 * 12.0 / math.sqrt(len(alt))
    neighbours = np.corrcoef(alt[1:], alt[:-1])[0, 1]
    assert abs(neighbours) < 4 / math.sqrt(len(alt))


def test_all_sensors_of_an_instant_share_one_navigation_system(scene, runs):
    believed = {}
    for row in runs.run(scene(tables=NOISY))["detections"].to_pylist():
        believed.setdefault(row["tick"], set()).add((row["own_lat_deg"], row["own_alt_m"]))
    assert all(len(positions) == 1 for positions in believed.values())


def test_sentences(scene, runs):
    for block in ("transform", "eo", "radar"):
        assert runs.sentences(scene(), block)["navigation"] == (
            "navigation: not simulated, [navigation] has no bias and no noise"
        )
        assert runs.sentences(scene(tables=BIASED), block)["navigation"] == (
            "navigation: simulated, [navigation] position_bias_m is [30.0, -20.0, 5.0] and "
            "attitude_bias_deg is [1.5, 0.0, 0.0]"
        )


def test_the_noise_of_a_late_instant_is_its_own():
    """Instants beyond 48 bits of ticks draw other numbers than those they would wrap to."""
    from types import SimpleNamespace

    from dsa_des.block.component import Context
    from dsa_des.time.randomness import Streams

    context = Context(Streams(1), sections={"navigation": Navigation(position_noise_m=(0, 0, 9))})
    believed = NavigationErrors().build(SimpleNamespace(context=context))
    ticks = np.array([7, 7 + 2**48, 7 + 2**50, 7])
    zeros = np.zeros(4)
    names = ("lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad", "roll_rad")
    states = SimpleNamespace(
        tick=ticks, run=np.zeros(4, int), **{f"own_{name}": zeros for name in names}
    )
    alt = believed(states)["alt_m"]
    assert alt[0] == alt[3] and len(set(alt.tolist())) == 3


@pytest.mark.parametrize(
    "keys",
    [
        "position_noise_m = [-1, 0, 0]",
        "attitude_bias_deg = [0, 0]",
        "attitude_noise_deg = [0,31,0]",
    ],
)
def test_bad_tables(scene, keys):
    with pytest.raises(SceneError, match=keys.split(" ")[0]):
        load_scene(scene(tables=f"[navigation]\n{keys}\n"))
