"""Closest approaches: what is found by halving time is what looking at every time finds."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.flights import closest_approach
from components.flights.closest_approach import (
    Approaches,
    KnownTimes,
    RegularTimes,
    closest_approaches,
    refine_between_samples,
)
from components.flights.legs import Straight, Turn
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight


def brute_force(own, target, times):
    """Return time and range of the first smallest range, or None."""
    a, b = own.at(times), target.at(times)
    there = a.present & b.present
    if not there.any():
        return None
    _, _, range_m = line_of_sight(a.lat_deg, a.lon_deg, a.alt_m, b.lat_deg, b.lon_deg, b.alt_m)
    place = int(np.argmin(np.where(there, range_m, np.inf)))
    return float(times[place]), float(range_m[place])


def found(own, targets, fleet, samples, end_s):
    there = np.array([target.interval_present() for target in targets]).reshape(-1, 2)
    best = None
    for times in samples:
        best = closest_approaches(
            lambda _, time_s: own.at(time_s), fleet.each, times,
            closing_speed_mps=np.array([t.max_speed_mps + own.max_speed_mps for t in targets]),
            present_s=(np.maximum(there[:, 0], 0.0), np.minimum(there[:, 1], end_s)), best=best,
        )  # fmt: skip
    pairs = zip(best.time_s.tolist(), best.range_m.tolist(), strict=True)
    return [(t, r) if np.isfinite(r) else None for t, r in pairs]


# As in scenes, no number is smaller than 1e-30 and not 0.
angles = st.floats(-180, 180).map(lambda angle: round(angle, 20))
legs = st.one_of(
    st.builds(Straight, duration_s=st.floats(1, 200), heading_deg=st.none() | angles),
    st.builds(
        Turn, duration_s=st.floats(1, 200), rate_deg_s=st.sampled_from([-6.0, -1.5, 0.7, 3.0])
    ),
)
flights = st.builds(
    ScriptedTrajectory,
    st.just("x"),
    lat_deg=st.floats(51.5, 52.5),
    lon_deg=st.floats(3.5, 5),
    alt_m=st.floats(0, 3000),
    heading_deg=angles,
    speed_mps=st.sampled_from([0.0, 50.0]) | st.floats(20, 300),
    climb_mps=st.floats(-5, 5),
    legs=st.lists(legs, max_size=3),
    start_time_s=st.sampled_from([0.0, 0.0, 33.3]),
    end_time_s=st.sampled_from([None, None, 90.0, 33.3]),
)


@settings(max_examples=40, deadline=None)
@given(
    own=flights,
    targets=st.lists(flights, min_size=1, max_size=5),
    step_s=st.sampled_from([0.3, 1.0, 13.0]),
    end_s=st.sampled_from([0.05, 60.0, 333.3]),
    at_once=st.sampled_from([16, closest_approach.MOST_AT_ONCE]),
)
def test_scripted_flights_as_by_looking_at_every_time(own, targets, step_s, end_s, at_once):
    times = np.round(np.arange(int(end_s / step_s) + 1) * step_s, 9)
    times = times[times <= end_s]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closest_approach, "MOST_AT_ONCE", at_once)
        fleet = ScriptedFleet(targets)
        halved = found(own, targets, fleet, [RegularTimes(step_s, end_s)], end_s)
    assert halved == [brute_force(own, target, times) for target in targets]


samples = st.integers(2, 25).flatmap(
    lambda n: st.tuples(
        st.lists(st.floats(0.5, 9), min_size=n, max_size=n),
        st.lists(st.tuples(st.floats(51.9, 52.1), st.floats(4.3, 4.5)), min_size=n, max_size=n),
    )
)


def recorded(steps_and_places):
    steps, places = steps_and_places
    lat, lon = np.array(places).T
    return SampledTrajectory("x", np.cumsum(steps) - steps[0], lat, lon, np.full(len(lat), 900.0))


@settings(max_examples=40, deadline=None)
@given(own=samples.map(recorded), targets=st.lists(samples.map(recorded), min_size=1, max_size=4),
       end_s=st.sampled_from([10.0, 500.0]))  # fmt: skip
def test_recorded_flights_as_by_looking_at_every_sample_of_the_two(own, targets, end_s):
    times = [KnownTimes(own.sample_times_s), KnownTimes(*(t.sample_times_s for t in targets))]
    halved = found(own, targets, SampledFleet(targets), times, end_s)
    for one, target in zip(halved, targets, strict=True):
        every = np.union1d(own.sample_times_s, target.sample_times_s)
        assert one == brute_force(own, target, every[every <= end_s])


@given(
    step_s=st.sampled_from([0.1, 0.3, 1.0, 7.0, 1e-3]),
    duration_s=st.floats(0.01, 50),
    first_s=st.floats(-1, 60),
    length_s=st.floats(-1, 60),
)
def test_numbers_of_regular_times_are_those_inside(step_s, duration_s, first_s, length_s):
    times = np.round(np.arange(int(duration_s / step_s) + 1) * step_s, 9)
    inside = np.flatnonzero((times >= first_s) & (times <= first_s + length_s))
    one = np.zeros(1, dtype=np.int64)
    first, last = RegularTimes(step_s, duration_s).first_and_last_sample_numbers(
        one, np.array([first_s]), np.array([first_s + length_s])
    )
    if len(inside):
        assert (first[0], last[0]) == (inside[0], inside[-1])
    else:
        assert first[0] > last[0]


def memory_of(duration_s, fly):
    """Return the peak of memory while a target that keeps its distance is looked at, in bytes."""
    ring = ScriptedTrajectory("ring", lat_deg=52, lon_deg=4, alt_m=100, speed_mps=40,
                              legs=[Turn(rate_deg_s=3)])  # fmt: skip
    own = ScriptedTrajectory("own", lat_deg=52, lon_deg=4.1, alt_m=100)
    fleet = ScriptedFleet([ring])
    fleet.each(np.zeros(1, dtype=np.int64), np.zeros(1))
    tracemalloc.start()
    fly(own, ring, fleet, duration_s)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_memory_does_not_grow_with_the_run(monkeypatch):
    """A target on a ring comes equally near every two minutes: the hardest case there is."""
    monkeypatch.setattr(closest_approach, "MOST_AT_ONCE", 64)

    def fly(own, ring, fleet, duration_s):
        found(own, [ring], fleet, [RegularTimes(1.0, duration_s)], duration_s)

    short, longer = (memory_of(days * 86400.0, fly) for days in (0.1, 0.7))
    # One number kept of each second would take 0.4 MB more; what Python keeps for use again, less
    # than 0.1 MB, is more or less by what other tests have left of it.
    assert longer - short < 0.5 * 8.0 * 0.6 * 86400.0 and short < 2e6


def test_ties_go_to_the_first_time():
    own = ScriptedTrajectory("own", lat_deg=52, lon_deg=4, alt_m=100)
    target = ScriptedTrajectory("t", lat_deg=52, lon_deg=4.1, alt_m=100, start_time_s=2.5)
    ((time_s, _),) = found(own, [target], ScriptedFleet([target]), [RegularTimes(1.0, 9.0)], 9.0)
    assert time_s == 3.0


def place(east_m, up_m):
    """States along the equator, so far east and up."""
    zeros = np.zeros_like(east_m)
    return SimpleNamespace(
        lat_deg=zeros, lon_deg=10.0 + east_m * (360.0 / 40_075_016.7), alt_m=zeros + up_m,
        present=np.ones(len(east_m), dtype=bool),
    )  # fmt: skip


@pytest.mark.parametrize("at_once", [7, 10_000])
@pytest.mark.parametrize("power", [1.0, 0.3])
def test_of_several_approaches_the_nearest_is_found_wherever_it_lies(monkeypatch, at_once, power):
    """Targets that come near and go, six times each at other times, no faster than they may."""
    monkeypatch.setattr(closest_approach, "MOST_AT_ONCE", at_once)
    draw = np.random.default_rng(9)
    count, end_s = 40, 150.0
    every_s = end_s * np.linspace(0.0, 1.0, 301) ** power  # evenly, or far apart at first
    times = RegularTimes(0.5, end_s) if power == 1.0 else KnownTimes(every_s)
    speed_mps = draw.uniform(20.0, 200.0, count)
    when_s = draw.uniform(0.0, end_s, (6, count))
    nearest_m = draw.uniform(100.0, 2000.0, (6, count))

    def away_m(target, time_s):
        since_s = np.abs(time_s - when_s[:, target])
        return (nearest_m[:, target] + speed_mps[target] * since_s).min(axis=0)

    best = closest_approaches(
        lambda _, time_s: place(np.zeros(len(time_s)), 0.0),
        lambda target, time_s: place(away_m(target, time_s), 0.0),
        times, closing_speed_mps=speed_mps,
        present_s=(np.full(count, 3.0), np.full(count, 140.0)),
    )  # fmt: skip
    every_s = every_s[(every_s >= 3.0) & (every_s <= 140.0)]
    every = np.array([away_m(np.full(len(every_s), k), every_s) for k in range(count)])
    assert best.time_s == pytest.approx(every_s[every.argmin(axis=1)])
    assert best.range_m == pytest.approx(every.min(axis=1), abs=0.01)


@pytest.mark.parametrize("passes_s", [3.3137, 3.999, 4.6, 2.004])
@pytest.mark.parametrize("step_s", [1.5, 2.0])
def test_between_two_times_the_closest_approach_is_that_of_straight_flights(passes_s, step_s):
    """Past each other on crossing ways along the equator: the vertex of a parabola.

    The first stays 200 m above. Three times are known, 1.1 s before it at the most.
    """
    known_s = np.array([passes_s - 1.1, passes_s + 0.9, 9.0])
    speed_mps = np.array([90.0, 40.0, 70.0])

    def other_at(target, time_s):
        return place(speed_mps[target] * (time_s - passes_s), 200.0)

    def own_at(target, time_s):
        return place(np.zeros(len(time_s)), 0.0)

    def range_m(time_s, k):
        return np.hypot(200.0, speed_mps[k] * (time_s - passes_s))

    best = Approaches(known_s.copy(), np.array([range_m(t, k) for k, t in enumerate(known_s)]))
    end_s = np.array([passes_s + 30.0, passes_s - 0.4, 30.0])
    refine_between_samples(own_at, other_at, np.full(3, step_s), (np.zeros(3), end_s), best)
    # The second is not there any more, and the third's step ends before it passes.
    expected_s = [passes_s, passes_s - 0.4, 9.0 - 1.11 * step_s]
    assert best.time_s[:2] == pytest.approx(expected_s[:2], abs=2e-3)
    assert best.range_m[:2] == pytest.approx([200.0, range_m(expected_s[1], 1)], abs=0.02)
    assert best.time_s[2] == pytest.approx(expected_s[2], abs=1e-3)
