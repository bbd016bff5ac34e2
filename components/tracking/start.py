"""The start of tracks, from one detection each."""

from typing import Any

import numpy as np

from components.estimation.batched import product, product_transposed, selected
from components.estimation.frame import Place
from components.estimation.kalman import innovation, updated
from components.estimation.measurement import Kind, expected, linearised, position_of
from components.messages.state_tracks import TENTATIVE
from components.tracking.gated_pairs import named
from components.tracking.life import NEVER
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans, kind_of
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray


def started(
    rules: TrackerRules,
    scans: Scans,
    places: Place,
    codes: IntArray,
    looks: IntArray,
    replica: IntArray,
    next_number: IntArray,
    detection: IntArray,
    of: IntArray,
) -> tuple[TrackStore, IntArray]:
    """Return a track for every one of some detections, in their order."""
    count = len(detection)
    sizes = rules.bank.sizes
    measured, variance = (
        selected(scans.measured[:3], detection),
        selected(scans.variance[:3], detection),
    )
    ranged = codes[detection] % 2 == 1
    mean, deviation = rules.start_range_m
    measured[2] = np.where(ranged, measured[2], mean)
    variance[2] = np.where(ranged, variance[2], deviation**2)
    # Nearer than its own error nothing has a direction; a false alarm may be reported at range 0.
    measured[2] = np.maximum(measured[2], np.sqrt(variance[2]))
    place = places.take(looks[of])
    position, jacobian = position_of(measured, place)
    spread = np.zeros((6, 6, count))
    spread[:3, :3] = product_transposed(product(jacobian, _diagonal(variance)), jacobian)
    spread[:3, :3] = 0.5 * (spread[:3, :3] + spread[:3, :3].swapaxes(0, 1))
    for i in range(3, 6):
        spread[i, i] = rules.start_speed_m_s**2
    states, covariances = [], []
    for size in sizes:
        state, covariance = np.zeros((size, count)), np.zeros((size, size, count))
        state[:3], covariance[:6, :6] = position, spread
        unknown = rules.start_turn_rad_s if size == 7 else rules.start_acceleration_m_s2
        for i in range(6, size):
            covariance[i, i] = unknown**2
        _tell_rates(scans, place, codes, detection, state, covariance)
        states.append(state)
        covariances.append(covariance)
    counts = np.bincount(of, minlength=len(looks))
    within = np.arange(count) - (np.cumsum(counts) - counts)[of]
    tick, mask, ones = scans.tick[looks][of], scans.contributors[detection], np.ones(count)
    whole = ones.astype(np.int64)
    born = TrackStore(
        {
            "replica": replica[of],
            "number": next_number[of] + within,
            "tick": tick,
            "born_tick": tick,
            "updated_tick": tick,
            "history": whole,
            "looks": whole,
            "misses": 0 * whole,
            "status": np.full(count, TENTATIVE),
            "score": rules.start_score * ones,
            "contributors": mask,
            "updated_by": mask,
            "ranged": ranged,
            "nis": 0.0 * ones,
            "freedom": 0 * whole,
            "vain": np.where(mask >> np.arange(len(rules.fields))[:, np.newaxis] & 1, 0, NEVER),
            "seen": np.full((3, len(rules.fields), count), np.nan),
            "seen_tick": np.full((len(rules.fields), count), -1),
            "weights": np.full((len(sizes), count), 1.0 / len(sizes)),
            **named(states, covariances),
        }
    )
    if rules.lasting is not None:
        born = born.with_columns(**now_seen(rules, born, place, mask))
    status = rules.life.judge(
        born.status, born.history, born.looks, born.misses, born.score, rules.start_score
    )
    return born.with_columns(status=status), next_number + counts


def now_seen(rules: TrackerRules, part: TrackStore, place: Place, mask: IntArray) -> Any:
    """Return the columns of where tracks were last seen after the sensors of a mask saw them."""
    mine = (mask >> np.arange(len(rules.fields))[:, np.newaxis] & 1).astype(bool)
    here = expected(Kind(True), part.state0, place)
    return {
        "seen": np.where(mine[np.newaxis], here[:, np.newaxis], part.seen),
        "seen_tick": np.where(mine, part.tick, part.seen_tick),
    }


def _tell_rates(
    scans: Scans,
    place: Place,
    codes: IntArray,
    detection: IntArray,
    state: FloatArray,
    covariance: FloatArray,
) -> None:
    """Let new tracks know their measured range rates, in place."""
    which = np.flatnonzero(codes[detection] >= 2)
    if len(which) == 0:
        return
    kind, _ = kind_of(2)
    known, slope = linearised(kind, selected(state, which), place.take(which))
    cells = detection[which]
    rate, variance = selected(scans.measured[3:], cells), selected(scans.variance[3:], cells)
    found = innovation(known[2:], slope[2:], selected(covariance, which), variance)
    state[:, which], covariance[:, :, which] = updated(
        selected(state, which), selected(covariance, which), found, rate - known[2:]
    )


def _diagonal(variance: FloatArray) -> FloatArray:
    found = np.zeros((len(variance), *variance.shape))
    for i, values in enumerate(variance):
        found[i, i] = values
    return found
