"""Each edge of the bands, confirmed by flying both sides of it in small steps of time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from components.alert_configuration.conf_file import default_values_and_units
from components.guidance.altitudes import Altitudes
from components.guidance.bands import nearest_values_outside_red
from components.guidance.intervals import (
    Band,
    Interval,
    clear_intervals,
    is_same_value,
    paint_bands,
)
from components.guidance.manoeuvre_kinds import manoeuvres_of_kind
from components.guidance.situation import Detector, State
from components.well_clear.relative_motion import nearly_equal
from components.well_clear.volume import Volume, violates

VALUES = {**default_values_and_units()[0], "max_alt": 2000.0, "max_hs": 150.0}
LOOKAHEAD_S, HORIZON_S, FLOWN_S = 150.0, 100.0, 0.02
SIZES = (900.0, 140.0, 20.0, 5.0)


def state(*parts):
    return State(*(np.float64(part) for part in parts))


def one_row(one):
    return State(*(np.array([part]) for part in one))


#: Heading 217 deg and climbing; the intruder crosses from the right and descends.
OWN = state(0, 0, 900.0, 60 * math.sin(3.787), 60 * math.cos(3.787), 1.5)
CROSSING = state(-5200.0, -3300.0, 1010.0, 45.0, -22.0, -1.0)
BELOW = state(-2500.0, -4200.0, 760.0, -5.0, 12.0, 0.5)
NEAR = state(-700.0, -1900.0, 900.0, 20.0, 55.0, 0.0)


def flown(kind, number, step):
    """Positions and velocities of a manoeuvre of some steps, then straight, by small steps."""
    count = abs(number)
    side = math.copysign(1.0, number)
    speed, track = math.hypot(OWN.east_mps, OWN.north_mps), math.atan2(OWN.east_mps, OWN.north_mps)
    rate = {"hdir": VALUES["turn_rate"], "hs": VALUES["horizontal_accel"]}.get(
        kind, VALUES["vertical_accel"]
    )
    ends_s = count * step / rate
    time_s = np.arange(0.0, min(LOOKAHEAD_S, HORIZON_S + ends_s), FLOWN_S)
    done = side * rate * np.minimum(time_s, ends_s)
    turned = track + (done if kind == "hdir" else 0.0)
    fast = speed + (done if kind == "hs" else 0.0)
    climb = OWN.climb_mps + (done if kind == "vs" else 0.0)
    rates = [v + 0.0 * time_s for v in (fast * np.sin(turned), fast * np.cos(turned), climb)]
    places = [
        start + np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * FLOWN_S)])
        for start, v in zip(OWN[:3], rates, strict=True)
    ]
    return time_s, State(*places, *rates)


def violated(kind, number, step, intruder, volume):
    time_s, own = flown(kind, number, step)
    moved = State(
        *(intruder[i] + intruder[3 + i] * time_s for i in range(3)),
        *(intruder[3 + i] + 0.0 * time_s for i in range(3)),
    )
    return bool(violates(volume, own.relative_to(moved)).any())


@pytest.mark.parametrize("variable", ["modified_tau", "time_to_closest", "none"])
@pytest.mark.parametrize("kind", ["hdir", "hs", "vs"])
def test_both_sides_of_every_edge_are_as_they_are_flown(kind, variable):
    step = VALUES[f"step_{kind}"]
    volume = Volume(*SIZES, variable)
    # A tangent looks one step ahead of the manoeuvre: sizes 2 % off allow for it.
    larger, smaller = (Volume(*(size * k for size in SIZES), variable) for k in (1.02, 0.98))
    edges = 0
    for intruder in (CROSSING, BELOW, NEAR):
        values = {**VALUES, "lookahead_time": LOOKAHEAD_S}
        made = manoeuvres_of_kind(kind, one_row(OWN), values)
        conflicts = made.find_conflicts(one_row(intruder).columns(), Detector(volume))
        clear = ~conflicts.is_in_or_behind_conflict(0.0, HORIZON_S)[0]
        zero = int(np.argmin(np.abs(made.values[0] - made.own_value)))
        for place in np.flatnonzero(clear[1:] != clear[:-1]):
            for at in (place, place + 1):
                if clear[at]:
                    assert not violated(kind, at - zero, step, intruder, smaller)
                else:
                    assert violated(kind, at - zero, step, intruder, larger)
            edges += 1
    assert edges >= 1


def test_flights_to_altitudes_are_smooth_and_end_there():
    for climb in (-9.0, -1.0, 0.0, 2.0, 9.0):
        own = State(*OWN[:5], np.float64(climb))
        made = Altitudes(one_row(own), {**VALUES, "lookahead_time": 1e6})
        targets = made.select_examined(made.values)[0]
        assert targets == pytest.approx(made.values[0])  # within so long a time, all differ
        t1, t2, t3 = (part[0] for part in (made.accelerated_s, made.held_s, made.level_s))
        assert (t1 <= t2 + 1e-12).all()
        most = VALUES["vertical_accel"]
        for place in range(0, len(targets), 7):
            time_s = np.linspace(0.0, t3[place] + 1.0, 4001)
            flights = [
                made.straight_flight_from(np.full((1, len(targets)), t)) for t in time_s[::100]
            ]
            up = np.array(
                [
                    f.up_m[0, place] + f.climb_mps[0, place] * t
                    for f, t in zip(flights, time_s[::100], strict=True)
                ]
            )
            rate = np.array([f.climb_mps[0, place] for f in flights])
            step_s = time_s[100]
            assert up[0] == pytest.approx(900.0) and rate[0] == pytest.approx(climb)
            assert up[-1] == pytest.approx(targets[place]) and rate[-1] == 0.0
            assert (np.abs(np.diff(rate)) <= most * step_s + 1e-9).all()
            mean = 0.5 * (rate[1:] + rate[:-1]) * step_s
            assert np.abs(np.diff(up) - mean).max() <= most * step_s**2 / 4 + 1e-6


@pytest.mark.parametrize("climb", [-9.0, -2.0, 0.0, 4.0])
@pytest.mark.parametrize("up", [40.0, 900.0, 1990.0, 2500.0])
def test_altitudes_that_others_stand_for_are_flown_like_them(climb, up):
    own = State(*(np.array([part]) for part in (0.0, 0.0, up, 30.0, -40.0, climb)))
    made = Altitudes(own, {**VALUES, "lookahead_time": 60.0})
    every = Altitudes(own, {**VALUES, "lookahead_time": 1e6})
    assert made.spread_to_all(
        np.ones((1, made.select_examined(made.values).shape[1]), dtype=bool)
    ).all()
    assert made.select_examined(made.values).shape[1] < every.select_examined(every.values).shape[1]
    for time_s in (0.0, 0.7, 5.0, 31.0, 60.0):
        few = made.straight_flight_from(np.full((1, 1), time_s))
        all_of_them = every.straight_flight_from(np.full((1, 1), time_s))
        for name in ("up_m", "climb_mps"):
            assert made.spread_to_all(getattr(few, name)) == pytest.approx(
                getattr(all_of_them, name)
            )


def test_a_clear_value_alone_makes_no_band():
    values = np.arange(10.0)
    clear = np.array([1, 1, 0, 1, 0, 0, 1, 1, 1, 0], dtype=bool)
    assert clear_intervals(values, clear, 0.0, 7.5, False) == [(0.0, 1.0), (6.0, 7.5)]


def test_directions_wrap_at_north():
    turn = 2 * math.pi
    values = 6.0 + np.arange(5) * 0.2
    found = clear_intervals(values, np.ones(5, dtype=bool), 0.0, turn, True)
    assert [(pytest.approx(a), pytest.approx(b)) for a, b in found] == [
        (6.0, turn), (0.0, 6.8 - turn)
    ]  # fmt: skip
    whole = 1.0 + np.linspace(-math.pi, math.pi, 361)
    assert clear_intervals(whole, np.ones(361, dtype=bool), 0.0, turn, True) == [(0.0, turn)]


def test_worse_regions_are_painted_over_milder_ones():
    mild = [Interval(0.0, 2.0), Interval(8.0, 10.0)]
    worse = [Interval(0.0, 4.0), Interval(6.0, 10.0)]
    layers = [("MID", mild, True), ("NEAR", worse, True)]
    assert paint_bands(layers, 0.0, 10.0) == [
        (0.0, 2.0, "NONE"), (2.0, 4.0, "MID"), (4.0, 6.0, "NEAR"), (6.0, 8.0, "MID"),
        (8.0, 10.0, "NONE"),
    ]  # fmt: skip


def test_the_nearer_way_out_is_preferred_and_right_where_they_are_equal():
    bands = [Band(0.0, 1.0, "NONE"), Band(1.0, 2.0, "MID"), Band(2.0, 2 * math.pi, "NONE")]
    assert nearest_values_outside_red(bands, 1.5, "MID", True) == (1.0, 2.0, True)
    assert nearest_values_outside_red(bands, 1.4, "MID", True) == (1.0, 2.0, False)
    assert nearest_values_outside_red(bands, 2.5, "MID", True) is None
    assert nearest_values_outside_red(bands, 1.5, "NEAR", True) is None
    across = [Band(0.0, 0.5, "NEAR"), Band(0.5, 6.0, "NONE"), Band(6.0, 2 * math.pi, "MID")]
    left, right, prefers_right = nearest_values_outside_red(across, 0.1, "MID", True)
    assert (left, right, prefers_right) == (pytest.approx(6.0), 0.5, False)
    saturated = [Band(100.0, 700.0, "NEAR")]
    assert nearest_values_outside_red(saturated, 300.0, "MID", False) == (
        -math.inf,
        math.inf,
        False,
    )


@pytest.mark.parametrize(
    ("one", "other", "same"), [(1.0, 1.0001, True), (1.0, 1.001, False), (0.0, 9e-6, True)]
)
def test_places_are_the_same_within_a_tolerance(one, other, same):
    assert is_same_value(one, other) is same


@given(
    one=st.floats(-1e4, 1e4) | st.just(0.0),
    part=st.floats(-4e-4, 4e-4),
    away=st.sampled_from([0.0, 1e-6, -1e-6, 2e-5]),
)
def test_places_of_two_numbers_are_those_of_arrays(one, part, away):
    other = one * (1.0 + part) + away
    assert is_same_value(one, other) is bool(nearly_equal(one, other, 2**40, 1e-5))
