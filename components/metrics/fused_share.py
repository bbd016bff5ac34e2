"""The share of two sensors' detections that are fused with each other (``fused_share``).

What is expected of two periodic clocks is exact: the scans of one fall on finitely many phases of
the other's period, q equally spaced ones, where f1/f2 = p/q in lowest terms. Of clocks that jitter
or run at slightly wrong rates the grid instants are exact ticks; jitter is normal and independent
from scan to scan, so the difference of two instants is normal about the grid's difference.
"""

import itertools
import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.special import ndtr

from components.metrics.rows import (
    FUSED,
    SensorMetricParameters,
    TargetMetric,
    is_named,
    is_of_target,
    select_rows,
    sensors_to_measure,
    share_and_trials_columns,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import may_end_its_run
from dsa_des.block.message import Text
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import SHARE, Group, Result, blocks_recording
from dsa_des.time.clock import ClockSpec, ScanClock

#: Beyond so many standard deviations nothing is expected to happen.
_SIGMAS = 6.0


class FusedShare(TargetMetric):
    """Share of one sensor's detections that were fused with one of another sensor.

    ``fused_share.ir_with_radar`` counts the detections of ir: those that occur, at their own
    instant or while they are held, in a fused line of sight to which radar contributed.
    """

    Parameters = SensorMetricParameters
    tables = {
        "detections": ("block", "target", "time_s"),
        FUSED: ("target", "sensors", "time_s", "block"),
    }

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.fusion = blocks_recording(scene, FUSED)[0]
        fed = {wire.source for wire in scene.wires if wire.target == self.fusion}
        names = [name for name in sensors_to_measure(scene, parameters.sensors) if name in fed]
        if len(names) < 2:
            raise ValueError(f"needs two sensors that feed {self.fusion}; there is {names}")
        self.pairs = list(itertools.permutations(names, 2))
        self.delay_s = {
            wire.source: float(wire.total_delay_s)
            for wire in scene.wires
            if wire.target == self.fusion
        }

    def results(self) -> list[Result]:
        """Return the definition of one share for each ordered pair of sensors."""
        return [
            Result(_share_name(a, b), SHARE, f"detections of {a} that were fused with one of {b}")
            for a, b in self.pairs
        ]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return by ordered sensor pair each replica's fused share and number of detections."""
        detections: Any = group.tables["detections"]
        fused: Any = group.tables[FUSED]
        rows = is_of_target(fused, self.p.target) & is_named(fused["block"], self.fusion)
        fused = select_rows(fused, rows, "target", "sensors", "time_s")
        values: dict[str, FloatArray] = {}
        for a, b in self.pairs:
            seen = is_named(detections["block"], a) & is_of_target(detections, self.p.target)
            own = select_rows(detections, seen, "target", "time_s")
            both = _contains_sensor_name(fused["sensors"], a) & _contains_sensor_name(
                fused["sensors"], b
            )
            pair = select_rows(fused, both, "target", "time_s")
            used = _fused_detection_indices(own, pair, self.delay_s[a])
            trials = np.bincount(own["replica"], minlength=len(group))
            successes = np.bincount(own["replica"][used], minlength=len(group))
            values |= share_and_trials_columns(_share_name(a, b), successes, trials)
        return values

    def analytic_answers(self, scene: Scene) -> Mapping[str, float]:
        """Return ordered sensor pairs' expected fused share by name, if every scan detects.

        Exact clocks are counted in rational numbers, in the long run; of clocks that jitter or
        drift it is the expected share of this run, and there is none where a block may end the run
        before its time.
        """
        fusion = scene.blocks[self.fusion].parameters
        gate = getattr(fusion, "coincidence_s", getattr(fusion, "time_gate_s", None))
        faulty = any(w.jitter_s or w.drop_probability or w.queued for w in scene.wires)
        if gate is None or faulty:
            return {}
        arrives = {w.source: w.total_delay_s for w in scene.wires if w.target == self.fusion}
        clocks = {}
        for name in {name for pair in self.pairs for name in pair}:
            clock = scene.blocks[name].cls.clock_of(scene.blocks[name].parameters)
            if clock is None:
                return {}
            clocks[name] = clock
        values = {}
        for a, b in self.pairs:
            share = _expected_share(scene, gate, (clocks[a], arrives[a]), (clocks[b], arrives[b]))
            if share is not None:
                values[_share_name(a, b)] = share
        return values


def _expected_share(
    scene: Scene,
    gate: Fraction,
    one: tuple[ClockSpec, Fraction],
    other: tuple[ClockSpec, Fraction],
) -> float | None:
    """Return a clock's expected share of scans that coincide; None if the run length is unknown."""
    (own, delay_s), (theirs, other_delay_s) = one, other
    if any(clock.jitter_s or clock.rate_error_ppm for clock in (own, theirs)):
        # How long a run is that a block may end is not known before it.
        if scene.duration_s is None or any(may_end_its_run(b.cls) for b in scene.blocks.values()):
            return None
        return mean_coincidence_share(
            own,
            theirs,
            ticks_per_s=scene.ticks_per_s,
            end_tick=int(scene.duration_s * scene.ticks_per_s),
            gate_ticks=int(gate * scene.ticks_per_s),
            delay_ticks=int(delay_s * scene.ticks_per_s),
            other_delay_ticks=int(other_delay_s * scene.ticks_per_s),
        )
    # A detection waits for a partner as long as the gate, and no longer than to the sensor's next
    # scan: just short of it is half of the smallest step in which phases can differ.
    step = Fraction(1, 2 * scene.ticks_per_s)
    share = coincidence_share(
        own.rate_hz,
        theirs.rate_hz,
        offset_s=own.offset_s + delay_s,
        other_offset_s=theirs.offset_s + other_delay_s,
        before_s=gate,
        after_s=min(gate, own.period_s - step),
    )
    return float(share)


def _share_name(a: str, b: str) -> str:
    return f"fused_share.{a}_with_{b}"


def _contains_sensor_name(column: Any, name: str) -> BoolArray:
    """Return which rows of a column such as ``radar+eo`` contain a sensor's name (mask)."""
    assert isinstance(column, Text)
    holds = np.array([name in known.split("+") for known in column.names] + [False], dtype=bool)
    return holds[column.codes]


def _fused_detection_indices(
    own: dict[str, Any], fused: dict[str, Any], delay_s: float
) -> IntArray:
    """Return the indices of detections that fused rows use: the latest arrived of each target."""
    names = {name: k for k, name in enumerate(own["target"].names)}
    lookup = np.array([names.get(name, -1) for name in fused["target"].names] + [-1])
    target = lookup[fused["target"].codes]
    start = len(own["replica"])
    # A nanosecond of grace: seconds as float are rounded, ticks are not.
    time_s = np.concatenate([own["time_s"] + delay_s, fused["time_s"] + 1e-9])
    replica = np.concatenate([own["replica"], fused["replica"]])
    order = np.lexsort((time_s, np.concatenate([own["target"].codes, target]), replica))
    index = np.where(order < start, np.arange(len(order)), -1)
    last = np.maximum.accumulate(index) if len(index) else index
    asked = order >= start
    result = order[last[asked][last[asked] >= 0]]
    return np.unique(result)


def coincidence_share(
    rate_hz: Fraction,
    other_rate_hz: Fraction,
    *,
    offset_s: Fraction = Fraction(0),
    other_offset_s: Fraction = Fraction(0),
    before_s: Fraction = Fraction(0),
    after_s: Fraction = Fraction(0),
) -> Fraction:
    """Return the long-run share of scans, at t, with others between t - before_s and t + after_s.

    That is one at t - before_s ≤ t' ≤ t + after_s, both bounds inclusive and 0 or more.
    """
    period = 1 / other_rate_hz
    phases = (other_rate_hz / rate_hz).denominator
    spacing = period / phases
    phase = (offset_s - other_offset_s) % spacing
    if before_s + after_s >= period:
        return Fraction(1)
    # Phases are phase + j·spacing for j = 0 ... phases - 1; an earlier partner is that far away.
    early = _count_within(before_s, phase, spacing, phases)
    late = _count_within(after_s, (-phase) % spacing, spacing, phases)
    both = 1 if phase == 0 else 0  # the same instant is early and late
    return Fraction(min(phases, early + late - both), phases)


def _count_within(reach: Fraction, first: Fraction, spacing: Fraction, most: int) -> int:
    """Return how many of first, first + spacing, ... lie within reach, at most `most`."""
    if reach < first:
        return 0
    return min(most, math.floor((reach - first) / spacing) + 1)


def mean_coincidence_share(
    own: ClockSpec,
    other: ClockSpec,
    *,
    ticks_per_s: int,
    end_tick: int,
    gate_ticks: int,
    delay_ticks: int = 0,
    other_delay_ticks: int = 0,
) -> float | None:
    """Return the expected share of a clock's scans that arrive within a gate of the other's.

    Scans and arrivals before `end_tick` count: drift makes the share depend on how long a run is.
    None where two scans of one clock may lie in one gate: the probabilities of single pairs do not
    add up then.
    """
    for clock in (own, other):
        if 2 * gate_ticks + _SIGMAS * clock.jitter_s * ticks_per_s >= clock.period_s * ticks_per_s:
            return None
    sigma = math.hypot(own.jitter_s, other.jitter_s) * ticks_per_s
    mine = _scan_ticks(own, ticks_per_s, end_tick) + delay_ticks
    theirs = _scan_ticks(other, ticks_per_s, end_tick) + other_delay_ticks
    theirs = theirs[theirs < end_tick]
    if not len(mine) or not len(theirs):
        return None
    after = np.searchsorted(theirs, mine)
    share = np.zeros(len(mine))
    period_ticks = float(other.period_s * ticks_per_s)
    reach = 1 + math.ceil((gate_ticks + _SIGMAS * sigma) / period_ticks)
    for step in range(-reach, reach):
        index = after + step
        there = np.flatnonzero((index >= 0) & (index < len(theirs)))
        share[there] += _probability_in_gate(theirs[index[there]] - mine[there], gate_ticks, sigma)
    return float(np.mean(np.minimum(share, 1.0)))


def _scan_ticks(spec: ClockSpec, ticks_per_s: int, end_tick: int) -> IntArray:
    return ScanClock(spec, ticks_per_s).scans_between(0, end_tick)[1]


def _probability_in_gate(apart: IntArray, gate: int, sigma: float) -> FloatArray:
    """Return the probability that a distance with normal error lies within the gate."""
    if sigma == 0.0:
        return np.asarray(np.abs(apart) <= gate, dtype=float)
    return np.asarray(ndtr((gate - apart) / sigma) - ndtr((-gate - apart) / sigma))
