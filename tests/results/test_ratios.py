"""Ratios of events in summaries: by hand, clustered, by class, compared, and how often right."""

import math
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from components.metrics.risk import risk_ratios_by_class
from dsa_des.results.printing import sampling_gain_text
from dsa_des.results.ratio import METHODS, PairedRatio, paired_ratio
from dsa_des.results.record import CLASS, EVENT, NUMBER, RATIO, RatioOf, Result
from dsa_des.results.rows import Rows
from dsa_des.results.summary import compare_axis, summarise
from tests.results.conftest import rows_of_table

FLAGS = [
    Result("n", EVENT, ""), Result("m", EVENT, ""), Result("w", NUMBER, ""),
    Result("family", NUMBER, ""), Result("kind", CLASS, ""),
]  # fmt: skip


def ratio(name: str = "r", **of: object) -> Result:
    return Result(name, RATIO, "", ratio=RatioOf("n", "m", **of))  # type: ignore[arg-type]


def rows_of(n, m, w=None, family=None, kind=None, axis=None, replica=None) -> Rows:
    count = len(n)
    columns = {
        "n": np.asarray(n, dtype=float), "m": np.asarray(m, dtype=float),
        "w": np.ones(count) if w is None else w, "family": family, "kind": kind,
        "x": np.zeros(count) if axis is None else axis,
        "replica": np.arange(count) if replica is None else replica,
        "error": pa.nulls(count, pa.string()), "status": ["done"] * count,
    }  # fmt: skip
    return rows_of_table(pa.table({k: v for k, v in columns.items() if v is not None}), ["x"], [])


def test_a_ratio_by_hand_with_both_intervals() -> None:
    rows = rows_of([1, 1, 0, 0, math.nan], [0, 1, 1, 0, 1], np.array([1, 2, 3, 4, 5.0]))
    (line,) = summarise(rows, [ratio(weight="w")], 0.95, "t", {})
    assert line.ratio is not None and line.other is not None
    assert (line.ratio.ratio, line.ratio.unresolved, line.ratio.induced) == pytest.approx(
        (5 / 3, 2 / 3, 1)
    )
    assert line.missing == 1 and line.estimate.count == 4
    assert line.ratio.standard_error == pytest.approx(math.sqrt(25 / 9 + 16 / 9 + 9) / 3)
    assert (line.estimate.low, line.estimate.high) == line.ratio.interval
    assert (line.ratio.method, line.estimate.few) == ("gamma", False)
    assert (line.other.method, line.other.few) == ("bootstrap", True)
    (drawn,) = summarise(rows, [ratio(weight="w")], 0.95, "bootstrap", {})
    assert (drawn.estimate.low, drawn.estimate.high) == line.other.interval
    assert drawn.other is not None and drawn.other.interval == line.ratio.interval


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("families", [1, 3])
def test_a_ratio_knows_no_unit_of_weight_no_order_and_no_other_class(
    method: str, families: int
) -> None:
    random = np.random.default_rng(6)
    n, m = ((random.random(1500) < chance).astype(float) for chance in (0.5, 0.4))
    w, family = random.uniform(0.5, 1.5, 1500), np.arange(1500) // families
    kind = np.array(["a", "bb", "c"])[random.integers(0, 3, 1500)]

    def near(found: PairedRatio, wanted: PairedRatio) -> bool:
        sides = [[v for v in vars(r).values() if not isinstance(v, str)] for r in (found, wanted)]
        return np.allclose(*map(np.hstack, sides), rtol=1e-9, equal_nan=True)

    def of(rows: np.ndarray, unit: float = 1.0) -> PairedRatio:
        return paired_ratio(
            n[rows], m[rows], unit * w[rows], cluster=family[rows], method=method, resamples=50
        )

    every = np.arange(1500)
    assert not of(every).few
    # Beyond 1e154 the square of a weight is no number.
    assert all(near(of(every, unit), of(every)) for unit in (1e3, 1e-3, 1e300, 1e-300))
    assert near(of(random.permutation(1500)), of(every))
    classes = risk_ratios_by_class(n, m, w, kind, family, method=method, resamples=50)
    assert list(classes) == ["a", "bb", "c"]
    assert all(near(classes[name], of(np.flatnonzero(kind == name))) for name in classes)


def test_a_share_ends_at_one_and_a_ratio_does_not() -> None:
    """Where what is over the line is always under it, no more than all can be left."""
    rows = rows_of([1, 1, 0], [0, 1, 0])
    plain, share = summarise(rows, [ratio("a"), ratio("b", share=True)], 0.95, "t", {})
    assert plain.estimate.high > 1.0 == share.estimate.high
    assert plain.other is not None and share.other is not None
    assert plain.other.interval[1] >= share.other.interval[1] and share.other.interval[1] <= 1.0
    assert plain.estimate.low == share.estimate.low


