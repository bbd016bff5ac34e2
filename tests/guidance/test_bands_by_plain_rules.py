"""Bands and recovery of random states against the published rules, one manoeuvre at a time."""

import math
from itertools import pairwise

import numpy as np
import pytest

from components.alert_configuration.conf_file import default_values_and_units
from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.guidance.bands import guidance_of_many
from components.guidance.manoeuvre_kinds import KINDS
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from components.well_clear.volume import Volume
from tests.guidance.plain_guidance import Plain

COUNT = 24
DEG = math.pi / 180.0
VALUES = {
    **default_values_and_units()[0],
    "lookahead_time": 90.0, "step_hdir": 7.0 * DEG, "step_hs": 8.0, "step_vs": 2.0,
    "step_alt": 130.0, "turn_rate": 2.6 * DEG, "horizontal_accel": 1.7, "vertical_accel": 1.1,
    "vertical_rate": 3.1,
    "min_hs": 20.0, "max_hs": 110.0, "min_vs": -14.0, "max_vs": 12.0, "min_alt": 130.0,
    "max_alt": 1900.0, "min_horizontal_recovery": 820.0, "min_vertical_recovery": 95.0,
    "horizontal_nmac": 170.0, "vertical_nmac": 33.0, "ca_bands": True, "ca_factor": 0.3,
    "recovery_stability_time": 2.5, "corrective_region": "MID",
}  # fmt: skip
#: Region, volume, alerting time, early alerting time; every size is another.
LEVELS = [
    ("FAR", ("time_to_entry", 900.0, 210.0, 28.0, 9.0), 50.0, 66.0),
    ("MID", ("modified_tau", 850.0, 130.0, 21.0, 0.0), 44.0, 59.0),
    ("NEAR", ("time_to_closest", 640.0, 105.0, 13.0, 4.0), 25.0, 37.0),
]


def alerter_of(levels):
    made = (Level(Volume(*v[1:], v[0]), region, t, early) for region, v, t, early in levels)
    return Alerter("plain", tuple(made))


def drawn(random, within_s=70.0):
    """Return an ownship at 217 deg or so, and two intruders, of which many are near."""
    track, speed = random.normal(217.0, 8.0) * DEG, random.choice([20.0, 34.0, 61.0, 109.7])
    climb, up = random.choice([0.0, 2.4, -9.0, 12.0]), random.choice([131.0, 700.0, 1212.0, 1899.0])
    own = [0.0, 0.0, up, speed * math.sin(track), speed * math.cos(track), climb]
    others = []
    for near in (1.0, 3.0):
        way, fast = random.uniform(0, 2 * math.pi), random.uniform(5.0, 80.0)
        rates = np.array([fast * math.sin(way), fast * math.cos(way), random.normal(0, 2.0)])
        miss = random.normal(0.0, 1.0, 3) * np.array([500.0, 500.0, 90.0]) * near
        rel = miss + random.uniform(0.0, within_s) * (np.array(own[3:]) - rates)
        others.append([*(np.array(own[:3]) + rel), *rates])
    return own, others, random.integers(0, 4, 2).tolist()


def compare(kind, values, draws, levels=LEVELS):
    """Compare our bands with the plain ones between all places they could end."""
    alerter = alerter_of(levels)
    configuration = Configuration((alerter,), values, {})
    own = State(*np.array([one[0] for one in draws]).T)
    intruders = [
        GuidedIntruders(
            State(*np.array([one[1][n] for one in draws]).T),
            alerter,
            np.array([one[2][n] for one in draws]),
        )
        for n in (0, 1)
    ]
    seen = []
    found = guidance_of_many(kind, configuration, own, intruders)
    for guided, (state, others, early) in zip(found, draws, strict=True):
        plain = Plain(kind, values, state)
        layers, recovery = plain.layers(levels, others, early)
        if recovery is None:
            assert guided.recovery is None
        else:
            assert (guided.recovery.time_s, guided.recovery.shrinks) == recovery
        turn = 2 * math.pi if kind == "hdir" else math.inf
        places = sorted({plain.least, plain.most, *(value % turn for value in plain.at)})
        for low, high in pairwise(places):
            middle = 0.5 * (low + high)
            if high - low < 1e-3 * high or not plain.least < middle < plain.most:
                continue
            want = plain.region_of(middle, layers)
            if want == "NONE" and recovery is not None and recovery[0] >= 0:
                want = "RECOVERY"
            assert [b.region for b in guided.bands if b.low <= middle <= b.high] == [want]
        seen.append((len({b.region for b in guided.bands}), recovery))
    return seen


