"""Every detection carries the variances of its grid, in the ownship's body axes."""

import math
from types import SimpleNamespace

import crooked
import numpy as np
import pytest
from covering import RANGING, SENSORS
from scipy.stats import kstest
from wired import alone, noise_crosses, rows

from components.sensor.grid import VARIANCE_OF
from components.sensor.measurement_errors import constant_variances, lasting_errors
from components.sensor.parameters import StatedError

STEPS = {"azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 1.0}
MOUNT = {"mount_azimuth_deg": -35.0, "mount_elevation_deg": 21.0, "mount_roll_deg": -75.0}


@pytest.mark.parametrize("kind", SENSORS)
def test_a_grid_s_variance_is_a_twelfth_of_its_step_squared(kind):
    keys = {"range_resolution_m": 60.0} if kind in RANGING else {}
    found = rows(alone(kind, **STEPS, **keys), block="sensor")
    assert len(found) == len(crooked.TARGETS)
    for row in found:
        assert row["azimuth_variance_rad2"] == pytest.approx(math.radians(3.0) ** 2 / 12.0)
        assert row["elevation_variance_rad2"] == pytest.approx(math.radians(1.0) ** 2 / 12.0)
        expected = 300.0 if kind in RANGING else None
        assert row["range_variance_m2"] == expected
        assert row["range_rate_m_s"] is None and row["range_rate_variance_m2_s2"] is None


@pytest.mark.parametrize("off_deg", [(0.0, 0.0, 0.0), (7.0, -5.0, 19.0)])
@pytest.mark.parametrize("kind", SENSORS)
def test_variances_of_a_mounted_sensor_are_turned_into_body_axes(kind, off_deg):
    """By brute force: where the corners of a small cell of the sensor's grid lie in body axes.

    They are turned as the values are, by the mounting that is believed.
    """
    across, upward = np.radians([0.03, 0.01])
    steps = {name: step / 100.0 for name, step in STEPS.items()}
    turned = crooked.rotation(*np.add(list(MOUNT.values()), off_deg))
    mount = {**MOUNT, "misalignment_deg": list(off_deg)}
    for row in rows(alone(kind, **mount, **steps), block="sensor"):
        middle = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        azimuth, elevation = crooked.angles(turned @ middle)
        part = (np.arange(20) + 0.5) / 20.0 - 0.5
        corners = [
            crooked.direction(azimuth + a * across, elevation + e * upward)
            for a in part
            for e in part
        ]
        cell = [crooked.angles(turned.T @ corner) for corner in corners]
        spread = np.var(np.array(cell), axis=0)
        assert row["azimuth_variance_rad2"] == pytest.approx(spread[0], rel=5e-3)
        assert row["elevation_variance_rad2"] == pytest.approx(spread[1], rel=5e-3)


def test_false_alarms_have_the_variances_of_their_sensor():
    grid = {"azimuth_resolution_deg": 30.0, "elevation_resolution_deg": 30.0, "range_km": 5.0}
    noise = noise_crosses("radar.threshold", 0.2)
    found = rows(
        alone("radar.threshold", **grid, **noise, range_resolution_m=600.0),
        block="sensor",
        target=None,
    )
    assert found
    for row in found:
        assert row["azimuth_variance_rad2"] == pytest.approx(math.radians(30.0) ** 2 / 12.0)
        assert row["elevation_variance_rad2"] == pytest.approx(math.radians(30.0) ** 2 / 12.0)
        assert row["range_variance_m2"] == 30000.0
    frames = rows(alone("optical.eo", false_alarms_per_frame=1.0), block="sensor", target=None)
    assert [row["azimuth_variance_rad2"] for row in frames] == pytest.approx(
        [math.radians(0.01) ** 2 / 12.0] * len(frames)
    )


def test_false_alarms_err_like_what_is_there():
    """On the grid where that is kept, with the stated errors in their variances."""
    noise = {**noise_crosses("radar.threshold", 0.02), "range_km": 5.0}
    keys = {
        **noise, "errors": "stated", "azimuth_error_deg": 2.0, "range_error_m": 70.0,
        "azimuth_resolution_deg": 6.0, "elevation_resolution_deg": 5.0, "range_resolution_m": 400.0,
        "measures_range_rate": True, "range_rate_error_m_s": 2.0, "range_rate_resolution_m_s": 8.0,
    }  # fmt: skip
    names = "azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s"
    steps = np.array([math.radians(6.0), math.radians(5.0), 400.0, 8.0])
    found = rows(alone("radar.threshold", **keys), block="sensor", target=None)
    value = np.array([[row[name] for name in names] for row in found])
    assert len(value) > 300
    np.testing.assert_allclose(value / steps, np.rint(value / steps), atol=1e-9)
    assert (np.abs(value[:, 0]) <= math.pi).all() and (value[:, 2] >= 400.0).all()
    # A place within the field of view errs beyond its edge, as a target's does.
    assert value[:, 2].max() > 5000.0
    for row in found:
        assert row["azimuth_variance_rad2"] == pytest.approx(
            math.radians(2.0) ** 2 + math.radians(6.0) ** 2 / 12.0
        )
        assert row["range_variance_m2"] == pytest.approx(70.0**2 + 400.0**2 / 12.0)
        assert row["range_rate_variance_m2_s2"] == pytest.approx(2.0**2 + 8.0**2 / 12.0)
    # Of aircraft up to 250 m/s over ground, whatever the ownship's own motion takes or adds.
    course = math.radians(crooked.OWNSHIP["heading_deg"])
    speed = crooked.OWNSHIP["speed_mps"]
    over_ground = speed * math.cos(course), speed * math.sin(course), -crooked.OWNSHIP["climb_mps"]
    own_m_s = crooked.attitude(crooked.OWNSHIP) @ np.array(over_ground)
    towards = np.array([crooked.direction(row[0], row[1]) for row in value])
    ground_m_s = value[:, 3] + towards @ own_m_s
    assert np.abs(ground_m_s).max() < 250.0 + 25.0 and np.ptp(ground_m_s) > 480.0
    assert kstest(ground_m_s / 500.0 + 0.5, "uniform").pvalue > 1e-3


def stated(*given: float | bool | None) -> SimpleNamespace:
    """Parameters of a sensor that states one error: step, deviation, bias, time, drawn, share."""
    return SimpleNamespace(
        errors="stated", stated_errors=lambda steps: {"range": StatedError(*given)}
    )


@pytest.mark.parametrize(
    ("given", "step", "parts"),
    [
        # Biases stay, 4² of a fixed one and a third of it of a drawn one; deviations do not.
        ((0.0, 3.0, 4.0, 10.0, False, False), 0.0, [(16.0, math.inf, 0.0), (9.0, 10.0, 0.0)]),
        ((0.0, 3.0, 4.0, None, True, False), 0.0, [(16.0 / 3.0, math.inf, 0.0)]),
        ((6.0, 3.0, 0.0, None, True, False), 6.0, []),
        # Shares of a variance that is 0.05² of the value, and 12²/12 m² of rounding that are none.
        ((12.0, 0.03, 0.04, 5.0, False, True), 12.0,
         [(-0.64 * 12.0, math.inf, 0.64), (-0.36 * 12.0, 5.0, 0.36)]),
    ],
)  # fmt: skip
def test_what_lasts_of_stated_errors_is_their_bias_and_what_is_correlated(given, step, parts):
    found = lasting_errors(stated(*given), {})["range"]
    assert found.step == step
    assert [(p.variance, p.lasts_s, p.share) for p in found.parts] == [
        pytest.approx(part) for part in parts
    ]


def test_what_is_new_at_each_look_lasts_not_and_has_one_variance_unless_it_is_a_share():
    new = stated(0.0, 3.0, 0.0, None, False, False)
    assert lasting_errors(new, {}) == {}
    assert constant_variances(new, {}) == {VARIANCE_OF["range"]: 9.0}
    assert constant_variances(stated(0.0, 0.1, 0.0, None, False, True), {}) == {}
    new.errors = "signal"
    assert constant_variances(new, {}) == {}
