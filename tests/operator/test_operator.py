"""The operator in a closed loop: when it acts, by how much, and what its keys change."""

import math
from itertools import pairwise

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone
from scipy import stats
from test_avoidance_by_bands import scene as by_bands
from wired import rows, run

from components.operator.pilot_model import (
    CLIMB,
    TURN,
    Draws,
    commanded_change_out_of_band,
    reaction_and_execution_delays_s,
)
from dsa_des import load_scene
from dsa_des.errors import SceneError

KIND = ("operator.stochastic",)
FIXED = {"deterministic": True, "turn_share": 1.0, "level": 1}


def scene(tmp_path, seed=1, **keys):
    found = by_bands(tmp_path)
    found["seed"] = seed
    conf = found["blocks"]["avoidance"]["conf"]
    found["blocks"]["avoidance"] = {"type": "operator.stochastic", "conf": conf, **FIXED, **keys}
    return found


def first(tmp_path, **keys):
    """When the alert began and the first manoeuvre was told, and that manoeuvre."""
    found = run(scene(tmp_path, **keys))
    level = keys.get("level", 1)
    began = next(row["time_s"] for row in rows(found, "alerts") if row["level"] >= level)
    return began, rows(found, "manoeuvres")[0]


@covers("held_s", "initial_delay_s", "coordination_s", "execution_delay_s", of=KIND)
@pytest.mark.parametrize(
    ("keys", "delay_s"),
    [
        ({}, 23),
        ({"held_s": 6.0}, 25),
        ({"initial_delay_s": 7.5}, 26),  # at the next alert
        ({"coordination_s": 2.0}, 14),
        ({"execution_delay_s": 0.0}, 20),
    ],
)
def test_a_deterministic_pilot_takes_the_sum_of_the_means(tmp_path, keys, delay_s):
    began, told = first(tmp_path, **keys)
    assert told["time_s"] - began == delay_s


@covers("level", "warning_level", of=KIND)
def test_a_warning_is_not_coordinated(tmp_path):
    quick = {"held_s": 1.0, "initial_delay_s": 1.0, "coordination_s": 5.0, "execution_delay_s": 1.0}
    corrective, _ = first(tmp_path, **quick)
    began, told = first(tmp_path, level=2, **quick)
    assert began > corrective + 15.0
    assert told["time_s"] - began == 8.0
    began, told = first(tmp_path, level=2, warning_level=2, **quick)
    assert told["time_s"] - began == 3.0


@covers("conf", "alerter", of=KIND)
def test_it_flies_out_of_the_bands_of_its_alerter(tmp_path):
    small, large = (first(tmp_path, alerter=k, coordination_s=0.0)[1] for k in (1, 2))
    # 30 deg beyond the edge, to the left, where the way out is shorter.
    assert large["turn_rad"] < small["turn_rad"] - 0.1 < -math.radians(30.0)


@covers("turn_share", "turn_rate_deg_s", "vertical_rate_mps", of=KIND)
def test_it_turns_or_climbs_at_its_rates(tmp_path):
    _, turn = first(tmp_path, turn_rate_deg_s=4.5)
    assert math.degrees(turn["rate_rad_s"]) == pytest.approx(4.5)
    assert turn["climb_m"] == turn["climb_rate_mps"] == 0.0
    _, climb = first(tmp_path, turn_share=0.0, vertical_rate_mps=3.25)
    assert climb["climb_rate_mps"] == 3.25 and climb["turn_rad"] == 0.0
    assert climb["climb_m"] < -152.4  # 500 ft beyond the edge


@covers("deterministic", of=KIND)
def test_drawn_pilots_differ_and_each_is_the_same_beside_the_others(tmp_path):
    drawn = [first(tmp_path, seed=seed, deterministic=False, coordination_s=0.0) for seed in (1, 2)]
    assert drawn[0] != drawn[1]
    assert all(told["time_s"] - began >= 4.0 for began, told in drawn)
    every = scene(tmp_path, deterministic=False, turn_share=0.5, coordination_s=0.0)
    same_as_alone(replicas_of(load_scene({**every, "duration_s": 32}), {}, {}))


def test_what_is_drawn_is_by_the_decision_not_by_how_often_an_alert_was_seen(tmp_path):
    """The first decision of a pilot who waits longer to see it is drawn alike, so much later."""
    keys = {"deterministic": False, "coordination_s": 0.0}
    told = [first(tmp_path, held_s=held_s, **keys)[1]["time_s"] for held_s in (0.0, 1.0, 3.0)]
    assert [time_s - told[0] for time_s in told] == [0.0, 1.0, 3.0]


def test_an_alert_that_ends_is_not_acted_on(tmp_path):
    found = scene(tmp_path, initial_delay_s=200.0)
    assert rows(run(found), "manoeuvres") == []


