"""Data association in a tracker: which detections belong to which tracks, and correct them.

An association is a class with `update`; one that gives every track at most one detection is an
`OneToOne` that says which pairs are taken. Pairs come kind by kind, as angle-only detections and
those with a range are gated by different quantities.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from components.association.assignment import (
    greedy_pair_indices,
    is_only_pair_of_both,
    least_total_pair_indices,
    squared_gate_distance,
)
from components.association.jpda import pair_probabilities
from components.estimation.batched import is_everything, log_determinant_from_root, select_tracks
from components.estimation.estimator import Estimates, mixture_innovation_squared
from components.estimation.frame import SensorPose
from components.estimation.iterated import iterate_updates_in_place
from components.estimation.modified_polar import (
    apply_correction_by_rotation,
    apply_correction_in_polar,
    update_with_first_range,
)
from components.tracking.gating import GatedPairs, log_false_alarm_density, log_score_gain
from components.tracking.management import start_estimates
from components.tracking.rules import TrackerRules
from components.tracking.scans import TELLS, LookBatch
from components.tracking.track_store import TrackStore, estimate_columns
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_LOG_2_PI = float(np.log(2.0 * np.pi))
# Weights of JPDA are kept below this power of e: products of some of them still are numbers.
_LARGEST_LOG = 200.0
# How far an arc leaves a straight line, in deviations, before it is none.
_BENT = 0.3

#: Tracks after a look, which of them were hit, and of these ln(Pd N(z) / λ).
Associated = tuple[TrackStore, BoolArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Predicted tracks, and all pairs of one and a detection in its gate, whatever their kind.

    `track`, `detection` and `distance` are (pairs,) over all kinds; `kinds` has them by kind, with
    what each measures.
    """

    rules: TrackerRules
    tracks: TrackStore
    kinds: list[GatedPairs]
    batch: LookBatch
    pose: SensorPose  # Of each track's look

    @cached_property
    def sensor_masks(self) -> IntArray:
        """Bit mask, per detection, of the sensors that contributed to it."""
        return self.batch.contributors

    @cached_property
    def track(self) -> IntArray:
        """Index of each pair's track."""
        return concatenate([one.track for one in self.kinds])

    @cached_property
    def detection(self) -> IntArray:
        """Index of each pair's detection."""
        return concatenate([one.detection for one in self.kinds])

    @cached_property
    def distance(self) -> FloatArray:
        """Squared Mahalanobis distance of each pair."""
        return concatenate([one.measured.distance for one in self.kinds])

    @cached_property
    def log_volume_cost(self) -> FloatArray:
        """Cost of each pair's gate volume: ln |S| plus the log density of false alarms, which makes
        different kinds of measurement comparable.
        """
        return np.concatenate(
            [
                _log_least_gate_volume(one)
                + 2.0 * log_false_alarm_density(self.rules, one, self.sensor_masks)
                + one.kind.size * _LOG_2_PI
                for one in self.kinds
            ]
        )

    @cached_property
    def cost_of_no_detection(self) -> FloatArray:
        """Cost, per pair, of leaving its track undetected: the largest inside its gates."""
        sizes = np.concatenate([np.full(len(one.track), one.kind.size) for one in self.kinds])
        limits = np.zeros(8)
        for many in range(2, 8):
            limits[many] = squared_gate_distance(self.rules.p.gate_probability, many)
        price = np.full(int(self.track.max()) + 1, -np.inf)
        np.maximum.at(price, self.track, limits[sizes] + self.log_volume_cost)
        return price[self.track]


class Association(Protocol):
    """Decides which detections belong to which tracks."""

    def update(self, pairs: Candidates) -> Associated:
        """Return tracks updated by detections in gates, which were hit (mask), and score gains."""
        ...


