"""One element gives the same bits whatever array it is evaluated in (part 3's pure functions)."""

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
    two_way_transmission,
)
from components.atmosphere.standard_atmosphere import standard_atmosphere
from components.atmosphere.visibility import (
    combined_visibility_m,
    fog_visibility_m,
    rain_visibility_m,
)
from components.navigation.errors import displaced_lat_lon_alt
from components.optical.detection import detection_probability, false_alarm_direction
from components.radar.beam import illumination_offset_s
from components.radar.detection.clutter import clutter_detection_probability
from components.radar.detection.detector_output import (
    false_alarm_count,
    false_alarm_snr,
)
from components.radar.ground_clutter import ground_clutter_rcs_m2

COUNT = 10_000
WEATHER = attenuation_table(
    35e9,
    rain_rate_mm_h=8.0,
    polarisation="vertical",
    fog_liquid_water_g_m3=0.1,
    fog_top_m=900.0,
)


def in_clutter(model, kind):
    return lambda a, b, c: clutter_detection_probability(
        30 * a,
        np.where(b < 0.3, 0.0, 20 * b),
        false_alarm_probability=0.01,
        model=model,
        clutter=kind,
        diffuse_cnr=c,
    )


# Functions of three arrays in [0, 1).
CASES = {
    "gas": lambda a, b, c: gas_specific_attenuation(
        1e9 + 3e11 * a,
        pressure_hpa=100 + 900 * b,
        temperature_k=200 + 100 * c,
        vapour_density_g_m3=5 * b,
    ),
    "rain": lambda a, b, c: rain_specific_attenuation(
        35e9, 50 * a, polarisation="horizontal", elevation_rad=b * c
    ),
    "fog": lambda a, b, c: fog_specific_attenuation(1e9 + 1e11 * a, b, 250 + 50 * c),
    "atmosphere": lambda a, b, c: standard_atmosphere(7e4 * a)[1] + standard_atmosphere(2e4 * b)[0],
    "path": lambda a, b, c: one_way_attenuation_db(2e4 * a, 5e3 * b, 5e3 * c, WEATHER),
    "transmission": lambda a, b, c: two_way_transmission(40 * a * b + c),
    "range": lambda a, b, c: attenuated_range_m(1e4 * a, 6 * b),
    "visibility": lambda a, b, c: combined_visibility_m(
        fog_visibility_m(a), rain_visibility_m(40 * b), 1e3 + 1e4 * c
    ),
    "clutter_steady": in_clutter("swerling0", "constant"),
    "clutter_constant": in_clutter("swerling1", "constant"),
    "clutter_chi_square": in_clutter("swerling3", "constant"),
    "clutter_fluctuating": in_clutter("swerling4", "fluctuating"),
    "ground": lambda a, b, c: ground_clutter_rcs_m2(
        8e3 * a,
        0.3 * (b - 0.5),
        10 + 500 * c,
        gamma_db=-12.0,
        azimuth_beamwidth_rad=0.09,
        elevation_beamwidth_rad=0.09,
        range_resolution_m=76.2,
    ),
    "count": lambda a, b, c: false_alarm_count(a, cells=10_000, false_alarm_probability=0.01),
    "alarm_snr": lambda a, b, c: false_alarm_snr(a, false_alarm_probability=0.01, pulses=3),
    "alarm_snr_1": lambda a, b, c: false_alarm_snr(a, false_alarm_probability=0.01),
    "sweep": lambda a, b, c: illumination_offset_s(
        9 * a - 4, start_rad=-1.9, width_rad=3.8, scan_period_s=1.0
    ),
    "frame": lambda a, b, c: detection_probability(a, b, 0.1 + c),
    "picture": lambda a, b, c: false_alarm_direction(
        a,
        b,
        azimuth_start_rad=-1.0,
        azimuth_width_rad=2.1,
        lowest_elevation_rad=-0.3,
        highest_elevation_rad=0.1,
    )[0],
    "position": lambda a, b, c: displaced_lat_lon_alt(
        180 * a - 90, 9.0, 100.0, 9.0 * b, 7.0 * c, 3.0 * b
    )[1],
}
ONE_ARGUMENT = {"count", "alarm_snr", "alarm_snr_1", "frame"}
SLOW = {"clutter_steady": 1000}


@pytest.mark.parametrize("name", CASES)
def test_same_bits_in_any_shape(name):
    function, count = CASES[name], SLOW.get(name, COUNT)
    rng = np.random.Generator(np.random.PCG64(6))
    inputs = [rng.random(count) for _ in range(3)]
    whole = function(*inputs)
    assert whole.shape == (count,)
    for size in (1, 7, 501):
        for start in (0, 13, count // 2):
            part = function(*(x[start : start + size] for x in inputs))
            np.testing.assert_array_equal(part, whole[start : start + size])
    np.testing.assert_array_equal(function(*(x[::3] for x in inputs)), whole[::3])
    np.testing.assert_array_equal(function(*(x[::-1] for x in inputs)), whole[::-1])
    box = function(*(x.reshape(10, 4, count // 40).transpose(2, 0, 1) for x in inputs))
    np.testing.assert_array_equal(box.transpose(1, 2, 0).reshape(-1), whole)
    alone = function(*(x[77] for x in inputs))
    assert np.ndim(alone) == 0 and alone == whole[77]
    empty = np.empty((0, 3))
    assert function(empty, empty, empty).shape == (0, 3)


@pytest.mark.parametrize("name", sorted(set(CASES) - ONE_ARGUMENT))
def test_scalars_broadcast(name):
    column = np.linspace(0.1, 0.9, 5)
    mixed = CASES[name](column[:, np.newaxis], column, 0.4)
    full = CASES[name](*(np.broadcast_to(x, (5, 5)) for x in (column[:, np.newaxis], column, 0.4)))
    np.testing.assert_array_equal(np.broadcast_to(mixed, (5, 5)), full)
