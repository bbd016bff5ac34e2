"""Pairs of a track and a detection in its gate."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from components.association.gates import gate_threshold
from components.estimation.batched import is_everything, selected
from components.estimation.frame import Place
from components.estimation.kalman import Moments
from components.estimation.measurement import Kind, expected
from components.geometry.angles import wrap_pi_unchecked
from components.messages.state_tracks import COASTED, CONFIRMED
from components.tracking.filter_bank import PairMeasurement, log_mixture
from components.tracking.rules import TrackerRules
from components.tracking.scans import Scans, kind_of
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# So many pairs are looked at together.
_MOST_PAIRS = 1 << 20
# The square of a box's width by that of the gate in it: who is in the gate must not depend on it.
_WIDER = 1.1
# Nearer to the vertical azimuths say nothing.
_LEAST_COS = 1e-3


@dataclass(frozen=True, eq=False)
class GatedPairs:
    """The pairs of one kind of measurement, by index among all tracks and detections of a step."""

    kind: Kind
    track: IntArray
    detection: IntArray
    said: PairMeasurement
    #: What else was measured, of tracks without a range: ranges and their variances.
    ranges: tuple[FloatArray, FloatArray] | None = None


def gated_pairs(
    rules: TrackerRules,
    part: TrackStore,
    of: IntArray,
    place: Place,
    scans: Scans,
    codes: IntArray,
    detection: IntArray,
    of_detection: IntArray,
    looks: int,
) -> tuple[list[GatedPairs], FloatArray | None, BoolArray]:
    """Return the pairs of one look in whose gate they are, kind by kind.

    Parameters
    ----------
    rules : TrackerRules
    part : TrackStore
        Predicted.
    of : (tracks,)
        The look of each, ascending.
    place : Place
        Of every track's look.
    scans : Scans
    codes : (detections,)
    detection, of_detection : (detections,)
        Their numbers in `scans`, and the look of each.
    looks : int

    Returns
    -------
    pairs : list of GatedPairs
    direction : (2, tracks) or None
        Azimuth and elevation in body axes that the first model expects, where they were needed.
    held : (detections,) of bool
        Which lie in the gate of a track, or in the wider one of a track that is confirmed.
    """
    found: list[GatedPairs] = []
    held = np.zeros(len(detection), dtype=bool)
    direction = None
    blind = bool((~part.ranged).any())
    whole = _WholeVariance(rules, part, place, scans)
    for code in np.flatnonzero(np.bincount(codes, minlength=4)).tolist():
        mine = np.flatnonzero(codes == code)
        # What a track without a range expects of one says nothing: there the direction decides.
        for of_whom in (True, False) if blind and code & 1 else (None,):
            kind, rows = kind_of(0 if of_whom is False else code)
            moments = rules.bank.moments(kind, part.states(), part.covariances(), place)
            direction = moments[0].expected[:2]
            track, entry = _near(
                rules, kind, moments, of, of_detection, mine, scans, detection, rows, looks, whole
            )
            if of_whom is not None:
                chosen = part.ranged[track] == of_whom
                track, entry = track[chosen], entry[chosen]
            if len(track) == 0:
                continue
            cells = detection[entry]
            variance = whole(track, cells, rows)
            said = rules.bank.measure(
                moments,
                track,
                _picked(scans.measured, rows, cells),
                variance,
                common_errors(
                    rules, part, track, scans, rows, cells, moments[0].expected, variance
                ),
                part.weights,
            )
            gated = said.distance <= gate_threshold(rules.gate_probability, kind.size)
            held[entry[gated]] = True
            if not gated.all():
                settled = (part.status == CONFIRMED) | (part.status == COASTED)
                near = said.distance <= gate_threshold(rules.widest_gate, kind.size)
                held[entry[near & settled[track]]] = True
            (inside,) = gated.nonzero()
            cells = cells[inside]
            found.append(
                GatedPairs(
                    kind, track[inside], entry[inside], taken_pairs(said, inside),
                    (scans.measured[2][cells], scans.variance[2][cells])
                    if of_whom is False else None,
                )
            )  # fmt: skip
    # Moments of sigma points are means over the points: not where the state itself is seen.
    return found, direction if rules.bank.sigma is None else None, held


def _near(
    rules: TrackerRules,
    kind: Kind,
    moments: list[Moments],
    of: IntArray,
    of_detection: IntArray,
    mine: IntArray,
    scans: Scans,
    detection: IntArray,
    rows: list[int],
    looks: int,
    whole: "_WholeVariance",
) -> tuple[IntArray, IntArray]:
    """Return pairs of one look whose angles and range lie in a box about the gate."""
    counts = np.bincount(of, minlength=looks)
    first = np.cumsum(counts) - counts
    many = counts[of_detection[mine]]
    threshold = gate_threshold(rules.widest_gate, kind.size)
    cells = detection[mine]
    measured = _picked(scans.measured, rows[:3], cells)
    variance = _picked(scans.variance, rows[:3], cells)
    boxes = [_box(found, variance, threshold, whole.most) for found in moments]
    tracks, entries = [], []
    # In clutter there are more pairs than fit into memory at once.
    part = np.cumsum(many) // _MOST_PAIRS
    for begin, end in _parts(part):
        size = many[begin:end]
        entry = np.repeat(np.arange(begin, end), size)
        start = np.cumsum(size) - size
        track = np.arange(len(entry)) - np.repeat(
            start - first[of_detection[mine[begin:end]]], size
        )
        kept = [_inside(*box, measured, entry, track) for box in boxes]
        near = kept[0] if len(kept) == 1 else np.unique(np.concatenate(kept))
        tracks.append(track[near])
        entries.append(mine[entry[near]])
    if len(tracks) == 1:
        return tracks[0], entries[0]
    return np.concatenate(tracks), np.concatenate(entries)


class _WholeVariance:
    """Variances of pairs: as reported, and of the ownship's place as far as the track is."""

    def __init__(self, rules: TrackerRules, part: TrackStore, place: Place, scans: Scans) -> None:
        self._scans, self._untold = scans, rules.untold_across_m2
        #: What is added at most to each track's azimuth and elevation.
        self.most: FloatArray | None = None
        if self._untold is not None:
            _, elevation, range_m = expected(Kind(True), part.state0, place)
            range2 = np.maximum(range_m, 1.0) ** 2
            level2 = np.maximum(np.cos(elevation), _LEAST_COS) ** 2
            self._by_m2 = np.stack([1.0 / (range2 * level2), 1.0 / range2])
            self.most = self._untold.max() * self._by_m2

    def __call__(self, track: IntArray, cells: IntArray, rows: list[int]) -> FloatArray:
        found = _picked(self._scans.variance, rows, cells)
        if self._untold is not None:
            source = self._scans.source[:2][:, cells]
            across_m2 = np.where(source < 0, 0.0, self._untold[source])
            found[:2] += across_m2 * selected(self._by_m2, track)
        return found


