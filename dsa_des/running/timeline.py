"""Which runs a simulation holds: one here, many in `dsa_des.replicas`.

A simulation asks its timeline for all in which several runs of a scene differ from one. So what
builds blocks, wires them and runs them knows no replicas.
"""

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.record.failure_counts import FailuresByRun, counts_by_run
from dsa_des.running.channel import Channel
from dsa_des.running.effects import WireFaults, has_simulated_loss_or_jitter
from dsa_des.running.grain import Grain, choose_grain
from dsa_des.running.windows import Rewinder, RewindingWindows, Windows
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.stretches.outages import Outages
from dsa_des.stretches.stretched_block import StretchedBlock
from dsa_des.time.clock import ClockSpec
from dsa_des.time.randomness import Streams
from dsa_des.time.run_clock import RunClock
from dsa_des.time.timeline_runs import Runs


def _zero_jitter_draw(number: int) -> Callable[[IntArray], FloatArray]:
    return lambda scans: np.zeros(len(scans))


class Timeline:
    """A run's clocks, channels, outages, windows; with `everything`, jitter is drawn even if 0."""

    count = 1
    says_replica = False

    runs: Runs

    def __init__(self, scene: Scene, *, everything: bool = False) -> None:
        self.scene = scene
        self._everything = everything
        self.seeds: Sequence[int] = (scene.seed,)
        self.streams = Streams(self.seeds)

    def parameters(self, name: str) -> Any:
        """Return the parameters with which a block is built."""
        return self.scene.blocks[name].parameters

    def set_length(self, components: Mapping[str, Component], duration_s: Fraction) -> None:
        """Set the number and the length of the runs, once the blocks are set up."""
        ticks = duration_s * self.scene.ticks_per_s
        self.runs = Runs(self.count, -(-ticks.numerator // ticks.denominator))

    def clock(self, name: str, component: Component) -> RunClock | None:
        """Return a block's scan clock, or None where it has none of its own."""
        specs = self.clock_specs(name, component)
        if not specs:
            return None

        def jitter(number: int) -> Callable[[IntArray], FloatArray]:
            return Streams(self.seeds[number]).scan_normal_function(name, "clock jitter")

        return RunClock(
            specs, self.scene.ticks_per_s, self.runs, jitter,
            always_draws=self._everything, changes=self._clock_changes(name, component, specs),
        )  # fmt: skip

    def _clock_changes(
        self, name: str, component: Component, specs: list[ClockSpec]
    ) -> list[tuple[int, list[ClockSpec]]]:
        """Return (tick, clock of each run) per stretch at whose start a block's clock changes."""
        changes: list[tuple[int, list[ClockSpec]]] = []
        if not self.scene.stretches:
            return changes
        for number, tick in enumerate(self.stretch_start_ticks.tolist()[1:]):
            if (later := self.clock_specs(name, component, number)) != specs:
                changes.append((tick, later))
                specs = later
        return changes

    def periodic_wake_clock(self, component: Component) -> RunClock | None:
        """Return the clock that wakes a block regularly even without arrivals; None if none."""
        every_s = component.acts_every_s()
        if every_s is None:
            return None
        specs = [ClockSpec(1 / every_s, every_s)] * self.runs.count
        return RunClock(specs, self.scene.ticks_per_s, self.runs, _zero_jitter_draw)

    def clock_specs(
        self, name: str, component: Component, stretch: int | None = None
    ) -> list[ClockSpec]:
        """Return each run's specification of a block's scan clock; empty if it has none.

        That is at the start, or in a stretch.
        """
        parameters = component.p
        if stretch is not None:
            parameters = self.scene.stretches[stretch].scene.blocks[name].parameters
        spec = component.clock_of(parameters)
        return [] if spec is None else [spec]

    def channel_of_wire(self, wires: Sequence[Wire], scan_delay_ticks: int) -> Channel:
        """Return the channel of a wire, with its delay and its random loss and lateness.

        `wires` are what the scene says of it in each stretch.
        """
        per_s, wire = self.scene.ticks_per_s, wires[0]
        delays = np.array([round(one.total_delay_s * per_s) for one in wires], dtype=np.int64)
        least = int(delays.min())
        faults = None
        if (
            any(has_simulated_loss_or_jitter(one, self._everything) for one in wires)
            or (delays > least).any()
        ):
            late, lost = (self.streams.stream(str(wire), f"wire {of}") for of in ("jitter", "loss"))
            jitter_ticks = np.array([float(one.jitter_s * per_s) for one in wires])
            losses = np.array([one.drop_probability for one in wires])
            faults = WireFaults(
                self.stretch_start_ticks, delays - least, jitter_ticks, losses, late, lost, per_s
            )
        return Channel(wire.source, least + scan_delay_ticks, faults, self.runs)

    @property
    def stretch_start_ticks(self) -> IntArray:
        """The first tick of each stretch of the scene."""
        instants_s = [Fraction(0), *(stretch.from_s for stretch in self.scene.stretches)]
        return np.array([t * self.scene.ticks_per_s for t in instants_s], dtype=np.int64)

    def outages(self, name: str) -> Outages | None:
        """Return the random outages of a block in each run; None if it can have none."""
        failing = [one for one in self.scene.outages if name in one.blocks]
        if not failing:
            return None
        return Outages(failing, self.streams, self.runs, self.scene.ticks_per_s)

    def block_switching_by_stretch(self, instances: Sequence[Component]) -> StretchedBlock | None:
        """Return what hands wakes to the instance of their stretch; None if one serves all."""
        if all(one is instances[0] for one in instances):
            return None
        return StretchedBlock(self.stretch_start_ticks, instances)

    def grain(self, window: int | None) -> Grain:
        """Return which blocks run in windows or scan by scan; parameter as for `Simulation`."""
        return choose_grain(self.scene, window)

    def runner(self, component: Component) -> Any:
        """Return what handles a block's wakes: its component, or an object in its place."""
        return component

    def windows(
        self,
        longest_ticks: int,
        scans: float,
        horizon_ticks: int | None,
        rewinder: Rewinder | None,
    ) -> Windows:
        """Return the windows in which all runs are simulated, one after another.

        Each run has about so many `scans` of all clocks together. With `horizon_ticks`, feedback
        loops run in windows: before so long, nothing that is sent comes back; with a `rewinder`
        they may be undone.
        """
        if rewinder is not None and horizon_ticks is not None:
            return RewindingWindows(self.runs, longest_ticks, horizon_ticks, rewinder)
        return Windows(self.runs, longest_ticks, horizon_ticks)

    def finish(self, components: Mapping[str, Component]) -> Mapping[str, Component]:
        """Return block → component that reports on the whole run, once everything has run."""
        return components

    def failure_counts(self, components: Mapping[str, Component]) -> FailuresByRun:
        """Return block → failure → counts in each run, once the blocks are finished."""
        return {
            n: counts_by_run(of.failure_counts(), self.runs.count) for n, of in components.items()
        }
