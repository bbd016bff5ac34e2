"""One filter or several side by side: prediction, moments, update and mixture."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from components.estimation import modes
from components.estimation.batched import (
    cholesky,
    is_everything,
    product_transposed,
    selected,
    solve_lower,
    squared_length,
    symmetric,
)
from components.estimation.frame import Place
from components.estimation.kalman import (
    Innovation,
    Moments,
    distance_squared,
    linear_moments,
    log_likelihood,
    updated,
    variance_of_what_is_new,
)
from components.estimation.measurement import Kind, linearised, residual
from components.estimation.motion import Motion, predict
from components.estimation.unscented import SigmaPoints, predict_unscented, unscented_moments
from dsa_des.arrays.types import FloatArray, IntArray

States = list[FloatArray]


@dataclass(frozen=True, eq=False)
class PairMeasurement:
    """What each model says of pairs of a track and a detection.

    Parameters
    ----------
    innovations : list of Innovation
        Of the pairs, for every model.
    residuals : list of (m, pairs)
    distance : (pairs,)
        Least squared Mahalanobis distance of any model.
    log_likelihoods : (models, pairs)
        Of the detection, were it the track's and the model right.
    learning : list of Innovation, or None
        Those by which tracks and models' odds are updated, where errors are not all new.
    log_odds : (models, pairs) or None
        The likelihoods by these.
    """

    innovations: list[Innovation]
    residuals: list[FloatArray]
    distance: FloatArray
    log_likelihoods: FloatArray
    learning: list[Innovation] | None = None
    log_odds: FloatArray | None = None


@dataclass(frozen=True)
class FilterBank:
    """Filters with one motion model each.

    Parameters
    ----------
    models : tuple of Motion
    rates_per_s : (models, models) array, optional
        Rates of changes of model; None for a single one.
    sigma : SigmaPoints, optional
        Take moments from sigma points; otherwise by linearisation.
    fresh : (models,) of float
        Variance of what each has besides position and velocity, in a target that enters it; empty
        where that is what the model's own filter thinks.
    """

    models: tuple[Motion, ...]
    rates_per_s: FloatArray | None = field(default=None, compare=False)
    sigma: SigmaPoints | None = None
    fresh: tuple[float, ...] = ()

    @property
    def sizes(self) -> list[int]:
        """Components of every model's state."""
        return [model.size for model in self.models]

    def predict(
        self, states: States, covariances: States, weights: FloatArray, dt_s: FloatArray
    ) -> tuple[States, States, FloatArray]:
        """Return states, covariances and models' probabilities after times (n,)."""
        if self.rates_per_s is not None:
            steps = modes.transition_probabilities(self.rates_per_s, dt_s)
            states, covariances, weights = modes.mixed(
                states, covariances, weights, steps, self.fresh
            )
        moved = [
            predict(model, x, p, dt_s)
            if self.sigma is None
            else predict_unscented(model, x, p, dt_s, self.sigma)
            for model, x, p in zip(self.models, states, covariances, strict=True)
        ]
        return [x for x, _ in moved], [p for _, p in moved], weights

    def moments(
        self, kind: Kind, states: States, covariances: States, place: Place
    ) -> list[Moments]:
        """Return what every model expects to be measured of its tracks."""
        return [
            linear_moments(*linearised(kind, x, place), p)
            if self.sigma is None
            else unscented_moments(kind, x, p, place, self.sigma)
            for x, p in zip(states, covariances, strict=True)
        ]

    def measure(
        self,
        moments: Sequence[Moments],
        track: IntArray,
        measured: FloatArray,
        variance: FloatArray,
        common: FloatArray | None,
        weights: FloatArray,
    ) -> PairMeasurement:
        """Return what every model says of pairs.

        Parameters
        ----------
        moments : sequence of Moments
        track : (pairs,)
        measured, variance : (m, pairs)
        common : (m, pairs) or None
            Covariance of each error with that of the sensor's last measurement of the track: gates
            take the whole error, updates what is new. None where all of it is.
        weights : (models, n)
            Probabilities of the tracks' models.
        """
        innovations = [found.innovation(variance, track) for found in moments]
        residuals = [residual(measured, found.expected) for found in innovations]
        distances = [distance_squared(i, r) for i, r in zip(innovations, residuals, strict=True)]
        likelihoods = np.empty((len(innovations), len(track)))
        for i, (found, apart) in enumerate(zip(innovations, distances, strict=True)):
            likelihoods[i] = log_likelihood(found, apart)
        distance = distances[0]
        for other in distances[1:]:
            distance = np.minimum(distance, other)
        if common is None:
            return PairMeasurement(innovations, residuals, distance, likelihoods)
        spread = np.zeros(variance.shape)
        for weight, said in zip(weights, moments, strict=True):
            for i in range(len(spread)):
                spread[i] += selected(weight * said.total[i, i], track)
        new = variance_of_what_is_new(variance, common, spread)
        learning = [found.innovation(new, track) for found in moments]
        odds = np.empty_like(likelihoods)
        for i, (found, apart) in enumerate(zip(learning, residuals, strict=True)):
            odds[i] = log_likelihood(found, distance_squared(found, apart))
        return PairMeasurement(innovations, residuals, distance, likelihoods, learning, odds)

    def update(
        self,
        states: States,
        covariances: States,
        weights: FloatArray,
        track: IntArray,
        pairs: PairMeasurement,
        which: IntArray,
    ) -> tuple[States, States, FloatArray]:
        """Return states, covariances and probabilities of tracks (k,) after their detections.

        Parameters
        ----------
        states, covariances, weights
            As predicted, of all tracks.
        track : (k,)
        pairs : PairMeasurement
        which : (k,)
            The pair of each.
        """
        every = is_everything(track, weights.shape[1])
        whole = is_everything(which, pairs.residuals[0].shape[1])
        moved = [
            updated(
                x if every else selected(x, track),
                p if every else selected(p, track),
                found if whole else found.take(which),
                apart if whole else selected(apart, which),
            )
            for x, p, found, apart in zip(
                states,
                covariances,
                pairs.learning or pairs.innovations,
                pairs.residuals,
                strict=True,
            )
        ]
        if len(self.models) == 1:
            new = weights if every else selected(weights, track)
        else:
            odds = pairs.log_likelihoods if pairs.log_odds is None else pairs.log_odds
            new = modes.reweighted(selected(weights, track), selected(odds, which))
        return [x for x, _ in moved], [p for _, p in moved], new


