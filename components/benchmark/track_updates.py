"""Track updates for timing: our tracker's work on what a run has given it, and that of two others.

The yardstick is one small Kalman filter per track in a plain loop, what one writes in an afternoon:
for every look and every track a predicted state, the measurement linearised, gates, a global
assignment by SciPy and an update in Joseph form, on 6 by 6 matrices. Stone Soup is the other.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from importlib.util import find_spec
from math import atan2, hypot, pi, sqrt
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import dsa_des
from components.estimation.batched import matrix_product, multiply_by_transpose
from components.estimation.frame import SensorPose, pose_in_frame
from components.estimation.measurement import position_and_jacobian
from components.tracking.filters import ExtendedKalman
from components.tracking.scans import Scans, looks_of_message
from dsa_des.arrays.types import FloatArray
from dsa_des.block.wake import Wake
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation

_DURATION_S = 4
#: Of radar and two cameras, in `_DURATION_S`.
LOOKS = (5 + 20 + 2) * _DURATION_S


class Listening(ExtendedKalman):
    """A tracker that stores the messages of every wake, so that a benchmark can feed them again."""

    rewindable = False
    kept: list[Wake]

    def setup(self) -> None:
        """Start with nothing kept."""
        super().setup()
        self.kept = []

    def run(self, wake: Wake) -> Any:
        """Track, and keep the wake."""
        self.kept.append(wake)
        return super().run(wake)


def record_tracker_inputs(replicas: int, targets: int) -> Listening:
    """Run a scene with some replicas and targets; return its tracker with all messages stored.

    Three sensors see every target at every look.
    """
    scene = dsa_des.load_scene(_tracking_scene_tables(targets))
    simulation = make_lockstep_simulation(
        [replica_scene(scene, Replica(1 + i, {})) for i in range(replicas)]
    )
    simulation.run()
    block: Any = simulation.components["tracker"]
    assert isinstance(block, Listening)
    return block


def prepare_tracker_updates(replicas: int, targets: int) -> Callable[[], object]:
    """Return a function that tracks all targets of some replicas anew, gated, from the messages."""
    known = record_tracker_inputs(replicas, targets)

    def track() -> None:
        block = ExtendedKalman(known.name, known.p, known.context)
        block.setup()
        for wake in known.kept:
            block.run(wake)

    return track


def _tracking_scene_tables(targets: int) -> dict[str, Any]:
    around = [2.0 * math.pi * k / targets for k in range(targets)]
    flights = [
        {
            "name": f"t{k}", "east_m": 6000.0 * math.sin(a), "north_m": 6000.0 * math.cos(a),
            "up_m": 100.0 + 10.0 * (k % 20), "heading_deg": math.degrees(a + 1.5) % 360.0,
            "speed_mps": 60.0,
        }
        for k, a in enumerate(around)
    ]  # fmt: skip
    # Errors that are new at every look: what other trackers take them for.
    new = {"errors": "stated", "quantised": False}
    camera = {
        "type": "optical.range_boundary", "range_km": 20.0, "azimuth_error_deg": 0.015,
        "elevation_error_deg": 0.015, **new,
    }  # fmt: skip
    radar = {
        "type": "radar.range_boundary", "range_km": 20.0, "scan_rate_hz": 5,
        "azimuth_error_deg": 0.15, "elevation_error_deg": 0.15, "range_error_m": 3.0, **new,
    }  # fmt: skip
    own = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 1000.0, "heading_deg": 0, "speed_mps": 50.0}
    return {
        "duration_s": _DURATION_S,
        "seed": 1,
        "wires": [
            "traffic -> transform -> gate -> radar -> fusion -> tracker",
            "gate -> eo -> fusion", "gate -> ir -> fusion",
        ],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": flights},
            "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "radar": radar,
            "eo": {**camera, "scan_rate_hz": 20},
            "ir": {**camera, "scan_rate_hz": 2},
            "fusion": {"type": "fusion.pass_through"},
            "tracker": {"type": f"{Listening.__module__}:{Listening.__name__}"},
        },
    }  # fmt: skip


# Chi-square quantiles at 0.997, by degrees of freedom.
_GATES = {2: 11.618, 3: 13.931}
_UNUSED = 1e6


@dataclass(frozen=True, eq=False)
class PlainLook:
    """One scan of one sensor for the plain loop: time, sensor pose, measurements and variances."""

    time_s: float
    #: (3,): Of the sensor, north, east, down.
    position_m: FloatArray
    #: (3, 3)
    to_body: FloatArray
    #: (detections, 2) or (detections, 3): Azimuth, elevation and, where it is measured, range.
    measured: FloatArray
    variance: FloatArray


def measurement_and_jacobian(
    state: FloatArray, look: PlainLook, size: int
) -> tuple[FloatArray, FloatArray]:
    """Return a state's expected measurement (size,), and its derivative by the state (size, 6)."""
    away = state[:3] - look.position_m
    x, y, z = look.to_body @ away
    level, distance = hypot(x, y), sqrt(x * x + y * y + z * z)
    slope = np.zeros((size, 6))
    by_body = np.array(
        [
            [-y / level**2, x / level**2, 0.0],
            [x * z / (level * distance**2), y * z / (level * distance**2), -level / distance**2],
            [x / distance, y / distance, z / distance],
        ]
    )
    slope[:, :3] = by_body[:size] @ look.to_body
    return np.array([atan2(y, x), atan2(-z, level), distance])[:size], slope


