"""Flights that are made and asked together are, to the bit, those that are made and asked alone."""

import numpy as np
import pytest

from components.flights.legs import Straight, Turn
from components.flights.many_flights import SteeredFlight, fleet_of
from components.flights.sampled_flight import SampledTrajectory
from components.flights.scripted_flights import ScriptedTrajectory
from components.messages.steering import Manoeuvre

TIMES = np.arange(0.0, 41.0)


def paths(count, rng):
    """Return wandering paths about the antimeridian at 66° south; some stand still for a while."""
    speed = rng.uniform(-60.0, 60.0, (2, len(TIMES), count))
    speed[:, :10, ::3] = 0.0
    north, east = np.cumsum(speed, axis=1)
    alt = 1000.0 + np.cumsum(rng.normal(0.0, 3.0, north.shape), axis=0)
    return -66.0 + north / 111_000.0, 179.99 + east / 45_000.0, alt


def same(one, other):
    for a, b in zip(one.arrays(), other.arrays(), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_sampled_together_are_those_made_alone():
    lat, lon, alt = paths(207, np.random.default_rng(5))
    together = SampledTrajectory.from_common_times(
        [f"a{k}" for k in range(207)], TIMES, lat, lon, alt
    )
    for k in (0, 1, 3, 120, 198, 199, 200, 206):  # blocks of cells end at 199
        alone = SampledTrajectory(f"a{k}", TIMES, lat[:, k], lon[:, k], alt[:, k])
        for name in ("coefficients", "lon_deg", "yaw_rad", "pitch_rad", "roll_rad"):
            assert getattr(together[k], name).tobytes() == getattr(alone, name).tobytes(), name
        assert together[k].max_speed_mps == alone.max_speed_mps
        assert together[k].name == alone.name


def test_a_bad_sample_of_one_names_it():
    lat, lon, alt = paths(3, np.random.default_rng(5))
    lat[7, 2] = 91.0
    with pytest.raises(ValueError, match=r"c: lat_deg is 91.0 \(sample 7\)"):
        SampledTrajectory.from_common_times(["a", "b", "c"], TIMES, lat, lon, alt)


class Still:
    """A flight of a kind that no table knows."""

    def __init__(self, like):
        self.like = like

    def at(self, time_s):
        return self.like.at(np.zeros_like(time_s))


def test_flights_of_all_kinds_are_asked_together():
    lat, lon, alt = paths(2, np.random.default_rng(8))
    sampled = SampledTrajectory.from_common_times(["a", "b"], TIMES, lat, lon, alt)
    legs = [Straight(duration_s=9), Turn(rate_deg_s=3, duration_s=9), Straight()]
    scripted = [
        ScriptedTrajectory(
            "own", lat_deg=-66.0, lon_deg=179.9, alt_m=900.0, heading_deg=217.0, speed_mps=v,
            legs=legs,
        )
        for v in (40.0, 55.0)
    ]  # fmt: skip
    right = Manoeuvre(turn_rad=1.0, rate_rad_s=0.05)
    up = Manoeuvre(climb_m=90.0, climb_rate_mps=5.0)
    steered = [
        SteeredFlight(sampled[0]).add_manoeuvre(7.25, right).add_manoeuvre(20.0, up),
        SteeredFlight(scripted[0]),
        SteeredFlight(scripted[1]).add_manoeuvre(3.0, up),
    ]
    flights = [sampled[0], *steered, scripted[1], Still(sampled[1]), sampled[1], scripted[0]]
    rng = np.random.default_rng(2)
    which, time_s = rng.integers(0, len(flights), 300), rng.uniform(0.0, 40.0, 300)
    found = fleet_of(flights).each(which, time_s)
    for k, flight in enumerate(flights):
        rows = which == k
        same(type(found)(*(part[rows] for part in found.arrays())), flight.at(time_s[rows]))


def test_a_fleet_of_all_kinds_says_what_scripts_fix():
    """Ground speeds and fixed angles, NaN where no script says them."""
    lat, lon, alt = paths(1, np.random.default_rng(8))
    (sampled,) = SampledTrajectory.from_common_times(["a"], TIMES, lat, lon, alt)
    start = {"lat_deg": -66.0, "lon_deg": 179.9, "alt_m": 900.0, "heading_deg": 217.0}
    slow = ScriptedTrajectory("slow", **start, speed_mps=40.0, roll_deg=9.0)
    fast = ScriptedTrajectory("fast", **start, speed_mps=70.0)
    up = Manoeuvre(climb_m=90.0, climb_rate_mps=5.0)
    steered = SteeredFlight(slow).add_manoeuvre(3.0, up)
    found = fleet_of([fast, Still(fast), steered, sampled, slow])
    which, time_s = np.array([2, 4, 0, 3, 1, 2]), np.array([2.0, 9.0, 9.0, 9.0, 9.0, 5.0])
    nan = np.nan
    np.testing.assert_allclose(
        found.ground_speeds_mps(which, time_s), [40.0, 40.0, 70.0, nan, nan, 40.0], rtol=1e-6
    )
    np.testing.assert_array_equal(
        found.fixed_attitudes_rad(which, time_s)[2], np.radians([9.0, 9.0, nan, nan, nan, nan])
    )
