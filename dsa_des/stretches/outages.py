"""When blocks are out: failures and repairs drawn for every run, and what is lost by them."""

from collections.abc import Mapping, Sequence

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks, last_position_at_or_before
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.failure_counts import SECONDS_FAILED
from dsa_des.stretches.outage import Outage
from dsa_des.time.randomness import Streams
from dsa_des.time.timeline_runs import Runs

# So many failures of each run are drawn at a time.
_AT_ONCE = 32


class Outages:
    """Random failures and repairs of one block in every run, from all outages that concern it.

    An outage lasts from a failure to the repair and the restart. Its block does not run then, and
    what comes over its wires is lost; what it remembers it still does afterwards. In the other
    modes it runs, and wrong values come out of it.
    """

    def __init__(
        self, failing: Sequence[Outage], streams: Streams, runs: Runs, ticks_per_s: int
    ) -> None:
        self._runs, self._ticks_per_s = runs, ticks_per_s
        self._failing = failing
        self._edges = [self._draw_outages(one, streams) for one in failing]
        self._freezes = any(one.mode == "frozen" for one in failing)
        #: The last good row of each run, by output.
        self._last: dict[str, Message] = {}

    def _draw_outages(self, one: Outage, streams: Streams) -> RunTicks:
        """Return the alternating ticks of failure and return to service, run after run."""
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

    def is_up(self, instants: RunTicks) -> BoolArray:
        """Return a mask of the instants, True where the block runs, False in a silent outage."""
        return ~self._is_failed_in_mode("silent", instants)

    def _is_failed_in_mode(self, mode: str, instants: RunTicks) -> BoolArray:
        """Return a mask of the instants, True where the block has failed in this mode."""
        failed = np.zeros(len(instants), dtype=bool)
        for one, edges in zip(self._failing, self._edges, strict=True):
            if one.mode == mode:
                failed |= _is_in_outage(edges, instants)
        return failed

    def corrupt_output(self, port: str, message: Message) -> Message:
        """Return the message really sent: with stuck bits and frozen values in such outages."""
        for one, edges in zip(self._failing, self._edges, strict=True):
            for quantity, worth in one.stuck.items():
                message = message.with_stuck_bit(
                    _is_in_outage(edges, message.instants), quantity, worth
                )
        return self._freeze_rows(port, message) if self._freezes else message

    def _freeze_rows(self, port: str, message: Message) -> Message:
        """Return the message with frozen rows as their run's last good row; remember those rows."""
        before = [self._last[port]] if port in self._last else []
        known = sum(map(len, before))
        both = message.concatenate([*before, message])
        good = np.append(np.ones(known, bool), ~self._is_failed_in_mode("frozen", message.instants))
        order = np.argsort(both.run, kind="stable")
        run, place = both.run[order], np.arange(len(order))
        last = np.maximum.accumulate(np.where(good[order], place, -1))
        here = (last >= 0) & (run[last] == run)
        source = np.empty(len(order), dtype=np.int64)
        source[order] = np.where(here, order[last], -1)
        latest = source[order[np.append(run[1:] != run[:-1], True)]]
        self._last = {**self._last, port: both.take(latest[latest >= 0])}
        if good.all():
            return message
        later = both.tick[known:] - both.tick[source[known:]]
        return message.repeat_rows(both, source[known:], later / self._ticks_per_s)

    def drop_arrivals_during_outage(self, wake: Wake) -> Wake:
        """Return a wake without the messages that arrived while the block was out."""
        arrived: dict[str, list[Arrivals]] = {}
        for port, every in wake._arrived.items():
            for new in every:
                rows = np.flatnonzero(self.is_up(new.instants))
                if len(rows):
                    part = Arrivals(new.source, new.instants.take(rows), new.message.take(rows))
                    arrived.setdefault(port, []).append(part)
        return wake.select_rows(np.arange(len(wake)), arrived) if wake._arrived else wake

    def outage_spans(self, run: int) -> IntArray:
        """Return a run's spans of ticks [start, end) of outage, (spans, 2), sorted and merged."""
        spans = np.concatenate([e.tick.reshape(self._runs.count, -1)[run] for e in self._edges])
        return merge_spans(spans.reshape(-1, 2), int(self._runs.ends[run]))

    def failure_counts(self) -> Mapping[str, IntArray]:
        """Return one kind of failure → (2, runs): seconds of outage, and seconds of the run."""
        ends = self._runs.ends
        each = map(self.outage_spans, range(self._runs.count))
        out = [int((spans[:, 1] - spans[:, 0]).sum()) for spans in each]
        seconds = np.rint(np.array([out, ends]) / self._ticks_per_s).astype(np.int64)
        return {SECONDS_FAILED: seconds}


def _is_in_outage(edges: RunTicks, instants: RunTicks) -> BoolArray:
    """Return which instants lie in an outage (mask); `edges` alternate failures and repairs."""
    last = last_position_at_or_before(edges, instants)
    there = (last >= 0) & (edges.run[last] == instants.run)
    # Failures are even, as every run has as many.
    out: BoolArray = there & (last % 2 == 0)
    return out


def merge_spans(spans: IntArray, end: int) -> IntArray:
    """Return spans of ticks (spans, 2), cut at `end`, sorted, merged if they overlap or touch."""
    first, last = np.minimum(spans[np.argsort(spans[:, 0], kind="stable")], end).T
    reached = np.maximum.accumulate(last)
    new = np.append(True, first[1:] > reached[:-1])[: len(first)]
    ends = reached[np.append(new[1:], True)[: len(first)]]
    whole = np.stack([first[new], ends], axis=1)
    return whole[whole[:, 1] > whole[:, 0]]
