"""A late measurement in one step, against the same measurements in their order."""

import numpy as np
import pytest

from components.estimation.carried_errors import MotionWithErrors
from components.estimation.kalman import innovation, update
from components.estimation.motion import ConstantAcceleration, ConstantVelocity, predict
from components.estimation.out_of_sequence import retrodict_before_start, retrodict_between

RNG = np.random.default_rng(3)
H = RNG.normal(size=(2, 6))[:, :, np.newaxis]
R = np.array([[4.0], [9.0]])


def corrected(state, covariance, measured):
    known = np.einsum("mdn,dn->mn", H, state[:6])
    return update(state, covariance, innovation(known, H, covariance, R), measured - known)


def in_order(model, start, measurements):
    """Every state after a measurement, (time, state, covariance), the start first."""
    known = [(0.0, *start)]
    for time_s, measured in measurements:
        last_s, state, covariance = known[-1]
        predicted = predict(model, state, covariance, np.array([time_s - last_s]))
        known.append((time_s, *corrected(*predicted, measured)))
    return known


def both(model, late, times=(1.0, 1.7, 2.2, 3.0)):
    """The last state, in order, and with measurement number `late` after the last one."""
    size = model.size
    root = RNG.normal(size=(size, size))
    start = RNG.normal(size=(size, 1)) * 30.0, (root @ root.T * 50.0)[:, :, np.newaxis]
    given = [(time_s, RNG.normal(size=(2, 1)) * 5.0) for time_s in times]
    wanted = in_order(model, start, given)[-1]
    known = in_order(model, start, [one for k, one in enumerate(given) if k != late])
    then_s, measured = given[late]
    before, now = known[late], known[-1]
    then = retrodict_between(
        model, before[1:], now[1:], np.array([then_s - before[0]]), np.array([now[0] - then_s])
    )
    found = then.carry_forward(*now[1:], *corrected(then.state, then.covariance, measured))
    return found, wanted[1:], now[1]


def apart(found, wanted):
    deviation = np.sqrt(np.einsum("iin->in", wanted[1]))
    return max(
        float(np.abs((found[0] - wanted[0]) / deviation).max()),
        float(np.abs((found[1] - wanted[1]) / deviation / deviation[:, np.newaxis]).max()),
    )


@pytest.mark.parametrize("model", [ConstantVelocity(3.0), ConstantAcceleration(0.7)])
def test_one_that_only_one_came_before_is_as_good_as_in_time(model):
    found, wanted, _ = both(model, late=2)
    assert apart(found, wanted) < 1e-9


@pytest.mark.parametrize("late", [0, 1, 2])
def test_without_noise_it_is_as_good_as_in_time_however_late(late):
    found, wanted, _ = both(ConstantVelocity(1e-12), late)
    assert apart(found, wanted) < 1e-8


@pytest.mark.parametrize("model", [ConstantVelocity(3.0), ConstantAcceleration(0.7)])
def test_before_all_that_was_known_it_is_what_both_instants_say_together(model):
    """By the information of both states at once; nothing else was known of the earlier one."""
    size, since = model.size, np.array([1.3])
    root, state = RNG.normal(size=(size, size)), RNG.normal(size=(size, 1)) * 30.0
    now = state, (root @ root.T * 50.0 + np.eye(size))[:, :, np.newaxis]
    measured = RNG.normal(size=(2, 1)) * 5.0
    then = retrodict_before_start(model, now, since)
    found = then.carry_forward(*now, *corrected(then.state, then.covariance, measured))

    whole, slope = np.zeros((2 * size, 2 * size)), np.zeros((2, 2 * size))
    moves = np.hstack([model.jacobian(state, since)[..., 0], -np.eye(size)])
    whole += moves.T @ np.linalg.solve(model.noise(since)[..., 0], moves)
    whole[size:, size:] += np.linalg.inv(now[1][..., 0])
    slope[:, :6] = H[..., 0]
    whole += slope.T @ (slope / R)
    says = slope.T @ (measured / R)
    says[size:] += np.linalg.solve(now[1][..., 0], state)
    wanted = np.linalg.solve(whole, says)[size:], np.linalg.inv(whole)[size:, size:, np.newaxis]
    assert apart(found, wanted) < 1e-7


def test_errors_that_are_forgotten_were_as_large_before_all_that_was_known():
    """The same by the information of both instants, errors new at each of them included."""
    lasts_s, since = (300.0, 5.0, 0.0, 1e9), np.array([1.3])
    model = MotionWithErrors(ConstantVelocity(3.0), lasts_s)
    size, kept = model.size, np.exp(-1.3 / np.array([300.0, 5.0, 1e-9, 1e9]))
    here, there = RNG.normal(size=(2, 12, size))  # what is measured now and then, by the states
    seen_here, seen_there = RNG.normal(size=(2, 12, 1)) * 5.0
    before = np.diag([0.0] * 6 + [1.0] * 4)  # of errors alone something is known
    first = before + here.T @ here
    state = np.linalg.solve(first, here.T @ seen_here)
    now = state, np.linalg.inv(first)[:, :, np.newaxis]
    then = retrodict_before_start(model, now, since)
    root = there[:, :, np.newaxis]
    known = np.einsum("mdn,dn->mn", root, then.state)
    what = innovation(known, root, then.covariance, np.ones((12, 1)))
    found = then.carry_forward(*now, *update(then.state, then.covariance, what, seen_there - known))

    moves, noise = np.eye(size), np.diag([1.0] * 6 + list(1.0 - kept**2))
    moves[:3, 3:6], moves[range(6, size), range(6, size)] = 1.3 * np.eye(3), kept
    noise[:6, :6] = ConstantVelocity(3.0).noise(since)[..., 0]
    steps = np.hstack([moves, -np.eye(size)])
    whole = steps.T @ np.linalg.solve(noise, steps)
    whole[:size, :size] += before + there.T @ there
    whole[size:, size:] += here.T @ here
    says = np.concatenate([there.T @ seen_there, here.T @ seen_here])
    wanted = np.linalg.solve(whole, says)[size:], np.linalg.inv(whole)[size:, size:, np.newaxis]
    assert apart(found, wanted) < 1e-6


def test_with_noise_and_several_since_it_is_near_and_stays_positive():
    """Strong noise: a third of the error of leaving it out, rms over cases."""
    errors, lost = [], []
    for _ in range(40):
        found, wanted, dropped = both(ConstantVelocity(3.0), late=1)
        deviation = np.sqrt(np.einsum("iin->in", wanted[1]))
        errors.append((found[0] - wanted[0]) / deviation)
        lost.append((dropped - wanted[0]) / deviation)
        assert np.linalg.eigvalsh(found[1][:, :, 0]).min() > 0.0
        np.testing.assert_array_equal(found[1], found[1].swapaxes(0, 1))
    error, loss = (np.sqrt(np.mean(np.square(values))) for values in (errors, lost))
    assert 1e-6 < error < 0.5 * loss
