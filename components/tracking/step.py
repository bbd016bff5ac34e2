"""One look of every replica: predict, gate, associate, update, start and end tracks."""

import numpy as np

from components.estimation.batched import squared_length
from components.estimation.frame import Place
from components.estimation.measurement import Kind, expected
from components.messages.reach import EVALUATE
from components.messages.state_tracks import DELETED
from components.tracking.gated_pairs import gated_pairs, named
from components.tracking.hard_update import updated_by_one
from components.tracking.life import LARGEST_SCORE, after_hits_and_misses, seeing
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans
from components.tracking.soft_update import updated_by_all
from components.tracking.start import now_seen, started
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


def step(
    rules: TrackerRules,
    store: TrackStore,
    scans: Scans,
    places: Place,
    codes: IntArray,
    looks: IntArray,
    replica: IntArray,
    next_number: IntArray,
) -> tuple[TrackStore, IntArray]:
    """Return the tracks after one look in each of some replicas, and their next numbers.

    Parameters
    ----------
    rules : TrackerRules
    store : TrackStore
        Of all replicas; those that do not look stay as they are.
    scans : Scans
    places : Place
        Of every look.
    codes : (detections,)
        `Scans.kinds`.
    looks : (n,)
        The look of each replica.
    replica : (n,)
        Ascending.
    next_number : (n,)
        Number that the next track of each replica bears.
    """
    of = np.minimum(np.searchsorted(replica, store.replica), len(replica) - 1)
    here = replica[of] == store.replica
    parts = [] if here.all() else [store.take(~here)]
    alive = here & (store.status != DELETED)
    part = store.take(alive)
    if len(part) < len(store):
        of = of[alive]
    tick = scans.tick[looks]
    detection, of_detection = detections_of(scans, looks)
    part = predicted(rules, part, tick[of])
    if len(part):
        part, held = looked_at(rules, part, of, scans, places, codes, looks, detection,
                               of_detection)  # fmt: skip
    else:
        held = np.zeros(len(detection), dtype=bool)
    parts.append(part)
    if not held.all():
        born, next_number = started(
            rules, scans, places, codes, looks, replica, next_number,
            detection[~held], of_detection[~held],
        )  # fmt: skip
        parts.append(born)
    return TrackStore.joined(parts), next_number


def detections_of(scans: Scans, looks: IntArray) -> tuple[IntArray, IntArray]:
    """Return the detections of looks, and to which of them each belongs."""
    first = scans.offsets[looks]
    counts = scans.offsets[looks + 1] - first
    of = np.repeat(np.arange(len(looks)), counts)
    starts = np.cumsum(counts) - counts
    return np.arange(len(of)) + (first - starts)[of], of


def predicted(rules: TrackerRules, part: TrackStore, tick: IntArray) -> TrackStore:
    """Return tracks at instants (tracks,) that are not before their own."""
    if len(part) == 0:
        return part
    dt_s = (tick - part.tick) / rules.ticks_per_s
    states, covariances, weights = rules.bank.predict(
        part.states(), part.covariances(), part.weights, dt_s
    )
    again = dt_s == 0.0  # innovations of one instant add up
    return part.with_columns(
        tick=tick, weights=weights, nis=part.nis * again, freedom=part.freedom * again,
        **named(states, covariances),
    )  # fmt: skip