def track_plainly(
    looks: Sequence[PlainLook],
    states: Sequence[FloatArray],
    covariances: Sequence[FloatArray],
    intensity: float,
    begin_s: float = 0.0,
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return final states and covariances of tracks updated with the looks one after the other."""
    states, covariances, last_s = list(states), list(covariances), begin_s
    step, identity = np.eye(6), np.eye(6)
    for look in looks:
        dt = look.time_s - last_s
        last_s = look.time_s
        step[:3, 3:] = dt * np.eye(3)
        noise = intensity * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        count, size = look.measured.shape
        cost = np.full((len(states), count), _UNUSED)
        known = []
        for k in range(len(states)):
            state, covariance = step @ states[k], step @ covariances[k] @ step.T + noise
            states[k], covariances[k] = state, covariance
            if count == 0:
                continue
            expected, slope = measurement_and_jacobian(state, look, size)
            apart = look.measured - expected
            apart[:, 0] = (apart[:, 0] + pi) % (2.0 * pi) - pi
            total = slope @ covariance @ slope.T
            known.append((slope, apart))
            # A box about the gate first: most detections are someone else's.
            near = np.flatnonzero(
                (apart**2 <= _GATES[size] * (np.diag(total) + look.variance)).all(axis=1)
            )
            for j in near.tolist():
                spread = total + np.diag(look.variance[j])
                distance = float(apart[j] @ np.linalg.solve(spread, apart[j]))
                if distance <= _GATES[size]:
                    cost[k, j] = distance + np.log(np.linalg.det(spread))
        for k, j in zip(*linear_sum_assignment(cost), strict=True):
            if cost[k, j] >= _UNUSED:
                continue
            slope, apart = known[k]
            errors = np.diag(look.variance[j])
            spread = slope @ covariances[k] @ slope.T + errors
            gain = np.linalg.solve(spread, slope @ covariances[k]).T
            rest = identity - gain @ slope
            states[k] = states[k] + gain @ apart[j]
            covariances[k] = rest @ covariances[k] @ rest.T + gain @ errors @ gain.T
    return states, covariances


#: Looks that Stone Soup is given: it takes as long for each as the plain loop for ten.
_FEW = 27


def prepare_plain_updates(targets: int) -> tuple[int, Callable[[], object]]:
    """Return the updates per call of the plain tracking loop, and the function that runs it."""
    block = record_tracker_inputs(1, targets)
    scans, poses = _recorded_scans_and_poses(block)
    looks = plain_looks(scans, poses, block.context.ticks_per_s)
    first, rest = _start_tracks(scans, poses, block.p.start_speed_m_s), looks[1:]
    updates = sum(len(look.measured) for look in rest)
    intensity = block.p.acceleration_intensity_m2_s3
    return updates, lambda: track_plainly(rest, *first, intensity, looks[0].time_s)


def prepare_stone_soup_updates(targets: int) -> tuple[int, Callable[[], object]] | None:
    """Return the updates per call of Stone Soup's tracker, and the function that runs it.

    None where it is not installed.
    """
    if find_spec("stonesoup") is None:
        return None
    from components.stone_soup.objects import Poses, make_detections, to_datetime

    block = record_tracker_inputs(1, targets)
    scans, believed = _recorded_scans_and_poses(block)
    poses = Poses(believed)
    looks = []
    for k in range(min(len(scans), _FEW)):
        which = slice(int(scans.offsets[k]), int(scans.offsets[k + 1]))
        when = to_datetime(int(scans.tick[k]) / block.context.ticks_per_s)
        count = which.stop - which.start
        looks.append(
            (when, make_detections(poses, [k] * count, when, scans.measured[:, which],
                              scans.variance[:, which], [{} for _ in range(count)]))
        )  # fmt: skip
    intensity, speed = block.p.acceleration_intensity_m2_s3, block.p.start_speed_m_s

    def track() -> None:
        tracker = _stone_soup_tracker(intensity, speed)
        for when, result in looks:
            tracker.update_tracker(when, result)

    return sum(len(result) for _, result in looks[1:]), track


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


def _recorded_scans_and_poses(block: Listening) -> tuple[Scans, SensorPose]:
    scans = Scans.concatenate([looks_of_message(wake["fused"]) for wake in block.kept])
    origin = scans.pose[:3, :1]
    lat, lon, alt = (np.repeat(value, len(scans)) for value in origin)
    pose = scans.pose
    return scans, pose_in_frame((lat, lon, alt), (pose[0], pose[1], pose[2]),
                                 (pose[3], pose[4], pose[5]))  # fmt: skip


def plain_looks(scans: Scans, poses: SensorPose, ticks_per_s: int) -> list[PlainLook]:
    """Return scans as `PlainLook`: time, sensor pose, measurements and variances."""
    result = []
    for k in range(len(scans)):
        which = slice(int(scans.offsets[k]), int(scans.offsets[k + 1]))
        ranged = bool(np.isfinite(scans.measured[2, which]).all())
        size = 3 if ranged else 2
        result.append(
            PlainLook(
                int(scans.tick[k]) / ticks_per_s, poses.position_m[:, k], poses.to_body[:, :, k],
                scans.measured[:size, which].T.copy(), scans.variance[:size, which].T.copy(),
            )
        )  # fmt: skip
    return result


def _start_tracks(
    scans: Scans, poses: SensorPose, speed_m_s: float
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return states and covariances of tracks started, as ours, by the first scan's detections."""
    which = np.arange(int(scans.offsets[1]))
    position, slope = position_and_jacobian(scans.measured[:3, which], poses.take(0 * which))
    spread = np.zeros((3, 3, len(which)))
    for i in range(3):
        spread[i, i] = scans.variance[i, which]
    turned = multiply_by_transpose(matrix_product(slope, spread), slope)
    states, covariances = [], []
    for k in which.tolist():
        states.append(np.concatenate([position[:, k], np.zeros(3)]))
        covariance = np.diag([0.0] * 3 + [speed_m_s**2] * 3)
        covariance[:3, :3] = turned[:, :, k]
        covariances.append(covariance)
    return states, covariances
