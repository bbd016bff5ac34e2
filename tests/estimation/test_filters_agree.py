"""Filters against Stone Soup's frozen results, textbook loops and 30-digit derivatives."""

import json
from pathlib import Path

import crooked
import mpmath
import numpy as np
import pymap3d
import pytest
from scipy.linalg import expm

from components.estimation.estimator import update_model_probabilities
from components.estimation.frame import SensorPose, pose_in_frame
from components.estimation.interacting_models import mix_models, transition_probabilities
from components.estimation.kalman import innovation, update
from components.estimation.measurement import (
    Kind,
    expected_measurement,
    linearise,
    position_and_jacobian,
    residual,
)
from components.estimation.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    predict,
)
from components.estimation.unscented import SigmaPoints, predict_unscented, unscented_moments

FLIP = np.array([1.0, 1.0, -1.0, 1.0, 1.0, -1.0])  # their up is our down
VECTORS = json.loads(Path(__file__).with_name("stone_soup_vectors.json").read_text())


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_every_update_agrees_with_stone_soup(name):
    state = (np.array(VECTORS["mean"]) * FLIP)[:, np.newaxis]
    covariance = np.diag(VECTORS["spread"])[:, :, np.newaxis]
    model, sigma = ConstantVelocity(VECTORS["intensity"]), SigmaPoints(*VECTORS["sigma"])
    last_s = 0.0
    for (time_s, *measured, sensor), known in zip(VECTORS["looks"], VECTORS[name], strict=True):
        kind = Kind(measured[-1] is not None)
        values = np.array([v for v in measured if v is not None])[:, np.newaxis]
        variance = np.array(VECTORS["variances"][: kind.size])[:, np.newaxis]
        place = SensorPose(
            (np.array(sensor, dtype=float) * FLIP[:3])[:, np.newaxis], np.eye(3)[:, :, np.newaxis]
        )
        dt = np.array([time_s - last_s])
        if name == "ekf":
            state, covariance = predict(model, state, covariance, dt)
            found = innovation(*linearise(kind, state, place), covariance, variance)
        else:
            state, covariance = predict_unscented(model, state, covariance, dt, sigma)
            found = unscented_moments(kind, state, covariance, place, sigma).innovation(variance)
        state, covariance = update(state, covariance, found, residual(values, found.expected))
        last_s = time_s
        np.testing.assert_allclose(state[:, 0], np.array(known["state"]) * FLIP, rtol=1e-10)
        expected_covariance = np.array(known["covariance"]) * np.outer(FLIP, FLIP)
        deviation = np.sqrt(np.diag(expected_covariance))
        apart = (covariance[:, :, 0] - expected_covariance) / np.outer(deviation, deviation)
        assert np.abs(apart).max() < 1e-10


def crooked_place(count=1):
    """Return the crooked ownship's pose in a frame 40 km away, by pymap3d and matrices."""
    own = crooked.OWNSHIP
    origin = (own["lat_deg"] + 0.31, own["lon_deg"] + 360.0 + 0.22, 300.0)
    here = (own["lat_deg"], own["lon_deg"], own["alt_m"])
    columns = [np.repeat(float(v), count) for v in (*origin, *here)]
    attitude = np.radians([own["yaw_deg"], own["pitch_deg"], own["roll_deg"]])
    place = pose_in_frame(
        tuple(columns[:3]), tuple(columns[3:]), tuple(np.repeat(v, count) for v in attitude)
    )
    return place, origin, here


def test_places_in_the_frame_are_those_of_ecef_and_rotation_matrices():
    place, origin, here = crooked_place()
    np.testing.assert_allclose(
        place.position_m[:, 0], pymap3d.ecef2ned(*pymap3d.geodetic2ecef(*here), *origin), atol=1e-6
    )
    target = crooked.position(crooked.ROLLING)
    in_frame = np.array(pymap3d.ecef2ned(*target, *origin))
    seen = expected_measurement(
        Kind(), np.concatenate([in_frame, np.zeros(3)])[:, np.newaxis], place
    )[:, 0]
    body = crooked.body(crooked.ROLLING)
    np.testing.assert_allclose(seen[:2], crooked.angles(body), atol=1e-9)
    assert seen[2] == pytest.approx(np.linalg.norm(body), abs=1e-5)
    back, _ = position_and_jacobian(seen[:, np.newaxis], place)
    np.testing.assert_allclose(back[:, 0], in_frame, atol=1e-6)


