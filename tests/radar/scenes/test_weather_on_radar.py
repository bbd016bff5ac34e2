"""What each key of [weather] takes from a radar's SNR, against loss summed along the path."""

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, chain, first_look

from components.atmosphere.attenuation import gas_specific_attenuation, rain_coefficients
from components.atmosphere.standard_atmosphere import standard_atmosphere

FREQUENCY_HZ = 35e9
BASE = {target["name"]: target for target in crooked.TARGETS}


def loss_db(**weather) -> dict[str, float]:
    """How much less SNR the radar has in this weather, by target."""
    clear = first_look(chain({"radar": HEARS_ALL}), "radar")
    cloudy = first_look(chain({"radar": HEARS_ALL}, weather=weather), "radar")
    return {name: clear[name]["snr_db"] - cloudy[name]["snr_db"] for name in BASE}


def altitudes(target: dict, steps: int = 4000) -> tuple[np.ndarray, float]:
    """Altitudes at the middles of equal steps between the two aircraft, and the slant range."""
    own_m = crooked.OWNSHIP["alt_m"]
    other_m = crooked.geodetic(crooked.position(target))[2]
    share = (np.arange(steps) + 0.5) / steps
    return own_m + share * (other_m - own_m), float(np.linalg.norm(crooked.ned(target)))


def water_db_km(temperature_c: float) -> float:
    """Specific attenuation of 1 g/m³ of droplets at 35 GHz (ITU-R P.840-8, eq. 2 to 11)."""
    theta = 300.0 / (temperature_c + 273.15)
    e0 = 77.66 + 103.3 * (theta - 1.0)
    e1, e2 = 0.0671 * e0, 3.52
    fp = 20.20 - 146.0 * (theta - 1.0) + 316.0 * (theta - 1.0) ** 2
    fs, f = 39.8 * fp, FREQUENCY_HZ / 1e9
    eps = e0 - f * ((e0 - e1) / (f - 1j * fp) + (e1 - e2) / (f - 1j * fs))
    # Rayleigh absorption: with eta = (2 + e') / e'' this is 0.819 f / (e'' (1 + eta²)).
    return 0.819 * f * abs(((eps - 1.0) / (eps + 2.0)).imag) / 3.0


@covers("fog_water_g_m3", "fog_temperature_c", of=("[weather]",))
@pytest.mark.parametrize("temperature_c", [-20.0, 10.0, 35.0])
def test_fog_attenuates_by_its_water_and_temperature(temperature_c):
    found = loss_db(fog_water_g_m3=0.4, fog_temperature_c=temperature_c, fog_top_m=9000.0)
    for name, target in BASE.items():
        _, range_m = altitudes(target)
        expected = 2.0 * 0.4 * water_db_km(temperature_c) * range_m / 1000.0
        assert found[name] == pytest.approx(expected, rel=1e-6)


@covers("fog_base_m", "fog_top_m", of=("[weather]",))
@pytest.mark.parametrize(
    ("base_m", "top_m"), [(-1000.0, 2600.0), (2500.0, 9000.0), (2100.0, 2200.0), (2410.0, 2790.0)]
)
def test_fog_fills_the_altitudes_from_its_base_to_its_top(base_m, top_m):
    found = loss_db(fog_water_g_m3=0.5, fog_base_m=base_m, fog_top_m=top_m)
    for name, target in BASE.items():
        alt_m, range_m = altitudes(target)
        inside = float(np.mean((alt_m >= base_m) & (alt_m <= top_m)))
        expected = 2.0 * 0.5 * water_db_km(10.0) * inside * range_m / 1000.0
        assert found[name] == pytest.approx(expected, rel=2e-3, abs=1e-9)


