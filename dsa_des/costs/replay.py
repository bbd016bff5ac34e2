"""One rung's run: what its block was given, what its work costs, and how far off it is.

A block is timed by running it again, fresh, on the wakes it had in its own run: nothing but the
block is on the clock, and its inputs are those of the run. Errors are target-scan by target-scan.
"""

import copy
import gc
import math
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Truth, Unavailable
from dsa_des.block.wake import Wake
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

# Slow rungs are timed fewer times: all passes of one rung together take about this long at most.
_LONGEST_S = 1.0
_FEWEST = 3
# A repeat is the best of so many passes: what interrupts a pass is not the block's.
_PASSES = 10


@dataclass
class RungRun:
    """A run of the scene with one rung: recorded tables, the block's wakes, processor time."""

    scene: Scene
    block: str
    #: What the block was given.
    wakes: list[Wake]
    #: Recorded tables, as ``pyarrow.Table``.
    tables: dict[str, Any]
    #: Processor time of the whole simulation.
    run_cpu_s: float
    #: Of which the block took this much.
    block_cpu_s: float
    passes_s: list[float] = field(default_factory=list)
    _pristine: Component | None = None

    def fresh_block(self) -> Component:
        """Return a newly set-up instance of the block, as before its first wake."""
        return Simulation(self.scene).components[self.block]

    def time_one_pass_s(self) -> float:
        """Run a fresh block over all its recorded wakes and return the processor time, s."""
        if self._pristine is None:
            self._pristine = self.fresh_block()
        try:  # a copy is made ten times faster than a scene is set up
            run = copy.deepcopy(self._pristine).run
        except Exception:  # a foreign block may hold what cannot be copied
            run = self.fresh_block().run
        wakes = self.wakes
        collecting = gc.isenabled()
        gc.disable()
        try:
            started = time.process_time_ns()
            for wake in wakes:
                run(wake)
            return (time.process_time_ns() - started) * 1e-9
        finally:
            if collecting:
                gc.enable()

    def affordable_passes(self, wanted: int) -> int:
        """Return how many passes to run: `wanted`, or fewer for a slow block."""
        affordable = int(_LONGEST_S / max(self.block_cpu_s, 1e-9))
        return min(wanted, max(_FEWEST, affordable))

    def expected_timing_s(self, repeats: int) -> float:
        """Return how long timing such a rung will take, s; 0 for a very slow block."""
        if self.block_cpu_s > _LONGEST_S:
            return 0.0
        return self.block_cpu_s * self.affordable_passes(repeats * _PASSES)

    @property
    def repeats_s(self) -> list[float]:
        """Processor time of each repeat, s: the shortest of its passes; of few passes every one."""
        if len(self.passes_s) < 2 * _PASSES:
            return self.passes_s
        return [
            min(self.passes_s[start : start + _PASSES])
            for start in range(0, len(self.passes_s) - _PASSES + 1, _PASSES)
        ]

    def instant_count(self) -> int:
        """Return the number of instants at which the block was run, over all its wakes."""
        return sum(len(wake) for wake in self.wakes)


def run_rung(scene: Scene, block: str) -> RungRun:
    """Run a scene and return that run with its recorded tables and the wakes of one block."""
    return run_with_recorded_wakes(scene, [block])[block]


def run_with_recorded_wakes(scene: Scene, blocks: Iterable[str]) -> dict[str, RungRun]:
    """Run a scene once; return by block that run with recorded tables and the block's wakes."""
    sink = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    watches = {name: _WatchedBlock(simulation.components[name]) for name in blocks}
    outcome = simulation.run()
    tables = sink.tables()
    return {
        name: RungRun(scene, name, watch.wakes, tables, outcome.cpu_s, watch.spent_ns * 1e-9)
        for name, watch in watches.items()
    }


class _WatchedBlock:
    """Keeps every wake that a block is run with, and adds up the time that the block takes."""

    def __init__(self, component: Component) -> None:
        self.wakes: list[Wake] = []
        self.spent_ns = 0
        self._run: Callable[[Wake], Any] = component.run
        # On this one instance: the engine calls `component.run`, and must know nothing of us.
        component.run = self.run  # type: ignore[method-assign]

    def run(self, wake: Wake) -> Any:
        """Run the block."""
        # In a feedback loop the engine may take a window back and run it again from some instant.
        while self.wakes and self.wakes[-1].ticks[0] >= wake.ticks[0]:
            self.wakes.pop()
        self.wakes.append(wake)
        started = time.process_time_ns()
        result = self._run(wake)
        self.spent_ns += time.process_time_ns() - started
        return result