def test_derivatives_of_measurements_are_exact():
    place, _, _ = crooked_place()
    velocity = np.array([31.0, -44.0, 3.0])
    place = SensorPose(place.position_m, place.to_body, velocity[:, np.newaxis])
    state = np.concatenate([place.position_m[:, 0] + [-2100.0, 900.0, -340.0], [20.0, 61.0, -8.0]])
    turn, sensor = place.to_body[:, :, 0], place.position_m[:, 0]

    def seen(*s):
        away = [s[i] - mpmath.mpf(sensor[i]) for i in range(3)]
        x, y, z = (sum(mpmath.mpf(turn[i, k]) * away[k] for k in range(3)) for i in range(3))
        r = mpmath.sqrt(sum(a * a for a in away))
        rate = sum(away[k] * (s[3 + k] - mpmath.mpf(velocity[k])) for k in range(3)) / r
        return [mpmath.atan2(y, x), mpmath.asin(-z / r), r, rate]

    kind = Kind(True, True)
    value, jacobian = linearise(kind, state[:, np.newaxis], place)
    with mpmath.workdps(30):
        np.testing.assert_allclose(value[:, 0], [float(v) for v in seen(*state)], rtol=1e-12)
        known = np.zeros((4, 6))
        for i, k in np.ndindex(4, 6):
            which = tuple(int(j == k) for j in range(6))
            known[i, k] = float(mpmath.diff(lambda *s, i=i: seen(*s)[i], state, which))
    np.testing.assert_allclose(jacobian[:, :, 0], known, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("rate", [0.0, 1e-7, 0.004, 0.0524, -0.2])
def test_a_turn_and_its_derivatives_are_those_of_its_differential_equation(rate):
    model, dt = CoordinatedTurn(1.0, 1e-4), 2.5
    state = np.array([100.0, -50.0, 10.0, 60.0, -20.0, 2.0, rate])
    with mpmath.workdps(40):

        def moved(*s):
            generator = mpmath.zeros(6)
            generator[0, 3] = generator[1, 4] = generator[2, 5] = 1
            generator[3, 4], generator[4, 3] = -s[6], s[6]
            end = mpmath.expm(generator * mpmath.mpf(dt), "taylor") * mpmath.matrix(s[:6])
            return [*end, s[6]]

        step = mpmath.mpf(10) ** -15
        point = [mpmath.mpf(float(v)) for v in state]
        columns = []
        for k in range(7):
            ends = [
                moved(*[v + sign * step * (i == k) for i, v in enumerate(point)])
                for sign in (1, -1)
            ]
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
        known = [float(v) for v in moved(*point)]
    got = model.move(state[:, np.newaxis], np.array([dt]))[:, 0]
    np.testing.assert_allclose(got, known, rtol=1e-13, atol=1e-13)
    jacobian = model.jacobian(state[:, np.newaxis], np.array([dt]))[:, :, 0]
    np.testing.assert_allclose(jacobian, np.array(columns).T, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("model", [ConstantVelocity(2.0), ConstantAcceleration(0.3)])
def test_linear_models_are_the_exponential_of_white_noise(model):
    """Van Loan's method: the exponential of one block matrix holds transition and noise."""
    size, dt = model.size, 1.7
    drift, gain = np.zeros((size, size)), np.zeros((size, size))
    drift[range(size - 3), range(3, size)] = 1.0
    intensity = 2.0 if size == 6 else 0.3
    gain[range(size - 3, size), range(size - 3, size)] = intensity
    block = np.block([[-drift, gain], [np.zeros_like(drift), drift.T]]) * dt
    whole = expm(block)
    step = whole[size:, size:].T
    times = np.array([dt])
    state = np.arange(1.0, size + 1.0)[:, np.newaxis]
    covariance = np.diag(np.arange(2.0, size + 2.0))[:, :, np.newaxis]
    np.testing.assert_allclose(model.jacobian(state, times)[:, :, 0], step, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(model.move(state, times)[:, 0], step @ state[:, 0], rtol=1e-13)
    np.testing.assert_allclose(
        model.noise(times)[:, :, 0], step @ whole[:size, size:], rtol=1e-12, atol=1e-13
    )
    _, spread = predict(model, state, covariance, times)
    known = step @ covariance[:, :, 0] @ step.T + step @ whole[:size, size:]
    np.testing.assert_allclose(spread[:, :, 0], known, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("fresh", [(), (0.0, 1.7, 0.3)])
def test_interacting_models_follow_the_textbook(fresh):
    """Three models of 6, 9 and 7 components over unequal times, against loops over matrices."""
    models = [ConstantVelocity(0.5), ConstantAcceleration(0.2), CoordinatedTurn(0.5, 1e-4)]
    rates = np.array([[0, 0.02, 0.05], [0.1, 0, 0.03], [0.07, 0.01, 0]])
    rng = np.random.default_rng(4)
    states = [rng.normal(size=m.size) * ([100.0] * 3 + [30.0] * 3 + [0.1] * (m.size - 6))
              for m in models]  # fmt: skip
    covariances = []
    for m in models:
        root = rng.normal(size=(m.size, m.size))
        covariances.append(root @ root.T + np.eye(m.size))
    probabilities = np.array([0.5, 0.3, 0.2])
    for dt in (0.05, 3.0, 400.0):
        generator = rates - np.diag(rates.sum(axis=1))
        steps = expm(generator * dt)
        got = transition_probabilities(rates, np.array([0.0, dt]))
        np.testing.assert_allclose(got[:, :, 1], steps, rtol=1e-12)
        np.testing.assert_allclose(got[:, :, 0], np.eye(3), atol=1e-15)
        new_states, new_covariances, predicted = mix_models(
            [s[:, np.newaxis] for s in states],
            [c[:, :, np.newaxis] for c in covariances],
            probabilities[:, np.newaxis],
            got[:, :, 1:],
            fresh,
        )
        np.testing.assert_allclose(predicted[:, 0], probabilities @ steps, rtol=1e-12)
        for j, model in enumerate(models):
            mu = probabilities * steps[:, j] / (probabilities @ steps)[j]
            given = []
            for i, other in enumerate(models):
                if other.size == model.size:
                    given.append((states[i], covariances[i]))
                    continue
                x, c = states[j].copy(), covariances[j].copy()
                x[:6] = states[i][:6]
                c[:6, :6] = covariances[i][:6, :6]
                c[:6, 6:] = c[6:, :6] = 0.0
                if fresh:
                    x[6:] = 0.0
                    c[6:, 6:] = np.eye(model.size - 6) * fresh[j]
                given.append((x, c))
            mean = sum(w * x for w, (x, _) in zip(mu, given, strict=True))
            spread = sum(
                w * (c + np.outer(x - mean, x - mean)) for w, (x, c) in zip(mu, given, strict=True)
            )
            np.testing.assert_allclose(new_states[j][:, 0], mean, rtol=1e-11, atol=1e-12)
            np.testing.assert_allclose(new_covariances[j][:, :, 0], spread, rtol=1e-10, atol=1e-10)
    logs = np.array([[-1.0], [-3.0], [-900.0]])
    weights = probabilities * np.exp(logs[:, 0])
    np.testing.assert_allclose(
        update_model_probabilities(probabilities[:, np.newaxis], logs)[:, 0],
        weights / weights.sum(),
        atol=1e-300,
    )  # fmt: skip
