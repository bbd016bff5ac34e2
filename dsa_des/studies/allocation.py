"""Which runs are flown where all are known without flying: drawn by what they can contribute.

A study of a ratio knows of every run what happens without a remedy, and its geometry x, for a
twentieth of the cost of flying it with one. A run is flown with a probability π(x) of its own and
stands for 1/π runs (`dsa_des.results.ratio`). π follows from the chance p(x) of each event: in the
first round, of `PILOT` runs, from what metrics expect; then from a logistic model beside it, learnt
from all that was flown before. An event that was seen often enough is *predicted*: every run counts
with a chance that was learnt from other runs, and those flown correct it. A wrong p(x) costs width,
never truth. With weights w and nominal flags n the variance of a ratio R is that of
Σ w (m/π - R n), or of Σ w (p + (m - p)/π - R n) with a prediction, of which only Σ w² q/π depends
on π, with q = p, or q = p (1 - p); so with costs c of knowing and 1 of flying

    π ∝ w √(Σ_e q_e / V_e),   of the size that makes  Σ_e V_e(π) / V_e · (Σ π + N c)  least,

V_e being the variance of event e with every run flown. It is Neyman's rule for a sample in two
phases, with the difference estimator where events are predicted (J. Neyman, "Contribution to the
theory of sampling human populations", Journal of the American Statistical Association 33, 1938;
C.-E. Särndal, B. Swensson & J. Wretman, "Model assisted survey sampling", 1992, chapters 6 and 9).
No π is below `LEAST`, and in the first round below `FIRST_LEAST`: what nobody expects must be seen
too, and weighs 1/π then. Rounds are few, because each flies a lock step of its own, whose windows
cost as much as a thousand runs.

Pure functions of arrays; which columns they are is said by `dsa_des.studies.foreseen_runs`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.results.ratio import FORESEEN_COST

#: Runs of the first round of a cell, and how many times as many are known after each round.
PILOT, GROWTH = 500, 20
#: A round that would begin within the last third of the runs is none.
_LAST_THIRD = 1.5
#: The least probability to be flown, and before anything is learnt.
LEAST, FIRST_LEAST = 0.02, 0.3
#: All are flown unless a sample is expected to cost less than this for the same width.
_WORTH_IT = 0.8
#: The chance that is expected of an event of which nothing is told.
UNTOLD = 0.05
#: An event is predicted once it was seen so often. With fewer a ratio could come out negative.
PREDICTED_FROM = 50
# A prediction is never taken for surer than that.
_SUREST = 0.95
# Standard deviations of the model's coefficients before anything is flown: of the level, of how far
# what is expected is believed, and for one standard deviation of geometry, or its square.
_LEVEL_SD, _BELIEF_SD, _SLOPE_SD = 3.0, 0.5, 0.25
_ITERATIONS = 50
# Sizes of π that are tried.
_SIZES = np.geomspace(1e-3, 1e6, 200)
# No chance is taken for nothing, or for certain.
_LEAST_CHANCE = 1e-12


@dataclass(frozen=True)
class ForeseenRuns:
    """What is known of runs before flight: geometry, nominal events, expected chances, weights.

    Geometry (numbers, runs); nominal flags (events, runs), 0 outside an event's class; the chance
    of each event that is expected before anything is flown (events, runs); weights (runs,).
    """

    geometry: FloatArray
    nominal: FloatArray
    expected: FloatArray
    weight: FloatArray


@dataclass(frozen=True)
class Allocation:
    """A plan of the probability of flying each run of a cell, from what is known beforehand."""

    middle: FloatArray
    spread: FloatArray
    #: Of the logistic models, (events, without and with the nominal event, coefficients).
    coefficients: FloatArray
    #: 1 / V of each event, (events,).
    precision: FloatArray
    #: How much π is for each w √(Σ q/V); infinite where all are flown.
    size: float
    #: Which events are predicted.
    predicted: BoolArray
    #: The least probability.
    least: float = LEAST
    #: Of the runs it was learnt from, so many would be flown.
    share: float = 1.0

    def probabilities(self, runs: ForeseenRuns) -> FloatArray:
        """Return the probability with which each run is flown, (runs,)."""
        left = sampling_variance(self._chances(runs), self.predicted)
        worth = np.sqrt(_weighted_sum(self.precision, left))
        return flight_probabilities(runs.weight * worth, self.size, self.least)

    def predicted_event_chances(self, runs: ForeseenRuns) -> FloatArray:
        """Return each event's predicted chance in each run, (events, runs), 0 if not predicted."""
        return np.where(self.predicted[:, np.newaxis], self._chances(runs), 0.0)

    def _chances(self, runs: ForeseenRuns) -> FloatArray:
        terms = logistic_model_terms(self._standardise_geometry(runs.geometry), runs.nominal)
        return event_chances(terms, runs, self.coefficients)

    def _standardise_geometry(self, geometry: FloatArray) -> FloatArray:
        away = geometry - self.middle[:, None]
        return np.where(np.isfinite(away), away, 0.0) / self.spread[:, None]


