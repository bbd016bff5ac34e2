"""The share of two sensors' detections that are fused with each other (``fused_share``)."""

import itertools
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from components.metrics.clock_coincidence import coincidence_share
from components.metrics.jittered_coincidence import mean_coincidence_share
from components.metrics.rows import (
    FUSED,
    SensorMetricParameters,
    TargetMetric,
    chosen,
    is_named,
    of_target,
    sensors_of,
    with_trials,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Text
from dsa_des.block.run_end import ends_its_run
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import SHARE, Group, Result, recorded_by
from dsa_des.time.clock import ClockSpec


class FusedShare(TargetMetric):
    """Share of one sensor's detections that were put together with one of another sensor.

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
        self.fusion = recorded_by(scene, FUSED)[0]
        fed = {wire.source for wire in scene.wires if wire.target == self.fusion}
        names = [name for name in sensors_of(scene, parameters.sensors) if name in fed]
        if len(names) < 2:
            raise ValueError(f"needs two sensors that feed {self.fusion}; there is {names}")
        self.pairs = list(itertools.permutations(names, 2))
        self.delay_s = {
            wire.source: float(wire.total_delay_s)
            for wire in scene.wires
            if wire.target == self.fusion
        }

    def results(self) -> list[Result]:
        """Return one share per ordered pair of sensors."""
        return [
            Result(_name(a, b), SHARE, f"detections of {a} that were fused with one of {b}")
            for a, b in self.pairs
        ]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Count detections and those that were fused, in every replica."""
        detections: Any = group.tables["detections"]
        fused: Any = group.tables[FUSED]
        rows = of_target(fused, self.p.target) & is_named(fused["block"], self.fusion)
        fused = chosen(fused, rows, "target", "sensors", "time_s")
        found: dict[str, FloatArray] = {}
        for a, b in self.pairs:
            seen = is_named(detections["block"], a) & of_target(detections, self.p.target)
            own = chosen(detections, seen, "target", "time_s")
            both = _holds(fused["sensors"], a) & _holds(fused["sensors"], b)
            pair = chosen(fused, both, "target", "time_s")
            used = _latest(own, pair, self.delay_s[a])
            trials = np.bincount(own["replica"], minlength=len(group))
            successes = np.bincount(own["replica"][used], minlength=len(group))
            found |= with_trials(_name(a, b), successes, trials)
        return found

    def expected(self, scene: Scene) -> Mapping[str, float]:
        """Return the share of two periodic clocks, if every scan detects.

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
        found = {}
        for a, b in self.pairs:
            share = _expected_share(scene, gate, (clocks[a], arrives[a]), (clocks[b], arrives[b]))
            if share is not None:
                found[_name(a, b)] = share
        return found


def _expected_share(
    scene: Scene,
    gate: Fraction,
    one: tuple[ClockSpec, Fraction],
    other: tuple[ClockSpec, Fraction],
) -> float | None:
    """Return the share of one clock's scans that meet the other's; each with its delay (s)."""
    (own, delay_s), (theirs, other_delay_s) = one, other
    if any(clock.jitter_s or clock.rate_error_ppm for clock in (own, theirs)):
        # How long a run is that a block may end is not known before it.
        if scene.duration_s is None or any(ends_its_run(b.cls) for b in scene.blocks.values()):
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


def _name(a: str, b: str) -> str:
    return f"fused_share.{a}_with_{b}"


def _holds(column: Any, name: str) -> BoolArray:
    """Return which rows of a column such as ``radar+eo`` name a sensor."""
    assert isinstance(column, Text)
    holds = np.array([name in known.split("+") for known in column.names] + [False], dtype=bool)
    return holds[column.codes]


def _latest(own: dict[str, Any], fused: dict[str, Any], delay_s: float) -> IntArray:
    """Return the distinct detections that fused rows rest on: the latest arrived of the target."""
    names = {name: k for k, name in enumerate(own["target"].names)}
    lookup = np.array([names.get(name, -1) for name in fused["target"].names] + [-1])
    target = lookup[fused["target"].codes]
    start = len(own["replica"])
    # A nanosecond of grace: seconds as float are rounded, ticks are not.
    time_s = np.concatenate([own["time_s"] + delay_s, fused["time_s"] + 1e-9])
    replica = np.concatenate([own["replica"], fused["replica"]])
    order = np.lexsort((time_s, np.concatenate([own["target"].codes, target]), replica))
    place = np.where(order < start, np.arange(len(order)), -1)
    last = np.maximum.accumulate(place) if len(place) else place
    asked = order >= start
    found = order[last[asked][last[asked] >= 0]]
    return np.unique(found)
