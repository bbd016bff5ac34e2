"""What an input holds in each replica, by the rows that came there before, one by one."""

import numpy as np
import pytest

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.message import Message
from dsa_des.running.channel import Channel
from dsa_des.running.windows import Windows
from dsa_des.time.timeline_runs import Runs

RUN_TICKS = 60


def as_held(runs, sent, asked, longest, horizon=None, *, initial=False):
    """Whether every replica holds at each tick that it asks about what came there last."""
    channel = Channel("source", 0, None, runs)
    if initial:
        channel.set_held_message(Message(np.array([-1])), -1)
        sent = [[-1, *ticks] for ticks in sent]
    windows = Windows(runs, longest, horizon)
    told = 0

    def inside(ticks, start, end):
        found = [(k, t) for k in runs.going for t in ticks[k] if start <= t < end]
        return RunTicks(*np.array(found, dtype=np.int64).reshape(-1, 2).T)

    while (window := windows.next()) is not None:
        start, end = window[:2]
        new, now = inside(sent, start, end), inside(asked, start, end)
        if len(new):
            channel.push(Message(new.tick, run=new.run))
        found = channel.held_rows_at_instants(now, end) if len(now) else None
        rows = np.full(len(now), -1) if found is None else found[1]
        for run, tick, row in zip(now.run, now.tick, rows, strict=True):
            came = [(run, t) for t in sent[run] if t <= tick]
            got = None
            if found is not None and row >= 0:
                got = int(found[0].run[row]), int(found[0].tick[row])
            assert got == (max(came) if came else None), (run, tick)
            told += got is not None
        windows.commit(window, None)
    return told


@pytest.mark.parametrize("ended", [(), (2,), (0, 2)])
def test_what_came_long_ago_is_held_beside_a_replica_that_is_told_all_the_time(ended):
    """The first asks at the instants at which it is told, for longer than rows pile up."""
    runs = Runs(4, RUN_TICKS)
    for replica in ended:
        runs.note_ends(RunTicks.of_run(replica, np.array([40])), "over")
    last = [40 if replica in ended else RUN_TICKS for replica in range(4)]
    sent = [range(last[0]), [3], [0, 5], [2, 30]]
    asked = [range(last[0]), [50, 58], [5], [30, 55]]
    assert as_held(runs, sent, asked, 1, 4) == last[0] + 5


@pytest.mark.parametrize("step", [1, 7, 64, 300])
def test_what_came_at_the_very_start_is_held_to_the_end_of_its_run(step):
    """One replica runs after the other, or some at a time."""
    runs = Runs(3, RUN_TICKS)
    sent, asked = [[0], [4], [0, 20]], [range(0, RUN_TICKS, 3)] * 3
    assert as_held(runs, sent, asked, step) == 20 + 18 + 20


def drawn_ticks(random):
    """Draw some instants, ascending: none, a few or most of a run's."""
    count = random.choice([0, 1, 3, RUN_TICKS // 2])
    return np.sort(random.choice(RUN_TICKS, count, replace=False)).tolist()


@pytest.mark.parametrize("seed", range(120))
def test_whatever_comes_each_replica_holds_what_came_last(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 6))
    runs = Runs(count, RUN_TICKS)
    sent, asked = ([drawn_ticks(random) for _ in range(count)] for _ in range(2))
    # All at a time, some, or one; the last ones may be fewer, down to a single one.
    longest = RUN_TICKS * int(random.integers(1, count + 1))
    horizon = random.choice([None, 1, 7])
    as_held(runs, sent, asked, longest, horizon, initial=bool(random.integers(2)))
