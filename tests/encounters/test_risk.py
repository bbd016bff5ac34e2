"""Risk ratios against published numbers, hand calculation, and chance itself."""

import csv
import math

import numpy as np
import pytest

from components.metrics.risk import risk_ratio, risk_ratios_by_class
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
    found = risk_ratio(*flags)
    assert abs(found.ratio - ratio) < 1e-12
    assert abs(found.induced - induced) < 1e-12
    assert abs(found.unresolved + found.induced - found.ratio) < 1e-15
    assert abs(found.unpaired_error - unpaired) < 1e-12
    assert abs(found.standard_error - error) < 1e-6
    assert found.interval == pytest.approx((low, high), abs=6e-5)
    assert round(found.effective_sample_size, 2) == 2742.43
    drawn = risk_ratio(*flags, method="bootstrap", resamples=1000)
    assert drawn.standard_error == pytest.approx(error, rel=0.06)
    assert drawn.interval == pytest.approx((low, high), abs=0.006)


def test_a_ratio_by_hand() -> None:
    # Weights 1, 2, 3, 4: nominal weighs 1 + 2 = 3, mitigated 2 + 3 = 5, of which 3 is induced.
    found = risk_ratio([1, 1, 0, 0], [0, 1, 1, 0], [1, 2, 3, 4])
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


@pytest.mark.parametrize("method", ["delta", "bootstrap"])
def test_intervals_hold_the_truth_as_often_as_they_say(method: str) -> None:
    random = np.random.default_rng(19)
    count, kept, rounds = 4000, 0, 1000
    chance, left, new = 0.1, 0.2, 0.003
    truth = (chance * left + (1 - chance) * new) / chance
    for _ in range(rounds):
        w = random.choice([1.0, 3.0], count)
        n = random.random(count) < chance
        m = random.random(count) < np.where(n, left, new)
        found = risk_ratio(n, m, w, method=method, resamples=400)
        kept += found.interval[0] <= truth <= found.interval[1]
    assert 0.93 <= kept / rounds <= 0.97


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
    gone = risk_ratio([1] * 50, [0] * 50)
    assert gone.ratio == 0.0 and gone.interval[0] == 0.0
    assert gone.interval[1] == pytest.approx(-math.log(0.025) / 50)
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