class OneToOne(Association, Protocol):
    """Gives every track at most one detection, and every detection to at most one track."""

    def taken(self, pairs: Candidates) -> IntArray:
        """Return ascending indices of pairs chosen; no track and no detection is chosen twice."""
        ...

    def update(self, pairs: Candidates) -> Associated:
        """Return tracks, each updated by at most one detection."""
        rules, part, kinds, sensors = pairs.rules, pairs.tracks, pairs.kinds, pairs.sensor_masks
        hit, gain = np.zeros(len(part), dtype=bool), np.zeros(len(part))
        if not kinds:
            return part, hit, gain
        if bool(is_only_pair_of_both(pairs.track, pairs.detection).all()):
            taken = np.arange(len(pairs.track))
        else:
            taken = self.taken(pairs)
        first = 0
        for one in kinds:
            last = first + len(one.track)
            mine = taken if len(kinds) == 1 else taken[(taken >= first) & (taken < last)] - first
            first = last
            if len(mine) == 0:
                continue
            which = one.track[mine]
            if not bool((which[1:] > which[:-1]).all()):
                mine = mine[np.argsort(which)]
                which = one.track[mine]
            estimates = rules.estimator.update(part.estimates(), which, one.measured, mine)
            correct_nonlinear_updates(pairs, which, one, mine, estimates)
            mask = sensors[one.detection[mine]]
            gain[which] = log_score_gain(rules, part, one, sensors)[mine]
            hit[which] = True
            before: dict[str, Any] = part.columns if is_everything(which, len(part)) else {
                name: select_tracks(part.columns[name], which)
                for name in ("contributors", "ranged", "nis", "freedom", "weights")
            }  # fmt: skip
            nis = mixture_innovation_squared(one.measured, before["weights"], mine)
            new = {
                **estimate_columns(estimates),
                "contributors": before["contributors"] | mask,
                "updated_by": mask,
                "ranged": before["ranged"] | one.measures_range,
                "nis": before["nis"] + nis,
                "freedom": before["freedom"] + one.kind.size,
            }
            if one.own_m_s is not None:
                new["own_m_s"] = one.own_m_s[:, mine]
            part = part.replace_columns(which, new)
        return part, hit, gain


class Nearest(OneToOne):
    """Takes the nearest pair first."""

    def taken(self, pairs: Candidates) -> IntArray:
        """Return the pairs chosen by repeatedly taking the nearest remaining pair (indices)."""
        return greedy_pair_indices(pairs.track, pairs.detection, pairs.distance)


class GlobalNearest(OneToOne):
    """Takes the pairs of the least sum over all (global nearest neighbour)."""

    def taken(self, pairs: Candidates) -> IntArray:
        """Return the indices of the pairs chosen so that the sum of their costs is least."""
        cost = pairs.distance + pairs.log_volume_cost
        return least_total_pair_indices(
            pairs.track, pairs.detection, cost, pairs.cost_of_no_detection
        )


