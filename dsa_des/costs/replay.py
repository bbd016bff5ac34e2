"""One rung's run: what its block was given, what the run recorded, and what the block's work costs.

A block is timed by running it again, fresh, on the wakes it had in its own run: nothing but the
block is on the clock, and its inputs are those of the run.
"""

import copy
import gc
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from dsa_des.block.component import Component
from dsa_des.block.wake import Wake
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

# Slow rungs are timed fewer times: all passes of one rung together take about this long at most.
_LONGEST_S = 2.0
_FEWEST = 3

# A repeat is the best of so many passes: what interrupts a pass is not the block's.
_PASSES = 10


@dataclass
class RungRun:
    """A run of the scene with one rung in place.

    Parameters
    ----------
    scene : Scene
    block : str
    wakes : list of Wake
        What the block was given.
    tables : dict
        Recorded tables, as ``pyarrow.Table``.
    run_cpu_s : float
        Processor time of the whole simulation.
    block_cpu_s : float
        Of which the block took this much.
    """

    scene: Scene
    block: str
    wakes: list[Wake]
    tables: dict[str, Any]
    run_cpu_s: float
    block_cpu_s: float
    passes_s: list[float] = field(default_factory=list)
    _pristine: Component | None = None

    def fresh(self) -> Component:
        """Return the block set up anew, as before its first wake."""
        return Simulation(self.scene).components[self.block]

    def pass_s(self) -> float:
        """Run a fresh block over all wakes and return the processor time."""
        if self._pristine is None:
            self._pristine = self.fresh()
        try:  # a copy is made ten times faster than a scene is set up
            run = copy.deepcopy(self._pristine).run
        except Exception:  # whatever a stranger's block holds that cannot be copied
            run = self.fresh().run
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

    def passes(self, wanted: int) -> int:
        """Return how many passes are run when `wanted` are asked for: fewer of a slow block."""
        affordable = int(_LONGEST_S / max(self.block_cpu_s, 1e-9))
        return min(wanted, max(_FEWEST, affordable))

    @property
    def repeats_s(self) -> list[float]:
        """Processor time of each repeat: the best of its passes; of a slow block, each pass."""
        if len(self.passes_s) < 2 * _PASSES:
            return self.passes_s
        return [
            min(self.passes_s[start : start + _PASSES])
            for start in range(0, len(self.passes_s) - _PASSES + 1, _PASSES)
        ]

    def target_scans(self) -> int:
        """Return how many (instant, target) pairs the block was asked about."""
        return sum(len(wake) for wake in self.wakes)


def run_rung(scene: Scene, block: str) -> RungRun:
    """Run a scene, recording what it records and the wakes of one block.

    Raises
    ------
    BlockFailure
        If a block failed.
    SceneError
        If a block cannot be set up.
    """
    sink = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    component = simulation.components[block]
    wakes: list[Wake] = []
    spent = 0
    own: Callable[[Wake], Any] = component.run

    def watched(wake: Wake) -> Any:
        nonlocal spent
        # In a feedback loop the engine may take a window back and run it again from some instant.
        while wakes and wakes[-1].ticks[0] >= wake.ticks[0]:
            wakes.pop()
        wakes.append(wake)
        started = time.process_time_ns()
        result = own(wake)
        spent += time.process_time_ns() - started
        return result

    # On this one instance: the engine calls `component.run`, and must know nothing of us.
    component.run = watched  # type: ignore[method-assign]
    outcome = simulation.run()
    return RungRun(scene, block, wakes, sink.tables(), outcome.cpu_s, spent * 1e-9)


def time_interleaved(runs: Sequence[RungRun], repeats: int) -> None:
    """Time all rungs in turn, again and again, so that a noisy machine hurts all of them alike.

    Every round starts with another rung. Their runs went before: libraries were imported and tables
    that are built once were built then. A rung so slow that its run took long is not run again:
    that run counts.
    """
    for run in runs:
        if run.block_cpu_s > _LONGEST_S:
            run.passes_s.append(run.block_cpu_s)
    fast = [run for run in runs if run.block_cpu_s <= _LONGEST_S]
    for round_ in range(repeats * _PASSES):
        for place in range(len(fast)):
            run = fast[(place + round_) % len(fast)]
            if len(run.passes_s) < run.passes(repeats * _PASSES):
                run.passes_s.append(run.pass_s())


def median_and_spread(repeats_s: Sequence[float]) -> tuple[float, float]:
    """Return the median and half the distance between the quartiles."""
    if len(repeats_s) < 2:
        return repeats_s[0], 0.0
    low, middle, high = statistics.quantiles(repeats_s, n=4, method="inclusive")
    return middle, 0.5 * (high - low)
