"""When an aircraft sends: at random intervals, each aircraft by a clock of its own.

Every interval between two messages is uniform in 0.4 to 0.6 s (RTCA DO-260B, 2.2.3.3.2), drawn by
the aircraft and the message's number; the first message comes as if the aircraft had been sending
for ever. When message n is sent is a sum of n draws: a function of the key alone, whatever was
asked before. The sums are kept for every 16th message, so that an instant late in a run of days
costs no more than the messages sent since the last one that was asked for.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.randomness import Stream

SHORTEST_S, LONGEST_S = 0.4, 0.6
_CHUNK = 16
_MOST_CHUNKS = 4096
_LONGEST_NS = 0.6 * NANOSECONDS
_SHORTEST_NS, _SPREAD_NS = 0.4 * NANOSECONDS, 0.2 * NANOSECONDS


def message_intervals_ns(uniform: FloatArray) -> IntArray:
    """Return random intervals between messages in whole ns, one for each uniform draw."""
    return np.asarray(np.rint(_SHORTEST_NS + _SPREAD_NS * uniform), dtype=np.int64)


def first_message_ns(uniform: FloatArray, share: FloatArray) -> IntArray:
    """Return the instant, ns, of a run's first message for clocks that have run for long.

    The interval that a given instant lies in is longer than others, by its length; the instant lies
    anywhere in it.
    """
    low, high = SHORTEST_S**2, LONGEST_S**2
    length_s = np.sqrt(low + (high - low) * uniform)
    return np.asarray(np.rint(share * length_s * NANOSECONDS), dtype=np.int64)


class SquitterClocks:
    """Random sending instants of one kind of message, reproducible by run and aircraft."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        #: When the first message of each chunk is sent, by draw key and run, ns.
        self._starts: dict[tuple[int, int], array[int]] = {}

    def latest_messages(
        self, keys: npt.NDArray[np.uint64], run: IntArray, until_ns: IntArray, count: int
    ) -> tuple[IntArray, IntArray, BoolArray]:
        """Return number, sending instant (ns) and existence of the last `count` messages (at most
        16) that each aircraft sent up to an instant.

        Aircraft are given by draw key and run, (n,). Numbers and instants in ns of the run,
        (n, count), are newest first, with whether there was one since the start of the run.
        """
        n = len(keys)
        first, start_ns = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        cells = zip(keys.tolist(), run.tolist(), until_ns.tolist(), strict=True)
        for cell, (key, of, until) in enumerate(cells):
            starts = self._chunk_starts(key, of, until)
            # The chunk before the one that the instant lies in.
            chunk = max(bisect_right(starts, until) - 2, 0)
            first[cell], start_ns[cell] = chunk * _CHUNK, starts[chunk]
        numbers = first[:, np.newaxis] + np.arange(2 * _CHUNK)
        instants = self._sending_instants_ns(keys, run, start_ns, numbers)
        newest = (instants <= until_ns[:, np.newaxis]).sum(axis=1) - 1
        index = newest[:, np.newaxis] - np.arange(count)
        sent: BoolArray = index >= 0
        index = np.maximum(index, 0)
        return (
            np.take_along_axis(numbers, index, 1),
            np.take_along_axis(instants, index, 1),
            sent,
        )

    def _sending_instants_ns(
        self,
        keys: npt.NDArray[np.uint64],
        run: IntArray,
        start_ns: IntArray,
        numbers: IntArray,
    ) -> IntArray:
        """Return consecutive messages' sending instants (n, m), ns, the first at `start_ns`."""
        later = numbers[:, 1:]
        each = later.shape[1]
        stream = self._stream.of_runs(np.repeat(run, each))
        drawn = stream.uniform(np.repeat(keys, each), later.reshape(-1))
        steps = message_intervals_ns(drawn).reshape(later.shape)
        return np.cumsum(np.concatenate([start_ns[:, np.newaxis], steps], axis=1), axis=1)

    def _chunk_starts(self, key: int, run: int, until_ns: int) -> array[int]:
        """Return when an aircraft's message chunks begin, ns, to the first after `until_ns`."""
        keys, runs = np.array([key], dtype=np.uint64), np.array([run])
        starts = self._starts.get((key, run))
        if starts is None:
            stream, first = self._stream.of_runs(runs), np.zeros(1, dtype=np.int64)
            length, share = (stream.uniform(keys, first, draw) for draw in (1, 2))
            starts = array("q", first_message_ns(length, share).tolist())
            self._starts[key, run] = starts
        while starts[-1] <= until_ns:
            chunks = int((until_ns - starts[-1]) / (_LONGEST_NS * _CHUNK)) + 1
            count = min(chunks, _MOST_CHUNKS) * _CHUNK
            numbers = (len(starts) - 1) * _CHUNK + np.arange(count + 1)[np.newaxis]
            later = self._sending_instants_ns(keys, runs, np.array(starts[-1:]), numbers)
            starts.extend(later[0, _CHUNK::_CHUNK].tolist())
        return starts
