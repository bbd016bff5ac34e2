"""Several motion models at once: interacting multiple models (IMM) over many tracks.

Between looks a target may change its model, as a Markov chain in continuous time: rates per second,
so that the mixing follows the time between looks whatever the sensors' scan rates.

Sources: Blom, Bar-Shalom, IEEE Trans. AC 33 (1988); Bar-Shalom, Li, Kirubarajan (2001), §11.6.6.
Models of different states are mixed by the components they share. What a target that enters a model
has not had before, a turn rate or an acceleration, is what the model's own filter thinks of it
(Granström, Willett, Bar-Shalom, *Systematic approach to IMM mixing for unequal dimension states*,
IEEE Trans. AES 51 (2015), the unbiased choice), or 0 with a stated spread: the filter of a model
that is not true is sure that there is no turn, and would learn of one late.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from components.estimation.batched import matrix_product, sum_in_order, symmetrised
from components.estimation.carried_errors import ReportedErrors
from components.estimation.estimator import LEAST, Estimates, Estimator
from components.estimation.frame import SensorPose
from components.estimation.kalman import Moments
from components.estimation.measurement import Kind
from components.estimation.motion import Motion
from dsa_des.arrays.types import FloatArray

# Terms of the exponential's series, exact to a double for |rate · time| of at most 1/8.
_TERMS = 12


@dataclass(frozen=True)
class InteractingMultipleModels(Estimator):
    """Several filters of one model each, whose estimates are mixed each step by probability."""

    filters: tuple[Estimator, ...]
    #: From the row's model to the column's, 1/s; the diagonal is not read.
    rates_per_s: FloatArray = field(compare=False)
    # Variance of what each has besides position and velocity, in a target that enters it; empty
    # where that is what the model's own filter thinks.
    fresh: tuple[float, ...] = ()

    @property
    def models(self) -> tuple[Motion, ...]:
        """Motion model of each filter."""
        return tuple(one.models[0] for one in self.filters)

    def predict(self, tracks: Estimates, dt_s: FloatArray) -> Estimates:
        """Return tracks predicted by times (n,), s: estimates are mixed, then filters predict."""
        steps = transition_probabilities(self.rates_per_s, dt_s)
        states, covariances, weights = mix_models(*tracks, steps, self.fresh, 6 + self.error_count)
        moved = [
            one.predict(Estimates([x], [p], weights), dt_s)
            for one, x, p in zip(self.filters, states, covariances, strict=True)
        ]
        return Estimates([e.states[0] for e in moved], [e.covariances[0] for e in moved], weights)

    @property
    def error_count(self) -> int:
        """Number of measurement errors that the state of every filter holds."""
        return self.filters[0].error_count

    def carrying(self, lasts_s: tuple[float, ...]) -> "InteractingMultipleModels":
        """Return the filter whose states add measurement errors of these correlation times (s)."""
        return replace(self, filters=tuple(one.carrying(lasts_s) for one in self.filters))

    def expect(
        self,
        kind: Kind,
        tracks: Estimates,
        pose: SensorPose,
        reported: ReportedErrors | None = None,
    ) -> list[Moments]:
        """Return by model the mean and covariance of measurements expected of predicted tracks."""
        return [
            one.expect(kind, Estimates([x], [p], tracks.weights), pose, reported)[0]
            for one, x, p in zip(self.filters, tracks.states, tracks.covariances, strict=True)
        ]

    def past_model_probabilities(
        self, weights: FloatArray, until_s: FloatArray, since_s: FloatArray
    ) -> FloatArray:
        """Return the probability of each past model, given each model now, (then, now, n)."""
        return past_probabilities(self.rates_per_s, weights, until_s, since_s)


def transition_probabilities(rates_per_s: FloatArray, dt_s: FloatArray) -> FloatArray:
    """Return the probability of each model change within a time, (from, to, n); rows sum to 1."""
    generator = np.array(rates_per_s, dtype=float)
    np.fill_diagonal(generator, 0.0)
    np.fill_diagonal(generator, -generator.sum(axis=1))
    size = len(generator)
    fastest = float(np.max(-np.diag(generator), initial=0.0))
    most = fastest * float(np.max(dt_s, initial=0.0))
    # The number of squarings must not depend on who else is in the batch: one for each octave.
    with np.errstate(divide="ignore"):
        octave = np.ceil(np.log2(np.maximum(8.0 * fastest * dt_s, 1.0)))
    squarings = octave.astype(np.int64) if most > 0 else np.zeros(len(dt_s), dtype=np.int64)
    # Uniformised: exp(A) = exp(-u) exp(A + u I), every term positive, so that nothing cancels.
    short = dt_s / np.exp2(squarings)
    positive = (generator + fastest * np.eye(size))[:, :, np.newaxis] * short
    identity = np.repeat(np.eye(size)[:, :, np.newaxis], len(dt_s), axis=2)
    total = identity.copy()
    for term in range(_TERMS, 0, -1):
        total = identity + matrix_product(positive, total) / term
    total = total * np.exp(-fastest * short)
    for done in range(int(squarings.max(initial=0))):
        total = np.where(squarings > done, matrix_product(total, total), total)
    sums = total.sum(axis=1, keepdims=True)
    return total / sums


def mix_models(
    states: Sequence[FloatArray],
    covariances: Sequence[FloatArray],
    probabilities: FloatArray,
    transitions: FloatArray,
    fresh: Sequence[float] = (),
    shared: int = 6,
) -> tuple[list[FloatArray], list[FloatArray], FloatArray]:
    """Return the models' mixed states, mixed covariances and predicted probabilities.

    `shared` components are in every model's state.
    """
    many = len(states)
    predicted = np.stack(
        [
            sum_in_order([transitions[i, j] * probabilities[i] for i in range(many)])
            for j in range(many)
        ]
    )
    predicted = np.maximum(predicted, LEAST)
    new_states, new_covariances = [], []
    for j in range(many):
        weights = [transitions[i, j] * probabilities[i] / predicted[j] for i in range(many)]
        given = [
            _converted_to_other_model((states[i], covariances[i]), (states[j], covariances[j]),
            shared,
                      fresh[j] if fresh else None)
            for i in range(many)
        ]  # fmt: skip
        state = sum_in_order([w * x for w, (x, _) in zip(weights, given, strict=True)])
        covariance = np.zeros_like(covariances[j])
        for weight, (x, whole) in zip(weights, given, strict=True):
            apart = x - state
            covariance += weight * (whole + apart[:, np.newaxis] * apart[np.newaxis])
        new_states.append(state)
        new_covariances.append(symmetrised(covariance))
    return new_states, new_covariances, predicted


def past_probabilities(
    rates_per_s: FloatArray, probabilities: FloatArray, until_s: FloatArray, since_s: FloatArray
) -> FloatArray:
    """Return the probability of each past model, given each model now, (then, now, n)."""
    many = len(probabilities)
    steps = transition_probabilities(rates_per_s, until_s)
    then = np.stack(
        [sum_in_order([steps[i, j] * probabilities[i] for i in range(many)]) for j in range(many)]
    )
    joint = np.maximum(then, LEAST)[:, np.newaxis] * transition_probabilities(rates_per_s, since_s)
    return np.asarray(joint / np.maximum(sum_in_order(list(joint)), LEAST))


def _converted_to_other_model(
    given: tuple[FloatArray, FloatArray],
    own: tuple[FloatArray, FloatArray],
    shared: int,
    fresh: float | None,
) -> tuple[FloatArray, FloatArray]:
    """Return one model's state and covariance, converted to another model's state.

    What the model has besides the shared components is as its own filter has it, or 0 with the
    variance `fresh`.
    """
    (x, p), (own_x, own_p) = given, own
    if len(x) == len(own_x):
        return x, p
    state, covariance = np.zeros_like(own_x), np.zeros_like(own_p)
    state[:shared], covariance[:shared, :shared] = x[:shared], p[:shared, :shared]
    if fresh is None:
        state[shared:], covariance[shared:, shared:] = own_x[shared:], own_p[shared:, shared:]
    else:
        for i in range(shared, len(own_x)):
            covariance[i, i] = fresh
    return state, covariance
