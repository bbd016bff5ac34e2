"""Keyed random numbers of replicas in lock step: each row draws with its own replica's seed."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.randomness import Stream, Streams, UInt64Array, key_of
from dsa_des.time.timeline import split_scans


class ReplicaStream(Stream):
    """The draws of one block for one purpose in every replica.

    Parameters
    ----------
    seeds : sequence of int
        One for each replica.
    block, purpose : str
    """

    def __init__(self, seeds: Sequence[int], block: str, purpose: str) -> None:
        keys = np.array([key_of(seed, block, purpose) for seed in seeds], dtype=np.uint64)
        self._low = keys & np.uint64(0xFFFFFFFF)
        self._high = keys >> np.uint64(32)

    def of_rows(self, replica: IntArray) -> Stream:
        """Return the draws of rows of these replicas, one by one."""
        return _RowStream(self._low[replica], self._high[replica])

    def _key_and_scan(self, scans: IntArray) -> tuple[tuple[Any, Any], IntArray]:
        replica, numbers = split_scans(scans)
        return (self._low[replica], self._high[replica]), numbers


class _RowStream(Stream):
    """The draws of rows whose keys are known; every number of a scan's 48 bits counts."""

    def __init__(self, low: UInt64Array, high: UInt64Array) -> None:
        self._keys = low, high

    def _key_and_scan(self, scans: IntArray) -> tuple[tuple[Any, Any], IntArray]:
        return self._keys, scans


class ReplicaStreams(Streams):
    """All draws of replicas in lock step, by block and purpose."""

    def __init__(self, seeds: Sequence[int]) -> None:
        super().__init__(seeds[0])
        self.seeds = tuple(seeds)
        self._made = lru_cache(maxsize=None)(self._make)

    def _make(self, block: str, purpose: str) -> Stream:
        return ReplicaStream(self.seeds, block, purpose)

    def stream(self, block: str, purpose: str) -> Stream:
        """Return the stream of a block's purpose."""
        return self._made(block, purpose)

    def scan_normals(self, block: str, purpose: str) -> Callable[[IntArray], FloatArray]:
        """Refuse: the clocks of replicas are made one by one, each with its own seed."""
        raise TypeError("replicas in lock step have a clock each")
