"""Infrared bands: water vapour, haze and rain, against integrals and the published laws by hand."""

import math

import mpmath
import numpy as np
import pytest

from components.atmosphere.infrared import (
    band_extinction_per_m,
    band_wavelengths_um,
    continuum_absorption_per_km,
    haze_extinction_ratio,
    long_wave_transmission,
    mid_wave_transmission,
    precipitable_water_mm,
)


def test_water_along_a_path_is_the_integral_of_its_density():
    for own, target in ((0.0, 0.0), (500.0, 4500.0), (6000.0, 100.0), (3000.0, 3000.0 + 1e-6)):
        integral = mpmath.quad(
            lambda s, a=own, b=target: 9.0 * mpmath.e ** (-(a + (b - a) * s) / 2000.0), [0, 1]
        )
        found = precipitable_water_mm(8000.0, own, target, 9.0)
        assert float(found) == pytest.approx(float(integral) * 8000.0 / 1000.0, rel=1e-9)


def test_mid_wave_windows_by_hand():
    """1 km at 7.5 g/m³ is 7.5 mm; both laws of a window meet where one takes over."""
    first = 0.827 * (0.26 / 7.5) ** 0.095
    second = 0.784 * (0.165 / 7.5) ** 0.122
    assert float(mid_wave_transmission(7.5)) == pytest.approx(0.65 * first + 0.35 * second)
    assert float(mid_wave_transmission(0.0)) == 1.0
    for water in (0.26, 0.165):
        around = mid_wave_transmission(np.array([water * (1 - 1e-9), water * (1 + 1e-9)]))
        assert around[0] == pytest.approx(around[1], rel=2e-3)
    falling = mid_wave_transmission(np.geomspace(1e-3, 300, 200))
    assert (np.diff(falling) < 2e-4).all() and falling[-1] > 0.2
    # Bands of lines: from the first kilometre to the tenth it takes less than Beer's law says.
    assert float(mid_wave_transmission(75.0)) > 0.7 * float(mid_wave_transmission(7.5))


def test_continuum_by_hand_and_with_the_square_of_humidity():
    pressure = 7.5 * 288.15 / 216.7 / 1013.25
    strength = 4.18 + 5578 * math.exp(-7.87e-3 * 1000)
    strength *= math.exp(1800 * (1 / 288.15 - 1 / 296))
    expected = strength * 0.75 * (pressure + 0.002 * (1 - pressure))
    found = float(continuum_absorption_per_km(10.0, vapour_density_g_m3=7.5))
    assert found == pytest.approx(expected, rel=1e-12) and 0.06 < found < 0.07
    humid = float(continuum_absorption_per_km(10.0, vapour_density_g_m3=15.0))
    assert 3.4 < humid / found < 4.0
    assert float(continuum_absorption_per_km(10.0, vapour_density_g_m3=0.0)) == 0.0


@pytest.mark.parametrize(("own", "target", "range_m"), [(300.0, 300.0, 5e3), (200.0, 5200.0, 12e3)])
def test_long_wave_is_the_mean_over_path_and_band(own, target, range_m):
    along = own + (target - own) * (np.arange(400) + 0.5) / 400
    wavelengths = 8.0 + 4.0 * (np.arange(400) + 0.5) / 400
    # ITU-R P.835's troposphere: 6.5 K/km, vapour falling by e every 2 km.
    temperature = 288.15 - 6.5e-3 * along
    pressure = 1013.25 * (temperature / 288.15) ** 5.2559
    depth = np.mean(
        [
            continuum_absorption_per_km(
                wavelengths, vapour_density_g_m3=12.0 * math.exp(-h / 2000), temperature_k=t,
                pressure_hpa=p,
            )
            for h, t, p in zip(along, temperature, pressure, strict=True)
        ],
        axis=0,
    )  # fmt: skip
    expected = np.exp(-depth * range_m / 1e3).mean()
    assert float(long_wave_transmission(range_m, own, target, 12.0)) == pytest.approx(
        expected, rel=2e-3
    )


def test_haze_takes_less_of_long_waves_and_fog_the_same():
    km = np.array([80.0, 20.0, 3.0, 0.8, 0.3])
    q = np.array([1.6, 1.3, 0.16 * 3 + 0.34, 0.3, 0.0])
    for band, middle in (("mwir", 4.0), ("lwir", 10.0)):
        np.testing.assert_allclose(haze_extinction_ratio(1e3 * km, band), (middle / 0.55) ** -q)
    assert band_extinction_per_m("lwir") == 0.0
    both = band_extinction_per_m("mwir", haze_visibility_m=2e4, rain_extinction_per_m=1e-4)
    assert both == pytest.approx(1e-4 + 3.912 / 2e4 * (4 / 0.55) ** -1.3)


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match="band is 'swir': it must be one of mwir, lwir"):
        band_wavelengths_um("swir")
    with pytest.raises(ValueError, match="visibility_m must be above 0"):
        haze_extinction_ratio(0.0, "mwir")
    with pytest.raises(ValueError, match="range_m"):
        long_wave_transmission(-1.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="water_mm"):
        mid_wave_transmission(-1.0)