def time_rungs_in_turn(runs: Sequence[RungRun], repeats: int) -> None:
    """Time all rungs in turn, again and again, so that a noisy machine hurts all of them alike.

    With no `repeats` nothing is timed. Every round starts with another rung. Their runs went
    before: libraries were imported and tables that are built once were built then. A rung so slow
    that its run took long is not run again: that run counts.
    """
    for run in runs if repeats else ():
        if run.block_cpu_s > _LONGEST_S:
            run.passes_s.append(run.block_cpu_s)
    fast = [run for run in runs if run.block_cpu_s <= _LONGEST_S]
    for round_ in range(repeats * _PASSES):
        for index in range(len(fast)):
            run = fast[(index + round_) % len(fast)]
            if len(run.passes_s) < run.affordable_passes(repeats * _PASSES):
                run.passes_s.append(run.time_one_pass_s())


def median_and_half_iqr(repeats_s: Sequence[float]) -> tuple[float, float]:
    """Return the median and half the distance between the quartiles; NaN of nothing."""
    if not repeats_s:
        return math.nan, math.nan
    if len(repeats_s) < 2:
        return repeats_s[0], 0.0
    low, middle, high = statistics.quantiles(repeats_s, n=4, method="inclusive")
    return middle, 0.5 * (high - low)


#: Target-scans at which a rung is compared with a far more precise evaluation.
SAMPLE = 100


@dataclass(frozen=True)
class Spread:
    """Mean, 95th percentile and maximum of an error, and over how many target-scans."""

    #: NaN when there was nothing to compare.
    mean: float
    p95: float
    maximum: float
    count: int

    @classmethod
    def from_errors(cls, errors: FloatArray) -> "Spread":
        """Return the mean, 95th percentile, maximum and number of the errors, leaving NaN out."""
        known = errors[~np.isnan(errors)]
        if known.size == 0:
            return cls(float("nan"), float("nan"), float("nan"), 0)
        p95 = float(np.percentile(known, 95.0))
        return cls(float(known.mean()), p95, float(known.max()), int(known.size))


#: Ticks of a rung's rows, and its values by quantity.
Values = tuple[IntArray, dict[str, AnyArray]]


def replay_values(ladder: Ladder, run: RungRun, reference: RungRun) -> Values:
    """Return the ticks of all recorded wakes, and the ladder's values of a fresh block there."""
    block, other = run.fresh_block(), reference.fresh_block()
    parts = [(wake.ticks, ladder.measure(block, wake, other)) for wake in run.wakes]
    ticks = np.concatenate([ticks for ticks, _ in parts])
    names = [q.name for q in ladder.quantities]
    return ticks, {name: np.concatenate([values[name] for _, values in parts]) for name in names}


def error_spread_by_quantity(ladder: Ladder, rung: Values, reference: Values) -> dict[str, Spread]:
    """Return each quantity's error at shared ticks: mean, 95th percentile, maximum and number."""
    ticks, values = rung
    other_ticks, others = reference
    _, here, there = np.intersect1d(ticks, other_ticks, return_indices=True)
    spreads = {}
    for quantity in ladder.quantities:
        apart = quantity.difference(values[quantity.name][here], others[quantity.name][there])
        spreads[quantity.name] = Spread.from_errors(apart)
    return spreads


def errors_against_precise(
    ladder: Ladder, run: RungRun, values: Values
) -> tuple[dict[str, Spread], str]:
    """Return a rung's errors against a far more precise evaluation, and a note; or none and why."""
    if ladder.truth is None:
        return {}, "nothing more exact is known"
    try:
        parts = _evaluate_sample(ladder.truth, run, _sample_known_pairs(ladder, values), values[0])
    except ImportError as error:
        return {}, f"not measured: {error}"
    except Unavailable as error:
        return {}, str(error)
    spreads = {
        name: Spread.from_errors(np.concatenate([part[name] for part in parts]))
        for name in parts[0]
    }
    count = max(spread.count for spread in spreads.values())
    return spreads, f"measured at {count} target-scans"


def _sample_known_pairs(ladder: Ladder, values: Values) -> IntArray:
    """Return up to `SAMPLE` (row, target) pairs (n, 2), evenly, where the first value is known."""
    first = values[1][ladder.quantities[0].name]
    unknown = np.isnan(first)
    pairs = np.unique(np.argwhere(~unknown)[:, :2], axis=0)
    if len(pairs) > SAMPLE:
        pairs = pairs[np.linspace(0, len(pairs) - 1, SAMPLE).astype(np.int64)]
    return pairs


def _evaluate_sample(
    truth: Truth, run: RungRun, pairs: IntArray, ticks: IntArray
) -> Sequence[Mapping[str, FloatArray]]:
    if len(pairs) == 0:
        raise Unavailable("no target-scan to measure at")
    block = run.fresh_block()
    parts = []
    start = 0
    for wake in run.wakes:
        inside = (pairs[:, 0] >= start) & (pairs[:, 0] < start + len(wake))
        if inside.any():
            parts.append(truth(block, wake, pairs[inside] - np.array([start, 0])))
        start += len(wake)
    return parts
