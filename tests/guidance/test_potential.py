"""The modified voltage potential, against its formulas in plain numbers, pair by pair."""

import math

import numpy as np
import pytest

from components.guidance.mvp import _others_own_velocities_and_mask
from components.guidance.potential import (
    KeptApart,
    Others,
    conflict_mask,
    may_resume,
    velocity_after_push,
)
from components.messages.alerts import AlertLevels

KEPT = KeptApart(50.0, 1.05, 120.0)


def plain_conflict(rx, ry, ux, uy):
    u2 = ux * ux + uy * uy
    if u2 < 1e-9:
        return False
    t = -(rx * ux + ry * uy) / u2
    d = math.hypot(rx + ux * t, ry + uy * t)
    if d >= 50.0:
        return False
    tau = math.sqrt(50.0 * 50.0 - d * d) / math.sqrt(u2)
    return t - tau < 120.0 and t + tau > 0.0


def plain_resume(rx, ry, ux, uy, vx, vy):
    if rx * ux + ry * uy <= 0.0 or math.hypot(rx, ry) < 50.0:
        return False
    one, other = math.atan2(vx, vy), math.atan2(vx + ux, vy + uy)
    beside = abs(math.remainder(other - one, 2 * math.pi)) < math.radians(30)
    return not (beside and math.hypot(rx, ry) < 52.5)


def plain_push(rx, ry, ux, uy):
    big = 1.05 * 50.0
    t = -(rx * ux + ry * uy) / (ux * ux + uy * uy)
    cx, cy = rx + ux * t, ry + uy * t
    m, far = math.hypot(cx, cy), math.hypot(rx, ry)
    if m <= 0.1:
        cx, cy, m = 0.1 * ry / far, -0.1 * rx / far, 0.1
    if big < far and m < far:
        gain = big / math.cos(math.asin(big / far) - math.asin(m / far)) - m
    else:
        gain = big - m
    k = gain / (max(abs(t), 1e-6) * m)
    return k * cx, k * cy


def drawn(seed, n=400, others=3):
    rng = np.random.default_rng(seed)
    near = rng.uniform(-200.0, 200.0, (2, n, others))
    far = rng.uniform(-1500.0, 1500.0, (2, n, others))
    position = np.where(rng.random((n, others)) < 0.5, near, far)
    own = rng.uniform(-12.0, 12.0, (2, n))
    aim = -position / rng.uniform(5.0, 200.0, (n, others)) + rng.normal(0.0, 1.0, (2, n, others))
    return Others(position, aim * rng.choice([-0.3, 1.0], (n, others), p=[0.2, 0.8])), own


def test_all_three_follow_the_formulas_pair_by_pair():
    others, own = drawn(1)
    now, done = conflict_mask(others, KEPT), may_resume(others, own, KEPT)
    out = velocity_after_push(others, own, now, KEPT)
    assert 0.2 < now.mean() < 0.8 and 0.02 < done.mean() < 0.8
    for k in range(own.shape[1]):
        x, y = own[:, k].tolist()
        for j in range(3):
            pair = [*others.position_m[:, k, j].tolist(), *others.velocity_mps[:, k, j].tolist()]
            assert now[k, j] == plain_conflict(*pair)
            assert done[k, j] == plain_resume(*pair, *own[:, k].tolist())
            if now[k, j]:
                push = plain_push(*pair)
                x, y = x - push[0], y - push[1]
        np.testing.assert_allclose(out[:, k], [x, y], rtol=1e-9, atol=1e-9)


def one(rx, ry, ux, uy):
    return Others(np.array([[[rx]], [[ry]]], dtype=float), np.array([[[ux]], [[uy]]], dtype=float))


