"""Pairs of a track and a detection in its gate."""

from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from components.association.assignment import squared_gate_distance
from components.estimation.batched import select_tracks
from components.estimation.estimator import PairMeasurement, log_mixture, pair_measurement
from components.estimation.frame import SensorPose
from components.estimation.kalman import Moments
from components.estimation.measurement import Kind, expected_measurement
from components.geometry import wrap_pi_unchecked
from components.messages.state_tracks import COASTED, CONFIRMED
from components.tracking.reported_errors import (
    angles_in_level_axes,
    variances_of_azimuth_elevation_range,
)
from components.tracking.rules import TrackerRules
from components.tracking.scans import TELLS, LookBatch, Scans, kind_and_measured_rows
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# So many pairs are looked at together.
_MOST_PAIRS = 1 << 20
# So few pairs are all gated at once: a box first would cost more.
_FEW_PAIRS = 64
# The square of a box's width by that of the gate in it: who is in the gate must not depend on it.
_WIDER = 1.1
# Nearer to the vertical azimuths say nothing.
_LEAST_COS = 1e-3


@dataclass(frozen=True, eq=False)
class GatedPairs:
    """Pairs of a track and a detection in its gate, for one kind of measurement, as indices into
    all tracks and detections of a step.
    """

    kind: Kind
    track: IntArray
    detection: IntArray
    measured: PairMeasurement
    #: What else was measured, of tracks without a range: ranges and their variances.
    ranges: tuple[FloatArray, FloatArray] | None = None
    #: (3, pairs) or None: The ownship's velocity, of bearings coarse beside their ranges; else NaN.
    #: None where no error is carried.
    own_m_s: FloatArray | None = None

    @property
    def measures_range(self) -> bool:
        """Return whether the detections have a range."""
        return self.kind.has_range or self.ranges is not None


def gate_pairs(
    rules: TrackerRules, part: TrackStore, of: IntArray, pose: SensorPose, batch: LookBatch
) -> tuple[list[GatedPairs], FloatArray | None, BoolArray]:
    """Return gated pairs by kind, expected directions, and which detections are in a gate (mask).

    `of` is the look of each track, ascending, and `pose` that look's. Also returned are the
    direction that the first model expects of every track, (2, tracks) in body axes, where it was
    needed and is that of the state; and which detections are held: in the gate of a track, or in
    the wider one of a track that is confirmed.
    """
    kinds: list[GatedPairs] = []
    scans = batch.scans
    held = np.zeros(len(batch.detection), dtype=bool)
    direction = None
    some_angle_only = bool((~part.ranged).any())
    linear, on_arc = rules.estimator.linearised, ~np.isnan(part.own_m_s[0])
    apart = linear is not rules.estimator and bool(on_arc.any())
    spread = _PairVariance(rules, part, pose, scans)
    for code in np.bincount(batch.code).nonzero()[0].tolist():
        mine = (batch.code == code).nonzero()[0]
        # What an angle-only track expects of a range says nothing: there the direction decides.
        ways = product(
            (True, False) if some_angle_only and code & 1 else (None,),
            (True, False) if apart else (None,),
        )
        for ranged, arc in ways:
            kind, rows = kind_and_measured_rows(0 if ranged is False else code)
            estimator = linear if arc else rules.estimator
            moments = estimator.expect(kind, part.estimates(), pose)
            # Moments of sigma points are means over them: not where the state itself is seen.
            direction = moments[0].expected[:2] if moments[0].left_over is None else None
            # The box of a kind that tells of errors is not about its gate, and decides itself.
            few = 0 if code & TELLS else _FEW_PAIRS
            track, entry = _track_detection_pairs_in_boxes(
                rules, kind, rows, moments, of, batch, mine, spread, few
            )
            if ranged is not None:
                chosen = part.ranged[track] == ranged
                track, entry = track[chosen], entry[chosen]
            if arc is not None:
                chosen = on_arc[track] == arc
                track, entry = track[chosen], entry[chosen]
            if len(track) == 0:
                continue
            cells = batch.detection[entry]
            measured = _values_at(scans.measured, rows, cells)
            own_m_s = None if rules.carried is None else np.full((3, len(cells)), np.nan)
            if rules.carried is not None and code & TELLS and ranged is not False:
                own_m_s = rules.carried.ownship_velocity_m_s(scans, cells)
                reported = rules.carried.errors_of_detections(scans, cells).with_track_covariances(
                    part.covariance0.take(track, -1), part.state0[3:6].take(track, -1)
                )
                white = rules.carried.new_error_variances(scans, cells, rows)
                measured[:2], level_pose = angles_in_level_axes(measured[:2], pose.take(track))
                mine_then = part.take(track)
                since = np.maximum(mine_then.tick - mine_then.updated_tick, 0) / rules.ticks_per_s
                ages = rules.carried.position_and_velocity_ages(scans, cells, since)
                foreseen = [
                    replace(
                        ages.add_age_errors(result, model, state, covariance),
                        considered=reported.uncorrected_components,
                    )
                    for result, model, state, covariance in zip(
                        estimator.expect(kind, mine_then.estimates(), level_pose, reported),
                        rules.estimator.models, mine_then.states_by_model(),
                        mine_then.covariances_by_model(),
                        strict=True,
                    )
                ]  # fmt: skip
                pairs = pair_measurement(
                    foreseen, np.arange(len(track)), measured,
                    variances_of_azimuth_elevation_range(white, measured), None, part.weights,
                )  # fmt: skip
            else:
                variance = spread(track, cells, rows)
                pairs = pair_measurement(
                    moments, track, measured, variance,
                    covariance_with_last_errors(
                        rules, part, track, scans, rows, cells, moments[0].expected, variance
                    ),
                    part.weights,
                )  # fmt: skip
            gated = pairs.distance <= squared_gate_distance(rules.p.gate_probability, kind.size)
            held[entry[gated]] = True
            if not gated.all():
                settled = (part.status == CONFIRMED) | (part.status == COASTED)
                near = pairs.distance <= squared_gate_distance(
                    rules.widest_gate_probability, kind.size
                )
                held[entry[near & settled[track]]] = True
            (inside,) = gated.nonzero()
            cells = cells[inside]
            ranges = (scans.measured[2][cells], scans.variance[2][cells])
            kinds.append(
                GatedPairs(
                    kind, track[inside], entry[inside], pairs.take(inside),
                    ranges if ranged is False else None,
                    None if own_m_s is None else own_m_s[:, inside],
                )
            )  # fmt: skip
    return kinds, direction, held


