"""The update of joint probabilistic data association: by all detections in the gate, weighed.

Every pair updates its track; what the track is then is the mixture of all that may be, with the
miss among them (Bar-Shalom, Li, *Multitarget-Multisensor Tracking* (1995), §3.4, in a form that
lets detections differ in their variances and kinds).
"""

import numpy as np

from components.association.jpda import marginals
from components.estimation import modes
from components.estimation.frame import Place
from components.tracking.filter_bank import mixture_by_track
from components.tracking.gated_pairs import GatedPairs, log_gain, named
from components.tracking.rules import TrackerRules
from components.tracking.track_store import TrackStore
from components.tracking.without_range import told_without_range
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# Weights are kept below this power of e: products of some of them still are numbers.
_LARGEST_LOG = 200.0


def updated_by_all(
    rules: TrackerRules,
    part: TrackStore,
    kinds: list[GatedPairs],
    sensors: IntArray,
    place: Place,
) -> tuple[TrackStore, BoolArray, FloatArray]:
    """Return tracks updated by all detections in their gates; who counts as hit, and their gains.

    A track is hit where it is likelier than not that one of its detections is its own.
    """
    count = len(part)
    if not any(len(one.track) for one in kinds):
        return part, np.zeros(count, dtype=bool), np.zeros(count)
    track = np.concatenate([one.track for one in kinds])
    entry = np.concatenate([one.detection for one in kinds])
    logs = np.concatenate([log_gain(rules, part, one, sensors) for one in kinds])
    missing = np.log1p(-rules.detection_probability * rules.gate_probability)
    weight = np.exp(np.minimum(logs - missing, _LARGEST_LOG))
    share = marginals(track, entry, weight, rules.exact_up_to)
    taken = np.bincount(track, weights=share, minlength=count)
    none = np.maximum(1.0 - taken, 0.0)
    gain = missing + np.log1p(np.bincount(track, weights=weight, minlength=count))
    # Where nothing is in the gate all stays as it was, to the bit, as without this function.
    paired = np.bincount(track, minlength=count) > 0
    # Per model: probability of each (pair, model) and of each (miss, model).
    by_model, states, covariances = [], [], []
    parts = []
    for one in kinds:
        which = np.arange(len(one.track))
        x, p, weights = rules.bank.update(
            part.states(), part.covariances(), part.weights, one.track, one.said, which
        )
        told_without_range(part, one.track, one, which, place, x, p)
        parts.append((x, p, weights))
    modes_of = np.concatenate([weights for _, _, weights in parts], axis=1)
    every = np.concatenate([np.arange(count), track])
    for m in range(len(part.weights)):
        chance = np.concatenate([none * part.weights[m], share * modes_of[m]])
        total = np.bincount(every, weights=chance, minlength=count)
        by_model.append(total)
        safe = np.maximum(total, modes.LEAST)
        state = np.concatenate([part.states()[m], *(one[0][m] for one in parts)], axis=1)
        within = np.concatenate([part.covariances()[m], *(one[1][m] for one in parts)], axis=2)
        mean, spread = mixture_by_track(every, count, chance / safe[every], state, within)
        moved = paired & (total > modes.LEAST)  # an impossible model stays as predicted
        states.append(np.where(moved, mean, part.states()[m]))
        covariances.append(np.where(moved, spread, part.covariances()[m]))
    weights = np.stack(by_model)
    weights = np.where(paired, weights / weights.sum(axis=0), part.weights)
    hit = taken > 0.5
    order = np.lexsort((share, track))
    last = np.flatnonzero(np.append(track[order][1:] != track[order][:-1], True))
    likeliest = np.zeros(count, dtype=np.int64)
    likeliest[track[order][last]] = sensors[entry[order][last]]
    mask = np.where(hit, likeliest, 0)
    ranged = np.zeros(count, dtype=bool)
    for one in kinds:
        if one.kind.has_range or one.ranges is not None:
            ranged[one.track] = True
    changed = part.with_columns(
        weights=weights,
        contributors=part.contributors | mask,
        updated_by=np.where(hit, mask, part.updated_by),
        ranged=part.ranged | (ranged & hit),
        **named(states, covariances),
    )
    return changed, hit, gain
