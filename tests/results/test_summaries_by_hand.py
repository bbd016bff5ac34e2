"""Shares, means and differences of a study's runs, from tables written by hand."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from dsa_des.commands.what_changed import ConditionPair, print_changes
from dsa_des.costs.replay import median_and_half_iqr
from dsa_des.results.differences import _agresti_caffo_difference, estimate_difference
from dsa_des.results.record import NUMBER, SHARE, TRIALS, Result
from dsa_des.results.statistics import estimate_rare_probability
from dsa_des.results.summary import compare_axis, summarise
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


def test_no_interval_reaches_beyond_what_values_can_be():
    """Of distances with one far from all others, whose interval by Student is a wide one."""
    values = [0.1, 0.2, 0.1, 0.3, 9.0]
    rows = rows_of_table(table(replica=[0, 1, 2, 3, 4], x=values), [], [])
    plain = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert plain.low < 0.0 and plain.high > 4.0
    bounds = {
        (None, None): (plain.low, plain.high), (0.0, None): (0.0, plain.high),
        (None, 4.0): (plain.low, 4.0), (0.0, 100.0): (0.0, plain.high),
    }  # fmt: skip
    for (least, most), expected in bounds.items():
        result = Result("x", NUMBER, "a distance", least=least, most=most)
        (line,) = summarise(rows, [result], 0.95, "t", {})
        assert (line.estimate.low, line.estimate.high) == pytest.approx(expected)
        assert line.estimate.value == pytest.approx(np.mean(values))
    alone = rows_of_table(table(replica=[0], x=[3.0]), [], [])
    (line,) = summarise(alone, [Result("x", NUMBER, "a distance", least=0.0)], 0.95, "t", {})
    assert line.estimate.value == 3.0 and np.isnan([line.estimate.low, line.estimate.high]).all()


ROUNDED = [0.1 + 0.2, 1e6 / 3.0 * 3.0, 7.0, 0.7 + 0.1]
EXACT = [0.3, 1e6, 7.0, 0.8]


def said_of(first, second, capsys):
    runs = table(rate=[1] * 4 + [2] * 4, replica=[0, 1, 2, 3] * 2, x=[*first, *second])
    tables = SimpleNamespace(rows=rows_of_table(runs, ["rate"], []))
    sides = ConditionPair(tables, np.arange(4), tables, np.arange(4, 8))
    print_changes(("a", "b"), [("", sides)], [NUMBERED])
    return capsys.readouterr().out


def test_what_differs_by_rounding_only_has_not_changed(capsys):
    assert EXACT != ROUNDED
    assert "1 other results are the same in every run" in said_of(EXACT, ROUNDED, capsys)
    assert "changed: x" in said_of(EXACT, [*ROUNDED[:3], 0.81], capsys)
    found = estimate_difference(np.array(EXACT), np.array(ROUNDED), 0.95)
    assert (found.paired.value, found.paired.low, found.paired.high) == (0.0, 0.0, 0.0)
    assert found.unpaired.value == 0.0
    # Small numbers that differ are no rounding, whatever their size.
    small = estimate_difference(1e-20 * np.array(EXACT), 2e-20 * np.array(EXACT), 0.95)
    assert small.paired.value == pytest.approx(1e-20 * np.mean(EXACT))


def test_medians_and_half_the_quartiles_distance() -> None:
    """Of 1, 2, 4, 8 and 16 the quartiles are 2 and 8; of 1 and 3 they are 1.5 and 2.5."""
    assert median_and_half_iqr([16.0, 1.0, 8.0, 2.0, 4.0]) == (4.0, 3.0)
    assert median_and_half_iqr([3.0, 1.0]) == (2.0, 0.5)
    assert median_and_half_iqr([7.0]) == (7.0, 0.0)
    assert np.isnan(median_and_half_iqr([])).all()


def test_the_mean_of_rare_probabilities_by_hand() -> None:
    """Student's t of one degree is 12.706; half of it times the distance is the half-width."""
    nan, some = float("nan"), np.array([1e-4, float("nan"), 3e-4])
    found = estimate_rare_probability(some, np.full(3, 1e-3), 0.95)
    factor = np.exp(12.7062 * 1e-4 / 2e-4)
    assert (found.value, found.count) == (pytest.approx(2e-4), 2)
    assert found.low == pytest.approx(2e-4 / factor, rel=1e-4)
    assert found.high == pytest.approx(2e-4 * factor, rel=1e-4)
    # Ten of 1 ± s are as sure as ten events where s is 1, for s / sqrt(10) = 1 / sqrt(10).
    for size, few in ((0.94, False), (0.96, True)):
        ten = estimate_rare_probability(1.0 + size * np.tile([-1.0, 1.0], 5), np.ones(10), 0.95)
        assert ten.few == few
    alone = estimate_rare_probability(np.array([1e-4, nan]), np.full(2, 1e-3), 0.95)
    assert alone.value == 1e-4 and np.isnan([alone.low, alone.high]).all()
    # None was seen in two: 3.689 events are as rare as an end may err; each adds 0.002 to one.
    none = estimate_rare_probability(np.zeros(2), np.array([1e-3, 3e-3]), 0.95)
    assert (none.value, none.low) == (0.0, 0.0)
    assert none.high == pytest.approx(-np.log(0.025) * 2e-3 / 2)


def test_shares_are_told_apart_as_if_one_more_had_been_counted_of_either_kind() -> None:
    """Of 4 runs 1 and 4: 2 of 6 and 5 of 6, whose variances are 2/9 and 5/36, over 6 each."""
    found = _agresti_caffo_difference(np.array([0.0, 1.0, 0.0, 0.0]), np.ones(4), 0.95)
    half = 1.959964 * np.sqrt((2.0 / 9.0 + 5.0 / 36.0) / 6.0)
    assert (found.value, found.count, found.few) == (0.75, 4, True)
    assert (found.low, found.high) == pytest.approx((0.5 - half, 0.5 + half), rel=1e-6)
