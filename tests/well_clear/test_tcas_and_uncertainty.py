"""Advisories by their definition at 40 digits; bounds on states hold for every state within."""

import mpmath
import numpy as np
import pytest

from components.arguments.units import FOOT_M
from components.well_clear.detection import (
    Bounds,
    select_bounds,
    uncertain_violation_span,
    violation_or_advisory_span,
)
from components.well_clear.tcas import (
    RESOLUTION_ADVISORY,
    TRAFFIC_ADVISORY,
    TcasAdvisory,
    tcas_advisory_span,
)
from components.well_clear.volume import Volume, violation_span
from tests.well_clear.test_violation_spans import random_states, span_by_bisection

END_S = 60.0
#: Upper bounds of the levels from 2 on, ft.
TOPS_FT = (1000, 2350, 5000, 10_000, 20_000, 42_000)


def advisory_at(table, state, altitude_m, climb, t):
    """The definition at one instant, at the level of the altitude then."""
    x, y, z = (state[i] + t * state[i + 3] for i in range(3))
    vx, vy, w = state[3:]
    sizes = table[sum(altitude_m + t * climb > top * FOOT_M for top in TOPS_FT)]
    if sizes is None:
        return False
    d, miss = mpmath.mpf(sizes.distance_m), sizes.miss_m
    q, p, a = x * x + y * y, x * vx + y * vy, vx * vx + vy * vy
    cross = x * vy - y * vx
    vertical = abs(z) <= sizes.height_m or (w != 0 and 0 <= -z / w <= sizes.tau_s)
    horizontal = q <= d * d or (p < 0 and (d * d - q) / p <= sizes.tau_s)
    if np.isfinite(miss):
        miss = mpmath.mpf(miss)
        if a == 0:
            horizontal = horizontal and q <= miss * miss
        else:
            root_sq = miss * miss * a - cross * cross
            horizontal = horizontal and root_sq >= 0 and -p + mpmath.sqrt(root_sq) >= 0
    return vertical and horizontal


@pytest.mark.parametrize(
    ("table", "resolution"), [(TRAFFIC_ADVISORY, False), (RESOLUTION_ADVISORY, True)]
)
def test_advisories_are_due_when_the_definition_says_so(table, resolution):
    """Level flights in a layer, and in climbs through one: there the earliest and the latest."""
    states = random_states(11, 45)
    states[0] = (1e-9, 0.0, 100.0, 0.0, 0.0, 0.0)
    states[1] = (-3000.0, 0.0, 40.0, 80.0, 0.0, 0.0)  # meets it head-on, level
    states[2] = (-3000.0, 200.0, 300.0, 80.0, 0.0, -12.0)
    draw = np.random.default_rng(12)
    altitude = draw.uniform(100, 14_000, len(states))
    altitude[1:3] = 2350 * FOOT_M, 10_000 * FOOT_M - 1e-6  # at a bound, which is of the level below
    climb = np.where(np.arange(len(states)) % 3 == 0, draw.normal(0, 8, len(states)), 0.0)
    found = tcas_advisory_span(tuple(states.T), altitude, climb, resolution=resolution, end_s=END_S)
    met = 0
    with mpmath.workdps(40):
        for number, state in enumerate(states.tolist()):
            exact = [mpmath.mpf(part) for part in state]
            above, rises = mpmath.mpf(altitude[number]), mpmath.mpf(climb[number])
            wanted = span_by_bisection(
                lambda t, s=exact, h=above, c=rises: advisory_at(table, s, h, c, t), exact, END_S
            )
            got = found.begin_s[number], found.end_s[number]
            if wanted is None or wanted[1] - wanted[0] < 1e-12:
                assert got == (np.inf, -np.inf), (state, got)
                continue
            met += 1
            assert abs(got[0] - wanted[0]) < 1e-9 and abs(got[1] - wanted[1]) < 1e-9, (state, got)
    assert met >= 8


