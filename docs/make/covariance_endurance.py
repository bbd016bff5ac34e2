"""``python -m docs.make.covariance_endurance``: do covariances stay positive?

Tracks at ranges from 1 m to 300 km are updated for 30 days, a million times each by default, by a
radar and a camera in turn: with an extended filter, an unscented one, interacting models, and with
corrections in modified polar coordinates, as tracks without a range have them.
"""

import argparse
import sys
from dataclasses import dataclass

import numpy as np

from components.estimation.estimator import (
    Estimates,
    ExtendedKalmanFilter,
    mixture_moments,
    pair_measurement,
)
from components.estimation.frame import SensorPose
from components.estimation.interacting_models import InteractingMultipleModels
from components.estimation.kalman import innovation, update
from components.estimation.measurement import Kind, expected_measurement, linearise, residual
from components.estimation.modified_polar import apply_correction_in_polar
from components.estimation.motion import ConstantVelocity, CoordinatedTurn, predict
from components.estimation.unscented import SigmaPoints, predict_unscented, unscented_moments
from dsa_des.arrays.types import FloatArray
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

_DAYS, _SIGMA = 30.0, SigmaPoints()
FILTERS = ("ekf", "ukf", "imm", "polar")


IMM = InteractingMultipleModels(
    (
        ExtendedKalmanFilter(ConstantVelocity(1e-4)),
        ExtendedKalmanFilter(CoordinatedTurn(1e-4, 1e-10)),
    ),
    np.array([[0.0, 0.01], [0.01, 0.0]]), (0.0, 1e-6),
)  # fmt: skip


@dataclass(frozen=True)
class Endured:
    """What became of covariances."""

    #: Least eigenvalue of any correlation matrix.
    least: float
    #: Largest difference of two mirrored elements.
    asymmetry: float
    #: Over tracks, at the end.
    nees_median: float


def endure(name: str, updates: int, count: int = 40, seed: int = 1) -> Endured:
    """Update tracks of targets that stand still so many times within 30 days."""
    rng = np.random.default_rng(seed)
    distance = np.geomspace(1.0, 3e5, count)
    line = rng.normal(size=(3, count))
    truth = np.concatenate([distance * line / np.linalg.norm(line, axis=0), np.zeros((3, count))])
    state = truth.copy()
    covariance = np.zeros((6, 6, count))
    for i in range(3):
        covariance[i, i], covariance[i + 3, i + 3] = (0.1 * distance) ** 2, 100.0
    # What is measured errs by 1e-5 to 0.01 rad, and by a thousandth of the range or less.
    variance = np.stack(
        [10.0 ** rng.uniform(-10, -4, count), 10.0 ** rng.uniform(-10, -4, count),
         (distance * 10.0 ** rng.uniform(-5, -3, count)) ** 2]
    )  # fmt: skip
    place = SensorPose(np.zeros((3, count)), np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2))
    model = ConstantVelocity(1e-4)
    # Linearised at 1 m, ten metres a second and a turn within seconds would be off for ever.
    slow = covariance.copy()
    for i in range(3, 6):
        slow[i, i] = np.minimum(100.0, (0.01 * distance) ** 2)
    tracks = _in_turn(state, slow)
    mean_s = _DAYS * 86_400.0 / 1e6
    for k in range(updates):
        dt = mean_s * rng.exponential(size=count)
        kind = Kind(k % 4 == 0)
        spread = variance[: kind.size]
        if name == "imm":
            seen = expected_measurement(kind, truth, place) + rng.normal(
                size=spread.shape
            ) * np.sqrt(spread)
            tracks = _interacting(tracks, dt, kind, place, seen, spread)
            continue
        seen = expected_measurement(kind, truth, place) + rng.normal(size=spread.shape) * np.sqrt(
            spread
        )
        if name == "ukf":
            state, covariance = predict_unscented(model, state, covariance, dt, _SIGMA)
            found = unscented_moments(kind, state, covariance, place, _SIGMA).innovation(spread)
        else:
            state, covariance = predict(model, state, covariance, dt)
            found = innovation(*linearise(kind, state, place), covariance, spread)
        after = update(state, covariance, found, residual(seen, found.expected))
        if name == "polar" and not kind.has_range:
            after = apply_correction_in_polar(state, *after, place.position_m)
        state, covariance = after
    if name == "imm":
        worst = [_quality(spread) for spread in tracks.covariances]
        state, covariance = mixture_moments(tracks)
        quality = min(least for least, _ in worst), max(apart for _, apart in worst)
        return Endured(*quality, _median_nees(state - truth, covariance))
    return Endured(*_quality(covariance), _median_nees(state - truth, covariance))


def _interacting(
    tracks: Estimates,
    dt_s: FloatArray,
    kind: Kind,
    pose: SensorPose,
    seen: FloatArray,
    spread: FloatArray,
) -> Estimates:
    ahead = IMM.predict(tracks, dt_s)
    every = np.arange(len(dt_s))
    moments = IMM.expect(kind, ahead, pose)
    pairs = pair_measurement(moments, every, seen, spread, None, ahead.weights)
    return IMM.update(ahead, every, pairs, every)


def _in_turn(state: FloatArray, covariance: FloatArray) -> Estimates:
    count = state.shape[1]
    turn, spread = np.zeros((7, count)), np.zeros((7, 7, count))
    turn[:6], spread[:6, :6], spread[6, 6] = state, covariance, 1e-6
    return Estimates([state, turn], [covariance, spread], np.full((2, count), 0.5))


def _quality(covariance: FloatArray) -> tuple[float, float]:
    deviation = np.sqrt(np.einsum("iin->in", covariance))
    scaled = (covariance / deviation / deviation[:, np.newaxis]).transpose(2, 0, 1)
    asymmetry = float(np.abs(covariance - covariance.swapaxes(0, 1)).max())
    return float(np.linalg.eigvalsh(scaled).min()), asymmetry


def _median_nees(error: FloatArray, covariance: FloatArray) -> float:
    solved = np.linalg.solve(covariance.transpose(2, 0, 1), error.T[:, :, np.newaxis])
    return float(np.median(np.einsum("in,nik->nk", error, solved)))


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code: 1 where a covariance is not positive."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.covariance_endurance",
        description="Update tracks many times, and look at their covariances.",
    )
    parser.add_argument("filters", nargs="*", metavar="filter", help=f"of {', '.join(FILTERS)}")
    parser.add_argument("--updates", type=int, default=1_000_000)
    options = parser.parse_args(arguments)
    good = True
    for name in options.filters or FILTERS:
        if name not in FILTERS:
            parser.error(f"no filter {name!r}; allowed: {', '.join(FILTERS)}")
        found = endure(name, options.updates)
        good &= found.least > 0.0 and found.asymmetry == 0.0
        say(
            f"{name}: {options.updates} updates of each track; least eigenvalue of a correlation "
            f"matrix {found.least:.2g}, asymmetry {found.asymmetry:g}, median NEES "
            f"{found.nees_median:.1f}"
        )
    return 0 if good else 1


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
