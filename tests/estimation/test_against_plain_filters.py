"""Every output of the filters against a second implementation: loops over single tracks."""

import math

import numpy as np
import plain_filters as plain
import pytest

from components.association.jpda import exact_pair_probabilities, pair_probabilities
from components.estimation.estimator import (
    Estimates,
    log_mixture,
    mixture_innovation_squared,
    mixture_moments,
    pair_measurement,
)
from components.estimation.frame import SensorPose
from components.estimation.measurement import Kind
from components.estimation.motion import predict
from components.tracking.filters import (
    InteractingModels,
    InteractingParameters,
    Unscented,
    UnscentedParameters,
)

COUNT = 4
KINDS = [Kind(False), Kind(True), Kind(False, True), Kind(True, True)]


def estimator_of(kind, parameters):
    block = object.__new__(kind)
    block.p = parameters
    return block.estimator()


def sizes_of(estimator):
    return [model.size for model in estimator.models]


def cases(sizes, seed):
    """Random tracks of every model, where they are seen from, and how the aircraft is turned."""
    rng = np.random.default_rng(seed)
    xs, ps = [], []
    base = np.concatenate([rng.normal(0, 3000, (3, COUNT)), rng.normal(0, 60, (3, COUNT))])
    for size in sizes:
        x = np.concatenate([base + rng.normal(0, 5, base.shape), np.zeros((size - 6, COUNT))])
        scale = np.array([40.0] * 3 + [8.0] * 3 + [0.03 if size == 7 else 1.0] * (size - 6))
        x[6:] = scale[6:, None] * rng.normal(size=(size - 6, COUNT))
        root = rng.normal(size=(size, size, COUNT)) * scale[:, None, None]
        xs.append(x)
        ps.append(np.einsum("ikn,jkn->ijn", root, root) / size)
    turn = np.stack([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(COUNT)], axis=-1)
    place = SensorPose(rng.normal(0, 300, (3, COUNT)), turn, rng.normal(0, 50, (3, COUNT)))
    weights = rng.dirichlet(np.ones(len(sizes)), COUNT).T
    return rng, xs, ps, weights, rng.uniform(0.05, 3.0, COUNT), place


def looks(rng, kind, x, place):
    """Measurements near what one model expects, with unequal noises, and the functions behind."""
    rows = [0, 1, *([2] if kind.has_range else []), *([3] if kind.has_range_rate else [])]
    r = np.array([0.004, 0.01, 20.0, 2.0])[rows, None] ** 2 * rng.uniform(
        0.3, 3, (len(rows), COUNT)
    )

    def h(n):
        return lambda s: plain.seen(
            s, place.position_m[:, n], place.velocity_m_s[:, n], place.to_body[:, :, n],
            kind.has_range, kind.has_range_rate,
        )  # fmt: skip

    z = np.stack([h(n)(x[:, n]) for n in range(COUNT)], axis=-1)
    return z + 2.0 * np.sqrt(r) * rng.normal(size=z.shape), r, h


PARAMETERS = InteractingParameters(
    models=("velocity", "turn", "acceleration"), acceleration_intensity_m2_s3=0.7,
    turn_acceleration_intensity_m2_s3=0.3, turn_rate_intensity_deg2_s3=0.8,
    jerk_intensity_m2_s5=0.4, start_turn_deg_s=4.0, start_acceleration_m_s2=2.0,
    transition_rates_per_s=((0, 0.02, 0.07), (0.3, 0, 0.05), (0.11, 0.13, 0)),
)  # fmt: skip
DEGREE = math.pi / 180


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_interacting_filters(kind):
    estimator = estimator_of(InteractingModels, PARAMETERS)
    rng, xs, ps, mu, dt, place = cases(sizes_of(estimator), KINDS.index(kind))
    ahead = estimator.predict(Estimates(xs, ps, mu), dt)
    z, r, h = looks(rng, kind, ahead[0][0], place)
    every = np.arange(COUNT)
    moments = estimator.expect(kind, ahead, place)
    said = pair_measurement(moments, every, z, r, None, ahead[2])
    after = estimator.update(ahead, every, said, every)
    nis = mixture_innovation_squared(said, ahead[2], every)
    mixture = log_mixture(ahead[2], said.log_likelihoods)
    whole = mixture_moments(after)
    fresh = [0.0, (4.0 * DEGREE) ** 2, 4.0]
    q = [(0.7, 0.0), (0.3, 0.8 * DEGREE**2), (0.4, 0.0)]
    for n in range(COUNT):
        x, p, w = plain.mixed([a[:, n] for a in xs], [a[:, :, n] for a in ps], mu[:, n],
                              PARAMETERS.transition_rates_per_s, dt[n], fresh)  # fmt: skip
        new, like, spreads, apart = [], [], [], []
        for j in range(3):
            f = plain.slope(lambda s, t=dt[n]: plain.move(s, t), x[j])
            p[j] = f @ p[j] @ f.T + plain.noise(len(x[j]), dt[n], *q[j])
            x[j] = plain.move(x[j], dt[n])
            new.append(plain.corrected(x[j], p[j], h(n), z[:, n], r[:, n]))
            like.append(new[j][3])
            jacobian = plain.slope(h(n), x[j])
            spreads.append(jacobian @ p[j] @ jacobian.T + np.diag(r[:, n]))
            apart.append(plain.wrapped(z[:, n] - h(n)(x[j])))
            assert np.allclose(ahead[0][j][:, n], x[j], rtol=1e-7, atol=1e-6)
            assert np.allclose(ahead[1][j][:, :, n], p[j], rtol=1e-5, atol=1e-6)
            assert np.allclose(after[0][j][:, n], new[j][0], rtol=1e-6, atol=1e-5)
            assert np.allclose(after[1][j][:, :, n], new[j][1], rtol=1e-4, atol=1e-5)
        assert said.distance[n] == pytest.approx(min(one[2] for one in new), rel=1e-5)
        assert mixture[n] == pytest.approx(math.log(w @ like), abs=1e-5)
        assert np.allclose(ahead[2][:, n], w, rtol=1e-9)
        mean = sum(a * e for a, e in zip(w, apart, strict=True))
        total = sum(a * (s + np.outer(e - mean, e - mean))
                    for a, s, e in zip(w, spreads, apart, strict=True))  # fmt: skip
        assert nis[n] == pytest.approx(mean @ np.linalg.solve(total, mean), rel=1e-4)
        odds = w * np.array(like) / (w @ like)
        assert np.allclose(after[2][:, n], odds, rtol=1e-4, atol=1e-9)
        mean = sum(a * one[0][:6] for a, one in zip(odds, new, strict=True))
        spread = sum(a * (one[1][:6, :6] + np.outer(one[0][:6] - mean, one[0][:6] - mean))
                     for a, one in zip(odds, new, strict=True))  # fmt: skip
        assert np.allclose(whole[0][:, n], mean, rtol=1e-5, atol=1e-4)
        assert np.allclose(whole[1][:, :, n], spread, rtol=1e-3, atol=1e-3)