def _track_detection_pairs_in_boxes(
    rules: TrackerRules,
    kind: Kind,
    rows: list[int],
    moments: list[Moments],
    of: IntArray,
    batch: LookBatch,
    mine: IntArray,
    spread: "_PairVariance",
    few: int,
) -> tuple[IntArray, IntArray]:
    """Return track and detection indices of pairs, the detection in the box around the gate.

    Up to so `few` pairs are all returned.
    """
    counts = np.bincount(of, minlength=len(batch.look))
    look = batch.of[mine]
    many, first = counts[look], (counts.cumsum() - counts)[look]
    so_far = many.cumsum()
    if so_far[-1] <= few:
        entry, track = _entry_and_track_pairs(many, first)
        return track, mine[entry]
    threshold = squared_gate_distance(rules.widest_gate_probability, kind.size)
    cells = batch.detection[mine]
    measured = _values_at(batch.scans.measured, rows[:3], cells)
    variance = _values_at(batch.scans.variance, rows[:3], cells)
    boxes = [_expected_and_half_widths(one, variance, threshold, spread.most) for one in moments]
    tracks, entries = [], []
    # In clutter there are more pairs than fit into memory at once.
    part = so_far // _MOST_PAIRS
    for begin, end in _bounds_of_equal_runs(part):
        entry, track = _entry_and_track_pairs(many[begin:end], first[begin:end])
        entry += begin
        kept = [_pairs_in_gate_boxes(*box, measured, entry, track) for box in boxes]
        near = kept[0] if len(kept) == 1 else np.unique(np.concatenate(kept))
        tracks.append(track[near])
        entries.append(mine[entry[near]])
    if len(tracks) == 1:
        return tracks[0], entries[0]
    return np.concatenate(tracks), np.concatenate(entries)


def _entry_and_track_pairs(many: IntArray, first: IntArray) -> tuple[IntArray, IntArray]:
    """Return entry and track indices of pairs: entry i with `many[i]` tracks from `first[i]`."""
    entry = np.arange(len(many)).repeat(many)
    before = many.cumsum() - many
    return entry, np.arange(len(entry)) - (before - first).repeat(many)


