"""Rows of messages can be cut and joined anywhere, and a channel shows only what has arrived."""

import itertools

import engine_blocks as blocks
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.message import Message, Text
from dsa_des.block.wake import Wake
from dsa_des.running.channel import Channel

RAGGED_ROWS = st.lists(st.lists(st.integers(0, 99), max_size=4), min_size=1, max_size=12)


def ragged(rows, first_tick=0):
    """Return a message with one row per list."""
    entries = np.array([value for row in rows for value in row], dtype=np.int64)
    counts = [len(row) for row in rows]
    return blocks.Ragged(
        tick=first_tick + np.arange(len(rows), dtype=np.int64),
        offsets=np.concatenate(([0], np.cumsum(counts))).astype(np.int64),
        value=np.array([sum(row) for row in rows], dtype=float),
        entry=entries,
        columns={"twice": 2 * entries, "none": None},
        label="same",
    )


def rows_in(message):
    """Return the rows of a ragged message as lists, checking that its columns agree."""
    o = message.offsets
    assert o[0] == 0 and len(o) == len(message) + 1
    assert len(message.entry) == o[-1] == len(message.columns["twice"])
    assert np.array_equal(message.columns["twice"], 2 * message.entry)
    assert message.columns["none"] is None
    assert message.label == "same"
    rows = [message.entry[a:b].tolist() for a, b in itertools.pairwise(o)]
    assert message.value.tolist() == [sum(row) for row in rows]
    return rows


@settings(derandomize=True, deadline=None, max_examples=100)
@given(rows=RAGGED_ROWS, data=st.data())
def test_taking_rows_takes_their_entries(rows, data):
    message = ragged(rows)
    count = len(rows)
    start, stop = (
        data.draw(st.integers(-count - 2, count + 2)),
        data.draw(st.integers(-3, count + 2)),
    )
    step = data.draw(st.sampled_from([None, 1, 2, 3]))
    cut = slice(start, stop, step)
    assert rows_in(message.take(cut)) == rows[cut]
    index = data.draw(st.lists(st.integers(0, count - 1), max_size=8))
    taken = message.take(np.array(index, dtype=np.int64))
    assert rows_in(taken) == [rows[i] for i in index]
    assert taken.tick.tolist() == index
    assert rows_in(message) == rows


@settings(derandomize=True, deadline=None, max_examples=100)
@given(rows=RAGGED_ROWS, cuts=st.lists(st.integers(0, 12), max_size=4))
def test_cutting_and_joining_gives_the_message_back(rows, cuts):
    message = ragged(rows)
    bounds = [0, *sorted(min(cut, len(rows)) for cut in cuts), len(rows)]
    parts = [message.take(slice(a, b)) for a, b in itertools.pairwise(bounds)]
    whole = blocks.Ragged.concatenate(parts)
    assert rows_in(whole) == rows
    assert whole.tick.tolist() == message.tick.tolist()
    # Parts of a joined message can be joined again.
    again = blocks.Ragged.concatenate([whole.take(np.array([len(rows) - 1])), whole])
    assert rows_in(again) == [rows[-1], *rows]


def test_taking_everything_is_free_and_a_slice_is_a_view():
    message = ragged([[1], [2, 3], []])
    assert message.take(slice(None)) is message
    assert np.shares_memory(message.take(slice(1, 3)).entry, message.entry)


def test_static_fields_follow_the_latest_part():
    old, new = ragged([[1]]), ragged([[2]], 1)
    old.label = "before the first message"
    assert blocks.Ragged.concatenate([old, new]).label == "same"


def test_a_message_cannot_be_written_in_a_scene_unless_it_says_how():
    with pytest.raises(ValueError, match="Message cannot be written in a scene"):
        Message.make_initial({})


def test_text_is_codes_into_names():
    assert len(Text(np.array([0, -1, 1]), ("a", "b"))) == 3


def beats(ticks, start=0):
    ticks = np.array(ticks, dtype=np.int64)
    return blocks.beat(ticks, start + np.arange(len(ticks)))


def at(ticks):
    return RunTicks.of_run(0, np.array(ticks))


def test_a_channel_hands_each_row_over_once_and_not_before_it_arrives():
    channel = Channel("radar")
    channel.push(beats([0, 10, 20, 30]))
    channel.push(beats([40], start=4))
    came, message = channel.pop_arrived_rows(20)
    assert came.tick.tolist() == [0, 10] and message.value.tolist() == [0, 1]
    assert channel.pop_arrived_rows(20) is None
    assert channel.arrivals_before(41).tick.tolist() == [20, 30, 40]
    came, message = channel.pop_arrived_rows(41)
    assert came.tick.tolist() == [20, 30, 40] and message.value.tolist() == [2, 3, 4]
    assert channel.arrivals_before(10**6).tick.tolist() == []


