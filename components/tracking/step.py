"""One look of every replica, in sequence or late: predict, gate, associate, update, manage.

A late look (an out-of-sequence measurement) is worked on in one step: tracks are retrodicted to its
instant, associated and corrected there, and the correction is carried forward to now.
"""

import numpy as np

from components.estimation.estimator import LEAST, Estimates
from components.estimation.out_of_sequence import (
    Retrodiction,
    retrodict_before_start,
    retrodict_between,
)
from components.messages.state_tracks import DELETED
from components.tracking.association import Association, Candidates
from components.tracking.due_detections import is_detection_expected
from components.tracking.gating import gate_pairs
from components.tracking.management import (
    initiate_tracks,
    summed_position_variance_m2,
    update_history_score_status,
)
from components.tracking.rules import TrackerRules
from components.tracking.scans import LookBatch
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


def tracks_after_looks(
    rules: TrackerRules,
    association: Association,
    store: TrackStore,
    batch: LookBatch,
    next_number: IntArray,
) -> tuple[TrackStore, IntArray]:
    """Return some replicas' tracks after one look of each, and their next track numbers.

    Tracks of replicas that do not look stay as they are.
    """
    replica = batch.replica
    of = np.minimum(replica.searchsorted(store.replica), len(replica) - 1)
    here = replica[of] == store.replica
    parts = [] if here.all() else [store.take(~here)]
    alive = here & (store.status != DELETED)
    part = store.take(alive)
    if len(part) < len(store):
        of = of[alive]
    part = predict_tracks(rules, part, batch.tick[of])
    held = np.zeros(len(batch.detection), dtype=bool)
    if len(part):
        part, held = associate_looks(rules, association, part, of, batch)
    parts.append(part)
    if not held.all():
        new, next_number = initiate_tracks(rules, batch, ~held, next_number)
        parts.append(new)
    # A single part is in the order that the store has.
    store = parts[0] if len(parts) == 1 else TrackStore.concatenate(parts).sort()
    return store, next_number


def predict_tracks(rules: TrackerRules, part: TrackStore, tick: IntArray) -> TrackStore:
    """Return the tracks predicted to given instants (ticks), none earlier than the track's own."""
    if len(part) == 0:
        return part
    dt_s = (tick - part.tick) / rules.ticks_per_s
    again = dt_s == 0.0  # innovations of one instant add up
    return part.replace_estimates(
        rules.estimator.predict(part.estimates(), dt_s),
        tick=tick, nis=part.nis * again, freedom=part.freedom * again,
    )  # fmt: skip


def associate_looks(
    rules: TrackerRules,
    association: Association,
    part: TrackStore,
    of: IntArray,
    batch: LookBatch,
) -> tuple[TrackStore, BoolArray]:
    """Return the tracks updated by one look each, and a mask of the detections that are in some
    gate and so start no new track.
    """
    pose = batch.poses_of_looks(of)
    kinds, direction, held = gate_pairs(rules, part, of, pose, batch)
    looked = is_detection_expected(rules.fields, rules.promises, part, of, batch, pose, direction)
    pairs = Candidates(rules, part, kinds, batch, pose)
    changed, hit, gain = association.update(pairs)
    return update_history_score_status(rules, part, changed, pose, looked, hit, gain), held


