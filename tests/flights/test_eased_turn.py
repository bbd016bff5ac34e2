"""Turns that a pilot eases: where they lead, how they begin, and what they cannot do."""

import math

import numpy as np
import pytest

from components.flights.legs import Straight, Turn
from components.flights.many_flights import SteeredFlight
from components.flights.point_mass import eased_turn_durations_and_rates
from components.flights.scripted_flights import ScriptedTrajectory
from components.messages.steering import Manoeuvre

G_M_S2 = 32.2 * 0.3048
MOST, EASES = math.radians(3.0), math.radians(8.0)
#: Southern hemisphere, across the antimeridian.
OWN = ScriptedTrajectory(
    "own", lat_deg=-42.0, lon_deg=179.999, alt_m=900.0, heading_deg=217.0, speed_mps=50.0
)


def told(heading_deg, **changes):
    manoeuvre = Manoeuvre(rate_rad_s=MOST, heading_rad=math.radians(heading_deg), eases_rad=EASES)
    return manoeuvre._replace(**changes)


@pytest.mark.parametrize("turn_deg", [-170.0, -25.0, -3.0, 0.4, 20.0, 90.0, 179.0])
@pytest.mark.parametrize("speed_mps", [35.0, 50.0, 180.0])
def test_all_of_the_turn_is_turned_and_never_faster_than_told(turn_deg, speed_mps):
    left = math.radians(turn_deg)
    rates = eased_turn_durations_and_rates(left, left, 0.0, speed_mps, MOST, EASES)
    assert sum(lasts_s * rate for lasts_s, rate in rates) == pytest.approx(turn_deg, abs=1e-9)
    assert max(abs(rate) for _, rate in rates) < 3.0 + 1e-6
    assert all(rate == 0.0 or abs(rate) >= 0.0999 for _, rate in rates)
    assert sum(lasts_s for lasts_s, _ in rates) < 150.0


def test_the_bank_begins_at_30_degrees_a_second():
    """|p| <= 0.524 rad/s: after k tenths the bank is k times 0.0524 rad, and the rate follows."""
    left = math.radians(90.0)
    rates = eased_turn_durations_and_rates(left, left, 0.0, 50.0, MOST, EASES)
    assert rates[0] == (pytest.approx(0.05), 0.0)
    for k in (1, 2, 3):
        rate = math.degrees(G_M_S2 * math.tan(0.0524 * k) / 50.0)
        assert rates[k] == (pytest.approx(0.1), pytest.approx(rate, rel=1e-12))


def test_near_the_heading_the_rate_is_in_proportion_to_what_was_left_a_second_ago():
    left = math.radians(60.0)
    rates = eased_turn_durations_and_rates(left, left, 0.0, 50.0, MOST, EASES)
    at_s = np.cumsum([lasts_s for lasts_s, _ in rates])
    left_deg = 60.0 - np.cumsum([lasts_s * rate for lasts_s, rate in rates])
    # Seconds of the law, which begin half a tenth after the turn does.
    seconds = np.arange(19, 24)
    left_then = np.interp(seconds - 1 + 0.05, at_s, left_deg)
    assert (np.abs(left_then) < 8.0).all()
    # The bank has followed by the end of the second: within a few percent.
    ends = [rates[int(np.searchsorted(at_s, second + 1.04))][1] for second in seconds]
    np.testing.assert_allclose(ends, 3.0 * left_then / 8.0, atol=0.02)


@pytest.mark.parametrize("to_deg", [237.0, 130.0, 5.0, 217.0])
def test_a_steered_flight_ends_on_the_track(to_deg):
    flight = SteeredFlight(OWN).add_manoeuvre(12.0, told(to_deg))
    after = flight.at(np.array([11.99, 80.0]))
    assert math.degrees(after.yaw_rad[0]) == pytest.approx(217.0, abs=0.01)
    # The great circle that it flies on turns by a few thousandths.
    assert math.degrees(after.yaw_rad[1]) == pytest.approx(to_deg, abs=0.03)
    fastest = np.abs(np.diff(np.unwrap(flight.at(np.arange(12.0, 80.0, 0.1)).yaw_rad))).max()
    assert fastest <= 0.1 * MOST * 1.001


def test_a_second_turn_goes_on_from_the_bank_and_the_heading_of_a_second_ago():
    once = SteeredFlight(OWN).add_manoeuvre(12.0, told(307.0))
    again = once.add_manoeuvre(20.0, told(307.0))
    times = np.arange(12.0, 60.0, 0.1)
    one, other = once.at(times), again.at(times)
    np.testing.assert_allclose(one.yaw_rad, other.yaw_rad, atol=1e-4)
    np.testing.assert_allclose(one.lat_deg, other.lat_deg, atol=1e-7)


def test_a_climb_lets_an_eased_turn_go_on():
    turning = SteeredFlight(OWN).add_manoeuvre(12.0, told(307.0))
    both = turning.add_manoeuvre(15.0, Manoeuvre(climb_m=100.0, climb_rate_mps=4.0))
    assert both.at(np.array([70.0])).alt_m[0] == pytest.approx(1000.0, abs=1e-6)
    assert both.at(np.array([70.0])).yaw_rad[0] == pytest.approx(
        turning.at(np.array([70.0])).yaw_rad[0], abs=1e-6
    )


def test_turns_in_a_row_lead_where_one_turn_leads():
    """A hundred pieces of a turn, each begun on the heading on which the one before ended."""

    def flown(pieces):
        legs = [Turn(duration_s=10.0 / pieces, rate_deg_s=2.0) for _ in range(pieces)]
        return ScriptedTrajectory(
            "own", lat_deg=-42.0, lon_deg=0.0, alt_m=189.0, heading_deg=10.0, speed_mps=50.0,
            legs=[*legs, Straight()],
        ).at(np.array([10.5]))  # fmt: skip

    whole, pieces = flown(1), flown(100)
    assert pieces.yaw_rad[0] == pytest.approx(whole.yaw_rad[0], abs=1e-9)
    assert pieces.lat_deg[0] == pytest.approx(whole.lat_deg[0], abs=1e-9)
