"""Paired changes of hand-made rows: who is counted, and edge cases of events and values."""

import math
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy import stats

from dsa_des.answers.changes import PairedChange, changes_by_model, confidence_per_interval
from dsa_des.results.record import EVENT, NUMBER, RATIO, RatioOf, Result
from tests.results.conftest import rows_of_table

NAN = math.nan
RANGE = Result("range_m", NUMBER, "range, m", "cut_off")
EVENTS = Result("lost", EVENT, "lost")
RISK = Result("risk", RATIO, "risk", ratio=RatioOf("nominal", "lost"))
TAIL = Result("range_m", NUMBER, "range, m", quantile=0.9)


def change_of(
    result: Result, own: dict[str, list[Any]], other: dict[str, list[Any]], comparisons: int = 1
) -> PairedChange:
    """The change from some runs to the same ones with another model."""
    count = len(next(iter(own.values())))
    columns = {name: [*own[name], *other[name]] for name in own}
    table = pa.table(
        columns
        | {
            "model": ["as it is"] * count + ["other"] * count,
            "replica": [*range(count)] * 2,
            "error": pa.nulls(2 * count, pa.string()),
            "status": ["done"] * (2 * count),
        }
    )
    rows = rows_of_table(table, ["model"], [])
    (change,) = changes_by_model(rows, [result], 0.95, "t", comparisons)
    return change


def ranges(values: list[float], said: list[str | None] | None = None) -> dict[str, list[Any]]:
    return {"range_m": values, "cut_off": pa.array(said or [None] * len(values), pa.string())}


def test_means_are_compared_by_student_s_t_of_the_differences() -> None:
    rng = np.random.default_rng(5)
    own = rng.normal(1000.0, 200.0, 30)
    other = own + rng.normal(20.0, 10.0, 30)
    for comparisons in (1, 12):
        change = change_of(RANGE, ranges(own.tolist()), ranges(other.tolist()), comparisons)
        level = 1.0 - 0.05 / comparisons
        by_hand = stats.ttest_rel(other, own).confidence_interval(level)
        assert (change.difference.low, change.difference.high) == pytest.approx(by_hand)
        # The scene's own interval stays that of the study.
        t = stats.t.ppf(0.975, 29) * own.std(ddof=1) / math.sqrt(30)
        assert change.own.high - change.own.value == pytest.approx(t)
    assert confidence_per_interval(0.95, 12) == pytest.approx(1.0 - 0.05 / 12)


def test_who_has_a_value_on_one_side_only_is_counted() -> None:
    own = [100.0, 200.0, 300.0, NAN, NAN, 400.0]
    other = [110.0, 210.0, NAN, NAN, 50.0, 410.0]
    cut = ["at the start", None, None, "never", None, None]
    change = change_of(RANGE, ranges(own, cut), ranges(other))
    assert (change.lost, change.gained, change.neither, change.cut_off) == (1, 1, 1, 1)
    assert (change.runs, change.differing, change.difference.count) == (6, 5, 3)
    assert change.difference.value == 10.0
    assert change.presence is not None and change.presence.value == 0.0
    assert math.isnan(change.largest_possible_change)  # nothing is sure of a mean without them


def test_no_run_with_both_values_has_no_difference() -> None:
    change = change_of(RANGE, ranges([1.0, 2.0]), ranges([NAN, NAN]))
    assert change.reason == "no run has a value with both"
    assert (change.lost, change.gained) == (2, 0)
    one = change_of(RANGE, ranges([1.0, 2.0]), ranges([3.0, NAN]))
    assert one.reason == "one run cannot tell how much others would differ"


def test_what_is_the_same_to_the_last_bit_is_identical_and_a_rounding_is_not() -> None:
    values = [100.0 + k for k in range(20)] + [NAN]
    same = change_of(RANGE, ranges(values), ranges(values))
    assert (
        same.has_only_identical_runs and same.largest_possible_change == 0.0 and same.neither == 1
    )
    near = [*values[:-2], math.nextafter(values[-2], math.inf), NAN]
    almost = change_of(RANGE, ranges(values), ranges(near))
    assert not almost.has_only_identical_runs and almost.differing == 1
    assert almost.difference.value == 0.0  # as everywhere, within 1e-9


def test_ratios_are_compared_encounter_by_encounter() -> None:
    """With equal weights: the mean of what each encounter adds, by hand."""
    rng = np.random.default_rng(7)
    nominal = rng.random(4000) < 0.5
    own = nominal & (rng.random(4000) < 0.3)
    other = own ^ (nominal & (rng.random(4000) < 0.05))
    sides = ({"nominal": nominal.astype(float).tolist(), "lost": lost.astype(float).tolist()}
             for lost in (own, other))  # fmt: skip
    change = change_of(RISK, *sides, comparisons=5)
    many = nominal.sum()
    value = (other.sum() - own.sum()) / many
    assert change.own.value == pytest.approx(own.sum() / many)
    assert change.difference.value == pytest.approx(value)
    each = (other.astype(float) - own - value * nominal) / many
    error = math.sqrt((each**2).sum() + 2.0 / many**2)  # one gained and one lost besides
    half = stats.norm.ppf(1.0 - 0.05 / 5 / 2) * error
    assert change.half_width == pytest.approx(half, rel=1e-6)
    assert change.differing == (own != other).sum()
    assert change.events == math.inf


def test_without_an_event_there_is_no_ratio_and_with_one_it_rests_on_few() -> None:
    nothing = {"nominal": [0.0] * 50, "lost": [0.0] * 50}
    change = change_of(RISK, nothing, nothing)
    assert change.reason == "no encounter has a nominal event"
    one = {"nominal": [1.0] * 10 + [0.0] * 40, "lost": [1.0] + [0.0] * 49}
    none = one | {"lost": [0.0] * 50}
    for other, events in ((one, 1.0), (none, 0.0)):
        change = change_of(RISK, one, other)
        assert change.reason == "" and change.difference.few and change.events == events
        assert change.difference.low < change.difference.high  # no point where no run differs


def test_events_that_all_agree_have_no_point_for_an_interval() -> None:
    change = change_of(EVENTS, {"lost": [0.0] * 40}, {"lost": [0.0] * 40})
    assert change.has_only_identical_runs and change.difference.value == 0.0
    assert (
        change.largest_possible_change == pytest.approx(change.difference.high)
        and change.largest_possible_change > 0.05
    )


def test_quantiles_are_those_of_the_runs_with_both_values() -> None:
    values = np.arange(1.0, 201.0)
    change = change_of(TAIL, {"range_m": values.tolist()}, {"range_m": (values + 7.0).tolist()})
    assert change.difference.value == 7.0
    assert change.own.value == 180.0
    few = change_of(TAIL, {"range_m": [1.0] * 5}, {"range_m": [2.0] * 5})
    assert few.reason == "5 runs are too few for an interval"


def test_how_often_there_is_a_value_with_the_other_model_goes_down_where_it_is_lost() -> None:
    """Three of five runs lose it and one comes to have it: a mean of -0.4 of -1, -1, -1, 1, 0."""
    own, other = [1.0, 2.0, 3.0, NAN, 5.0], [NAN, NAN, NAN, 4.0, 7.0]
    change = change_of(RANGE, ranges(own), ranges(other))
    assert (change.lost, change.gained, change.neither) == (3, 1, 0)
    assert change.presence is not None and change.presence.value == pytest.approx(-0.4)
