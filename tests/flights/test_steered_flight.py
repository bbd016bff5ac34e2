"""A flight that is told to turn: where it goes, and that what was flown stays flown."""

import math

import numpy as np
import pytest

from components.flights.many_flights import SteeredFleet, SteeredFlight, fleet_of
from components.flights.scripted_flights import ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight_ned
from components.messages.steering import Manoeuvre
from components.metrics.flown_flights import ManoeuvresTold, steered_flights

STRAIGHT = ScriptedTrajectory(
    "own", lat_deg=52.0, lon_deg=4.0, alt_m=1000.0, heading_deg=90.0, speed_mps=60.0
)


def test_before_the_manoeuvre_nothing_changes():
    times = np.linspace(0.0, 30.0, 61)
    turned = SteeredFlight(STRAIGHT).add_manoeuvre(30.5, Manoeuvre(0.3, 0.05))
    for got, expected in zip(turned.at(times).arrays(), STRAIGHT.at(times).arrays(), strict=True):
        assert np.array_equal(got, expected)


@pytest.mark.parametrize("turn_deg", [-40.0, 25.0, 170.0])
def test_it_turns_by_the_angle_at_the_rate_without_a_jump(turn_deg):
    rate = math.radians(3.0)
    turned = SteeredFlight(STRAIGHT).add_manoeuvre(20.0, Manoeuvre(math.radians(turn_deg), rate))
    done_s = 20.0 + abs(turn_deg) / 3.0
    yaw = turned.at(np.array([20.0, done_s + 1.0])).yaw_rad
    change = math.remainder(float(yaw[1] - yaw[0]), 2.0 * math.pi)
    assert math.degrees(change) == pytest.approx(turn_deg, abs=0.01)
    times = np.arange(19.0, done_s + 5.0, 0.05)
    state = turned.at(times)
    north, east, down = line_of_sight_ned(
        state.lat_deg[:-1], state.lon_deg[:-1], state.alt_m[:-1],
        state.lat_deg[1:], state.lon_deg[1:], state.alt_m[1:],
    )  # fmt: skip
    steps = np.sqrt(north**2 + east**2 + down**2) / 0.05
    assert steps == pytest.approx(60.0, rel=2e-4)


@pytest.mark.parametrize(("speed_mps", "turn_deg"), [(31.0, 90.0), (60.0, -20.0), (260.0, 3.0)])
def test_a_turn_by_bank_rolls_in_at_the_rate(speed_mps, turn_deg):
    """Against the equations of motion, integrated: ψ' = g tan φ / v, φ = min(p t, bank)."""
    bank, roll = math.radians(45.0), math.radians(10.0)
    own = ScriptedTrajectory(
        "own", lat_deg=-41.0, lon_deg=4.0, alt_m=1000.0, heading_deg=217.0, speed_mps=speed_mps
    )
    manoeuvre = Manoeuvre(math.radians(turn_deg), bank_rad=bank, roll_rate_rad_s=roll)
    flight = SteeredFlight(own).add_manoeuvre(3.0, manoeuvre)
    step = 1e-3
    since = np.arange(0.0, 12.0, step)
    rate = 9.80665 * np.tan(np.minimum(roll * since, bank)) / speed_mps
    turned = np.minimum(np.cumsum(rate) * step, math.radians(abs(turn_deg)))
    heading = math.radians(217.0) + math.copysign(1.0, turn_deg) * turned
    along = np.cumsum([np.cos(heading), np.sin(heading)], axis=1) * step * speed_mps
    for after_s in (2.0, 4.0, 6.0, 11.0):
        k = round(after_s / step)
        state = flight.at(np.array([3.0, 3.0 + after_s]))
        north, east, _ = line_of_sight_ned(
            state.lat_deg[:1], state.lon_deg[:1], state.alt_m[:1],
            state.lat_deg[1:], state.lon_deg[1:], state.alt_m[1:],
        )  # fmt: skip
        # A step of the sum is 0.1 to 0.3 m; arcs of one rate in place of a growing one are less.
        assert np.hypot(north[0] - along[0, k], east[0] - along[1, k]) < 2e-3 * speed_mps + 0.05
        change = math.remainder(float(state.yaw_rad[1]) - heading[k], 2.0 * math.pi)
        assert abs(change) < 0.012


