"""Rain's reflectivity and volume against published figures, spheres after Mie, and brute force."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.special import spherical_jn, spherical_yn

from components.atmosphere.rain_echo import (
    fall_speed_m_s,
    rain_reflectivity_per_m,
    rain_shell_m3,
    rain_volume_m3,
)
from components.radar.ground_clutter import ground_ring_rcs_m2

LIGHT_M_S = 299_792_458.0


@pytest.mark.parametrize(("frequency_ghz", "rate_mm_h"), [(3.0, 4.0), (9.3, 25.0), (35.0, 1.0)])
def test_reflectivity_is_skolnik_s(frequency_ghz, rate_mm_h):
    """η = 7 f⁴ R^1.6 10⁻¹² m²/m³, f in GHz (Introduction to Radar Systems, section 7.6)."""
    eta = rain_reflectivity_per_m(rate_mm_h, LIGHT_M_S / (1e9 * frequency_ghz))
    assert eta == pytest.approx(7e-12 * frequency_ghz**4 * rate_mm_h**1.6, rel=0.01)


def backscatter_m2(diameter_m: np.ndarray, wavelength_m: float, index: complex) -> np.ndarray:
    """Backscatter of water spheres by Mie's series."""
    found = []
    for diameter in diameter_m:
        x = math.pi * diameter / wavelength_m
        n, y = np.arange(1, int(x + 4.0 * x ** (1 / 3) + 10)), index * x
        j, h = spherical_jn(n, x), spherical_jn(n, x) + 1j * spherical_yn(n, x)
        dj = j + x * spherical_jn(n, x, True)
        dh = h + x * (spherical_jn(n, x, True) + 1j * spherical_yn(n, x, True))
        jy = spherical_jn(n, y)
        djy = jy + y * spherical_jn(n, y, True)
        a = (index**2 * jy * dj - j * djy) / (index**2 * jy * dh - h * djy)
        b = (jy * dj - j * djy) / (jy * dh - h * djy)
        series = np.sum((2 * n + 1) * (-1.0) ** n * (a - b))
        found.append(abs(series) ** 2 * math.pi / (2.0 * math.pi / wavelength_m) ** 2)
    return np.array(found)


@pytest.mark.parametrize("rate_mm_h", [1.0, 4.0, 10.0, 25.0])
@pytest.mark.parametrize(
    ("frequency_hz", "index", "within_db"),
    [(9.4e9, 7.9 + 2.2j, 2.0), (35e9, 4.0 + 2.4j, 4.0)],
)
def test_up_to_35_ghz_it_is_that_of_spheres_after_mie(frequency_hz, index, within_db, rate_mm_h):
    """Drops as Marshall and Palmer counted them; indices of water at 10 deg C (Ray, 1972)."""
    wave = LIGHT_M_S / frequency_hz
    diameter_mm = np.linspace(0.1, 6.5, 120)
    count = 8000.0 * np.exp(-4.1 * rate_mm_h**-0.21 * diameter_mm)
    eta = trapezoid(count * backscatter_m2(1e-3 * diameter_mm, wave, index), diameter_mm)
    assert abs(10.0 * math.log10(rain_reflectivity_per_m(rate_mm_h, wave) / eta)) < within_db


def test_a_gaussian_beam_s_volume_is_the_integral_of_its_gain():
    """Both ways over the two angles; half of it where rain ends at the height of its axis."""
    beam = {"azimuth_beamwidth_rad": 0.1, "elevation_beamwidth_rad": 0.06,
            "range_resolution_m": 75.0}  # fmt: skip
    range_m, elevation, alt_m = 4000.0, 0.2, 3000.0
    across, up = np.meshgrid(np.linspace(-0.3, 0.3, 601), np.linspace(-0.2, 0.2, 601))
    gain = 0.25 ** (4.0 * (across / 0.1) ** 2 + 4.0 * (up / 0.06) ** 2)
    height = alt_m + range_m * (np.sin(elevation + up) - math.sin(elevation))
    for low_m, high_m in ((-math.inf, math.inf), (-math.inf, 3000.0), (2950.0, 3060.0)):
        there = gain * (height > low_m) * (height < high_m)
        volume = there.sum() * (0.6 / 600) * (0.4 / 600) * range_m**2 * 75.0
        found = rain_volume_m3(range_m, elevation, alt_m, **beam, lowest_m=low_m, highest_m=high_m)
        assert found == pytest.approx(volume, rel=0.02)


def test_the_rain_beside_a_target_of_the_issue_is_some_hundred_square_metres():
    """25 mm/h at 10 GHz, a beam of 6 deg, a cell of 76 m at 8 km: 20 dB over 5 dBsm."""
    beam = math.radians(6.0)
    volume = rain_volume_m3(
        8000.0, 0.0, 500.0, azimuth_beamwidth_rad=beam, elevation_beamwidth_rad=beam,
        range_resolution_m=76.2, lowest_m=-math.inf, highest_m=math.inf,
    )  # fmt: skip
    rcs_m2 = volume * rain_reflectivity_per_m(25.0, 0.03)
    assert 10.0 * math.log10(rcs_m2) - 5.0 == pytest.approx(20.8, abs=0.5)


@pytest.mark.parametrize(("low_m", "high_m"), [(0.0, 2000.0), (-math.inf, 1500.0), (900.0, 950.0)])
def test_a_shell_of_rain_is_counted_by_bars_of_elevation(low_m, high_m):
    range_m, own_m, depth_m = 1800.0, 1000.0, 60.0
    edges = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 200_001)
    middle = 0.5 * (edges[1:] + edges[:-1])
    height = own_m + range_m * np.sin(middle)
    bars = 2.0 * math.pi * range_m**2 * np.cos(middle) * np.diff(edges) * depth_m
    counted = float(np.sum(bars[(height > low_m) & (height < high_m)]))
    found = rain_shell_m3(range_m, own_m, range_resolution_m=depth_m, lowest_m=low_m,
                          highest_m=high_m)  # fmt: skip
    assert found == pytest.approx(counted, rel=1e-3)


def test_a_ring_of_ground_is_the_difference_of_two_discs():
    range_m, height_m, depth_m = 3000.0, 500.0, 80.0
    discs = [math.pi * ((range_m + half) ** 2 - height_m**2) for half in (-40.0, 40.0)]
    expected = 10.0**-1.2 * height_m / range_m * (discs[1] - discs[0])
    found = ground_ring_rcs_m2(range_m, height_m, gamma_db=-12.0, range_resolution_m=depth_m)
    assert found == pytest.approx(expected, rel=1e-12)
    near = ground_ring_rcs_m2(499.0, height_m, gamma_db=-12.0, range_resolution_m=depth_m)
    assert near == 0.0


def test_rain_falls_at_a_few_metres_a_second():
    assert fall_speed_m_s(0.0) == 0.0
    assert 4.0 < fall_speed_m_s(1.0) < 5.0 < fall_speed_m_s(25.0) < 9.0
