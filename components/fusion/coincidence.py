"""The detection of a sensor that belongs to an instant and a target.

Both rules return, for every (instant, target) asked about, the entry of the sensor's detections
that counts there, or -1.
"""

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.block.wake import Arrivals


def same_instant(keys: IntArray, asked: IntArray) -> IntArray:
    """Return the entry detected at exactly the same instant.

    Parameters
    ----------
    keys : (entries,)
        Instant and target of every detection as one ascending number.
    asked : (n,)
        The same for what is asked about; holds every one of `keys`.
    """
    entry = np.full(len(asked), -1, dtype=np.int64)
    if len(keys):
        entry[asked.searchsorted(keys)] = np.arange(len(keys))
    return entry


def latest_in_gate(
    arrivals: Arrivals, ticks: IntArray, targets: IntArray, gate_ticks: int
) -> IntArray:
    """Return the latest entry that arrived at the instant or at most `gate_ticks` before it.

    Parameters
    ----------
    arrivals : Arrivals
        The sensor's detections, reaching back at least one gate.
    ticks, targets : (n,)
        Instants and targets asked about.
    gate_ticks : int
        The bound is inclusive.
    """
    counts = np.diff(arrivals.message.offsets)
    if not counts.any():
        return np.full(len(ticks), -1, dtype=np.int64)
    # Ranks of instants stay small where ticks times targets would overflow.
    instants, rank = np.unique(np.concatenate([arrivals.tick, ticks]), return_inverse=True)
    span = len(instants)
    entry_tick = np.repeat(arrivals.tick, counts)
    entry_key = arrivals.message.target * span + np.repeat(rank[: len(arrivals.tick)], counts)
    order = np.argsort(entry_key, kind="stable")
    asked = targets * span + rank[len(arrivals.tick) :]
    place = np.searchsorted(entry_key[order], asked, side="right") - 1
    entry = order[np.maximum(place, 0)]
    fits = (
        (place >= 0)
        & (arrivals.message.target[entry] == targets)
        & (ticks - entry_tick[entry] <= gate_ticks)
    )
    return np.where(fits, entry, -1)
