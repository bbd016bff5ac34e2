"""Runs flown by what they can contribute: unbiased, with intervals that cover, and a gain."""

import numpy as np
import pytest

from dsa_des.arrays.types import FloatArray
from dsa_des.results.ratio import (
    FORESEEN_COST,
    paired_ratio,
    redistribute_lost_runs,
    share_from_flown_sample,
)
from dsa_des.studies.allocation import (
    FIRST_LEAST,
    LEAST,
    PILOT,
    PREDICTED_FROM,
    Allocation,
    ForeseenRuns,
    best_probability_scale,
    event_chances,
    fit_logistic_coefficients,
    flight_probabilities,
    learn_allocation,
    round_ends,
    sample_runs_to_fly,
    sampling_variance,
)

#: Of a study.
RUNS = 3000


def encounters(
    rng: np.random.Generator, count: int, *, kind: str = "nmac", sigma: float = 0.0,
    everywhere: float = 0.0,
) -> tuple[ForeseenRuns, FloatArray]:  # fmt: skip
    """Encounters by miss distance d and closing speed v, and whether the event happens when flown.

    "nmac": nominal where d < 1, a sixth of them; a third of these stay if v is high, a twentieth if
    low; beside it one that was just missed comes with 1 %, and anywhere with `everywhere`.
    "loss": nominal where d < 4, of which about half stay. "needless": a manoeuvre with 20 % where
    well clear is just kept, of all where it is.
    """
    distance, speed = rng.uniform(0.0, 6.0, count), rng.uniform(0.0, 1.0, count)
    size = 4.0 if kind == "loss" else 1.0
    nominal = (distance < size).astype(float)
    beyond = np.maximum(distance / size, 1.0)
    stays = np.where(speed > 0.6, *((0.7, 0.35) if kind == "loss" else (0.35, 0.05)))
    just = (distance >= size) & (distance < size + 0.5)
    chance, expected = np.where(nominal > 0.0, stays, 0.01 * just) + everywhere, 0.02 * beyond**-8
    expected = np.where(nominal > 0.0, 0.2, expected)
    if kind == "needless":
        nominal = 1.0 - nominal
        chance, expected = 0.2 * just, nominal * 0.1 * beyond**-8
    happened = (rng.uniform(size=count) < chance).astype(float)
    weight = np.exp(sigma * rng.standard_normal(count))
    known = ForeseenRuns(
        np.array([distance, speed]), nominal[np.newaxis], expected[np.newaxis], weight
    )
    return known, happened[np.newaxis]


def part_of(runs: ForeseenRuns, some: slice) -> ForeseenRuns:
    return ForeseenRuns(
        runs.geometry[:, some], runs.nominal[:, some], runs.expected[:, some], runs.weight[some]
    )


