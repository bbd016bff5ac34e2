"""Covariance intersection and changes of frame, against computations that are not the project's."""

import mpmath
import numpy as np
import pymap3d
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from components.estimation.covariance_intersection import intersect_covariances, inverse
from components.estimation.frame import frame_change
from components.estimation.motion import ConstantVelocity
from components.track_fusion.local_tracks import LocalTracks
from components.track_fusion.track_association import (
    MatchRules,
    gate_distance_ratio,
    reset_numbers_of_strays,
)


def covariances(seed, count):
    draw = np.random.default_rng(seed)
    root = draw.normal(size=(count, 6, 6)) * np.exp(draw.normal(size=(count, 6, 1)))
    return (root @ root.transpose(0, 2, 1)).transpose(1, 2, 0)


def cost(rule, first, second, weight):
    whole = weight * np.linalg.inv(first) + (1.0 - weight) * np.linalg.inv(second)
    if rule == "determinant":
        return -np.linalg.slogdet(whole)[1]
    return np.trace(np.linalg.inv(whole)[:3, :3])


@pytest.mark.parametrize("rule", ["determinant", "trace"])
def test_the_weight_is_that_of_a_numerical_minimum(rule):
    first, second = covariances(1, 12), covariances(2, 12)
    apart = np.random.default_rng(3).normal(size=(6, 12))
    information = inverse(second)
    pull = np.einsum("ijn,jn->in", information, apart)
    shift, spread, weight = intersect_covariances(first, information, pull, rule)
    inside = 0
    for k in range(12):
        p, q = first[..., k], second[..., k]
        best = minimize_scalar(
            lambda w, p=p, q=q: cost(rule, p, q, w), bounds=(0, 1), method="bounded",
            options={"xatol": 1e-10},
        )  # fmt: skip
        ends = min(cost(rule, p, q, w) for w in (0.0, 1.0))
        least = min(best.fun, ends)
        assert cost(rule, p, q, weight[k]) <= least + 1e-9 * abs(least)
        w = weight[k]
        inside += 0.0 < w < 1.0
        wanted = np.linalg.inv(w * np.linalg.inv(p) + (1 - w) * np.linalg.inv(q))
        np.testing.assert_allclose(spread[..., k], wanted, rtol=1e-7, atol=1e-9 * wanted.max())
        moved = wanted @ np.linalg.inv(q) @ apart[:, k] * (1 - w)
        np.testing.assert_allclose(shift[:, k], moved, rtol=1e-6, atol=1e-9)
    assert inside >= 6


def test_one_case_to_40_digits():
    """Axes that the two know better in turn, and one of which the second knows more."""
    first, second = np.diag([4.0, 1.0, 9.0, 1.0, 1.0, 2.0]), np.diag([1.0, 4.0, 2.0, 1.0, 3.0, 2.0])
    with mpmath.workdps(40):
        ratio = [mpmath.mpf(a) / mpmath.mpf(b) for a, b in zip(np.diag(first), np.diag(second),
                                                               strict=True)]  # fmt: skip
        wanted = mpmath.findroot(lambda w: sum((1 - r) / (w + (1 - w) * r) for r in ratio), 0.5)
    _, spread, weight = intersect_covariances(
        first[..., None], inverse(second[..., None]), np.zeros((6, 1)), "determinant"
    )
    assert weight[0] == pytest.approx(float(wanted), rel=1e-14)
    w = float(wanted)
    np.testing.assert_allclose(
        np.diag(spread[..., 0]), 1.0 / (w / np.diag(first) + (1 - w) / np.diag(second)), rtol=1e-13
    )


def test_independent_estimates_add_their_information():
    first, second = covariances(5, 3), covariances(6, 3)
    _, spread, _ = intersect_covariances(first, inverse(second), np.zeros((6, 3)), "independent")
    for k in range(3):
        wanted = np.linalg.inv(np.linalg.inv(first[..., k]) + np.linalg.inv(second[..., k]))
        np.testing.assert_allclose(spread[..., k], wanted, rtol=1e-7, atol=1e-9)


def test_a_frame_s_change_is_that_of_the_ellipsoid():
    old, new = (-41.3, 179.99, 2400.0), (-41.12, -179.86, 1100.0)
    change = frame_change(np.array(old)[:, None], np.array(new)[:, None])
    position, velocity = np.array([1200.0, -3400.0, 560.0]), np.array([12.0, -34.0, 5.6])
    there = pymap3d.ned2ecef(*position, *old)
    ends = pymap3d.ned2ecef(*(position + velocity), *old)
    wanted = np.array(pymap3d.ecef2ned(*there, *new))
    moved = np.array(pymap3d.ecef2ned(*ends, *new)) - wanted
    state = np.concatenate([position, velocity])[:, None]
    np.testing.assert_allclose(change.states(state)[:, 0], [*wanted, *moved], atol=2e-8)
    root = np.random.default_rng(4).normal(size=(6, 6))
    turn = np.kron(np.eye(2), change.turn[..., 0])
    wanted = turn @ (root @ root.T) @ turn.T
    np.testing.assert_allclose(
        change.covariances((root @ root.T)[..., None])[..., 0], wanted, atol=1e-12
    )


