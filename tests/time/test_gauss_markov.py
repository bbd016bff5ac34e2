"""A process that lasts: its covariance exactly, its draws by statistics, and what it depends on."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from dsa_des.time.gauss_markov import LONGEST_S, MOST_PROCESSES, GaussMarkov
from dsa_des.time.randomness import Stream, target_keys

LOOKS = 100_000
#: Of 99 % bounds, over all statistics of a test.
ONE_IN_A_HUNDRED = 0.01


def process(tau_s: float, seed: int = 1) -> GaussMarkov:
    return GaussMarkov(Stream(seed, "radar", "errors"), tau_s)


class OneDraw:
    """Stands for a stream: notes which draws are asked for, or gives 1 for one of them, else 0."""

    branches = 0

    def __init__(self):
        self.known = {}

    def of_runs(self, run):
        assert not run.any()  # a stream of one run is that of all its rows
        return self

    def three_normals(self, targets, scans, draw):
        targets = np.broadcast_to(targets, scans.shape)
        self.found = []
        columns = []
        for which in range(3):
            keys = [(int(s) & 0xFFFFFFFFFF, int(t), draw, which)
                    for t, s in zip(targets, scans, strict=True)]  # fmt: skip
            place = np.array([self.known.setdefault(key, len(self.known)) for key in keys])
            columns.append((place == self.wanted).astype(float))
        return tuple(columns)


@pytest.mark.parametrize("tau_s", [1e-9, 1e-3, 300.0, LONGEST_S])
def test_its_covariance_is_exponential_to_the_last_digits(tau_s):
    """The weights of all draws in each value, multiplied out."""
    days = 90 * 86400 * 10**9
    lags = [0.0, 1e-7, 1e-3, 0.3, 1.0, 1.01, 7.0, 63.9, 64.0]
    instants = np.array([days + int(tau_s * 1e9 * lag) for lag in lags])
    stream = OneDraw()
    made = GaussMarkov(stream, tau_s)
    stream.wanted = -1
    made(np.uint64(3), instants)
    weights = []
    for draw in range(len(stream.known)):
        stream.wanted = draw
        weights.append(made(np.uint64(3), instants))
    covariance = np.array(weights).T @ np.array(weights)
    apart = np.abs(instants[:, np.newaxis] - instants) / 1e9
    np.testing.assert_allclose(covariance, np.exp(-apart / tau_s), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("tau_s", [1e-3, 40.0])
def test_over_many_targets_it_is_standard_normal_with_the_stated_correlation(tau_s):
    keys = target_keys(tuple(f"t{i}" for i in range(LOOKS)))
    start = np.arange(LOOKS) * 86_400_000_017 % (5 * 86400 * 10**9)
    first = process(tau_s)(keys, start)
    lags = [1e-4, 0.01, 0.3, 1.0, 3.0]
    z = NormalDist().inv_cdf(1.0 - ONE_IN_A_HUNDRED / 2.0 / (2 * len(lags) + 3))
    assert abs(first.mean()) < z / math.sqrt(LOOKS)
    assert abs(first.var() - 1.0) < z * math.sqrt(2.0 / LOOKS)
    assert abs((first**4).mean() - 3.0) < z * math.sqrt(96.0 / LOOKS)
    for lag in lags:
        step = max(1, round(lag * tau_s * 1e9))
        later = process(tau_s)(keys, start + step)
        rho = math.exp(-step / 1e9 / tau_s)
        off = (first * later).mean() - rho
        assert abs(off) < z * math.sqrt((1.0 + rho**2) / LOOKS)
        grown = ((later - first) ** 2).mean() / (2.0 * -math.expm1(-step / 1e9 / tau_s))
        assert abs(grown - 1.0) < z * math.sqrt(2.0 / LOOKS)


def test_along_one_path_what_is_new_is_white():
    """The innovations of a recursion from look to look are independent standard normals."""
    tau_s, period_s = 2.0, 0.1
    instants = np.arange(LOOKS // 4) * int(period_s * 1e9) + 123_456_789
    path = process(tau_s)(np.uint64(77), instants)
    rho = math.exp(-period_s / tau_s)
    new = (path[1:] - rho * path[:-1]) / math.sqrt(1.0 - rho**2)
    z = NormalDist().inv_cdf(1.0 - ONE_IN_A_HUNDRED / 2.0 / 8.0)
    assert abs(new.mean()) < z / math.sqrt(len(new))
    assert abs(new.var() - 1.0) < z * math.sqrt(2.0 / len(new))
    for lag in (1, 2, 3, 5, 10, 50):
        assert abs((new[lag:] * new[:-lag]).mean()) < z / math.sqrt(len(new) - lag)


def test_a_value_depends_on_key_and_instant_alone():
    keys = target_keys(("a", "b", "c"))
    instants = np.arange(300) * 37_000_001
    who = np.tile(keys, 100)
    whole = process(0.5)(who, instants)
    order = np.random.default_rng(3).permutation(300)
    assert (process(0.5)(who[order], instants[order]) == whole[order]).all()
    for part in (slice(0, 1), slice(5, 18), slice(13, 14), slice(100, 290, 7)):
        assert (process(0.5)(who[part], instants[part]) == whole[part]).all()
    alone = [process(0.5)(who[i : i + 1], instants[i : i + 1])[0] for i in range(0, 300, 31)]
    assert alone == whole[::31].tolist()


def test_scan_rates_see_one_process():
    slow, fast = np.arange(50) * 200_000_000, np.arange(1000) * 10_000_000
    assert (process(3.0)(np.uint64(1), fast)[::20] == process(3.0)(np.uint64(1), slow)).all()


def test_targets_processes_streams_and_seeds_are_independent():
    instants = np.arange(2000) * 10**9
    first = process(0.1)(np.uint64(1), instants)
    others = [
        process(0.1)(np.uint64(2), instants),
        process(0.1)(np.uint64(1), instants, process=1),
        process(0.1, seed=2)(np.uint64(1), instants),
        GaussMarkov(Stream(1, "radar", "other"), 0.1)(np.uint64(1), instants),
    ]
    for other in others:
        assert abs(np.corrcoef(first, other)[0, 1]) < 0.08


def test_replicas_in_lock_step_draw_as_each_by_itself():
    seeds = [5, 9, 12]
    together = GaussMarkov(Stream(seeds, "radar", "errors"), 0.7)
    replica = np.repeat(np.arange(3), 40)
    instants = np.tile(np.arange(40) * 10**14, 3)
    values = together(np.uint64(8), instants, 2, replica).reshape(3, 40)
    for seed, row in zip(seeds, values, strict=True):
        assert (process(0.7, seed)(np.uint64(8), instants[:40], 2) == row).all()


@pytest.mark.parametrize("tau_s", [0.0, -1.0, math.nan, math.inf, 2.0 * LONGEST_S])
def test_no_correlation_time(tau_s):
    with pytest.raises(ValueError, match="correlation_time_s is"):
        process(tau_s)


def test_too_many_processes():
    with pytest.raises(ValueError, match="process is 2048"):
        process(1.0)(np.uint64(1), np.arange(3), MOST_PROCESSES)
