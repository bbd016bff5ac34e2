"""What altimeters read, against tables of the standard and a hydrostatic integration."""

import numpy as np
import pytest

from components.atmosphere.pressure_altitude import Air, scene_air
from components.environment.tables import Terrain, Weather

#: ICAO Doc 7488: geopotential altitude, m, and pressure, hPa.
ICAO = [(0, 1013.25), (1000, 898.745), (3000, 701.085), (5000, 540.199), (8000, 355.998),
        (11000, 226.320), (20000, 54.7489)]  # fmt: skip


#: A morning in the hills: cold at the ground, an inversion, and air that is warm aloft.
SOUNDING = ((-100.0, -8.0), (600.0, -8.0), (900.0, 4.0), (4000.0, -9.0))


def kelvin(height_m, offset_k=0.0, profile_c=()):
    """Return temperatures at heights above sea level, by hand."""
    standard = np.maximum(288.15 - 0.0065 * height_m, 216.65)
    if not profile_c:
        return standard + offset_k
    heights, celsius = np.array(profile_c).T
    off = celsius + 273.15 - np.maximum(288.15 - 0.0065 * heights, 216.65)
    outside = standard + np.where(height_m < heights[0], off[0], off[-1])
    inside = np.interp(height_m, heights, celsius) + 273.15
    return np.where((height_m < heights[0]) | (height_m > heights[-1]), outside, inside)


def pressure_hpa(height_m, qnh_hpa, **of):
    """Return the pressure at a height by summing thin layers of air from sea level up."""
    edges = np.linspace(0, height_m, 20_001)
    temperature = kelvin(0.5 * (edges[1:] + edges[:-1]), **of)
    return qnh_hpa * np.exp(-np.sum(9.80665 / 287.05287 / temperature * np.diff(edges)))


@pytest.mark.parametrize(("height_m", "hpa"), ICAO)
def test_tables_of_the_standard_are_met(height_m, hpa):
    # Air of that pressure at sea level reads so high, whatever is above it.
    assert Air(hpa).pressure_altitude_m(0) == pytest.approx(height_m, abs=0.1)
    assert pressure_hpa(height_m, 1013.25) == pytest.approx(hpa, rel=1e-5)


@pytest.mark.parametrize(
    "of", [{"offset_k": -30}, {}, {"offset_k": 20}, {"profile_c": SOUNDING},
           {"profile_c": ((2000, 12.0),)}, {"profile_c": ((12_000, -70.0), (20_000, -50.0))}],
)  # fmt: skip
@pytest.mark.parametrize("qnh_hpa", [960, 993, 1013.25, 1040])
def test_an_altimeter_reads_the_standard_height_of_the_pressure_there(qnh_hpa, of):
    air = Air(qnh_hpa, geoid_m=47.0, **of)
    heights = np.array([-300, 0, 450, 900, 3000, 9000, 12_500])
    for height_m, altitude in zip(heights, air.pressure_altitude_m(heights + 47.0), strict=True):
        there = pressure_hpa(height_m, qnh_hpa, **of)
        assert pressure_hpa(altitude, 1013.25) == pytest.approx(there, rel=1e-6)
    back_m = air.height_of_pressure_altitude_m(air.pressure_altitude_m(heights + 47.0))
    assert back_m == pytest.approx(heights + 47.0, abs=1e-6)


def test_one_row_of_a_profile_is_an_offset_and_the_standards_own_rows_are_no_change():
    heights = np.linspace(-500, 20_000, 60)
    one = Air(profile_c=((2000, 22.0),)).pressure_altitude_m(heights)
    assert one == pytest.approx(Air(offset_k=20).pressure_altitude_m(heights), abs=1e-8)
    rows = ((0, 15.0), (5000, -17.5), (11_000, -56.5))
    assert Air(profile_c=rows).pressure_altitude_m(heights) == pytest.approx(heights, abs=1e-8)


def test_the_standard_atmosphere_is_no_air_of_a_scene():
    heights = np.array([0.1, 123.456, 7891.234, 14_000.7])
    assert Air(geoid_m=30.0).height_of_pressure_altitude_m(heights) == pytest.approx(
        heights + 30.0, abs=1e-8
    )
    assert Air(geoid_m=30.0).pressure_altitude_m(heights) == pytest.approx(heights - 30.0, abs=1e-8)
    assert scene_air({}) is scene_air({"weather": Weather(), "terrain": Terrain()}) is None
    assert scene_air({"weather": Weather(qnh_hpa=993)}) == Air(993)


def test_heights_are_refused_where_they_are_wrong():
    with pytest.raises(ValueError, match="height_m"):
        Air().pressure_altitude_m(31_000)
    with pytest.raises(ValueError, match="altitude_m"):
        Air(993).height_of_pressure_altitude_m(np.nan)
