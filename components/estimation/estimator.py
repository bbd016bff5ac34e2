"""Estimators: what a tracker needs of a filter, over many tracks at once.

A filter is a class that says how tracks go on (`predict`) and what it expects to be measured of
them (`expect`); how a measurement corrects them (`update`) and how several possible pasts become
one track again (`merge`) is the same for all that are Gaussian.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from components.estimation.batched import (
    Batch,
    cholesky,
    is_everything,
    mahalanobis_squared,
    multiply_by_transpose,
    select_tracks,
    sum_in_order,
    symmetrised,
)
from components.estimation.carried_errors import MotionWithErrors, ReportedErrors
from components.estimation.frame import SensorPose
from components.estimation.kalman import (
    Innovation,
    Moments,
    equivalent_independent_variance,
    linear_moments,
    log_likelihood,
    update,
)
from components.estimation.measurement import Kind, linearise, residual
from components.estimation.motion import Motion, predict
from dsa_des.arrays.types import FloatArray, IntArray

States = list[FloatArray]

#: No model is less likely than this before a look, or underflow would lose its chance to return.
LEAST = 1e-250


class Estimates(NamedTuple):
    """Estimates of many tracks: state and covariance by motion model, and model probabilities.

    States are (d, n), covariances (d, d, n), position and velocity first; weights, the models'
    probabilities, (models, n).
    """

    states: States
    covariances: States
    weights: FloatArray

    def take(self, which: IntArray) -> "Estimates":
        """Return the estimates of the tracks with these indices."""
        if is_everything(which, self.weights.shape[1]):
            return self
        return Estimates(
            [select_tracks(x, which) for x in self.states],
            [select_tracks(p, which) for p in self.covariances],
            select_tracks(self.weights, which),
        )

    @classmethod
    def concatenate(cls, parts: Sequence["Estimates"]) -> "Estimates":
        """Return the tracks of all parts, one after the other."""
        states, covariances, weights = zip(*parts, strict=True)
        return cls(
            [np.concatenate(one, axis=-1) for one in zip(*states, strict=True)],
            [np.concatenate(one, axis=-1) for one in zip(*covariances, strict=True)],
            np.concatenate(weights, axis=-1),
        )


@dataclass(frozen=True, eq=False)
class PairMeasurement(Batch):
    """For pairs of track and detection: each model's innovation, residual and likelihood."""

    innovations: list[Innovation]  # Of the pairs, for every model
    residuals: list[FloatArray]  # list of (m, pairs)
    distance: FloatArray  # (pairs,), least squared Mahalanobis distance of any model
    # (models, pairs), of the detection, were it the track's and the model right
    log_likelihoods: FloatArray
    # Those by which tracks and models' odds are updated, where errors are not all new
    learning: list[Innovation] | None = None
    log_odds: FloatArray | None = None  # (models, pairs) or None: The likelihoods by these

    def take(self, which: IntArray | slice) -> Self:
        """Return the record for the pairs at these indices or in this slice."""
        whole = not isinstance(which, slice) and len(which) == len(self.distance)
        return self if whole else super().take(which)


