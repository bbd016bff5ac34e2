"""Flat earth, local radii and geodesic: the formulas, the stated errors and the shared contract."""

import math
import sys

import numpy as np
import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import EARTH_MODELS, LineOfSight, earth_models, ellipsoid

ALL = {name: LineOfSight(name).in_ned for name in EARTH_MODELS}
RUNGS = {name: line for name, line in ALL.items() if name != "ellipsoid"}


def pairs_at(distance_m, count=400, seed=1):
    """Random pairs a given distance apart, within ±60 degrees of latitude, 0-12 km high."""
    rng = np.random.default_rng(seed)
    lat, lon = rng.uniform(-60, 60, count), rng.uniform(-180, 180, count)
    alt, bearing = rng.uniform(0, 12_000, count), rng.uniform(0, 2 * np.pi, count)
    m, n = ellipsoid.radii_of_curvature(lat)
    lat2 = lat + np.degrees(distance_m * np.cos(bearing) / (m + alt))
    parallel = (n + alt) * np.cos(np.radians(lat))
    lon2 = lon + np.degrees(distance_m * np.sin(bearing) / parallel)
    return lat, lon, alt, lat2, lon2, alt + rng.uniform(-0.1, 0.1, count) * distance_m


def errors(rung, distance_m, **kwargs):
    pairs = pairs_at(distance_m)
    truth, got = ellipsoid.line_of_sight(*pairs), rung(*pairs, **kwargs)
    azimuth = np.abs((got[0] - truth[0] + np.pi) % (2 * np.pi) - np.pi)
    return (
        np.degrees(azimuth).max(),
        np.degrees(np.abs(got[1] - truth[1])).max(),
        np.abs(got[2] / truth[2] - 1).max(),
    )


# The tables of the docstrings: (distance, azimuth deg, elevation deg, range as a fraction).
STATED = [
    ("flat_earth", 1e3, 0.194, 0.034, 0.0056),
    ("flat_earth", 10e3, 0.20, 0.075, 0.0057),
    ("flat_earth", 50e3, 0.47, 0.27, 0.0077),
    ("local_radii", 1e3, 0.0085, 0.0049, 0.00006),
    ("local_radii", 10e3, 0.085, 0.0485, 0.00059),
    ("local_radii", 50e3, 0.425, 0.245, 0.0029),
    ("geodesic", 10e3, 0.0004, 0.0565, 0.00195),
]


@pytest.mark.parametrize(("name", "distance_m", "azimuth", "elevation", "fraction"), STATED)
def test_errors_are_as_stated(name, distance_m, azimuth, elevation, fraction):
    worst = errors(RUNGS[name], distance_m)
    limits = (azimuth, elevation, fraction)
    for error, limit in zip(worst, limits, strict=True):
        assert 0.3 * limit < error <= limit  # not above, and not quite another formula either


@pytest.mark.parametrize(
    ("own", "target", "east", "north"),
    [
        ((0.0, 0.0), (0.0, 1.0), 111195.0, 0.0),
        ((60.0, 10.0), (61.0, 11.0), 111195.0 * 0.5, 111195.0),  # the ownship's cosine
        ((0.0, 179.5), (0.0, -179.5), 111195.0, 0.0),
        ((0.0, 0.25), (0.0, 359.75), -0.5 * 111195.0, 0.0),
        ((-30.0, 5.0), (-31.0, 5.0), 0.0, -111195.0),
        ((90.0, 5.0), (89.0, 100.0), 0.0, -111195.0),
    ],
)
def test_flat_earth_is_the_corrected_equation_two(own, target, east, north):
    azimuth, elevation, slant_range = RUNGS["flat_earth"](*own, 100.0, *target, 1100.0)
    level = math.hypot(east, north)
    assert slant_range == pytest.approx(math.hypot(level, 1000.0), rel=1e-14)
    assert elevation == pytest.approx(math.atan2(1000.0, level), rel=1e-14)
    assert azimuth == pytest.approx(math.atan2(east, north) % (2 * math.pi), rel=1e-14, abs=1e-16)


def test_radii_of_curvature_against_geographiclib():
    lat = np.array([-89.0, -45.0, 0.0, 30.0, 60.0, 89.0])
    meridian, prime_vertical = ellipsoid.radii_of_curvature(lat)
    for i, phi in enumerate(lat):
        north = Geodesic.WGS84.Inverse(phi - 0.01, 0.0, phi + 0.01, 0.0)["s12"]
        assert meridian[i] == pytest.approx(north / math.radians(0.02), rel=1e-7)
        chord = ellipsoid.line_of_sight(phi, 0, 0, phi, 180, 0)[2]  # across the parallel
        assert prime_vertical[i] == pytest.approx(
            chord / 2 / math.cos(math.radians(phi)), rel=1e-13
        )
    assert ellipsoid.radii_of_curvature(90.0)[0] == pytest.approx(6399593.6257585, abs=1e-6)


