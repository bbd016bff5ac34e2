"""The section of least ranges: flights against a turn that is integrated by hand, and the count."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import brentq

from components.arguments.units import KNOT_M_S
from docs.make.published import least_range
from docs.make.published.least_range import RATIOS, grid_courses, main, ratio_rows
from docs.make.published.turn_flights import (
    LeastRange,
    closing_speeds,
    least_ranges,
    turns_deg,
)
from docs.make.published.turn_geometry import (
    DISC_M,
    TIME_STEP_S,
    as_searched_m,
    least_range_m,
    stepped_least_range_m,
    turned_rad,
)

DATA = Path(os.environ.get("REFERENCE_DATA", Path(__file__).parents[5] / "shared" / "data"))


def by_hand(azimuth_deg, closing_mps):
    """Least range of the better turn by 90 deg over a flat Earth: ψ' = g tan φ / v, φ = p t."""
    v = 60.0 * KNOT_M_S
    line = np.array([math.sin(math.radians(azimuth_deg)), math.cos(math.radians(azimuth_deg))])
    intruder = np.array([0.0, v]) - closing_mps * line

    def cleared(range_m, side):
        """By how much the disc is cleared by a turn at a range: its motion integrated."""

        def motion(t, state):
            bank = min(math.radians(10.0) * t, math.radians(45.0))
            turning = state[2] < 0.5 * math.pi
            rate = 9.80665 * math.tan(bank) / v if turning else 0.0
            psi = side * min(state[2], 0.5 * math.pi)
            return [v * math.sin(psi) - intruder[0], v * math.cos(psi) - intruder[1], rate]

        done = solve_ivp(motion, (0.0, 40.0), [0.0, 0.0, 0.0], max_step=0.05, rtol=1e-8)
        return np.hypot(*(done.y[:2] - range_m * line[:, np.newaxis])).min() - DISC_M

    found = []
    for side in (-1.0, 1.0):
        if cleared(2000.0, side) > 0.0:
            found.append(brentq(cleared, DISC_M, 2000.0, args=(side,), xtol=0.01))
    return min(found)


@pytest.mark.parametrize(("kt", "azimuth_deg"), [(35, 20.0), (140, 100.0)])
def test_the_least_range_is_that_of_the_turn_by_hand(kt, azimuth_deg):
    found = least_ranges(kt, [azimuth_deg])
    speeds = closing_speeds(azimuth_deg, kt * KNOT_M_S)
    assert [one.closing_mps for one in found] == speeds and len(speeds) == (2 if kt < 60 else 1)
    for one, speed in zip(found, speeds, strict=True):
        by_geometry = least_range_m(azimuth_deg, speed, [90.0])
        assert by_geometry == pytest.approx(by_hand(azimuth_deg, speed), abs=0.3)
        assert one.range_m == pytest.approx(by_geometry, abs=0.3)
        assert one.geometry_m == by_geometry


def test_turns_from_behind_are_also_by_less():
    speed = closing_speeds(172.0, 105 * KNOT_M_S)[0]
    (one,) = least_ranges(105, [172.0])
    assert one.range_m == pytest.approx(least_range_m(172.0, speed, [60.0]), abs=0.3)
    assert one.range_m < least_range_m(172.0, speed, [75.0]) - 1.0
    assert turns_deg(140.0) == turns_deg(-140.0) == (90.0,)


def test_how_far_a_rolling_turn_has_turned():
    # The integral of g tan(p t) / v, by Simpson's rule, and a steady rate from 4.5 s on.
    time_s = np.linspace(0.0, 4.5, 201)
    rate = 9.80665 * np.tan(np.radians(10.0) * time_s) / (60.0 * KNOT_M_S)
    assert turned_rad(np.array([4.5]))[0] == pytest.approx(simpson(rate, x=time_s), rel=1e-6)
    ahead = turned_rad(np.array([6.0, 7.0]))
    assert ahead[1] - ahead[0] == pytest.approx(9.80665 / (60.0 * KNOT_M_S))


