"""Intervals of violation against root finding at 40 digits; all sizes are unequal."""

import math

import mpmath
import numpy as np
import pytest

from components.well_clear.volume import (
    PRESETS,
    TIME_VARIABLES,
    Volume,
    cylinder_span,
    is_inside_cylinder,
    violates,
    violation_span,
)

END_S = 180.0


def horizontal_at(volume, state, t):
    """The definition itself, at 40 digits: is the horizontal condition met at time t?"""
    x, y = (state[i] + t * state[3 + i] for i in range(2))
    vx, vy = state[3], state[4]
    q, p, a = x * x + y * y, x * vx + y * vy, vx * vx + vy * vy
    d = mpmath.mpf(volume.horizontal_m)
    if q <= d * d:
        return True
    if a == 0 or volume.time_variable == "none":
        return False
    closest = -p / a
    miss_sq = (x + closest * vx) ** 2 + (y + closest * vy) ** 2
    if miss_sq > d * d:
        return False
    if volume.time_variable == "modified_tau":
        variable = (d * d - q) / p if p < 0 else -1
    elif volume.time_variable == "time_to_closest":
        variable = closest
    else:
        variable = closest - mpmath.sqrt((d * d - miss_sq) / a) if p < 0 else -1
    return 0 <= variable <= volume.horizontal_time_s


def vertical_at(volume, state, t):
    z, w = state[2] + t * state[5], state[5]
    if abs(z) <= volume.vertical_m:
        return True
    return w != 0 and z * w <= 0 and -z / w <= volume.vertical_time_s


def inside_at(volume, state, t):
    return vertical_at(volume, state, t) and horizontal_at(volume, state, t)


def span_by_bisection(inside, state, end_s):
    """First and last time inside, found from probes and bisection of the definition alone."""
    x, y, z, vx, vy, w = state
    a = vx * vx + vy * vy
    probes = [mpmath.mpf(end_s) * k / 60 for k in range(61)]
    if a != 0:
        closest = -(x * vx + y * vy) / a
        probes += [closest, closest * (1 - mpmath.mpf("1e-9")), closest * mpmath.mpf("0.999")]
    if w != 0:
        probes += [-z / w, (-z - 1) / w, (-z + 1) / w]
    there = sorted(t for t in probes if 0 <= t <= end_s and inside(t))
    if not there:
        return None

    def edge(within, beyond):
        if inside(beyond):
            return beyond
        while abs(within - beyond) > mpmath.mpf(10) ** -14:
            middle = (within + beyond) / 2
            within, beyond = (middle, beyond) if inside(middle) else (within, middle)
        return within

    return edge(there[0], mpmath.mpf(0)), edge(there[-1], mpmath.mpf(end_s))


def compare(volume, states, tolerance_s=1e-9):
    met = 0
    found = violation_span(volume, tuple(np.array(states).T), 0.0, END_S)
    with mpmath.workdps(40):
        for number, state in enumerate(states):
            exact = [mpmath.mpf(part) for part in state]
            wanted = span_by_bisection(lambda t, s=exact: inside_at(volume, s, t), exact, END_S)
            got = found.begin_s[number], found.end_s[number]
            if wanted is None or wanted[1] - wanted[0] < 1e-12:
                assert got == (np.inf, -np.inf), (state, got)
            else:
                met += 1
                assert abs(got[0] - wanted[0]) < tolerance_s, (state, got, wanted)
                assert abs(got[1] - wanted[1]) < tolerance_s, (state, got, wanted)
    return met


def random_states(seed, count):
    draw = np.random.default_rng(seed)
    track = draw.uniform(0, 2 * np.pi, count)
    range_m, speed = draw.uniform(0, 12_000, count), draw.uniform(0, 250, count)
    aim = draw.normal(np.pi, 0.25, count)
    return np.stack(
        [
            range_m * np.sin(track), range_m * np.cos(track), draw.normal(0, 250, count),
            speed * np.sin(track + aim), speed * np.cos(track + aim), draw.normal(0, 6, count),
        ],
        axis=1,
    )  # fmt: skip


@pytest.mark.parametrize("variable", TIME_VARIABLES)
def test_random_flights_violate_when_the_definition_says_so(variable):
    volume = Volume(1222.0, 137.0, 33.0, 17.0, variable)
    assert compare(volume, random_states(5, 30).tolist()) >= 5