def innovation_squared(pairs: PairMeasurement, weights: FloatArray, which: IntArray) -> FloatArray:
    """Return the normalised innovations squared of pairs; of several models that of their mixture.

    Parameters
    ----------
    pairs : PairMeasurement
    weights : (models, k)
        Of each pair's track, before the look.
    which : (k,)
    """
    if len(weights) == 1:
        return pairs.distance[which]
    residuals = [selected(apart, which) for apart in pairs.residuals]
    mean = residuals[0] * weights[0]
    for weight, apart in zip(weights[1:], residuals[1:], strict=True):
        mean = mean + weight * apart
    spread = np.zeros((len(mean), *mean.shape))
    for weight, apart, found in zip(weights, residuals, pairs.innovations, strict=True):
        root, off = selected(found.root, which), apart - mean
        spread += weight * (product_transposed(root, root) + off[:, np.newaxis] * off[np.newaxis])
    return squared_length(solve_lower(cholesky(spread), mean))


def log_mixture(weights: FloatArray, log_likelihoods: FloatArray) -> FloatArray:
    """Return the logarithm of the mean likelihood over models, (models, n) → (n,)."""
    if len(weights) == 1:
        return log_likelihoods[0]
    most = log_likelihoods.max(axis=0)
    total = weights[0] * np.exp(log_likelihoods[0] - most)
    for weight, value in zip(weights[1:], log_likelihoods[1:], strict=True):
        total = total + weight * np.exp(value - most)
    with np.errstate(divide="ignore"):
        return np.asarray(most + np.log(total))


def mixture_by_track(
    track: IntArray, count: int, share: FloatArray, states: FloatArray, covariances: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of what belongs to each track, with shares that sum to 1.

    Parameters
    ----------
    track : (parts,)
        Every one of `count` tracks occurs.
    share : (parts,)
    states : (d, parts)
    covariances : (d, d, parts)
    """

    def summed(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(track, weights=values, minlength=count), dtype=float)

    size = len(states)
    mean = np.stack([summed(share * states[i]) for i in range(size)])
    apart = states - selected(mean, track)
    spread = np.empty((size, size, count))
    for i in range(size):
        for j in range(i, size):
            value = summed(share * (covariances[i, j] + apart[i] * apart[j]))
            spread[i, j] = spread[j, i] = value
    return mean, symmetric(spread)
