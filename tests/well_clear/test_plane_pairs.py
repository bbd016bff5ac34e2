"""Pairs in the plane: what they say of flights on the ellipsoid, and what they leave to these."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from components.flights.closest_approach import KnownTimes
from components.flights.sampled_flight import SampledTrajectory
from components.geometry import enu_to_geodetic
from components.metrics.losses import flight_times_first_within_s
from components.metrics.separation import RelativeFlight
from components.well_clear.plane_pairs import PairPaths, PairsInPlane, closest_meetings
from dsa_des.arrays.types import FloatArray

SIZES_M = ((670.56, 137.16), (152.4, 30.48))
AT_DEG = (52.0, 4.0)


def flight(name: str, time_s: FloatArray, path: FloatArray) -> SampledTrajectory:
    north, east, up = path
    lat, lon, _ = enu_to_geodetic(
        east, north, 0.0,
        reference_lat_deg=AT_DEG[0], reference_lon_deg=AT_DEG[1], reference_alt_m=0.0,
    )  # fmt: skip
    return SampledTrajectory(name, time_s, lat, lon, up)


def relative(paths: PairPaths, pair: int) -> RelativeFlight:
    own = flight("own", paths.time_s, paths.own_m[:, :, pair])
    other = flight("other", paths.time_s, paths.other_m[:, :, pair])
    known = [KnownTimes(one.sample_times_s) for one in (own, other)]
    source: Any = SimpleNamespace(own=own, targets=[other], sample_times=lambda: known)
    return RelativeFlight(source, 0, None, 1, float(paths.time_s[-1]))


def turning_pairs(rng: np.random.Generator, count: int, far_m: float, up_m: float) -> PairPaths:
    """Pairs whose paths bend at every second, and that pass near the edges of both cylinders."""
    time_s, middle = np.arange(41.0), 20
    paths = []
    for _ in range(2):
        heading = rng.uniform(0, 2 * np.pi, count) + np.cumsum(
            rng.normal(0.0, 0.05, (41, count)), axis=0
        )
        speed = rng.uniform(20.0, 250.0, count)
        climb = rng.normal(0.0, 3.0, (41, count))
        steps = np.array([speed * np.cos(heading), speed * np.sin(heading), climb])
        way = np.cumsum(steps, axis=1)
        paths.append(way - way[:, middle : middle + 1])
    radius, half = np.array(SIZES_M)[rng.integers(0, 2, count)].T
    bearing = rng.uniform(0, 2 * np.pi, count)
    off = radius * rng.choice([0.5, 0.99, 1.0, 1.01, 1.1], count)
    high = half * rng.choice([0.2, 0.98, 1.02], count) * rng.choice([-1.0, 1.0], count)
    at = np.array([rng.uniform(-far_m, far_m, count), rng.uniform(-far_m, far_m, count),
                   rng.uniform(0.0, up_m, count)])  # fmt: skip
    own = paths[0] + at[:, np.newaxis]
    other = paths[1] + at[:, np.newaxis]
    other += np.array([off * np.cos(bearing), off * np.sin(bearing), high])[:, np.newaxis]
    return PairPaths(time_s, own, other)


@pytest.mark.parametrize(("far_m", "up_m"), [(5e3, 3e3), (4e4, 18e3)])
def test_what_is_sure_is_what_the_flights_do(far_m: float, up_m: float) -> None:
    paths = turning_pairs(np.random.default_rng(int(far_m)), 80, far_m, up_m)
    pairs = PairsInPlane(paths)
    found = ~np.isnan(
        flight_times_first_within_s([relative(paths, k) for k in range(80)], *SIZES_M)
    )
    for k, limits in enumerate(SIZES_M):
        surely, unsure = pairs.masks_sure_and_uncertain_entry(*limits)
        assert not (surely & unsure).any()
        assert surely[~unsure].tolist() == found[~unsure, k].tolist()
        assert 3 < surely.sum() < 77 and unsure.sum() < 45


def test_distances_hold_to_what_the_margin_allows_for() -> None:
    """At the samples, far from the origin and high up; margins are 1.5 m and a thousandth."""
    paths = turning_pairs(np.random.default_rng(3), 20, 4.2e4, 19e3)
    at_m = np.array([PairsInPlane(paths)._level_m[:, k] for k in range(20)])
    for k in range(20):
        true_m = relative(paths, k).separation_at(paths.time_s).horizontal_m
        assert (np.abs(at_m[k] - true_m) <= 1e-4 * true_m + 0.7).all()


def test_what_the_plane_cannot_tell_is_left_to_the_flights() -> None:
    near = turning_pairs(np.random.default_rng(1), 3, 1e3, 1e3)
    for change in ([60e3, 0, 0], [0, -60e3, 0], [0, 0, 21e3], [np.nan, 0, 0]):
        shift = np.array(change)[:, np.newaxis, np.newaxis]
        surely, unsure = PairsInPlane(
            PairPaths(near.time_s, near.own_m + shift, near.other_m + shift)
        ).masks_sure_and_uncertain_entry(*SIZES_M[0])
        assert unsure.all() and not surely.any()
    one = PairPaths(near.time_s[:1], near.own_m[:, :1], near.other_m[:, :1])
    assert PairsInPlane(one).masks_sure_and_uncertain_entry(*SIZES_M[0])[1].all()


def straight(*pairs: tuple[tuple[float, ...], tuple[float, ...]]) -> PairPaths:
    """Ownships that fly north at 50 m/s, and intruders from a place (m) at a velocity (m/s)."""
    time_s = np.arange(0.0, 101.0, 10.0)
    zero = np.zeros_like(time_s)
    own = np.array([50.0 * time_s, zero, zero + 1000.0])
    other = [np.array(at)[:, None] + np.array(v)[:, None] * time_s for at, v in pairs]
    return PairPaths(time_s, np.stack([own] * len(pairs), axis=2), np.stack(other, axis=2))


def test_the_closest_approach_lies_between_samples_and_its_angles_are_those_of_the_ways() -> None:
    # Head-on with 200 m to the right, 30 m above: nearest at 10,000/(50+70) = 83.33 s.
    head_on = ((10_000.0, 200.0, 1030.0), (-70.0, 0.0, 0.0))
    # From the right, through the ownship's place at 30 s.
    crossing = ((1500.0, 1800.0, 1000.0), (0.0, -60.0, 0.0))
    met = closest_meetings(
        [(np.array([0, 1]), straight(head_on, crossing))], 3, 100.0, SIZES_M, SIZES_M
    )
    assert met.closest[0, :2] == pytest.approx([10_000 / 120, 30.0])
    assert met.closest[1, :2] == pytest.approx([200.0 * (1 + 1030 / 6_371_000), 0.0], abs=1e-6)
    assert met.closest[2, :2] == pytest.approx([30.0, 0.0], abs=1e-6)
    assert met.closest[3, :2] == pytest.approx([120.0, np.hypot(50, 60)])
    assert met.closest[5, :2] == pytest.approx([180.0, 270.0])
    assert met.closest[6, :2] == pytest.approx([0.0, np.degrees(np.arctan2(60, 50))])
    assert np.isnan(met.closest[:, 2]).all() and not met.unsure[:, 2].any()
    assert met.inside.tolist() == [[True, True, False], [False, True, False]]
    # A run that ends before sees only what comes until then.
    early = closest_meetings(
        [(np.array([0, 1]), straight(head_on, crossing))], 2, 25.0, SIZES_M, SIZES_M
    )
    assert early.closest[0] == pytest.approx([25.0, 25.0])
    assert early.inside.tolist() == [[False, True], [False, False]]


def test_of_several_intruders_the_nearest_counts_and_events_are_anyones() -> None:
    far_below = ((1500.0, 1800.0, 1100.0), (0.0, -60.0, 0.0))
    nearer = ((10_000.0, 50.0, 1000.0), (-70.0, 0.0, 0.0))
    blocks = [(np.array([1]), straight(far_below)), (np.array([1, 0]), straight(nearer, far_below))]
    met = closest_meetings(blocks, 2, 100.0, SIZES_M, SIZES_M)
    assert met.closest[5].tolist() == pytest.approx([270.0, 180.0])
    assert met.inside.tolist() == [[True, True], [False, True]]
    assert not met.unsure_angles.any()
    twice = [(np.array([0]), straight(nearer)), (np.array([0]), straight(nearer))]
    assert closest_meetings(twice, 1, 100.0, SIZES_M, SIZES_M).unsure_angles.all()


def test_how_a_cylinder_is_missed_beside_it_and_above_by_hand() -> None:
    """Head-on 200 m to the side at 120 m/s; 600 m above at first, and 10 m/s down."""
    wider = 1 + 1030 / 6_371_000
    descends = ((10_000.0, 200.0, 1600.0), (-70.0, 0.0, -10.0))
    above_all = ((10_000.0, 200.0, 1600.0), (-70.0, 0.0, 0.0))
    behind = ((-10_000.0, 0.0, 1000.0), (50.0, 0.0, 0.0))
    pairs = PairsInPlane(straight(descends, above_all, behind))
    beside_m, above_m = pairs.least_distances_by_cylinder_m(670.56, 30.48)
    # Within 30.48 m of the same altitude until 63.05 s; within the radius from 78.0 s on.
    assert beside_m[0] == pytest.approx(np.hypot(10_000 - 120 * 63.048, 200.0) * wider, rel=1e-3)
    assert above_m[0] == pytest.approx((10_000 - np.sqrt(670.56**2 - 200**2)) / 12 - 600, abs=0.2)
    assert beside_m[1] == np.inf and above_m[1] == pytest.approx(600.0)
    assert beside_m[2] == pytest.approx(10_000.0, rel=1e-3) and above_m[2] == np.inf


def test_a_conflict_is_foreseen_a_minute_ahead_and_a_late_turn_late() -> None:
    """60 s of straight flight lead within 670 m from 18.0 s on; samples are 10 s apart."""
    head_on = ((10_000.0, 200.0, 1030.0), (-70.0, 0.0, 0.0))
    passes = ((10_000.0, 900.0, 1030.0), (-70.0, 0.0, 0.0))
    paths = straight(head_on, passes)
    paths.other_m[1, 7:, 1] = 200.0  # it comes over between 60 and 70 s
    met = closest_meetings([(np.array([0, 1]), paths)], 2, 100.0, SIZES_M, SIZES_M)
    # From 20 s on, and from when it comes over, until they are closest after 83 s.
    assert met.closest[4].tolist() == [70.0, 30.0]


def test_pairs_are_inside_where_closely_spaced_places_on_their_ways_are() -> None:
    """Level and climbing pairs, and some that do not move, near the edges of a cylinder."""
    rng = np.random.default_rng(41)
    count, limits = 240, (500.0, 100.0)
    apart = rng.uniform(-1.0, 1.0, (3, 3, count)) * np.array([900.0, 900.0, 180.0])[:, None, None]
    apart[2, :, :60] = apart[2, :1, :60]  # level
    apart[:, :, 60:80] = apart[:, :1, 60:80]  # at rest
    own = np.zeros_like(apart)
    surely, unsure = PairsInPlane(
        PairPaths(np.array([0.0, 4.0, 9.0]), own, apart)
    ).masks_sure_and_uncertain_entry(*limits)
    share = np.linspace(0.0, 1.0, 1501)[:, None]
    inside = np.zeros(count, dtype=bool)
    for k in (0, 1):
        north, east, up = (one[k] + share * (one[k + 1] - one[k]) for one in apart)
        inside |= ((np.hypot(north, east) < limits[0]) & (np.abs(up) < limits[1])).any(axis=0)
    assert 40 < np.count_nonzero(inside) < 200 and np.count_nonzero(unsure) < 0.05 * count
    assert (surely == inside)[~unsure].all()


@pytest.mark.parametrize(
    ("level_m", "up_m", "found"),
    [
        # 1.5 m and a thousandth of the radius are the plane's own error.
        (497.9, 98.4, "surely"), (498.1, 0.0, "unsure"), (501.9, 0.0, "unsure"),
        (502.1, 0.0, ""), (0.0, 98.6, "unsure"), (0.0, -101.4, "unsure"), (0.0, -101.6, ""),
    ],
)  # fmt: skip
def test_what_is_as_near_a_limit_as_the_plane_errs_is_unsure(
    level_m: float, up_m: float, found: str
) -> None:
    place = np.array([0.6 * level_m, 0.8 * level_m, up_m])
    apart = np.repeat(place, 2).reshape(3, 2, 1)
    pairs = PairsInPlane(PairPaths(np.array([0.0, 1.0]), np.zeros_like(apart), apart))
    said = dict(
        zip(("surely", "unsure"), pairs.masks_sure_and_uncertain_entry(500.0, 100.0), strict=True)
    )
    assert {name for name, is_so in said.items() if is_so[0]} == ({found} if found else set())
