"""The simplest classifier there is: a tree of depth 3, grown on one half and tried on the other."""

import numpy as np


def _gini(labels: np.ndarray) -> np.ndarray:
    """Impurity times count of the first n and of the rest, for each n."""
    ones = np.cumsum(labels)
    count = np.arange(1, len(labels) + 1)
    rest, rest_ones = len(labels) - count, ones[-1] - ones
    other = np.where(rest > 0, rest_ones * (rest - rest_ones) / np.maximum(rest, 1), 0.0)
    return ones * (count - ones) / count + other


def grown(values: np.ndarray, labels: np.ndarray, depth: int = 3):
    """Return a tree of (column, edge, below, above), or a leaf's share of ones."""
    leaf = labels.mean() if len(labels) else 0.5
    if depth == 0 or len(labels) < 20 or leaf in (0.0, 1.0):
        return leaf
    best = (np.inf, 0, 0.0)
    for column in range(values.shape[1]):
        order = np.argsort(values[:, column], kind="stable")
        ranked = values[order, column]
        cost = np.where(np.append(np.diff(ranked) > 0, False), _gini(labels[order]), np.inf)
        at = int(np.argmin(cost))
        if cost[at] < best[0]:
            best = (cost[at], column, 0.5 * (ranked[at] + ranked[at + 1]))
    if not np.isfinite(best[0]):
        return leaf
    below = values[:, best[1]] <= best[2]
    halves = (grown(values[part], labels[part], depth - 1) for part in (below, ~below))
    return best[1], best[2], *halves


def told(tree, row: np.ndarray) -> float:
    """Return the share of ones in a row's leaf."""
    while isinstance(tree, tuple):
        tree = tree[2] if row[tree[0]] <= tree[1] else tree[3]
    return tree


def separation(values: np.ndarray, labels: np.ndarray, seed: int = 0) -> float:
    """Return by how many standard deviations a tree beats chance on the half it has not seen.

    Of its guesses' mean for either label, which is the same where nothing tells them apart.
    """
    order = np.random.default_rng(seed).permutation(len(labels))
    train, test = order[::2], order[1::2]
    tree = grown(values[train], labels[train])
    guess = np.array([told(tree, row) for row in values[test]])
    ones, zeros = guess[labels[test] == 1], guess[labels[test] == 0]
    spread = np.sqrt(guess.var() * (1.0 / len(ones) + 1.0 / len(zeros)))
    return float((ones.mean() - zeros.mean()) / spread) if spread > 0.0 else 0.0