def allocated(
    rng: np.random.Generator, runs: ForeseenRuns, happened: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """For how many each encounter stands after all rounds, and what it was predicted."""
    stands_for, start = np.zeros(len(runs.weight)), 0
    predicted = np.zeros(len(runs.weight))
    for end in round_ends(len(stands_for), None):
        known = slice(start or end)
        least = LEAST if start else FIRST_LEAST
        plan = learn_allocation(part_of(runs, known), happened[:, known], stands_for[known], least)
        here = part_of(runs, slice(start, end))
        stands_for[start:end] = sample_runs_to_fly(
            plan.probabilities(here), rng.uniform(size=end - start)
        )[1]
        predicted[start:end] = plan.predicted_event_chances(here)[0]
        start = end
    return stands_for, predicted


def repeated(kind: str, sigma: float, repetitions: int) -> tuple[float, float, float, float]:
    """How often the interval covers, bias in standard errors, gain, and the gain that is said."""
    rng = np.random.default_rng(20261128)
    # By counting far more of them than any study has.
    many, events = encounters(rng, 2_000_000, kind=kind, sigma=sigma)
    truth = float((many.weight * events).sum() / (many.weight * many.nominal).sum())
    errors, covered, costs, plain, said = [], [], [], [], []
    for _ in range(repetitions):
        runs, happened = encounters(rng, RUNS, kind=kind, sigma=sigma)
        stands_for, predicted = allocated(rng, runs, happened)
        flags = runs.nominal[0], happened[0], runs.weight
        one = paired_ratio(*flags, stands_for=stands_for, predicted=predicted)
        errors.append(one.ratio - truth)
        covered.append(one.interval[0] <= truth <= one.interval[1])
        costs.append(one.flown / RUNS + FORESEEN_COST)
        said.append(one.gain)
        plain.append(paired_ratio(*flags).ratio - truth)
    spread = float(np.std(errors))
    gain = float(np.var(plain)) / spread**2 / float(np.mean(costs))
    return float(np.mean(covered)), float(np.mean(errors)) / spread, gain, float(np.median(said))


@pytest.mark.parametrize("sigma", [0.0, 0.7])
@pytest.mark.parametrize("kind", ["nmac", "loss", "needless"])
def test_over_500_studies_ratios_are_unbiased_and_intervals_cover(kind: str, sigma: float) -> None:
    many = 500
    covered, bias, _, _ = repeated(kind, sigma, many)
    # Three standard errors of so many repetitions: binomial of the share, and of the bias.
    assert abs(covered - 0.95) <= 3.0 * np.sqrt(0.95 * 0.05 / many)
    assert abs(bias) < 3.0 / np.sqrt(many)


def test_the_gain_that_a_study_says_is_there() -> None:
    _, _, gain, said = repeated("nmac", 0.7, 120)
    assert gain > 1.8
    assert said == pytest.approx(gain, rel=0.35)


def test_where_the_event_comes_anywhere_nothing_is_gained_and_it_says_so() -> None:
    """A twentieth of all have it, most of them harmless without."""
    rng = np.random.default_rng(7)
    errors, gains = [], []
    for _ in range(60):
        runs, happened = encounters(rng, RUNS, everywhere=0.05)
        s, predicted = allocated(rng, runs, happened)
        one = paired_ratio(runs.nominal[0], happened[0], stands_for=s, predicted=predicted)
        errors.append(one.ratio)
        gains.append(one.gain)
    many, events = encounters(rng, 1_000_000, everywhere=0.05)
    truth = float(events.sum() / many.nominal.sum())
    assert abs(np.mean(errors) - truth) < 3.0 * float(np.std(errors)) / np.sqrt(60)
    assert 0.8 <= np.median(gains) <= 1.0


def test_copies_of_an_encounter_gain_as_much_less_as_they_have_in_common() -> None:
    """Each of 300 encounters eight times, half of each alike; known: every copy with 0.4."""
    rng = np.random.default_rng(12)
    gains, sampled, plain = [], [], []
    for _ in range(300):
        chance = np.repeat(rng.choice([0.05, 0.75], 300), 8)
        happened = (rng.uniform(size=2400) < chance).astype(float)
        s = sample_runs_to_fly(np.full(2400, 0.4), rng.uniform(size=2400).tolist())[1]
        both = {"cluster": np.repeat(np.arange(300), 8)}
        one = paired_ratio(np.ones(2400), happened, stands_for=s, **both)
        gains.append(one.gain)
        sampled.append(one.ratio)
        plain.append(paired_ratio(np.ones(2400), happened, **both).ratio)
    there = float(np.var(plain) / np.var(sampled)) / (0.4 + FORESEEN_COST)
    assert np.mean(gains) == pytest.approx(there, rel=0.15)


def test_an_event_that_nobody_expects_is_flown_and_weighs_what_it_stands_for() -> None:
    rng = np.random.default_rng(11)
    runs, happened = encounters(rng, RUNS)
    far = np.flatnonzero(runs.geometry[0] > 5.0)
    happened[0, far[::10]] = 1.0  # the pilot never saw why
    sums = []
    for _ in range(60):
        s = allocated(rng, runs, happened)[0]
        sums.append(float((s * happened[0]).sum()))
    assert np.mean(sums) == pytest.approx(happened.sum(), abs=3.0 * np.std(sums) / np.sqrt(60))


def test_no_event_one_event_and_encounters_that_are_all_alike() -> None:
    rng = np.random.default_rng(3)
    runs, happened = encounters(rng, PILOT)
    for seen in (np.zeros_like(happened), np.eye(1, PILOT)):
        plan = learn_allocation(runs, seen, np.ones(PILOT))
        chance = plan.probabilities(runs)
        assert ((chance >= LEAST) & (chance <= 1.0)).all()
        # What is nominal is flown before what passes far away.
        assert chance[runs.nominal[0] > 0.0].min() > chance[runs.geometry[0] > 3.0].max()
    alike = ForeseenRuns(np.ones((2, 50)), np.ones((1, 50)), np.full((1, 50), 0.2), np.ones(50))
    plan = learn_allocation(alike, np.zeros((1, 50)), np.ones(50))
    assert np.unique(plan.probabilities(alike)).size == 1
    never = ForeseenRuns(
        np.full((2, 50), np.nan), np.zeros((1, 50)), np.zeros((1, 50)), np.ones(50)
    )
    assert np.isfinite(
        learn_allocation(never, np.zeros((1, 50)), np.ones(50)).probabilities(never)
    ).all()


def test_weights_over_six_orders_of_magnitude_stay_finite_and_the_heavy_are_flown() -> None:
    rng = np.random.default_rng(5)
    runs, happened = encounters(rng, PILOT)
    heavy = ForeseenRuns(
        runs.geometry, runs.nominal, runs.expected, 10.0 ** rng.uniform(-3, 3, PILOT)
    )
    chance = learn_allocation(heavy, happened, np.ones(PILOT)).probabilities(heavy)
    assert np.isfinite(chance).all() and chance.min() >= LEAST
    inside = heavy.nominal[0] > 0.0
    order = np.argsort(heavy.weight[inside])
    assert chance[inside][order[-1]] == 1.0 and chance[inside][order[0]] < 0.5


def test_the_size_of_the_probabilities_has_the_least_variance_times_cost() -> None:
    """Against a search over all pairs of two probabilities, one for each of two kinds of runs."""
    p, many = np.array([0.3, 0.002]), np.array([100, 900])
    runs = ForeseenRuns(
        np.zeros((1, 1000)), np.repeat([1.0, 0.0], many)[np.newaxis], np.zeros((1, 1000)),
        np.ones(1000),
    )  # fmt: skip
    ratio = float((p * many).sum() / many[0])

    def cost(pi: FloatArray) -> float:
        variance = (many * p / pi).sum() + many[0] * (ratio**2 - 2.0 * ratio * p[0])
        return float(variance * ((many * pi).sum() / 1000 + FORESEEN_COST))

    precision, size = best_probability_scale(
        runs, np.repeat(p, many)[np.newaxis], np.array([False]), LEAST
    )
    mine = flight_probabilities(np.sqrt(precision[0] * p), size, LEAST)
    grid = np.linspace(LEAST, 1.0, 98)
    best = min(cost(np.array([a, b])) for a in grid for b in grid)
    assert cost(mine) <= 1.01 * best
    # Neyman's rule: in proportion to the root of the chance, but for the limits.
    assert mine[1] == pytest.approx(max(LEAST, mine[0] * np.sqrt(p[1] / p[0])), rel=0.02) or (
        mine[0] == 1.0
    )


def test_chances_are_those_that_a_grid_search_finds_likeliest() -> None:
    rng = np.random.default_rng(2)
    terms = rng.standard_normal((1, 400))
    happened = (rng.uniform(size=400) < 1.0 / (1.0 + np.exp(1.0 - 0.8 * terms[0]))).astype(float)
    expected = np.full(400, 0.2)
    level, belief, slope = fit_logistic_coefficients(terms, expected, happened, np.ones(400))

    def loss(a: float, k: float, b: float) -> float:
        p = 1.0 / (1.0 + np.exp(-(a + b * terms[0] + (1.0 + k) * np.log(0.25))))
        likely = -(happened * np.log(p) + (1 - happened) * np.log(1 - p)).sum()
        return float(likely + a * a / 18.0 + k * k / 0.5 + b * b / 0.125)

    grid = np.linspace(-0.04, 0.04, 17)
    found = min((loss(level + a, belief + k, slope + b), a, k, b)
                for a in grid for k in grid for b in grid)  # fmt: skip
    assert found[1:] == pytest.approx((0.0, 0.0, 0.0), abs=0.0051)


def test_what_was_expected_is_believed_no_more_where_it_is_wrong() -> None:
    """A fifth of all have an event, whatever is expected, from a hundredth to nothing."""
    rng = np.random.default_rng(4)
    expected = 10.0 ** rng.uniform(-8.0, -2.0, 600)
    happened = (rng.uniform(size=600) < 0.2).astype(float)
    none = np.zeros((1, 600))
    fitted = fit_logistic_coefficients(none, expected, happened, np.ones(600))
    runs = ForeseenRuns(none, none, expected[np.newaxis], np.ones(600))
    chance = event_chances(none, runs, np.stack([fitted, fitted])[np.newaxis])[0]
    assert chance.min() > 0.1 and chance.max() < 0.35


def test_rounds_grow_and_end_with_the_study() -> None:
    assert round_ends(100, None) == [100]
    assert round_ends(PILOT, None) == [PILOT]
    assert round_ends(10_000, None) == [PILOT, 10_000]
    assert round_ends(100_000, None) == [PILOT, 20 * PILOT, 100_000]
    assert round_ends(250, 100) == [100, 200, 250]


def test_a_plan_that_flies_all_stands_for_one_each() -> None:
    plan = Allocation(
        np.zeros(1), np.ones(1), np.zeros((1, 2, 5)), np.ones(1), float("inf"), np.array([False])
    )
    runs = ForeseenRuns(np.zeros((1, 3)), np.ones((1, 3)), np.full((1, 3), 0.2), np.ones(3))
    flown, stands_for = sample_runs_to_fly(plan.probabilities(runs), [0.0, 0.5, 0.999])
    assert flown.all() and stands_for.tolist() == [1.0, 1.0, 1.0]


def test_a_ratio_of_a_sample_by_hand() -> None:
    # Two of four flown, each for two; the second unflown one has the event nominally.
    one = paired_ratio(
        [1, 1, 0, 0], [1, np.nan, np.nan, 1], [1.0, 2.0, 3.0, 4.0], stands_for=[2, 0, 0, 2]
    )
    assert one.ratio == pytest.approx((2 * 1 + 2 * 4) / 3)
    assert one.induced == pytest.approx(8 / 3) and one.unresolved == pytest.approx(2 / 3)
    assert (one.flown, one.nominal_events, one.mitigated_events, one.induced_events) == (2, 2, 2, 1)
    r = 10 / 3
    terms = [2 - r, -2 * r, 0, 8]
    assert one.standard_error == pytest.approx(np.sqrt(np.square(terms).sum()) / 3)
    for bad in ([0.5, 1.0], [np.nan, 1.0], [-1.0, 1.0], [1.0]):
        with pytest.raises(ValueError, match="stands_for"):
            paired_ratio([1, 0], [1, 0], stands_for=bad)


def test_a_ratio_of_a_sample_with_predictions_by_hand() -> None:
    # As above, the first predicted with 0.6, the second with 0.4, the last with 0.1.
    one = paired_ratio(
        [1, 1, 0, 0], [1, np.nan, np.nan, 1], [1.0, 2.0, 3.0, 4.0], stands_for=[2, 0, 0, 2],
        predicted=[0.6, 0.4, 0.0, 0.1],
    )  # fmt: skip
    terms = [1 * (0.6 + 2 * 0.4), 2 * 0.4, 0.0, 4 * (0.1 + 2 * 0.9)]
    assert one.ratio == pytest.approx(sum(terms) / 3)
    assert one.induced == pytest.approx(terms[3] / 3)
    assert one.unresolved == pytest.approx((terms[0] + terms[1]) / 3)
    left = np.array(terms) - one.ratio * np.array([1, 2, 0, 0])
    assert one.standard_error == pytest.approx(np.sqrt(np.square(left).sum()) / 3)
    # What all are flown tells leaves nothing to predict.
    flags = [1, 1, 0], [1, 0, 0]
    told = paired_ratio(*flags, stands_for=[1, 1, 1], predicted=[0.9, 0.9, 0.9])
    assert told.ratio == paired_ratio(*flags).ratio


def test_an_event_that_was_seen_often_is_predicted_and_the_sure_are_flown_less() -> None:
    rng = np.random.default_rng(6)
    runs, happened = encounters(rng, 2000, kind="loss")
    few = np.where(np.arange(2000) < 60, 1.0, 0.0)
    assert happened[0, :60].sum() < PREDICTED_FROM < happened.sum()
    unsure, sure = (
        learn_allocation(runs, happened, few),
        learn_allocation(runs, happened, np.ones(2000)),
    )
    assert not unsure.predicted_event_chances(runs).any()
    truth = np.where(runs.geometry[1] > 0.6, 0.7, 0.35)[runs.nominal[0] > 0.0]
    found = sure.predicted_event_chances(runs)[0][runs.nominal[0] > 0.0]
    assert np.abs(found - truth).mean() < 0.1
    both = np.array([[0.5, 0.9], [0.5, 0.9]])
    open_ = sampling_variance(both, np.array([True, False]))
    assert open_ == pytest.approx(np.array([[0.25, 0.09], [0.5, 0.9]]))


def test_a_share_of_a_sample_is_the_surer_of_two_and_never_above_1() -> None:
    rng = np.random.default_rng(8)
    whole, chance = np.ones(400), np.repeat([0.05, 0.8], 200)
    s = sample_runs_to_fly(chance, rng.uniform(size=400).tolist())[1]
    weight = np.ones(400)
    every = share_from_flown_sample(whole, whole, weight, s, predicted=None)
    # One that nobody saw stands for twenty: 3.69 of these may be missing of 400.
    assert every.ratio == every.interval[1] == 1.0
    assert every.interval[0] == pytest.approx(1.0 - 3.69 * 20 / 400, abs=0.01)
    part = (rng.uniform(size=400) < 0.7).astype(float)
    large = share_from_flown_sample(whole, part, weight, s, predicted=None)
    assert large.ratio == pytest.approx((s * part).sum() / s.sum())  # Hájek's
    rare = np.zeros(400)
    rare[-2:] = (s[-2:] > 0.0) | (np.arange(2) > 0)
    seldom = share_from_flown_sample(whole, rare, weight, s, predicted=None)
    plain = paired_ratio(whole, rare, stands_for=s)
    assert seldom.standard_error <= plain.standard_error
    assert seldom.flown == plain.flown == np.count_nonzero(s)
    for one in (large, seldom):
        assert one.interval[0] <= one.ratio <= one.interval[1] <= 1.0
    # Where nothing can be told no more is said to have been flown, nor less.
    assert paired_ratio([0, 0], [0, np.nan], stands_for=[2, 0]).flown == 1


def test_what_failed_runs_stood_for_is_shared_by_those_flown_of_their_cell() -> None:
    stands_for, first = np.array([1.0, 0.0, 3.0, 5.0, 2.0]), np.array([1, 1, 1, 1, 0], dtype=bool)
    # One that stood for four leaves out itself, and three others; those of unknown runs are as many
    # as the others on average: (0 + 2 + 4) / 3.
    assert redistribute_lost_runs(stands_for, [4.0, np.nan], first) == pytest.approx(
        [1.0, 0.0, 3.0 + 2.0 * 5.0 / 6.0, 5.0 + 4.0 * 5.0 / 6.0, 2.0]
    )
    assert redistribute_lost_runs(stands_for, [1.0, 0.0], first).tolist() == stands_for.tolist()
    nobody = np.array([1.0, 0.0])
    assert redistribute_lost_runs(nobody, [7.0], np.array([True, True])) is nobody


def test_a_ratio_is_unbiased_where_a_tenth_of_the_runs_fails() -> None:
    rng = np.random.default_rng(17)
    found, whole = [], []
    for _ in range(400):
        runs, happened = encounters(rng, 1000)
        chance = np.where(runs.nominal[0] > 0.0, 0.6, 0.1)
        s = sample_runs_to_fly(chance, rng.uniform(size=1000).tolist())[1]
        failed = (rng.uniform(size=1000) < 0.1) & (s > 0.0)
        kept = ~failed
        lost = redistribute_lost_runs(
            s[kept], s[failed].tolist(), np.ones(int(kept.sum()), dtype=bool)
        )
        found.append(paired_ratio(runs.nominal[0][kept], happened[0][kept], stands_for=lost).ratio)
        whole.append(paired_ratio(runs.nominal[0], happened[0]).ratio)
    error = float(np.std(found)) / 20.0
    assert abs(np.mean(found) - np.mean(whole)) < 3.0 * error
    assert error < 0.03 * np.mean(whole)