def tracks_after_late_looks(
    rules: TrackerRules,
    association: Association,
    store: TrackStore,
    before: TrackStore,
    batch: LookBatch,
    next_number: IntArray,
    *,
    unless_updated: bool,
) -> tuple[TrackStore, IntArray, BoolArray]:
    """Return tracks after one late look of some replicas, next numbers and left-out looks (mask).

    A look is late for the tracks that speak of a later instant. Those that were there before it,
    as in `before`, are taken back to it by what they were then, those that are newer by what they
    are now; others are carried on to it as ever.

    With `unless_updated` tracks stay as they are that something later has updated (a later
    misdetection does not count: it said nothing of where they are), and looks are left out that
    have a detection that such a track would have had.
    """
    replica, tick = batch.replica, batch.tick
    of = np.minimum(replica.searchsorted(store.replica), len(replica) - 1)
    here = replica[of] == store.replica
    now, of = store.take(here & (store.status != DELETED)), of[here & (store.status != DELETED)]
    parts = [store.take(~here)]
    held = np.zeros(len(batch.detection), dtype=bool)
    left_out = np.zeros(len(replica), dtype=bool)
    if len(now):
        ahead = now.tick > tick[of]
        index, known = _match_earlier_tracks(before, now, tick[of])
        groups = [
            (ahead & known, before.take(index[ahead & known])),
            (ahead & ~known, None),
        ]
        back = [(one, *_retrodict(rules, now.take(one), old, tick[of][one])) for one, old in groups]
        for _, was, _, _ in back:
            summed_position_variance_m2(was, late=True)
        then = [
            predict_tracks(rules, now.take(~ahead), tick[of][~ahead]),
            *(one[1] for one in back),
        ]
        seen, held = associate_looks(rules, association, _sort_tracks(then), of, batch)
        changed = [seen.take(~ahead)]
        for one, was, states, weights in back:
            changed.append(_carry_forward(now.take(one), was, seen.take(one), states, weights))
        whole = _sort_tracks(changed)
        if unless_updated:
            newer = now.updated_tick > tick[of]
            left_out[of[newer & (seen.updated_tick == tick[of])]] = True
            whole = _sort_tracks([whole.take(~newer), now.take(newer)])
        summed_position_variance_m2(whole, late=True)
        parts.append(whole)
    if not held.all():
        new, next_number = initiate_tracks(rules, batch, ~held, next_number)
        parts.append(new)
    return _sort_tracks(parts), next_number, left_out


def _sort_tracks(parts: list[TrackStore]) -> TrackStore:
    return TrackStore.concatenate(parts).sorted_by_key()


def _match_earlier_tracks(
    before: TrackStore, now: TrackStore, tick: IntArray
) -> tuple[IntArray, BoolArray]:
    """Return each track's index in the earlier table, and a mask of states at or before `tick`."""
    if len(before) == 0:
        return np.zeros(len(now), dtype=np.int64), np.zeros(len(now), dtype=bool)
    keys, key = before.unique_numbers, now.unique_numbers
    index = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
    there = (keys[index] == key) & (before.status[index] != DELETED)
    return index, there & (before.tick[index] <= tick)


def _retrodict(
    rules: TrackerRules, now: TrackStore, old: TrackStore | None, tick: IntArray
) -> tuple[TrackStore, list[Retrodiction], FloatArray]:
    """Return tracks predicted back to a past instant, retrodictions and model probabilities."""
    since_s = (now.tick - tick) / rules.ticks_per_s
    present = zip(
        rules.estimator.models, now.states_by_model(), now.covariances_by_model(), strict=True
    )
    if old is None:
        until_s, chances = np.zeros(len(now)), now.weights
        parts = [retrodict_before_start(model, (x, p), since_s) for model, x, p in present]
    else:
        until_s, chances = (tick - old.tick) / rules.ticks_per_s, old.weights
        parts = [
            retrodict_between(model, (y, q), (x, p), until_s, since_s)
            for (model, x, p), y, q in zip(
                present, old.states_by_model(), old.covariances_by_model(), strict=True
            )
        ]
    back = rules.estimator.past_model_probabilities(chances, until_s, since_s)
    weights = (back * now.weights[np.newaxis]).sum(axis=1)
    then = Estimates([one.state for one in parts], [one.covariance for one in parts], weights)
    return now.replace_estimates(then, tick=tick), parts, back


def _carry_forward(
    now: TrackStore, then: TrackStore, seen: TrackStore, parts: list[Retrodiction], back: FloatArray
) -> TrackStore:
    """Return the tracks at present, corrected by what a late look changed at the past instant."""
    moved = [
        one.carry_forward(x, p, seen_x, seen_p)
        for one, x, p, seen_x, seen_p in zip(
            parts,
            now.states_by_model(),
            now.covariances_by_model(),
            seen.states_by_model(),
            seen.covariances_by_model(),
            strict=True,
        )
    ]
    weights = _corrected_model_probabilities(back, then.weights, seen.weights, now.weights)
    return seen.replace_estimates(
        Estimates([x for x, _ in moved], [p for _, p in moved], weights),
        tick=now.tick,
        updated_tick=np.maximum(now.updated_tick, seen.updated_tick),
    )


def _corrected_model_probabilities(
    back: FloatArray, then: FloatArray, seen: FloatArray, now: FloatArray
) -> FloatArray:
    """Return present model probabilities, corrected by how a late look changed the past ones."""
    if len(now) == 1:
        return now
    changed = seen / np.maximum(then, LEAST)
    weights = now * (back * changed[:, np.newaxis]).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))
