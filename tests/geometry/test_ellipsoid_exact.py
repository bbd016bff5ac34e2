"""The ellipsoid's line of sight against 40-digit arithmetic, a peer library and its symmetries."""

import warnings
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import ellipsoid, enu_to_geodetic

MP = mpmath.MPContext()  # our own precision: the global context is left alone
MP.dps = 40
A = MP.mpf(6378137)
F = 1 / MP.mpf("298.257223563")
E2 = F * (2 - F)

latitudes = st.floats(-90.0, 90.0)
longitudes = st.floats(-720.0, 720.0)
altitudes = st.floats(-400.0, 40_000.0)
fast = settings(derandomize=True, deadline=None, max_examples=100)


def ecef(lat, lon, alt):
    lat, lon, alt = MP.radians(MP.mpf(lat)), MP.radians(MP.mpf(lon)), MP.mpf(alt)
    n = A / MP.sqrt(1 - E2 * MP.sin(lat) ** 2)
    x = (n + alt) * MP.cos(lat)
    return x * MP.cos(lon), x * MP.sin(lon), (n * (1 - E2) + alt) * MP.sin(lat)


def exact_ned(pair):
    """ECEF coordinates subtracted at 40 digits, rotated into the observer's NED frame."""
    pair = [float(value) for value in pair]
    dx, dy, dz = (b - a for a, b in zip(ecef(*pair[:3]), ecef(*pair[3:]), strict=True))
    lat, lon = MP.radians(MP.mpf(pair[0])), MP.radians(MP.mpf(pair[1]))
    inward = MP.cos(lon) * dx + MP.sin(lon) * dy
    north = MP.cos(lat) * dz - MP.sin(lat) * inward
    east = MP.cos(lon) * dy - MP.sin(lon) * dx
    return north, east, -(MP.cos(lat) * inward + MP.sin(lat) * dz)


def vector(azimuth, elevation, slant_range):
    azimuth, elevation, r = (MP.mpf(float(x)) for x in (azimuth, elevation, slant_range))
    level = r * MP.cos(elevation)
    return level * MP.cos(azimuth), level * MP.sin(azimuth), -r * MP.sin(elevation)


def distance(a, b):
    return MP.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)))


def hard_pairs(count, seed):
    """Pairs near every place where a formula could lose its digits."""
    rng = np.random.default_rng(seed)
    pairs = []
    for _ in range(count):
        pole = 90.0 - 10.0 ** rng.uniform(-13, 0)
        lat = rng.choice([rng.uniform(-90, 90), 90, -90, 0, pole, -pole, 10 ** rng.uniform(-12, 0)])
        lon = rng.choice([rng.uniform(-180, 180), 180, -180, 179.99999999, 359.9, 540, -0.1, 720.1])
        alt = rng.choice([0.0, -400.0, 40_000.0, rng.uniform(-400, 40_000)])
        step = 10.0 ** rng.uniform(-8.5, 2.2)
        lat2, lon2 = lat + step * rng.uniform(-1, 1), lon + step * rng.uniform(-1, 1)
        kind = rng.integers(7)
        if kind == 0:
            lat2 = lat
        elif kind == 1:
            lon2 = lon
        elif kind == 2:  # across the pole
            lon2 = lon + 180.0 + rng.choice([0.0, 1e-9, -1e-9])
        elif kind == 3:  # antipodes
            lat2, lon2 = -lat + rng.choice([0.0, 1e-9, 1e-3]), lon + 180.0
        elif kind == 4:  # east or west by a distance, however near the pole
            lon2 = lon + rng.uniform(-1, 1) * min(step / max(np.cos(np.radians(lat)), 1e-9), 180.0)
        lon2 += rng.choice([0.0, 360.0, -360.0, 720.0])
        if abs(lat2) > 90.0:
            lat2, lon2 = np.copysign(180.0, lat2) - lat2, lon2 + 180.0
        lat2 = min(max(lat2, -90.0), 90.0)
        rise = 10.0 ** rng.uniform(-3, 3)
        alt2 = rng.choice([alt, alt + rise, alt - rise, rng.uniform(-400, 40_000)])
        pairs.append((lat, lon, alt, lat2, lon2, alt2))
    return np.array(pairs)


def test_vector_error_on_hard_pairs():
    pairs = hard_pairs(700, seed=20)
    polar = ellipsoid.line_of_sight(*pairs.T)
    ned = ellipsoid.line_of_sight_ned(*pairs.T)
    assert np.all((polar[0] >= 0.0) & (polar[0] < 2.0 * np.pi))
    for i, pair in enumerate(pairs):
        truth = exact_ned(pair)
        # The contract is 1e-12 m + 1e-13 R; NumPy's own sines may differ by an ulp or two.
        allowed = MP.mpf("1e-14") + MP.mpf("5e-15") * distance(truth, (0, 0, 0))
        assert distance(vector(*(x[i] for x in polar)), truth) <= allowed, pair
        assert distance([MP.mpf(float(x[i])) for x in ned], truth) <= allowed, pair


