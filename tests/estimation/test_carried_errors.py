"""Errors that a filter carries as states: against differences, and one batch of all looks."""

from dataclasses import replace

import numpy as np
import pytest

from components.estimation.carried_errors import (
    BEARING,
    CLIMB,
    EAST,
    HEIGHT,
    LATENCY,
    NORTH,
    RANGE,
    SPEED_EAST,
    SPEED_NORTH,
    MotionWithErrors,
    ReportedErrors,
)
from components.estimation.estimator import Estimates, ExtendedKalmanFilter, pair_measurement
from components.estimation.frame import pose_in_frame
from components.estimation.interacting_models import InteractingMultipleModels
from components.estimation.kalman import linear_moments, update
from components.estimation.measurement import Kind
from components.estimation.motion import ConstantVelocity, CoordinatedTurn, predict
from components.estimation.unscented import SigmaPoints, UnscentedKalmanFilter

WAYS = (NORTH, EAST, HEIGHT, HEIGHT, SPEED_NORTH, SPEED_EAST, BEARING, RANGE, CLIMB)
DEVIATIONS = np.array([30.0, 30.0, 25.0, 2.0, 4.0, 4.0, 0.15, 38.0, 0.9])


def pose(count):
    """Banked on the southern hemisphere."""
    ones = np.ones(count)
    return pose_in_frame(
        (-41.3 * ones, 173.2 * ones, 2400.0 * ones), (-41.29 * ones, 173.2 * ones, 2400.0 * ones),
        (np.radians(217.0) * ones, 0.07 * ones, -0.35 * ones),
    )  # fmt: skip


def told(count, at_range):
    deviation = DEVIATIONS[:, np.newaxis] * np.ones(count)
    deviation[[0, 1, 4, 5, 8] if at_range else [6, 7]] = 0.0
    return ReportedErrors(WAYS, deviation, np.full(count, 0.4), np.full(count, at_range))


@pytest.mark.parametrize("at_range", [False, True])
def test_derivatives_are_those_of_differences(at_range):
    count, rng = 40, np.random.default_rng(3)
    errors, kind, place = told(count, at_range), Kind(True, False, True), pose(count)
    late = np.full((1, count), 0.0 if at_range else 0.6)
    errors = ReportedErrors(
        (*WAYS, LATENCY), np.concatenate([errors.deviation, late]), errors.age_s, errors.at_range
    )
    state = np.concatenate([
        rng.choice([-1.0, 1.0], (2, count)) * rng.uniform(2000.0, 6000.0, (2, count)),
        rng.normal(0.0, 400.0, (1, count)),
        rng.normal(0.0, 60.0, (3, count)), rng.normal(size=(len(WAYS) + 1, count)),
    ])  # fmt: skip
    seen, slope = errors.linearise(kind, state, place)
    np.testing.assert_array_equal(seen, errors.expected_measurement(kind, state, place))
    for i, step in enumerate([1e-2] * 6 + [1e-4] * (len(WAYS) + 1)):
        off = np.zeros_like(state)
        off[i] = step
        both = [
            errors.expected_measurement(kind, state + sign * off, place) for sign in (1.0, -1.0)
        ]
        apart = (both[0] - both[1]) / (2.0 * step)
        size = np.maximum(np.abs(slope[:, i]).max(axis=1, keepdims=True), 1e-6)
        least = np.array([1e-9, 1e-9, 1e-5, 1e-5, 1e-5, 1e-5])[:, np.newaxis]
        assert (np.abs(apart - slope[:, i]) < 1e-5 * size + least).all(), i


def test_heights_at_ranges_and_without_stand_beside_each_other():
    """One that leaves its range as it is beside one that does not: each as by itself."""
    count, rng = 6, np.random.default_rng(8)
    state = np.concatenate([
        rng.uniform(2000.0, 6000.0, (2, count)), rng.normal(0.0, 400.0, (1, count)),
        rng.normal(0.0, 60.0, (3, count)), rng.normal(size=(len(WAYS), count)),
    ])  # fmt: skip
    kind, place, at_range = Kind(True, False, True), pose(count), np.arange(count) % 3 == 0
    both = [told(count, each) for each in (False, True)]
    mixed = replace(
        both[0], at_range=at_range, deviation=np.where(at_range, *(b.deviation for b in both[::-1]))
    )
    alone = [each.linearise(kind, state, place) for each in both]
    for part, found in enumerate(mixed.linearise(kind, state, place)):
        expected = np.where(at_range, alone[1][part], alone[0][part])
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_a_height_at_a_range_moves_on_a_sphere_and_a_bearing_about_the_vertical():
    place, kind = pose(1), Kind(True)
    state = np.zeros((6 + len(WAYS), 1))
    state[:3, 0] = place.position_m[:, 0] + [3000.0, -4000.0, -700.0]
    for way, says in ((HEIGHT, 2), (BEARING, 2), (BEARING, "height")):
        moved = state.copy()
        moved[6 + WAYS.index(way)] = 2.0
        errors = told(1, True)
        if says == 2:  # the range
            seen = [errors.expected_measurement(kind, x, place)[2, 0] for x in (state, moved)]
        else:
            seen = [errors._reported_states(x, place)[0][2, 0] for x in (state, moved)]
        assert seen[0] == pytest.approx(seen[1], abs=1e-6)


