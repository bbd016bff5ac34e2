"""Wires that are not perfect: messages that come late, or not at all."""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.time.clock import nanosecond_of
from dsa_des.time.randomness import Stream


@dataclass(frozen=True)
class WireFaults:
    """Keyed faults of one wire; a row's fate depends on the wire and on its instant only.

    Parameters
    ----------
    jitter_ticks : float
        Largest extra delay; each row takes a uniformly drawn part of it.
    drop_probability : float
    jitter, drops : Stream
        Draws named after the wire.
    ticks_per_s : int
    """

    jitter_ticks: float
    drop_probability: float
    jitter: Stream
    drops: Stream
    ticks_per_s: int

    def kept(self, ticks: IntArray) -> BoolArray:
        """Return which rows sent at `ticks` are not lost."""
        return self._drawn(self.drops, ticks) >= self.drop_probability

    def lateness(self, ticks: IntArray) -> IntArray:
        """Return the extra delay of the rows sent at `ticks`, in ticks."""
        return np.rint(self._drawn(self.jitter, ticks) * self.jitter_ticks).astype(np.int64)

    def _drawn(self, stream: Stream, ticks: IntArray) -> FloatArray:
        instant = nanosecond_of(ticks, self.ticks_per_s).astype(np.uint64)
        return stream.uniform(instant, 0)