HARD = [
    (500.0, 300.0, 100.0, 0.0, 0.0, 0.0),  # inside, no relative motion
    (500.0, 300.0, 400.0, 0.0, 0.0, -3.0),  # within the radius, only descending
    (4000.0, 300.0, 40.0, 0.0, 0.0, -3.0),  # outside, only descending
    (300.0, -200.0, 20.0, 90.0, 10.0, 0.0),  # inside and leaving, level
    (300.0, -200.0, 137.0, 90.0, 10.0, 0.0),  # level on the vertical boundary
    (300.0, -200.0, math.nextafter(137.0, 200.0), 90.0, 10.0, 0.0),  # just above it
    (-9000.0, 0.0, 0.0, 1e-3, 0.0, 0.0),  # hardly moving, far away
    (-1222.0, 0.0, 0.0, 50.0, 0.0, -1.0),  # exactly on the circle, closing
    (1222.0, 0.0, 0.0, 50.0, 0.0, -1.0),  # exactly on the circle, leaving
    (-8000.0, 1221.999, 5.0, 80.0, 0.0, 0.0),  # nearly grazing
    (-8000.0, 1222.001, 5.0, 80.0, 0.0, 0.0),  # nearly missing
    (0.0, 0.0, 0.0, 100.0, 7.0, 2.0),  # at the same place
    (-6000.0, 30.0, 900.0, 100.0, 0.0, -900.0 / 60.0),  # level at the closest approach
    (-6000.0, 30.0, 10_000.0, 100.0, 0.0, -1e-9),  # hardly descending
    (-6000.0, 30.0, 100.0, 100.0, 0.0, 1e-9),
    (-6e6, 3.0, 0.0, 9e4, 0.0, 0.0),  # very fast
]


@pytest.mark.parametrize("variable", TIME_VARIABLES)
def test_hard_flights_violate_when_the_definition_says_so(variable):
    assert compare(Volume(1222.0, 137.0, 33.0, 17.0, variable), HARD) >= 7


@pytest.mark.parametrize("variable", TIME_VARIABLES)
def test_a_grazing_flight_is_no_violation(variable):
    grazing = tuple(np.array([part]) for part in (-8000.0, 1222.0, 5.0, 80.0, 0.0, 0.0))
    volume = Volume(1222.0, 137.0, 0.0, 0.0, variable)
    assert violation_span(volume, grazing, 0.0, END_S).begin_s[0] == np.inf
    inward = (grazing[0], grazing[1] - 1e-6, *grazing[2:])
    assert np.isfinite(violation_span(volume, inward, 0.0, END_S).begin_s[0])


@pytest.mark.parametrize("variable", TIME_VARIABLES)
def test_flights_violate_now_when_the_definition_says_so(variable):
    volume = Volume(1222.0, 137.0, 33.0, 17.0, variable)
    states = np.concatenate([random_states(8, 300) * [0.5, 0.5, 0.5, 1, 1, 1], HARD])
    found = violates(volume, tuple(states.T))
    with mpmath.workdps(40):
        wanted = [inside_at(volume, [mpmath.mpf(x) for x in s], 0) for s in states.tolist()]
    assert found.tolist() == wanted
    assert 30 < sum(wanted) < 270


def test_spans_begin_where_looking_begins_and_end_with_it():
    state = tuple(np.array([part]) for part in (-3000.0, 30.0, 10.0, 100.0, 0.0, 0.0))
    volume = Volume(1000.0, 137.0, time_variable="none")
    all_of_it = violation_span(volume, state, 0.0, END_S)
    part = violation_span(volume, state, 25.0, 31.0)
    assert part == (25.0, 31.0)
    assert all_of_it.begin_s < 25.0 < 31.0 < all_of_it.end_s
    assert violation_span(volume, state, 50.0, 60.0) == (np.inf, -np.inf)


