"""Which models may be taken, by hand-made changes; and how often a wrong one would be taken."""

import math

import numpy as np
import pytest

from dsa_des.answers.changes import PairedChange, confidence_per_interval
from dsa_des.answers.verdicts import (
    BEYOND,
    NOTHING,
    OPEN,
    SAME,
    WITHIN,
    Limit,
    flag_verdicts_on_cost_front,
    judge_by_worst_change,
    parse_limits,
)
from dsa_des.errors import UsageError
from dsa_des.results.differences import estimate_difference, quantile_difference
from dsa_des.results.record import EVENT, NUMBER, RATIO, RatioOf, Result
from dsa_des.results.statistics import Estimate

RANGE = Result("range_m", NUMBER, "range, m")
SEEN = Result("seen", EVENT, "seen")
RISK = Result("risk_ratio", RATIO, "risk", ratio=RatioOf("below", "above"))


def change(low, high, *, result=RANGE, own=1000.0, count=100, at=(), value=None, **options):
    value = (low + high) / 2 if value is None else value
    few = options.pop("few", False)
    settings = {
        "runs": count, "differing": count, "lost": 0, "gained": 0, "neither": 0, "cut_off": 0,
        "presence": None,
    } | options  # fmt: skip
    owns, found = Estimate(own, own, own, count, False), Estimate(value, low, high, count, few)
    return PairedChange("other", result, at, owns, found, **settings)


HUNDRED = Limit(100.0, False)


def kind_of(*changes, limit=HUNDRED, result=RANGE):
    return judge_by_worst_change("other", result, changes, limit, "")


@pytest.mark.parametrize(
    ("low", "high", "kind", "wanted"),
    [
        (-99.0, 99.0, WITHIN, math.nan),
        (10.0, 60.0, WITHIN, math.nan),
        (101.0, 300.0, BEYOND, math.nan),
        (-300.0, -101.0, BEYOND, math.nan),
        # 0 ± 200 must become 0 ± 100: four times as many of 100.
        (-200.0, 200.0, OPEN, 400.0),
        # 50 ± 100 must become 50 ± 50.
        (-50.0, 150.0, OPEN, 400.0),
        # 150 ± 100 must become 150 ± 50 to be surely beyond.
        (50.0, 250.0, OPEN, 400.0),
        # 100 ± 100 lies on the limit: no number tells.
        (0.0, 200.0, OPEN, math.inf),
        # 20 ± 105 must become 20 ± 80: 172.3, said as 180.
        (-85.0, 125.0, OPEN, 180.0),
    ],
)
def test_the_whole_interval_decides(low, high, kind, wanted):
    verdict = kind_of(change(low, high))
    assert verdict.kind == kind
    assert verdict.wanted == pytest.approx(wanted, nan_ok=True)


def test_every_place_counts_and_the_worst_is_told():
    good, bad = change(-1.0, 1.0, at=(1,)), change(200.0, 300.0, at=(5,))
    verdict = kind_of(good, bad)
    assert (verdict.kind, verdict.change, verdict.weight) == (BEYOND, bad, 3.0)
    wide = change(-150.0, 150.0, at=(2,))
    assert kind_of(good, wide).kind == OPEN
    assert kind_of(good, good).weight == pytest.approx(0.01)


def test_a_share_is_one_of_the_answer_at_each_place():
    near, far = change(-60.0, 60.0, own=500.0), change(-60.0, 60.0, own=1000.0)
    assert kind_of(far, limit=Limit(0.1, True)).kind == WITHIN
    assert kind_of(near, limit=Limit(0.1, True)).kind == OPEN
    # A tenth of nothing is nothing: only what is the same in every run is within it.
    assert kind_of(change(-1.0, 1.0, own=0.0), limit=Limit(0.1, True)).kind == OPEN
    same = change(0.0, 0.0, own=0.0, differing=0)
    assert kind_of(same, limit=Limit(0.1, True)).kind == SAME


def test_a_lost_value_is_counted_and_never_dropped():
    """The other runs are all within the limit: still nothing says that it may be taken."""
    few_lost = change(-1.0, 1.0, lost=3, presence=Estimate(-0.03, -0.09, 0.02, 100, False))
    verdict = kind_of(few_lost)
    assert verdict.kind == OPEN and math.isnan(verdict.weight) and math.isnan(verdict.wanted)
    many_lost = change(-1.0, 1.0, lost=40, presence=Estimate(-0.4, -0.5, -0.3, 100, False))
    assert kind_of(many_lost).kind == BEYOND


def test_events_that_never_differed_leave_what_so_many_runs_may_have_missed():
    wide = change(-0.18, 0.18, result=SEEN, own=1.0, count=24, differing=0)
    verdict = kind_of(wide, limit=Limit(0.1, True), result=SEEN)
    # Its interval shrinks with the number of runs: 24 · 1.8 = 43.2.
    assert (verdict.kind, verdict.wanted) == (OPEN, 44.0)
    narrow = change(-0.05, 0.05, result=SEEN, own=1.0, differing=0)
    assert kind_of(narrow, limit=Limit(0.1, True), result=SEEN).kind == SAME