def flight_probabilities(worth: FloatArray, size: float, least: float) -> FloatArray:
    """Return the probability to fly each run: `size` times `worth`, held between `least` and 1."""
    if not np.isfinite(size):
        return np.ones(len(worth))
    result: FloatArray = np.clip(size * worth, least, 1.0)
    return result


def sampling_variance(chance: FloatArray, predicted: BoolArray) -> FloatArray:
    """Return each event's part of variance due to how often its run is flown, (events, runs)."""
    sure = np.clip(chance, None, _SUREST)
    return np.where(predicted[:, np.newaxis], sure * (1.0 - sure), chance)


def logistic_model_terms(scaled: FloatArray, nominal: FloatArray) -> FloatArray:
    """Return the logistic model's terms, (terms, runs): geometry, its squares, nominal flags."""
    within = np.clip(scaled, -4.0, 4.0)
    return np.concatenate([within, within**2 - 1.0, nominal])


def event_chances(terms: FloatArray, runs: ForeseenRuns, coefficients: FloatArray) -> FloatArray:
    """Return the chance of each event in each run by the logistic models, (events, runs)."""
    offset = _logit(runs.expected)
    without, having = (
        np.array(
            [
                _weighted_sum(c[k], _design_matrix(terms, of))
                for c, of in zip(coefficients, offset, strict=True)
            ]
        )
        for k in (0, 1)
    )
    score = np.where(runs.nominal > 0.0, having, without) + offset
    result: FloatArray = np.clip(_logistic(score), _LEAST_CHANCE, 1.0 - _LEAST_CHANCE)
    return result


def learn_allocation(
    runs: ForeseenRuns, happened: FloatArray, stands_for: FloatArray, least: float = LEAST
) -> Allocation:
    """Return the plan for further runs of a cell, learnt from earlier runs of it, flown or not.

    Parameters
    ----------
    runs : ForeseenRuns
    happened : (events, runs)
        Whether each event happened with the remedy; of those not flown anything.
    stands_for : (runs,)
        For how many each stands, 0 of those not flown; where none is, what is expected counts.
    least : float
        The least probability.
    """
    there = np.isfinite(runs.geometry)
    many = np.maximum(there.sum(axis=1), 1)
    middle = np.where(there, runs.geometry, 0.0).sum(axis=1) / many
    away = np.where(there, runs.geometry, middle[:, None]) - middle[:, None]
    spread = np.sqrt((away**2).sum(axis=1) / many)
    spread = np.where(spread > 0.0, spread, 1.0)
    terms = logistic_model_terms(away / spread[:, None], runs.nominal)
    flown = stands_for > 0.0
    fitted = np.zeros((len(happened), 2, 2 + len(terms)))
    for event, (n, e, m) in enumerate(zip(runs.nominal, runs.expected, happened, strict=True)):
        for having in (0, 1):
            some = flown & ((n > 0.0) == having)
            weight = stands_for[some] / stands_for[some].mean() if some.any() else np.empty(0)
            fitted[event, having] = fit_logistic_coefficients(
                terms[:, some], e[some], m[some], weight
            )
    predicted = np.where(flown, happened, 0.0).sum(axis=1) >= PREDICTED_FROM
    precision, size = best_probability_scale(
        runs, event_chances(terms, runs, fitted), predicted, least
    )
    plan = Allocation(middle, spread, fitted, precision, size, predicted, least)
    return replace(plan, share=float(plan.probabilities(runs).mean()))


