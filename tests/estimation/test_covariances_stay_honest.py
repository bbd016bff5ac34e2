"""Covariances: positive whatever comes, honest by chi-square, the same in any company."""

import numpy as np
import pytest
from scipy.stats import chi2

from components.estimation.batched import cholesky, mahalanobis_squared, solve_lower
from components.estimation.frame import SensorPose
from components.estimation.kalman import innovation, update
from components.estimation.measurement import Kind, expected_measurement, linearise, residual
from components.estimation.motion import ConstantVelocity, predict
from components.estimation.unscented import SigmaPoints, predict_unscented, unscented_moments

SIGMA = SigmaPoints()


def level_place(count):
    return SensorPose(np.zeros((3, count)), np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2))


def step(name, model, state, covariance, dt, kind, place, variance):
    if name == "ekf":
        state, covariance = predict(model, state, covariance, dt)
        return state, covariance, innovation(*linearise(kind, state, place), covariance, variance)
    state, covariance = predict_unscented(model, state, covariance, dt, SIGMA)
    return (
        state, covariance,
        unscented_moments(kind, state, covariance, place, SIGMA).innovation(variance),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_a_million_updates_keep_covariances_symmetric_and_positive(name):
    """Ranges from 1 m to 300 km, errors from 1e-6 to 0.1 rad, steps of 1 ms to a minute."""
    rng = np.random.default_rng(1)
    count, steps = (5000, 200) if name == "ekf" else (500, 40)
    distance = 10.0 ** rng.uniform(0.0, np.log10(3e5), count)
    direction = rng.normal(size=(3, count))
    direction /= np.linalg.norm(direction, axis=0)
    state = np.concatenate([distance * direction, rng.normal(size=(3, count)) * 50.0])
    covariance = np.zeros((6, 6, count))
    for i in range(3):
        covariance[i, i], covariance[i + 3, i + 3] = (0.3 * distance) ** 2, 50.0**2
    variance = np.stack([10.0 ** rng.uniform(-12, -2, count) for _ in range(2)]
                        + [10.0 ** rng.uniform(-4, 4, count)])  # fmt: skip
    place, model = level_place(count), ConstantVelocity(1.0)
    dt = 10.0 ** rng.uniform(-3, 0, count)
    for k in range(steps):
        late = np.where(rng.uniform(size=count) < 1e-3, 60.0, dt)
        kind = Kind(k % 3 == 0)
        errors = variance[: kind.size]
        state, covariance, found = step(name, model, state, covariance, late, kind, place, errors)
        moved = found.expected + rng.normal(size=errors.shape) * np.sqrt(errors)
        state, covariance = update(state, covariance, found, residual(moved, found.expected))
    np.testing.assert_array_equal(covariance, covariance.swapaxes(0, 1))
    deviation = np.sqrt(np.einsum("iin->in", covariance))
    scaled = (covariance / deviation / deviation[:, np.newaxis]).transpose(2, 0, 1)
    assert np.linalg.eigvalsh(scaled).min() > 0.0


def test_normalised_errors_of_far_targets_have_the_mean_of_chi_square():
    rng = np.random.default_rng(7)
    count, looks, q = 400, 25, 4.0
    model, place, kind = ConstantVelocity(q), level_place(count), Kind()
    truth = np.concatenate(
        [np.array([[9000.0], [4000.0], [-800.0]]) + rng.normal(size=(3, count)) * 200.0,
         rng.normal(size=(3, count)) * 40.0]
    )  # fmt: skip
    spread = np.diag([200.0**2] * 3 + [40.0**2] * 3)
    state = np.array([[9000.0], [4000.0], [-800.0], [0.0], [0.0], [0.0]]) + np.zeros(count)
    covariance = np.repeat(spread[:, :, np.newaxis], count, axis=2)
    variance = np.array([0.003**2, 0.004**2, 20.0**2])[:, np.newaxis] + np.zeros(count)
    nis = []
    for k in range(looks):
        dt = np.full(count, 0.2 + 0.1 * (k % 3))
        root = np.linalg.cholesky(model.noise(dt).transpose(2, 0, 1))
        truth = model.move(truth, dt)
        truth += np.einsum("nij,jn->in", root, rng.normal(size=(6, count)))
        seen = expected_measurement(kind, truth, place) + rng.normal(size=(3, count)) * np.sqrt(
            variance
        )
        state, covariance, found = step("ekf", model, state, covariance, dt, kind, place, variance)
        apart = residual(seen, found.expected)
        nis.append(mahalanobis_squared(found.root, apart))
        state, covariance = update(state, covariance, found, apart)
    error = (truth - state).T
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance.transpose(2, 0, 1)), error)
    for values, freedom in ((nees, 6), (np.concatenate(nis), 3)):
        low, high = chi2.ppf([0.005, 0.995], freedom * len(values)) / len(values)
        assert low < values.mean() < high


@pytest.mark.parametrize("name", ["ekf", "ukf"])
def test_a_track_is_the_same_to_the_bit_alone_or_among_others(name):
    rng = np.random.default_rng(3)
    count = 67
    state = np.concatenate([rng.normal(size=(3, count)) * 5000, rng.normal(size=(3, count)) * 60])
    covariance = np.repeat(np.diag([1e4] * 3 + [900.0] * 3)[:, :, np.newaxis], count, axis=2)
    dt, place = rng.uniform(0.01, 3, count), level_place(count)
    variance = np.full((3, count), 1e-4)
    model, kind = ConstantVelocity(2.0), Kind()

    def run(which):
        found = step(name, model, state[:, which], covariance[:, :, which], dt[which], kind,
                     place.take(which), variance[:, which])  # fmt: skip
        measured = found[2].expected + 0.001
        return update(found[0], found[1], found[2], residual(measured, found[2].expected))

    together = run(np.arange(count))
    for which in (np.array([0]), np.array([66]), np.array([13, 14, 15]), np.arange(5, 38)):
        for part, whole in zip(run(which), together, strict=True):
            assert part.tobytes() == np.ascontiguousarray(whole[..., which]).tobytes()


def test_roots_are_lower_triangles_whose_diagonal_is_rounded_once():
    """Of a variance alone the root is its square root, to the bit; and NaN of what is none."""
    draw = np.random.default_rng(3)
    variance = draw.uniform(1e-3, 1e6, 200)
    np.testing.assert_array_equal(cholesky(variance.reshape(1, 1, -1))[0, 0], np.sqrt(variance))
    whole = draw.normal(size=(4, 4, 30))
    whole = np.einsum("ikn,jkn->ijn", whole, whole) + np.eye(4)[:, :, None]
    root = cholesky(whole)
    for k in range(30):
        np.testing.assert_allclose(root[:, :, k], np.linalg.cholesky(whole[:, :, k]), atol=1e-12)
    right = draw.normal(size=(4, 2, 30))
    solved = solve_lower(root, right)
    np.testing.assert_allclose(np.einsum("ikn,kjn->ijn", root, solved), right, atol=1e-12)
    assert np.isnan(cholesky(np.array([[[-1.0, 0.0, np.nan]]]))).all()