class JointProbabilistic(Association):
    """Updates tracks by all detections in their gates, weighed (JPDA).

    Every pair updates its track; what the track is then is the mixture of all that may be, with the
    miss among them (Bar-Shalom, Li, *Multitarget-Multisensor Tracking* (1995), §3.4, in a form that
    lets detections differ in their variances and kinds). A track is hit where it is likelier than
    not that one of its detections is its own.
    """

    def update(self, pairs: Candidates) -> Associated:
        """Return tracks updated by all detections in their gates."""
        rules, part, kinds, sensors = pairs.rules, pairs.tracks, pairs.kinds, pairs.sensor_masks
        count = len(part)
        if not any(len(one.track) for one in kinds):
            return part, np.zeros(count, dtype=bool), np.zeros(count)
        track, entry = pairs.track, pairs.detection
        logs = np.concatenate([log_score_gain(rules, part, one, sensors) for one in kinds])
        missing = np.log1p(-rules.p.detection_probability * rules.p.gate_probability)
        weight = np.exp(np.minimum(logs - missing, _LARGEST_LOG))
        share = pair_probabilities(track, entry, weight, rules.p.jpda_exact_detections)
        taken = np.bincount(track, weights=share, minlength=count)
        missed = np.maximum(1.0 - taken, 0.0)
        gain = missing + np.log1p(np.bincount(track, weights=weight, minlength=count))
        updates = []
        for one in kinds:
            which = np.arange(len(one.track))
            updated = rules.estimator.update(part.estimates(), one.track, one.measured, which)
            correct_nonlinear_updates(pairs, one.track, one, which, updated)
            updates.append(updated)
        merged = rules.estimator.merge(
            part.estimates(), missed, track, share, Estimates.concatenate(updates)
        )
        hit = taken > 0.5
        order = np.lexsort((share, track))
        likeliest = order[np.append(track[order][1:] != track[order][:-1], True)]
        mask, own_m_s = np.zeros(count, dtype=np.int64), part.own_m_s.copy()
        mask[track[likeliest]] = sensors[entry[likeliest]]
        mask = np.where(hit, mask, 0)
        if kinds[0].own_m_s is not None:
            told = np.concatenate([one.own_m_s for one in kinds], axis=1)
            own_m_s[:, track[likeliest]] = told[:, likeliest]
            own_m_s = np.where(hit, own_m_s, part.own_m_s)
        ranged = np.zeros(count, dtype=bool)
        for one in kinds:
            if one.measures_range:
                ranged[one.track] = True
        changed = part.replace_estimates(
            merged,
            contributors=part.contributors | mask,
            updated_by=np.where(hit, mask, part.updated_by),
            ranged=part.ranged | (ranged & hit),
            own_m_s=own_m_s,
        )
        return changed, hit, gain


#: By the parameter `association` of trackers.
ASSOCIATIONS: dict[str, Association] = {
    "nearest": Nearest(), "gnn": GlobalNearest(), "jpda": JointProbabilistic(),
}  # fmt: skip


def correct_nonlinear_updates(
    pairs: Candidates, track: IntArray, one: GatedPairs, pair: IntArray, estimates: Estimates
) -> None:
    """Improve in place poor linear updates: angle-only tracks, large corrections, coarse bearings.

    Those of angle-only tracks are brought into modified polar coordinates, and those that went far
    along a tangent of a precise measurement are repeated. What coarse bearings
    leave of a target is an arc: there corrections turn it, but a report of where it is, whose
    errors lie along fixed axes, begins it anew if it is bent. `estimates` are those of the tracks
    `track` of the predicted ones after the pairs `pair`.
    """
    part, pose = pairs.tracks, pairs.pose
    angle_only = (~part.ranged[track]).nonzero()[0]
    straight = part.ranged[track]
    if one.own_m_s is None:
        iterate_far_updates(pairs, track, one, pair, estimates, np.flatnonzero(straight))
    else:
        own_m_s, batch, entry = one.own_m_s[:, pair], pairs.batch, one.detection[pair]
        known = np.isnan(own_m_s[0]) & ~np.isnan(part.own_m_s[0, track])
        reports = batch.code[entry] & TELLS > 0
        own_m_s = np.where(known & ~reports, part.own_m_s[:, track], own_m_s)
        straight = straight & np.isnan(own_m_s[0])
        iterate_far_updates(pairs, track, one, pair, estimates, np.flatnonzero(straight))
        rotate_coarse_updates(part, track, own_m_s, pose, estimates)
        anew = np.flatnonzero(known & reports)
        anew = anew[is_arc_bent(part.take(track[anew]), pose.take(track[anew]))]
        if len(anew):
            begun = start_estimates(
                pairs.rules, batch.scans, pose.take(track[anew]), batch.code[entry[anew]],
                batch.detection[entry[anew]],
            )  # fmt: skip
            now, new = ([*one.states, *one.covariances, one.weights] for one in (estimates, begun))
            for whole, some in zip(now, new, strict=True):
                whole[..., anew] = some
    if one.kind.has_range or len(angle_only) == 0:
        return
    which = track[angle_only]
    sensor_m = select_tracks(pose.position_m, which)
    after = zip(estimates.states, estimates.covariances, strict=True)
    for before, (state, covariance) in zip(part.states_by_model(), after, strict=True):
        moved = apply_correction_in_polar(
            select_tracks(before, which), select_tracks(state, angle_only),
            select_tracks(covariance, angle_only), sensor_m,
        )  # fmt: skip
        if one.ranges is not None:
            range_m, variance_m2 = (values[pair[angle_only]] for values in one.ranges)
            moved = update_with_first_range(*moved, range_m, variance_m2, sensor_m)
        state[:, angle_only], covariance[:, :, angle_only] = moved


