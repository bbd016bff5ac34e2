"""Track management: initiation, confirmation (M of N, likelihood ratio), coasting, deletion.

Two rules confirm: m hits among the last n expected looks, or the sequential likelihood ratio of
Wald, applied to tracks by Sittler (IEEE Trans. Military Electronics 8, 1964): the logarithm of the
odds that there is something rises with every hit by ln(Pd N(z) / λ) and falls with every
misdetection by ln(1 - Pd Pg). Which looks count, `components.tracking.due_detections` says.
"""

from typing import Any

import numpy as np

from components.estimation.batched import (
    matrix_product,
    multiply_by_transpose,
    select_tracks,
    symmetrised,
)
from components.estimation.estimator import Estimates
from components.estimation.frame import SensorPose
from components.estimation.kalman import innovation, update
from components.estimation.measurement import (
    Kind,
    expected_measurement,
    linearise,
    position_and_jacobian,
)
from components.messages.state_tracks import COASTED, CONFIRMED, DELETED, TENTATIVE
from components.tracking.due_detections import range_or_infinity_m, update_misdetection_counts
from components.tracking.rules import LONGEST_WINDOW, TrackerRules
from components.tracking.scans import TELLS, LookBatch, Scans, kind_and_measured_rows
from components.tracking.track_store import NEVER, TrackStore, estimate_columns
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Odds are kept within this: a track of an hour must not take an hour to be doubted.
LARGEST_SCORE = 20.0
# Within a thousandth of the vertical a track is started as uncertain as there.
_STEEPEST_RAD = 0.5 * np.pi - 1e-3


def judge_status(
    rules: TrackerRules,
    status: IntArray,
    history: IntArray,
    looks: IntArray,
    misses: IntArray,
    score: FloatArray,
) -> IntArray:
    """Return each track's new status after a look: confirmed, coasted, deleted or unchanged."""
    tentative, new = status == TENTATIVE, status
    if tentative.any():
        confirm, hopeless = _masks_confirmed_and_hopeless(rules, history, looks, score)
        new = np.where(tentative & confirm, CONFIRMED, status)
        new = np.where(tentative & ~confirm & hopeless, DELETED, new)
    held = (new == CONFIRMED) | (new == COASTED)
    new = np.where(held, np.where(misses > 0, COASTED, CONFIRMED), new)
    if rules.p.delete_misses is None:
        return new
    return np.where(held & (misses >= rules.p.delete_misses), DELETED, new)


