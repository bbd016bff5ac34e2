"""False alarms of a camera: as many as asked for, anywhere in the picture, never with a truth."""

import math
import tomllib

import pytest
from scipy.stats import norm

import dsa_des

EVERY_TENTH = "false_alarms_per_frame = 0.1"


def false_rows(run, block):
    rows = run.tables["detections"].to_pylist()
    return [row for row in rows if row["block"] == block and row["target"] is None]


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
        # Half of the looks of the higher one detect where eq. 18 gives 1, of 1 / 0.3 pixels.
        spot = 4.0 * math.pi / 3.0
        high = math.sqrt(spot / (spot + 1.0 / 0.3))
        assert camera["high"]["threshold"] == pytest.approx(high, rel=2e-5)
        assert camera["low"]["threshold"] == pytest.approx(apart * high, rel=2e-5)
        assert camera["low"]["noise"] == pytest.approx(camera["high"]["noise"], rel=2e-5)
        for name, share in (("high", 0.0001), ("low", 0.00045)):
            assert camera[name]["false_alarms_per_frame"] == pytest.approx(share, rel=1e-9)
