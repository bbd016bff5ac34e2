"""Which runs a simulation holds: one here, many in `dsa_des.replicas`.

A simulation asks its timeline for all in which several runs of a scene differ from one. So what
builds blocks, wires them and runs them knows no replicas.
"""

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

from dsa_des.block.component import Component
from dsa_des.running.rewind import Rewinder, RewindingWindows
from dsa_des.running.windows import EqualWindows, Windows
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import ScanClock
from dsa_des.time.randomness import Streams
from dsa_des.time.timeline import ReplicaTime


class Timeline:
    """One run of a scene.

    Parameters
    ----------
    scene : Scene
    everything : bool
        Let clocks draw their jitter also where it is 0.

    Attributes
    ----------
    streams : Streams
        The keyed random numbers of blocks.
    time : ReplicaTime
        How the runs lie in time; known once `lay` was called.
    """

    time: ReplicaTime

    def __init__(self, scene: Scene, *, everything: bool = False) -> None:
        self.scene = scene
        self._everything = everything
        self.streams = Streams(scene.seed)

    def parameters(self, name: str) -> Any:
        """Return what a block is made with."""
        return self.scene.blocks[name].parameters

    def lay(self, components: Mapping[str, Component], duration_s: Fraction) -> None:
        """Learn the blocks, which are set up, and how long a run lasts."""
        self.time = ReplicaTime(1, self._run_ticks(duration_s))

    def _run_ticks(self, duration_s: Fraction) -> int:
        ticks = duration_s * self.scene.ticks_per_s
        return -(-ticks.numerator // ticks.denominator)

    def clock(self, name: str, component: Component) -> ScanClock | None:
        """Return a block's scan clock, or None where it has none of its own."""
        spec = component.clock_of(component.p)
        if spec is None:
            return None
        draw = self.streams.scan_normals(name, "clock jitter")
        return ScanClock(spec, self.scene.ticks_per_s, draw, always_draws=self._everything)

    def runner(self, component: Component) -> Any:
        """Return what handles the wakes of a block: itself, or what stands in for it."""
        return component

    def windows(
        self, longest_ticks: int, cuts: Iterable[int], rewinder: Rewinder | None
    ) -> Windows:
        """Return the windows of all runs.

        Parameters
        ----------
        longest_ticks : int
        cuts : iterable of int
            Ticks at which one ends early.
        rewinder : Rewinder, optional
            If feedback loops are run in windows.
        """
        if rewinder is None:
            return EqualWindows(self.time.end_tick, longest_ticks, cuts)
        return RewindingWindows(self.time.end_tick, longest_ticks, cuts, rewinder)

    def finish(self, components: Mapping[str, Component]) -> Mapping[str, Component]:
        """Take note that all has run, and return the blocks that speak for the whole run."""
        return components
