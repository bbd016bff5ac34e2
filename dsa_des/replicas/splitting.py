"""Splitting: the probability of a rare event, from runs that branch where they come near it.

A *repetition* begins with some runs. Those that reach the first level of a score are branched
there: the next stage has as many runs again, each of which is one of these up to the instant at
which it reached the level, and draws by a seed of its own from then on (`dsa_des.time.randomness`).
So it goes on from level to level, and the last one is the event itself. With weights w of the first
runs, and those of a stage sharing the weight of all that reached its level, the estimate

    P = (weight of the runs of the last stage that come to the event) / Σ w

is unbiased for fixed levels and equal weights, wherever the levels are: bad ones cost width, never
truth. A repetition none of whose runs reaches a level has *collapsed*: its P is 0 and counts.
Repetitions are independent, and the interval is that of the mean of their P.

A branch flies again, on the same draws, what it has in common with the run that it comes from: no
block's memory is copied, so blocks of any kind can branch.

H. Kahn & T. E. Harris, "Estimation of particle transmission by random sampling", National Bureau of
Standards AMS 12, 1951; P. Glasserman, P. Heidelberger, P. Shahabuddin & T. Zajic, "Multilevel
splitting for estimating rare event probabilities", Operations Research 47, 1999. The levels are
found as by F. Cérou & A. Guyader, "Adaptive multilevel splitting for rare event analysis",
Stochastic Analysis and Applications 25, 2007, from a pilot of runs that count for nothing else.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.replicas.changed_scene import Replica
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.randomness import branch_seed, key_of

#: A level of the pilot is reached by at least so many of its runs, where one is.
_SHARE = 0.2
#: A pilot has no more stages.
_MOST_STAGES = 60
#: When a run comes within a level is known to a millisecond: a branch draws from then on, ns.
_SURELY_NS = 2_000_000


@dataclass(frozen=True)
class FlownRuns:
    """When runs first reached some levels, s, (levels, runs); NaN for never.

    The weights (runs,) say how often each happens; `errors` has a text for each that failed.
    """

    reached_s: FloatArray
    weights: FloatArray
    errors: Sequence[str | None]


#: Flies runs, each of a repetition of some number (the pilot is -1), and looks when they reach some
#: levels, which fall.
Fly = Callable[[Sequence[Replica], IntArray, Sequence[float]], FlownRuns]


@dataclass(frozen=True)
class Repeated:
    """A repetition's estimated probability, and what one more run with the event would add."""

    probability: float
    unseen: float
    flown: int
    error: str | None = None


class _Repetition:
    """The runs of one repetition in its present stage, with their weights."""

    def __init__(self, seed: int, roots: Sequence[Replica]) -> None:
        self._seed, self.runs = seed, list(roots)
        self.weights, self._whole = np.ones(len(roots)), 0.0
        self.stage = self.flown = 0
        self.error: str | None = None
        #: The weight of the runs of this stage by that of all first runs; and of one of them.
        self.share, self.unseen = 1.0, 1.0 / len(roots)

    def count_runs_and_set_weights(self, weights: FloatArray) -> None:
        """Count the runs of this stage as flown, and in the first stage set their weights."""
        self.flown += len(self.runs)
        if self.stage == 0:
            self.weights, self._whole = weights, float(weights.sum())

    def branch_at_next_level(self, reached_s: FloatArray) -> None:
        """Replace the runs by branches of those that reached the next level, at the given times
        (NaN: not reached); no runs are left if none did.
        """
        some = np.flatnonzero(~np.isnan(reached_s))
        total = float(self.weights[some].sum())
        if not total > 0.0:
            self.runs = []
            return
        self.stage, count = self.stage + 1, len(self.runs)
        self.share = total / self._whole
        self.unseen = self.share / count
        uniform = (key_of(self._seed, "branches", self.stage) >> 11) * 2.0**-53
        parents = some[parent_indices_of_branches(self.weights[some], count, uniform)]
        self.runs = [
            Replica(
                branch_seed(
                    self.runs[k].seed, branch_instant_ns(reached_s[k]), self._seed_of(number)
                ),
                self.runs[k].changes,
            )
            for number, k in enumerate(parents.tolist())
        ]
        self.weights = np.full(count, total / count)

    def _seed_of(self, number: int) -> int:
        return key_of(self._seed, "branch", self.stage, number) >> 1


