"""Severity of a loss and probability of a collision, against other ways to find them."""

import mpmath
import numpy as np
import pytest

from components.well_clear.severity import (
    altimeter_error_mixture,
    collision_probability,
    horizontal_miss_distance_m,
    laplace_difference_exceedance,
    loss_severity_percent,
)

FOOT_M = 0.3048


def state(*parts):
    return tuple(np.array([float(part)]) for part in parts)


def norm(x, y):
    """The Fernandez-Guasti norm as it is defined, for two penetrations."""
    return mpmath.sqrt(x**2 + (1 - x**2) * y**2)


def test_severity_is_the_norm_taken_twice():
    relative = state(-900, 250, 60, 70, -12, -1.5)
    d, tau = 4000 * mpmath.mpf("0.3048"), 35
    x, y, z, vx, vy, _ = (mpmath.mpf(float(part[0])) for part in relative)
    r = mpmath.hypot(x, y)
    rate = (x * vx + y * vy) / r
    scale = max(d, (mpmath.sqrt((rate * tau) ** 2 + 4 * d * d) - rate * tau) / 2)
    miss = abs(x * vy - y * vx) / mpmath.hypot(vx, vy)
    both = norm(r / scale, miss / d)
    wanted = 100 * (1 - norm(both, z / (450 * mpmath.mpf("0.3048"))))
    assert loss_severity_percent(relative)[0] == pytest.approx(float(wanted), rel=1e-13)


@pytest.mark.parametrize(
    ("relative", "wanted"),
    [
        ((0, 0, 0, 0, 0, 0), 100.0),
        ((0, 0, 450 * FOOT_M, 0, 0, 0), 0.0),
        ((4000 * FOOT_M, 0, 0, 0, 0, 0), 0.0),
        ((3000 * FOOT_M, 0, 0, 0, -80, 0), 100 * (1 - mpmath.sqrt(1 - (1 - 0.5625) ** 2))),
    ],
)
def test_severity_of_states_worked_by_hand(relative, wanted):
    assert loss_severity_percent(state(*relative))[0] == pytest.approx(float(wanted), abs=1e-10)


def test_severity_keeps_its_digits_where_it_is_small():
    height_m = 450 * FOOT_M * (1 - 1e-12)
    found = loss_severity_percent(state(0, 0, height_m, 0, 0, 0))[0]
    # As the height is written in doubles, at 40 digits.
    with mpmath.workdps(40):
        y = mpmath.mpf(height_m) / mpmath.mpf(450 * FOOT_M)
        assert found == pytest.approx(float(100 * (1 - y)), rel=1e-3)
    assert 0.9e-10 < found < 1.1e-10


def test_a_miss_distance_that_is_past_is_the_distance_now():
    assert horizontal_miss_distance_m(state(300, 400, 0, 50, 0, 0))[0] == pytest.approx(500.0)
    assert horizontal_miss_distance_m(state(-300, 400, 0, 50, 0, 0))[0] == pytest.approx(400.0)


@pytest.mark.parametrize("scales", [(35.0, 58.0), (43.0, 43.0), (43.0, 43.0 * (1 + 1e-8))])
@pytest.mark.parametrize("height", [0.0, 12.5, -80.0, 400.0])
def test_the_tail_of_the_difference_is_the_integral(height, scales):
    one, other = (mpmath.mpf(scale) for scale in scales)

    def beyond(error):
        """Chance that the other error is below `error - height`, times the density."""
        at = error - height
        below = mpmath.exp(at / other) / 2 if at < 0 else 1 - mpmath.exp(-at / other) / 2
        return below * mpmath.exp(-abs(error) / one) / (2 * one)

    kinks = sorted({-mpmath.inf, mpmath.mpf(0), mpmath.mpf(height), mpmath.inf})
    wanted = mpmath.quad(beyond, kinks)
    assert laplace_difference_exceedance(height, *scales) == pytest.approx(float(wanted), rel=1e-10)


def test_a_collision_needs_a_small_miss_distance():
    near, far = 499 * FOOT_M, 500 * FOOT_M
    low = (700.0, 2000.0)
    found = collision_probability([near, far], [0.0, 0.0], low)
    assert 0.5 < found[0] < 1.0 and found[1] == 0.0
    heights = collision_probability(np.full(3, near), [0.0, 60.0, -60.0], low)
    assert heights[0] > heights[1] == pytest.approx(heights[2])


def test_mode_c_mixes_two_altimeters():
    altitude_m = 3000 * FOOT_M
    (good, scale), (poor, other) = altimeter_error_mixture(altitude_m, True)
    assert (good, poor) == pytest.approx((0.320, 0.680))
    assert (scale / FOOT_M, other / FOOT_M) == pytest.approx((38.0, 60.0))
    near = ([10.0], [20.0], (altitude_m, altitude_m))
    assert collision_probability(*near, (True, True)) < collision_probability(*near)
