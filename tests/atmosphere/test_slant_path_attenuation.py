"""Attenuation along a path, and what it does to a radar's range."""

import math
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.atmosphere.attenuation import gas_specific_attenuation, rain_specific_attenuation
from components.atmosphere.slant_path import (
    STANDARD_RAIN_HEIGHT_M,
    attenuated_range_m,
    attenuation_table,
    one_way_attenuation_db,
    two_way_transmission,
)
from components.atmosphere.standard_atmosphere import standard_atmosphere
from components.radar.detection import detection_probability
from components.radar.link_budget import LinkBudget, calibrated_bandwidth, with_bandwidth

CLEAR = attenuation_table(35e9)
NOTHING = attenuation_table(35e9, gas=False)
RAIN = attenuation_table(35e9, gas=False, rain_rate_mm_h=5.0)
FOG = attenuation_table(
    35e9, gas=False, fog_liquid_water_g_m3=0.5, fog_base_m=100.0, fog_top_m=300.0
)


def gas_db_km(altitude_m):
    pressure, temperature, vapour = standard_atmosphere(altitude_m)
    return gas_specific_attenuation(
        35e9, pressure_hpa=pressure, temperature_k=temperature, vapour_density_g_m3=vapour
    )


@pytest.mark.parametrize(
    ("own", "target"), [(0, 3000), (3000, 3001), (10.0, 15000), (-400, 0), (5000, 100), (7, 7)]
)
def test_gas_path_is_the_integral_over_the_path(own, target):
    nodes, weights = np.polynomial.legendre.leggauss(60)
    mean = np.sum(weights / 2 * gas_db_km(own + (target - own) * (nodes + 1) / 2))
    path = one_way_attenuation_db(20e3, own, target, CLEAR)
    assert path == pytest.approx(20.0 * mean, rel=3e-5)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    own=st.floats(-2000, 60_000),
    target=st.floats(-2000, 60_000),
    ends=st.sampled_from(["apart", "near", "next"]),
)
def test_gas_path_is_exact_for_its_table(own, target, ends):
    if ends == "near":
        target = own + 1e-7 * target
    elif ends == "next":
        target = float(np.nextafter(own, np.inf))
    with mpmath.workdps(400):  # neighbouring doubles near 0 are 1e-323 apart
        expected = float(mean_of_table(own, target))
    ours = one_way_attenuation_db(1000.0, own, target, CLEAR)
    assert ours == pytest.approx(expected, rel=1e-11)


def mean_of_table(own, target):
    """Return the mean over altitude of the piecewise linear table, constant beyond its ends."""
    gas, step = CLEAR.gas[0], 25
    cumulative = [mpmath.mpf(0)]
    for below, above in pairwise(gas):
        cumulative.append(cumulative[-1] + (mpmath.mpf(float(below)) + float(above)) / 2)
    low, high = (mpmath.mpf(x) for x in sorted((own, target)))

    def up_to(altitude):
        x = (altitude + 1000) / step
        i = min(max(int(mpmath.floor(x)), 0), len(gas) - 2)
        t, a, b = x - i, mpmath.mpf(float(gas[i])), mpmath.mpf(float(gas[i + 1]))
        return cumulative[i] + t * a + t * t / 2 * (b - a)

    if high == low:
        return np.interp(own, -1000 + step * np.arange(len(gas)), gas)
    return (up_to(high) - up_to(low)) / (high - low) * step


def test_level_path_is_the_limit_of_a_sloping_one():
    level = one_way_attenuation_db(1e4, 1000.0, 1000.0, CLEAR)
    assert level == pytest.approx(10 * gas_db_km(1000.0), rel=1e-12)
    for climb in (1e-13, 1e-9, 1e-6, 1e-3):
        sloping = one_way_attenuation_db(1e4, 1000.0 - climb, 1000.0 + climb, CLEAR)
        assert sloping == pytest.approx(level, rel=1e-6)


def test_path_is_the_same_both_ways_and_zero_at_range_zero():
    there = one_way_attenuation_db(5e3, 100.0, 4000.0, RAIN)
    assert there == one_way_attenuation_db(5e3, 4000.0, 100.0, RAIN)
    assert one_way_attenuation_db(0.0, 100.0, 100.0, CLEAR) == 0.0
    assert np.all(one_way_attenuation_db([0.0, 1e5], 100.0, 5e3, NOTHING) == 0.0)
    assert two_way_transmission(0.0) == 1.0


def test_only_the_part_of_the_path_in_the_rain_counts():
    per_km = rain_specific_attenuation(35e9, 5.0)
    top = STANDARD_RAIN_HEIGHT_M
    assert one_way_attenuation_db(1e4, 0.0, 1000.0, RAIN) == pytest.approx(10 * per_km, rel=1e-14)
    assert one_way_attenuation_db(1e4, 0.0, 2 * top, RAIN) == pytest.approx(5 * per_km, rel=1e-14)
    assert one_way_attenuation_db(1e4, top + 1, 2 * top, RAIN) == 0.0
    assert one_way_attenuation_db(1e4, top, top, RAIN) == pytest.approx(10 * per_km, rel=1e-14)