def looked_at(
    rules: TrackerRules,
    part: TrackStore,
    of: IntArray,
    scans: Scans,
    places: Place,
    codes: IntArray,
    looks: IntArray,
    detection: IntArray,
    of_detection: IntArray,
) -> tuple[TrackStore, BoolArray]:
    """Return tracks after association, and which detections start no track."""
    place = places.take(looks[of])
    codes_here = codes[detection]
    kinds, direction, held = gated_pairs(
        rules, part, of, place, scans, codes_here, detection, of_detection, len(looks)
    )
    looked = _expected_looks(rules, part, of, scans, looks, place, direction)
    sensors = scans.contributors[detection]
    update = updated_by_all if rules.association == "jpda" else updated_by_one
    changed, hit, gain = update(rules, part, kinds, sensors, place)
    missed = ~hit
    missed &= looked.any(axis=0)
    vain = _looks_in_vain(part.vain, np.where(hit, changed.updated_by, 0), looked)
    gain[~hit] = 0.0
    gain[missed] = np.log1p(-rules.detection_probability * rules.gate_probability)
    history, count, misses = after_hits_and_misses(
        part.history, part.looks, part.misses, hit, missed
    )
    score = np.minimum(np.maximum(part.score + gain, -LARGEST_SCORE), LARGEST_SCORE)
    status = rules.life.judge(part.status, history, count, misses, score, rules.start_score)
    if rules.lasting is not None:
        mask = np.where(hit, changed.updated_by, 0)
        changed = changed.with_columns(**now_seen(rules, changed, place, mask))
    changed = changed.with_columns(
        history=history, looks=count, misses=misses, score=score, vain=vain,
        updated_tick=np.where(hit, changed.tick, changed.updated_tick),
    )  # fmt: skip
    spread = position_variance(changed)
    ended = changed.ranged & (spread > rules.delete_above_m**2)
    ended |= changed.tick - changed.updated_tick > rules.delete_after_ticks
    return changed.with_columns(status=np.where(ended, DELETED, status)), held


def _looks_in_vain(vain: IntArray, by: IntArray, looked: BoolArray) -> IntArray:
    """Return each sensor's looks in vain after a look; `by` is the mask of who updated a track."""
    new = vain.copy()
    hitting = int(np.bitwise_or.reduce(by)) if len(by) else 0
    for i, mine in enumerate(looked):
        new[i] += mine
        if hitting >> i & 1:
            new[i][(by >> i & 1).astype(bool)] = 0
    return new


def position_variance(part: TrackStore) -> FloatArray:
    """Return the variance of each track's position, summed over its axes.

    Raises
    ------
    ValueError
        If one is negative or no number.
    """
    total = np.zeros(len(part))
    for weight, spread in zip(part.weights, part.covariances(), strict=True):
        total = total + weight * (spread[0, 0] + spread[1, 1] + spread[2, 2])
    good = np.isfinite(total) & (total >= 0.0)
    if not bool(good.all()):
        number = int(part.number[~good][0])
        raise ValueError(
            f"the covariance of track {number} has become singular: the stated variances are "
            "smaller than what the filter's arithmetic resolves at this range, or the noise of the "
            "motion is too large beside them; state larger ones, or less noise"
        )
    return total


def _expected_looks(
    rules: TrackerRules,
    part: TrackStore,
    of: IntArray,
    scans: Scans,
    looks: IntArray,
    place: Place,
    direction: FloatArray | None,
) -> BoolArray:
    """Return which sensors looked where the tracks are that they see, (sensors, tracks)."""
    sensors = np.where(scans.tells_misses[looks], scans.sensors[looks], 0)
    used = int(np.bitwise_or.reduce(sensors)) if len(sensors) else 0
    found = np.zeros((len(rules.fields), len(part)), dtype=bool)
    if used == 0:
        return found
    mine = sensors[of]
    sees = seeing(part.vain)
    where: tuple[FloatArray, FloatArray, FloatArray] | None = None
    for i, field in enumerate(rules.fields):
        if not used >> i & 1:
            continue
        found[i] = (mine >> i & 1).astype(bool) & sees[i]
        if field is None:
            continue
        if where is None:
            if direction is None:
                direction = expected(Kind(False), part.state0, place)
            away = np.sqrt(squared_length(part.state0[:3] - place.position_m))
            where = (*direction, np.where(part.ranged, away, 0.0))
        there = np.ones(len(part), dtype=bool)
        found[i] &= field.decide(*where, there) == EVALUATE
    return found
