"""False alarms of a camera: as many as asked for, anywhere in the picture, never with a truth."""

import math
import tomllib

import numpy as np
import pytest
from scipy.stats import norm

import dsa_des
from components.aircraft.aircraft import Roster
from components.messages.detections import Detections
from components.messages.false_detections import FALSE_TARGET, add_false_detections
from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene

EVERY_TENTH = "false_alarms_per_frame = 0.1"


def false_rows(run, block):
    rows = run.tables["detections"].to_pylist()
    return [row for row in rows if row["block"] == block and row["target"] is None]


def test_windows_do_not_change_a_bit(scene, runs):
    run = runs.assert_grain_changes_nothing(scene(EVERY_TENTH, "false_alarms_per_frame = 0.5"))
    assert false_rows(run, "eo") and false_rows(run, "ir")


def test_share_of_frames(scene, runs):
    run = runs.run(scene(EVERY_TENTH, duration=600))
    frames = 6000
    alarms = false_rows(run, "eo")
    # Four standard deviations of the binomial distribution.
    assert abs(len(alarms) - 0.1 * frames) < 4 * math.sqrt(frames * 0.1)
    assert len(false_rows(run, "ir")) == 0
    azimuth = np.degrees([row["azimuth_rad"] for row in alarms])
    elevation = np.degrees([row["elevation_rad"] for row in alarms])
    for values, edge in ((azimuth, 110), (elevation, 30)):
        assert np.abs(values).max() <= edge * (1 + 1e-12)
        assert abs(values.mean()) < 4 * edge / math.sqrt(3 * len(alarms))
        assert values.std() == pytest.approx(edge / math.sqrt(3), rel=0.1)
    # On the pixel grid: multiples of 220/6144 and 60/2048 degrees.
    for values, step in ((azimuth, 220 / 6144), (elevation, 60 / 2048)):
        inside = np.abs(values) < 29.9
        steps = values[inside] / step
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


@pytest.mark.parametrize(
    "field",
    ["azimuth_deg = [150, -150]", "azimuth_deg = [-30, 30]\nmount_azimuth_deg = 180"],
    ids=["field across the tail", "mounted astern"],
)
def test_they_lie_where_the_camera_looks(scene, runs, field):
    alarms = false_rows(runs.run(scene(f"{field}\nfalse_alarms_per_frame = 0.9")), "eo")
    astern = np.array([math.remainder(row["azimuth_rad"] - math.pi, math.tau) for row in alarms])
    assert len(alarms) > 150
    assert np.abs(astern).max() <= math.radians(30) + 1e-9
    assert astern.min() < -0.4 and astern.max() > 0.4


def test_they_leave_the_targets_alone_and_have_no_truth(scene, runs):
    quiet = runs.run(scene(EVERY_TENTH + "\nfalse_alarms = false"))
    noisy = runs.run(scene(EVERY_TENTH))
    alarms = false_rows(noisy, "eo")
    assert alarms
    for row in alarms:
        assert row["true_azimuth_rad"] is None and row["true_range_m"] is None
        assert row["range_m"] is None and row["pixels"] > 0.0
        assert row["confidence"] >= 0.0 and row["declared"] is True
    found = runs.detections(noisy, "eo")
    real = {key: row for key, row in found.items() if key[1] is not None}
    assert real == runs.detections(quiet, "eo")
    scans = noisy.tables["scans"].to_pylist()
    counted = sum(row["detected"] for row in scans if row["block"] == "eo")
    assert counted == len(real) + len(alarms)


def test_a_camera_that_is_off_raises_none(scene, runs):
    path = scene("enabled = false\nfalse_alarms_per_frame = 1.0")
    assert false_rows(runs.run(path), "eo") == []
    assert runs.sentences(path, "eo")["false alarms"] == (
        "false alarms: not simulated, enabled is false"
    )


def test_sentences(scene, runs):
    assert runs.sentences(scene(), "ir")["false alarms"] == (
        "false alarms: not simulated, neither false_alarms nor false_alarms_per_frame is given"
    )
    assert runs.sentences(scene(EVERY_TENTH), "eo")["false alarms"] == (
        "false alarms: simulated, false_alarms_per_frame is 0.1"
    )