def test_a_late_position_lies_back_along_the_flight_and_reports_do_not_tell_how_late():
    """Half a second at 80 m/s; covariances with what is corrected are those of Schmidt's filter."""
    place, kind = pose(1), Kind(True, False, True)
    late = ReportedErrors(
        (NORTH, LATENCY), np.array([[3.0], [0.5]]), np.zeros(1), np.zeros(1, bool)
    )
    state = np.zeros((8, 1))
    state[:6, 0] = [4000.0, 3000.0, -2600.0, 80.0, 0.0, 0.0]
    state[7] = 1.0
    seen = late.expected_measurement(kind, state, place)
    state[0] -= 40.0
    state[7] = 0.0
    np.testing.assert_allclose(seen, late.expected_measurement(kind, state, place), rtol=1e-12)

    root = np.random.default_rng(5).normal(size=(8, 8))
    covariance = (root @ root.T * 9.0 + np.diag([900.0] * 3 + [9.0] * 3 + [1.0] * 2))[..., None]
    moments = linear_moments(*late.linearise(kind, state, place), covariance)
    moments = replace(moments, considered=late.uncorrected_components)
    variance = np.array([1e-6, 1e-6, 25.0, 1.0, 1.0, 1.0])[:, None]
    measured = np.array([0.01, -0.004, 30.0, 2.0, -1.0, 0.5])[:, None]
    moved, spread = update(state, covariance, moments.innovation(variance), measured)
    p, h = covariance[..., 0], moments.jacobian[..., 0]
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(variance[:, 0]))
    gain[7] = 0.0
    rest = np.eye(8) - gain @ h
    wanted = rest @ p @ rest.T + gain * variance[:, 0] @ gain.T
    np.testing.assert_allclose(moved[:, 0], state[:, 0] + gain @ measured[:, 0], rtol=1e-9)
    np.testing.assert_allclose(spread[..., 0], wanted, rtol=1e-6, atol=1e-7)


def test_errors_are_forgotten_and_stay_as_large():
    model = MotionWithErrors(ConstantVelocity(1.0), (300.0, np.inf, 0.0))
    state, covariance = np.ones((9, 2)), np.zeros((9, 9, 2))
    for i in range(9):
        covariance[i, i] = 1.0
    dt_s = np.array([0.0, 60.0])
    moved, spread = predict(model, state, covariance, dt_s)
    left = np.exp(-60.0 / 300.0)
    np.testing.assert_allclose(moved[6:], [[1.0, left], [1.0, 1.0], [1.0, 0.0]], atol=1e-15)
    np.testing.assert_allclose(np.diagonal(spread)[:, 6:], 1.0, rtol=1e-14)
    np.testing.assert_allclose(moved[:6], ConstantVelocity(1.0).move(state[:6], dt_s))


def tracked(estimator, looks, place, errors, white):
    """Return what a filter makes of looks one second apart, from a vague start."""
    states, covariances = [], []
    for model in estimator.models:
        size = model.size
        state, covariance = np.zeros((size, 1)), np.zeros((size, size, 1))
        state[:6, 0] = START
        for i in range(size):
            covariance[i, i] = (500.0**2 if i < 3 else 50.0**2) if i < 6 else 1.0
        for i in range(6 + estimator.error_count, size):
            covariance[i, i] = 1e-12
        states.append(state)
        covariances.append(covariance)
    many = len(states)
    tracks = Estimates(states, covariances, np.full((many, 1), 1.0 / many))
    for k, seen in enumerate(looks):
        if k:
            tracks = estimator.predict(tracks, np.ones(1))
        moments = estimator.expect(Kind(True, False, True), tracks, place, errors)
        pairs = pair_measurement(
            moments, np.arange(1), seen[:, np.newaxis], white, None, tracks.weights
        )
        tracks = estimator.update(tracks, np.arange(1), pairs, np.arange(1))
    return tracks