@pytest.mark.parametrize("kind", KINDS)
def test_bands_and_recovery_are_those_of_the_plain_rules(kind):
    random = np.random.default_rng(217)
    seen = compare(kind, VALUES, [drawn(random) for _ in range(COUNT)])
    ways = [recovery for _, recovery in seen if recovery is not None]
    assert any(time_s > 0 and shrinks > 0 for time_s, shrinks in ways)
    assert any(math.isinf(time_s) and shrinks == 0 for time_s, shrinks in ways)
    assert sum(regions > 2 for regions, _ in seen) > 3


def test_two_cylinders_made_smaller_beside_each_other_lead_out_as_by_the_plain_rules():
    """A few of the states above, which are too many for the fast tests."""
    random = np.random.default_rng(6)
    seen = compare("vs", VALUES, [drawn(random) for _ in range(5)])
    assert [recovery and recovery[1] for _, recovery in seen] == [1, 2, None, None, None]


@pytest.mark.parametrize("kind", KINDS)
def test_without_smaller_cylinders_the_search_ends_after_the_first(kind):
    random = np.random.default_rng(31)
    values = {**VALUES, "ca_bands": False, "min_horizontal_recovery": 1500.0}
    seen = compare(kind, values, [drawn(random) for _ in range(12)])
    assert {recovery[1] for _, recovery in seen if recovery is not None} == {0}


@pytest.mark.parametrize("kind", KINDS)
def test_the_search_ends_at_the_size_of_a_collision_and_before_the_last_second(kind):
    """With a cylinder that is soon that small, and level-offs that end with the lookahead."""
    random = np.random.default_rng(7)
    values = {
        **VALUES, "lookahead_time": 14.0, "step_alt": 21.0, "max_alt": 1300.0,
        "min_horizontal_recovery": 460.0, "min_vertical_recovery": 60.0,
    }  # fmt: skip
    seen = compare(kind, values, [drawn(random, within_s=12.0) for _ in range(40)])
    ways = {recovery for _, recovery in seen if recovery is not None}
    assert any(shrinks > 0 and time_s > 0 for time_s, shrinks in ways)
    assert (-math.inf, 3) in ways


@pytest.mark.parametrize("kind", KINDS)
def test_horizons_may_count_from_now(kind):
    """Manoeuvres that end after them are judged, in recovery, by the cylinder all the time."""
    random, ahead_s = np.random.default_rng(101), 21.0 if kind == "alt" else 39.0
    values = {
        **VALUES, "lookahead_time": ahead_s, "max_alt": 1300.0, "horizontal_accel": 1.9,
        "vertical_accel": 0.43, "min_horizontal_recovery": 460.0,
    }  # fmt: skip
    draws = [drawn(random, within_s=ahead_s - 2.0) for _ in range(16)]
    for from_now in (True, False):
        seen = compare(kind, {**values, "bands_add_time_to_maneuver": from_now}, draws)
        assert any(recovery and recovery[0] > 0 for _, recovery in seen)


def beside(random):
    """Return an ownship, one that comes straight at it, and one that flies beside it."""
    own, others, _ = drawn(random, within_s=25.0)
    track = math.atan2(own[3], own[4]) + random.choice([-1.0, 1.0]) * math.pi / 2
    way_m = random.uniform(900.0, 2200.0)
    aside = np.array([way_m * math.sin(track), way_m * math.cos(track), random.normal(0.0, 130.0)])
    drift = random.normal(0.0, 6.0, 3) * np.array([1.0, 1.0, 0.3])
    others[1] = [*(np.array(own[:3]) + aside), *(np.array(own[3:]) + drift)]
    return own, others, [0, 0]


@pytest.mark.parametrize("from_now", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_who_is_met_only_by_manoeuvres_counts_in_recovery_up_to_its_alerting_time(kind, from_now):
    """It was counted up to the lookahead: our way out was down where the reference has it up."""
    random = np.random.default_rng(22)
    values = {**VALUES, "bands_add_time_to_maneuver": from_now, "min_vertical_recovery": 60.0}
    levels = [(region, v, 0.4 * t, 0.5 * early) for region, v, t, early in LEVELS]
    seen = compare(kind, values, [beside(random) for _ in range(24)], levels)
    ways = [recovery for _, recovery in seen if recovery is not None]
    assert any(0 < time_s < 17.6 for time_s, _ in ways)
    assert any(time_s > 17.6 for time_s, _ in ways)
