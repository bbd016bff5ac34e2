"""One detection for one track: the nearest in turn, or the assignment that is best for all.

Pairs are those whose detection lies in the gate of the track. Both rules return which pairs are
taken; no track and no detection is in two of them.
"""

import numpy as np

from components.association.clusters import alone, groups, labels
from dsa_des.arrays.types import FloatArray, IntArray


def nearest(track: IntArray, detection: IntArray, distance: FloatArray) -> IntArray:
    """Take the nearest pair, then the nearest of what is left, and so on.

    Parameters
    ----------
    track, detection : (pairs,)
    distance : (pairs,)
        Squared Mahalanobis distances; among equal ones the earlier pair counts.

    Returns
    -------
    ndarray of int
        Pairs that are taken, ascending.
    """
    taken = [np.flatnonzero(alone(track, detection))]
    left = np.flatnonzero(~alone(track, detection))
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


def global_nearest(
    track: IntArray, detection: IntArray, distance: FloatArray, missing: FloatArray | float
) -> IntArray:
    """Take the pairs whose sum of distances, with a price for tracks left out, is the least.

    Parameters
    ----------
    track, detection : (pairs,)
    distance : (pairs,)
        Squared Mahalanobis distances or other costs.
    missing : (pairs,) or float
        Price of a track going without; at least the largest distance in the gate. All tracks that
        compete have the same, the largest of theirs: else a wide gate, which costs more to leave
        empty, would take detections from narrow ones.

    Returns
    -------
    ndarray of int
        Pairs that are taken, ascending. Clusters are solved one by one (Jonker-Volgenant, in
        `scipy.optimize.linear_sum_assignment`); a cluster of one pair is taken as it is.
    """
    single = alone(track, detection)
    taken = [np.flatnonzero(single)]
    left = np.flatnonzero(~single)
    price = np.broadcast_to(missing, distance.shape)
    for part in groups(labels(track[left], detection[left])):
        pairs = left[part]
        taken.append(pairs[_solved(track[pairs], detection[pairs], distance[pairs], price[pairs])])
    return np.sort(np.concatenate(taken))


def _solved(
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
    found = pair[linear_sum_assignment(cost)]
    return np.sort(found[found >= 0])