def test_a_swap_of_the_sizes_changes_the_answer():
    beside = tuple(np.array([part]) for part in (400.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    above = tuple(np.array([part]) for part in (0.0, 0.0, 400.0, 0.0, 0.0, 0.0))
    flat = Volume(600.0, 80.0, time_variable="none")
    assert violates(flat, beside).all() and not violates(flat, above).any()
    assert cylinder_span(600.0, 80.0, beside, 0.0, 5.0) == (0.0, 5.0)
    assert cylinder_span(600.0, 80.0, above, 0.0, 5.0) == (np.inf, -np.inf)


def test_random_flights_are_inside_a_cylinder_when_the_definition_says_so():
    states = random_states(11, 40) * [0.3, 0.3, 0.3, 1, 1, 1]
    found = cylinder_span(700.0, 90.0, tuple(states.T), 0.0, END_S)
    met = 0
    with mpmath.workdps(40):
        for number, state in enumerate(states.tolist()):
            x, y, z, vx, vy, w = (mpmath.mpf(part) for part in state)

            def inside(t, x=x, y=y, z=z, vx=vx, vy=vy, w=w):
                far_sq = (x + t * vx) ** 2 + (y + t * vy) ** 2
                return far_sq < 490_000 and abs(z + t * w) < 90

            wanted = span_by_bisection(inside, (x, y, z, vx, vy, w), END_S)
            got = found.begin_s[number], found.end_s[number]
            if wanted is None:
                assert got == (np.inf, -np.inf)
            else:
                met += 1
                assert abs(got[0] - wanted[0]) < 1e-9 and abs(got[1] - wanted[1]) < 1e-9
    assert 3 < met < 40


def test_the_boundary_of_a_cylinder_is_outside():
    on_it = [
        (700.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 90.0, 50.0, 0.0, 0.0),
        (-5000.0, 700.0, 0.0, 50.0, 0.0, 0.0),
    ]
    touching = cylinder_span(700.0, 90.0, tuple(np.array(on_it).T), 0.0, END_S)
    assert (touching.begin_s == np.inf).all()
    assert not is_inside_cylinder(
        np.array([700.0, 10.0]), np.array([0.0, -90.0]), 700.0, 90.0
    ).any()
    assert is_inside_cylinder(np.array([699.0]), np.array([-89.0]), 700.0, 90.0).all()


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ((0.0, 10.0), "horizontal_m is 0.0"),
        ((10.0, -1.0), "vertical_m is -1.0"),
        ((10.0, 20.0, -1.0), "horizontal_time_s is -1.0"),
        ((10.0, 20.0, 1.0, math.nan), "vertical_time_s is nan"),
        ((10.0, 20.0, 1.0, 1.0, "tau"), "modified_tau, time_to_closest"),
    ],
)
def test_a_volume_refuses_sizes_that_mean_nothing(sizes, said):
    with pytest.raises(ValueError, match=said):
        Volume(*sizes)


def test_the_sizes_of_the_standards_are_those_published():
    sizes = {name: (v.horizontal_m / 0.3048, v.vertical_m / 0.3048) for name, v in PRESETS.items()}
    assert sizes["astm_f3442"] == pytest.approx((2000, 250))
    assert sizes["nmac"] == pytest.approx((500, 100))
    assert sizes["do365_en_route"] == pytest.approx((0.66 * 1852 / 0.3048, 450))
    assert PRESETS["do365_en_route"].horizontal_time_s == 35.0
    assert PRESETS["do365_terminal"].horizontal_time_s == 0.0


@pytest.mark.parametrize("inward_m", [1e-4, 1e-6])
def test_a_slow_pass_just_inside_lasts_as_long_as_its_chord(inward_m):
    """At 1 m/s the discriminant of a circle of 100 m is 200 times the depth in metres."""
    volume = Volume(100.0, 137.0, time_variable="none")
    state = tuple(np.array([x]) for x in (-300.0, 100.0 - inward_m, 0.0, 1.0, 0.0, 0.0))
    half_s = math.sqrt(inward_m * (200.0 - inward_m))
    found = violation_span(volume, state, 0.0, 1000.0)
    assert found.begin_s[0] == pytest.approx(300.0 - half_s, abs=1e-6)
    assert found.end_s[0] == pytest.approx(300.0 + half_s, abs=1e-6)
    outside = (state[0], 200.0 - state[1], *state[2:])
    assert violation_span(volume, outside, 0.0, 1000.0) == (np.inf, -np.inf)
