"""Clocks of a running FMU of FMI 3: when they tick, and that they do."""

import ctypes as c
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from components.foreign.fmu.running.values import FmuFailure


class Clocks:
    """The input clocks of an FMU instance, and which of its output clocks have ticked.

    Instants are ticks of the scene.

    Parameters
    ----------
    instance : Instance
    clocks : sequence of dict
        From `components.foreign.fmu.wiring.Wiring.spec`.
    outputs : sequence of int
        References of the FMU's own clocks.
    """

    def __init__(
        self, instance: Any, clocks: Sequence[dict[str, Any]], outputs: Sequence[int]
    ) -> None:
        self._of, self._clocks, self._outputs = instance, clocks, list(outputs)
        #: When clocks tick whose intervals the FMU sets, by their place.
        self.pending: dict[int, int] = {}
        self._activate: Any = None

    def next_ticks(self, after: int) -> dict[int, int]:
        """Return each input clock's next tick after a given one, by number; one without any is left
        out (co-simulation).
        """
        found = dict(self.pending)
        for number, clock in enumerate(self._clocks):
            if clock["interval"]:
                ahead = max(0, (after - clock["shift"]) // clock["interval"] + 1)
                found[number] = clock["shift"] + ahead * clock["interval"]
            else:
                later = [tick for tick in clock["times"] if tick > after]
                if later:
                    found[number] = min(later)
        return found

    def pop_ticking_clocks(self, after: int, at: int) -> list[int]:
        """Return the numbers of clocks ticking in (one tick, another], and discard the ticks."""
        due = [number for number, tick in self.next_ticks(after).items() if tick <= at]
        self.pending = {number: tick for number, tick in self.pending.items() if tick > at}
        return due

    def tick_clocks(self, due: Sequence[int]) -> None:
        """Make the given input clocks of the FMU tick; it must be in event mode."""
        references = [self._clocks[number]["reference"] for number in due]
        self._of.fmu.setClock(references, [True] * len(references))

    def add_output_ticks(self, raised: Any) -> None:
        """Add to ``raised`` which of the FMU's output clocks tick now; it must be in event mode."""
        if self._outputs and raised is not None:
            raised += self._of.fmu.getClock(self._outputs)

    def activate_partitions(self, due: Sequence[int], tick: int, per_s: int, raised: Any) -> None:
        """Run the partitions of a scheduled FMU whose clocks are due up to a tick.

        In order of time and priority.
        """
        if self._activate is None:
            self._activate = self._of.library_function("fmi3ActivateModelPartition")
            self._activate.argtypes = [c.c_void_p, c.c_uint32, c.c_double]
        waiting = [(tick, self._clocks[number]["priority"], number) for number in due]
        while True:
            late = [(at, self._clocks[n]["priority"], n) for n, at in self.pending.items()]
            ready = sorted(one for one in waiting + late if one[0] <= tick)
            if not ready:
                return
            one = ready[0]
            at, _, number = one
            if one in waiting:
                waiting.remove(one)
            else:
                del self.pending[number]
            reference = self._clocks[number]["reference"]
            status = self._activate(self._of.component, reference, at / per_s)
            if status > 1:
                self._of.raise_failure("fmi3ActivateModelPartition", status)
            for place, output in enumerate(self._outputs):
                raised[place] += self._of.fmu.getClock([output])[0]
            self.update_pending_ticks(at, per_s)

    def update_pending_ticks(self, now: int, per_s: int) -> None:
        """Ask the FMU for the intervals it sets, and store when each such clock ticks next."""
        for number, clock in enumerate(self._clocks):
            if not clock["asked"]:
                continue
            reference, qualifier = (c.c_uint32 * 1)(clock["reference"]), (c.c_int * 1)()
            if clock["fraction"]:
                counter, resolution = (c.c_uint64 * 1)(), (c.c_uint64 * 1)()
                self._of.fmu.getIntervalFraction(reference, counter, resolution, qualifier)
                exact = Fraction(counter[0], resolution[0] or 1)
            else:
                interval = (c.c_double * 1)()
                self._of.fmu.getIntervalDecimal(reference, interval, qualifier)
                exact = Fraction(repr(interval[0]))
            if qualifier[0] == 2:
                ticks = exact * per_s
                if ticks.denominator != 1:
                    raise FmuFailure(
                        f"clock {clock['name']!r} asks for an interval of {exact} s, which is no "
                        f"whole number of ticks (1/{per_s} s)"
                    )
                self.pending[number] = now + int(ticks)
