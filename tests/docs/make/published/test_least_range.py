"""The section of least ranges: flights against a turn that is integrated by hand, and the count."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import brentq

from docs.make.published import least_range
from docs.make.published.least_range import RATIOS, main, ratio_rows, risk_ratio
from docs.make.published.turn_flights import (
    KT_MPS,
    LeastRange,
    closing_speeds,
    least_ranges,
    turns_deg,
)
from docs.make.published.turn_geometry import (
    DISC_M,
    as_searched_m,
    least_range_m,
    turned_rad,
)

DATA = Path(os.environ.get("REFERENCE_DATA", Path(__file__).parents[5] / "shared" / "data"))


def by_hand(azimuth_deg, closing_mps):
    """Least range of the better turn by 90 deg over a flat Earth: ψ' = g tan φ / v, φ = p t."""
    v = 60.0 * KT_MPS
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
    speeds = closing_speeds(azimuth_deg, kt * KT_MPS)
    assert [one.closing_mps for one in found] == speeds and len(speeds) == (2 if kt < 60 else 1)
    for one, speed in zip(found, speeds, strict=True):
        by_geometry = least_range_m(azimuth_deg, speed, [90.0])
        assert by_geometry == pytest.approx(by_hand(azimuth_deg, speed), abs=0.3)
        assert one.range_m == pytest.approx(by_geometry, abs=0.3)
        assert one.geometry_m == by_geometry


def test_turns_from_behind_are_also_by_less():
    speed = closing_speeds(172.0, 105 * KT_MPS)[0]
    (one,) = least_ranges(105, [172.0])
    assert one.range_m == pytest.approx(least_range_m(172.0, speed, [75.0]), abs=0.3)
    assert one.range_m < least_range_m(172.0, speed, [90.0]) - 2.0
    assert turns_deg(140.0) == turns_deg(-140.0) == (90.0,)


def test_how_far_a_rolling_turn_has_turned():
    # The integral of g tan(p t) / v, by Simpson's rule, and a steady rate from 4.5 s on.
    time_s = np.linspace(0.0, 4.5, 201)
    rate = 9.80665 * np.tan(np.radians(10.0) * time_s) / (60.0 * KT_MPS)
    assert turned_rad(np.array([4.5]))[0] == pytest.approx(simpson(rate, x=time_s), rel=1e-6)
    ahead = turned_rad(np.array([6.0, 7.0]))
    assert ahead[1] - ahead[0] == pytest.approx(9.80665 / (60.0 * KT_MPS))


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


def test_the_ratio_counts_every_course_of_the_grid():
    # Of a slower intruder, who comes from within 35.69 deg: 142 azimuths of 0.25 deg, two courses.
    near = [LeastRange(a, c, 30.0, 400.0) for c in (0, 1) for a in (0.25, 35.0)]
    assert risk_ratio(near, 35, 60.0, 1000.0) == pytest.approx(1.0 - 240 / 284)
    assert risk_ratio(near, 35, 60.0, 300.0) == 1.0
    # Of a faster one from anywhere; half of the azimuths in view need more than there is.
    rising = [LeastRange(0.25, 0, 60.0, 900.0), LeastRange(30.0, 0, 60.0, 1100.0)]
    ratio = risk_ratio(rising, 105, 60.0, 1000.0, None)
    assert ratio == pytest.approx(1.0 - 60 / 719, abs=2 / 719)


def test_needed_ranges_may_be_a_step_longer_or_as_flown():
    # 195 kt head-on need 1095 m; a step of 0.2 s is 26 m there.
    found = [LeastRange(a, 0, 131.0, 1005.0) for a in (0.25, 30.0)]
    at = [risk_ratio(found, 195, 60.0, 1000.0, steps) for steps in (-1.0, 0.0, 1.0, None)]
    assert at[0] == pytest.approx(1.0 - 120 / 719) and at[2] == at[3] == 1.0
    # 1005 m are 7.67 s at 131 m/s; the search counts 979.6 m, and 1.4 m are the disc's.
    assert at[1] < 1.0


def test_rows_of_ratios_say_what_a_step_comes_to():
    found = {kt: [LeastRange(a, 0, 131.0, 1005.0) for a in (0.25, 30.0)] for kt in RATIOS}
    rows = ratio_rows(found)
    assert [row.published for row in rows] == list(RATIOS.values())
    assert rows[-1].interval == (pytest.approx(1.0 - 120 / 719), 1.0)


def test_any_speed_is_asked_for_by_a_command(capsys):
    main(["195", "20", "--range-m", "1200", "--field-deg", "360"])
    out = capsys.readouterr().out.splitlines()
    (azimuth, course, closing, flown, closed, _) = map(float, out[1].split(","))
    assert (azimuth, course) == (20.0, 0.0) and len(out) == 3
    assert closing == pytest.approx(closing_speeds(20.0, 195 * KT_MPS)[0], abs=1e-4)
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
