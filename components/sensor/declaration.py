"""Declaration of targets: after m detections in the last n looks.

Looks before the first one count as misses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray = NDArray[np.bool_]


def no_looks_yet(n: int, targets: int) -> BoolArray:
    """Return the memory before the first look: shape (targets, n - 1), all misses.

    Raises
    ------
    ValueError
        If `n` is not a whole number from 1 on, or `targets` is negative.
    """
    _checked_rule(1, n)
    if targets < 0:
        raise ValueError(f"targets is {targets}: it must be 0 or more")
    return np.zeros((targets, n - 1), dtype=bool)


def declare(detected: ArrayLike, m: int, n: int, memory: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Say at which looks targets are declared, when every target is looked at in every scan.

    Parameters
    ----------
    detected : (scans, targets) array_like of bool
        Whether a target was detected in a scan; scans in order of time.
    m, n : int
        A target is declared at a look if m or more of the last n looks (this one included)
        detected it, 1 <= m <= n.
    memory : (targets, n - 1) array of bool
        The looks before, oldest first; `no_looks_yet`, or what the last call returned.

    Returns
    -------
    declared : (scans, targets) array of bool
    memory : (targets, n - 1) array of bool
        To hand in with the next scans: any division into calls gives the same declarations.

    Raises
    ------
    ValueError
        If m or n is out of range or the shapes do not fit.
    """
    looks = np.asarray(detected, dtype=bool)
    if looks.ndim != 2:
        raise ValueError(f"detected has the shape {looks.shape}: it must be (scans, targets)")
    scans, targets = looks.shape
    target = np.tile(np.arange(targets), scans)
    declared, after = declare_looks(target, looks.reshape(-1), m, n, memory)
    return declared.reshape(scans, targets), after


def declare_looks(
    target: ArrayLike, detected: ArrayLike, m: int, n: int, memory: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Say at which looks targets are declared, when not every scan looks at every target.

    Only looks count: a scan that did not look at a target neither helps nor ages its detections.

    Parameters
    ----------
    target : (looks,) array_like of int
        Number of the target of each look, 0 to targets - 1.
    detected : (looks,) array_like of bool
        Each target's looks in order of time.
    m, n, memory
        As for `declare`.

    Returns
    -------
    declared : (looks,) array of bool
    memory : (targets, n - 1) array of bool

    Raises
    ------
    ValueError
        If m or n is out of range, the shapes do not fit or a target is outside the memory.
    """
    _checked_rule(m, n)
    past = np.asarray(memory, dtype=bool)
    if past.ndim != 2 or past.shape[1] != n - 1:
        raise ValueError(f"memory has the shape {past.shape}: it must be (targets, {n - 1})")
    who, seen = np.asarray(target, dtype=np.int64), np.asarray(detected, dtype=bool)
    if who.ndim != 1 or who.shape != seen.shape:
        raise ValueError(
            f"target has the shape {who.shape} and detected {seen.shape}: both must be (looks,)"
        )
    targets = len(past)
    if who.size and not (who.min() >= 0 and who.max() < targets):
        wrong = int(who[(who < 0) | (who >= targets)][0])
        raise ValueError(f"target is {wrong}: it must be a whole number from 0 to {targets - 1}")
    # Each target's memory and then its looks, one target after the other.
    order = np.argsort(who, kind="stable")
    looks = np.bincount(who, minlength=targets)
    length = looks + (n - 1)
    first = np.cumsum(length) - length
    place = np.empty(len(who), dtype=np.int64)
    rank = np.arange(len(who)) - np.repeat(np.cumsum(looks) - looks, looks)
    place[order] = np.repeat(first + (n - 1), looks) + rank
    line = np.zeros(int(length.sum()), dtype=np.int64)
    kept = first[:, np.newaxis] + np.arange(n - 1)
    line[kept] = past
    line[place] = seen
    count = np.concatenate(([0], np.cumsum(line)))
    declared = count[place + 1] - count[place + 1 - n] >= m
    after = line[kept + looks[:, np.newaxis]].astype(bool)
    return declared, after


def _checked_rule(m: int, n: int) -> None:
    for name, value in (("n", n), ("m", m)):
        if isinstance(value, bool) or int(value) != value or value < 1:
            raise ValueError(f"{name} is {value!r}: it must be a whole number of 1 or more")
    if m > n:
        raise ValueError(f"m is {m}: it must be at most n, {n}")
