"""One element gives the same bits whatever array it is evaluated in."""

import numpy as np
import pytest

from components.aircraft.aspect_tables import SilhouetteTable
from components.optical.contrast import contrast_gain
from components.optical.infrared_area import infrared_area
from components.optical.mesh import TriangleMesh
from components.optical.signature import detection_range, line_of_sight_rate, pixels_covered
from components.optical.silhouette import visible_area
from components.sensor.grid import Grid

COUNT = 10_000
AREAS = {"front_m2": 12.0, "side_m2": 30.0, "horizontal_m2": 90.0}
PIXEL = {"pixel_azimuth_rad": 6.2e-4, "pixel_elevation_rad": 5.1e-4}


def table():
    azimuth, elevation = np.arange(0.0, 360.0, 15.0), np.arange(-90.0, 91.0, 15.0)
    return SilhouetteTable(
        azimuth, elevation, 5.0 + np.abs(np.add.outer(elevation, azimuth) % 77.0)
    )


CASES = {
    "exact": lambda a, b, c, d: visible_area(a, b, c, d, **AREAS),
    "thesis": lambda a, b, c, d: visible_area(a, b, c, d, **AREAS, model="thesis"),
    "convex_hull": lambda a, b, c, d: visible_area(a, b, c, d, **AREAS, model="convex_hull"),
    "aspect_table": lambda a, b, c, d: visible_area(a, b, c, d, model="aspect_table", table=TABLE),
    "infrared": lambda a, b, c, d: infrared_area(
        a, b, c, d, **AREAS, back_m2=20, engine="turbofan"
    ),
    "pixels": lambda a, b, c, d: pixels_covered(
        np.abs(a), 1e3 * np.abs(b), **PIXEL, sensor_pixels=1e7
    ),
    "rate": lambda a, b, c, d: line_of_sight_rate(a, b, c, d, 0.05),
    "rate_thesis": lambda a, b, c, d: line_of_sight_rate(a, b, c, d, 0.05, model="thesis"),
    "range": lambda a, b, c, d: detection_range(np.abs(a), **PIXEL, contrast_gain=np.abs(b)),
    "contrast": lambda a, b, c, d: contrast_gain(
        model="daylight",
        azimuth_rad=a,
        elevation_rad=b,
        sun_azimuth_rad=c,
        sun_elevation_rad=np.abs(d) + 1e-3,
        range_m=5e3 * np.abs(a),
        visibility_m=2e4,
    ),
    "grid": lambda a, b, c, d: GRID.round(np.atleast_1d(a)).reshape(np.shape(a)),
}
TABLE = table()
GRID = Grid(6.25e-4, limit_low=-1.9, limit_high=1.9)


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.Generator(np.random.PCG64(5))
    return [rng.uniform(-1.5, 1.5, COUNT) for _ in range(4)]


@pytest.mark.parametrize("name", CASES)
def test_same_bits_in_any_shape(name, inputs):
    function = CASES[name]
    whole = function(*inputs)
    for size in (1, 7, 64, 1001):
        for start in (0, 13, 5000):
            part = function(*(x[start : start + size] for x in inputs))
            np.testing.assert_array_equal(part, whole[start : start + size])
    np.testing.assert_array_equal(function(*(x[::3] for x in inputs)), whole[::3])
    np.testing.assert_array_equal(function(*(x[::-1] for x in inputs)), whole[::-1])
    square = function(*(x.reshape(100, 4, 25).transpose(2, 0, 1) for x in inputs))
    assert square.shape == (25, 100, 4)
    np.testing.assert_array_equal(square.transpose(1, 2, 0).reshape(-1), whole)
    for index in (0, 77, COUNT - 1):
        alone = function(*(x[index] for x in inputs))
        assert np.ndim(alone) == 0 and alone == whole[index]
    # A scalar beside an array is the same as that scalar repeated.
    mixed = function(inputs[0][:5], inputs[1][9], inputs[2][:5], inputs[3][9])
    repeated = function(
        inputs[0][:5], np.full(5, inputs[1][9]), inputs[2][:5], np.full(5, inputs[3][9])
    )
    np.testing.assert_array_equal(mixed, repeated)


def test_mesh_silhouette_has_the_same_bits_in_any_shape(synthetic_aircraft, ellipsoid, directions):
    u = directions(24)
    for body in (synthetic_aircraft, ellipsoid((7.0, 1.0, 1.0))):
        mesh = TriangleMesh(*body, rows=64)
        whole = mesh.projected_area(*u)
        square = mesh.projected_area(*(x.reshape(4, 6).T for x in u))
        np.testing.assert_array_equal(square.T.reshape(-1), whole)
        assert mesh.projected_area(*(x[5] for x in u)) == whole[5]


@pytest.mark.parametrize("name", CASES)
def test_empty_arrays_pass(name):
    empty = np.empty((0, 3))
    assert CASES[name](empty, empty, empty, empty).shape == (0, 3)
