"""A running FMU: its communication points, events, clocks, and the states it was saved in.

For the process in which it runs; what we ask it for is in `components.foreign.fmu.worker`.
"""

import ctypes as c
from collections import deque
from fractions import Fraction
from typing import Any

import numpy as np

from components.foreign.fmu.values import ValueGroup

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_EXACT = 2**53


class FmuFailure(Exception):
    """What an FMU refused, in its own words."""


class Instance:
    """One FMU instance, its communication points, and the states it was saved in."""

    def __init__(self, folder: str, spec: dict[str, Any]) -> None:
        from fmpy import fmi2, fmi3

        self.spec, self.three = spec, spec["version"] == 3
        self.log: deque[str] = deque(maxlen=20)
        slave = {
            "cs": fmi3.FMU3Slave if self.three else fmi2.FMU2Slave,
            "se": fmi3.FMU3ScheduledExecution,
        }[spec["kind"]]
        self.fmu: Any = slave(
            guid=spec["token"], modelIdentifier=spec["identifier"], unzipDirectory=folder,
            instanceName=spec["name"],
        )  # fmt: skip
        self._functions: dict[str, Any] = {}
        options: dict[str, Any] = {}
        if self.three:
            options["logMessage"] = self._logged
            if spec["kind"] == "cs":
                options |= {"eventModeUsed": spec["events"], "earlyReturnAllowed": spec["events"]}
        else:
            calls = fmi2.fmi2CallbackFunctions()
            calls.logger = fmi2.fmi2CallbackLoggerTYPE(self._logged2)
            calls.allocateMemory = fmi2.defaultCallbacks.allocateMemory
            calls.freeMemory = fmi2.defaultCallbacks.freeMemory
            try:
                from fmpy.logging import addLoggerProxy

                addLoggerProxy(c.byref(calls))
            except Exception:  # messages then keep their %s
                pass
            options["callbacks"] = calls
        try:
            self.fmu.instantiate(loggingOn=False, **options)
        except Exception as error:
            raise FmuFailure(f"it cannot be instantiated ({error}){self.words()}") from None
        self.component = c.c_void_p(self.fmu.component)
        self.saved: dict[int, Any] = {}
        self.slot = self.names = 0
        self.started = self.ended = False
        self.tick, self.pending = 0, {}  # type: ignore[var-annotated]
        self._groups()

    def _groups(self) -> None:
        spec = self.spec
        kinds = [(kind, [tuple(v) for v in variables]) for kind, variables in spec["outputs"]]
        self.numbers = [
            ValueGroup(self, k, v, "Get") for k, v in kinds if k not in ("String", "Binary")
        ]
        self.texts = [ValueGroup(self, k, v, "Get") for k, v in kinds if k in ("String", "Binary")]
        self.setters = [(ValueGroup(self, kind, v, "Set"), kind) for kind, v in spec["inputs"]]
        if not self.three:
            function = self.function("fmi2DoStep")
            function.argtypes = [c.c_void_p, c.c_double, c.c_double, c.c_int]
            self._do_step = function
        elif spec["kind"] == "cs":
            self._flags: Any = [c.c_bool(), c.c_bool(), c.c_bool(), c.c_double()]
            function = self.function("fmi3DoStep")
            pointer = c.c_void_p
            function.argtypes = [
                pointer, c.c_double, c.c_double, c.c_bool, pointer, pointer, pointer, pointer
            ]  # fmt: skip
            self._pointers = [c.addressof(flag) for flag in self._flags]
            self._do_step = function
        else:
            self._activate = self.function("fmi3ActivateModelPartition")
            self._activate.argtypes = [c.c_void_p, c.c_uint32, c.c_double]

    def function(self, name: str) -> Any:
        """Return a function of the FMU's library, without the checks of arguments."""
        if name not in self._functions:
            try:
                found = getattr(self.fmu.dll, name)
            except AttributeError:
                raise FmuFailure(f"its library has no {name}") from None
            found.restype = c.c_int
            self._functions[name] = found
        return self._functions[name]

    def _logged(self, _: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append(message.decode(errors="replace").strip())

    def _logged2(self, _: Any, __: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append(message.decode(errors="replace").strip())

    def words(self) -> str:
        """Return what it logged last, to be added to an error."""
        return f": {' | '.join(list(self.log)[-3:])}" if self.log else ""

    def refuse(self, call: str, status: int) -> None:
        """Raise what the FMU answered, with what it logged."""
        raise FmuFailure(f"{call} returned {_STATUS[min(status, 5)]}{self.words()}")

    # -- the life of an instance ---------------------------------------------------------------

    def start(self, time_s: float, first: Any) -> None:
        """Initialize it at a time, with its start values and the first inputs."""
        spec, fmu = self.spec, self.fmu
        structural = [start for start in spec["start"] if start[3]]
        if structural:
            fmu.enterConfigurationMode()
            self._put(structural)
            fmu.exitConfigurationMode()
        self._put([start for start in spec["start"] if not start[3]])
        if self.three:
            fmu.enterInitializationMode(startTime=time_s)
        else:
            fmu.setupExperiment(startTime=time_s)
            fmu.enterInitializationMode()
        self._set(first, events=False)
        fmu.exitInitializationMode()
        self._events(entered=True)
        self.started = True

    def _put(self, starts: Any) -> None:
        for kind, reference, values, _ in starts:
            ValueGroup(self, kind, [(reference, len(values))], "Set").put(values)

    def _events(self, entered: bool = False) -> None:
        """Let it handle an event, where it has an event mode."""
        if not self.spec["events"]:
            return
        if not entered:
            self.fmu.enterEventMode()
        for _ in range(1000):
            again, ended, *_ = self.fmu.updateDiscreteStates()
            self.ended = self.ended or ended
            if not again:
                self.fmu.enterStepMode()
                return
        raise FmuFailure("its discrete states do not settle within 1000 updates")

    def _set(self, row: Any, *, events: bool = True) -> None:
        discrete = events and self.spec["events"] and self.spec["discrete"]
        if discrete:
            self.fmu.enterEventMode()
        at = 0
        for group, _ in self.setters:
            group.values[:] = row[at : at + group.count]
            group.go()
            at += group.count
        if discrete:
            self._events(entered=True)

    def step(self, start_s: float, end_s: float) -> bool:
        """Go from one communication point to the next; return whether it got there.

        Events on the way are handled. It may ask to end before, or there (`ended`).
        """
        if not self.three:
            return self._step2(start_s, end_s)
        event, ended, early, last = self._flags
        for _ in range(1_000_000):
            size = end_s - start_s
            status = self._do_step(self.component, start_s, size, False, *self._pointers)
            if status > 1:
                self.refuse("fmi3DoStep", status)
            self.ended = self.ended or ended.value
            if event.value and not ended.value:
                self._events()
            there = not early.value or last.value >= end_s
            if self.ended:
                return there or end_s - last.value <= 1e-9 * max(1.0, abs(end_s))
            if there:
                return True
            start_s = last.value
        raise FmuFailure("it returned early from a step 1000000 times")

    def _step2(self, start_s: float, end_s: float) -> bool:
        status = self._do_step(self.component, start_s, end_s - start_s, 0)
        if status == 2 and self.fmu.getBooleanStatus(3):
            self.ended = True
            last: float = self.fmu.getRealStatus(2)
            return end_s - last <= 1e-9 * max(1.0, abs(end_s))
        if status > 1:
            self.refuse("fmi2DoStep", status)
        return True

    # -- clocks --------------------------------------------------------------------------------

    def _tick_clocks(self, due: list[int], tick: int, per_s: int, raised: Any) -> None:
        """Activate the clocks that are due up to an instant, in order of time and priority."""
        clocks = self.spec["clocks"]
        waiting = [(tick, clocks[number]["priority"], number) for number in due]
        while True:
            late = [(at, clocks[number]["priority"], number) for number, at in self.pending.items()]
            ready = sorted(one for one in waiting + late if one[0] <= tick)
            if not ready:
                return
            one = ready[0]
            at, _, number = one
            if one in waiting:
                waiting.remove(one)
            else:
                del self.pending[number]
            reference = clocks[number]["reference"]
            status = self._activate(self.component, reference, at / per_s)
            if status > 1:
                self.refuse("fmi3ActivateModelPartition", status)
            for place, output in enumerate(self.spec["raised"]):
                raised[place] += self.fmu.getClock([output])[0]
            self._count_down(at, per_s)

    def _count_down(self, now: int, per_s: int) -> None:
        for number, clock in enumerate(self.spec["clocks"]):
            if not clock["asked"]:
                continue
            reference, qualifier = (c.c_uint32 * 1)(clock["reference"]), (c.c_int * 1)()
            if clock["fraction"]:
                counter, resolution = (c.c_uint64 * 1)(), (c.c_uint64 * 1)()
                self.fmu.getIntervalFraction(reference, counter, resolution, qualifier)
                exact = Fraction(counter[0], resolution[0] or 1)
            else:
                interval = (c.c_double * 1)()
                self.fmu.getIntervalDecimal(reference, interval, qualifier)
                exact = Fraction(repr(interval[0]))
            if qualifier[0] == 2:
                ticks = exact * per_s
                if ticks.denominator != 1:
                    raise FmuFailure(
                        f"clock {clock['name']!r} asks for an interval of {exact} s, which is no "
                        f"whole number of ticks (1/{per_s} s)"
                    )
                self.pending[number] = now + int(ticks)

    # -- going back ----------------------------------------------------------------------------

    def go_to(self, slot: int, freed: list[int]) -> None:
        """Bring it back to a state in which it was saved; 0 is before it started."""
        if slot != self.slot:
            if slot == 0:
                self.fmu.reset()
                self.started, self.ended, self.pending, self.tick = False, False, {}, 0
            else:
                state, self.tick, pending, self.ended = self.saved[slot]
                self.fmu.setFMUState(state)
                self.pending, self.started = dict(pending), True
            self.slot = slot
        for old in freed:
            if old in self.saved:
                self.fmu.freeFMUState(self.saved.pop(old)[0])

    def save(self) -> int:
        """Remember its state; return the number it is known by."""
        self.names += 1
        self.saved[self.names] = self.fmu.getFMUState(), self.tick, dict(self.pending), self.ended
        self.slot = self.names
        return self.slot

    def run(self, request: dict[str, Any], beat: Any) -> dict[str, Any]:
        """Go through some communication points; return what is read at each."""
        self.go_to(request["slot"], request["freed"])
        ticks, per_s, rows = request["ticks"], request["per_s"], request["inputs"]
        changed, due, count = request["changed"], request["due"], len(request["ticks"])
        numbers = np.empty((count, sum(group.count for group in self.numbers)))
        raised = np.zeros((count, len(self.spec["raised"])))
        places, at = [], 0
        for group in self.numbers:
            places.append((group.go, group.values, slice(at, at + group.count)))
            at += group.count
        wide = [
            (group.values, place)
            for group, (_, _, place) in zip(self.numbers, places, strict=True)
            if group.kind in ("Int64", "UInt64")
        ]
        texts: list[list[str]] = []
        exact: dict[tuple[int, int], str] = {}
        scheduled, step = self.spec["kind"] == "se", self.step
        times = [tick / per_s for tick in ticks]
        before = self.tick / per_s
        done = count
        for row, (tick, time_s) in enumerate(zip(ticks, times, strict=True)):
            if self.ended:  # it asked to; what it gave last is the last
                done = row
                break
            beat[0] += 1
            request["at"] = time_s
            if not self.started:
                self.start(time_s, rows[row])
                if scheduled:
                    self._count_down(tick, per_s)
            else:
                if not scheduled and not step(before, time_s):
                    done = row
                    break
                if changed[row]:
                    self._set(rows[row])
            if scheduled:
                self._tick_clocks(due[row], tick, per_s, raised[row])
            before, self.tick = time_s, tick
            for go, values, place in places:
                go()
                numbers[row, place] = values
            for values, place in wide:
                for element in np.flatnonzero(np.abs(numbers[row, place]) >= _EXACT).tolist():
                    exact[row, place.start + element] = str(values[element])
            if self.texts:
                for group in self.texts:
                    group.go()
                texts.append([word for group in self.texts for word in group.words()])
        slot = self.save() if request["save"] else self.slot
        return {
            "numbers": numbers,
            "texts": texts,
            "raised": raised,
            "exact": exact,
            "slot": slot,
            "done": done,
        }