def test_ordinary_pairs_agree_with_pymap3d():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what the peer's imports say is not ours to judge
        pymap3d = pytest.importorskip("pymap3d")
    rng = np.random.default_rng(5)
    own = rng.uniform(-80, 80, 300), rng.uniform(-180, 180, 300), rng.uniform(0, 12_000, 300)
    target = (
        own[0] + rng.uniform(-0.1, 0.1, 300),
        own[1] + rng.uniform(-0.1, 0.1, 300),
        own[2] + rng.uniform(-1000, 1000, 300),
    )
    azimuth, elevation, slant_range = ellipsoid.line_of_sight(*own, *target)
    peer = pymap3d.geodetic2aer(*target, *own)
    np.testing.assert_allclose(np.degrees(azimuth), peer[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.degrees(elevation), peer[1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(slant_range, peer[2], rtol=0, atol=1e-8)


@fast
@given(latitudes, longitudes, altitudes, latitudes, longitudes, altitudes)
def test_range_is_symmetric(lat1, lon1, alt1, lat2, lon2, alt2):
    there = ellipsoid.line_of_sight(lat1, lon1, alt1, lat2, lon2, alt2)[2]
    back = ellipsoid.line_of_sight(lat2, lon2, alt2, lat1, lon1, alt1)[2]
    assert abs(there - back) <= 4e-15 * there + 1e-150


@fast
@given(latitudes, st.integers(-720 * 4, 720 * 4), altitudes, latitudes, longitudes, altitudes)
def test_whole_turns_of_longitude_change_no_bit(lat1, quarters, alt1, lat2, lon2, alt2):
    # Quarters of a degree stay exact when a turn is added to them.
    lon1 = quarters / 4
    here = ellipsoid.line_of_sight(lat1, lon1, alt1, lat2, lon2, alt2)
    for turns in (-3, -1, 1, 2):
        assert ellipsoid.line_of_sight(lat1, lon1 + 360 * turns, alt1, lat2, lon2, alt2) == here
        moved = lon2 + 360 * turns
        if Fraction(moved) == Fraction(lon2) + 360 * turns:
            assert ellipsoid.line_of_sight(lat1, lon1, alt1, lat2, moved, alt2) == here


@fast
@given(
    st.floats(-90.0, 90.0),
    st.floats(-1e150, 1e150),
    st.floats(-6e6, 1e9),
    st.floats(-90.0, 90.0),
    st.floats(-1e150, 1e150),
    st.floats(-6e6, 1e9),
)
def test_any_allowed_input_is_finite_and_silent(lat1, lon1, alt1, lat2, lon2, alt2):
    with np.errstate(all="raise"):
        azimuth, elevation, slant_range = ellipsoid.line_of_sight(
            lat1, lon1, alt1, lat2, lon2, alt2
        )
    assert 0.0 <= azimuth < 2.0 * np.pi
    assert -np.pi / 2 <= elevation <= np.pi / 2
    assert 0.0 <= slant_range < 3e9


def test_same_bits_in_every_shape():
    pairs = hard_pairs(10_000, seed=3)
    whole = ellipsoid.line_of_sight(*pairs.T)
    for start in range(0, 10_000, 613):
        alone = ellipsoid.line_of_sight(*pairs[start])
        seven = ellipsoid.line_of_sight(*pairs[start : start + 7].T)
        for w, one, some in zip(whole, alone, seven, strict=True):
            assert w[start] == one
            assert np.array_equal(w[start : start + 7], some)
    strided = ellipsoid.line_of_sight(*np.asfortranarray(pairs.reshape(100, 100, 6)).T)
    for w, s in zip(whole, strided, strict=True):
        assert np.array_equal(w.reshape(100, 100).T, s)


def test_shapes_broadcast_and_scalars_stay_scalars():
    results = ellipsoid.line_of_sight_ned([[1.0], [2.0]], 0, [[[5.0]], [[6.0]]], 3, [4, 5, 6], 0)
    assert all(x.shape == (2, 2, 3) for x in results)
    scalar = ellipsoid.line_of_sight_ned(2.0, 0, 6.0, 3, 5, 0)
    assert all(x.shape == () for x in scalar)
    assert all(x[1, 1, 1] == s for x, s in zip(results, scalar, strict=True))
    assert all(x.shape == (0,) for x in ellipsoid.line_of_sight(1, 2, 3, [], [], []))
    assert all(x.shape == (1,) for x in ellipsoid.line_of_sight([1], 2, 3, 4, 5, 6))


def test_skipping_validation_changes_nothing_else():
    pairs = hard_pairs(50, seed=9).T
    checked = ellipsoid.line_of_sight(*pairs)
    unchecked = ellipsoid.line_of_sight(*pairs, validate=False)
    assert all(np.array_equal(a, b) for a, b in zip(checked, unchecked, strict=True))


def test_the_range_alone_is_that_of_the_line_to_the_bit():
    own, other = hard_pairs(2000, seed=10).T[:3], hard_pairs(2000, seed=11).T[3:]
    for places in ((*own, *other), [*(x[:50, np.newaxis] for x in own), *(x[:30] for x in other)]):
        alone = ellipsoid.slant_range_m(*places)
        assert np.array_equal(alone, ellipsoid.line_of_sight(*places)[2])


def test_points_about_a_reference_each_are_those_of_each_alone():
    pymap3d = pytest.importorskip("pymap3d")
    rng = np.random.default_rng(12)
    lat, lon = rng.uniform(-85, 85, 40), rng.uniform(-180, 180, 40)
    alt = rng.uniform(0, 9000, 40)
    east, north, up = rng.uniform(-30e3, 30e3, (3, 40))
    together = enu_to_geodetic(
        east, north, up, reference_lat_deg=lat, reference_lon_deg=lon, reference_alt_m=alt
    )
    theirs = pymap3d.enu2geodetic(east, north, up, lat, lon, alt)
    assert together[0] == pytest.approx(theirs[0], abs=1e-9)
    assert np.abs((together[1] - theirs[1] + 180.0) % 360.0 - 180.0).max() < 1e-8
    assert together[2] == pytest.approx(theirs[2], abs=1e-4)