def test_a_search_ends_on_its_staircase():
    # 190 s halved ten times are 0.18555 s: 979 of them are 181.65 s, to the next tenth 181.7 s.
    v, less = 130.0, DISC_M**2 / (190.0 * 130.0)
    assert as_searched_m(8.45 * v, v) == pytest.approx(8.3 * v - less, abs=1e-6)
    # A little less than 190 s are left where the disc is large: 189.3 s for a slow one.
    v, found = 13.0, set()
    for tau in np.arange(10.0, 15.0, 0.01):
        taken = (as_searched_m(tau * v, v) + DISC_M**2 / (190.0 * v)) / v
        assert -0.2 - 1e-9 <= taken - tau <= 1e-9
        found.add(round(taken, 6))
    assert len(found) == pytest.approx(5.0 / (189.3 / 1024.0), abs=1.5)
    assert all(abs(10.0 * one - round(10.0 * one)) < 1e-4 for one in found)


def test_both_sides_are_alike():
    left, right = (least_ranges(105, [side * 40.0])[0].range_m for side in (-1.0, 1.0))
    assert left == pytest.approx(right, abs=1.5)


def stepped_by_hand(azimuth_deg, closing_mps, turn_deg, side):
    """The range from which on a turn by their equations, step by step, clears the disc."""
    v, dt = 60.0 * KNOT_M_S, TIME_STEP_S
    line = np.array([math.sin(math.radians(azimuth_deg)), math.cos(math.radians(azimuth_deg))])
    intruder = np.array([0.0, v]) - closing_mps * line

    def nearest(range_m):
        own, velocity, bank, turned, steps = np.zeros(2), np.array([0.0, v]), 0.0, 0.0, 0
        distances = [range_m]
        while True:
            bank = min(bank + 1.0, 45.0)
            angle = 9.80665 * math.tan(math.radians(bank)) / v * dt
            if turned + angle > math.radians(turn_deg):
                break
            aside = side * np.array([velocity[1], -velocity[0]])
            own = own + dt * velocity + 0.5 * angle * dt * aside
            velocity = (1.0 - 0.5 * angle**2) * velocity + angle * aside
            turned, steps = turned + angle, steps + 1
            distances.append(float(np.hypot(*(range_m * line + steps * dt * intruder - own))))
        heading = side * math.radians(turn_deg)
        apart = range_m * line + (steps + 1) * dt * intruder - own
        relative = intruder - v * np.array([math.sin(heading), math.cos(heading)])
        later_s = max(-float(apart @ relative) / float(relative @ relative), 0.0)
        if later_s > 0.0:
            distances.append(float(np.hypot(*(apart + later_s * relative))))
        return min(distances) - DISC_M

    ranges = np.arange(160.0, 2000.0, 8.0)
    last = max(r for r in ranges if nearest(r) < 0.0)
    return brentq(nearest, last, last + 8.0, xtol=1e-6)


@pytest.mark.parametrize(
    ("kt", "azimuth_deg", "turn_deg", "side"),
    [(195, 4.0, 90.0, 1.0), (105, 100.0, 90.0, -1.0), (35, 20.0, 90.0, -1.0),
     (105, 172.0, 60.0, 1.0), (80, 60.0, 45.0, -1.0)],
)  # fmt: skip
def test_a_turn_by_steps_is_that_of_their_equations(kt, azimuth_deg, turn_deg, side):
    speed = closing_speeds(azimuth_deg, kt * KNOT_M_S)[0]
    found = stepped_least_range_m(azimuth_deg, speed, [turn_deg], [side])
    assert found == pytest.approx(stepped_by_hand(azimuth_deg, speed, turn_deg, side), abs=0.01)


def as_geometry_says(kt, azimuths_deg, more_m=0.0):
    """Flights that need so much more than geometry does."""
    return [
        LeastRange(a, c, speed, least_range_m(a, speed, turns_deg(a)) + more_m)
        for a in azimuths_deg
        for c, speed in enumerate(closing_speeds(a, kt * KNOT_M_S))
    ]


def test_the_ratio_counts_every_course_of_the_grid():
    # Of a slower intruder, who comes from within 35.69 deg: 142 azimuths of 0.25 deg, two courses.
    near = grid_courses(as_geometry_says(35, [0.25]), 35)
    assert near.risk_ratio(60.0, 1000.0) == pytest.approx(1.0 - 240 / 284)
    assert near.risk_ratio(60.0, 150.0) == 1.0
    # Courses that nobody flew are not led out of.
    first = grid_courses([one for one in as_geometry_says(35, [0.25]) if not one.course], 35)
    assert first.risk_ratio(60.0, 1000.0) == pytest.approx(1.0 - 120 / 284)


