"""How often two sensors' detections are fused with each other (``fused_share``)."""

import itertools
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from components.clock_coincidence import coincidence_share
from components.metrics.rows import (
    FUSED,
    SensorParameters,
    chosen,
    is_named,
    of_target,
    sensors_of,
    with_trials,
)
from dsa_des.message import Text
from dsa_des.scene import Scene
from dsa_des.studies.metric import SHARE, Group, Metric, Result, recorded_by
from dsa_des.types import BoolArray, FloatArray, IntArray


class FusedShare(Metric):
    """Share of one sensor's detections that were put together with one of another sensor.

    ``fused_share.ir_with_radar`` counts the detections of ir: those that occur, at their own
    instant or while they are held, in a fused line of sight to which radar contributed.
    """

    Parameters = SensorParameters
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
        """Return the exact share of two periodic clocks, if every scan detects.

        A detection waits for a partner as long as the fusion's ``coincidence_s``, and no longer
        than to the sensor's next scan.
        """
        gate = getattr(scene.blocks[self.fusion].parameters, "coincidence_s", None)
        if gate is None or any(w.jitter_s or w.drop_probability for w in scene.wires):
            return {}
        arrives = {w.source: w.total_delay_s for w in scene.wires if w.target == self.fusion}
        clocks = {}
        for name in {name for pair in self.pairs for name in pair}:
            clock = scene.blocks[name].cls.clock_of(scene.blocks[name].parameters)
            if clock is None or clock.jitter_s or clock.rate_error_ppm:
                return {}
            clocks[name] = clock
        found = {}
        for a, b in self.pairs:
            one, other = clocks[a], clocks[b]
            # Just short of the next scan: half of the smallest step in which phases can differ.
            step = Fraction(1, 2 * scene.ticks_per_s)
            share = coincidence_share(
                one.rate_hz,
                other.rate_hz,
                offset_s=one.offset_s + arrives[a],
                other_offset_s=other.offset_s + arrives[b],
                before_s=gate,
                after_s=min(gate, one.period_s - step),
            )
            found[_name(a, b)] = float(share)
        return found


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
