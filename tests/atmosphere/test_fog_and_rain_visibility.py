"""Visibility in fog and rain, and how several obscurations add up."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from components.atmosphere.visibility import (
    combined_visibility_m,
    fog_visibility_m,
    rain_extinction_per_m,
    rain_visibility_m,
)
from components.optical.contrast import visibility_transmission


def test_fog_visibility_repeats_the_published_relation():
    # Gultepe et al. 2006: 1.002 (LWC N_d)^-0.6473 km; at a product of 1 it is 1.002 km.
    assert fog_visibility_m(0.005, 200.0) == pytest.approx(1002.0, rel=1e-14)
    assert fog_visibility_m(0.1, 100.0) == pytest.approx(1002.0 * 10**-0.6473, rel=1e-14)
    # ITU-R P.840: 0.5 g/m³ is thick fog, visibility of the order of 50 m; 0.05 medium, 300 m.
    assert fog_visibility_m(0.5) == pytest.approx(50.0, rel=0.05)
    assert fog_visibility_m(0.05) == pytest.approx(300.0, rel=0.3)
    # Kunkel 1984: 0.027 km LWC^-0.88.
    assert fog_visibility_m(0.5) == pytest.approx(27.0 * 0.5**-0.88, rel=0.03)
    assert fog_visibility_m(0.0) == math.inf


@pytest.mark.parametrize("rate", [0.25, 5.0, 25.0, 100.0])
def test_rain_extinction_is_twice_the_drops_cross_section(rate):
    slope = 4.1 * rate**-0.21  # Marshall and Palmer, per mm
    per_m3 = quad(lambda d: 8000 * math.exp(-slope * d) * math.pi / 4 * d * d, 0, 40 / slope)[0]
    assert rain_extinction_per_m(rate) == pytest.approx(2e-6 * per_m3, rel=1e-6)


def test_rain_extinction_repeats_p1814():
    # Recommendation ITU-R P.1814 (2007): 1.58 R^0.63 dB/km (the other set is 1.076 R^0.67).
    for rate in (1.0, 10.0, 50.0):
        db_km = rain_extinction_per_m(rate) * 1000 * 10 / math.log(10)
        assert db_km == pytest.approx(1.58 * rate**0.63, rel=0.005)
        assert db_km == pytest.approx(1.076 * rate**0.67, rel=0.5)
    assert rain_visibility_m(0.0) == math.inf
    assert visibility_transmission(rain_visibility_m(7.0), rain_visibility_m(7.0)) == pytest.approx(
        0.02, rel=1e-3
    )


def test_extinctions_add():
    fog, rain, haze = 900.0, 4000.0, 2e4
    together = combined_visibility_m(fog, rain, haze)
    product = np.prod([visibility_transmission(1500.0, v) for v in (fog, rain, haze)])
    assert visibility_transmission(1500.0, together) == pytest.approx(product, rel=1e-12)
    assert combined_visibility_m(fog, math.inf) == fog
    assert combined_visibility_m(math.inf, math.inf) == math.inf
    assert combined_visibility_m(haze) == haze
    assert combined_visibility_m([1e-300, 1e300], 1e300) == pytest.approx([1e-300, 5e299])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: combined_visibility_m(1000.0, 0.0), "visibility_m is 0: .*above 0"),
        (lambda: combined_visibility_m(math.nan), "visibility_m is nan"),
        (lambda: visibility_transmission(1.0, 0.0), "visibility_m is 0"),
        (lambda: rain_visibility_m(-1.0), "rain_rate_mm_h is -1"),
        (lambda: fog_visibility_m(-0.1), "liquid_water_g_m3 is -0.1"),
        (lambda: fog_visibility_m(0.1, 0.0), "droplets_per_cm3 is 0"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()