@pytest.mark.parametrize("time_s", [0.0, 0.1, 0.4])
def test_a_manoeuvre_at_the_start_keeps_the_speed(time_s):
    own = ScriptedTrajectory(
        "own", lat_deg=-41.0, lon_deg=4.0, alt_m=1000.0, heading_deg=217.0, speed_mps=40.0,
        climb_mps=3.0,
    )  # fmt: skip
    rises = Manoeuvre(vertical_speed_mps=2.0, vertical_acceleration_mps2=10.0)
    for manoeuvre, climb_mps in ((Manoeuvre(0.3, 0.1), 0.0), (rises, 5.0)):
        state = SteeredFlight(own).add_manoeuvre(time_s, manoeuvre).at(np.array([4.0, 5.0]))
        north, east, _ = line_of_sight_ned(
            state.lat_deg[:1], state.lon_deg[:1], state.alt_m[:1],
            state.lat_deg[1:], state.lon_deg[1:], state.alt_m[1:],
        )  # fmt: skip
        assert np.hypot(north[0], east[0]) == pytest.approx(40.0, rel=2e-3)
        assert state.alt_m[1] - state.alt_m[0] == pytest.approx(climb_mps, abs=1e-3)


def test_a_manoeuvre_that_comes_in_a_roll_goes_on_from_there():
    manoeuvre = Manoeuvre(1.2, bank_rad=0.7, roll_rate_rad_s=0.15)
    once = SteeredFlight(STRAIGHT).add_manoeuvre(10.0, manoeuvre)
    climbs = once.add_manoeuvre(12.0, Manoeuvre(climb_m=100.0, climb_rate_mps=5.0))
    times = np.array([11.0, 13.0, 16.0, 30.0])
    assert climbs.at(times).yaw_rad == pytest.approx(once.at(times).yaw_rad, abs=1e-5)


def test_manoeuvres_follow_each_other_and_the_old_flight_stays():
    once = SteeredFlight(STRAIGHT).add_manoeuvre(10.0, Manoeuvre(0.5, 0.05))
    twice = once.add_manoeuvre(40.0, Manoeuvre(-0.5, 0.05))
    assert len(once.parts) == 1
    times = np.array([5.0, 25.0, 39.9])
    for got, expected in zip(twice.at(times).arrays(), once.at(times).arrays(), strict=True):
        assert np.array_equal(got, expected)
    assert twice.at(np.array([80.0])).yaw_rad[0] == pytest.approx(math.pi / 2, abs=2e-3)


def test_a_climbing_flight_levels_off():
    climbing = ScriptedTrajectory(
        "own", lat_deg=52.0, lon_deg=4.0, alt_m=1000.0, heading_deg=0.0, speed_mps=60.0,
        climb_mps=5.0,
    )  # fmt: skip
    state = (
        SteeredFlight(climbing).add_manoeuvre(10.0, Manoeuvre(0.2, 0.05)).at(np.array([10.0, 50.0]))
    )
    assert state.alt_m == pytest.approx([1050.0, 1050.0], abs=0.01)


@pytest.mark.parametrize("climb_m", [180.0, -240.0])
def test_it_climbs_by_the_change_at_the_rate_and_levels_off(climb_m):
    flight = SteeredFlight(STRAIGHT).add_manoeuvre(
        20.0, Manoeuvre(climb_m=climb_m, climb_rate_mps=4.0)
    )
    done_s = 20.0 + abs(climb_m) / 4.0
    state = flight.at(np.array([20.0, 30.0, done_s, done_s + 50.0]))
    start = float(STRAIGHT.at(np.array([20.0])).alt_m[0])
    wanted = [0.0, math.copysign(40.0, climb_m), climb_m, climb_m]
    assert state.alt_m - start == pytest.approx(wanted, abs=0.02)
    straight = STRAIGHT.at(np.array([20.0, 30.0, done_s, done_s + 50.0]))
    assert state.yaw_rad == pytest.approx(straight.yaw_rad, abs=1e-6)


@pytest.mark.parametrize("change", [-37.0, 12.3])
def test_a_speed_changes_steadily(change):
    """North of the start by v t + a t² / 2 until the speed is there, then with that speed."""
    climbing = ScriptedTrajectory(
        "own", lat_deg=52.0, lon_deg=4.0, alt_m=1000.0, heading_deg=0.0, speed_mps=60.0,
        climb_mps=5.0,
    )  # fmt: skip
    ends_s = abs(change) / 1.5
    for told, flown in (
        (Manoeuvre(speed_mps=change, acceleration_mps2=1.5), "north"),
        (Manoeuvre(vertical_speed_mps=change, vertical_acceleration_mps2=1.5), "up"),
    ):
        times = np.linspace(0.0, ends_s + 20.0, 173)
        state = SteeredFlight(climbing).add_manoeuvre(10.0, told).at(10.0 + times)
        north, east, _ = line_of_sight_ned(
            52.0, 4.0, 1000.0, state.lat_deg, state.lon_deg, np.full(len(times), 1000.0)
        )
        gone = math.copysign(1.5, change) * (
            0.5 * np.minimum(times, ends_s) ** 2 + ends_s * np.maximum(times - ends_s, 0.0)
        )
        along = 600.0 + 60.0 * times + (gone if flown == "north" else 0.0)
        up = 1050.0 + 5.0 * times + (gone if flown == "up" else 0.0)
        assert np.abs(state.alt_m - up).max() < 0.07
        assert np.abs(east).max() < 0.01
        assert np.abs(north - along).max() < 0.35 + 0.07  # geodesic at altitude against chord


