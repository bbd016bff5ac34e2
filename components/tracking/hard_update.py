"""The update of one detection for one track: nearest, or globally nearest."""

from typing import Any

import numpy as np

from components.association.assignment import global_nearest, nearest
from components.association.clusters import alone
from components.association.gates import gate_threshold
from components.estimation.batched import is_everything, log_determinant, selected
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
    track = joined([one.track for one in kinds])
    entry = joined([one.detection for one in kinds])
    if bool(alone(track, entry).all()):
        taken = np.arange(len(track))
    elif rules.association == "nearest":
        taken = nearest(track, entry, joined([one.said.distance for one in kinds]))
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
        distance = joined([one.said.distance for one in kinds])
        taken = global_nearest(track, entry, distance + volume, price[track])
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
        states, covariances, weights = rules.bank.update(
            part.states(), part.covariances(), part.weights, which, one.said, mine
        )
        told_without_range(part, which, one, mine, place, states, covariances)
        mask = sensors[one.detection[mine]]
        gain[which] = log_gain(rules, part, one, sensors)[mine]
        hit[which] = True
        size = len(one.said.residuals[0])
        ranged = one.kind.has_range or one.ranges is not None
        before: dict[str, Any] = part.columns if is_everything(which, len(part)) else {
            name: selected(part.columns[name], which)
            for name in ("contributors", "ranged", "nis", "freedom", "weights")
        }  # fmt: skip
        new = {
            **named(states, covariances),
            "weights": weights,
            "contributors": before["contributors"] | mask,
            "updated_by": mask,
            "ranged": before["ranged"] | ranged,
            "nis": before["nis"] + innovation_squared(one.said, before["weights"], mine),
            "freedom": before["freedom"] + size,
        }
        part = put(part, which, new)
    return part, hit, gain


def joined(parts: list[Any]) -> Any:
    """Return arrays end to end; a single one as it is."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _log_volume(one: GatedPairs) -> FloatArray:
    """Return ln |S| of every pair; of several models the least, whose gate is the tightest."""
    found = log_determinant(one.said.innovations[0].root)
    for other in one.said.innovations[1:]:
        found = np.minimum(found, log_determinant(other.root))
    return found
