"""Who belongs to whom, against enumeration of everything that may be."""

import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from components.association.assignment import (
    greedy_pair_indices,
    least_total_pair_indices,
    squared_gate_distance,
)
from components.association.jpda import (
    approximate_pair_probabilities,
    exact_pair_probabilities,
    pair_probabilities,
)


def events(tracks, detections):
    """Yield every joint event as a tuple: each track's detection, or -1."""
    for event in itertools.product(range(-1, detections), repeat=tracks):
        used = [d for d in event if d >= 0]
        if len(used) == len(set(used)):
            yield event


def enumerated(weights):
    found, total = np.zeros_like(weights), 0.0
    for event in events(*weights.shape):
        product = np.prod([weights[t, d] for t, d in enumerate(event) if d >= 0])
        total += product
        for t, d in enumerate(event):
            if d >= 0:
                found[t, d] += product
    return found / total


@pytest.mark.parametrize("probability", [0.9, 0.997])
def test_gates_hold_their_probability(probability):
    for size in (1, 2, 3, 4, 5):
        assert chi2.cdf(squared_gate_distance(probability, size), size) == pytest.approx(
            probability
        )


def test_the_textbook_s_two_targets():
    """Two tracks that see both detections alike: seven joint events, three of them a miss."""
    track, detection = np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])
    found = pair_probabilities(track, detection, np.ones(4))
    np.testing.assert_allclose(found, 2 / 7)
    assert round(1 - found[:2].sum(), 4) == 0.4286


def test_exact_marginals_are_those_of_enumeration():
    rng = np.random.default_rng(2)
    for tracks, detections in [(1, 3), (2, 2), (3, 2), (3, 4), (4, 4)]:
        weights = 10.0 ** rng.uniform(-3, 5, (tracks, detections))
        weights[rng.uniform(size=weights.shape) < 0.3] = 0.0
        np.testing.assert_allclose(
            exact_pair_probabilities(weights), enumerated(weights), rtol=1e-12, atol=1e-300
        )


def test_many_clusters_together_are_each_decided_alone():
    rng = np.random.default_rng(5)
    track, detection, weight, known = [], [], [], []
    for cluster in range(12):
        weights = 10.0 ** rng.uniform(-2, 2, (3, 3)) * (rng.uniform(size=(3, 3)) < 0.6)
        known += enumerated(weights)[weights > 0].tolist()
        t, d = np.nonzero(weights)
        track += (3 * cluster + t).tolist()
        detection += (3 * cluster + d).tolist()
        weight += weights[weights > 0].tolist()
    found = pair_probabilities(np.array(track), np.array(detection), np.array(weight))
    np.testing.assert_allclose(found, known, rtol=1e-12)


def test_propagation_is_close_and_exact_where_nothing_is_shared():
    rng = np.random.default_rng(9)
    single = 10.0 ** rng.uniform(-1, 3, (1, 6))
    np.testing.assert_allclose(
        approximate_pair_probabilities(single), exact_pair_probabilities(single), rtol=1e-9
    )
    for _ in range(20):
        weights = 10.0 ** rng.uniform(-1, 2, (4, 5)) * (rng.uniform(size=(4, 5)) < 0.5)
        assert np.abs(approximate_pair_probabilities(weights) - enumerated(weights)).max() < 0.1


def best(tracks, detections, cost, missing):
    """Return the least total cost of any event."""
    return min(
        sum(missing if d < 0 else cost.get((t, d), np.inf) for t, d in enumerate(event))
        for event in events(tracks, detections)
    )


def test_the_global_assignment_costs_least_and_the_nearest_goes_in_turn():
    rng = np.random.default_rng(11)
    greedy_lost = 0
    for _ in range(60):
        tracks, detections, gate = 4, 4, 9.0
        cost = {
            (t, d): float(c)
            for t in range(tracks)
            for d in range(detections)
            if (c := rng.uniform(0, 20)) < gate
        }
        track, detection = (np.array([k[i] for k in cost], dtype=int) for i in (0, 1))
        distance = np.array(list(cost.values()))
        taken = least_total_pair_indices(track, detection, distance, gate)
        assert len(set(track[taken])) == len(set(detection[taken])) == len(taken)
        total = distance[taken].sum() + gate * (tracks - len(taken))
        assert total == pytest.approx(best(tracks, detections, cost, gate))
        near, used = [], set()
        for pair in sorted(cost, key=cost.__getitem__):
            if ("t", pair[0]) not in used and ("d", pair[1]) not in used:
                near.append(pair)
                used |= {("t", pair[0]), ("d", pair[1])}
        got = greedy_pair_indices(track, detection, distance)
        assert sorted(zip(track[got], detection[got], strict=True)) == sorted(near)
        greedy_lost += distance[got].sum() + gate * (tracks - len(got)) > total + 1e-9
    assert greedy_lost > 0


def test_the_global_assignment_lives_with_costs_below_zero():
    """ln|S| of angles is -28: prices and costs are negative, and still the least sum is taken."""
    rng = np.random.default_rng(12)
    for _ in range(20):
        track, detection = np.nonzero(rng.uniform(size=(3, 3)) < 0.7)
        if len(track) == 0:
            continue
        cost = rng.uniform(0.0, 9.0, len(track)) - 28.0
        price = 11.0 - 28.0
        taken = least_total_pair_indices(track, detection, cost, price)
        assert len(set(track[taken])) == len(set(detection[taken])) == len(taken)
        total = cost[taken].sum() + price * (len(set(track)) - len(taken))
        known = dict(zip(zip(track.tolist(), detection.tolist(), strict=True), cost, strict=True))
        rows = sorted(set(track.tolist()))
        renamed = {(rows.index(t), d): c for (t, d), c in known.items()}
        assert total == pytest.approx(best(len(rows), 3, renamed, price))


def test_a_wide_gate_takes_no_detection_from_a_narrow_one():
    """Leaving the wide one empty is no dearer: the detection goes to whom it is likelier."""
    wide, narrow = 0, 1
    track, detection = np.array([wide, narrow]), np.array([0, 0])
    cost = np.array([1.0 + 6.0, 2.0 - 6.0])  # squared distance and ln|S|
    price = np.array([9.0 + 6.0, 9.0 - 6.0])  # the gate and ln|S|
    assert track[least_total_pair_indices(track, detection, cost, price)].tolist() == [narrow]
