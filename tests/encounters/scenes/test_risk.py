"""Risk ratios against published numbers, hand calculation, and chance itself."""

import csv
import math

import numpy as np
import pytest

from components.metrics.risk import risk_ratio, risk_ratios_by_class
from tests.encounters.count_coverage import SHAPES, misses
from tests.encounters.reference_data import reference_file


def published() -> dict[str, np.ndarray]:
    path = reference_file("degas_sample/sample_results.csv")
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.mark.parametrize(
    ("what", "ratio", "induced", "unpaired", "error", "low", "high"),
    [
        ("nmac", 0.126765133837, 0.022934286853, 0.017423046246, 0.016623, 0.0980, 0.1639),
        ("wcv", 0.414919554395, 0.025464025382, 0.025411080001, 0.023601, 0.3711, 0.4639),
    ],
)
def test_published_ratios(what, ratio, induced, unpaired, error, low, high) -> None:
    data = published()
    flags = data[f"{what}_nominal"], data[f"{what}_mitigated"], data["weight"]
    found = risk_ratio(*flags, method="delta")
    assert abs(found.ratio - ratio) < 1e-12
    assert abs(found.induced - induced) < 1e-12
    assert abs(found.unresolved + found.induced - found.ratio) < 1e-15
    assert abs(found.unpaired_error - unpaired) < 1e-12
    assert abs(found.standard_error - error) < 1e-6
    assert found.interval == pytest.approx((low, high), abs=6e-5)
    assert round(found.effective_sample_size, 2) == 2742.43
    # By gammas it is hardly wider: 68 mitigated events are many.
    assert risk_ratio(*flags).interval == pytest.approx((low, high), rel=0.03)
    drawn = risk_ratio(*flags, method="bootstrap", resamples=1000)
    assert drawn.standard_error == pytest.approx(error, rel=0.06)
    assert drawn.interval == pytest.approx((low, high), abs=0.006)


def test_a_ratio_by_hand() -> None:
    # Weights 1, 2, 3, 4: nominal weighs 1 + 2 = 3, mitigated 2 + 3 = 5, of which 3 is induced.
    found = risk_ratio([1, 1, 0, 0], [0, 1, 1, 0], [1, 2, 3, 4], method="delta")
    assert (found.ratio, found.unresolved, found.induced) == pytest.approx((5 / 3, 2 / 3, 1))
    assert (found.nominal_probability, found.mitigated_probability) == pytest.approx((0.3, 0.5))
    # Residuals w (m - R n): -5/3, 2 (1 - 5/3) = -4/3, 3, 0.
    assert found.standard_error == pytest.approx(math.sqrt(25 / 9 + 16 / 9 + 9) / 3)
    assert found.effective_sample_size == pytest.approx(100 / 30)
    reach = math.exp(1.959963984540054 * found.standard_error / found.ratio)
    assert found.interval == pytest.approx((5 / 3 / reach, 5 / 3 * reach))
    assert (found.encounters, found.nominal_events, found.mitigated_events) == (4, 2, 2)
    assert found.induced_events == 1 and found.few


def test_the_bootstrap_agrees_with_drawing_every_encounter() -> None:
    random = np.random.default_rng(3)
    count = 300
    w = random.choice([1.0, 2.5, 7.0], count)
    n = random.random(count) < 0.3
    m = np.where(n, random.random(count) < 0.3, random.random(count) < 0.03)
    ratios = []
    for _ in range(4000):
        rows = random.integers(0, count, count)
        ratios.append((w * m)[rows].sum() / (w * n)[rows].sum())
    found = risk_ratio(n, m, w, method="bootstrap", resamples=4000)
    assert found.standard_error == pytest.approx(np.std(ratios), rel=0.05)
    assert found.interval == pytest.approx(np.quantile(ratios, [0.025, 0.975]), rel=0.06)


@pytest.mark.parametrize("shape", SHAPES)
def test_an_end_of_an_interval_errs_one_time_in_forty(shape: str) -> None:
    """With three events and with a hundred, of weights however uneven; and is no wider than that
    where events are many and alike."""
    few, many = misses(shape, 3, 600, "gamma"), misses(shape, 100, 600, "gamma")
    chance = 0.025 + 2.0 * math.sqrt(0.025 * 0.975 / 600)
    assert max(*few, *many) <= chance
    if shape == "equal":
        assert min(many[:2]) >= 0.012
        # What the delta method of three events leaves unsaid is said.
        above, _, unmarked = misses(shape, 3, 600, "delta")
        assert above > chance and unmarked == 0.0