def test_rates_by_default_leave_every_model_after_a_quarter_of_a_minute():
    for models in (("velocity", "turn"), ("turn", "velocity", "acceleration")):
        estimator = estimator_of(InteractingModels, InteractingParameters(models=models))
        for i, name in enumerate(models):
            leaves = sum(estimator.rates_per_s[i][j] for j in range(len(models)) if j != i)
            assert leaves == pytest.approx(1 / 15), name


@pytest.mark.parametrize("shape", [(1.0, 2.0, 0.0), (0.4, 1.5, 1.0)], ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_unscented_filter(kind, shape):
    keys = dict(zip(("alpha", "beta", "kappa"), shape, strict=True))
    estimator = estimator_of(
        Unscented, UnscentedParameters(acceleration_intensity_m2_s3=0.7, **keys)
    )
    rng, xs, ps, mu, dt, place = cases([6], 7)
    ahead = estimator.predict(Estimates(xs, ps, mu), dt)
    z, r, h = looks(rng, kind, ahead[0][0], place)
    every = np.arange(COUNT)
    said = pair_measurement(estimator.expect(kind, ahead, place), every, z, r, None, mu)
    after = estimator.update(ahead, every, said, every)
    for n in range(COUNT):
        f = plain.slope(lambda s, t=dt[n]: plain.move(s, t), xs[0][:, n])
        x, p = plain.move(xs[0][:, n], dt[n]), f @ ps[0][:, :, n] @ f.T
        p = p + plain.noise(6, dt[n], 0.7)
        assert np.allclose(ahead[1][0][:, :, n], p, rtol=1e-6, atol=1e-6)
        state, spread, nis = plain.unscented(x, p, h(n), z[:, n], r[:, n], shape)
        assert np.allclose(after[0][0][:, n], state, rtol=1e-7, atol=1e-6)
        assert np.allclose(after[1][0][:, :, n], spread, rtol=1e-6, atol=1e-6)
        assert said.distance[n] == pytest.approx(nis, rel=1e-6)


def test_shares_of_detections_by_all_joint_events():
    rng = np.random.default_rng(3)
    for _ in range(40):
        weights = np.exp(rng.normal(0, 3, (3, 3))) * (rng.uniform(size=(3, 3)) < 0.7)
        expected = plain.shares(weights)
        assert np.allclose(exact_pair_probabilities(weights), expected, rtol=1e-9, atol=1e-12)
        track, detection = np.nonzero(weights)
        found = pair_probabilities(track, detection, weights[track, detection])
        assert np.allclose(found, expected[track, detection], rtol=1e-9, atol=1e-12)


def test_models_move_alone_as_they_do_together():
    estimator = estimator_of(InteractingModels, PARAMETERS)
    _, xs, ps, _, dt, _ = cases(sizes_of(estimator), 11)
    for model, x, p in zip(estimator.models, xs, ps, strict=True):
        moved, _ = predict(model, x, p, dt)
        for n in range(COUNT):
            assert np.allclose(moved[:, n], plain.move(x[:, n], dt[n]), rtol=1e-10, atol=1e-8)
