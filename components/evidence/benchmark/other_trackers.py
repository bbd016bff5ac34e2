"""What a plain loop and Stone Soup make of the detections that our trackers are timed on."""

from collections.abc import Callable
from datetime import timedelta
from importlib.util import find_spec
from typing import Any

import numpy as np

from components.estimation.batched import product, product_transposed
from components.estimation.frame import SensorPose, pose_in_frame
from components.estimation.measurement import position_of
from components.evidence.benchmark.plain_tracker import PlainLook, track_plainly
from components.evidence.benchmark.track_updates import Listening, heard
from components.tracking.scans import Scans, scans_of
from dsa_des.arrays.types import FloatArray

#: Looks that Stone Soup is given: it takes as long for each as the plain loop for ten.
_FEW = 27


def plainly(targets: int) -> tuple[int, Callable[[], object]]:
    """Return how many updates the plain loop does in one run, and what does them."""
    block = heard(1, targets)
    scans, places = _looks(block)
    looks = plain_looks(scans, places, block.context.ticks_per_s)
    first, rest = _started(scans, places, block.p.start_speed_m_s), looks[1:]
    updates = sum(len(look.measured) for look in rest)
    intensity = block.p.acceleration_intensity_m2_s3
    return updates, lambda: track_plainly(rest, *first, intensity, looks[0].time_s)


def by_stone_soup(targets: int) -> tuple[int, Callable[[], object]] | None:
    """Return how many updates Stone Soup's tracker does in some looks, and what does them.

    None where it is not installed.
    """
    if find_spec("stonesoup") is None:
        return None
    from components.stone_soup.objects import Poses, detections, instant

    block = heard(1, targets)
    scans, places = _looks(block)
    poses = Poses(places)
    looks = []
    for k in range(min(len(scans), _FEW)):
        which = slice(int(scans.offsets[k]), int(scans.offsets[k + 1]))
        when = instant(int(scans.tick[k]) / block.context.ticks_per_s)
        count = which.stop - which.start
        looks.append(
            (when, detections(poses, [k] * count, when, scans.measured[:, which],
                              scans.variance[:, which], [{} for _ in range(count)]))
        )  # fmt: skip
    intensity, speed = block.p.acceleration_intensity_m2_s3, block.p.start_speed_m_s

    def track() -> None:
        tracker = _stone_soup_tracker(intensity, speed)
        for when, found in looks:
            tracker.update_tracker(when, found)

    return sum(len(found) for _, found in looks[1:]), track


def _stone_soup_tracker(intensity: float, speed_m_s: float) -> Any:
    from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
    from stonesoup.deleter.time import UpdateTimeDeleter
    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.initiator.simple import SimpleMeasurementInitiator
    from stonesoup.measures import Mahalanobis
    from stonesoup.models.transition.linear import (
        CombinedLinearGaussianTransitionModel,
        ConstantVelocity,
    )
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.tracker.simple import MultiTargetTracker
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(intensity)] * 3)
    updater = ExtendedKalmanUpdater()
    hypothesiser = DistanceHypothesiser(
        ExtendedKalmanPredictor(motion), updater, Mahalanobis(), missed_distance=4
    )
    start = GaussianState(np.zeros((6, 1)), np.diag([0.0, speed_m_s**2] * 3))
    return MultiTargetTracker(
        SimpleMeasurementInitiator(start, skip_non_reversible=True),
        UpdateTimeDeleter(timedelta(seconds=6)),
        None,
        GNNWith2DAssignment(hypothesiser),
        updater,
    )


def _looks(block: Listening) -> tuple[Scans, SensorPose]:
    scans = Scans.joined([scans_of(wake["fused"]) for wake in block.kept])
    origin = scans.pose[:3, :1]
    lat, lon, alt = (np.repeat(value, len(scans)) for value in origin)
    pose = scans.pose
    return scans, pose_in_frame((lat, lon, alt), (pose[0], pose[1], pose[2]),
                                 (pose[3], pose[4], pose[5]))  # fmt: skip


def plain_looks(scans: Scans, places: SensorPose, ticks_per_s: int) -> list[PlainLook]:
    """Return looks as the plain loop takes them."""
    found = []
    for k in range(len(scans)):
        which = slice(int(scans.offsets[k]), int(scans.offsets[k + 1]))
        ranged = bool(np.isfinite(scans.measured[2, which]).all())
        size = 3 if ranged else 2
        found.append(
            PlainLook(
                int(scans.tick[k]) / ticks_per_s, places.position_m[:, k], places.to_body[:, :, k],
                scans.measured[:size, which].T.copy(), scans.variance[:size, which].T.copy(),
            )
        )  # fmt: skip
    return found


def _started(
    scans: Scans, places: SensorPose, speed_m_s: float
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return a track for each detection of the first look, as our trackers start them."""
    which = np.arange(int(scans.offsets[1]))
    position, slope = position_of(scans.measured[:3, which], places.take(0 * which))
    spread = np.zeros((3, 3, len(which)))
    for i in range(3):
        spread[i, i] = scans.variance[i, which]
    turned = product_transposed(product(slope, spread), slope)
    states, covariances = [], []
    for k in which.tolist():
        states.append(np.concatenate([position[:, k], np.zeros(3)]))
        covariance = np.diag([0.0] * 3 + [speed_m_s**2] * 3)
        covariance[:3, :3] = turned[:, :, k]
        covariances.append(covariance)
    return states, covariances