def tracks_of(**changes):
    """Three tracks of three trackers, of one fused track; the second and third less certain."""
    none, some = np.zeros(3), np.ones(3, dtype=int)
    columns = {
        "replica": 0 * some, "tracker": np.arange(3), "number": some, "system": 7 * some,
        "status": some, "existence": np.ones(3), "ranged": np.ones(3, dtype=bool),
        "state": np.zeros((6, 3)),
        "covariance": np.eye(6)[..., None] * np.array([4.0, 9.0, 9.0]), "azimuth_rad": none,
        "elevation_rad": none, "azimuth_variance_rad2": none, "elevation_variance_rad2": none,
        "own_m": np.zeros((3, 3)), "turn": np.eye(3)[..., None] * np.ones(3), "time_s": none,
        "updated_s": none, "contributors": some, "updated_by": some,
    }  # fmt: skip
    return LocalTracks(**columns | changes)


RULES = MatchRules(0.9, ConstantVelocity(1.0), 0.01, 3.0)


def test_a_member_leaves_beyond_three_times_its_gate():
    """The second track stands a hair within three times the gate, the third a hair beyond."""
    gate_m = np.sqrt(chi2.ppf(0.9, 6) * (4.0 + 9.0))
    state = np.zeros((6, 3))
    state[1] = [0.0, 2.99 * gate_m, 3.01 * gate_m]
    found = reset_numbers_of_strays(RULES, tracks_of(state=state), np.zeros(3))
    assert found.system.tolist() == [7, 7, 0]


def test_a_direction_leaves_beyond_three_times_its_own_gate():
    """It has two quantities, and the leader's place adds to its variance."""
    variance = np.full(3, 1e-4)
    gate_rad = np.sqrt(chi2.ppf(0.9, 2) * (1e-4 + 4.0 / 100.0**2))
    state = np.zeros((6, 3))
    state[0, 0] = 100.0
    tracks = tracks_of(
        state=state, ranged=np.array([True, False, False]), azimuth_variance_rad2=variance,
        azimuth_rad=np.array([0.0, 2.99, -3.01]) * gate_rad, elevation_variance_rad2=variance,
    )  # fmt: skip
    assert reset_numbers_of_strays(RULES, tracks, np.zeros(3)).system.tolist() == [7, 7, 0]


def test_a_pair_s_distance_is_its_own_whoever_stands_beside_it():
    random = np.random.default_rng(2)
    some = LocalTracks.concatenate([
        tracks_of(
            state=random.normal(0.0, 500.0, (6, 3)), ranged=random.random(3) < 0.5,
            azimuth_rad=random.uniform(-3.0, 3.0, 3), elevation_rad=random.uniform(-1.4, 1.4, 3),
            azimuth_variance_rad2=random.uniform(1e-4, 1e-2, 3), time_s=random.uniform(0.0, 1.0, 3),
            elevation_variance_rad2=random.uniform(1e-4, 1e-2, 3),
            own_m=random.normal(0.0, 50.0, (3, 3)),
        )
        for _ in range(4)
    ])  # fmt: skip
    pairs, when = np.triu_indices(12, 1), np.full(66, 1.5)

    def share(one, other):
        return gate_distance_ratio(RULES, some.take(one), some.take(other), when[: len(one)])

    together = share(*pairs)
    alone = [share(*(each[[k]] for each in pairs))[0] for k in range(66)]
    assert together == pytest.approx(alone, rel=1e-9)
    # Which of two leads counts where neither has a range alone: by whose elevation a turn counts.
    ranged = some.ranged[pairs[0]] | some.ranged[pairs[1]]
    assert share(*pairs[::-1])[ranged] == pytest.approx(together[ranged], rel=1e-9)
    assert np.count_nonzero(~ranged) > 5 and len(set(zip(*some.ranged[[*pairs]], strict=True))) == 4


def test_two_directions_may_have_turned_since_the_more_the_steeper():
    two = tracks_of(
        ranged=np.zeros(3, dtype=bool), azimuth_rad=np.array([0.1, 0.2, 0.0]),
        elevation_rad=np.array([1.2, 1.23, 0.0]), azimuth_variance_rad2=np.full(3, 1e-4),
        elevation_variance_rad2=np.full(3, 1e-4), time_s=np.array([1.0, 4.0, 0.0]),
    )  # fmt: skip
    first, second = (two.take(np.array([k])) for k in (0, 1))
    turned = (0.01 * 3.0) ** 2
    wanted = 0.1**2 / (2e-4 + turned / np.cos(1.2) ** 2) + 0.03**2 / (2e-4 + turned)
    found = gate_distance_ratio(RULES, first, second, np.array([4.0]))
    assert found[0] == pytest.approx(wanted / chi2.ppf(0.9, 2))
