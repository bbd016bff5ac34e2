"""Searches among instants of several runs, against a search through a list."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dsa_des.arrays.run_ticks import (
    RunTicks,
    first_position_at_or_after,
    first_position_in_runs,
    is_shared_single_run,
    last_position_at_or_before,
    rank_instants,
    shared_zero_run_numbers,
    union_of_instants,
)

FAR = 2**61
pairs = st.lists(st.tuples(st.integers(0, 3), st.integers(-2, 6)), max_size=12)
scales = st.sampled_from([1, 10**9, FAR // 8])  # the last is beyond what one number can hold


def of(found, scale=1):
    array = np.array(found, dtype=np.int64).reshape(-1, 2)
    return RunTicks(array[:, 0], array[:, 1] * scale)


def as_list(instants):
    return list(zip(instants.run.tolist(), instants.tick.tolist(), strict=True))


@settings(derandomize=True, deadline=None, max_examples=200)
@given(known=pairs.map(sorted), asked=pairs.map(sorted), scale=scales)
def test_the_last_of_its_own_run(known, asked, scale):
    rows = last_position_at_or_before(of(known, scale), of(asked, scale))
    for (run, tick), row in zip(asked, rows.tolist(), strict=True):
        there = [k for k, (other, t) in enumerate(known) if other == run and t <= tick]
        assert row == (there[-1] if there else -1)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(known=pairs.map(sorted), asked=pairs, scale=scales)
@example(known=[(1, 0)], asked=[(1, 0), (0, 1), (1, 0)], scale=1)
def test_the_first_at_or_after(known, asked, scale):
    instants = of(known, scale)
    rows = first_position_at_or_after(instants, of(asked, scale))
    assert rows.tolist() == [sum(one < pair for one in known) for pair in asked]
    of_run = first_position_in_runs(instants, np.array([run for run, _ in asked], dtype=np.int64))
    assert of_run.tolist() == [sum(one[0] < run for one in known) for run, _ in asked]
    assert [
        instants.count_before_run_tick(run, tick * scale) for run, tick in asked
    ] == rows.tolist()


@settings(derandomize=True, deadline=None, max_examples=200)
@given(parts=st.lists(pairs, min_size=1, max_size=3), scale=scales)
def test_union_order_and_ranks(parts, scale):
    every = sorted({pair for part in parts for pair in part})
    united = union_of_instants([of(sorted(part), scale) for part in parts])
    assert as_list(united) == as_list(of(every, scale))
    for part in parts:
        instants = of(part, scale)
        order = instants.sort_indices()
        assert as_list(instants if order is None else instants.take(order)) == as_list(
            of(sorted(part), scale)
        )
    found, count = rank_instants(*(of(part, scale) for part in parts))
    assert count == len(every)
    wanted = [[every.index(pair) for pair in part] for part in parts]
    assert [rank.tolist() for rank in found] == wanted


@settings(derandomize=True, deadline=None, max_examples=100)
@given(scale=scales, found=pairs)
def test_the_newest_so_far_of_each_run(found, scale):
    found = sorted(found, key=lambda pair: pair[0])
    newest = of(found, scale).running_largest_tick()
    for k, (run, _) in enumerate(found):
        so_far = max(t for other, t in found[: k + 1] if other == run)
        assert newest.tick[k] == scale * so_far


@settings(derandomize=True, deadline=None, max_examples=100)
@given(found=pairs.map(sorted))
def test_where_runs_begin_and_end(found):
    instants, runs = of(found), sorted({run for run, _ in found})
    firsts = [min(k for k, (other, _) in enumerate(found) if other == run) for run in runs]
    lasts = [max(k for k, (other, _) in enumerate(found) if other == run) for run in runs]
    assert instants.first_position_of_runs.tolist() == firsts
    assert instants.last_position_of_runs.tolist() == lasts
    assert instants.is_one_run == (len(runs) <= 1)


@pytest.mark.parametrize("rows", [slice(1, 3), np.array([2, 0]), np.array([True, False, True])])
def test_a_single_run_needs_no_column(rows):
    instants = RunTicks.of_run(0, np.array([4, 5, 9]))
    assert is_shared_single_run(instants.run) and is_shared_single_run(instants.take(rows).run)
    joined = RunTicks.concatenate([instants, instants])
    assert is_shared_single_run(joined.run) and joined.run.tolist() == [0] * 6
    assert not is_shared_single_run(RunTicks.of_run(2, np.array([4])).run)
    assert shared_zero_run_numbers(0).tolist() == []
