"""Freshness, steadiness and errors of the fused picture (``age_of_information``,
``track_updates``, ``position_error``)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from components.geometry import angle_of_chord, chord_between, unit_vector_unchecked
from components.metrics.rows import (
    FUSED,
    TargetMetric,
    TargetParameters,
    alphabetical_name_ranks,
    is_of_target,
    nonnegative_result_definitions,
    select_rows,
)
from dsa_des.arrays.sorted_union import sorted_union_and_positions
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import FRACTION, Group, Result, blocks_recording
from dsa_des.time.clock import ClockSpec


class _Lines:
    """Rows sorted by replica, target and time; a target's consecutive rows form a gapped line."""

    def __init__(self, columns: Any, rows: BoolArray, *names: str) -> None:
        self.rows = select_rows(columns, rows, "target", "time_s", *names)
        target = alphabetical_name_ranks(self.rows["target"])
        self.order = _sorting_indices(self.rows["replica"], target, self.rows["time_s"])
        self.replica: IntArray = self.rows["replica"][self.order]
        self.time_s: FloatArray = self.rows["time_s"][self.order]
        target = target[self.order]
        same = (self.replica[1:] == self.replica[:-1]) & (target[1:] == target[:-1])
        #: Index of the row at which each gap ends.
        self.end: IntArray = np.flatnonzero(same) + 1
        self.gap_s = self.time_s[self.end] - self.time_s[self.end - 1]
        self.of_gap = self.replica[self.end]


def _sorting_indices(replica: IntArray, target: IntArray, time_s: FloatArray) -> Any:
    """Return indices that sort rows by replica, target and time; a full slice if sorted."""
    same = (replica[1:] == replica[:-1]) & (target[1:] == target[:-1])
    if bool((same & (time_s[1:] >= time_s[:-1]) | (replica[1:] > replica[:-1])).all()):
        return slice(None)
    return np.lexsort((time_s, target, replica))


def _sum_by_replica(replica: IntArray, values: FloatArray, count: int) -> FloatArray:
    return np.bincount(replica, weights=values, minlength=count).astype(float)