def test_a_class_counts_its_own_and_none_stands_in_no_class() -> None:
    rows = rows_of([1, 1, 1, 1], [1, 0, 0, 1], kind=["a", "a", "b", None])
    found = summarise(
        rows, [ratio("a", only=("kind", "a")), ratio("b", only=("kind", "b")), ratio(), FLAGS[4]],
        0.95, "t", {},
    )  # fmt: skip
    assert [line.estimate.value for line in found] == [0.5, 0.0, 0.5]
    assert [line.other is None for line in found] == [True, True, False]


def test_runs_of_a_family_count_as_one_of_all_their_weight() -> None:
    """Copies of an encounter tell no more of other encounters than the encounter itself."""
    random = np.random.default_rng(5)
    n = random.random(60) < 0.6
    m = n & (random.random(60) < 0.4)
    one = paired_ratio(n, m)
    copies = np.repeat(np.arange(60), 4)
    rows = rows_of(n[copies], m[copies], np.full(240, 0.25), copies.astype(float))
    (line,) = summarise(rows, [ratio(weight="w", cluster="family")], 0.95, "t", {})
    assert line.ratio is not None and line.ratio.clusters == 60 == line.estimate.count
    assert line.ratio.standard_error == pytest.approx(one.standard_error)
    assert line.ratio.effective_sample_size == pytest.approx(60)
    (loose,) = summarise(rows, [ratio(weight="w")], 0.95, "t", {})
    assert loose.ratio is not None
    assert loose.ratio.standard_error == pytest.approx(one.standard_error / 2)


def test_differences_of_ratios_hold_what_they_share_once() -> None:
    """Two conditions on the same encounters, again and again: the paired interval holds 95 %."""
    random = np.random.default_rng(11)
    held, widths, truth, rounds = 0, [], 0.3 - 0.5, 200
    for _ in range(rounds):
        w = random.choice([1.0, 2.0], 1500)
        n = random.random(1500) < 0.2
        u = random.random(1500)
        m = np.concatenate([n & (u < 0.5), n & (u < 0.3)])
        rows = rows_of(
            np.tile(n, 2), m, np.tile(w, 2), axis=np.repeat([0.0, 1.0], 1500),
            replica=np.tile(np.arange(1500), 2),
        )  # fmt: skip
        (found,) = compare_axis(rows, "x", 0.0, [ratio(weight="w")], 0.95, "t")
        d = found.difference
        held += d.paired.low <= truth <= d.paired.high
        widths.append(d.narrowing_factor)
    assert 0.925 <= held / rounds <= 0.975 and min(widths) > 1.2
    # Where only one side has an interval by error, the other one's uncertainty still counts.
    n = np.ones(100)
    m = np.concatenate([np.zeros(100), np.ones(100)])
    rows = rows_of(np.tile(n, 2), m, axis=np.repeat([0.0, 1.0], 100),
                   replica=np.tile(np.arange(100), 2))  # fmt: skip
    (sure,) = compare_axis(rows, "x", 0.0, [ratio()], 0.95, "t")
    assert sure.difference.paired.value == 1.0 and sure.difference.paired.half_width > 0.01


def compared(n, first, second, w=None):
    """Return the difference of the ratios of two conditions on the same encounters."""
    rows = rows_of(
        np.tile(n, 2), np.concatenate([first, second]), None if w is None else np.tile(w, 2),
        axis=np.repeat([0.0, 1.0], len(n)), replica=np.tile(np.arange(len(n)), 2),
    )  # fmt: skip
    of = ratio() if w is None else ratio(weight="w")
    return compare_axis(rows, "x", 0.0, [of], 0.95, "t")[0].difference


@pytest.mark.parametrize("left", [0.0, 0.3, 1.0])
def test_runs_that_all_agree_leave_open_what_one_more_of_either_would_do(left: float) -> None:
    """By hand: 1.96 standard errors of one event gained and one lost, of 40 events below."""
    n = np.repeat([1.0, 0.0], [40, 160])
    m = n * (np.arange(200) < 40 * left)
    d = compared(n, m, m)
    assert d.paired.value == 0.0 and d.unpaired.half_width > d.paired.half_width
    assert d.paired.half_width == pytest.approx(1.959964 * math.sqrt(2.0) / 40.0, rel=1e-5)
    # The same events, a tenth as heavy half of the time: those that weigh count.
    w = np.where(np.arange(200) % 2, 0.1, 1.0)
    x = (w * n)[:40]
    one_more = (x**3).sum() / x.sum() / x.sum() ** 2
    assert compared(n, m, m, w).paired.half_width == pytest.approx(
        1.959964 * math.sqrt(2.0 * one_more), rel=1e-5
    )


