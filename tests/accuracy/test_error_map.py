"""The map of errors: what theory says of flat earth, and nothing hidden beyond its validity."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from components.geometry.error_bounds import Envelope, error_bound
from components.line_of_sight.error_map import (
    ALTITUDE_M,
    ErrorMap,
    draw_error_map,
    error_maps_of_earth_models,
)

LAT = np.array([0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 89.99])
RANGE = np.array([1e3, 2e3, 4e3, 8e3, 16e3, 32e3])

# WGS 84 at the equator: a degree of latitude is shorter there than of a sphere of 6371 km, one of
# longitude longer. A scale that differs by k in two directions turns a line by asin((k-1)/(k+1)).
NORTH_M = 6378137.0 * (1.0 - 6.69437999014e-3) + ALTITUDE_M
EAST_M = 6378137.0 + ALTITUDE_M
SCALES = 6371e3 / NORTH_M, 6371e3 / EAST_M
TURN_DEG = np.degrees(np.arcsin((SCALES[0] / SCALES[1] - 1.0) / (SCALES[0] / SCALES[1] + 1.0)))


@cache
def maps() -> dict[str, ErrorMap]:
    return {found.model: found for found in error_maps_of_earth_models(LAT, RANGE)}


@pytest.mark.parametrize("model", ["flat_earth", "local_radii"])
def test_elevation_errs_by_half_the_angle_of_the_earth_so_the_height_by_range_squared(
    model,
) -> None:
    found = maps()[model]
    for row, lat in enumerate(LAT[:3]):
        drop = found.elevation_rad[row] * RANGE
        growth = drop[1:] / drop[:-1]
        assert growth == pytest.approx(4.0, rel=0.01), lat
        assert drop == pytest.approx(RANGE**2 / (2 * 6371e3), rel=0.015), lat


def test_meridians_converge_with_the_tangent_of_latitude() -> None:
    """Local radii have no error of scale: their azimuth errs by (x² y + y³/2) tan(lat)/(N S)."""
    found = maps()["local_radii"]
    column = int(np.flatnonzero(RANGE == 8e3)[0])
    for row in (1, 2, 3, 4, 5):
        expected = 0.544 * np.tan(np.radians(LAT[row])) * RANGE[column] / 6385e3
        assert found.azimuth_rad[row, column] == pytest.approx(expected, rel=0.03)


def test_flat_earths_scale_errs_alike_at_any_short_range_and_adds_to_local_radii() -> None:
    found = maps()["flat_earth"]
    assert np.degrees(found.azimuth_rad[0]) == pytest.approx(TURN_DEG, rel=0.01)
    assert found.range_error_m[0] / RANGE == pytest.approx(SCALES[0] - 1.0, rel=1e-3)
    # All else that errs is what errs in local radii: the scale adds 0.192 degrees at most.
    added = np.degrees(np.abs(found.azimuth_rad - maps()["local_radii"].azimuth_rad))
    assert added[:-1].max() < 0.195


def test_the_pole_shows_and_is_finite() -> None:
    for model in ("flat_earth", "local_radii"):
        assert np.degrees(maps()[model].direction_rad[-1]).max() > 90.0
        assert np.isfinite(maps()[model].range_error_m).all()
    assert np.degrees(maps()["geodesic"].direction_rad[-1]).max() < 0.2


def test_the_reference_shows_its_own_rounding() -> None:
    exact = maps()["ellipsoid"]
    assert 0.0 < exact.direction_rad.max() < 1e-11
    assert 0.0 < exact.range_error_m.max() < 1e-8


@pytest.mark.parametrize("model", ["flat_earth", "local_radii", "geodesic"])
def test_the_map_stays_below_the_bounds(model: str) -> None:
    found = maps()[model]
    for row, lat in enumerate(LAT[:-1]):
        for column, range_m in enumerate(RANGE):
            height = (ALTITUDE_M - 1.0, ALTITUDE_M + 1.0)
            envelope = Envelope(range_m * (1 + 1e-9), (lat, lat), height, height)
            bound = error_bound(model, envelope)
            assert found.direction_rad[row, column] <= bound.direction_rad
            assert found.range_error_m[row, column] <= bound.range_m


def test_rows_are_flat_records_for_json() -> None:
    rows = maps()["flat_earth"].rows()
    assert len(rows) == LAT.size * RANGE.size
    assert json.loads(json.dumps(rows))[0]["rung"] == "flat_earth"
    # The largest turn, and half the angle of the Earth over the first range of 1 km.
    assert rows[0]["direction_error_deg"] == pytest.approx(TURN_DEG, rel=0.01)


def test_both_maps_are_drawn(tmp_path: Path) -> None:
    paths = draw_error_map(tmp_path)
    assert [path.name for path in paths] == ["error_map_angle.png", "error_map_range.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