def best_probability_scale(
    runs: ForeseenRuns, chance: FloatArray, predicted: BoolArray, least: float
) -> tuple[FloatArray, float]:
    """Return (1/V of each event, scale of the flight probabilities) with the least variance times
    cost; an infinite scale flies all.
    """
    w, n = runs.weight, runs.nominal
    below = (w * n).sum(axis=1)
    there = below > 0.0
    ratio = np.where(there, (w * chance).sum(axis=1) / np.where(there, below, 1.0), 0.0)[:, None]
    left = sampling_variance(chance, predicted)
    fixed = (w**2 * (chance - left + ratio**2 * n - 2.0 * ratio * chance * n)).sum(axis=1)
    all_flown = (w**2 * left).sum(axis=1) + fixed
    counts = there & (all_flown > 0.0)
    precision = np.where(counts, 1.0 / np.where(counts, all_flown, 1.0), 0.0)
    if not counts.any():
        return precision, np.inf
    open_ = _weighted_sum(precision, left)
    worth = w * np.sqrt(open_)
    scale = 1.0 / max(float(worth.max()), 1e-300)
    costs = []
    for size in _SIZES * scale:
        pi = flight_probabilities(worth, size, least)
        variance = float((w**2 * open_ / pi).sum() + precision @ fixed)
        costs.append(variance * (float(pi.mean()) + FORESEEN_COST))
    best = int(np.argmin(costs))
    # Flying all tells the nominal runs by the way.
    worth_it = costs[best] < _WORTH_IT * counts.sum()
    return precision, float(_SIZES[best] * scale) if worth_it else np.inf


def fit_logistic_coefficients(
    terms: FloatArray, expected: FloatArray, happened: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return likeliest logistic coefficients of an event (level, weight of chances, slopes).

    Newton's method on the logarithm of the likelihood and of a normal distribution of the
    coefficients (level, belief, slopes); with no event at all it stays near what was expected. A
    belief of 0 takes the logit of that as it is, one of -1 not at all.
    """
    offset = _logit(expected)
    design = _design_matrix(terms, offset)
    sd = np.full(len(design), _SLOPE_SD)
    sd[:2] = _LEVEL_SD, _BELIEF_SD
    prior, at = np.diag(1.0 / sd**2), np.zeros(len(design))

    def negative_log_posterior(coefficients: FloatArray) -> float:
        score = design.T @ coefficients + offset
        likely = weight @ (np.logaddexp(0.0, score) - happened * score)
        return float(likely + 0.5 * coefficients @ prior @ coefficients)

    for _ in range(_ITERATIONS):
        p = _logistic(design.T @ at + offset)
        slope = design @ (weight * (p - happened)) + prior @ at
        curve = (design * (weight * p * (1.0 - p))) @ design.T + prior
        step = np.linalg.solve(curve, slope)
        part, here = 1.0, negative_log_posterior(at)
        while part > 1e-6 and negative_log_posterior(at - part * step) > here:
            part /= 2.0
        at = at - part * step
        if np.abs(part * step).max() < 1e-8:
            break
    return at


def _weighted_sum(factors: FloatArray, terms: FloatArray) -> FloatArray:
    """Return the sum of terms (k, runs) times factors (k,), rounded alike for one run and many."""
    result = np.zeros(terms.shape[1])
    for factor, term in zip(factors.tolist(), terms, strict=True):
        result += factor * term
    return result


def _design_matrix(terms: FloatArray, offset: FloatArray) -> FloatArray:
    return np.concatenate([np.ones((1, len(offset))), offset[np.newaxis], terms])


def _logit(expected: FloatArray) -> FloatArray:
    p = np.clip(expected, _LEAST_CHANCE, 1.0 - _LEAST_CHANCE)
    result: FloatArray = np.log(p / (1.0 - p))
    return result


def _logistic(score: FloatArray) -> FloatArray:
    result: FloatArray = 0.5 * (1.0 + np.tanh(0.5 * score))
    return result


def round_ends(replicas: int, batch: int | None) -> list[int]:
    """Return the replica before which each round ends: rounds of `batch`, or else growing ones."""
    if batch is not None:
        return [min(end, replicas) for end in range(batch, replicas + batch, batch)]
    ends, end = [], PILOT
    while end * _LAST_THIRD < replicas:
        ends.append(end)
        end *= GROWTH
    return [*ends, replicas]


def sample_runs_to_fly(
    probability: FloatArray, uniform: Sequence[float]
) -> tuple[BoolArray, FloatArray]:
    """Return a mask of the runs drawn, and how many runs each stands for: 1 / probability or 0."""
    flown = np.asarray(uniform) < probability
    return flown, np.where(flown, 1.0 / probability, 0.0)
