"""The model of visual acquisition: its closed forms, against quadrature and published numbers."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from components.visual.acquisition import (
    acquisition_rate_per_s,
    integrate_rate_while_shown,
    integrated_acquisition_rate,
    search_round_look_probability,
)

KNOT_MPS, FOOT_M, NMI_M = 1852.0 / 3600.0, 0.3048, 1852.0


def test_the_rate_is_solid_angle_times_beta():
    # By hand: 100 ft² at one mile; 17,000 · 100 / 6076.12² = 0.046047 1/s.
    rate = acquisition_rate_per_s(100.0 * FOOT_M**2, NMI_M)
    assert rate == pytest.approx(0.0460466, rel=1e-5)
    hazy = acquisition_rate_per_s(100.0 * FOOT_M**2, NMI_M, extinction_per_m=2.996 / (5.0 * NMI_M))
    assert hazy / rate == pytest.approx(math.exp(-2.996 / 5.0))


@pytest.mark.parametrize("extinction", [0.0, 2.996 / 37_040.0, 2.996 / 4_000.0])
@pytest.mark.parametrize(("from_m", "to_m"), [(9_000.0, 700.0), (math.inf, 1_300.0)])
def test_the_closed_form_is_the_integral_of_the_rate(extinction, from_m, to_m):
    def rate(range_m):
        return acquisition_rate_per_s(
            11.0, range_m, beta_per_sr_s=9_000.0, extinction_per_m=extinction
        )

    expected = quad(rate, to_m, from_m, epsabs=0.0, epsrel=1e-10)[0] / 120.0
    found = integrated_acquisition_rate(
        11.0, 120.0, from_m=from_m, to_m=to_m, beta_per_sr_s=9_000.0, extinction_per_m=extinction
    )
    assert found == pytest.approx(expected, rel=1e-8)


# Morris (2005), abstract: probability to see and avoid an aircraft of 40 ft, of an observer who
# scans all, two thirds and a third of the time, by closing speed in kt.
MORRIS = {200: (0.91, 0.60, 0.30), 300: (0.49, 0.32, 0.16), 400: (0.28, 0.18, 0.09),
          500: (0.15, 0.10, 0.05)}  # fmt: skip


@pytest.mark.parametrize("speed_kt", MORRIS)
def test_a_search_that_comes_round_gives_the_published_table(speed_kt):
    # Shown from where 40 ft are 9', seen 12.5 s before at the latest, a round of 36 s.
    shows_m = 40.0 * FOOT_M / math.radians(9.0 / 60.0)
    speed = speed_kt * KNOT_MPS
    for looking, published in zip((1.0, 2.0 / 3.0, 1.0 / 3.0), MORRIS[speed_kt], strict=True):
        found = search_round_look_probability(
            speed, from_m=shows_m, to_m=12.5 * speed, round_s=36.0, looking=looking
        )
        # "Less than" the numbers of two places, as the abstract says of an upper bound.
        assert published - 0.005 < found < published + 0.01


def test_no_poisson_search_gives_that_table():
    # With a share of the rate, two thirds of the time are worth more than two thirds of 0.91.
    opportunity = -math.log1p(-0.91)
    assert 1.0 - math.exp(-2.0 / 3.0 * opportunity) > 0.75
    # And without haze the opportunity would fall with the square of the speed: 2.4 to 0.39.
    assert -math.log1p(-0.15) < 0.5 * opportunity * (200 / 500) ** 2


def test_stretches_begin_and_end_where_something_begins_and_ends_to_show():
    # A rate of exp(t) that shows in (-0.731, -0.2); in all; in none; and in an interval of none.
    edges = np.array([[-0.731, -0.2], [-9.0, 9.0], [5.0, 6.0], [-9.0, 9.0]])

    def shown(cell, ahead_s):
        return (ahead_s > edges[cell, 0]) & (ahead_s < edges[cell, 1])

    def rate(cell, ahead_s):
        assert shown(cell, ahead_s).all(), "asked where nothing shows"
        return np.exp(ahead_s)

    found = integrate_rate_while_shown(np.array([1.0, 2.0, 1.0, 0.0]), shown, rate)
    expected = [math.exp(-0.2) - math.exp(-0.731), 1.0 - math.exp(-2.0), 0.0, 0.0]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-15)


def test_what_is_impossible_is_refused():
    with pytest.raises(ValueError, match=r"from_m is 100: it must be at least to_m, 200"):
        integrated_acquisition_rate(1.0, 1.0, from_m=100.0, to_m=200.0)
    with pytest.raises(ValueError, match="range_m"):
        acquisition_rate_per_s(1.0, 0.0)