def test_few_events_decide_nothing():
    few = change(-0.01, 0.01, result=RISK, own=0.1, few=True, events=5.0)
    verdict = kind_of(few, limit=Limit(0.1, False), result=RISK)
    assert (verdict.kind, verdict.wanted) == (OPEN, 400.0)  # until 20 are seen
    # Two runs that agree tell nothing; ten would be enough for an interval.
    assert kind_of(change(0.0, 0.0, count=2, differing=0, few=True)).wanted == 10.0
    none = change(-0.01, 0.01, result=RISK, own=0.1, few=True, events=0.0)
    assert kind_of(none, limit=Limit(0.1, False), result=RISK).wanted == math.inf


def test_what_cannot_be_compared_says_why():
    nothing = change(math.nan, math.nan, reason="no encounter has a nominal event")
    assert kind_of(nothing).kind == NOTHING
    assert kind_of(nothing).reason == "no encounter has a nominal event"
    assert (
        judge_by_worst_change("other", RANGE, [], Limit(1.0, False), "it broke").reason
        == "it broke"
    )


def test_the_front_holds_what_is_cheaper_or_surely_nearer():
    verdicts = [
        judge_by_worst_change(
            name, RANGE, [change(-size, size, value=0.0)], Limit(100.0, False), ""
        )
        for name, size in (("cheap", 80.0), ("cheaper", 20.0), ("near", 5.0), ("dear", 1.0))
    ]
    costs = {"cheap": 0.5, "cheaper": 0.4, "near": 0.8, "dear": 1.05}
    # The scene as it is changes nothing and costs as much as the last one.
    assert flag_verdicts_on_cost_front(verdicts, costs) == [False, True, True, False]


def test_limits_have_the_unit_of_a_result_or_are_shares():
    results = [RANGE, RISK]
    assert parse_limits([], results) == dict.fromkeys(("range_m", "risk_ratio"), Limit(0.1, True))
    assert parse_limits(["5%"], results)["range_m"] == Limit(0.05, True)
    limits = parse_limits(["0.02", "300 m"], results)
    assert limits == {"range_m": Limit(300.0, False), "risk_ratio": Limit(0.02, False)}
    for text in ("0", "-3m", "much", "1e999", "5s", "nan"):
        with pytest.raises(UsageError, match="--budget"):
            parse_limits([text], results)


def test_a_model_that_changes_as_much_as_the_limit_is_seldom_taken():
    """Of ten models whose true change is the limit, one or more is taken in at most 1 of 20."""
    rng, taken, repeats = np.random.default_rng(1), 0, 300
    each = confidence_per_interval(0.95, 10)
    for _ in range(repeats):
        own = rng.normal(1000.0, 50.0, 40)
        some = []
        for _ in range(10):
            found = estimate_difference(own, own + rng.normal(10.0, 5.0, 40), each).paired
            some.append(kind_of(change(found.low, found.high), limit=Limit(10.0, False)).kind)
        taken += WITHIN in some
    assert taken / repeats < 0.05 + 3 * math.sqrt(0.05 * 0.95 / repeats)


def test_the_interval_of_a_difference_of_quantiles_holds_the_truth():
    """Of a normal distribution that is shifted by 1 and gets wider with it."""
    rng, repeats, held = np.random.default_rng(2), 200, 0
    truth = 1.0 + 0.2 * 1.6448536  # 95 % of a normal distribution lie below
    for _ in range(repeats):
        common, own = rng.normal(size=(2, 300))
        first = common
        second = 1.0 + math.sqrt(1.44 - 0.36) * common + 0.6 * own
        found = quantile_difference(first, second, 0.95, 0.95).paired
        held += found.low <= truth <= found.high
    assert 0.95 - 3 * math.sqrt(0.95 * 0.05 / repeats) <= held / repeats


def test_a_shift_of_all_values_shifts_their_quantile_by_as_much():
    values = np.random.default_rng(3).normal(size=200)
    found = quantile_difference(values, values + 0.25, 0.9, 0.95)
    assert found.paired.value == pytest.approx(0.25)
    assert found.paired.high - found.paired.low < 1e-9
    assert found.unpaired.half_width > 0.1
    values[:2] = np.nan
    other = np.random.default_rng(3).normal(size=200)
    other[5] = np.nan
    lost = quantile_difference(values, other, 0.9, 0.95)
    assert (lost.only_first, lost.only_second, lost.paired.count) == (1, 2, 197)
    assert math.isnan(quantile_difference(values[:9], other[:9], 0.95, 0.95).paired.low)


def test_what_the_run_cut_off_may_have_changed_by_more():
    assert kind_of(change(-9.0, 9.0, cut_off=1)).kind == OPEN
    assert kind_of(change(0.0, 0.0, differing=0, cut_off=100)).kind == OPEN
    assert kind_of(change(101.0, 300.0, cut_off=100)).kind == BEYOND  # at least by so much