def test_what_is_superseded_before_anybody_can_ask_is_forgotten():
    """Scenario: three messages wait, the next instant that may be sampled is 25."""
    channel, whole = Channel("source"), Channel("source")
    for part in (beats([0, 10]), beats([20, 21], start=2), beats([30, 40], start=4)):
        channel.push(part)
        whole.push(part)
        channel.drop_superseded_rows(25)
    assert len(channel.state()[0]) == 2  # that of 0 and 10 is gone
    asked = at([25, 35, 40])
    (got, rows), (expected, places) = (
        channel.held_rows_at_instants(asked, 50),
        whole.held_rows_at_instants(asked, 50),
    )
    assert got.tick[rows].tolist() == expected.tick[places].tolist() == [21, 30, 40]


def test_a_delay_moves_the_arrival_and_not_what_the_row_speaks_of():
    channel = Channel("radar", delay_ticks=7)
    assert channel.push(beats([0, 10])).tick.tolist() == [7, 17]
    assert channel.pop_arrived_rows(7) is None
    came, message = channel.pop_arrived_rows(8)
    assert came.tick.tolist() == [7] and message.tick.tolist() == [0]


def test_sampling_holds_the_last_arrived_row():
    channel = Channel("radar", delay_ticks=5)
    asked = at([0, 4, 5, 6, 14, 15, 100])
    assert channel.held_rows_at_instants(asked, 101) is None
    channel.push(beats([0, 10]))
    message, rows = channel.held_rows_at_instants(asked, 101)
    held = [None if row < 0 else message.value[row] for row in rows]
    assert held == [None, None, 0, 0, 0, 1, 1]
    message, rows = channel.held_rows_at_instants(at([200, 201]), 202)
    assert message.value[rows].tolist() == [1, 1]


def test_what_a_channel_holds_before_the_first_row():
    channel = Channel("radar")
    channel.set_held_message(beats([0], start=9), 0)
    channel.push(beats([10]))
    message, rows = channel.held_rows_at_instants(at([0, 9, 10]), 11)
    assert message.value[rows].tolist() == [9, 9, 0]


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    sent=st.lists(st.integers(0, 40), min_size=1, max_size=12, unique=True).map(sorted),
    batches=st.integers(1, 4),
    delay=st.integers(0, 9),
    asked=st.lists(st.integers(0, 60), min_size=1, max_size=12, unique=True).map(sorted),
    windows=st.lists(st.integers(0, 60), max_size=4),
)
def test_sampling_in_windows_equals_looking_back_over_a_list(sent, batches, delay, asked, windows):
    channel = Channel("radar", delay)
    size = -(-len(sent) // batches)
    for start in range(0, len(sent), size):  # all deposited ahead of time
        channel.push(beats(sent[start : start + size], start))
    found = []
    bounds = [0, *sorted(windows), 61]
    for a, b in itertools.pairwise(bounds):
        ticks = np.array([t for t in asked if a <= t < b], dtype=np.int64)
        if len(ticks):
            sample = channel.held_rows_at_instants(at(ticks), b)
            rows = np.full(len(ticks), -1) if sample is None else sample[1]
            found += [None if r < 0 else sample[0].value[r] for r in rows]
    expected = []
    for t in asked:
        arrived = [i for i, tick in enumerate(sent) if tick + delay <= t]
        expected.append(arrived[-1] if arrived else None)
    assert found == expected


def test_a_simulation_that_has_run_says_that_it_runs_once(lab):
    run = lab.run(lab.write({"a": "Pulse; scan_rate_hz = 4", "b": "Relay"}, ['"a -> b"']))
    with pytest.raises(RuntimeError, match="a simulation runs once"):
        run.simulation.run()


def test_a_wake_without_a_clock_has_no_scans_before_it():
    instants = RunTicks(np.array([0, 0, 1]), np.array([3, 7, 5]))
    wake = Wake(instants, np.array([0, 1, 0]), 10, {}, {})
    assert wake.previous_scan_tick.tolist() == [-1, -1, -1] and wake.time_s.tolist() == [
        0.3,
        0.7,
        0.5,
    ]
    asked = []
    clocked = Wake(
        instants, np.array([4, 5, 9]), 10, {}, {},
        clock=lambda scans, runs: asked.append((scans, runs)) or 100 * runs + scans - 1,
    )  # fmt: skip
    assert clocked.previous_scan_tick.tolist() == [3, 4, 108] and len(asked) == 1