def test_two_head_on_turn_to_the_same_side_and_miss_by_the_larger_radius():
    mine, theirs = np.array([[0.0], [10.0]]), np.array([[0.0], [-10.0]])
    push = np.array([[True]])
    a = velocity_after_push(one(0, 1450, 0, -20), mine, push, KEPT)[:, 0]
    b = velocity_after_push(one(0, -1450, 0, 20), theirs, push, KEPT)[:, 0]
    np.testing.assert_allclose(a, -b)  # each the other's image through the middle
    assert a[0] < 0.0  # to the left of the line, for both
    # By one alone the line touches the circle of 52.5 m, less what a tenth of a metre is off.
    u = np.array([0.0, -10.0]) - a
    assert abs(1450.0 * u[0]) / math.hypot(*u) == pytest.approx(52.5, abs=0.2)


@pytest.mark.parametrize("offset_m", [-40.0, -5.0, 5.0, 40.0])
def test_who_passes_on_one_side_is_given_more_room_there(offset_m):
    out = velocity_after_push(
        one(offset_m, 1000, 0, -20), np.array([[0.0], [10.0]]), np.array([[True]]), KEPT
    )
    assert np.sign(out[0, 0]) == -np.sign(offset_m)
    u = np.array([0.0, -10.0]) - out[:, 0]
    miss_m = abs(offset_m * u[1] - 1000.0 * u[0]) / math.hypot(*u)
    assert miss_m == pytest.approx(52.5, abs=1e-6)


def test_inside_already_the_push_is_what_is_missing_of_the_radius():
    """At 30 m, passing 12 m beside in 1 s: (52.5 - 12) / 1 against it."""
    side, along = 12.0, math.sqrt(30.0**2 - 12.0**2)
    inside = one(side, along, 0, -along)
    assert conflict_mask(inside, KEPT).all()
    out = velocity_after_push(inside, np.array([[3.0], [4.0]]), np.array([[True]]), KEPT)
    np.testing.assert_allclose(out[:, 0], [3.0 - 40.5, 4.0])


def test_far_ahead_and_past_are_no_conflicts_and_a_parallel_one_is_kept_longer():
    assert conflict_mask(one(0, 2400, 0, -20), KEPT).all()  # its edge is met after 117.5 s
    assert not conflict_mask(one(0, 2500, 0, -20), KEPT).any()
    assert not conflict_mask(one(0, 80, 0, 20), KEPT).any()
    ahead = np.array([[0.0], [10.0]])
    assert may_resume(one(0, 51, 0, 5), ahead, KEPT).tolist() == [[False]]
    assert may_resume(one(0, 53, 0, 5), ahead, KEPT).tolist() == [[True]]
    assert may_resume(one(0, 51, 0, -21), ahead, KEPT).tolist() == [[False]]
    assert may_resume(one(0, -51, 0, -21), ahead, KEPT).tolist() == [[True]]


@pytest.mark.parametrize("tracks", [None, [5, 9]])
def test_what_alerts_say_stands_by_contact(tracks):
    """Two that are heard in turns, targets or tracks that are near none: a row each instant."""

    class Alerts(list):
        row_of_entries, target = np.array([0, 1]), np.array([0, 1] if tracks is None else [-1, -1])
        numbers = {} if tracks is None else {"track": np.array(tracks)}
        contact_numbers = AlertLevels.contact_numbers
        relative = {
            "east_m": np.array([1.0, 3.0]), "north_m": np.array([4.0, 6.0]),
            "east_mps": np.array([7.0, 9.0]), "north_mps": np.array([-1.0, -3.0]),
        }  # fmt: skip
        own_motion = {"east_mps": np.array([10.0, 20.0]), "north_mps": np.array([30.0, 40.0])}

    alerts, nan = Alerts([None, None]), math.nan
    others, own, heard = _others_own_velocities_and_mask(alerts, alerts.contact_numbers())
    assert heard.tolist() == [[True, False], [False, True]]
    np.testing.assert_array_equal(
        others.position_m, [[[-1.0, nan], [nan, -3.0]], [[-4.0, nan], [nan, -6.0]]]
    )
    np.testing.assert_array_equal(
        others.velocity_mps, [[[-7.0, nan], [nan, -9.0]], [[1.0, nan], [nan, 3.0]]]
    )
    assert own.tolist() == [[10.0, 20.0], [30.0, 40.0]]
