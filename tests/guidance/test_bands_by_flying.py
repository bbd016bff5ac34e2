"""Each edge of the bands, confirmed by flying both sides of it in small steps of time."""

import math

import numpy as np
import pytest

from components.alert_configuration.conf_file import default_values
from components.guidance.altitudes import Altitudes
from components.guidance.intervals import Band, Interval, clear_intervals, painted, same_place
from components.guidance.kinds import kind_of
from components.guidance.resolution import resolution
from components.guidance.situation import Detector, Required, State
from components.well_clear.violation import violates
from components.well_clear.volume import Volume

VALUES = {**default_values()[0], "max_alt": 2000.0, "max_hs": 150.0}
LOOKAHEAD_S, HORIZON_S, FLOWN_S = 150.0, 100.0, 0.02
SIZES = (900.0, 140.0, 20.0, 5.0)


def state(*parts):
    return State(*(np.float64(part) for part in parts))


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
    return bool(violates(volume, own.less(moved)).any())


@pytest.mark.parametrize("variable", ["modified_tau", "time_to_closest", "none"])
@pytest.mark.parametrize("kind", ["hdir", "hs", "vs"])
def test_both_sides_of_every_edge_are_as_they_are_flown(kind, variable):
    step = VALUES[f"step_{kind}"]
    volume = Volume(*SIZES, variable)
    # A tangent looks one step ahead of the manoeuvre: sizes 2 % off allow for it.
    larger, smaller = (Volume(*(size * k for size in SIZES), variable) for k in (1.02, 0.98))
    edges = 0
    for intruder in (CROSSING, BELOW, NEAR):
        made = kind_of(kind, OWN, VALUES)
        clear = made.clear(intruder, Required(Detector(volume), HORIZON_S, LOOKAHEAD_S))
        zero = int(np.argmin(np.abs(made.values - made.own_value)))
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
        made = Altitudes(own, VALUES)
        assert (made.accelerated_s <= made.held_s + 1e-12).all()
        most = VALUES["vertical_accel"]
        for place in range(0, len(made.values), 7):
            time_s = np.linspace(0.0, made.level_s[place] + 1.0, 4001)
            flights = [made._flight_at(np.full(len(made.values), t)) for t in time_s[::100]]
            up = np.array(
                [
                    f.up_m[place] + f.climb_mps[place] * t
                    for f, t in zip(flights, time_s[::100], strict=True)
                ]
            )
            rate = np.array([f.climb_mps[place] for f in flights])
            step_s = time_s[100]
            assert up[0] == pytest.approx(900.0) and rate[0] == pytest.approx(climb)
            assert up[-1] == pytest.approx(made.values[place]) and rate[-1] == 0.0
            assert (np.abs(np.diff(rate)) <= most * step_s + 1e-9).all()
            mean = 0.5 * (rate[1:] + rate[:-1]) * step_s
            assert np.abs(np.diff(up) - mean).max() <= most * step_s**2 / 4 + 1e-6


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
    assert painted(layers, 0.0, 10.0) == [
        (0.0, 2.0, "NONE"), (2.0, 4.0, "MID"), (4.0, 6.0, "NEAR"), (6.0, 8.0, "MID"),
        (8.0, 10.0, "NONE"),
    ]  # fmt: skip


def test_the_nearer_way_out_is_preferred_and_right_where_they_are_equal():
    bands = [Band(0.0, 1.0, "NONE"), Band(1.0, 2.0, "MID"), Band(2.0, 2 * math.pi, "NONE")]
    assert resolution(bands, 1.5, "MID", True) == (1.0, 2.0, True)
    assert resolution(bands, 1.4, "MID", True) == (1.0, 2.0, False)
    assert resolution(bands, 2.5, "MID", True) is None
    assert resolution(bands, 1.5, "NEAR", True) is None
    across = [Band(0.0, 0.5, "NEAR"), Band(0.5, 6.0, "NONE"), Band(6.0, 2 * math.pi, "MID")]
    left, right, prefers_right = resolution(across, 0.1, "MID", True)
    assert (left, right, prefers_right) == (pytest.approx(6.0), 0.5, False)
    saturated = [Band(100.0, 700.0, "NEAR")]
    assert resolution(saturated, 300.0, "MID", False) == (-math.inf, math.inf, False)


@pytest.mark.parametrize(
    ("one", "other", "same"), [(1.0, 1.0001, True), (1.0, 1.001, False), (0.0, 9e-6, True)]
)
def test_places_are_the_same_within_a_tolerance(one, other, same):
    assert same_place(one, other) is same