class Estimator(Protocol):
    """A filter for many tracks; subclasses give `models`, `predict`, `expect` (measurements).

    Every operation is an elementwise one over tracks, so that a track's one is the same to the
    bit however many others are computed with it (`components.estimation.batched`).
    """

    @property
    def models(self) -> tuple[Motion, ...]:
        """Motion models of the filter, one for each state of a track."""
        ...

    def predict(self, tracks: Estimates, dt_s: FloatArray) -> Estimates:
        """Return the tracks predicted by times of 0 or more (n,), s."""
        ...

    @property
    def error_count(self) -> int:
        """Number of measurement errors that each state holds after position and velocity."""
        return 0

    @property
    def linearised(self) -> "Estimator":
        """The filter linearising at the state, for arc-shaped uncertainty; by default itself."""
        return self

    def carrying(self, lasts_s: tuple[float, ...]) -> "Estimator":
        """Return the filter whose state adds measurement errors of these correlation times (s)."""
        return self

    def expect(
        self,
        kind: Kind,
        tracks: Estimates,
        pose: SensorPose,
        reported: ReportedErrors | None = None,
    ) -> list[Moments]:
        """Return by model the mean and covariance of measurements expected of predicted tracks.

        `reported` are the errors of the measurements, of a filter that carries some.
        """
        ...

    def update(
        self, tracks: Estimates, track: IntArray, pairs: "PairMeasurement", which: IntArray
    ) -> Estimates:
        """Return the tracks `track` (k,), each updated with one of the pairs, `which` (k,)."""
        before = tracks.take(track)
        whole = is_everything(which, pairs.residuals[0].shape[1])
        moved = [
            update(
                x, p, innovation if whole else innovation.take(which),
                apart if whole else select_tracks(apart, which),
            )
            for x, p, innovation, apart in zip(
                before.states, before.covariances, pairs.learning or pairs.innovations,
                pairs.residuals, strict=True,
            )
        ]  # fmt: skip
        weights = before.weights
        if len(self.models) > 1:
            odds = pairs.log_likelihoods if pairs.log_odds is None else pairs.log_odds
            weights = update_model_probabilities(weights, select_tracks(odds, which))
        return Estimates([x for x, _ in moved], [p for _, p in moved], weights)

    def merge(
        self,
        tracks: Estimates,
        missed: FloatArray,
        track: IntArray,
        share: FloatArray,
        updates: Estimates,
    ) -> Estimates:
        """Return each track as the probability-weighted mixture of its prediction and updates.

        `missed` (n,) and the `share` of each update (k,), of the track `track` (k,), are
        probabilities and sum to 1 for each track. A track without updates stays as it is, to the
        bit.
        """
        count = len(missed)
        paired = np.bincount(track, minlength=count) > 0
        every = np.concatenate([np.arange(count), track])
        by_model, states, covariances = [], [], []
        for m in range(len(tracks.weights)):
            chance = np.concatenate([missed * tracks.weights[m], share * updates.weights[m]])
            total = np.asarray(np.bincount(every, chance, count), dtype=np.float64)
            by_model.append(total)
            safe = np.maximum(total, LEAST)
            state = np.concatenate([tracks.states[m], updates.states[m]], axis=1)
            within = np.concatenate([tracks.covariances[m], updates.covariances[m]], axis=2)
            mean, spread = mixture_by_track(every, count, chance / safe[every], state, within)
            moved = paired & (total > LEAST)  # an impossible model stays as predicted
            states.append(np.where(moved, mean, tracks.states[m]))
            covariances.append(np.where(moved, spread, tracks.covariances[m]))
        weights = np.stack(by_model)
        weights = np.where(paired, weights / weights.sum(axis=0), tracks.weights)
        return Estimates(states, covariances, weights)

    def past_model_probabilities(
        self, weights: FloatArray, until_s: FloatArray, since_s: FloatArray
    ) -> FloatArray:
        """Return the probability of each past model, given each model now, (then, now, n).

        `weights` are those before that instant; `until_s` and `since_s` the times from there to it
        and from it to now.
        """
        return np.ones((1, 1, len(until_s)))


@dataclass(frozen=True)
class SingleModelFilter(Estimator):
    """A filter of one motion model, which may carry errors of measurements."""

    model: Motion

    @property
    def models(self) -> tuple[Motion, ...]:
        """The one model."""
        return (self.model,)

    @property
    def error_count(self) -> int:
        """Number of measurement errors that the state holds after position and velocity."""
        return len(self.model.lasts_s) if isinstance(self.model, MotionWithErrors) else 0

    def carrying(self, lasts_s: tuple[float, ...]) -> Self:
        """Return the filter whose state adds measurement errors of these correlation times (s)."""
        return replace(self, model=MotionWithErrors(self.model, lasts_s))


class ExtendedKalmanFilter(SingleModelFilter):
    """Kalman filter of one model that linearises motion and measurement at the state."""

    def predict(self, tracks: Estimates, dt_s: FloatArray) -> Estimates:
        """Return the tracks predicted by these times (n,), s."""
        state, covariance = predict(self.model, tracks.states[0], tracks.covariances[0], dt_s)
        return Estimates([state], [covariance], tracks.weights)

    def expect(
        self,
        kind: Kind,
        tracks: Estimates,
        pose: SensorPose,
        reported: ReportedErrors | None = None,
    ) -> list[Moments]:
        """Return mean and covariance of expected measurements, linearised at the state."""
        how = linearise if reported is None else reported.linearise
        seen, jacobian = how(kind, tracks.states[0], pose)
        return [linear_moments(seen, jacobian, tracks.covariances[0])]


