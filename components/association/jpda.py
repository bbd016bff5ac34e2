"""Joint probabilistic data association: how likely each detection is of each track.

A joint event gives every track at most one detection and every detection at most one track; its
weight is the product of the weights of its pairs, where a track left out weighs 1. Marginals are
exact in clusters of up to a stated number of detections (a sum over sets of used detections, not
over events); in larger ones they come from loopy belief propagation, which converges and is close.

Sources: Fortmann, Bar-Shalom, Scheffe, IEEE J. Oceanic Eng. 8 (1983); Williams, Lau,
*Approximate evaluation of marginal association probabilities with belief propagation*, IEEE Trans.
AES 50 (2014).
"""

import numpy as np

from components.association.assignment import cluster_labels, pair_indices_by_cluster
from dsa_des.arrays.types import FloatArray, IntArray

#: Detections in a cluster up to which marginals are exact: a sum over 2^10 sets for each track.
EXACT_UP_TO = 10

_SETTLED = 1e-12
_MOST_ROUNDS = 10_000


def pair_probabilities(
    track: IntArray, detection: IntArray, weight: FloatArray, exact_up_to: int = EXACT_UP_TO
) -> FloatArray:
    """Return pairs' joint association probabilities; a track's sum to 1 with that of its miss."""
    result = np.empty(len(track))
    if len(track) == 0:
        return result
    # A detection in one gate only ties no tracks together: its track is decided in closed form.
    shared = np.bincount(detection)[detection] > 1
    mixed_up = np.zeros(int(track.max()) + 1, dtype=bool)
    mixed_up[track[shared]] = True
    simple = ~mixed_up[track]
    total = 1.0 + np.bincount(track[simple], weights=weight[simple], minlength=len(mixed_up))
    result[simple] = weight[simple] / total[track[simple]]
    left = np.flatnonzero(~simple)
    for part in pair_indices_by_cluster(cluster_labels(track[left], detection[left])):
        pairs = left[part]
        tracks, row = np.unique(track[pairs], return_inverse=True)
        detections, column = np.unique(detection[pairs], return_inverse=True)
        weights = np.zeros((len(tracks), len(detections)))
        weights[row, column] = weight[pairs]
        solve = (
            exact_pair_probabilities
            if len(detections) <= exact_up_to
            else approximate_pair_probabilities
        )
        result[pairs] = solve(weights)[row, column]
    return result


def exact_pair_probabilities(weights: FloatArray) -> FloatArray:
    """Return exact probabilities of the pairs of one cluster, (tracks, detections), from weights
    relative to a miss, 0 for no pair.
    """
    many, count = weights.shape
    sets = 1 << count
    free = [np.flatnonzero((np.arange(sets) >> j & 1) == 0) for j in range(count)]
    # Each track's largest factor is taken out: products of many stay in range.
    scale = np.maximum(weights.max(axis=1), 1.0)
    scaled, nothing = weights / scale[:, np.newaxis], 1.0 / scale
    before = np.zeros((many + 1, sets))
    before[0, 0] = 1.0
    for i in range(many):
        before[i + 1] = before[i] * nothing[i]
        for j in np.flatnonzero(scaled[i]).tolist():
            before[i + 1, free[j] | 1 << j] += before[i, free[j]] * scaled[i, j]
    after = np.ones((many + 1, sets))
    for i in range(many - 1, -1, -1):
        after[i] = after[i + 1] * nothing[i]
        for j in np.flatnonzero(scaled[i]).tolist():
            after[i, free[j]] += after[i + 1, free[j] | 1 << j] * scaled[i, j]
    result = np.zeros_like(weights)
    for i in range(many):
        for j in np.flatnonzero(scaled[i]).tolist():
            together = before[i, free[j]] * after[i + 1, free[j] | 1 << j]
            result[i, j] = scaled[i, j] * together.sum() / after[0, 0]
    return result


def approximate_pair_probabilities(weights: FloatArray) -> FloatArray:
    """Return a cluster's approximate pair probabilities (tracks, detections) by belief propagation.

    Within 0.1 of exact ones in most clusters; where several tracks share the same detections and
    misses are rare it is too sure of one way round.
    """
    message = np.ones_like(weights)
    for _ in range(_MOST_ROUNDS):
        product = weights * message
        out = weights / (1.0 + product.sum(axis=1, keepdims=True) - product)
        new = 1.0 / (1.0 + out.sum(axis=0, keepdims=True) - out)
        settled = float(np.abs(new - message).max()) < _SETTLED
        message = new
        if settled:
            break
    product = weights * message
    return np.asarray(product / (1.0 + product.sum(axis=1, keepdims=True)))
