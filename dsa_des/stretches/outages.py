"""When blocks are out: failures and repairs drawn for every run, and what is lost by them."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks, last_of_run
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.undone import SECONDS_OUT
from dsa_des.time.randomness import Streams
from dsa_des.time.runs import Runs

# So many failures of each run are drawn at a time.
_AT_ONCE = 32


class Failing(Protocol):
    """What is known of something that fails: means and times in s, and what keys its draws."""

    @property
    def key(self) -> str:
        """What its draws are keyed by."""

    mean_between_s: float
    mean_repair_s: float
    restart_s: float


class Outages:
    """When a block is out, in every run: whenever one of what it depends on is.

    An outage lasts from a failure to the repair and the restart. Its block does not run then, and
    what comes over its wires is lost; what it remembers it still does afterwards.
    """

    def __init__(
        self, failing: Sequence[Failing], streams: Streams, runs: Runs, ticks_per_s: int
    ) -> None:
        self._runs, self._ticks_per_s = runs, ticks_per_s
        self._edges = [self._drawn(one, streams) for one in failing]

    def _drawn(self, one: Failing, streams: Streams) -> RunTicks:
        """Return when it fails and is back, in turns, of the first run, the second, and so on."""
        stream = streams.stream("[outages]", one.key)
        count, lasts_s = self._runs.count, self._runs.run_ticks / self._ticks_per_s
        now_s = np.zeros((count, 1))
        parts: list[FloatArray] = []
        while now_s.min() < lasts_s:
            run, number = np.divmod(np.arange(count * _AT_ONCE), _AT_ONCE)
            number += _AT_ONCE * len(parts)
            drawn = [
                stream.of_runs(run).uniform(np.uint64(0), number, draw=which).reshape(count, -1)
                for which in (0, 1)
            ]
            fails_s = -one.mean_between_s * np.log1p(-drawn[0])
            lost_s = one.restart_s - one.mean_repair_s * np.log1p(-drawn[1])
            back_s = now_s + np.cumsum(fails_s + lost_s, axis=1)
            parts.append(np.stack([back_s - lost_s, back_s], axis=2).reshape(count, -1))
            now_s = back_s[:, -1:]
        # Both ends of an outage within one tick are none.
        ticks = np.rint(np.concatenate(parts, axis=1) * self._ticks_per_s)
        ticks = np.minimum(ticks, self._runs.run_ticks).astype(np.int64)
        width = ticks.shape[1]
        return RunTicks(np.repeat(np.arange(count), width), ticks.reshape(-1))

    def up(self, instants: RunTicks) -> BoolArray:
        """Return at which instants the block is not out."""
        up = np.ones(len(instants), dtype=bool)
        for edges in self._edges:
            last = last_of_run(edges, instants)
            there = (last >= 0) & (edges.run[last] == instants.run)
            # Failures are even, as every run has as many.
            up &= ~there | (last % 2 == 1)
        return up

    def heard(self, wake: Wake) -> Wake:
        """Return a wake without what arrived while the block was out."""
        arrived: dict[str, list[Arrivals]] = {}
        for port, every in wake._arrived.items():
            for new in every:
                rows = np.flatnonzero(self.up(new.instants))
                if len(rows):
                    part = Arrivals(new.source, new.instants.take(rows), new.message.take(rows))
                    arrived.setdefault(port, []).append(part)
        return wake.part(np.arange(len(wake)), arrived) if wake._arrived else wake

    def spans(self, run: int) -> IntArray:
        """Return when the block is out in a run, in order: first tick, and the first after it."""
        spans = np.concatenate([e.tick.reshape(self._runs.count, -1)[run] for e in self._edges])
        return merged(spans.reshape(-1, 2), int(self._runs.ends[run]))

    def undone(self) -> Mapping[str, IntArray]:
        """Return of how many seconds of each run the block was out, as counts (2, runs)."""
        ends = self._runs.ends
        each = map(self.spans, range(self._runs.count))
        out = [int((spans[:, 1] - spans[:, 0]).sum()) for spans in each]
        seconds = np.rint(np.array([out, ends]) / self._ticks_per_s).astype(np.int64)
        return {SECONDS_OUT: seconds}


def merged(spans: IntArray, end: int) -> IntArray:
    """Return spans of ticks (spans, 2) before an end, in order, those that touch as one."""
    first, last = np.minimum(spans[np.argsort(spans[:, 0], kind="stable")], end).T
    reached = np.maximum.accumulate(last)
    new = np.append(True, first[1:] > reached[:-1])[: len(first)]
    ends = reached[np.append(new[1:], True)[: len(first)]]
    whole = np.stack([first[new], ends], axis=1)
    return whole[whole[:, 1] > whole[:, 0]]
