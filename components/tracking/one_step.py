"""One late look of every replica, worked on in one step."""

import numpy as np

from components.estimation import modes
from components.estimation.frame import Place
from components.estimation.late import StateThen, state_back, state_then
from components.messages.state_tracks import DELETED
from components.tracking.gated_pairs import named
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans
from components.tracking.start import started
from components.tracking.step import detections_of, looked_at, position_variance, predicted
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# More than there are tracks in a replica.
_NUMBERS = 1 << 32


def late_step(
    rules: TrackerRules,
    store: TrackStore,
    before: TrackStore,
    scans: Scans,
    places: Place,
    codes: IntArray,
    looks: IntArray,
    replica: IntArray,
    next_number: IntArray,
    *,
    unless_updated: bool,
) -> tuple[TrackStore, IntArray, BoolArray]:
    """Return the tracks after one late look in each of some replicas, and their next numbers.

    A look is late for the tracks that speak of a later instant. Those that were there before it are
    taken back to it by what they were then, those that are newer by what they are now; others are
    carried on to it as ever.

    Parameters
    ----------
    rules, store, scans, places, codes, looks, replica, next_number
        As in `components.tracking.step.step`.
    before : TrackStore
        How the replicas' tracks were before the first look that was made since.
    unless_updated : bool
        Leave tracks as they are that something later has updated. A later look in vain does not
        count: it told nothing of where they are.

    Returns
    -------
    store, next_number
    left_out : (n,) of bool
        Which looks have a detection that such a track would have had.
    """
    of = np.minimum(np.searchsorted(replica, store.replica), len(replica) - 1)
    here = replica[of] == store.replica
    now, of = store.take(here & (store.status != DELETED)), of[here & (store.status != DELETED)]
    parts = [store.take(~here)]
    tick = scans.tick[looks]
    detection, of_detection = detections_of(scans, looks)
    held = np.zeros(len(detection), dtype=bool)
    left_out = np.zeros(len(looks), dtype=bool)
    if len(now):
        ahead = now.tick > tick[of]
        place, known = _found(before, now, tick[of])
        groups = [
            (ahead & known, before.take(place[ahead & known])),
            (ahead & ~known, None),
        ]
        back = [(one, *_then(rules, now.take(one), old, tick[of][one])) for one, old in groups]
        then = [predicted(rules, now.take(~ahead), tick[of][~ahead]), *(one[1] for one in back)]
        seen, held = looked_at(
            rules, _ordered(then), of, scans, places, codes, looks, detection, of_detection
        )
        changed = [seen.take(~ahead)]
        for one, was, states, weights in back:
            changed.append(_now(now.take(one), was, seen.take(one), states, weights))
        whole = _ordered(changed)
        if unless_updated:
            newer = now.updated_tick > tick[of]
            left_out[of[newer & (seen.updated_tick == tick[of])]] = True
            whole = _ordered([whole.take(~newer), now.take(newer)])
        position_variance(whole)
        parts.append(whole)
    if not held.all():
        born, next_number = started(
            rules, scans, places, codes, looks, replica, next_number,
            detection[~held], of_detection[~held],
        )  # fmt: skip
        parts.append(born)
    return _ordered(parts), next_number, left_out


def _ordered(parts: list[TrackStore]) -> TrackStore:
    """Return all tracks by replica and number, as searches in them want them."""
    whole = TrackStore.joined(parts)
    return whole.take(np.lexsort((whole.number, whole.replica)))


def _found(before: TrackStore, now: TrackStore, tick: IntArray) -> tuple[IntArray, BoolArray]:
    """Return where tracks stand among those of before, and which speak of `tick` at the latest."""
    if len(before) == 0:
        return np.zeros(len(now), dtype=np.int64), np.zeros(len(now), dtype=bool)
    keys = before.replica * _NUMBERS + before.number
    key = now.replica * _NUMBERS + now.number
    place = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
    there = (keys[place] == key) & (before.status[place] != DELETED)
    return place, there & (before.tick[place] <= tick)


def _then(
    rules: TrackerRules, now: TrackStore, old: TrackStore | None, tick: IntArray
) -> tuple[TrackStore, list[StateThen], FloatArray]:
    """Return the tracks at an instant that is past, what became of them since, and of models.

    Parameters
    ----------
    rules : TrackerRules
    now : TrackStore
    old : TrackStore or None
        The same tracks as they were before; None where they were not there.
    tick : (tracks,)
    """
    since_s = (now.tick - tick) / rules.ticks_per_s
    present = zip(rules.bank.models, now.states(), now.covariances(), strict=True)
    if old is None:
        until_s, chances = np.zeros(len(now)), now.weights
        parts = [state_back(model, (x, p), since_s) for model, x, p in present]
    else:
        until_s, chances = (tick - old.tick) / rules.ticks_per_s, old.weights
        parts = [
            state_then(model, (y, q), (x, p), until_s, since_s)
            for (model, x, p), y, q in zip(present, old.states(), old.covariances(), strict=True)
        ]
    back = np.ones((1, 1, len(now)))
    if rules.bank.rates_per_s is not None:
        back = modes.before(rules.bank.rates_per_s, chances, until_s, since_s)
    weights = (back * now.weights[np.newaxis]).sum(axis=1)
    states, covariances = [one.state for one in parts], [one.covariance for one in parts]
    then = now.with_columns(tick=tick, weights=weights, **named(states, covariances))
    return then, parts, back


def _now(
    now: TrackStore, then: TrackStore, seen: TrackStore, parts: list[StateThen], back: FloatArray
) -> TrackStore:
    """Return the tracks as they are now, after a look changed what they were then."""
    moved = [
        one.carried_over(x, p, seen_x, seen_p)
        for one, x, p, seen_x, seen_p in zip(
            parts, now.states(), now.covariances(), seen.states(), seen.covariances(), strict=True
        )
    ]
    return seen.with_columns(
        tick=now.tick,
        updated_tick=np.maximum(now.updated_tick, seen.updated_tick),
        weights=_weights_now(back, then.weights, seen.weights, now.weights),
        **named([x for x, _ in moved], [p for _, p in moved]),
    )


def _weights_now(
    back: FloatArray, then: FloatArray, seen: FloatArray, now: FloatArray
) -> FloatArray:
    """Return the models' probabilities now after a look changed those of then."""
    if len(now) == 1:
        return now
    changed = seen / np.maximum(then, modes.LEAST)
    weights = now * (back * changed[:, np.newaxis]).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))