def test_ends_are_where_gamma_variables_are_as_sure() -> None:
    """Against drawn gamma variables, with induced events, unresolved ones and a ratio above 1."""
    random = np.random.default_rng(8)
    for new, scale in ((0.1, 1.0), (0.7, 3.0)):
        w = random.lognormal(0.0, scale, 60)
        n = random.random(60) < 0.6
        m = random.random(60) < np.where(n, 0.4, new)
        found = risk_ratio(n, m, w, confidence=0.9)
        low, high = found.interval
        assert low < found.ratio < high
        either, top = w * (n | m), (w * n).max()
        more = np.array([(either**2).sum(), (either**3).sum()]) / either.sum()
        for limit, went_more, stay_more in (
            (high, 0.0, more), (low, np.array([low * top, (low * top) ** 2]), 0.0)
        ):  # fmt: skip
            z = w * (m - limit * n)
            went = np.array([-z[z < 0].sum(), (z[z < 0] ** 2).sum()]) + went_more
            stay = np.array([z[z > 0].sum(), (z[z > 0] ** 2).sum()]) + stay_more
            one, other = (random.gamma(a * a / v, v / a, 400_000) for a, v in (went, stay))
            sure = (one > other).mean()
            assert sure == pytest.approx(0.95 if limit == high else 0.05, abs=0.0015)


def test_with_equal_weights_the_lower_end_is_clopper_and_pearson_s() -> None:
    from scipy.stats import beta

    for stayed, count in ((1, 10), (5, 50), (49, 50)):
        low, high = risk_ratio([1] * count, [1] * stayed + [0] * (count - stayed)).interval
        assert low == pytest.approx(beta.ppf(0.025, stayed, count - stayed + 1))
        assert high > beta.ppf(0.975, stayed + 1, count - stayed)


def test_without_an_event_that_weighs_anything_there_is_a_reason() -> None:
    none = risk_ratio([0, 0], [0, 1], [1, 3])
    assert math.isnan(none.ratio) and all(map(math.isnan, none.interval))
    assert none.reason == "no encounter has a nominal event"
    assert none.mitigated_probability == 0.75
    assert risk_ratio([1, 0], [1, 0], [0, 1]).reason == (
        "the encounters with a nominal event weigh nothing"
    )
    assert risk_ratio([1, 0], [1, 0], [0, 0]).reason == "all weights are 0"
    assert risk_ratio([], []).reason == "there is no encounter"


def test_where_nothing_differs_the_interval_is_no_point() -> None:
    gone = risk_ratio([1] * 50, [0] * 50, method="delta")
    assert gone.ratio == 0.0 and gone.interval[0] == 0.0
    assert gone.interval[1] == pytest.approx(-math.log(0.025) / 50)
    # One event more, of 50: (1 + 1/50 R)^-50 = 0.025, as ratios of gammas have it.
    sure = risk_ratio([1] * 50, [0] * 50).interval
    assert sure == pytest.approx((0.0, 0.025 ** (-1 / 50) - 1.0))
    same = risk_ratio([1] * 50, [1] * 50, method="bootstrap")
    assert same.ratio == 1.0 and same.interval[0] < 1.0 < same.interval[1]


def test_an_encounter_without_weight_counts_for_nothing() -> None:
    some = risk_ratio([1, 1, 0, 1], [0, 1, 1, 1], [1, 2, 3, 0])
    less = risk_ratio([1, 1, 0], [0, 1, 1], [1, 2, 3])
    assert (some.ratio, some.standard_error) == (less.ratio, less.standard_error)
    assert some.effective_sample_size == less.effective_sample_size


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([1, 0], [0, 0], [1, math.nan]), "weight of encounter 1 is missing"),
        (([1, 0], [0, 0], [-1, 1]), "weight of encounter 0 is -1.0"),
        (([1, 2], [0, 0], [1, 1]), "nominal of encounter 1 is 2.0"),
        (([1, 0], [0, math.nan], [1, 1]), "mitigated of encounter 1 is missing"),
        (([1, 0], [0], [1, 1]), "nominal has 2 encounters and mitigated 1"),
        (([1, 0], [0, 0], [1]), "2 encounters have one each"),
    ],
)
def test_what_cannot_be_used_is_named(arguments, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        risk_ratio(*arguments)


def test_classes_have_ratios_of_their_own() -> None:
    n, m, w = [1, 1, 1, 0], [1, 0, 0, 1], [1.0, 1.0, 2.0, 5.0]
    found = risk_ratios_by_class(n, m, w, ["head-on", "head-on", "overtaking", "crossing"])
    assert list(found) == ["crossing", "head-on", "overtaking"]
    assert found["head-on"].ratio == 0.5 and found["overtaking"].ratio == 0.0
    assert found["crossing"].reason == "no encounter has a nominal event"
