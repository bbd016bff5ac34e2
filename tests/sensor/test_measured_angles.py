"""What sensors report: true angles on the grid of their own axes, as they believe to be mounted."""

import math

import crooked
import numpy as np
import pytest
from covering import CAMERAS, RANGING, SENSORS, covers
from wired import alone, rows

BODY = {target["name"]: crooked.body(target) for target in crooked.TARGETS}
MOUNTS = ("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg")


def reports(kind: str, **keys) -> dict[str, dict]:
    found = {row["target"]: row for row in rows(alone(kind, **keys), block="sensor")}
    assert found.keys() == BODY.keys()
    return found


def on_grid(value: float, step: float) -> float:
    return step * round(value / step)


@covers("azimuth_resolution_deg", "elevation_resolution_deg", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(("across_deg", "up_deg"), [(7.0, 3.0), (3.0, 11.0)])
def test_reports_are_on_the_grid_of_each_angle(kind, across_deg, up_deg):
    found = reports(kind, azimuth_resolution_deg=across_deg, elevation_resolution_deg=up_deg)
    for name, vector in BODY.items():
        azimuth, elevation = crooked.angles(vector)
        assert found[name]["true_azimuth_rad"] == pytest.approx(azimuth, abs=1e-9)
        assert found[name]["true_elevation_rad"] == pytest.approx(elevation, abs=1e-9)
        expected = on_grid(azimuth, math.radians(across_deg))
        assert found[name]["azimuth_rad"] == pytest.approx(expected, abs=1e-9)
        expected = on_grid(elevation, math.radians(up_deg))
        assert found[name]["elevation_rad"] == pytest.approx(expected, abs=1e-9)


@covers("range_resolution_m", of=RANGING)
@pytest.mark.parametrize("kind", SENSORS)
def test_ranges_are_on_their_grid_where_they_are_measured(kind):
    if kind not in RANGING:
        assert all(row["range_m"] is None for row in reports(kind).values())
        return
    exact = reports(kind)
    coarse = reports(kind, range_resolution_m=70.0)
    for name, vector in BODY.items():
        range_m = float(np.linalg.norm(vector))
        assert exact[name]["range_m"] == pytest.approx(range_m, abs=1e-6)
        assert coarse[name]["range_m"] == pytest.approx(on_grid(range_m, 70.0), abs=1e-6)
        assert coarse[name]["true_range_m"] == pytest.approx(range_m, abs=1e-6)


@covers("misalignment_deg", *MOUNTS, of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("error", [(4.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 9.0)])
def test_reports_are_off_by_what_is_believed_of_the_mounting(kind, error):
    mount = (-35.0, 21.0, -75.0)
    fine = {"azimuth_resolution_deg": 1e-7, "elevation_resolution_deg": 1e-7}
    keys = dict(zip(MOUNTS, mount, strict=True))
    found = reports(kind, misalignment_deg=list(error), **keys, **fine)
    believed = [angle + off for angle, off in zip(mount, error, strict=True)]
    for name, vector in BODY.items():
        reported = crooked.rotation(*believed).T @ crooked.rotation(*mount) @ vector
        there = crooked.direction(found[name]["azimuth_rad"], found[name]["elevation_rad"])
        np.testing.assert_allclose(there, reported / np.linalg.norm(reported), atol=1e-8)


@pytest.mark.parametrize("kind", SENSORS)
def test_the_grid_lies_in_the_sensor_s_own_axes(kind):
    mount = (-35.0, 21.0, -75.0)
    steps = {"azimuth_resolution_deg": 7.0, "elevation_resolution_deg": 3.0}
    found = reports(kind, **dict(zip(MOUNTS, mount, strict=True)), **steps)
    turned = crooked.rotation(*mount)
    for name, vector in BODY.items():
        azimuth, elevation = crooked.angles(turned @ vector)
        cell = on_grid(azimuth, math.radians(7.0)), on_grid(elevation, math.radians(3.0))
        there = crooked.direction(found[name]["azimuth_rad"], found[name]["elevation_rad"])
        np.testing.assert_allclose(there, turned.T @ crooked.direction(*cell), atol=1e-9)


@covers("azimuth_pixels", "elevation_pixels", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_camera_s_grid_and_pixels_follow_from_its_picture(kind):
    """90 by 40 deg in 30 by 20 pixels: 3 deg across and 2 deg up."""
    view = {"azimuth_deg": [-45, 45], "elevation_deg": [-30, 10]}
    found = reports(kind, azimuth_pixels=30, elevation_pixels=20, **view)
    finer = reports(kind, azimuth_pixels=90, elevation_pixels=20, **view)
    taller = reports(kind, azimuth_pixels=30, elevation_pixels=80, **view)
    for name, vector in BODY.items():
        azimuth, elevation = crooked.angles(vector)
        row = found[name]
        assert row["azimuth_rad"] == pytest.approx(on_grid(azimuth, math.radians(3.0)), abs=1e-9)
        assert row["elevation_rad"] == pytest.approx(
            on_grid(elevation, math.radians(2.0)), abs=1e-9
        )
        assert finer[name]["pixels"] == pytest.approx(3.0 * row["pixels"])
        # A line one pixel high loses height as pixels do.
        lines = 1.0 if kind == "optical.projection" else 4.0
        assert taller[name]["pixels"] == pytest.approx(lines * row["pixels"])


@covers("declare_m", "declare_n", of=SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(("m", "n", "first"), [(1, 1, 0), (2, 3, 1), (3, 3, 2), (4, 6, 3)])
def test_a_target_is_declared_after_m_detections(kind, m, n, first):
    found = alone(kind, declare_m=m, declare_n=n, scan_rate_hz=8)
    for target in BODY:
        declared = [row["declared"] for row in rows(found, block="sensor", target=target)]
        assert declared == [scan >= first for scan in range(8)]
    told = found.info["summary"]["declarations"]["sensor"]
    assert told["rolling"]["time_s"] == pytest.approx(first / 8)
    assert told["rolling"]["range_m"] == pytest.approx(
        float(np.linalg.norm(crooked.ned(crooked.ROLLING, first / 8))), abs=0.02
    )


def test_only_the_last_n_looks_count():
    """A radar that misses now and then: counted by hand from one that has no rule."""
    radar = {"power_w": 2.0, "false_alarm_probability": 1e-4, "scan_rate_hz": 40}
    one = alone("radar.swerling", **radar)
    hits = {row["scan"] for row in rows(one, target="rolling")}
    assert 10 < len(hits) < 38
    ruled = alone("radar.swerling", **radar, declare_m=3, declare_n=4)
    seen = rows(ruled, target="rolling")
    assert {row["scan"] for row in seen} == hits
    for row in seen:
        last = sum(scan in hits for scan in range(row["scan"] - 3, row["scan"] + 1))
        assert row["declared"] is (last >= 3)