def test_geodesic_is_geographiclibs_inverse():
    pairs = pairs_at(20e3, count=60, seed=8)
    azimuth, elevation, slant_range = earth_models.geodesic_line_of_sight(*pairs)
    for i, (lat1, lon1, alt1, lat2, lon2, alt2) in enumerate(zip(*pairs, strict=True)):
        solution = Geodesic.WGS84.Inverse(lat1, lon1, lat2, lon2)
        ground, rise = solution["s12"], alt2 - alt1
        assert azimuth[i] == pytest.approx(math.radians(solution["azi1"] % 360.0), abs=1e-14)
        assert elevation[i] == pytest.approx(math.atan2(rise, ground), abs=1e-15)
        assert slant_range[i] == pytest.approx(math.hypot(ground, rise), rel=1e-15)


def test_published_geodesic():
    # Wellington to Salamanca, the worked example in the documentation of GeographicLib (JavaScript)
    _, elevation, ground = earth_models.geodesic_line_of_sight(
        -41.32, 174.81, 0, 40.96, 360 - 5.50, 0
    )
    assert elevation == 0.0
    assert round(float(ground), 3) == 19959679.267


def test_both_backends_agree():
    pytest.importorskip("pyproj")
    pairs = pairs_at(20e3, count=200, seed=2)
    ours = earth_models.geodesic_line_of_sight(*pairs)
    theirs = earth_models.geodesic_line_of_sight(*pairs, backend="pyproj")
    np.testing.assert_allclose(theirs[0], ours[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(theirs[1], ours[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(theirs[2], ours[2], rtol=0, atol=1e-8)
    same = earth_models.geodesic_line_of_sight(10, 20, 5, 10, 380, 5, backend="pyproj")
    assert same == (0.0, 0.0, 0.0)


def test_missing_pyproj_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(ImportError, match=r"pip install 'dsa-des\[geodesic\]'"):
        earth_models.geodesic_line_of_sight(1, 2, 3, 4, 5, 6, backend="pyproj")


def test_unknown_backend_is_named():
    with pytest.raises(ValueError, match="backend is 'proj': it must be 'geographiclib' or"):
        earth_models.geodesic_line_of_sight(1, 2, 3, 4, 5, 6, backend="proj")


@pytest.mark.parametrize("name", ALL)
def test_same_point_and_straight_up(name):
    rung = ALL[name]
    for lat in (-90.0, -45.5, 0.0, 51.3, 90.0):
        for lon in (-180.0, -0.1, 0.0, 359.9):
            assert rung(lat, lon, 120.0, lat, lon, 120.0) == (0.0, 0.0, 0.0)
            assert rung(lat, lon, 120.0, lat, lon, 370.0) == (0.0, np.pi / 2, 250.0)
            assert rung(lat, lon, 120.0, lat, lon, 20.0) == (0.0, -np.pi / 2, 100.0)


@pytest.mark.parametrize("name", RUNGS)
def test_shape_and_bits_do_not_depend_on_each_other(name):
    rung = RUNGS[name]
    pairs = pairs_at(5e3, count=210, seed=4)
    whole = rung(*pairs)
    grid = rung(*(np.asfortranarray(x.reshape(30, 7)) for x in pairs))
    for w, g in zip(whole, grid, strict=True):
        assert g.shape == (30, 7)
        assert np.array_equal(w.reshape(30, 7), g)
    for i in (0, 17, 209):
        alone = rung(*(x[i] for x in pairs))
        assert all(w[i] == a for w, a in zip(whole, alone, strict=True))


@pytest.mark.parametrize("name", ALL)
@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    st.floats(-90, 90),
    st.floats(-720, 720),
    st.floats(-400, 40_000),
    st.floats(-90, 90),
    st.floats(-720, 720),
    st.floats(-400, 40_000),
)
def test_azimuth_and_elevation_stay_in_their_intervals(name, lat1, lon1, alt1, lat2, lon2, alt2):
    azimuth, elevation, slant_range = ALL[name](lat1, lon1, alt1, lat2, lon2, alt2)
    assert 0.0 <= azimuth < 2 * np.pi
    assert -np.pi / 2 <= elevation <= np.pi / 2
    assert slant_range >= 0.0