def test_as_long_as_an_alert_lasts_the_next_decisions_follow_after_the_mean_pause(tmp_path):
    """At level 1 after 9 + 6 s, at 2 after 6 + 3 s; then it takes 3 s more to execute it.

    A second aircraft's alert, long after the first one's, is answered as the first one's was.
    """
    loop = scene(tmp_path, turn_share=0.0, vertical_rate_mps=0.05)
    first_one = loop["blocks"]["traffic"]["intruders"][0]
    late = {**first_one, "name": "late", "up_m": -120.0, "east_m": 2.6 * first_one["east_m"],
            "north_m": 2.6 * first_one["north_m"]}  # fmt: skip
    loop["blocks"]["traffic"]["intruders"] = [first_one, late]
    loop["duration_s"] = 250
    found = run(loop)
    told = [row["time_s"] for row in rows(found, "manoeuvres")]
    level = {row["time_s"]: 0 for row in rows(found, "alerts")}
    for row in rows(found, "alerts"):
        level[row["time_s"]] = max(level[row["time_s"]], row["level"])
    times = sorted(level)
    begins = [b for a, b in pairwise(times) if level[a] == 0 < level[b]]
    assert len(begins) == 2 and begins[1] - begins[0] > 100.0
    answers = [[t - begin for t in told if begin <= t <= begin + 60.0] for begin in begins]
    assert answers[0][:3] == [23.0, 41.0, 53.0] and answers[1][0] == 23.0
    # Who chooses before executing pauses from 20 s on: 9 s have passed at 30 s, and 6 + 3 s more.
    loop["blocks"]["avoidance"]["chooses"], loop["duration_s"] = "before_executing", 120
    early = [row["time_s"] - begins[0] for row in rows(run(loop), "manoeuvres")]
    assert early[:2] == [23.0, 39.0]


def uniforms(count):
    """Evenly spread over (0, 1), in an order without pattern."""
    return np.random.default_rng(3).permutation((np.arange(count) + 0.5) / count)


def test_response_times_are_distributed_as_published():
    draws = np.stack([uniforms(4000), np.roll(uniforms(4000), 7), np.roll(uniforms(4000), 99)], 1)
    waits = [sum(reaction_and_execution_delays_s(row, 5.0, 0.0, 0.0)) for row in draws]
    assert stats.kstest(waits, stats.expon(scale=5.0).cdf).pvalue > 0.01
    waits = [sum(reaction_and_execution_delays_s(row, 0.0, 11.0, 0.0)) for row in draws]
    assert stats.kstest(waits, stats.gamma(5.5, scale=2.0).cdf).pvalue > 0.01
    both = [sum(reaction_and_execution_delays_s(row, 5.0, 11.0, 3.0)) for row in draws]
    assert np.mean(both) == pytest.approx(19.0, abs=0.3)


@pytest.mark.parametrize(
    ("changes", "turns", "shape", "scale", "less", "unit"),
    [
        ((-0.5, 2.0), True, 6.21, 9.67, 30.0, math.pi / 180),  # clearly the smaller
        ((-400.0, 250.0), False, 9.73, 207.98, 1500.0, 0.3048),
    ],
)
def test_sizes_are_distributed_as_published(changes, turns, shape, scale, less, unit):
    size = [commanded_change_out_of_band(changes, turns, Draws(0.0, 0.0, u)) for u in uniforms(500)]
    side = -1.0 if -changes[0] < changes[1] else 1.0
    nearest = min(-changes[0], changes[1])
    drawn = np.maximum(
        nearest + (stats.gamma(shape, scale=scale).ppf(uniforms(500)) - less) * unit, 0
    )
    assert size == pytest.approx(side * (np.minimum(drawn, math.pi) if turns else drawn))


def test_the_side_is_the_smaller_one_four_times_of_five():
    near = (-0.30, 0.40)
    left = [
        commanded_change_out_of_band(near, True, Draws(u, 0.99, 0.5)) < 0.0 for u in uniforms(1000)
    ]
    assert np.mean(left) == pytest.approx(0.8, abs=0.002)
    left = [
        commanded_change_out_of_band(near, True, Draws(0.9, u, 0.5)) < 0.0 for u in uniforms(1000)
    ]
    assert np.mean(left) == pytest.approx(0.6, abs=0.002)
    down = [
        commanded_change_out_of_band((-60.0, 50.0), False, Draws(0.9, u, 0.5)) < 0.0
        for u in uniforms(1000)
    ]
    assert np.mean(down) == pytest.approx(0.5, abs=0.002)
    assert commanded_change_out_of_band(near, True, None) == pytest.approx(-0.30 - TURN.fixed)
    assert commanded_change_out_of_band((-0.3, 0.3), True, None) == pytest.approx(0.3 + TURN.fixed)
    assert commanded_change_out_of_band((-3.0, 3.1), True, None) == -math.pi
    assert commanded_change_out_of_band((-math.inf, 0.2), True, Draws(0.9, 0.0, 0.5)) > 0.0
    assert commanded_change_out_of_band((-math.inf, math.inf), True, None) == 0.0
    assert commanded_change_out_of_band((-10.0, 20.0), False, None) == pytest.approx(
        -10.0 - CLIMB.fixed
    )


def test_a_turn_that_no_flight_can_have_is_refused_before_the_run(tmp_path):
    with pytest.raises(SceneError, match=r"turn_rate_deg_s.*greater than or equal to 0.1"):
        load_scene(scene(tmp_path, turn_rate_deg_s=0.001))
    with pytest.raises(SceneError, match=r"turn_rate of its configuration is 0.001 deg/s"):
        run(by_bands(tmp_path, rate_deg_s=0.001))
