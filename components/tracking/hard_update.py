"""The update of one detection for one track: nearest, or globally nearest."""

import numpy as np

from components.association.assignment import global_nearest, nearest
from components.association.clusters import alone
from components.association.gates import gate_threshold
from components.estimation.batched import log_determinant
from components.estimation.frame import Place
from components.tracking.filter_bank import innovation_squared
from components.tracking.gated_pairs import GatedPairs, log_density, log_gain, named, put
from components.tracking.rules import TrackerRules
from components.tracking.track_store import TrackStore
from components.tracking.without_range import told_without_range
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_LOG_2_PI = float(np.log(2.0 * np.pi))


def updated_by_one(
    rules: TrackerRules,
    part: TrackStore,
    kinds: list[GatedPairs],
    sensors: IntArray,
    place: Place,
) -> tuple[TrackStore, BoolArray, FloatArray]:
    """Return tracks, each updated by at most one detection; who was, and their ln(Pd N(z) / λ)."""
    hit, gain = np.zeros(len(part), dtype=bool), np.zeros(len(part))
    if not kinds:
        return part, hit, gain
    track = np.concatenate([one.track for one in kinds])
    entry = np.concatenate([one.detection for one in kinds])
    distance = np.concatenate([one.said.distance for one in kinds])
    if bool(alone(track, entry).all()):
        taken = np.arange(len(track))
    elif rules.association == "nearest":
        taken = nearest(track, entry, distance)
    else:
        # Kinds measure different things: what all compare with are false alarms of their kind.
        volume = np.concatenate(
            [_log_volume(one) + 2.0 * log_density(rules, one, sensors) + one.kind.size * _LOG_2_PI
             for one in kinds]
        )  # fmt: skip
        sizes = np.concatenate([np.full(len(one.track), len(one.said.residuals[0]))
                                for one in kinds])  # fmt: skip
        limits = np.zeros(5)
        for many in range(2, 5):
            limits[many] = gate_threshold(rules.gate_probability, many)
        price = np.full(len(part), -np.inf)
        np.maximum.at(price, track, limits[sizes] + volume)
        taken = global_nearest(track, entry, distance + volume, price[track])
    first = 0
    for one in kinds:
        last = first + len(one.track)
        mine = taken[(taken >= first) & (taken < last)] - first
        first = last
        if len(mine) == 0:
            continue
        mine = mine[np.argsort(one.track[mine])]
        which = one.track[mine]
        states, covariances, weights = rules.bank.update(
            part.states(), part.covariances(), part.weights, which, one.said, mine
        )
        told_without_range(part, which, one, mine, place, states, covariances)
        mask = sensors[one.detection[mine]]
        gain[which] = log_gain(rules, part, one, sensors)[mine]
        hit[which] = True
        size = len(one.said.residuals[0])
        ranged = one.kind.has_range or one.ranges is not None
        new = {
            **named(states, covariances),
            "weights": weights,
            "contributors": part.contributors[which] | mask,
            "updated_by": mask,
            "ranged": part.ranged[which] | ranged,
            "nis": part.nis[which] + innovation_squared(one.said, part.weights[:, which], mine),
            "freedom": part.freedom[which] + size,
        }
        part = put(part, which, new)
    return part, hit, gain


def _log_volume(one: GatedPairs) -> FloatArray:
    """Return ln |S| of every pair; of several models the least, whose gate is the tightest."""
    found = log_determinant(one.said.innovations[0].root)
    for other in one.said.innovations[1:]:
        found = np.minimum(found, log_determinant(other.root))
    return found