def iterate_far_updates(
    pairs: Candidates,
    track: IntArray,
    one: GatedPairs,
    pair: IntArray,
    estimates: Estimates,
    which: IntArray,
) -> None:
    """Repeat, in place, updates of tracks `which` corrected too far for one linearisation."""
    if len(which) == 0:
        return
    of, mine, pose = track[which], pair[which], pairs.pose.take(track[which])
    measured, part = one.measured, pairs.tracks
    for m, slopes in enumerate(measured.learning or measured.innovations):
        # What sigma points say is no slope, and errors that states carry are judged by themselves.
        if slopes.spread.ndim > 2 or slopes.considered is not None or slopes.shared is not None:
            return
        after = (
            select_tracks(estimates.states[m], which),
            select_tracks(estimates.covariances[m], which),
        )
        before = (
            select_tracks(part.states_by_model()[m], of),
            select_tracks(part.covariances_by_model()[m], of),
        )
        iterate_updates_in_place(
            one.kind,
            pose,
            before,
            after,
            slopes.take(mine),
            select_tracks(measured.residuals[m], mine),
        )
        estimates.states[m][:, which], estimates.covariances[m][:, :, which] = after


def rotate_coarse_updates(
    part: TrackStore, track: IntArray, own_m_s: FloatArray, pose: SensorPose, estimates: Estimates
) -> None:
    """Replace in place coarse-bearing updates by turns about the sensor; not at NaN `own_m_s`."""
    coarse = np.flatnonzero(~np.isnan(own_m_s[0]))
    if not len(coarse):
        return
    which = track[coarse]
    after = zip(estimates.states, estimates.covariances, strict=True)
    for before, (state, covariance) in zip(part.states_by_model(), after, strict=True):
        state[:, coarse], covariance[:, :, coarse] = apply_correction_by_rotation(
            select_tracks(before, which), select_tracks(state, coarse),
            select_tracks(covariance, coarse),
            select_tracks(pose.position_m, which), own_m_s[:, coarse],
        )  # fmt: skip


def is_arc_bent(part: TrackStore, pose: SensorPose) -> BoolArray:
    """Return which tracks spread too wide for a straight line along the arc of equal range (mask).

    At two deviations a straight line leaves it by `_BENT` of the deviation along it.
    """
    result = np.zeros(len(part), dtype=bool)
    for state, spread in zip(part.states_by_model(), part.covariances_by_model(), strict=True):
        x, y, _ = state[:3] - pose.position_m
        ground = np.maximum(np.hypot(x, y), 1.0)
        cos, sin = x / ground, y / ground
        both = 2.0 * cos * sin * spread[0, 1]
        along = cos * cos * spread[0, 0] + sin * sin * spread[1, 1] + both
        across = sin * sin * spread[0, 0] + cos * cos * spread[1, 1] - both
        result |= 2.0 * across > _BENT * ground * np.sqrt(along)
    return result


def concatenate(parts: Sequence[Any]) -> Any:
    """Return arrays joined end to end along their first axis; a single one unchanged."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _log_least_gate_volume(one: GatedPairs) -> FloatArray:
    """Return, per pair, ln |S| of innovation covariance S; the least of several motion models."""
    result = log_determinant_from_root(one.measured.innovations[0].root)
    for other in one.measured.innovations[1:]:
        result = np.minimum(result, log_determinant_from_root(other.root))
    return result
