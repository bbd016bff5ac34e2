"""One detection for one track: the nearest in turn, or the assignment that is best for all.

Pairs are those whose detection lies in the gate of the track. Both rules return which pairs are
taken; no track and no detection is in two of them. Clusters of tracks and detections that share
gates are decided apart from all others.
"""

import math
from functools import lru_cache

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


@lru_cache(maxsize=64)
def squared_gate_distance(probability: float, size: int) -> float:
    """Return the squared Mahalanobis distance within which a detection of `size` quantities lies
    with this probability.
    """
    low, high = 0.0, 1.0
    while 1.0 - probability < _chi_square_survival(high, size):
        high *= 2.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return high
        if 1.0 - probability < _chi_square_survival(middle, size):
            low = middle
        else:
            high = middle


def _chi_square_survival(distance: float, size: int) -> float:
    """Return a chi-square variable's probability (`size` degrees of freedom) of exceeding this."""
    half = 0.5 * distance
    total = 0.0 if size % 2 == 0 else math.erfc(math.sqrt(half))
    term = math.exp(-half) * (1.0 if size % 2 == 0 else math.sqrt(half) / math.gamma(1.5))
    power = 1.0 if size % 2 == 0 else 1.5
    for _ in range(size // 2):
        total += term
        term *= half / power
        power += 1.0
    return total


def is_only_pair_of_both(track: IntArray, detection: IntArray) -> BoolArray:
    """Return whether each pair is the only one both of its track and of its detection."""
    if len(track) == 0:
        return np.zeros(0, dtype=bool)
    tracks, detections = np.bincount(track), np.bincount(detection)
    return np.asarray((tracks[track] == 1) & (detections[detection] == 1))


def cluster_labels(track: IntArray, detection: IntArray) -> IntArray:
    """Return each pair's label: the least track number in its cluster of tracks and detections."""
    if len(track) == 0:
        return np.zeros(0, dtype=np.int64)
    of_track = np.arange(int(track.max()) + 1)
    while True:
        of_detection = np.full(int(detection.max()) + 1, len(of_track))
        np.minimum.at(of_detection, detection, of_track[track])
        lower = of_track.copy()
        np.minimum.at(lower, track, of_detection[detection])
        if np.array_equal(lower, of_track):
            return of_track[track]
        of_track = lower


def pair_indices_by_cluster(label: IntArray) -> list[IntArray]:
    """Return for each cluster the indices of its pairs, ascending; clusters are sorted by label."""
    if len(label) == 0:
        return []
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    return np.split(order, cuts)


def greedy_pair_indices(track: IntArray, detection: IntArray, distance: FloatArray) -> IntArray:
    """Return pairs chosen greedily (indices): repeatedly the closest free track and detection."""
    taken = [np.flatnonzero(is_only_pair_of_both(track, detection))]
    left = np.flatnonzero(~is_only_pair_of_both(track, detection))
    left = left[np.argsort(distance[left], kind="stable")]
    while len(left):
        # The first pair of its track and of its detection is taken whatever the others are.
        first = np.zeros((2, len(left)), dtype=bool)
        for side, numbers in zip(first, (track[left], detection[left]), strict=True):
            side[np.unique(numbers, return_index=True)[1]] = True
        chosen = left[first.all(axis=0)]
        taken.append(chosen)
        left = left[~np.isin(track[left], track[chosen])]
        left = left[~np.isin(detection[left], detection[chosen])]
    return np.sort(np.concatenate(taken))


def least_total_pair_indices(
    track: IntArray, detection: IntArray, distance: FloatArray, missing: FloatArray | float
) -> IntArray:
    """Return the indices of pairs of least total distance; an unpaired track costs `missing`."""
    single = is_only_pair_of_both(track, detection)
    taken = [np.flatnonzero(single)]
    left = np.flatnonzero(~single)
    price = np.broadcast_to(missing, distance.shape)
    for part in pair_indices_by_cluster(cluster_labels(track[left], detection[left])):
        pairs = left[part]
        taken.append(
            pairs[
                _least_cost_pair_indices(
                    track[pairs], detection[pairs], distance[pairs], price[pairs]
                )
            ]
        )
    return np.sort(np.concatenate(taken))


def _least_cost_pair_indices(
    track: IntArray, detection: IntArray, distance: FloatArray, price: FloatArray
) -> IntArray:
    from scipy.optimize import linear_sum_assignment

    tracks, row = np.unique(track, return_inverse=True)
    detections, column = np.unique(detection, return_inverse=True)
    # Costs may be negative, and so may prices: more than all that can be saved.
    never = 1.0 + 2.0 * float(np.abs(distance).sum() + np.abs(price).sum())
    cost = np.full((len(tracks), len(detections) + len(tracks)), never)
    cost[row, column] = distance
    cost[np.arange(len(tracks)), len(detections) + np.arange(len(tracks))] = price.max()
    pair = np.full(cost.shape, -1, dtype=np.int64)
    pair[row, column] = np.arange(len(track))
    result = pair[linear_sum_assignment(cost)]
    return np.sort(result[result >= 0])
