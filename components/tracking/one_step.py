"""One late look of every replica, worked on in one step."""

import numpy as np

from components.estimation import modes
from components.estimation.frame import Place
from components.estimation.late import StateThen, state_then
from components.messages.state_tracks import DELETED
from components.tracking.gated_pairs import named
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans
from components.tracking.step import detections_of, looked_at, position_variance
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray

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
) -> TrackStore:
    """Return the tracks after one late look in each of some replicas.

    Tracks that were not there before the look stay as they are, and none is started.

    Parameters
    ----------
    rules, store, scans, places, codes, looks, replica
        As in `components.tracking.step.step`.
    before : TrackStore
        How the replicas' tracks were before the first look that was made since.
    """
    of = np.minimum(np.searchsorted(replica, store.replica), len(replica) - 1)
    told = (replica[of] == store.replica) & (store.status == DELETED)  # once is enough
    store, of = store.take(~told), of[~told]
    tick = scans.tick[looks]
    old = before.take(
        (before.status != DELETED)
        & (before.tick <= tick[np.minimum(np.searchsorted(replica, before.replica),
                                          len(replica) - 1)])
    )  # fmt: skip
    if len(old) == 0:
        return store
    keys = old.replica * _NUMBERS + old.number
    key = store.replica * _NUMBERS + store.number
    place = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
    known = (replica[of] == store.replica) & (keys[place] == key)
    if not known.any():
        return store
    now, old, of = store.take(known), old.take(place[known]), of[known]
    then, parts, weights = _then(rules, old, now, tick[of])
    detection, of_detection = detections_of(scans, looks)
    seen, _ = looked_at(rules, then, of, scans, places, codes, looks, detection, of_detection)
    moved = [
        one.carried_over(x, p, seen_x, seen_p)
        for one, x, p, seen_x, seen_p in zip(
            parts, now.states(), now.covariances(), seen.states(), seen.covariances(), strict=True
        )
    ]
    changed = seen.with_columns(
        tick=now.tick,
        updated_tick=np.maximum(now.updated_tick, seen.updated_tick),
        weights=_weights_now(weights, then.weights, seen.weights, now.weights),
        **named([x for x, _ in moved], [p for _, p in moved]),
    )
    position_variance(changed)
    whole = TrackStore.joined([store.take(~known), changed])
    # Tracks stand by number, as the search above wants them.
    return whole.take(np.lexsort((whole.number, whole.replica)))


def _then(
    rules: TrackerRules, old: TrackStore, now: TrackStore, tick: IntArray
) -> tuple[TrackStore, list[StateThen], FloatArray]:
    """Return the tracks at an instant that is past, what became of them since, and of models."""
    until_s = (tick - old.tick) / rules.ticks_per_s
    since_s = (now.tick - tick) / rules.ticks_per_s
    parts = [
        state_then(model, (x, p), (y, q), until_s, since_s)
        for model, x, p, y, q in zip(
            rules.bank.models, old.states(), old.covariances(), now.states(), now.covariances(),
            strict=True,
        )
    ]  # fmt: skip
    back = np.ones((1, 1, len(now)))
    if rules.bank.rates_per_s is not None:
        back = modes.before(rules.bank.rates_per_s, old.weights, until_s, since_s)
    weights = (back * now.weights[np.newaxis]).sum(axis=1)
    states, covariances = [one.state for one in parts], [one.covariance for one in parts]
    then = now.with_columns(tick=tick, weights=weights, **named(states, covariances))
    return then, parts, back


def _weights_now(
    back: FloatArray, then: FloatArray, seen: FloatArray, now: FloatArray
) -> FloatArray:
    """Return the models' probabilities now after a look changed those of then."""
    if len(now) == 1:
        return now
    changed = seen / np.maximum(then, modes.LEAST)
    weights = now * (back * changed[:, np.newaxis]).sum(axis=0)
    return np.asarray(weights / weights.sum(axis=0))
