"""Every kind of interval holds the truth as often as it says, on synthetic results of studies."""

import math
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pytest

from dsa_des.results.differences import estimate_difference, paired_unit_means
from dsa_des.results.record import EVENT, NUMBER, SHARE, TRIALS, Result
from dsa_des.results.statistics import Estimate, estimate_mean, estimate_share
from dsa_des.results.summary import compare_axis, summarise
from dsa_des.studies.draws import parse_draw
from tests.results.conftest import rows_of_table

#: Chance alone moves a coverage of 95 % over so many rounds by 0.5 % (two standard deviations: 1).
ROUNDS = 2000
LEVEL = 0.95
Random = np.random.Generator


def coverage(
    estimate: Callable[[Random], Estimate], truth: float, rounds: int = ROUNDS, seed: int = 1
) -> float:
    """Return the share of unmarked intervals that hold the truth."""
    random = np.random.default_rng(seed)
    found = [estimate(random) for _ in range(rounds)]
    told = [e for e in found if not e.few]
    assert len(told) > rounds / 4, "nearly all are marked as resting on few values"
    return sum(e.low <= truth <= e.high for e in told) / len(told)


@pytest.mark.parametrize(
    ("method", "count", "shape"),
    [*(("t", count, shape) for count in (10, 40) for shape in ("normal", "uniform", "skewed")),
     ("bootstrap", 10, "uniform"), ("bootstrap", 40, "skewed")],
)  # fmt: skip
def test_means(method: str, count: int, shape: str) -> None:
    draw = {
        "normal": lambda r: r.normal(3.0, 2.0, count),
        "uniform": lambda r: r.uniform(2.0, 4.0, count),
        "skewed": lambda r: r.gamma(16.0, 3 / 16, count),  # skewness 1/2
    }[shape]
    found = coverage(lambda r: estimate_mean(draw(r), LEVEL, method), 3.0, 1000)
    assert 0.93 <= found <= 0.975


def test_the_bootstrap_covers_long_tails_better_than_t() -> None:
    t = coverage(lambda r: estimate_mean(r.exponential(1.0, 20), LEVEL, "t"), 1.0, 1000)
    bootstrap = coverage(
        lambda r: estimate_mean(r.exponential(1.0, 20), LEVEL, "bootstrap"), 1.0, 1000
    )
    assert t < bootstrap and 0.93 <= bootstrap <= 0.97


@pytest.mark.parametrize("count", [20, 60, 300])
def test_shares_of_single_trials(count: int) -> None:
    # Counts are whole, so the coverage at one chance goes up and down: it is taken over many.
    random = np.random.default_rng(2)
    held = 0
    for _ in range(ROUNDS):
        chance = random.uniform(0.03, 0.97)
        won = random.binomial(1, chance, count).astype(float)
        e = estimate_share(won, np.ones(count), LEVEL)
        held += e.low <= chance <= e.high
    assert 0.93 <= held / ROUNDS <= 0.97


@pytest.mark.parametrize("units", [10, 20, 60])
@pytest.mark.parametrize("trials", [5, 100])
@pytest.mark.parametrize("shape", [(0.5, 0.5), (5.0, 5.0), (6.0, 2.0)])
def test_shares_of_trials_that_hang_together(
    units: int, trials: int, shape: tuple[float, float]
) -> None:
    each = np.full(units, float(trials))
    found = coverage(
        lambda r: estimate_share(
            r.binomial(trials, r.beta(*shape, units)).astype(float), each, LEVEL
        ),
        shape[0] / sum(shape),
    )
    assert 0.93 <= found <= 0.98


def test_shares_of_trials_that_do_not_hang_together_are_a_little_wide() -> None:
    each = np.full(15, 40.0)
    found = coverage(
        lambda r: estimate_share(r.binomial(40, 0.3, 15).astype(float), each, LEVEL), 0.3
    )
    assert 0.95 <= found <= 0.985


def test_units_that_go_one_way_as_a_whole_count_once() -> None:
    # Of 20 encounters of 50 looks each, 36 % of folders hold none of the 5 % that are never seen.
    random, held = np.random.default_rng(3), 0
    for _ in range(ROUNDS):
        won = 50.0 * random.binomial(1, 0.95, 20)
        e = estimate_share(won, np.full(20, 50.0), LEVEL)
        held += e.low <= 0.95 <= e.high
    assert 0.93 <= held / ROUNDS <= 0.99
    assert math.isnan(estimate_share(np.array([30.0]), np.array([50.0]), LEVEL).low)
    assert estimate_share(np.array([1.0]), np.array([1.0]), LEVEL).low == pytest.approx(
        0.2065, abs=1e-4
    )