@pytest.mark.parametrize("apart", [0.0, 0.004, 0.05])
def test_few_runs_that_differ_are_held_by_the_interval(apart: float) -> None:
    """Of some 200 events, few or none of which go otherwise, in 1,000 encounters each time."""
    random = np.random.default_rng(29)
    held, widths, rounds = 0, [], 200
    for _ in range(rounds):
        n = random.random(1000) < 0.2
        u, changed = random.random(1000), random.random(1000) < apart
        first = n & (u < 0.3)
        d = compared(n, first, np.where(changed, n & ~first, first)).paired
        held += d.low <= apart * (0.7 - 0.3) <= d.high
        widths.append(d.half_width)
    assert held / rounds >= 0.935 and max(widths) < 0.06


@pytest.mark.parametrize("method", ["t", "bootstrap"])
def test_intervals_of_clustered_ratios_hold_the_truth(method: str) -> None:
    random = np.random.default_rng(23)
    chance, left, new, kept, rounds = 0.3, 0.25, 0.01, 0, 160
    truth = left + (1 - chance) / chance * new
    for _ in range(rounds):
        n = np.repeat(random.random(700) < chance, 3)
        hard = np.repeat(random.random(700) < 0.5, 3)  # what copies of an encounter share
        m = random.random(2100) < np.where(n, np.where(hard, 2 * left - 0.05, 0.05), new)
        w = np.repeat(random.choice([1.0, 3.0], 700), 3)
        found = paired_ratio(
            n, m, w, cluster=np.repeat(np.arange(700), 3),
            method="gamma" if method == "t" else method, resamples=300,
        )  # fmt: skip
        kept += found.interval[0] <= truth <= found.interval[1]
    # What one event more would be is a whole cluster to the gammas: a little too wide.
    assert 0.925 <= kept / rounds <= (0.99 if method == "t" else 0.975)


def test_events_of_two_conditions_have_a_weighted_ratio() -> None:
    """Runs without and with a remedy as values of an axis: those that both have, by hand."""
    rows = rows_of(
        [1, 1, 0, 0, 1, 0, 1, 1, 0, 1], np.zeros(10),
        np.array([1, 2, 3, 4, 9, 1, 2, 3, 4, 9.0]), axis=np.repeat([0.0, 1.0], 5),
        replica=np.array([0, 1, 2, 3, 4, 0, 1, 2, 3, 5]),
    )  # fmt: skip
    (found,) = compare_axis(rows, "x", 0.0, [FLAGS[0]], 0.95, "t", "w")
    # Below the line 1 + 2, above it 2 of them and 3 that are induced; the fifth ones are alone.
    assert found.ratio is not None and found.ratio.encounters == 4
    assert (found.ratio.ratio, found.ratio.induced) == pytest.approx((5 / 3, 1))
    (plain,) = compare_axis(rows, "x", 0.0, [FLAGS[0]], 0.95, "t")
    assert plain.ratio is not None and plain.ratio.ratio == 1.0
    (number,) = compare_axis(rows, "x", 0.0, [FLAGS[2]], 0.95, "t")
    assert number.ratio is None


@pytest.mark.parametrize(
    ("gain", "reason", "events", "more"),
    [
        (2.345, "", 9, "; as wide an interval costs 2.3 times as much with all of them"),
        (1.0, "", 9, "; as wide an interval costs no more with all of them: nothing is gained"),
        (1.04, "", 9, "; as wide an interval costs no more with all of them: nothing is gained"),
        (0.4, "", 9, "; as wide an interval costs no more with all of them: nothing is gained"),
        (0.0, "", 9, ""), (math.nan, "", 9, ""), (2.0, "too few", 9, ""), (2.0, "too few", 0, ""),
        (math.nan, "", 0, "; the event came in none of them, so what is gained is not known"),
    ],
)  # fmt: skip
def test_what_a_choice_of_runs_gained_is_said_in_a_sentence(gain, reason, events, more) -> None:
    ratio = SimpleNamespace(
        flown=1200, encounters=34_000, gain=gain, reason=reason, mitigated_events=events
    )
    line = SimpleNamespace(ratio=ratio, at=[2.5, "ekf"], result=SimpleNamespace(name="risk"))
    assert sampling_gain_text(line) == f"2.5: ekf: risk: 1,200 of 34,000 runs were flown{more}"
    ratio.flown = 34_000
    assert (
        sampling_gain_text(line) == "2.5: ekf: risk: all 34,000 runs were flown: nothing is gained"
    )