class _PairVariance:
    """Variances of pairs: as reported, and of the ownship's position as far as the track is."""

    def __init__(
        self, rules: TrackerRules, part: TrackStore, pose: SensorPose, scans: Scans
    ) -> None:
        self._scans, self._unstated = scans, rules.unstated_across_m2
        #: What is added at most to each track's azimuth and elevation.
        self.most: FloatArray | None = None
        if self._unstated is not None:
            _, elevation, range_m = expected_measurement(Kind(True), part.state0, pose)
            range2 = np.maximum(range_m, 1.0) ** 2
            level2 = np.maximum(np.cos(elevation), _LEAST_COS) ** 2
            self._by_m2 = np.stack([1.0 / (range2 * level2), 1.0 / range2])
            self.most = self._unstated.max() * self._by_m2

    def __call__(self, track: IntArray, cells: IntArray, rows: list[int]) -> FloatArray:
        variance = _values_at(self._scans.variance, rows, cells)
        if self._unstated is not None:
            source = self._scans.source[:2][:, cells]
            across_m2 = np.where(source < 0, 0.0, self._unstated[source])
            variance[:2] += across_m2 * select_tracks(self._by_m2, track)
        return variance


def _expected_and_half_widths(
    moments: Moments, variance: FloatArray, threshold: float, more: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return each track's expected angles and range, and half widths of a box around its gate.

    They are wide enough for the worst detection of all, and for rounding.
    """
    expected = moments.expected[: len(variance)]
    half = np.empty_like(expected)
    for i, worst in enumerate(variance.max(axis=1).tolist()):
        spread = moments.total[i, i] + worst
        if more is not None and i < 2:
            spread = spread + more[i]
        half[i] = np.sqrt((threshold * _WIDER) * spread)
    return expected, half


def _pairs_in_gate_boxes(
    expected: FloatArray, half: FloatArray, measured: FloatArray, entry: IntArray, track: IntArray
) -> IntArray:
    """Return the pairs whose measured values lie in the box around one model's gate (indices)."""
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


def _values_at(values: FloatArray, rows: list[int], cells: IntArray) -> FloatArray:
    """Return the given rows of an array at chosen detections, (rows, detections)."""
    result = np.empty((len(rows), len(cells)))
    for i, row in enumerate(rows):
        values[row].take(cells, out=result[i], mode="clip")
    return result


def _bounds_of_equal_runs(part: IntArray) -> list[tuple[int, int]]:
    """Return the begin and end index of each run of equal numbers in an ascending array."""
    if len(part) == 0 or part[-1] == 0:
        return [(0, len(part))]
    cuts = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(part)]
    return list(pairwise(cuts))


def covariance_with_last_errors(
    rules: TrackerRules,
    part: TrackStore,
    track: IntArray,
    scans: Scans,
    rows: list[int],
    cells: IntArray,
    foreseen: FloatArray,
    variance: FloatArray,
) -> FloatArray | None:
    """Return each pair's error covariance with the same sensor's last measurement of the track.

    None where all errors are new at every look.
    """
    if rules.lasting is None:
        return None
    source = scans.source[rows].take(cells, axis=1)
    if not rules.lasting.is_correlated[source].any():
        return None
    there = np.maximum(source, 0)
    when = part.seen_tick[there, track]
    apart_s = np.abs(part.tick.take(track) - when) / rules.ticks_per_s
    since_s = np.where((when < 0) | (source < 0), np.inf, apart_s)
    seen = np.isfinite(since_s)
    moved = np.zeros(source.shape)
    known = [row for row in rows if row < 3]  # they come first
    last = part.seen[np.array(known)[:, np.newaxis], there[: len(known)], track]
    np.subtract(foreseen[: len(known)].take(track, axis=1), last, out=moved[: len(known)])
    moved[0] = wrap_pi_unchecked(moved[0])
    moved = np.where(seen, np.abs(moved), 0.0)
    range_m = np.where(seen, part.seen[2, there, track], np.inf)
    return rules.lasting.covariance_with_last_errors(rows, there, variance, moved, since_s, range_m)


def log_false_alarm_density(rules: TrackerRules, one: GatedPairs, sensors: IntArray) -> FloatArray:
    """Return ln of the false alarm density at each pair's detection, by that one's first sensor."""
    mine = sensors[one.detection]
    lowest = mine & -mine
    sensor = np.frexp(lowest.astype(float))[1] - 1
    code = one.kind.has_range + 2 * one.kind.has_range_rate + 4 * one.kind.has_velocity
    return np.asarray(rules.log_density[code].take(sensor))


def log_score_gain(
    rules: TrackerRules, part: TrackStore, one: GatedPairs, sensors: IntArray
) -> FloatArray:
    """Return, for each pair, the gain of track score ln(Pd N(z) / λ) if its detection is taken."""
    density = log_false_alarm_density(rules, one, sensors)
    mixed = log_mixture(select_tracks(part.weights, one.track), one.measured.log_likelihoods)
    return np.asarray(np.log(rules.p.detection_probability) + mixed - density)