def test_a_speed_does_not_become_negative():
    told = Manoeuvre(speed_mps=-80.0, acceleration_mps2=4.0)
    state = SteeredFlight(STRAIGHT).add_manoeuvre(0.0, told).at(np.array([16.0, 50.0]))
    assert state.lon_deg[0] == state.lon_deg[1]


def as_told(commands):
    times_s, manoeuvres = map(np.array, zip(*commands, strict=True))
    return ManoeuvresTold(times_s, times_s, np.full(len(times_s), -1), manoeuvres)


def test_who_is_told_more_often_than_others_flies_as_if_alone():
    left, right = Manoeuvre(-0.5, 0.05), Manoeuvre(0.4, 0.05)
    told = [[(10.0, left)], [(5.0, right), (30.0, left)], [(8.0, left), (9.0, right), (40.0, left)]]
    times = np.linspace(0.0, 80.0, 33)
    for one, found in zip(
        told, steered_flights([STRAIGHT] * 3, list(map(as_told, told))), strict=True
    ):
        alone = SteeredFlight(STRAIGHT)
        for time_s, manoeuvre in one:
            alone = alone.add_manoeuvre(time_s, manoeuvre)
        for got, expected in zip(found.at(times).arrays(), alone.at(times).arrays(), strict=True):
            assert np.array_equal(got, expected)


def reckoned(start, told, times):
    """North, east, up and heading of who flies all that is told side by side, in small steps."""
    north = east = up = 0.0
    heading, climb, speed = start
    step_s, found = 0.01, []
    turns, climbs, goes, faster = 0.0, 0.0, 0.0, 0.0
    turn_rate = climb_rate = push = lift = 0.0
    waiting = list(told)
    for number in range(round(max(times) / step_s) + 1):
        while waiting and waiting[0][0] <= number * step_s + 1e-9:
            new = waiting.pop(0)[1]
            if new.turn_rad:
                turns, turn_rate = new.turn_rad, math.copysign(new.rate_rad_s, new.turn_rad)
            if new.climb_m:
                climbs, climb_rate = new.climb_m, math.copysign(new.climb_rate_mps, new.climb_m)
                goes = climb = 0.0
            if new.vertical_speed_mps:
                goes, lift = new.vertical_speed_mps, new.vertical_acceleration_mps2
                climb, climbs = climb + (climb_rate if climbs else 0.0), 0.0
            if new.speed_mps:
                faster, push = new.speed_mps, new.acceleration_mps2
        found.append((north, east, up, heading))
        part_s = min(step_s, turns / turn_rate) if turns else 0.0
        rise_s = min(step_s, climbs / climb_rate) if climbs else 0.0
        gain = math.copysign(min(push * step_s, abs(faster)), faster)
        more = math.copysign(min(lift * step_s, abs(goes)), goes)
        along = (speed + 0.5 * gain) * step_s
        track = heading + 0.5 * turn_rate * part_s
        north, east = north + along * math.cos(track), east + along * math.sin(track)
        up += climb_rate * rise_s + (climb + 0.5 * more) * step_s
        heading, speed, climb = heading + turn_rate * part_s, speed + gain, climb + more
        turns = turns - turn_rate * part_s if part_s == step_s else 0.0
        climbs = climbs - climb_rate * rise_s if rise_s == step_s else 0.0
        faster, goes = faster - gain, goes - more
    return np.array([found[round(t / step_s)] for t in times])


TURN = Manoeuvre(turn_rad=math.radians(40.0), rate_rad_s=math.radians(2.0))
BACK = Manoeuvre(turn_rad=math.radians(-65.0), rate_rad_s=math.radians(3.0))
CLIMB = Manoeuvre(climb_m=120.0, climb_rate_mps=4.0)
SINK = Manoeuvre(climb_m=-70.0, climb_rate_mps=2.5)
FASTER = Manoeuvre(speed_mps=22.0, acceleration_mps2=0.8)
SLOWER = Manoeuvre(speed_mps=-31.0, acceleration_mps2=1.1)
RISING = Manoeuvre(vertical_speed_mps=3.0, vertical_acceleration_mps2=1.0)