@pytest.mark.parametrize(("method", "count"), [("t", 10), ("t", 40), ("bootstrap", 10)])
def test_paired_differences(method: str, count: int) -> None:
    def pairs(random: Random) -> tuple[np.ndarray, np.ndarray]:
        first = random.normal(0.0, 5.0, count)
        return first, first + random.gamma(36.0, 1 / 12, count)

    found = coverage(lambda r: estimate_difference(*pairs(r), LEVEL, method).paired, 3.0, 1000)
    assert 0.93 <= found <= 0.97


@pytest.mark.parametrize("count", [10, 30, 100])
def test_unpaired_differences_of_unlike_spreads(count: int) -> None:
    found = coverage(
        lambda r: estimate_difference(r.normal(0, 1, count), r.normal(2, 3, count), LEVEL).unpaired,
        2.0,
    )
    assert 0.93 <= found <= 0.97


@pytest.mark.parametrize(("up", "down"), [(0.3, 0.1), (0.5, 0.3), (0.1, 0.05), (0.02, 0.01)])
@pytest.mark.parametrize("count", [15, 60, 200])
def test_paired_differences_of_events(count: int, up: float, down: float) -> None:
    def paired(random: Random) -> Estimate:
        u = random.random(count)
        first, second = (u < down) * 1.0, ((u > 1.0 - up) * 1.0)
        return estimate_difference(first, second, LEVEL, kind="event").paired

    found = coverage(paired, up - down)
    rare = (up + down) * count < 10
    assert 0.93 <= found <= (1.0 if rare else 0.97)


@pytest.mark.parametrize(("one", "other"), [(0.3, 0.5), (0.1, 0.15), (0.9, 0.97)])
@pytest.mark.parametrize("count", [30, 100])
def test_unpaired_differences_of_events(count: int, one: float, other: float) -> None:
    def unpaired(random: Random) -> Estimate:
        first, second = (random.random(count) < one) * 1.0, (random.random(count) < other) * 1.0
        return estimate_difference(first, second, LEVEL, kind="event").unpaired

    assert 0.93 <= coverage(unpaired, other - one) <= 0.995
    alike = estimate_difference(np.ones(count), np.ones(count), LEVEL, kind="event").unpaired
    # Agresti and Caffo: (count + 1) / (count + 2) of both, and no point.
    p = (count + 1) / (count + 2)
    assert alike.high == pytest.approx(
        1.959964 * math.sqrt(2 * p * (1 - p) / (count + 2)), rel=1e-6
    )
    assert (alike.value, alike.low) == (0.0, -alike.high)


def test_where_no_unit_differs_outcomes_may_still_differ_elsewhere() -> None:
    same = np.ones(60)
    found = estimate_difference(same, same, LEVEL, kind="event").paired
    assert found.value == 0.0 and -0.06 < found.low < -0.03 and 0.03 < found.high < 0.06
    numbers = estimate_difference(same, same, LEVEL).paired
    assert numbers.low == numbers.high == 0.0