def _mean_by_replica(replica: IntArray, values: FloatArray, count: int) -> FloatArray:
    many = np.bincount(replica, minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(
            np.where(many > 0, _sum_by_replica(replica, values, count) / many, np.nan)
        )


def _quantile_by_replica(
    replica: IntArray, values: FloatArray, count: int, share: float
) -> FloatArray:
    """Return each replica's least value that at least `share` of its values do not exceed."""
    order = np.lexsort((values, replica))
    many = np.bincount(replica, minlength=count)
    start = np.cumsum(many) - many
    at = start + np.maximum(np.ceil(share * many).astype(np.int64) - 1, 0)
    result = np.full(count, np.nan)
    some = many > 0
    result[some] = values[order][at[some]]
    return result


class AgeOfInformation(TargetMetric):
    """Age of a target's newest measurement in the fusion, from the first to the last arrival.

    An age counts from when the measurement was made, so whatever kept it on its way is in it.
    Between two arrivals it grows with time; the mean and the 95th percentile are over time, from
    the first arrival to the last.
    """

    Parameters = TargetParameters
    tables = {FUSED: ("target", "measured_s", "time_s", "block")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.fusion = blocks_recording(scene, FUSED)[0]

    def results(self) -> list[Result]:
        """Return the definitions of two results: the mean and the 95th percentile of the age."""
        return nonnegative_result_definitions({
            "age_of_information_mean_s": "mean age of what the fusion holds, s",
            "age_of_information_p95_s": "age exceeded 5 % of the time, s",
        })  # fmt: skip

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return each replica's mean and 95th percentile of the age over time, s."""
        columns = group.tables[FUSED]
        known = "measured_s" if "measured_s" in columns else "time_s"
        lines = _Lines(columns, is_of_target(columns, self.p.target), known)
        # A sweeping beam measures after its scan has begun, which is when its report is sent.
        made_s = np.minimum(lines.rows[known][lines.order], lines.time_s)
        # What arrives now may be older than what is held: the newest counts.
        origin = _running_max(made_s, lines)
        low = lines.time_s[lines.end - 1] - origin[lines.end - 1]
        high = low + lines.gap_s
        count = len(group)
        area = _sum_by_replica(lines.of_gap, (low + high) / 2.0 * lines.gap_s, count)
        span = _sum_by_replica(lines.of_gap, lines.gap_s, count)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.where(span > 0, area / span, np.nan)
        return {
            "age_of_information_mean_s": mean,
            "age_of_information_p95_s": _ramp_quantile_by_replica(
                lines.of_gap, low, high, span, 0.95
            ),
        }

    def analytic_answers(self, scene: Scene) -> Mapping[str, float]:
        """Return the age's expected mean, 95th percentile (s): one sensor, only lost scans miss."""
        feed = feed_of_only_sensor(scene, self.fusion)
        if feed is None:
            return {}
        jitter_s = feed.clock.jitter_s
        mean = mean_age_s(feed.period_s, feed.through, jitter_s)
        values = {"age_of_information_mean_s": feed.delay_s + mean}
        if jitter_s == 0.0:
            p95 = age_quantile_s(feed.period_s, feed.through, 0.95)
            values["age_of_information_p95_s"] = feed.delay_s + p95
        return values


def _running_max(values: FloatArray, lines: _Lines) -> FloatArray:
    """Return the largest value so far on each line."""
    if bool((values[lines.end] >= values[lines.end - 1]).all()):
        return values
    starts = np.ones(len(values), dtype=bool)
    starts[lines.end] = False
    # Ranks are whole numbers: raising each line above the one before it rounds nothing.
    known, rank = np.unique(values, return_inverse=True)
    line = np.cumsum(starts)
    highest: IntArray = np.maximum.accumulate(rank + line * len(known)) - line * len(known)
    return known[highest]


def _ramp_quantile_by_replica(
    replica: IntArray, low: FloatArray, high: FloatArray, span: FloatArray, share: float
) -> FloatArray:
    """Return each replica's age not exceeded for `share` of the time, as ages rise with time."""
    result = np.full(len(span), np.nan)
    for number in np.flatnonzero(span > 0).tolist():
        start, end = np.searchsorted(replica, [number, number + 1])
        lows, highs = np.sort(low[start:end]), np.sort(high[start:end])
        # Time spent at or below age x is Σ min(x, high) - min(x, low): piecewise linear in x.
        ages, _ = sorted_union_and_positions([lows, highs])
        below = _clipped_sums(highs, ages) - _clipped_sums(lows, ages)
        result[number] = np.interp(share * span[number], below, ages)
    return result


def _clipped_sums(ascending: FloatArray, at: FloatArray) -> FloatArray:
    """Return Σ min(x, value) over ascending values, for every x."""
    total = np.concatenate(([0.0], np.cumsum(ascending)))
    index = np.searchsorted(ascending, at, side="right")
    return total[index] + (len(ascending) - index) * at


def _has_new_measurement(columns: Any, rows: BoolArray) -> BoolArray:
    """Return which rows have a new measurement since that replica and target's last row (mask)."""
    if "measured_s" not in columns:  # a recording that knows ages only, from arrivals
        return rows & np.asarray(columns["age_s"] <= 0.0)
    lines = _Lines(columns, rows, "measured_s", "updated_by")
    made_s = lines.rows["measured_s"][lines.order]
    sensors = lines.rows["updated_by"].codes[lines.order]
    new = np.ones(len(made_s), dtype=bool)
    end = lines.end
    new[end] = (made_s[end] != made_s[end - 1]) | (sensors[end] != sensors[end - 1])
    result = np.zeros(len(rows), dtype=bool)
    result[np.flatnonzero(rows)[lines.order]] = new
    return result


class TrackParameters(TargetParameters):
    """Parameters of track metrics."""

    break_after_s: float = Field(
        default=2.0, gt=0, description="Time without an update after which a track is broken, s."
    )


class TrackUpdates(TargetMetric):
    """How often tracks are updated, and how much of the time they are not broken.

    A track is broken from `break_after_s` after an update until the next one. An update is a row
    that holds another measurement than the target's row before.
    """

    Parameters = TrackParameters
    tables = {"tracks": ("target", "time_s", "age_s", "measured_s", "updated_by", "block")}

    def results(self) -> list[Result]:
        """Return four definitions: update interval (mean, 95th percentile), continuity, breaks."""
        said = "share of a track's time that it is not broken"
        interval, p95, breaks = nonnegative_result_definitions({
            "track_update_interval_s": "mean time between updates of a track, s",
            "track_update_interval_p95_s": "95th percentile of it, s",
            "track_breaks": "number of breaks",
        })  # fmt: skip
        return [interval, p95, Result("track_continuity", FRACTION, said), breaks]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return by replica mean, 95th percentile update interval (s), continuity share, breaks."""
        columns: Any = group.tables["tracks"]
        lines = _Lines(columns, _has_new_measurement(columns, is_of_target(columns, self.p.target)))
        count = len(group)
        broken = np.maximum(lines.gap_s - self.p.break_after_s, 0.0)
        span = _sum_by_replica(lines.of_gap, lines.gap_s, count)
        with np.errstate(invalid="ignore", divide="ignore"):
            continuity = np.where(
                span > 0, 1.0 - _sum_by_replica(lines.of_gap, broken, count) / span, np.nan
            )
        breaks = _sum_by_replica(lines.of_gap, (broken > 0.0).astype(float), count)
        has = np.bincount(lines.replica, minlength=count) > 0
        return {
            "track_update_interval_s": _mean_by_replica(lines.of_gap, lines.gap_s, count),
            "track_update_interval_p95_s": _quantile_by_replica(
                lines.of_gap, lines.gap_s, count, 0.95
            ),
            "track_continuity": continuity,
            "track_breaks": np.where(has, breaks, np.nan),
        }

    def analytic_answers(self, scene: Scene) -> Mapping[str, float]:
        """Return the mean interval for a single sensor that detects in every scan not lost."""
        fusion = blocks_recording(scene, FUSED)
        feed = feed_of_only_sensor(scene, fusion[0]) if len(fusion) == 1 else None
        onward = [wire for wire in scene.wires if wire.source in fusion]
        if feed is None or any(wire.jitter_s or wire.drop_probability for wire in onward):
            return {}
        return {"track_update_interval_s": mean_interval_s(feed.period_s, feed.through)}


class PositionError(TargetMetric):
    """How far fused positions lie from the true ones, root mean square over all of a run."""

    Parameters = TargetParameters
    tables = {
        FUSED: (
            "target", "azimuth_rad", "elevation_rad", "range_m",
            "true_azimuth_rad", "true_elevation_rad", "true_range_m",
        )
    }  # fmt: skip

    def results(self) -> list[Result]:
        """Return the error of positions (where there is a range) and of directions."""
        return nonnegative_result_definitions({
            "fused_position_error_m": "distance to the true position, rms, m",
            "fused_angle_error_deg": "angle to the true direction, rms, deg",
        })  # fmt: skip

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return each replica's root mean square errors of position and of direction."""
        columns: Any = group.tables[FUSED]
        rows = select_rows(columns, is_of_target(columns, self.p.target), *self.tables[FUSED][1:])
        seen = unit_vector_unchecked(rows["azimuth_rad"], rows["elevation_rad"])
        true = unit_vector_unchecked(rows["true_azimuth_rad"], rows["true_elevation_rad"])
        chord = chord_between(seen, true)
        angle = angle_of_chord(chord)
        replica, count = rows["replica"], len(group)
        ranged = np.flatnonzero(~np.isnan(rows["range_m"]))
        r, t = rows["range_m"][ranged], rows["true_range_m"][ranged]
        # Law of cosines, without cancellation where the two points are close.
        square = (r - t) ** 2 + r * t * chord[ranged] ** 2
        return {
            "fused_position_error_m": np.sqrt(_mean_by_replica(replica[ranged], square, count)),
            "fused_angle_error_deg": np.degrees(
                np.sqrt(_mean_by_replica(replica, angle**2, count))
            ),
        }


@dataclass(frozen=True)
class Feed:
    """A sensor's connection to a block: its clock, share of scans not lost, and total delay."""

    clock: ClockSpec
    through: float
    delay_s: float

    @property
    def period_s(self) -> float:
        """Time from scan to scan, at the rate at which the clock truly runs, s."""
        return float(self.clock.period_s / (1 + self.clock.rate_error_ppm / 1_000_000))


def feed_of_only_sensor(scene: Scene, block: str) -> Feed | None:
    """Return the `Feed` of a block's only directly connected sensor; None if there are several.

    None also where lateness is random or queues decide about it: no formula is known then.
    """
    sensors = {
        name
        for name in blocks_recording(scene, "detections")
        if getattr(scene.blocks[name].parameters, "enabled", True)
    }
    wires = [wire for wire in scene.wires if wire.target == block and wire.source in sensors]
    if len(wires) != 1 or wires[0].jitter_s or wires[0].queued or wires[0].delay_scans:
        return None
    name = wires[0].source
    clock = scene.blocks[name].cls.clock_of(scene.blocks[name].parameters)
    through = 1.0 - wires[0].drop_probability
    if clock is None or through <= 0:
        return None
    return Feed(clock, through, float(wires[0].total_delay_s))


def mean_interval_s(period_s: float, through: float) -> float:
    """Return the mean time between arriving scans, s, if each arrives with chance `through`."""
    return period_s / through


def mean_age_s(period_s: float, through: float, jitter_s: float = 0.0) -> float:
    """Return the mean age of the last scan that arrived, over time, s.

    Scans come through independently with probability q = `through`, so the number N of periods
    between two that do is geometric: E[N] = 1/q, E[N²] = (2 - q)/q². By the renewal-reward theorem
    the mean age is E[g²] / (2 E[g]) of the gaps g between them. Jitter of standard deviation s
    about the grid adds 2s² to E[g²].
    """
    square = period_s**2 * (2.0 - through) / through**2 + 2.0 * jitter_s**2
    return square * through / (2.0 * period_s)


def age_quantile_s(period_s: float, through: float, share: float) -> float:
    """Return the last scan's age not exceeded for `share` of the time, without jitter, s.

    The age lies beyond n periods for the share (1 - through)^n of the time, and is uniform
    between two multiples of the period.
    """
    left, lost = 1.0 - share, 1.0 - through
    whole = 0 if lost == 0.0 else math.floor(math.log(left) / math.log(lost))
    beyond = lost**whole
    return period_s * (whole + (beyond - left) / (beyond * through))