def parent_indices_of_branches(weights: FloatArray, count: int, uniform: float) -> IntArray:
    """Return the index of each of `count` branches' parent, in proportion to the weights.

    Of every run there are as many as expected, to the whole number below or above (systematic
    resampling): no run is left out of equal ones.
    """
    ends = np.cumsum(weights)
    places = (np.arange(count) + uniform) * (ends[-1] / count)
    return np.minimum(np.searchsorted(ends, places, side="right"), len(weights) - 1)


def branch_instant_ns(reached_s: float) -> int:
    """Return from when, ns since the start, a branch at `reached_s` draws new random numbers."""
    return math.ceil(reached_s * NANOSECONDS) + _SURELY_NS


def run_repetitions(
    repetitions: Sequence[Sequence[Replica]],
    seeds: Sequence[int],
    levels: Sequence[float],
    fly: Fly,
) -> list[Repeated]:
    """Repeat multilevel splitting, each time from its own starting runs; return all results.

    `levels` end with the event itself, and `seeds` are those of the repetitions. They fly together,
    stage by stage, and know nothing of each other.
    """
    every = [_Repetition(*both) for both in zip(seeds, repetitions, strict=True)]
    for level in levels:
        going = [k for k, one in enumerate(every) if one.runs and not one.error]
        if not going:
            break
        runs = [run for k in going for run in every[k].runs]
        of = np.repeat(going, [len(every[k].runs) for k in going])
        flown, end = fly(runs, of, [level]), 0
        for one in (every[k] for k in going):
            mine = slice(end, end := end + len(one.runs))
            one.error = next((text for text in flown.errors[mine] if text), None)
            if one.error is None:
                one.count_runs_and_set_weights(flown.weights[mine])
                one.branch_at_next_level(flown.reached_s[0, mine])
    return [
        Repeated(one.share if one.runs else 0.0, one.unseen, one.flown, one.error) for one in every
    ]


def find_levels(
    roots: Sequence[Replica], seed: int, candidates: FloatArray, fly: Fly
) -> tuple[float, ...]:
    """Return splitting levels among `candidates`, by flying a pilot from given starting runs.

    Each is the smallest that a fifth of the runs of a stage reach, or else the next one that any
    does; the last is the event itself. ValueError if no run comes nearer, or a run fails.
    """
    pilot = _Repetition(seed, roots)
    levels: list[float] = []
    for _ in range(_MOST_STAGES):
        flown = fly(pilot.runs, np.full(len(roots), -1), candidates.tolist())
        if said := next((text for text in flown.errors if text), None):
            raise ValueError(f"of the pilot of splitting: {said}")
        pilot.count_runs_and_set_weights(flown.weights)
        share = (~np.isnan(flown.reached_s) @ pilot.weights) / pilot.weights.sum()
        nearer = np.flatnonzero((share > 0.0) & (candidates < (levels[-1] if levels else np.inf)))
        if not len(nearer):
            break
        usual = nearer[share[nearer] >= _SHARE]
        level = int(usual[-1] if len(usual) else nearer[0])
        levels.append(float(candidates[level]))
        if level == len(candidates) - 1:
            return tuple(levels)
        pilot.branch_at_next_level(flown.reached_s[level])
    so_far = f" that came to a score of {levels[-1]:.4g}" if levels else ""
    raise ValueError(
        f"the score never rises: of {len(roots)} runs of the pilot of splitting{so_far} none comes "
        "nearer to the event, whatever is drawn from then on; take another splitting.score, more "
        "splitting.runs, or splitting.levels of your own"
    )
