"""Gas, rain and fog against ITU's validation examples, ITU-Rpy and the figures of the errata."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.atmosphere.attenuation import (
    fog_specific_attenuation,
    fog_specific_attenuation_coefficient,
    gas_specific_attenuation,
    rain_coefficients,
    rain_specific_attenuation,
)
from components.atmosphere.standard_atmosphere import standard_atmosphere

with open(Path(__file__).with_name("itur_table.csv"), newline="") as _file:
    ITUR = list(csv.DictReader(_file))


def rows_of(quantity):
    chosen = [row for row in ITUR if row["quantity"] == quantity]
    assert len(chosen) >= 10
    return [
        [float(row[key]) for key in ("a", "b", "c", "d", "value") if row[key]] for row in chosen
    ]


def vapour_pressure_hpa(temperature_k, density):
    return density * temperature_k / 216.7


# ITU-R Study Group 3's validation examples for P.676 line by line (CG-3M3J-13), 1013.25 hPa of dry
# air, 288.15 K, 7.5 g/m³: frequency in GHz, dB/km.
ITU_GAS = [
    (12, 0.0182336522889695),
    (20, 0.108930855292919),
    (60, 14.7783166374861),
    (90, 0.380843105072424),
    (130, 0.793353787599523),
]


@pytest.mark.parametrize(("ghz", "expected"), ITU_GAS)
def test_gas_repeats_itu_validation_examples(ghz, expected):
    pressure = 1013.25 + vapour_pressure_hpa(288.15, 7.5)
    assert gas_specific_attenuation(ghz * 1e9, pressure_hpa=pressure) == pytest.approx(
        expected, rel=2e-9
    )


def test_gas_agrees_with_iturpy():
    for ghz, dry, kelvin, density, expected in rows_of("gas"):
        ours = gas_specific_attenuation(
            ghz * 1e9,
            pressure_hpa=dry + vapour_pressure_hpa(kelvin, density),
            temperature_k=kelvin,
            vapour_density_g_m3=density,
        )
        assert ours == pytest.approx(expected, rel=1e-12)


# ITU-R Study Group 3's validation examples for P.838-3: elevation and tilt in degrees, GHz, mm/h,
# dB/km.
ITU_RAIN = [
    (31.07699124, 0, 14.25, 26.48052, 1.58130839),
    (40.232036, 0, 14.25, 33.936232, 2.06173213),
    (46.35969261, 0, 29, 27.13586832, 5.03135479),
    (22.27833468, 0, 29, 50.639304, 9.42430244),
    (48.24117054, 90, 14.25, 63.62668149, 3.72901264),
    (20.14335809, 90, 29, 42.91007183, 6.83364556),
]


@pytest.mark.parametrize(("elevation", "tilt", "ghz", "rate", "expected"), ITU_RAIN)
def test_rain_repeats_itu_validation_examples(elevation, tilt, ghz, rate, expected):
    ours = rain_specific_attenuation(
        ghz * 1e9, rate, polarisation=math.radians(tilt), elevation_rad=math.radians(elevation)
    )
    assert ours == pytest.approx(expected, rel=5e-8)


def test_rain_agrees_with_iturpy():
    for ghz, tilt, elevation, rate, expected in rows_of("rain"):
        ours = rain_specific_attenuation(
            ghz * 1e9,
            rate,
            polarisation=math.radians(tilt),
            elevation_rad=math.radians(elevation),
        )
        assert ours == pytest.approx(expected, rel=1e-12)


def test_fog_agrees_with_iturpy():
    for ghz, celsius, expected in rows_of("fog"):
        ours = fog_specific_attenuation_coefficient(ghz * 1e9, celsius + 273.15)
        assert ours == pytest.approx(expected, rel=1e-12)


def test_reference_atmosphere_agrees_with_iturpy():
    for index, quantity in enumerate(("pressure", "temperature")):
        for km, expected in rows_of(quantity):
            assert standard_atmosphere(km * 1e3)[index] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("boundary_km", [11, 20, 32, 47, 51, 71])
def test_reference_atmosphere_is_continuous_where_layers_meet(boundary_km):
    # As continuous as the printed base pressures are: the last one is off by 1.6e-5.
    altitude = 6356.766e3 * boundary_km / (6356.766 - boundary_km)
    below = np.array(standard_atmosphere(altitude - 1e-3))
    above = np.array(standard_atmosphere(altitude + 1e-3))
    np.testing.assert_allclose(below, above, rtol=3e-5)


def test_reference_atmosphere_is_dry_above_the_weather_but_not_empty():
    pressure, temperature, vapour = standard_atmosphere(25e3)
    assert vapour * temperature / 216.7 == pytest.approx(2e-6 * pressure, rel=1e-12)
    assert standard_atmosphere(3e3, sea_level_vapour_density_g_m3=0.0)[2] == 0.0


def test_rain_of_a_tilt_lies_between_horizontal_and_vertical():
    k = rain_coefficients(35e9)
    horizontal, vertical, circular = (
        rain_specific_attenuation(35e9, 10.0, polarisation=name)
        for name in ("horizontal", "vertical", "circular")
    )
    assert horizontal == pytest.approx(k.k_horizontal * 10**k.alpha_horizontal, rel=1e-14)
    assert vertical == pytest.approx(k.k_vertical * 10**k.alpha_vertical, rel=1e-14)
    assert vertical < circular < horizontal
    # Looking straight up, horizontal and vertical mean the same.
    up = [
        rain_specific_attenuation(35e9, 10.0, polarisation=p, elevation_rad=math.pi / 2)
        for p in ("horizontal", "vertical", "circular")
    ]
    assert up == pytest.approx([circular] * 3, rel=1e-12)
    assert rain_specific_attenuation(35e9, 0.0) == 0.0


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    ghz=st.floats(1, 1000),
    pressure=st.floats(0.001, 1100),
    kelvin=st.floats(180, 320),
    density=st.floats(0, 30),
    rate=st.floats(0, 300),
)
def test_never_negative_and_finite(ghz, pressure, kelvin, density, rate):
    density = min(density, 0.9 * pressure * 216.7 / kelvin)
    gas = gas_specific_attenuation(
        ghz * 1e9, pressure_hpa=pressure, temperature_k=kelvin, vapour_density_g_m3=density
    )
    assert 0.0 <= gas < 1e6
    assert 0.0 <= rain_specific_attenuation(ghz * 1e9, rate) < 1e3
    if ghz <= 200:
        assert 0.0 <= fog_specific_attenuation(ghz * 1e9, rate / 100, max(kelvin, 240.0)) < 1e3


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: gas_specific_attenuation(35.0), "frequency_hz is 35: .*1e9"),
        (lambda: gas_specific_attenuation(35e9, temperature_k=15.0), "temperature_k is 15"),
        (lambda: gas_specific_attenuation(35e9, pressure_hpa=-1.0), "pressure_hpa is -1"),
        (lambda: gas_specific_attenuation(35e9, vapour_density_g_m3=2000.0), "is 2000: .*pressure"),
        (lambda: gas_specific_attenuation(math.nan), "frequency_hz is nan"),
        (lambda: rain_specific_attenuation(35e9, -5.0), "rain_rate_mm_h is -5: .*0 or more"),
        (lambda: rain_specific_attenuation(35e9, 5.0, polarisation="vertcal"), "'vertical'"),
        (lambda: rain_specific_attenuation(35e9, 5.0, polarisation=90.0), "polarisation is 90"),
        (lambda: rain_specific_attenuation(35e9, 5.0, elevation_rad=2.0), "elevation_rad is 2"),
        (lambda: fog_specific_attenuation(300e9, 0.5), r"2e\+11"),
        (lambda: fog_specific_attenuation(35e9, -0.5), "liquid_water_g_m3 is -0.5"),
        (lambda: standard_atmosphere(1e5), "altitude_m is 100000"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()