def _masks_confirmed_and_hopeless(
    rules: TrackerRules, history: IntArray, looks: IntArray, score: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Return which tentative tracks are confirmed, and which can no longer be (two masks)."""
    p = rules.p
    if p.initiation == "m_of_n":
        hits = count_bits(history & (1 << p.confirm_n) - 1)
        # What cannot come to m hits any more within its first n looks is dropped.
        left = p.confirm_n - np.minimum(looks, p.confirm_n)
        return hits >= p.confirm_m, hits + left < p.confirm_m
    gained = score - rules.initial_track_score
    low = np.log(p.missed_confirmation / (1.0 - p.false_confirmation))
    high = np.log((1.0 - p.missed_confirmation) / p.false_confirmation)
    return gained >= high, gained <= low


def count_bits(values: IntArray) -> IntArray:
    """Return how many bits are 1 in numbers below 2^62."""
    v = values - (values >> 1 & 0x5555555555555555)
    v = (v & 0x3333333333333333) + (v >> 2 & 0x3333333333333333)
    v = v + (v >> 4) & 0x0F0F0F0F0F0F0F0F
    v = v + (v >> 8)
    v = v + (v >> 16)
    return np.asarray((v + (v >> 32)) & 0x7F, dtype=np.int64)


def update_history(
    history: IntArray, looks: IntArray, misses: IntArray, hit: BoolArray, missed: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return each track's hit history (bits), number of looks and misses in a row after a look."""
    counted = hit | missed
    moved = np.where(counted, (history << 1 & (1 << LONGEST_WINDOW) - 1) | hit, history)
    return moved, looks + counted, np.where(hit, 0, misses + missed)


def initiate_tracks(
    rules: TrackerRules, batch: LookBatch, chosen: BoolArray, next_number: IntArray
) -> tuple[TrackStore, IntArray]:
    """Return a new tentative track per chosen detection, and each replica's next number."""
    scans, looks, replica = batch.scans, batch.look, batch.replica
    detection, of, codes = batch.detection[chosen], batch.of[chosen], batch.code[chosen]
    count, pose = len(detection), batch.poses_of_looks(of)
    estimates = start_estimates(rules, scans, pose, codes, detection)
    ranged = codes % 2 == 1
    counts = np.bincount(of, minlength=len(looks))
    within = np.arange(count) - (np.cumsum(counts) - counts)[of]
    tick, mask, ones = scans.tick[looks][of], scans.contributors[detection], np.ones(count)
    whole = ones.astype(np.int64)
    by = (mask >> np.arange(len(rules.fields))[:, np.newaxis] & 1).astype(bool)
    range_m = np.where(ranged, scans.measured[2].take(detection), np.inf)
    born = TrackStore(
        replica=replica[of],
        number=next_number[of] + within,
        tick=tick,
        born_tick=tick,
        updated_tick=tick,
        life_ticks=rules.track_life_ticks(by, range_m),
        updated_m2=0.0 * ones,
        history=whole,
        looks=whole,
        misses=0 * whole,
        status=np.full(count, TENTATIVE),
        score=rules.initial_track_score * ones,
        contributors=mask,
        updated_by=mask,
        ranged=ranged,
        nis=0.0 * ones,
        freedom=0 * whole,
        misdetections=np.where(by, 0, NEVER),
        seen=np.full((3, len(rules.fields), count), np.nan),
        seen_tick=np.full((len(rules.fields), count), -1),
        counted_tick=np.broadcast_to(tick, by.shape),
        own_m_s=_ownship_velocity_at_coarse_bearings(rules, scans, codes, detection),
        **estimate_columns(estimates),
    )
    status = judge_status(rules, born.status, born.history, born.looks, born.misses, born.score)
    born = born.with_columns(
        status=status,
        updated_m2=summed_position_variance_m2(born),
        **last_seen_columns(rules, born, pose, mask),
    )
    return born, next_number + counts


def start_estimates(
    rules: TrackerRules, scans: Scans, pose: SensorPose, codes: IntArray, detection: IntArray
) -> Estimates:
    """Return initial states and covariances of all models, weighted alike: one track per entry of
    `detection` (index into the scans' detections), whose kind `codes` has.
    """
    count = len(detection)
    measured, variance = (
        select_tracks(scans.measured[:3], detection),
        select_tracks(scans.variance[:3], detection),
    )
    ranged = codes % 2 == 1
    mean, deviation = rules.start_range_m
    measured[2] = np.where(ranged, measured[2], mean)
    variance[2] = np.where(ranged, variance[2], deviation**2)
    # Nearer than its own error nothing has a direction; a false alarm may be reported at range 0.
    measured[2] = np.maximum(measured[2], np.sqrt(variance[2]))
    position, jacobian = position_and_jacobian(measured, pose)
    steep = np.abs(measured[1]) > _STEEPEST_RAD
    if steep.any():  # straight up or down an azimuth moves nothing, and would seem to be known
        measured[1] = np.where(steep, np.copysign(_STEEPEST_RAD, measured[1]), measured[1])
        jacobian = position_and_jacobian(measured, pose)[1]
    spread = np.zeros((6, 6, count))
    spread[:3, :3] = multiply_by_transpose(matrix_product(jacobian, _diagonal(variance)), jacobian)
    spread[:3, :3] = 0.5 * (spread[:3, :3] + spread[:3, :3].swapaxes(0, 1))
    for i in range(3, 6):
        spread[i, i] = rules.p.start_speed_m_s**2
    if rules.p.start_climb_m_s is not None:
        spread[5, 5] = rules.p.start_climb_m_s**2
    states, covariances = [], []
    begin = _initial_states_and_covariances(rules, scans, pose, codes, detection, position, spread)
    known = 6 + rules.estimator.error_count
    sizes = [model.size for model in rules.estimator.models]
    for size in sizes:
        state, covariance = np.zeros((size, count)), np.zeros((size, size, count))
        state[:known], covariance[:known, :known] = begin
        for i in range(known, size):
            covariance[i, i] = (
                rules.initial_extra_state_deviation(size - rules.estimator.error_count) ** 2
            )
        _update_by_range_rates(scans, pose, codes, detection, state, covariance)
        states.append(state)
        covariances.append(covariance)
    return Estimates(states, covariances, np.full((len(sizes), count), 1.0 / len(sizes)))


def _ownship_velocity_at_coarse_bearings(
    rules: TrackerRules, scans: Scans, codes: IntArray, detection: IntArray
) -> FloatArray:
    """Return the ownship's velocity (3, n), NED, at detections with coarse bearing; else NaN."""
    if rules.carried is None or scans.reported is None:
        return np.full((3, len(detection)), np.nan)
    return np.where(codes & TELLS > 0, rules.carried.ownship_velocity_m_s(scans, detection), np.nan)


def update_history_score_status(
    rules: TrackerRules,
    part: TrackStore,
    changed: TrackStore,
    pose: SensorPose,
    looked: BoolArray,
    hit: BoolArray,
    gain: FloatArray,
) -> TrackStore:
    """Return the tracks with hit history, score, status and times updated after a look.

    `part` are they before and `changed` after the update by detections; `looked` (sensors, tracks)
    says whose looks were expected to see them, `gain` what a hit adds to the score.
    """
    missed = ~hit
    missed &= looked.any(axis=0)
    by = np.where(hit, changed.updated_by, 0)
    misdetections = update_misdetection_counts(part.misdetections, by, looked)
    gain[~hit] = 0.0
    gain[missed] = np.log1p(-rules.p.detection_probability * rules.p.gate_probability)
    history, count, misses = update_history(part.history, part.looks, part.misses, hit, missed)
    score = np.minimum(np.maximum(part.score + gain, -LARGEST_SCORE), LARGEST_SCORE)
    status = judge_status(rules, part.status, history, count, misses, score)
    updated_tick = np.where(hit, changed.tick, changed.updated_tick)
    spread_m2, life_ticks = summed_position_variance_m2(changed), part.life_ticks
    updated_m2 = np.where(hit, spread_m2, part.updated_m2)
    ended = changed.ranged & (spread_m2 - updated_m2 > rules.p.delete_above_m**2)
    counted_tick = part.counted_tick
    if rules.promises:
        counts = looked | (by >> np.arange(len(looked))[:, np.newaxis] & 1).astype(bool)
        counted_tick = np.where(counts, np.maximum(counted_tick, changed.tick), counted_tick)
    if hit.any():
        # Who has not missed it, and has looked at it lately.
        lately = changed.tick - counted_tick <= rules.default_life_ticks
        sees = (misdetections == 0) & (lately if rules.promises else True)
        life_ticks = np.where(
            hit, rules.track_life_ticks(sees, range_or_infinity_m(changed, pose)), life_ticks
        )
    ended |= changed.tick - updated_tick > life_ticks
    return changed.with_columns(
        history=history, looks=count, misses=misses, score=score, misdetections=misdetections,
        updated_tick=updated_tick, status=np.where(ended, DELETED, status),
        life_ticks=life_ticks, updated_m2=updated_m2, counted_tick=counted_tick,
        **last_seen_columns(rules, changed, pose, by),
    )  # fmt: skip


def summed_position_variance_m2(part: TrackStore, *, late: bool = False) -> FloatArray:
    """Return each track's summed position variance, m²; ValueError if a covariance is singular.

    `late` says that the tracks were taken back to a late look, for what an error advises.
    """
    total = np.zeros(len(part))
    for weight, spread in zip(part.weights, part.covariances_by_model(), strict=True):
        total = total + weight * (spread[0, 0] + spread[1, 1] + spread[2, 2])
    good = np.isfinite(total) & (total >= 0.0)
    if not bool(good.all()):
        number = int(part.number[~good][0])
        raise ValueError(
            f"the covariance of track {number} has become singular{_advise_on_late_looks(late)}"
        )
    return total


def _advise_on_late_looks(late: bool) -> str:
    if late:
        return (
            " as it was taken back to a late look: late = 'rerun' works on looks in their own "
            "order, and takes no track back by what is known of it now"
        )
    return (
        ": the stated variances are smaller than what the filter's arithmetic resolves at this "
        "range, or the noise of the motion is too large beside them; state larger ones, or less "
        "noise"
    )


def last_seen_columns(
    rules: TrackerRules, part: TrackStore, pose: SensorPose, mask: IntArray
) -> dict[str, Any]:
    """Return where and when each sensor last saw each track, updated for sensors in `mask`.

    Nothing is kept of sensors all of whose errors are new.
    """
    if rules.lasting is None or not (mask := mask & rules.lasting.correlated_sensors_mask).any():
        return {}
    mine = (mask >> np.arange(len(part.misdetections))[:, np.newaxis] & 1).astype(bool)
    here = expected_measurement(Kind(True), part.state0, pose)
    return {
        "seen": np.where(mine[np.newaxis], here[:, np.newaxis], part.seen),
        "seen_tick": np.where(mine, part.tick, part.seen_tick),
    }


def _update_by_range_rates(
    scans: Scans,
    pose: SensorPose,
    codes: IntArray,
    detection: IntArray,
    state: FloatArray,
    covariance: FloatArray,
) -> None:
    """Update states and covariances of new tracks, in place, by their measured range rates."""
    which = np.flatnonzero(codes & 2)
    if len(which) == 0:
        return
    kind, _ = kind_and_measured_rows(2)
    known, slope = linearise(kind, select_tracks(state, which), pose.take(which))
    cells = detection[which]
    rate, variance = (
        select_tracks(scans.measured[3:4], cells),
        select_tracks(scans.variance[3:4], cells),
    )
    result = innovation(known[2:], slope[2:], select_tracks(covariance, which), variance)
    state[:, which], covariance[:, :, which] = update(
        select_tracks(state, which), select_tracks(covariance, which), result, rate - known[2:]
    )


def _initial_states_and_covariances(
    rules: TrackerRules,
    scans: Scans,
    pose: SensorPose,
    codes: IntArray,
    detection: IntArray,
    position: FloatArray,
    spread: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return new tracks' states and covariances, with reported velocities and carried errors.

    `spread` (6, 6, n) is that of position and velocity where nothing is reported. A report is off
    by its errors, so that the target lies that far on the other side.
    """
    errors, count = rules.estimator.error_count, len(detection)
    state, covariance = np.zeros((6 + errors, count)), np.zeros((6 + errors, 6 + errors, count))
    state[:3], covariance[:6, :6] = position, spread
    moving = np.flatnonzero(codes & 4)
    for axis in (3, 4, 5) if len(moving) else ():
        state[axis, moving] = scans.measured[axis + 1, detection[moving]]
        covariance[axis, axis, moving] = scans.variance[axis + 1, detection[moving]]
    for i in range(6, 6 + errors):
        covariance[i, i] = 1.0
    telling = np.flatnonzero(codes & TELLS)
    if rules.carried is None or not len(telling):
        return state, covariance
    cells = detection[telling]
    reported = rules.carried.errors_of_detections(scans, cells)
    effects = reported.effects_on_reported_states(state[:6, telling], pose.take(telling))
    effects[3:] *= (codes[telling] & 4) > 0
    white = rules.carried.new_error_variances(scans, cells, [0, 1, 2, 4, 5, 6])
    own = covariance[:6, :6, telling]
    for i in (3, 4, 5):
        own[i, i] = np.where(codes[telling] & 4, white[i], own[i, i])
    own[:3, :3] = _diagonal(white[:3])
    ages = rules.carried.position_and_velocity_ages(scans, cells, np.zeros(len(cells)))
    own += multiply_by_transpose(effects, effects)
    speeds = np.stack([own[i, i] for i in (3, 4, 5)])
    for model in rules.estimator.models:
        own += ages.error_covariances(model, np.zeros((model.size, len(cells))), speeds)[0] / len(
            rules.estimator.models
        )
    covariance[:6, :6, telling] = symmetrised(own)
    covariance[:6, 6:, telling] = -effects
    covariance[6:, :6, telling] = -effects.swapaxes(0, 1)
    return state, covariance


def _diagonal(variance: FloatArray) -> FloatArray:
    result = np.zeros((len(variance), *variance.shape))
    for i, values in enumerate(variance):
        result[i, i] = values
    return result
