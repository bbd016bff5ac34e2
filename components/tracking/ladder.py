"""The ladders of trackers: the filter, the association, and what becomes of late looks."""

from typing import Any

import numpy as np

from components.estimation.batched import cholesky, mahalanobis_squared
from components.estimation.frame import pose_in_frame
from components.estimation.measurement import position_and_jacobian
from components.messages.columns import ORIGIN, POSE, POSITION, VELOCITY
from components.messages.false_detections import without_false_alarms
from components.messages.fused import FusedDetections
from components.messages.state_tracks import COASTED, CONFIRMED, StateTracks, covariance_matrices
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.wake import Wake

# A track farther from a target than this is not taken to be of it.
_NEAR_M = 1000.0


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return the nearest confirmed track's distance (m) and NEES at each detected row and target.

    Rungs have other tracks, so they are compared with the truth and not with each other: at every
    instant at which a target was detected and tracks are reported, the nearest confirmed track with
    a range, carried back to when that was measured. The tracker does not see the truth: it comes
    from what it was given, after it has run.
    """
    fused: Any = wake["fused"]
    if fused is None:
        return {"position": np.empty((0, 0)), "nees": np.empty((0, 0))}
    shape = (len(wake), len(fused.roster))
    errors = {name: np.full(shape, np.nan) for name in ("position", "nees")}
    tracks: Any = block.run(wake)
    fused = without_false_alarms(fused)
    if tracks is None or len(fused.target) == 0:
        return errors
    row_of_track = np.repeat(np.searchsorted(wake.ticks, tracks.tick), np.diff(tracks.offsets))
    row_of_entry = fused.row_of_entries
    held = tracks.has_range & np.isin(tracks.track_status, (CONFIRMED, COASTED))
    track = np.flatnonzero(held)
    first = np.searchsorted(row_of_track[track], row_of_entry, side="left")
    many = np.searchsorted(row_of_track[track], row_of_entry, side="right") - first
    entry = np.repeat(np.arange(len(row_of_entry)), many)
    start = np.cumsum(many) - many
    mine = track[np.arange(len(entry)) - np.repeat(start - first, many)]
    if len(entry) == 0:
        return errors
    error, back_s = _position_errors_and_lags(fused, entry, tracks, mine, wake)
    distance = np.sqrt((error**2).sum(axis=0))
    # The nearest of each entry's tracks, the first of equals.
    order = np.lexsort((distance, entry))
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = entry[order][1:] != entry[order][:-1]
    best = order[begins]
    best = best[distance[best] <= _NEAR_M]
    row, target = row_of_entry[entry[best]], fused.target[entry[best]]
    errors["position"][row, target] = distance[best]
    spread = covariance_matrices(tracks.covariance, mine[best], 3)
    nees = mahalanobis_squared(cholesky(spread), error[:, best]) / 3.0
    # A covariance is not carried back: of late detections only the position counts.
    errors["nees"][row, target] = np.where(back_s[best] < 1e-6, nees, np.nan)
    return errors


def _position_errors_and_lags(
    fused: FusedDetections, entry: IntArray, tracks: StateTracks, mine: IntArray, wake: Wake
) -> tuple[FloatArray, FloatArray]:
    """Return track minus true position (3, pairs), m, when measured, and the time moved back, s."""
    measured_s = fused.measured_tick[entry] / wake.ticks_per_s
    own = np.stack([fused.pose_columns()[name][entry] for name in POSE])
    origin = np.stack([getattr(tracks, name)[mine] for name in ORIGIN])
    pose = pose_in_frame(origin, own[:3], own[3:])
    true = np.stack(
        [fused.true_azimuth_rad[entry], fused.true_elevation_rad[entry], fused.true_range_m[entry]]
    )
    truth_m, _ = position_and_jacobian(true, pose)
    back_s = tracks.state_s[mine] - measured_s
    position = np.stack([getattr(tracks, name)[mine] for name in POSITION])
    velocity = np.stack([getattr(tracks, name)[mine] for name in VELOCITY])
    return position - back_s * velocity - truth_m, np.abs(back_s)


def position_error_and_nees_at_cells(
    block: Component, wake: Wake, cells: IntArray
) -> dict[str, FloatArray]:
    """Return, by name, position error (m) and NEES of own tracks at (row, target) cells."""
    row, target = cells.T
    return {name: values[row, target] for name, values in measure(block, wake, block).items()}


def _errors_to_truth(values: AnyArray, reference: AnyArray) -> FloatArray:
    return values


_QUANTITIES = (
    Quantity("position", "m", _errors_to_truth),
    Quantity("nees", "1", _errors_to_truth),
)

FILTER = Ladder(
    "filter",
    (
        Rung("ekf", "extended Kalman filter, nearly constant velocity", "tracking.ekf"),
        Rung("ukf", "unscented Kalman filter, nearly constant velocity", "tracking.ukf"),
        Rung("imm", "interacting models: straight and turning", "tracking.imm"),
    ),
    "imm",
    _QUANTITIES,
    measure,
    position_error_and_nees_at_cells,
)  # fmt: skip

ASSOCIATION = Ladder(
    "association",
    (
        Rung("nearest", "the nearest pair first", parameters={"association": "nearest"}),
        Rung("gnn", "the least sum over all", parameters={"association": "gnn"}),
        Rung("jpda", "all in the gate, weighed", parameters={"association": "jpda"}),
    ),
    "jpda",
    _QUANTITIES,
    measure,
    position_error_and_nees_at_cells,
)

LATENESS = Ladder(
    "lateness",
    (
        Rung("drop", "late looks are left out", parameters={"late": "drop"}),
        Rung("one_step", "late looks correct the state once", parameters={"late": "one_step"}),
        Rung("rerun", "all since a late look is worked on again", parameters={"late": "rerun"}),
    ),
    "rerun",
    _QUANTITIES,
    measure,
    position_error_and_nees_at_cells,
)

#: Of every tracker that estimates states.
LADDERS = (FILTER, ASSOCIATION, LATENESS)
