"""Camera effects exist only when the scene calls for them, and change nothing else."""

import math

import numpy as np
import pytest

from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

CAMERAS = [
    ("", ""),
    ('background = "auto"\nsun_azimuth_deg = 20', "plume = true"),
    ("dynamic_weight = 3", "dynamic_weight = 0.5\nplume = true"),
]


@pytest.mark.parametrize(("eo", "ir"), CAMERAS)
def test_windows_and_neutral_effects_do_not_change_a_bit(scene, runs, eo, ir):
    path = scene(eo, ir)
    planned = runs.assert_grain_changes_nothing(path)
    assert {"eo", "ir"} <= set(planned.tables["detections"]["block"].to_pylist())
    plan = runs.run(path, simulate_everything=True).plan
    built = {item.effect.name for item in plan if item.built and item.block == "ir"}
    assert {"plume", "dynamic signature"} <= built


def test_sentences(scene, runs):
    off = scene()
    eo, ir = runs.sentences(off, "eo"), runs.sentences(off, "ir")
    assert eo["background and sun"] == "background and sun: not simulated, background is 'none'"
    assert eo["dynamic signature"] == "dynamic signature: not simulated, dynamic_weight is 0"
    assert ir["plume"] == "plume: not simulated, plume is false"
    on = scene('background = "sky"\ndynamic_weight = 0.25', "plume = true")
    eo, ir = runs.sentences(on, "eo"), runs.sentences(on, "ir")
    assert eo["background and sun"] == "background and sun: simulated, background is 'sky'"
    assert eo["dynamic signature"] == "dynamic signature: simulated, dynamic_weight is 0.25"
    assert ir["plume"] == "plume: simulated, plume is true and 'turbofan' has a turbofan"
    cold = scene("", "plume = true", engines=("propeller",) * 3)
    assert runs.sentences(cold, "ir")["plume"] == (
        "plume: not simulated, plume is true, but no target's engine has one"
    )


def test_what_does_not_apply_does_not_exist(scene):
    simulation = Simulation(load_scene(scene()))
    for name in ("eo", "ir"):
        assert simulation.components[name].context.effects == {}


def test_a_plume_shows_on_hot_engines_only(scene, runs):
    low = "threshold = -1"
    without, hot = (
        runs.detections(runs.run(scene("", keys)), "ir") for keys in (low, low + "\nplume = true")
    )
    assert without.keys() == hot.keys()
    gains = {engine: [] for engine in ("propeller", "turbofan", "turbojet")}
    for key, row in without.items():
        gains[key[1]].append(hot[key]["pixels"] / row["pixels"])
    assert set(gains["propeller"]) == {1.0}
    assert min(gains["turbofan"]) > 1.005
    assert np.mean(gains["turbojet"]) > np.mean(gains["turbofan"])


def test_motion_adds_to_the_signature(scene, runs):
    """E = a·Q·P + b·V, with V from successive lines of sight of one target (eq. 16-18)."""
    still, moving = (
        runs.detections(runs.run(scene(f"threshold = -1\ndynamic_weight = {b}")), "eo")
        for b in (0, 50)
    )
    assert still.keys() == moving.keys()
    compared = 0
    for (scan, target), row in still.items():
        before = still.get((scan - 1, target))
        added = moving[scan, target]["confidence"] - row["confidence"]
        if before is None:
            assert added == 0.0
            continue
        # The ownship flies level and straight, so body angles turn as the horizon's do.
        turned = math.hypot(
            (row["true_azimuth_rad"] - before["true_azimuth_rad"])
            * math.cos(row["true_elevation_rad"]),
            row["true_elevation_rad"] - before["true_elevation_rad"],
        )
        assert added == pytest.approx(50 * turned * 10, rel=1e-3, abs=1e-6)
        compared += 1
    assert compared > 300


def test_a_dark_forest_shows_a_grey_aircraft_better_than_a_bright_sky(scene, runs):
    def signature(background):
        found = runs.run(scene(f'background = "{background}"\nthreshold = -1'))
        return np.mean([row["confidence"] for row in runs.detections(found, "eo").values()])

    assert signature("ground") > signature("sky") > 1.0
