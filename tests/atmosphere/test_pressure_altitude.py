"""What altimeters read, against tables of the standard and a hydrostatic integration."""

import numpy as np
import pytest

from components.atmosphere.pressure_altitude import (
    height_of_pressure_altitude_m,
    pressure_altitude_m,
)

#: ICAO Doc 7488: geopotential altitude, m, and pressure, hPa.
ICAO = [(0, 1013.25), (1000, 898.745), (3000, 701.085), (5000, 540.199), (8000, 355.998),
        (11000, 226.320), (20000, 54.7489)]  # fmt: skip


def pressure_hpa(height_m, qnh_hpa, offset_k):
    """Return the pressure at a height by summing thin layers of air from sea level up."""
    edges = np.linspace(0, height_m, 20_001)
    middle = 0.5 * (edges[1:] + edges[:-1])
    temperature = offset_k + np.maximum(288.15 - 0.0065 * middle, 216.65)
    return qnh_hpa * np.exp(-np.sum(9.80665 / 287.05287 / temperature * np.diff(edges)))


@pytest.mark.parametrize(("height_m", "hpa"), ICAO)
def test_tables_of_the_standard_are_met(height_m, hpa):
    # Air of that pressure at sea level reads so high, whatever is above it.
    assert pressure_altitude_m(0, qnh_hpa=hpa) == pytest.approx(height_m, abs=0.1)
    assert pressure_hpa(height_m, 1013.25, 0) == pytest.approx(hpa, rel=1e-5)


@pytest.mark.parametrize("offset_k", [-30, 0, 20])
@pytest.mark.parametrize("qnh_hpa", [960, 993, 1013.25, 1040])
@pytest.mark.parametrize("height_m", [-300, 900, 3000, 9000, 12_500])
def test_an_altimeter_reads_the_standard_height_of_the_pressure_there(height_m, qnh_hpa, offset_k):
    altitude = float(pressure_altitude_m(height_m, qnh_hpa=qnh_hpa, offset_k=offset_k))
    there = pressure_hpa(height_m, qnh_hpa, offset_k)
    assert pressure_hpa(altitude, 1013.25, 0) == pytest.approx(there, rel=1e-8)
    back_m = height_of_pressure_altitude_m(altitude, qnh_hpa=qnh_hpa, offset_k=offset_k)
    assert back_m == pytest.approx(height_m, abs=1e-6)


def test_the_standard_atmosphere_changes_no_bit():
    heights = np.array([0.1, 123.456, 7891.234, 14_000.7])
    assert (pressure_altitude_m(heights) == heights).all()
    assert (height_of_pressure_altitude_m(heights) == heights).all()


def test_arguments_are_named_where_they_are_wrong():
    for wrong in ({"qnh_hpa": 0}, {"offset_k": -100}, {"qnh_hpa": np.nan}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            pressure_altitude_m(0, **wrong)
    with pytest.raises(ValueError, match="height_m"):
        pressure_altitude_m(31_000)