@pytest.mark.parametrize(
    "told",
    [
        [(5.0, TURN), (11.0, CLIMB)],
        [(5.0, CLIMB), (11.0, TURN)],
        [(5.0, TURN), (9.0, CLIMB), (10.0, FASTER), (30.0, SLOWER)],
        [(5.0, CLIMB), (12.0, SINK)],  # the second replaces the first
        [(5.0, TURN), (12.0, BACK), (13.0, RISING)],
        [(5.0, RISING), (20.0, BACK), (24.0, SINK)],
        [(5.0, FASTER), (5.0, SINK), (5.0, TURN)],
        [(4.0, TURN._replace(climb_m=55.0, climb_rate_mps=3.0, speed_mps=9.0,
                             acceleration_mps2=0.5))],
    ],
)  # fmt: skip
def test_turns_climbs_and_speeds_are_flown_together(told):
    """South of the equator at 217 deg: a command replaces its own part and no other."""
    own = ScriptedTrajectory(
        "own", lat_deg=-33.9, lon_deg=18.4, alt_m=800.0, heading_deg=217.0, speed_mps=55.0
    )
    flight = SteeredFlight(own)
    for time_s, manoeuvre in told:
        flight = flight.add_manoeuvre(time_s, manoeuvre)
    times = np.array([4.0, 8.5, 11.5, 12.5, 17.0, 24.0, 26.0, 33.0, 41.0, 60.0])
    want = reckoned((math.radians(217.0), 0.0, 55.0), told, times)
    state = flight.at(times)
    north, east, _ = line_of_sight_ned(
        -33.9, 18.4, 800.0, state.lat_deg, state.lon_deg, np.full(len(times), 800.0)
    )
    assert np.abs(state.alt_m - 800.0 - want[:, 2]).max() < 0.1
    turned = np.remainder(state.yaw_rad - want[:, 3] + 1.0, 2.0 * math.pi) - 1.0
    assert np.abs(turned).max() < math.radians(0.06)  # the meridians meet by so much
    assert np.hypot(north - want[:, 0], east - want[:, 1]).max() < 0.5


def test_a_turn_that_a_climb_meets_ends_where_it_would_have_ended():
    """And so do others that are told of at the same instants, flown together with it."""
    commands = [(10.0, TURN), (13.1, CLIMB), (13.1, FASTER), (29.7, SINK)]
    alone = SteeredFlight(STRAIGHT)
    for time_s, manoeuvre in commands:
        alone = alone.add_manoeuvre(time_s, manoeuvre)
    only = SteeredFlight(STRAIGHT).add_manoeuvre(10.0, TURN)
    ends = np.array([30.0])
    assert alone.at(ends).yaw_rad == pytest.approx(only.at(ends).yaw_rad, abs=1e-4)
    times = np.linspace(0.0, 80.0, 33)
    for found in steered_flights([STRAIGHT] * 2, [as_told(commands)] * 2):
        for got, expected in zip(found.at(times).arrays(), alone.at(times).arrays(), strict=True):
            assert np.array_equal(got, expected)


def test_fleets_that_grew_out_of_one_each_keep_their_own_manoeuvres():
    """A run that goes back steers anew from a fleet that was steered on already."""
    runs, times = np.arange(3), np.arange(0.0, 40.0, 0.5)
    fleet = SteeredFleet(fleet_of([STRAIGHT] * 3))
    first = fleet
    for at_s in (5.0, 7.0, 9.0):
        first = first.add_manoeuvres(
            runs, np.full(3, at_s), [Manoeuvre(0.1 * k, 0.05) for k in (1, 2, 3)]
        )

    def ways(fleet):
        return np.array([fleet[run].at(times).lat_deg for run in runs.tolist()])

    before = ways(first)
    both = [
        first.add_manoeuvres(
            np.array(who), np.full(len(who), at_s), [Manoeuvre(turn, 0.05)] * len(who)
        )
        for who, at_s, turn in (([0, 2], 20.0, 0.5), ([0, 1], 15.0, -0.7))
    ]
    assert np.array_equal(ways(first), before)
    for fleet, (who, at_s, turn) in zip(
        both, (([0, 2], 20.0, 0.5), ([0, 1], 15.0, -0.7)), strict=True
    ):
        for run in runs.tolist():
            alone = SteeredFlight(STRAIGHT)
            for before_s in (5.0, 7.0, 9.0):
                alone = alone.add_manoeuvre(before_s, Manoeuvre(0.1 * (run + 1), 0.05))
            if run in who:
                alone = alone.add_manoeuvre(at_s, Manoeuvre(turn, 0.05))
            assert np.array_equal(ways(fleet)[run], alone.at(times).lat_deg)
            # As many as count: by the first ones only, or by none.
            for known in (0, 3):
                got = fleet.each(np.full(len(times), run), times, np.full(len(times), known))
                expected = before[run] if known else STRAIGHT.at(times).lat_deg
                assert np.array_equal(got.lat_deg, expected)