def test_only_the_part_of_the_path_in_the_fog_counts():
    per_km = FOG.fog_db_km
    assert per_km == pytest.approx(0.40, abs=0.005)
    assert one_way_attenuation_db(1e3, 0.0, 400.0, FOG) == pytest.approx(per_km / 2, rel=1e-14)
    assert one_way_attenuation_db(1e3, 0.0, 99.0, FOG) == 0.0
    assert one_way_attenuation_db(1e3, 300.0, 300.0, FOG) == pytest.approx(per_km, rel=1e-14)


@pytest.mark.parametrize("polarisation", ["horizontal", "vertical"])
def test_rain_sees_the_elevation_of_the_path(polarisation):
    table = attenuation_table(
        35e9, gas=False, rain_rate_mm_h=20.0, rain_height_m=1e4, polarisation=polarisation
    )
    climb, distance = 1200.0, 2000.0
    expected = 2.0 * rain_specific_attenuation(
        35e9, 20.0, polarisation=polarisation, elevation_rad=math.asin(climb / distance)
    )
    ours = one_way_attenuation_db(distance, 100.0, 100.0 + climb, table)
    assert ours == pytest.approx(expected, rel=1e-13)


def test_attenuated_range_is_lambert_w():
    for clear in (1e-3, 5.6e3, 6.5e3, 2e7):
        for gamma in (0.0, 1e-30, 1e-9, 0.1, 1.38, 40.0):
            with mpmath.workdps(40):
                kappa = mpmath.mpf(gamma) * mpmath.log(10) / 20 / 1000
                expected = mpmath.lambertw(kappa * clear).real / kappa if gamma else clear
            assert attenuated_range_m(clear, gamma) == pytest.approx(float(expected), rel=1e-14)


def range_at_pd(pd, radar, table, pfa):
    """Return by bisection where the whole chain (link budget, path, Pd) gives a probability."""
    low, high = 10.0, 2e4
    for _ in range(80):
        middle = 0.5 * (low + high)
        loss = two_way_transmission(one_way_attenuation_db(middle, 500.0, 500.0, table))
        found = detection_probability(radar.snr(middle, 5.0) * loss, false_alarm_probability=pfa)
        low, high = (middle, high) if found > pd else (low, middle)
    return low


@pytest.mark.parametrize(("rain", "about_km"), [(0.0, 6.5), (5.0, 3.5), (25.0, 1.9)])
def test_rain_shortens_the_range_of_a_35_ghz_radar(rain, about_km):
    # The thesis's radar (Table 2.2), calibrated to Pd 0.9 at 6.5 km in a vacuum.
    radar = LinkBudget(
        power_w=2.5,
        antenna_gain_db=29.5,
        bandwidth_hz=1.0,
        frequency_hz=35e9,
        integration_gain_db=7.0,
        noise_figure_db=6.0,
    )
    rcs_dbsm = 10 * math.log10(5.0)
    bandwidth = calibrated_bandwidth(
        radar, rcs_dbsm=rcs_dbsm, range_km=6.5, pd=0.9, false_alarm_probability=0.05
    )
    radar = with_bandwidth(radar, bandwidth)
    table = attenuation_table(35e9, gas=False, rain_rate_mm_h=rain)
    found = range_at_pd(0.9, radar, table, 0.05)
    assert found / 1e3 == pytest.approx(about_km, abs=0.15)
    gamma = rain_specific_attenuation(35e9, rain)
    assert found == pytest.approx(attenuated_range_m(6500.0, gamma), rel=1e-9)


def test_the_curvature_left_out_is_as_small_as_said():
    # A level start at 100 m: altitude along the chord over a round Earth.
    radius, distance = 6_371_000.0, 20e3
    share = np.linspace(0.0, 1.0, 2001)
    dip = distance**2 / (2 * radius) * share * (1 - share)
    truth = np.mean(gas_db_km(1000.0 - dip)) * distance / 1e3
    ours = one_way_attenuation_db(distance, 1000.0, 1000.0, CLEAR)
    error = abs(ours / truth - 1)
    # R²/(12 · 6371 km) lower on average, of a scale height of 2 km or more.
    assert 1e-4 < error < distance**2 / (12.0 * radius) / 2000.0


def test_transmission_of_an_opaque_path_is_zero():
    assert two_way_transmission(1e9) == 0.0
    assert two_way_transmission(3.0) == pytest.approx(10**-0.6)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: attenuation_table(35e9, rain_rate_mm_h=-1.0), "rain_rate_mm_h is -1"),
        (lambda: attenuation_table(35e9, polarisation="H"), "polarisation is 'H'"),
        (lambda: attenuation_table(35e9, fog_base_m=10.0, fog_top_m=0.0), "fog_top_m is 0"),
        (lambda: attenuation_table(35e9, rain_height_m=math.nan), "rain_height_m is nan"),
        (lambda: attenuation_table(5e12), "frequency_hz is 5e"),
        (lambda: one_way_attenuation_db(-1.0, 0.0, 0.0, CLEAR), "range_m is -1"),
        (lambda: one_way_attenuation_db(1.0, math.inf, 0.0, CLEAR), "own_alt_m is inf"),
        (lambda: attenuated_range_m(1.0, -1.0), "specific_attenuation_db_km is -1"),
        (lambda: two_way_transmission(-1.0), "one_way_db is -1"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()
