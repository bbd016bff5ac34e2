"""Shares, means and differences of a study's runs, from tables written by hand."""

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from dsa_des.results.record import NUMBER, SHARE, TRIALS, Result
from dsa_des.results.summary import compare_axis
from tests.results.conftest import rows_of_table


def table(**columns: list) -> pa.Table:
    count = len(next(iter(columns.values())))
    done = {"error": pa.nulls(count, pa.string()), "status": ["done"] * count}
    return pa.table({**done, **columns})


NUMBERED, SHARED = Result("x", NUMBER, "a number"), Result("x", SHARE, "a share")


def test_a_difference_is_the_value_less_the_baseline_run_by_run():
    """Runs of a place may stand in any order; pairs are those of one replica."""
    replica = [0, 1, 2, 3, 3, 1, 0, 2]
    value = [1.0, 4.0, 2.0, 8.0, 9.1, 5.2, 2.0, 2.9]
    rows = rows_of_table(table(rate=[5] * 4 + [7] * 4, replica=replica, x=value), ["rate"], [])
    (found,) = compare_axis(rows, "rate", 5, [NUMBERED], 0.95, "t")
    first, second = np.array([1.0, 4.0, 2.0, 8.0]), np.array([2.0, 5.2, 2.9, 9.1])
    expected = stats.ttest_rel(second, first).confidence_interval(0.95)
    assert (found.value, found.baseline) == (7, 5)
    assert found.difference.paired.value == pytest.approx(np.mean(second - first))
    interval = (found.difference.paired.low, found.difference.paired.high)
    assert interval == pytest.approx((expected.low, expected.high))


def test_a_share_is_weighed_by_trials_and_a_run_without_one_has_none():
    runs = table(replica=[0, 1, 2], x=[1.0, float("nan"), 0.5], **{"x" + TRIALS: [2.0, 5.0, 4.0]})
    found, missing = rows_of_table(runs, [], []).estimate(SHARED, np.arange(3), 0.95, "t")
    assert found.value == pytest.approx(4.0 / 6.0)
    assert (found.count, missing) == (2, 1)


def test_runs_of_one_encounter_are_one_unit():
    """Two encounters of three runs each: the mean is of two means."""
    runs = table(file=["a"] * 3 + ["b"] * 3, replica=[0, 1, 2] * 2, x=[1, 2, 3, 10.0, 20.0, 30.0])
    rows = rows_of_table(runs, ["file"], ["file"])
    found, _ = rows.estimate(NUMBERED, np.arange(6), 0.95, "t")
    assert (found.value, found.count) == (pytest.approx(11.0), 2)
    expected = stats.ttest_1samp([2.0, 20.0], 0.0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