def test_latin_hypercubes_are_never_too_narrow() -> None:
    draw = parse_draw("blocks.a.x_m", {"latin_hypercube": [0, 1]})
    random, held = np.random.default_rng(4), 0
    for seed in range(ROUNDS // 4):
        values = np.array([float(draw.value(seed, k, 20)) for k in range(20)])
        e = estimate_mean(values + random.normal(0.0, 1.0, 20), LEVEL)
        held += e.low <= 0.5 <= e.high
    assert held / (ROUNDS // 4) >= 0.93


@pytest.mark.parametrize(("half_width", "event"), [(0.25, False), (0.4, False), (0.1, True)])
def test_cells_that_stop_when_their_interval_is_narrow(half_width: float, event: bool) -> None:
    def stopped(random: Random) -> Estimate:
        values = (random.random(200) < 0.1) * 1.0 if event else random.normal(0.1, 1.0, 200)
        for end in range(10, 201, 10):
            e = (
                estimate_share(values[:end], np.ones(end), LEVEL)
                if event
                else estimate_mean(values[:end], LEVEL)
            )
            if e.half_width <= half_width:
                return e
        return e

    assert 0.93 <= coverage(stopped, 0.1) <= 0.975


RESULTS = [Result("time_s", NUMBER, ""), Result("seen", EVENT, ""), Result("looks", SHARE, "")]
#: Means of the population from which `folder_study` draws encounters.
TRUTHS = {"time_s": 7.0, "seen": 0.6, "looks": 0.6}
STEP_S, FASTER = 1.5, 0.4


def folder_study(random: Random, files: int, replicas: int, *, same_draws: bool) -> pa.Table:
    """Return the rows of a study of encounters at two rates, drawn from a population.

    Half of the variance lies between encounters. With `same_draws` replica k has the same chances
    in all encounters, as if aircraft of the same name were one.
    """
    size = (files, 1, 1)
    own = random.normal(0.0, 1.0, size)
    chance = random.beta(6.0, 4.0, size)
    shape = (1 if same_draws else files, 1, replicas)
    noise, u = random.normal(0.0, 1.0, shape), random.random(shape)
    luck = random.random((1 if same_draws else files, 1, replicas, 20))
    rate = np.array([0.0, 1.0]).reshape(1, 2, 1)
    time = 7.0 + own + noise + rate * (STEP_S + 0.5 * random.normal(0.0, 1.0, (files, 2, replicas)))
    likely = chance - FASTER * chance * rate
    seen = (u < likely) * np.ones((files, 2, replicas))
    looks = (luck < likely[..., None]).mean(axis=-1) * np.ones((files, 2, replicas))
    index = np.indices((files, 2, replicas))
    columns = {
        "cell": index[0] * 2 + index[1], "replica": index[2], "rate_hz": index[1] * 1.0,
        "file": index[0], "time_s": time, "seen": seen, "looks": looks,
        "looks" + TRIALS: np.full(time.shape, 20.0),
    }  # fmt: skip
    table = {name: pa.array(values.ravel()) for name, values in columns.items()}
    table["file"] = pa.array([f"{k:03d}.daa" for k in columns["file"].ravel()])
    count = time.size
    table["status"] = pa.array(["done"] * count)
    table["error"] = pa.array([None] * count, pa.string())
    return pa.table(table)


def covered(rounds: int, *, files: int, replicas: int, same_draws: bool) -> dict[str, float]:
    """Return how often the summary and the differences of folder studies hold the truth."""
    random = np.random.default_rng(7)
    held: dict[str, int] = {}
    for _ in range(rounds):
        table = folder_study(random, files, replicas, same_draws=same_draws)
        rows = rows_of_table(table, ["file", "rate_hz"], ["file"])
        for line in summarise(rows, RESULTS, LEVEL, "t", {}):
            if line.at == (0.0,):
                name, e = line.result.name, line.estimate
                assert e.count == files
                held[name] = held.get(name, 0) + (e.low <= TRUTHS[name] <= e.high)
        for item in compare_axis(rows, "rate_hz", 0.0, RESULTS, LEVEL, "t"):
            name, d = f"change of {item.result.name}", item.difference.paired
            truth = STEP_S if item.result.kind == NUMBER else -FASTER * TRUTHS["seen"]
            held[name] = held.get(name, 0) + (d.low <= truth <= d.high)
    return {name: count / rounds for name, count in held.items()}


@pytest.mark.parametrize(("files", "replicas"), [(12, 5), (40, 1)])
def test_a_folder_speaks_of_encounters_like_these(files: int, replicas: int) -> None:
    found = covered(1000, files=files, replicas=replicas, same_draws=False)
    assert len(found) == 6
    for name, share_held in found.items():
        assert 0.93 <= share_held <= 0.98, name


def test_encounters_that_shared_their_draws_would_be_found_out() -> None:
    found = covered(100, files=60, replicas=2, same_draws=True)
    assert found["time_s"] < 0.5 and found["seen"] < 0.5


def test_of_these_encounters_alone_an_interval_is_too_wide_never_too_narrow() -> None:
    random = np.random.default_rng(8)
    own = random.normal(7.0, 1.0, (25, 1))
    held = 0
    for _ in range(ROUNDS // 2):
        e = estimate_mean((own + random.normal(0.0, 1.0, (25, 4))).mean(axis=1), LEVEL)
        held += e.low <= own.mean() <= e.high
    assert held / (ROUNDS // 2) >= 0.97


def test_runs_are_paired_before_encounters_are_averaged() -> None:
    # The first condition has no value in the hard run of the first encounter: what the second has
    # there is compared with nothing.
    first = np.array([1.0, np.nan, 4.0, 5.0, np.nan, 3.0])
    second = np.array([2.0, 90.0, 6.0, 7.0, 8.0, np.nan])
    units, one, two = paired_unit_means(np.array([5, 5, 7, 7, 8, 9]), first, second)
    assert units.tolist() == [5, 7, 8, 9]
    assert one.tolist()[:2] == [1.0, 4.5] and two.tolist()[:2] == [2.0, 6.5]
    assert math.isnan(one[2]) and two[2] == 8.0
    assert one[3] == 3.0 and math.isnan(two[3])