def pair_measurement(
    moments: Sequence[Moments],
    track: IntArray,
    measured: FloatArray,
    variance: FloatArray,
    common: FloatArray | None,
    weights: FloatArray,
) -> PairMeasurement:
    """Return by model the innovations, residuals and likelihoods of track-detection pairs."""
    innovations = [one.innovation(variance, track) for one in moments]
    residuals = [residual(measured, one.expected) for one in innovations]
    distances = [
        mahalanobis_squared(i.root, r) for i, r in zip(innovations, residuals, strict=True)
    ]
    likelihoods = np.empty((len(innovations), len(track)))
    for i, (one, apart) in enumerate(zip(innovations, distances, strict=True)):
        likelihoods[i] = log_likelihood(one, apart)
    distance = distances[0]
    for other in distances[1:]:
        distance = np.minimum(distance, other)
    if common is None:
        return PairMeasurement(innovations, residuals, distance, likelihoods)
    spread = np.zeros(variance.shape)
    for weight, expected in zip(weights, moments, strict=True):
        for i in range(len(spread)):
            spread[i] += select_tracks(weight * expected.total[i, i], track)
    new = equivalent_independent_variance(variance, common, spread)
    learning = [one.innovation(new, track) for one in moments]
    odds = None
    if len(learning) > 1:  # the odds of a single model are known
        odds = np.empty_like(likelihoods)
        for i, (one, apart) in enumerate(zip(learning, residuals, strict=True)):
            odds[i] = log_likelihood(one, mahalanobis_squared(one.root, apart))
    return PairMeasurement(innovations, residuals, distance, likelihoods, learning, odds)


def mixture_innovation_squared(
    pairs: PairMeasurement, weights: FloatArray, which: IntArray
) -> FloatArray:
    """Return these pairs' normalised innovation squared (n,), for the mixture of all models."""
    if len(weights) == 1:
        return pairs.distance[which]
    residuals = [select_tracks(apart, which) for apart in pairs.residuals]
    mean = residuals[0] * weights[0]
    for weight, apart in zip(weights[1:], residuals[1:], strict=True):
        mean = mean + weight * apart
    spread = np.zeros((len(mean), *mean.shape))
    for weight, apart, one in zip(weights, residuals, pairs.innovations, strict=True):
        root, off = select_tracks(one.root, which), apart - mean
        spread += weight * (
            multiply_by_transpose(root, root) + off[:, np.newaxis] * off[np.newaxis]
        )
    return mahalanobis_squared(cholesky(spread), mean)


def log_mixture(weights: FloatArray, log_likelihoods: FloatArray) -> FloatArray:
    """Return the log of the likelihood averaged over weighted models, (models, n) to (n,)."""
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
    """Return mean (d, tracks), covariance (d, d, tracks) of tracks' Gaussians; shares sum to 1."""

    def summed(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(track, weights=values, minlength=count), dtype=float)

    size = len(states)
    mean = np.stack([summed(share * states[i]) for i in range(size)])
    apart = states - select_tracks(mean, track)
    spread = np.empty((size, size, count))
    for i in range(size):
        for j in range(i, size):
            value = summed(share * (covariances[i, j] + apart[i] * apart[j]))
            spread[i, j] = spread[j, i] = value
    return mean, symmetrised(spread)


def update_model_probabilities(
    probabilities: FloatArray, log_likelihoods: FloatArray
) -> FloatArray:
    """Return the models' probabilities (models, n) after a measurement, by Bayes' rule."""
    with np.errstate(divide="ignore"):
        logs = np.log(probabilities) + log_likelihoods
    weights = np.exp(logs - logs.max(axis=0))
    return weights / sum_in_order(list(weights))


def mixture_moments(tracks: Estimates) -> tuple[FloatArray, FloatArray]:
    """Return mean (6, n) and covariance (6, 6, n) of position and velocity over the models."""
    states, covariances, probabilities = tracks
    many = len(states)
    if many == 1:
        return states[0][:6], covariances[0][:6, :6]
    state = sum_in_order([probabilities[i] * states[i][:6] for i in range(many)])
    covariance = np.zeros((6, 6, state.shape[1]))
    for i in range(many):
        apart = states[i][:6] - state
        covariance += probabilities[i] * (
            covariances[i][:6, :6] + apart[:, np.newaxis] * apart[np.newaxis]
        )
    return state, symmetrised(covariance)