@covers("gas", "vapour_density_g_m3", of=("[weather]",))
@pytest.mark.parametrize("density", [2.0, 7.5, 25.0])
def test_gas_attenuates_by_the_vapour_and_the_altitudes_of_both_ends(density):
    steep = {**crooked.ROLLING, "up_m": 6500.0}
    clear = first_look(chain({"radar": HEARS_ALL}, targets=[steep]), "radar")["rolling"]
    weather = {"gas": True, "vapour_density_g_m3": density}
    moist = first_look(chain({"radar": HEARS_ALL}, targets=[steep], weather=weather), "radar")
    alt_m, range_m = altitudes(steep)
    pressure, temperature, vapour = standard_atmosphere(
        alt_m, sea_level_vapour_density_g_m3=density
    )
    along = gas_specific_attenuation(
        FREQUENCY_HZ, pressure_hpa=pressure, temperature_k=temperature, vapour_density_g_m3=vapour
    )
    expected = 2.0 * float(np.mean(along)) * range_m / 1000.0
    assert clear["snr_db"] - moist["rolling"]["snr_db"] == pytest.approx(expected, rel=1e-3)


@covers("rain_rate_mm_h", "rain_top_m", of=("[weather]",))
@pytest.mark.parametrize(
    ("polarisation", "balance"), [("horizontal", 1.0), ("vertical", -1.0), ("circular", 0.0)]
)
def test_rain_falls_below_its_top(polarisation, balance):
    """Half of the way to the target above lies below the top of the rain, all of that below.

    The balance is cos 2τ of ITU-R P.838-3, with τ = 0, 90 and 45 deg.
    """
    own_m = crooked.OWNSHIP["alt_m"]
    above = crooked.geodetic(crooked.position(crooked.ROLLING))[2]
    radar = {**HEARS_ALL, "polarisation": polarisation}
    weather = {"rain_rate_mm_h": 12.0, "rain_top_m": own_m + 0.5 * (above - own_m)}
    dry = first_look(chain({"radar": radar}), "radar")
    wet = first_look(chain({"radar": radar}, weather=weather), "radar")
    rain = rain_coefficients(FREQUENCY_HZ)
    for name, share in (("rolling", 0.5), ("diving", 1.0)):
        target = BASE[name]
        _, range_m = altitudes(target)
        other_m = crooked.geodetic(crooked.position(target))[2]
        sine = (other_m - own_m) / range_m
        tilt = (1.0 - sine * sine) * balance
        db_km = float(rain.specific_attenuation_db_km(np.array([12.0]), np.array([tilt]))[0])
        expected = 2.0 * share * db_km * range_m / 1000.0
        assert dry[name]["snr_db"] - wet[name]["snr_db"] == pytest.approx(expected, rel=1e-5)


def test_attenuations_add_and_follow_the_radar_s_own_carrier():
    """Two radars in one scene: each loses what its own frequency loses."""
    low = {**HEARS_ALL, "frequency_hz": 10e9}
    sensors = {"high": HEARS_ALL, "low": low}
    weather = {"rain_rate_mm_h": 8.0, "rain_top_m": 9000.0}
    for name, factor in (("high", 1.0), ("low", (10.0 / 35.0))):
        dry = first_look(chain(sensors), name)["diving"]["snr_db"]
        wet = first_look(chain(sensors, weather=weather), name)["diving"]["snr_db"]
        rain = rain_coefficients(FREQUENCY_HZ * factor)
        db_km = float(rain.specific_attenuation_db_km(np.array([8.0]), np.zeros(1))[0])
        expected = 2.0 * db_km * np.linalg.norm(crooked.ned(crooked.DIVING)) / 1000.0
        assert dry - wet == pytest.approx(expected, rel=1e-6), name
    fog = loss_db(fog_water_g_m3=0.2, fog_top_m=9000.0)["diving"]
    rain_alone = loss_db(**weather)["diving"]
    both = loss_db(**weather, fog_water_g_m3=0.2, fog_top_m=9000.0)["diving"]
    assert both == pytest.approx(fog + rain_alone)
