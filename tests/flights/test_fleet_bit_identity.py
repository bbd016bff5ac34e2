"""A fleet gives each aircraft the bits it would get alone."""

import numpy as np
import pytest

from components.flights.legs import Straight, Turn
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory


def scripted(count):
    rng = np.random.default_rng(7)
    made = []
    for k in range(count):
        made.append(
            ScriptedTrajectory(
                f"t{k}",
                lat_deg=rng.uniform(-90, 90),
                lon_deg=rng.uniform(-180, 180),
                alt_m=rng.uniform(0, 9000),
                heading_deg=rng.uniform(0, 360),
                speed_mps=0.0 if k % 7 == 3 else rng.uniform(10, 300),
                climb_mps=rng.uniform(-2, 2) if k % 3 == 0 else 0.0,
                legs=[Straight(duration_s=40.0), Turn(rate_deg_s=2)] if k % 5 == 4 else (),
                roll_deg=3.0 if k % 4 == 1 else None,
                yaw_deg=10.0 if k % 6 == 5 else None,
                start_time_s=5.0 * (k % 3),
                end_time_s=70.0 if k % 2 else None,
            )
        )
    return made


def assert_same(fleet, times):
    together = fleet.at(times)
    for k, trajectory in enumerate(fleet):
        alone = trajectory.at(times)
        for a, b in zip(together.arrays(), alone.arrays(), strict=True):
            assert (a[:, k] == b).all()
            assert a.shape == (len(times), len(fleet))
        one = trajectory.at(times[-1])
        assert all(a[-1, k] == b for a, b in zip(together.arrays(), one.arrays(), strict=True))


@pytest.mark.parametrize("count", [1, 2, 13, 60])
@pytest.mark.parametrize("scans", [1, 3, 700])
def test_scripted_fleet(count, scans):
    assert_same(ScriptedFleet(scripted(count)), np.linspace(-1, 90, scans))


def test_only_straight_flights_in_several_blocks():
    flights = [t for t in scripted(60) if len(t.segments) == 1 and t.segments[0].kind == "geodesic"]
    assert_same(ScriptedFleet(flights), np.linspace(0, 50, 1111))


@pytest.mark.parametrize("scans", [1, 5, 2000])
def test_sampled_fleet_with_common_and_own_times(scans):
    made = []
    for k, t in enumerate(scripted(13)):
        times = np.arange(0, 60, 1.0) if k % 2 else np.arange(0, 60, 0.7) + 0.01 * k
        s = t.at(times)
        made.append(SampledTrajectory(t.name, times, s.lat_deg, s.lon_deg, s.alt_m))
    assert_same(SampledFleet(made), np.linspace(-3, 70, scans))


@pytest.mark.parametrize("fleet", [ScriptedFleet([]), SampledFleet([])])
def test_empty_fleet(fleet):
    assert fleet.at(np.arange(4.0)).lat_deg.shape == (4, 0)


def test_times_need_one_axis():
    with pytest.raises(ValueError, match="time_s has shape"):
        ScriptedFleet(scripted(1)).at(np.zeros((2, 2)))


def assert_each_same(fleet, low, high):
    rng = np.random.default_rng(3)
    aircraft = rng.integers(0, len(fleet), 3000)
    times = rng.uniform(low, high, 3000)
    times[:200] = np.round(times[:200])  # some right at the start of a leg or at a sample
    pairs = fleet.each(aircraft, times)
    whole = fleet.at(times)
    for a, b in zip(pairs.arrays(), whole.arrays(), strict=True):
        np.testing.assert_array_equal(a, b[np.arange(3000), aircraft])
    assert fleet.each(aircraft[:0], times[:0]).lat_deg.shape == (0,)


def test_each_scripted_aircraft_at_a_time_of_its_own():
    several = ScriptedTrajectory(
        "many", lat_deg=1, lon_deg=2, alt_m=3, speed_mps=50,
        legs=[Straight(duration_s=3.0), Turn(rate_deg_s=3, duration_s=4)] * 9,
    )  # fmt: skip
    assert_each_same(ScriptedFleet([*scripted(40), several]), -5, 95)


def test_each_sampled_aircraft_at_a_time_of_its_own():
    made = []
    for k, t in enumerate(scripted(9)):
        times = np.arange(0, 60, 0.5 + k % 3) if k else np.array([30.0])
        s = t.at(times)
        made.append(SampledTrajectory(t.name, times, s.lat_deg, s.lon_deg, s.alt_m))
    assert_each_same(SampledFleet(made), -5, 70)


def test_flights_made_together_lie_in_memory_once():
    """And each is what it would be alone, in fleets of all, of some, of some with another."""
    times, rng = np.arange(0.0, 60.0), np.random.default_rng(2)
    position = [rng.uniform(-1, 1, (60, 5)).cumsum(axis=0) * 1e-4 + of for of in (52, 179.99, 900)]
    names = [*"abcde"]
    made = SampledTrajectory.from_common_times(names, times, *position)
    alone = [
        SampledTrajectory(name, times, *(part[:, k] for part in position))
        for k, name in enumerate(names)
    ]
    own, others = SampledFleet(made[::2]), SampledFleet([made[3], made[1], made[3]])
    table = own._coefficients_and_shifts[0]
    for fleet, which in ((own, [0, 2, 4]), (others, [3, 1, 3]), (SampledFleet(made), range(5))):
        assert fleet._coefficients_and_shifts[0] is table
        assert_same(fleet, np.linspace(-1, 61, 130))
        assert_each_same(fleet, -1, 61)
        for one, number in zip(fleet, which, strict=True):
            assert np.shares_memory(one.coefficients, table)
            for name in ("coefficients", "lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad",
                         "roll_rad", "sample_times_s"):  # fmt: skip
                mine, other = getattr(one, name), getattr(alone[number], name)
                assert mine.tobytes() == other.tobytes()
            assert one.max_speed_mps == alone[number].max_speed_mps
    mixed = SampledFleet([made[1], alone[0], made[1]])
    assert len(mixed._coefficients_and_shifts[0]) == 2 * len(
        times
    )  # who flies in several runs is there once
    assert_each_same(mixed, -1, 61)
    assert np.shares_memory(alone[0].coefficients, mixed._coefficients_and_shifts[0])
    assert_each_same(own, -1, 61)
    assert_each_same(others, -1, 61)  # one of whose flights is in another table now
    assert SampledFleet([made[0], made[2]])._coefficients_and_shifts[0] is table