def test_what_flights_need_more_goes_along_straight_lines():
    more = {0.25: 100.0, 30.0: 160.0}
    found = [one for a, m in more.items() for one in as_geometry_says(105, [a], m)]
    courses, without = grid_courses(found, 105), grid_courses(as_geometry_says(105, [0.25]), 105)
    expected = np.interp(courses.azimuth_deg, list(more), list(more.values()))
    assert courses.flown_m - without.flown_m == pytest.approx(expected, abs=1e-9)
    assert np.abs(courses.counted_m - without.counted_m - expected).max() < courses.step_m.max()
    assert courses.step_m[0] == pytest.approx(0.2 * closing_speeds(0.25, 105 * KNOT_M_S)[0])


def test_needed_ranges_may_be_a_step_longer_or_as_flown():
    # 195 kt head-on need 1095 m; a step of 0.2 s is 26 m there.
    courses = grid_courses(as_geometry_says(195, [0.25], -70.0), 195)
    flown = courses.risk_ratio(60.0, 1000.0, as_flown=True)
    assert flown == pytest.approx(1.0 - (courses.flown_m[:120] < 1000.0).mean() * 120 / 719)
    at = [courses.risk_ratio(60.0, 1000.0, steps_more=steps) for steps in (-2.0, 0.0, 2.0)]
    assert at[0] == pytest.approx(1.0 - 120 / 719) and at[2] == 1.0
    assert at[0] < at[1] < 1.0


def test_geometry_as_it_is_counted_gives_the_published_ratios(monkeypatch):
    # Their staircase decides which of the 120 azimuths in view are cleared: 107 and 8.
    rest = {kt: RATIOS[kt] for kt in (35, 175, 185)}
    monkeypatch.setattr(least_range, "RATIOS", rest)
    rows = ratio_rows({kt: grid_courses(as_geometry_says(kt, [0.25]), kt) for kt in rest})
    assert [row.published for row in rows] == list(rest.values())
    assert [row.ours for row in rows] == pytest.approx([1 - 240 / 284, 1 - 107 / 719, 1 - 8 / 719])
    assert [row.verdict for row in rows] == ["equal"] * 3
    assert rows[2].interval[0] < 0.9 and rows[2].interval[1] == 1.0


def test_any_speed_is_asked_for_by_a_command(capsys):
    main(["195", "20", "--range-m", "1200", "--field-deg", "360"])
    out = capsys.readouterr().out.splitlines()
    (azimuth, course, closing, flown, closed, _) = map(float, out[1].split(","))
    assert (azimuth, course) == (20.0, 0.0) and len(out) == 3
    assert closing == pytest.approx(closing_speeds(20.0, 195 * KNOT_M_S)[0], abs=1e-4)
    assert flown == pytest.approx(closed, abs=0.4)
    assert out[-1].endswith("1200 m: 0.0000")


def test_flown_ranges_are_within_steps_of_the_published_ones(monkeypatch):
    folder = DATA / "published" / "nrc_min_range"
    if not folder.exists():
        pytest.skip(f"there is no {folder}")
    monkeypatch.setattr(least_range, "DATA", folder)
    found = {35: least_ranges(35, [30.0]), 195: least_ranges(195, [90.0])}
    assert all(-0.1 < one < 0.25 for one in least_range.differences_s(found, as_flown=True))
    off = least_range.differences_s(found)
    assert len(off) == 3
    assert all(abs(one) < least_range.STEP_S + 5e-4 for one in off)


@pytest.mark.parametrize("intruder_kt", [35, 61, 65, 75, 105, 195])
def test_no_other_turn_lets_an_overtaking_aircraft_by_with_less(intruder_kt):
    """Within a step of the search or a metre of all turns from 20 to 90 deg, by five degrees."""
    for azimuth in (145.0, 160.0, 175.0):
        for speed in closing_speeds(azimuth, intruder_kt * KNOT_M_S):
            every = stepped_least_range_m(azimuth, speed, range(20, 95, 5))
            tried = stepped_least_range_m(azimuth, speed, turns_deg(azimuth))
            assert tried - every < max(0.3 * speed, 1.0)
