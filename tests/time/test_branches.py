"""Runs that branch: as the run they come from before, and by draws of their own after."""

import pickle

import numpy as np

from dsa_des.time.gauss_markov import GaussMarkov
from dsa_des.time.randomness import BranchedSeed, Streams, branch_seed

S = 10**9
SECONDS = np.arange(12)


def drawn(seeds: list[int], *, timed: bool = True) -> np.ndarray:
    """A draw at every second of each run."""
    run, second = np.repeat(np.arange(len(seeds)), 12), np.tile(SECONDS, len(seeds))
    stream = Streams(seeds).stream("block", "purpose").of_runs(run, second * S if timed else None)
    return stream.uniform(np.zeros(len(run), np.uint64), second).reshape(-1, 12)


def test_a_branch_draws_as_its_run_up_to_its_instant():
    first = branch_seed(1, 5 * S, 77)
    one, two, late, plain, other = drawn(
        [first, branch_seed(first, 8 * S, 5), branch_seed(1, 12 * S, 9), 1, 2]
    )
    np.testing.assert_array_equal(one == plain, SECONDS < 5)
    np.testing.assert_array_equal(two == one, SECONDS < 8)
    np.testing.assert_array_equal(two == plain, SECONDS < 5)
    np.testing.assert_array_equal(late, plain)
    assert not (other == plain).any()


def test_what_branches_draw_is_what_a_run_of_that_seed_would():
    (one,) = drawn([branch_seed(1, 5 * S, 77)])
    np.testing.assert_array_equal(one, drawn([branch_seed(1, 5 * S, 77), 3])[0])
    np.testing.assert_array_equal(one[5:], drawn([77])[0][5:])


def test_an_earlier_branch_replaces_the_later_ones():
    again = branch_seed(branch_seed(1, 8 * S, 5), 3 * S, 7)
    assert again.branches == ((3 * S, 7),)
    np.testing.assert_array_equal(drawn([again]), drawn([BranchedSeed(1, [(3 * S, 7)])]))


def test_what_is_of_no_instant_stays_as_it_is():
    branched, plain = drawn([branch_seed(1, 5 * S, 77), 1], timed=False)
    np.testing.assert_array_equal(branched, plain)
    stream = Streams(branch_seed(1, 0, 77)).stream("block", "purpose")
    once = np.zeros(1, np.uint64), np.zeros(1, np.int64)
    assert stream.uniform(*once) == Streams(1).stream("block", "purpose").uniform(*once)


def test_a_branched_seed_is_a_number_that_travels():
    one = branch_seed(12, 5 * S, 77)
    assert one == 12 and f"{one}" == "12"
    assert pickle.loads(pickle.dumps(one)).branches == one.branches == ((5 * S, 77),)


def test_chance_that_lasts_goes_on_from_where_it_was():
    """Continuous at both branches, and by the law of the process within, before and between."""
    tau_s, runs = 3.0, 2000
    at_s = np.array([3.0, 5.0, 6.0, 6.0 + 1e-9, 8.0, 11.0])
    seeds = [BranchedSeed(n, [(4 * S, 10**6 + n), (6 * S, 2 * 10**6 + n)]) for n in range(runs)]
    process = GaussMarkov(Streams(seeds).stream("block", "error"), tau_s)
    plain = GaussMarkov(Streams([*range(runs)]).stream("block", "error"), tau_s)
    key, run = np.zeros(runs, np.uint64), np.arange(runs)
    values, before = (
        np.array([one(key, np.full(runs, round(t * S)), run=run) for t in at_s])
        for one in (process, plain)
    )
    np.testing.assert_array_equal(values[0], before[0])
    assert not (values[1] == before[1]).any()
    np.testing.assert_allclose(values[2], values[3], atol=5e-4)
    known = np.exp(-np.abs(at_s[:, np.newaxis] - at_s) / tau_s)
    np.testing.assert_allclose(np.cov(values), known, atol=5.0 * np.sqrt(2.0 / runs))
