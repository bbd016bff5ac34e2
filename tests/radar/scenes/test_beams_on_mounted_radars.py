"""A sweeping beam, and what noise brings, on a radar that is turned on its airframe."""

import math

import crooked
import numpy as np
import pytest
from wired import alone, chain, noise_crosses, rows, run, sensor

MOUNT = (-35.0, 21.0, -75.0)
KEYS = dict(zip(("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg"), MOUNT, strict=True))
VIEW = {"azimuth_deg": [-60, 100], "elevation_deg": [-90, 90], "scan_rate_hz": 2}


def lit_s(row: dict, start_deg: float, width_deg: float, picture_s: float) -> float:
    """Where in its sweep the beam meets the target, at the position it is reported with."""
    (target,) = (t for t in crooked.TARGETS if t["name"] == row["target"])
    vector = crooked.body(target, picture_s)
    assert row["true_range_m"] == pytest.approx(float(np.linalg.norm(vector)), abs=0.02)
    azimuth, _ = crooked.angles(crooked.rotation(*MOUNT) @ vector)
    return 0.5 * (math.degrees(azimuth) - start_deg) / width_deg


def test_a_beam_sweeps_in_the_radar_s_own_axes():
    found = rows(alone("radar.range_boundary", **KEYS, **VIEW, beam_sweep=True))
    assert len(found) == 4
    for row in found:
        into_s = row["illuminated_s"] - row["scan"] / 2
        assert into_s == pytest.approx(lit_s(row, -60, 160, row["illuminated_s"]), abs=1e-5)


@pytest.mark.parametrize("delayed", ["traffic -> transform", "gate -> radar"])
def test_a_beam_goes_on_from_the_instant_of_a_late_picture(delayed):
    """What is 0.1 s late is of 0.1 s before, wherever on its way it was held up."""
    radar = sensor("radar.range_boundary", **KEYS, **VIEW, beam_sweep=True)
    scene = chain({"radar": radar}, duration_s=2)
    ends = delayed.split(" -> ")
    scene["wires"] = [
        "transform -> gate" if delayed.startswith("traffic") else "traffic -> transform -> gate",
        {"from": ends[0], "to": ends[1], "delay_s": 0.1},
    ]
    if delayed.startswith("traffic"):
        scene["wires"].append("gate -> radar")
    found = [row for row in rows(run(scene)) if row["scan"] > 0]
    assert len(found) == 6
    for row in found:
        into_s = row["illuminated_s"] - row["scan"] / 2
        picture_s = row["illuminated_s"] - 0.1
        assert into_s == pytest.approx(lit_s(row, -60, 160, picture_s), abs=1e-5)


def test_a_beam_meets_what_was_published_last():
    """Positions every 0.1 s, and a sweep of half a second."""
    radar = sensor("radar.range_boundary", **KEYS, **VIEW, beam_sweep=True)
    scene = chain({"radar": radar})
    scene["blocks"]["traffic"]["update_rate_hz"] = 10
    found = rows(run(scene))
    assert len(found) == 4
    for row in found:
        published_s = math.floor(10.0 * row["illuminated_s"]) / 10.0
        assert published_s < row["illuminated_s"] - 1e-3
        into_s = row["illuminated_s"] - row["scan"] / 2
        assert into_s == pytest.approx(lit_s(row, -60, 160, published_s), abs=1e-5)


@pytest.mark.parametrize("kind", ["radar.threshold", "radar.swerling", "optical.eo", "optical.ir"])
def test_false_alarms_lie_in_the_field_of_view_of_the_mounted_sensor(kind):
    """Turned into the sensor's axes, and on its grid there."""
    view = {"azimuth_deg": [10, 40], "elevation_deg": [-30, 10], "scan_rate_hz": 100}
    if kind.startswith("radar"):
        noisy = {
            **noise_crosses(kind, 3e-4), "range_km": 3.0,
            "azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 4.0,
            "range_resolution_m": 300.0,
        }  # fmt: skip
    else:
        noisy = {"false_alarms_per_frame": 0.4, "azimuth_pixels": 10, "elevation_pixels": 10}
    found = rows(alone(kind, **KEYS, **view, **noisy), block="sensor", target=None)
    assert len(found) > 15
    turned = np.array(
        [
            crooked.angles(
                crooked.rotation(*MOUNT)
                @ crooked.direction(row["azimuth_rad"], row["elevation_rad"])
            )
            for row in found
        ]
    )
    azimuth, elevation = np.degrees(turned).T
    assert 10 - 1e-6 <= azimuth.min() < 17 and 33 < azimuth.max() <= 40 + 1e-6
    assert -30 - 1e-6 <= elevation.min() < -20 and 0 < elevation.max() <= 10 + 1e-6
    np.testing.assert_allclose(azimuth / 3, np.round(azimuth / 3), atol=1e-6)
    np.testing.assert_allclose(elevation / 4, np.round(elevation / 4), atol=1e-6)
    assert abs(np.corrcoef(azimuth, elevation)[0, 1]) < 0.5