START = np.array([90_000.0, -50_000.0, -3000.0, 20.0, -40.0, 3.0])
COUNT, LASTS_S = 25, (300.0, 300.0, np.inf, 0.0, 300.0, 300.0, 0.0, np.inf, 0.0)


@pytest.mark.parametrize("name", ["ekf", "ukf", "imm"])
def test_tracks_are_those_of_one_batch_that_knows_how_errors_are_correlated(name):
    """The Gaussian posterior of all looks at once, whose errors have their covariance in time."""
    calm = ConstantVelocity(1e-9)
    estimator = {
        "ekf": ExtendedKalmanFilter(calm),
        "ukf": UnscentedKalmanFilter(calm, SigmaPoints(0.1)),
        "imm": InteractingMultipleModels(
            (ExtendedKalmanFilter(calm), ExtendedKalmanFilter(CoordinatedTurn(1e-9, 1e-20))),
            np.zeros((2, 2)), (0.0, 1e-12),
        ),
    }[name].carrying(LASTS_S)  # fmt: skip
    place, errors = pose(1), told(1, False)
    away = START[:3] - place.position_m[:, 0]
    far = np.linalg.norm(away)
    white_m2, white = np.array([4.0, 4.0, 4.0, 0.04, 0.04, 0.25]), np.zeros((6, 1))
    white[3:, 0] = white_m2[3:]
    kind, still = Kind(True, False, True), np.zeros((6 + len(WAYS), 1))
    rng, true = np.random.default_rng(11), START + np.array([120.0, -90.0, 40.0, 6.0, 5.0, -2.0])
    # Errors of place (three axes) and velocity in time, without any state.
    apart = np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))
    in_time = [np.exp(-apart / t) if t > 0.0 else np.eye(COUNT) for t in LASTS_S]
    effects = np.zeros((6, 9))
    effects[0, 0], effects[1, 1], effects[2, 2], effects[2, 3] = 30.0, 30.0, -25.0, -2.0
    effects[3, 4] = effects[4, 5] = 4.0
    effects[0, 4] = effects[1, 5] = 4.0 * 0.4
    effects[5, 8], effects[2, 8] = -0.9, -0.9 * 0.4
    whole = np.kron(np.eye(COUNT), np.diag(white_m2))
    for i, by in enumerate(in_time):
        whole += np.kron(by, np.outer(effects[:, i], effects[:, i]))
    drawn = np.linalg.cholesky(whole) @ rng.normal(size=6 * COUNT)
    design = np.zeros((6 * COUNT, 6))
    for k in range(COUNT):
        design[6 * k : 6 * k + 6] = np.eye(6)
        design[6 * k : 6 * k + 3, 3:] += k * np.eye(3)
    # Of the state at the last look.
    onward = np.eye(6)
    onward[:3, 3:] = (COUNT - 1) * np.eye(3)
    told_states = design @ true + drawn
    prior = np.diag([500.0**2] * 3 + [50.0**2] * 3)
    information = np.linalg.inv(prior) + design.T @ np.linalg.solve(whole, design)
    batch = np.linalg.inv(information)
    mean = batch @ (np.linalg.solve(prior, START) + design.T @ np.linalg.solve(whole, told_states))
    mean, batch = onward @ mean, onward @ batch @ onward.T
    looks = []
    plain = ReportedErrors(WAYS, 0.0 * errors.deviation, errors.age_s, errors.at_range)
    for k in range(COUNT):
        still[:6, 0] = told_states[6 * k : 6 * k + 6]
        looks.append(plain.expected_measurement(kind, still, place)[:, 0])
    level = np.cos(looks[0][1])
    white[:3, 0] = 4.0 / (far * level) ** 2, 4.0 / far**2, 4.0
    tracks = tracked(estimator, looks, place, errors, white)
    for state, covariance in zip(tracks.states, tracks.covariances, strict=True):
        deviation = np.sqrt(np.diag(batch))
        assert (np.abs(state[:6, 0] - mean) < 0.05 * deviation).all()
        found = covariance[:6, :6, 0]
        # The white part is fixed in angles here, in the batch in metres.
        np.testing.assert_allclose(np.sqrt(np.diag(found)), deviation, rtol=0.02)
