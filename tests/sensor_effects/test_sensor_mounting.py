"""A sensor that is turned on its airframe looks and reports where it points."""

import math

import numpy as np
import pytest

from components.display.map_view import outline_of, reach_text
from components.messages.reach import Reach
from components.sensor.mounting import SensorAxes
from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene


def rotation(azimuth_deg, elevation_deg, roll_deg):
    """Body to sensor axes, from the three elementary matrices."""
    a, e, r = np.radians([azimuth_deg, elevation_deg, roll_deg])
    about_z = np.array([[math.cos(a), math.sin(a), 0], [-math.sin(a), math.cos(a), 0], [0, 0, 1]])
    about_y = np.array([[math.cos(e), 0, -math.sin(e)], [0, 1, 0], [math.sin(e), 0, math.cos(e)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(r), math.sin(r)], [0, -math.sin(r), math.cos(r)]])
    return about_x @ about_y @ about_z


def vector(azimuth, elevation):
    return np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            -np.sin(elevation),
        ]
    )


def test_axes_are_those_of_the_rotation_matrices():
    rng = np.random.default_rng(4)
    p, q = rng.uniform(-3.1, 3.1, 50), rng.uniform(-1.5, 1.5, 50)
    for mount in ((90.0, 0.0, 0.0), (0.0, -30.0, 0.0), (0.0, 0.0, 45.0), (-120.0, 20.0, 170.0)):
        rad = tuple(math.radians(angle) for angle in mount)
        axes = SensorAxes(rad, rad)
        seen = vector(*axes(p, q))
        np.testing.assert_allclose(seen, rotation(*mount) @ vector(p, q), atol=1e-14)
        back = vector(*axes.to_body(*axes(p, q)))
        np.testing.assert_allclose(back, vector(p, q), atol=1e-14)


def test_a_mounting_in_azimuth_turns_the_field_of_view(scene, runs):
    """A ±20° camera turned by 30° sees what one from 10° to 50° sees."""
    turned = scene("azimuth_deg = [-20, 20]\nmount_azimuth_deg = 30")
    first = runs.detections(runs.run(turned), "eo")
    wide = runs.detections(runs.run(scene("azimuth_deg = [10, 50]\nazimuth_pixels = 6144")), "eo")
    assert first.keys() == wide.keys() and len(first) > 30
    for key, row in first.items():
        half_pixel = math.radians(40 / 6144) / 2
        assert row["azimuth_rad"] == pytest.approx(row["true_azimuth_rad"], abs=1.01 * half_pixel)
        assert row["confidence"] == pytest.approx(wide[key]["confidence"], rel=1e-12)


def test_fields_of_view_are_drawn_as_they_are_mounted():
    reach = Reach((-math.radians(20), math.radians(20)), (-0.5, 0.5), 6000.0)
    true, believed = (math.radians(90), 0.0, 0.0), (0.0, 0.0, 0.0)
    beside = outline_of(math.radians(30), reach, SensorAxes(true, believed))
    expected = 6 * np.array([[math.sin(b), math.cos(b)] for b in np.radians([100, 140])])
    np.testing.assert_allclose(beside.corners_km[[0, 180]], expected, atol=1e-12)
    np.testing.assert_array_equal(beside.corners_km[181], [0.0, 0.0])
    assert reach_text(reach, SensorAxes(true, believed)).startswith(
        "field of view ±20°\nround 90°,"
    )
    up = SensorAxes((0.0, math.radians(60), 0.0), believed)
    middle = outline_of(0.0, reach, up).corners_km[90]
    np.testing.assert_allclose(middle, [0.0, 3.0], atol=1e-12)
    assert "60° up" in reach_text(reach, up)


def test_looking_astern_sees_nobody_ahead(scene, runs):
    run = runs.run(scene("azimuth_deg = [-60, 60]\nmount_azimuth_deg = 180"))
    ahead = [
        row for row in runs.detections(run, "eo").values() if abs(row["true_azimuth_rad"]) < 2.0
    ]
    assert ahead == []
    scans = [row for row in run.tables["scans"].to_pylist() if row["block"] == "eo"]
    assert sum(row["skipped_field_of_view"] for row in scans) > 0


def test_reports_are_off_by_the_misalignment(scene, runs):
    keys = "misalignment_deg = [0.5, 0, 0]"
    fine = runs.detections(runs.run(scene(keys, "", keys)), "radar")
    assert len(fine) > 100
    for row in fine.values():
        off = row["azimuth_rad"] - row["true_azimuth_rad"]
        assert off == pytest.approx(math.radians(0.5), abs=1e-12)
        assert row["elevation_rad"] == pytest.approx(row["true_elevation_rad"], abs=1e-12)


def test_misalignment_in_elevation_shows_ahead(scene, runs):
    fine = runs.detections(runs.run(scene("", "", "misalignment_deg = [0, -2, 0]")), "radar")
    for row in fine.values():
        # Turned about the wings' axis: all of it ahead, none abeam.
        expected = -math.radians(2.0) * math.cos(row["true_azimuth_rad"])
        off = row["elevation_rad"] - row["true_elevation_rad"]
        assert off == pytest.approx(expected, abs=2e-3)


def test_windows_do_not_change_a_bit(scene, runs):
    keys = "mount_azimuth_deg = -15\nmount_elevation_deg = 4\nmount_roll_deg = 10"
    keys += "\nmisalignment_deg = [0.2, -0.1, 0.3]"
    run = runs.assert_grain_changes_nothing(
        scene(keys + "\nfalse_alarms_per_frame = 0.2", keys, keys)
    )
    assert {"eo", "ir", "radar"} <= set(run.tables["detections"]["block"].to_pylist())


def test_sentences(scene, runs):
    path = scene("mount_azimuth_deg = 30", "misalignment_deg = [0, 0.1, 0]")
    assert runs.sentences(path, "eo")["mounting"] == (
        "mounting: simulated, mount_azimuth_deg is 30"
    )
    assert runs.sentences(path, "ir")["mounting"] == (
        "mounting: simulated, misalignment_deg is [0.0, 0.1, 0.0]"
    )
    assert runs.sentences(path, "radar")["mounting"] == (
        "mounting: not simulated, it looks along the nose and misalignment_deg is 0"
    )


@pytest.mark.parametrize(
    "keys", ["mount_elevation_deg = 91", "misalignment_deg = [0, 0]", "misalignment_deg = [0,50,0]"]
)
def test_bad_mountings(scene, keys):
    with pytest.raises(SceneError, match=keys.split(" ")[0]):
        load_scene(scene(keys))
