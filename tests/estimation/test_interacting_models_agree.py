"""Interacting models after every look, against frozen values at 40 digits (`make_imm_vectors`)."""

import json
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from components.estimation.estimator import (
    Estimates,
    ExtendedKalmanFilter,
    mixture_moments,
    pair_measurement,
)
from components.estimation.frame import SensorPose
from components.estimation.interacting_models import InteractingMultipleModels
from components.estimation.measurement import Kind
from components.estimation.motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn

VECTORS = json.loads(Path(__file__).with_name("imm_vectors.json").read_text())


def apart(covariance, known):
    """Return the largest difference, in units of the deviations."""
    deviation = np.sqrt(np.diag(known))
    return np.abs((covariance - known) / np.outer(deviation, deviation)).max()


def test_every_update_of_three_models_agrees_with_40_digits():
    velocity, turn, rate, jerk = VECTORS["intensities"]
    models = ConstantVelocity(velocity), CoordinatedTurn(turn, rate), ConstantAcceleration(jerk)
    imm = InteractingMultipleModels(
        tuple(ExtendedKalmanFilter(model) for model in models),
        np.array(VECTORS["rates"]),
    )
    own = [[], [VECTORS["turn"]], [VECTORS["acceleration"]] * 3]
    states = [np.array([*VECTORS["mean"], *(m for m, _ in more)])[:, None] for more in own]
    covariances = [np.diag([*VECTORS["spread"], *(v for _, v in more)])[:, :, None] for more in own]
    weights = np.array(VECTORS["probabilities"])[:, None]
    one, last_s = np.zeros(1, dtype=np.int64), 0.0
    for (time_s, *values, sensor), known in zip(VECTORS["looks"], VECTORS["after"], strict=True):
        kind = Kind(values[-1] is not None)
        place = SensorPose(np.array(sensor, dtype=float)[:, None], np.eye(3)[:, :, None])
        measured = np.array([v for v in values if v is not None])[:, None]
        variance = np.array(VECTORS["variances"][: kind.size])[:, None]
        tracks = Estimates(states, covariances, weights)
        before = imm.predict(tracks, np.array([time_s - last_s]))
        last_s = time_s
        moments = imm.expect(kind, before, place)
        pairs = pair_measurement(moments, one, measured, variance, None, before.weights)
        states, covariances, weights = after = imm.update(before, one, pairs, one)
        np.testing.assert_allclose(weights[:, 0], known["probabilities"], rtol=1e-9)
        for m in range(3):
            np.testing.assert_allclose(states[m][:, 0], known["states"][m], rtol=1e-9)
            assert apart(covariances[m][:, :, 0], np.array(known["covariances"][m])) < 1e-9
        mean, spread = mixture_moments(after)
        np.testing.assert_allclose(mean[:, 0], known["state"], rtol=1e-9)
        assert apart(spread[:, :, 0], np.array(known["covariance"])) < 1e-9


def test_which_model_it_was_is_what_bayes_says_of_two_unlike_times():
    rates = np.array([[0.0, 0.3, 0.02], [0.1, 0.0, 0.05], [0.4, 0.01, 0.0]])
    generator, weights = rates - np.diag(rates.sum(axis=1)), np.array([0.6, 0.3, 0.1])
    models = [ExtendedKalmanFilter(ConstantVelocity(q)) for q in (1.0, 2.0, 3.0)]
    imm = InteractingMultipleModels(tuple(models), rates)
    until_s, since_s = np.array([0.5, 4.0]), np.array([3.0, 0.2])
    found = imm.past_model_probabilities(np.stack([weights, weights], axis=1), until_s, since_s)
    for k in range(2):
        joint = (weights @ expm(generator * until_s[k]))[:, None] * expm(generator * since_s[k])
        np.testing.assert_allclose(found[..., k], joint / joint.sum(axis=0), rtol=1e-12)


def test_the_frozen_looks_ask_every_model():
    """Otherwise agreement would say little: each is the likeliest, or nearly, at some look."""
    odds = np.array([known["probabilities"] for known in VECTORS["after"]])
    assert (odds.max(axis=0) > 0.5).all() and (odds.min(axis=0) < 0.2).all()