def test_only_the_times_looked_at_count():
    state = tuple(np.array([part]) for part in (-3000.0, 0.0, 40.0, 80.0, 0.0, 0.0))
    level = {"altitude_m": np.array([1000.0]), "climb_mps": np.array([0.0]), "resolution": True}
    whole = tcas_advisory_span(state, **level, end_s=60.0)
    # 3 km at 80 m/s are more than the 20 s of 1,000 m, 1.5 km are less: due at once.
    assert whole.begin_s > 10.0
    near = (np.array([-1500.0]), *state[1:])
    assert tcas_advisory_span(near, **level, end_s=60.0).begin_s == 0.0
    part = tcas_advisory_span(
        state, **level, begin_s=whole.begin_s + 2.0, end_s=whole.begin_s + 9.0
    )
    assert part.begin_s == pytest.approx(whole.begin_s + 2.0)
    assert part.end_s == pytest.approx(whole.begin_s + 9.0)


@pytest.mark.parametrize(("climb_mps", "edge_ft"), [(10.0, 5000.0), (-6.0, 10_000.0)])
def test_an_ownship_that_comes_to_wider_limits_is_advised_from_there_on(climb_mps, edge_ft):
    """0.45 nautical miles beside it: within 0.55 from 5,000 to 10,000 ft, not within 0.35 below.

    Coming down from above 10,000 ft, where it is 0.80, the advisory is there from the start.
    """
    state = tuple(np.array([part, part]) for part in (0.45 * 1852.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    off_s = np.array([30.0, 70.0])
    own_m = edge_ft * 0.3048 - climb_mps * off_s
    span = tcas_advisory_span(
        state, altitude_m=own_m, climb_mps=np.full(2, climb_mps), resolution=True, begin_s=0.5,
        end_s=60.0,
    )  # fmt: skip
    if climb_mps > 0.0:
        assert span.begin_s == pytest.approx([30.0, np.inf]) and span.end_s[0] == 60.0
    else:
        assert span.begin_s == pytest.approx([0.5, 0.5]) and (span.end_s == 60.0).all()


#: Position, height, velocity and climb are wrong by at most so much.
WRONG = (100.0, 20.0, 10.0, 1.0)
#: Relative state, bounds, from when and until when is looked, and the span, in closed form.
SPANS = [
    # Head on: the soonest over 4,900 - 900 m at 110 m/s, the last to leave 6,000 m at 90 m/s.
    ((-5000, 0, 0, 100, 0, 0), WRONG, 0.0, 90.0, 4000 / 110, 6000 / 90),
    ((0, 5000, 0, 0, -100, 0), WRONG, 40.0, 60.0, 40.0, 60.0),
    ((0, 5000, 0, 0, -100, 0), WRONG, 0.0, 36.0, np.inf, -np.inf),
    ((0, 5000, 0, 0, 100, 0), WRONG, 0.0, 60.0, np.inf, -np.inf),
    # Exactly known, beside others that are not: 4,100 m and 5,900 m at 100 m/s.
    ((3000, 4000, 0, -60, -80, 0), (0, 0, 0, 0), 0.0, 90.0, 41.0, 59.0),
    ((3000, 4000, 0, -60, -80, 0), (0, 0, 0, 0), 45.0, 50.0, 45.0, 50.0),
    # Leaving from within: 500 m more to 1,000 m at 90 m/s.
    ((500, 0, 0, 100, 0, 0), WRONG, 0.0, 90.0, 0.0, 500 / 90),
    # Nobody moves: within 1,000 m for ever, or never; if it can move, over 3,900 - 900 m at 15 m/s.
    ((950, 0, 0, 0, 0, 0), WRONG, 0.0, 90.0, 0.0, 90.0),
    ((4000, 0, 0, 5, 0, 0), WRONG, 0.0, 90.0, np.inf, -np.inf),
    ((4000, 0, 0, 5, 0, 0), WRONG, 0.0, 300.0, 200.0, 300.0),
    # Above, coming down: 580 - 250 m at 6 m/s, and 620 + 250 m at 4; the same from below.
    ((0, 0, 600, 0, 0, -5), WRONG, 0.0, 300.0, 55.0, 217.5),
    ((0, 0, -600, 0, 0, 5), WRONG, 0.0, 300.0, 55.0, 217.5),
    ((0, 0, 600, 0, 0, -5), WRONG, 0.0, 100.0, 55.0, 100.0),
    # Both: level from 55 s on, within 900 m from 4000 / 110 to 6000 / 90.
    ((-5000, 0, 600, 100, 0, -5), WRONG, 0.0, 300.0, 55.0, 6000 / 90),
    # Climbing away from within: 250 - 80 m at 4 m/s; level and out of it, never.
    ((0, 0, 100, 0, 0, 5), WRONG, 0.0, 300.0, 0.0, 170 / 4),
    ((0, 0, 300, 0, 0, 5), WRONG, 0.0, 300.0, np.inf, -np.inf),
    ((0, 0, 260, 0, 0, 0), WRONG, 0.0, 50.0, 0.0, 50.0),
]  # fmt: skip


def test_how_far_spans_reach_is_that_of_the_worst_within_the_bounds():
    states, bounds, begin_s, end_s, *wanted = (
        np.array(part, float).T for part in zip(*SPANS, strict=True)
    )
    volume = Volume(900.0, 250.0)
    found = violation_or_advisory_span(volume, tuple(states), None, Bounds(*bounds), begin_s, end_s)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    one = [tuple(states[:, :1]), None, Bounds(*bounds[:, :1]), 0.0, 90.0]
    np.testing.assert_allclose(
        np.ravel(violation_or_advisory_span(volume, *one)), [4000 / 110, 6000 / 90], rtol=1e-12
    )
    # Nothing said of errors is none.
    plain = violation_or_advisory_span(volume, tuple(states), None, None, begin_s, end_s)
    np.testing.assert_allclose(plain, violation_span(volume, tuple(states), begin_s, end_s))
    with pytest.raises(ValueError, match="advisories of TCAS II need the ownship's altitude"):
        violation_or_advisory_span(TcasAdvisory(True), tuple(states), None, None, 0.0, 60.0)
    part = select_bounds(Bounds(*bounds), [0, 4])
    assert [value.tolist() for value in part] == [[100, 0], [20, 0], [10, 0], [1, 0]]
    assert select_bounds(None, [0, 4]) is None


def test_no_state_within_the_bounds_violates_outside_the_span():
    """Drawn on the bounds and within them, in position, height and both speeds."""
    draw, count = np.random.default_rng(1), 150
    volume = Volume(1200.0, 140.0, 35.0)
    nominal = np.stack([
        *draw.uniform(-9000, 9000, (2, count)), draw.uniform(-400, 400, count),
        *draw.uniform(-120, 120, (2, count)), draw.uniform(-6, 6, count),
    ])  # fmt: skip
    bounds = Bounds(
        draw.uniform(1, 300, count), draw.uniform(1, 80, count), draw.uniform(0.1, 12, count),
        draw.uniform(0.1, 2, count),
    )  # fmt: skip
    span = uncertain_violation_span(volume, tuple(nominal), bounds, 0.0, 180.0)
    plain = violation_span(volume, tuple(nominal), 0.0, 180.0)
    assert (span.begin_s <= plain.begin_s).all() and (span.end_s >= plain.end_s).all()
    # With next to no error it is next to the same: it reaches no farther than it must.
    wide = Volume(3000.0, 300.0, 35.0, 20.0)
    next_to_none = Bounds(*np.full((4, count), 1e-3))
    tight = uncertain_violation_span(wide, tuple(nominal), next_to_none, 0.0, 180.0)
    exact = violation_span(wide, tuple(nominal), 0.0, 180.0)
    np.testing.assert_allclose(tight, exact, rtol=0.0, atol=0.02)
    assert np.isfinite(exact.begin_s).sum() > 20
    hits = 0
    for _ in range(120):
        way = draw.uniform(0, 2 * np.pi, (2, count))
        share = np.where(draw.random((2, count)) < 0.5, 1.0, np.sqrt(draw.random((2, count))))
        side = np.where(draw.random((2, count)) < 0.5, 1.0, draw.random((2, count)))
        side *= np.sign(draw.uniform(-1, 1, (2, count))) * 0.9999
        off = 0.9999 * share * np.stack([bounds.position_m, bounds.velocity_mps])
        true = nominal + np.stack([
            off[0] * np.cos(way[0]), off[0] * np.sin(way[0]), side[0] * bounds.height_m,
            off[1] * np.cos(way[1]), off[1] * np.sin(way[1]), side[1] * bounds.climb_mps,
        ])  # fmt: skip
        one = violation_span(volume, tuple(true), 0.0, 180.0)
        met = np.isfinite(one.begin_s)
        hits += int(met.sum())
        assert (span.begin_s[met] <= one.begin_s[met] + 1e-9).all()
        assert (span.end_s[met] >= one.end_s[met] - 1e-9).all()
    assert hits > 300
