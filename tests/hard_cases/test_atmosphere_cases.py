"""Hard cases of the atmosphere, clutter and false alarms, each row with its source."""

import math

import numpy as np
import pytest

from components.atmosphere.attenuation import (
    fog_specific_attenuation,
    gas_specific_attenuation,
    rain_specific_attenuation,
)
from components.atmosphere.slant_path import (
    attenuated_range_m,
    attenuation_table,
    one_way_attenuation_db,
)
from components.atmosphere.standard_atmosphere import standard_atmosphere
from components.atmosphere.visibility import fog_visibility_m
from components.navigation.errors import displaced_lat_lon_alt
from components.radar.beam import illumination_offset_s
from components.radar.detection.clutter import clutter_detection_probability
from components.radar.detection.detector_output import false_alarm_count
from components.radar.ground_clutter import ground_clutter_rcs_m2


def clear_air(altitude_m):
    pressure, temperature, vapour = standard_atmosphere(altitude_m)
    return gas_specific_attenuation(
        35e9, pressure_hpa=pressure, temperature_k=temperature, vapour_density_g_m3=vapour
    )


# What, our value, the printed value with its last digit's half as tolerance, source.
AT_35_GHZ = [
    ("clear air, sea level", lambda: clear_air(0.0), 0.100, 5e-4, "numerical facts of the errata"),
    ("clear air, 3 km", lambda: clear_air(3000.0), 0.030, 5e-4, "numerical facts of the errata"),
    ("rain 5 mm/h, H", lambda: rain(5, "horizontal"), 1.45, 5e-3, "numerical facts of the errata"),
    ("rain 5 mm/h, V", lambda: rain(5, "vertical"), 1.32, 5e-3, "numerical facts of the errata"),
    ("rain 5 mm/h, circular", lambda: rain(5, "circular"), 1.38, 5e-3, "effects of a scene, 2"),
    ("rain 25 mm/h, H", lambda: rain(25, "horizontal"), 6.21, 5e-3, "numerical facts"),
    ("rain 25 mm/h, V", lambda: rain(25, "vertical"), 5.41, 5e-3, "numerical facts"),
    ("fog 0.5 g/m³, 10 °C", lambda: fog_specific_attenuation(35e9, 0.5), 0.40, 5e-3, "facts"),
]


def rain(rate, polarisation):
    return rain_specific_attenuation(35e9, rate, polarisation=polarisation)


@pytest.mark.parametrize(
    ("value", "printed", "half_digit"),
    [row[1:4] for row in AT_35_GHZ],
    ids=[row[0] for row in AT_35_GHZ],
)
def test_one_way_attenuation_at_35_ghz(value, printed, half_digit):
    assert value() == pytest.approx(printed, abs=half_digit)


# Rain rate in mm/h, range of a radar that reaches 6.5 km in clear air, km. Source: "done when" 2 of
# the effects; with circular polarisation and 0.1 dB/km of clear air in both.
@pytest.mark.parametrize(("rate", "about_km"), [(5.0, 3.5), (25.0, 1.9)])
def test_range_in_rain(rate, about_km):
    ours = attenuated_range_m(6500.0, rain(rate, "circular") + 0.1)
    assert ours / 1e3 == pytest.approx(about_km, abs=0.06)


LEVEL = attenuation_table(35e9)

# What, ours, expected, source of the difficulty.
EDGES = [
    (
        "a level path divides by the sine of 0",
        lambda: one_way_attenuation_db(1e4, 3000.0, 3000.0, LEVEL),
        10 * clear_air(3000.0),
        1e-12,
    ),
    (
        "a path that climbs one unit in the last place",
        lambda: one_way_attenuation_db(1e4, 3000.0, np.nextafter(3000.0, 4000.0), LEVEL),
        10 * clear_air(3000.0),
        1e-12,
    ),
    ("no attenuation: W(0)/0", lambda: attenuated_range_m(6500.0, 0.0), 6500.0, 0.0),
    ("attenuation of 1e-320 dB/km", lambda: attenuated_range_m(6500.0, 1e-320), 6500.0, 0.0),
    ("range 0", lambda: attenuated_range_m(0.0, 5.0), 0.0, 0.0),
    ("no rain: 0 to a power", lambda: rain(0.0, "vertical"), 0.0, 0.0),
    (
        "vacuum",
        lambda: gas_specific_attenuation(35e9, pressure_hpa=0.0, vapour_density_g_m3=0.0),
        0.0,
        0.0,
    ),
    ("no fog: 0 to a negative power", lambda: fog_visibility_m(0.0), math.inf, 0.0),
    (
        "clutter alone, as strong as the number range of a receiver",
        lambda: clutter_detection_probability(0.0, 1e12, false_alarm_probability=1e-12),
        1.0,
        1e-10,
    ),
    (
        "target and constant clutter may cancel: 20 dB each, Pfa 1e-6 (2 million draws)",
        lambda: clutter_detection_probability(
            100.0, 100.0, false_alarm_probability=1e-6, model="swerling0", clutter="constant"
        ),
        0.88316,
        1e-3,
    ),
    (
        "ground straight below: the cosine of the grazing angle is 0",
        lambda: ground_clutter_rcs_m2(
            100.0,
            -math.pi / 2,
            100.0,
            gamma_db=0.0,
            azimuth_beamwidth_rad=0.1,
            elevation_beamwidth_rad=0.1,
            range_resolution_m=75.0,
        ),
        100.0,
        1e-9,
    ),
    (
        "the uniform number just below 1 of a 53-bit generator",
        lambda: float(false_alarm_count(1 - 2**-53, cells=1, false_alarm_probability=0.5)),
        1.0,
        0.0,
    ),
    (
        "a target at the edge that rounding puts just before the start",
        lambda: illumination_offset_s(
            math.radians(-110) - 1e-16,
            start_rad=math.radians(-110),
            width_rad=math.radians(220),
            scan_period_s=1.0,
        ),
        0.0,
        1e-15,
    ),
    (
        "an error at the pole itself",
        lambda: displaced_lat_lon_alt(90.0, 0.0, 0.0, 0.0, 0.0, 5.0)[0],
        90.0,
        0.0,
    ),
]


@pytest.mark.parametrize(
    ("value", "expected", "tolerance"), [row[1:] for row in EDGES], ids=[row[0] for row in EDGES]
)
def test_edge(value, expected, tolerance):
    with np.errstate(all="raise", under="ignore"):
        assert value() == pytest.approx(expected, rel=tolerance, abs=0.0)