@pytest.mark.parametrize("share", ["-0.1", "1.5e5"])
def test_no_probability(scene, share):
    with pytest.raises(SceneError, match="false_alarms_per_frame"):
        load_scene(scene(f"false_alarms_per_frame = {share}"))


@pytest.mark.parametrize(("threshold", "percent"), [("low", 0.045), ("high", 0.01)])
def test_published_thresholds_are_configs(configs, threshold, percent):
    text = (configs / f"sensors/afrl_eo_{threshold}_threshold.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["false_alarms_per_frame"] == pytest.approx(percent / 100)


def test_the_two_thresholds_of_the_flight_tests_are_of_one_noise(configs):
    """As far apart as the two shares of Gaussian noise that exceed them anywhere in a picture."""
    for folder, pixels, low_key in (("sensors", 6144, "eo"), ("systems", 2048, "centre")):
        places = round(pixels * 2048 / (4.0 * math.pi * (0.25 + 1.0 / 12.0)))
        apart = norm.isf(0.00045 / places) / norm.isf(0.0001 / places)
        camera = {}
        for name in ("high", "low"):
            if folder == "systems":
                path = configs / f"systems/afrl{'_low_threshold' if name == 'low' else ''}.toml"
                scene = dsa_des.load_scene(path, duration_s=1)
            else:
                sensor = configs / f"sensors/afrl_eo_{name}_threshold.toml"
                scene = {
                    "extends": str(configs / "first_light.toml"),
                    "duration_s": 1,
                    "remove": ["blocks.eo"],
                    "blocks": {"eo": {"extends": str(sensor)}},
                }
            blocks = dsa_des.run(scene).summary["cameras"]
            camera[name] = blocks[low_key]
        assert camera["high"]["threshold"] == 1.0
        assert camera["low"]["threshold"] == pytest.approx(apart, abs=2e-5)
        assert camera["low"]["noise"] == pytest.approx(camera["high"]["noise"], rel=2e-5)
        for name, share in (("high", 0.0001), ("low", 0.00045)):
            assert camera[name]["false_alarms_per_frame"] == pytest.approx(share, rel=1e-9)


def report_of(*counts):
    """A report with entries numbered from 0, over as many scans as there are counts."""
    total = sum(counts)
    numbers = np.arange(total, dtype=np.float64)
    return Detections(
        tick=np.arange(len(counts)),
        scan=np.arange(len(counts)),
        evaluated=np.array(counts),
        skipped={},
        offsets=np.cumsum([0, *counts]),
        target=np.arange(total),
        azimuth_rad=numbers,
        elevation_rad=numbers,
        range_m=numbers,
        confidence=numbers,
        true_azimuth_rad=numbers,
        true_elevation_rad=numbers,
        true_range_m=numbers,
        extras={"pixels": numbers, "declared": np.ones(total, dtype=bool)},
        roster=Roster.of([]),
    )


def test_false_detections_follow_the_true_ones_of_their_scan():
    report = report_of(2, 0, 1)
    row = np.array([0, 1, 1, 2])
    angles = np.array([10.0, 11.0, 12.0, 13.0])
    joined = add_false_detections(
        report, row, azimuth_rad=angles, elevation_rad=-angles, confidence=angles + 0.5,
        extras={"pixels": 7.0},
    )  # fmt: skip
    assert joined.offsets.tolist() == [0, 3, 5, 7]
    assert joined.target.tolist() == [0, 1, FALSE_TARGET, FALSE_TARGET, FALSE_TARGET, 2, -1]
    assert joined.azimuth_rad.tolist() == [0, 1, 10, 11, 12, 2, 13]
    assert joined.confidence.tolist() == [0, 1, 10.5, 11.5, 12.5, 2, 13.5]
    assert np.isnan(joined.range_m).tolist() == [False, False, True, True, True, False, True]
    assert joined.extras["pixels"].tolist() == [0, 1, 7, 7, 7, 2, 7]
    assert joined.extras["declared"].tolist() == [True, True, False, False, False, True, False]
    none = np.empty(0, dtype=np.int64)
    assert add_false_detections(report, none, azimuth_rad=none, elevation_rad=none) is report
