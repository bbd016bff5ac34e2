"""Every detection has the ownship's pose as it believes it to be, at the instant of the look."""

import math

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SENSORS, chain, noise_crosses, rows, run, sensor

ATTITUDE = [math.radians(crooked.OWNSHIP[f"{name}_deg"]) for name in ("yaw", "pitch", "roll")]
ANGLES = ("own_heading_rad", "own_pitch_rad", "own_roll_rad")
PLACE = ("own_lat_deg", "own_lon_deg", "own_alt_m")


def off_m(row, time_s):
    """Return how far north, east and down the believed place is from the true one, m."""
    import pymap3d

    own = crooked.geodetic(crooked.position(crooked.OWNSHIP, time_s))
    return pymap3d.geodetic2ned(*(row[name] for name in PLACE), *own)


@pytest.mark.parametrize("kind", list(SENSORS))
def test_without_errors_it_is_the_true_pose(kind):
    found = rows(run(chain({"sensor": sensor(kind, scan_rate_hz=2)}, duration_s=2)))
    assert len({row["tick"] for row in found}) == 4
    for row in found:
        np.testing.assert_allclose([row[name] for name in ANGLES], ATTITUDE, atol=1e-12)
        np.testing.assert_allclose(off_m(row, row["time_s"]), 0.0, atol=0.01)
        assert row["ned_azimuth_rad"] is None  # asked for by navigation errors only


def test_an_erring_navigation_is_believed_by_every_sensor():
    bias = {"attitude_bias_deg": [2.0, -1.0, 3.0], "position_bias_m": [40.0, -30.0, 20.0]}
    two = {"one": sensor("radar.range_boundary"), "two": sensor("optical.range_boundary")}
    found = rows(run(chain(two, navigation=bias)))
    assert {row["block"] for row in found} == {"one", "two"}
    for row in found:
        wrong = np.degrees([row[name] for name in ANGLES] - np.array(ATTITUDE))
        np.testing.assert_allclose(wrong, bias["attitude_bias_deg"], atol=1e-9)
        np.testing.assert_allclose(off_m(row, row["time_s"]), bias["position_bias_m"], atol=0.01)


@pytest.mark.parametrize("errors", [{}, {"position_bias_m": [300.0, -200.0, 50.0]}])
def test_a_sweeping_beam_tells_the_pose_of_when_it_passed(errors):
    sweeping = {**HEARS_ALL, "beam_sweep": True}
    found = rows(run(chain({"radar": sweeping}, duration_s=2, navigation=errors)))
    assert {round(row["illuminated_s"] % 1, 2) for row in found}.isdisjoint({0.0, 1.0})
    expected = errors.get("position_bias_m", [0.0] * 3)
    for row in found:
        np.testing.assert_allclose(off_m(row, row["illuminated_s"]), expected, atol=0.03)
        # At 70 m/s it has moved since its scan began, and that is seen.
        assert np.linalg.norm(np.subtract(off_m(row, row["time_s"]), expected)) > 1.0


def test_false_alarms_tell_the_pose_like_detections():
    noisy = {**HEARS_ALL, "azimuth_resolution_deg": 2, "elevation_resolution_deg": 2,
             "range_resolution_m": 150, "range_km": 3,
             **noise_crosses("radar.threshold", 1e-5)}  # fmt: skip
    for extra in ({}, {"beam_sweep": True}):
        found = rows(run(chain({"radar": {**noisy, **extra}}, duration_s=2)))
        assert {row["target"] for row in found} == {None, "rolling", "diving"}
        for row in found:
            at = row["illuminated_s"] or row["time_s"]
            np.testing.assert_allclose(off_m(row, at), 0.0, atol=0.03)