def _box(
    found: Moments, variance: FloatArray, threshold: float, more: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return where one model expects angles and range, and half the widths of boxes about gates.

    They are wide enough for the worst detection of all, and for rounding.
    """
    expected = found.expected[: len(variance)]
    half = np.empty_like(expected)
    for i, worst in enumerate(variance.max(axis=1).tolist()):
        spread = found.total[i, i] + worst
        if more is not None and i < 2:
            spread = spread + more[i]
        half[i] = np.sqrt((threshold * _WIDER) * spread)
    return expected, half


def _inside(
    expected: FloatArray, half: FloatArray, measured: FloatArray, entry: IntArray, track: IntArray
) -> IntArray:
    """Return which pairs lie in the boxes about the gates of one model."""
    left: IntArray | None = None
    for i in range(len(expected)):
        apart = measured[i].take(entry)
        apart -= expected[i].take(track)
        np.abs(apart, out=apart)
        width = half[i].take(track)
        inside = apart <= width
        if i == 0:  # azimuths may be a turn apart
            apart += width
            inside |= apart >= 2.0 * np.pi
        (some,) = inside.nonzero()
        left = some if left is None else left[some]
        entry, track = entry[some], track[some]
    assert left is not None
    return left


def _picked(values: FloatArray, rows: list[int], cells: IntArray) -> FloatArray:
    """Return some rows of values at some detections."""
    found = np.empty((len(rows), len(cells)))
    for i, row in enumerate(rows):
        values[row].take(cells, out=found[i], mode="clip")
    return found


def _parts(part: IntArray) -> list[tuple[int, int]]:
    """Return where runs of equal numbers, ascending from 0, begin and end."""
    if len(part) == 0 or part[-1] == 0:
        return [(0, len(part))]
    cuts = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(part)]
    return list(pairwise(cuts))


def taken_pairs(said: PairMeasurement, which: IntArray) -> PairMeasurement:
    if len(which) == len(said.distance):
        return said
    return PairMeasurement(
        [found.take(which) for found in said.innovations],
        [selected(apart, which) for apart in said.residuals],
        said.distance[which],
        selected(said.log_likelihoods, which),
        said.learning and [found.take(which) for found in said.learning],
        None if said.log_odds is None else selected(said.log_odds, which),
    )


def common_errors(
    rules: TrackerRules,
    part: TrackStore,
    track: IntArray,
    scans: Scans,
    rows: list[int],
    cells: IntArray,
    foreseen: FloatArray,
    variance: FloatArray,
) -> FloatArray | None:
    """Return what the errors of pairs' measurements have in common with their sensors' last ones.

    None where all errors are new at every look.
    """
    if rules.lasting is None:
        return None
    source = scans.source[rows][:, cells]
    there = np.maximum(source, 0)
    when = part.seen_tick[there, track]
    apart_s = np.abs(part.tick[track] - when) / rules.ticks_per_s
    since_s = np.where((when < 0) | (source < 0), np.inf, apart_s)
    moved = np.zeros(source.shape)
    for place, row in enumerate(rows):
        if row < 3:
            moved[place] = selected(foreseen[place], track) - part.seen[row, there[place], track]
    moved[0] = wrap_pi_unchecked(np.ascontiguousarray(moved[0]))
    moved = np.where(np.isfinite(since_s), np.abs(moved), 0.0)
    range_m = np.where(np.isfinite(since_s), part.seen[2, there, track], np.inf)
    return rules.lasting.common(rows, there, variance, moved, since_s, range_m)


def log_density(rules: TrackerRules, one: GatedPairs, sensors: IntArray) -> FloatArray:
    """Return the logarithm of the density of false alarms at every pair's detection."""
    mine = sensors[one.detection]
    lowest = mine & -mine
    sensor = np.frexp(lowest.astype(float))[1] - 1
    code = one.kind.has_range + 2 * one.kind.has_range_rate
    return np.asarray(rules.log_density[code].take(sensor))


def log_gain(
    rules: TrackerRules, part: TrackStore, one: GatedPairs, sensors: IntArray
) -> FloatArray:
    """Return ln(Pd N(z) / λ) of every pair."""
    density = log_density(rules, one, sensors)
    mixed = log_mixture(selected(part.weights, one.track), one.said.log_likelihoods)
    return np.asarray(np.log(rules.detection_probability) + mixed - density)


def named(states: list[FloatArray], covariances: list[FloatArray]) -> dict[str, FloatArray]:
    """Return states and covariances as columns of a store."""
    columns = {f"state{i}": x for i, x in enumerate(states)}
    return columns | {f"covariance{i}": p for i, p in enumerate(covariances)}


def put(part: TrackStore, which: IntArray, new: dict[str, Any]) -> TrackStore:
    """Return tracks with other values in some columns of some of them."""
    if is_everything(which, len(part)):
        return part.with_columns(**new)
    changed = {}
    for name, values in new.items():
        whole = part.columns[name].copy()
        whole[..., which] = values
        changed[name] = whole
    return part.with_columns(**changed)
