"""Proven bounds of the models of the line of sight, against an adversarial search."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import (
    LineOfSight,
    body_angles_of_sight_line,
    earth_models,
    ellipsoid,
    enu_to_geodetic,
    unit_vector,
)
from components.geometry.error_bounds import (
    Envelope,
    ErrorBound,
    attitude_error_bound_rad,
    azimuth_error_bound_rad,
    error_bound,
)

MODELS = {
    "flat_earth": LineOfSight("flat_earth").in_ned,
    "local_radii": LineOfSight("local_radii").in_ned,
    "geodesic": partial(earth_models.geodesic_line_of_sight, backend="pyproj"),
}
LOW, HIGH, DEEP = (0.0, 500.0), (9000.0, 12000.0), (-400.0, 3000.0)
USUAL = [(0.0, 0.4), (30.0, 30.5), (-52.0, -51.8), (69.5, 70.0)]
HARD = [(-0.3, 0.3), (44.8, 45.2), (79.0, 81.0), (-88.5, -88.0), (89.9, 89.95), (-90.0, -89.0)]


def pairs(envelope: Envelope, count: int, seed: int) -> list[np.ndarray]:
    """Pairs in the envelope: corners, cardinal bearings, full range, the antimeridian, overhead."""
    rng = np.random.default_rng(seed)

    def within(interval: tuple[float, float]) -> np.ndarray:
        corner = rng.random(count) < 0.5
        return np.where(corner, rng.choice(interval, count), rng.uniform(*interval, count))

    lat, alt, wanted = map(
        within, (envelope.own_lat_deg, envelope.own_alt_m, envelope.target_alt_m)
    )
    lon = np.where(rng.random(count) < 0.3, 180.0, rng.uniform(-180, 180, count))
    cardinal = rng.integers(0, 8, count) * (math.pi / 4)
    bearing = np.where(rng.random(count) < 0.3, cardinal, rng.uniform(0, 2 * math.pi, count))
    share = np.where(rng.random(count) < 0.6, 1.0, 10.0 ** rng.uniform(-4, 0, count))
    range_m = envelope.range_max_m * share * (1 - 1e-12)
    up = np.clip(wanted - alt - range_m**2 / 12.76e6, -range_m, range_m)
    level = np.sqrt(np.maximum(range_m**2 - up**2, 0.0))
    target = enu_to_geodetic(
        level * np.sin(bearing),
        level * np.cos(bearing),
        up,
        reference_lat_deg=lat,
        reference_lon_deg=lon,
        reference_alt_m=alt,
    )
    low, high = envelope.target_alt_m
    kept = (target[2] >= low) & (target[2] <= high)
    return [column[kept] for column in (lat, lon, alt, *target)]


def found(name: str, envelope: Envelope, count: int = 6000, seed: int = 3) -> ErrorBound:
    """Return the worst errors of a search: whoever is in range, in truth or by the model."""
    places = pairs(envelope, count, seed)
    true, got = ellipsoid.line_of_sight(*places), MODELS[name](*places)
    near = np.minimum(true[2], got[2]) <= envelope.range_max_m
    chord = np.array(unit_vector(*true[:2])) - np.array(unit_vector(*got[:2]))
    turned = 2 * np.arcsin(np.minimum(1.0, np.sqrt((chord**2).sum(axis=0)) / 2))[near]
    off = np.abs(true[2] - got[2])[near]
    relative = off / np.maximum(np.minimum(true[2], got[2])[near], 1e-9)
    level = np.minimum(np.abs(true[1]), np.abs(got[1]))[near] <= envelope.steepest_rad
    azimuth = np.abs(np.arctan2(np.sin(true[0] - got[0]), np.cos(true[0] - got[0])))[near][level]
    return ErrorBound(*(x.max(initial=0.0) for x in (turned, azimuth, off, relative)))


def envelopes(latitudes: list[tuple[float, float]]) -> list[Envelope]:
    return [
        Envelope(range_m, lat, own, target, steepest_rad=0.5)
        for lat in latitudes
        for range_m in (300.0, 10e3, 30e3)
        for own, target in ((LOW, LOW), (HIGH, HIGH), (DEEP, HIGH))
    ]


@pytest.mark.parametrize("name", MODELS)
def test_no_search_finds_more_than_the_bound(name: str) -> None:
    for envelope in envelopes(USUAL + HARD):
        if envelope.range_max_m < envelope.target_alt_m[0] - envelope.own_alt_m[1]:
            continue  # nobody is in range
        bound, worst = error_bound(name, envelope), found(name, envelope)
        slack = 1e-12  # what the search itself rounds
        assert worst.direction_rad <= bound.direction_rad + slack, envelope
        assert worst.azimuth_rad <= bound.azimuth_rad + slack, envelope
        assert worst.range_m <= bound.range_m + 1e-9, envelope
        assert worst.relative_range <= bound.relative_range + slack, envelope


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("range_m", [1e3, 10e3, 30e3])
def test_bounds_are_not_loose_in_usual_envelopes(name: str, range_m: float) -> None:
    for lat in USUAL:
        envelope = Envelope(range_m, lat, (900.0, 1100.0), (800.0, 1500.0))
        bound, worst = error_bound(name, envelope), found(name, envelope)
        assert bound.direction_rad < 1.8 * worst.direction_rad
        assert bound.range_m < 1.9 * worst.range_m


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    st.sampled_from(sorted(MODELS)),
    st.floats(-90, 90),
    st.floats(0, 3),
    st.floats(1.0, 5.5),
    st.floats(-400, 15_000),
    st.floats(0, 5000),
)
def test_bound_holds_in_any_envelope(name, lat, width, log_range, alt, thick) -> None:
    """Up to 316 km, from pole to pole, also where only the trivial bound is left."""
    own_lat = (lat, min(90.0, lat + width))
    envelope = Envelope(10.0**log_range, own_lat, (alt, alt + 100.0), (alt - thick, alt + thick))
    bound, worst = error_bound(name, envelope), found(name, envelope, count=400)
    assert worst.direction_rad <= bound.direction_rad + 1e-12
    assert worst.range_m <= bound.range_m + 1e-9


@pytest.mark.parametrize("name", ["flat_earth", "local_radii"])
def test_nothing_is_proven_where_the_pole_is_in_range(name: str) -> None:
    bound = error_bound(name, Envelope(20e3, (89.9, 89.95), LOW, LOW, steepest_rad=0.0))
    assert bound == ErrorBound(math.pi, math.pi, math.inf, math.inf)
    # And rightly: the model may see a target two ranges too far, and in any direction.
    _, _, range_m = MODELS[name](89.9999, 0, 100, 90, 180, 100)
    assert range_m > 3 * ellipsoid.line_of_sight(89.9999, 0, 100, 90, 180, 100)[2]


def test_geodesic_and_ellipsoid_know_no_pole() -> None:
    polar = Envelope(20e3, (89.0, 90.0), LOW, LOW, steepest_rad=0.2)
    assert error_bound("geodesic", polar).direction_rad < math.radians(0.1)
    assert error_bound("ellipsoid", polar).azimuth_rad < 1e-14


def test_infinite_range_is_not_proven() -> None:
    bound = error_bound("local_radii", Envelope(math.inf, (52, 52), LOW, LOW))
    assert bound.direction_rad == math.pi and math.isinf(bound.range_m)


def test_the_known_sizes_of_flat_earth_and_curvature() -> None:
    """The turn by the sphere's radius at the equator, and half the angle of the Earth.

    Scales that differ by k in two directions turn a line by asin((k - 1)/(k + 1)); at the equator
    k is the ratio of WGS 84's radii along and across the meridian, 1 / (1 - e²).
    """
    k = 1.0 / (1.0 - 6.69437999014e-3)
    turn_deg = math.degrees(math.asin((k - 1.0) / (k + 1.0)))
    equator = Envelope(1.0, (0, 0), (0, 0), (0, 0))
    assert math.degrees(error_bound("flat_earth", equator).direction_rad) == pytest.approx(
        turn_deg, rel=0.01
    )
    for range_m in (1e3, 5e3):
        bound = error_bound("local_radii", Envelope(range_m, (0, 0), (0, 0), (0, 0)))
        assert math.degrees(bound.direction_rad) == pytest.approx(
            math.degrees(range_m / (2 * 6371e3)), rel=0.02
        )


def test_attitude_bound_holds_and_is_reached_astern() -> None:
    rng = np.random.default_rng(5)
    size = 200_000
    azimuth, elevation = rng.uniform(-np.pi, np.pi, size), rng.uniform(-1.2, 1.2, size)
    pitch, roll = rng.uniform(-0.3, 0.3, size), rng.uniform(-0.5, 0.5, size)
    true, rough = (
        np.array(
            unit_vector(
                *body_angles_of_sight_line(azimuth, elevation, 0.0, pitch, roll, model=model)
            )
        )
        for model in ("exact", "small_angle")
    )
    turned = 2 * np.arcsin(np.sqrt(((true - rough) ** 2).sum(axis=0)) / 2)
    limit = np.array([attitude_error_bound_rad(p, r) for p, r in zip(pitch, roll, strict=True)])
    assert np.all(turned <= limit + 1e-12)
    assert np.max(turned / limit) > 0.95
    q = body_angles_of_sight_line(np.pi, 0.0, 0.0, 0.1, 0.0)[1]
    assert q == pytest.approx(0.1) and attitude_error_bound_rad(0.1, 0.0) == pytest.approx(0.2)
    assert attitude_error_bound_rad(1.0, 3.0) == math.pi
    envelope = Envelope(1e3, (10, 10), LOW, LOW, steepest_rad=0.0, pitch_rad=0.1, roll_rad=0.2)
    assert error_bound("ellipsoid", envelope, "small_angle").direction_rad == pytest.approx(0.4)


def test_azimuth_bound_is_reached_and_gives_up_at_the_zenith() -> None:
    """A circle of radius e round a direction at elevation q spans asin(sin e/cos q) of azimuth."""
    e, q = 0.05, 1.0
    turn = np.linspace(0, 2 * np.pi, 100_001)
    # Unit vectors on the circle about (cos q, 0, sin q).
    x = math.cos(e) * math.cos(q) - math.sin(e) * math.sin(q) * np.cos(turn)
    y = math.sin(e) * np.sin(turn)
    limit = azimuth_error_bound_rad(e, q)
    assert np.max(np.abs(np.arctan2(y, x))) == pytest.approx(limit, rel=1e-8)
    assert azimuth_error_bound_rad(0.05, 0.5 * math.pi - 0.04) == math.pi
    assert azimuth_error_bound_rad(0.0, 0.5 * math.pi) == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"range_max_m": -1.0}, "range_max_m is -1.0: it must be 0 or more"),
        ({"own_lat_deg": (2.0, 1.0)}, r"own_lat_deg is \(2.0, 1.0\): it must hold two numbers"),
    ],
)
def test_bad_envelopes_are_named(change: dict[str, object], message: str) -> None:
    values = {"range_max_m": 1e3, "own_lat_deg": (0, 1), "own_alt_m": LOW, "target_alt_m": LOW}
    with pytest.raises(ValueError, match=message):
        Envelope(**{**values, **change})


def test_unknown_models_are_named() -> None:
    envelope = Envelope(1e3, (0, 1), LOW, LOW)
    with pytest.raises(ValueError, match="earth is 'flat': it must be one of 'flat_earth'"):
        error_bound("flat", envelope)
    with pytest.raises(ValueError, match="attitude is 'none': it must be 'exact' or"):
        error_bound("ellipsoid", envelope, "none")
