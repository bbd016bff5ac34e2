"""A running FMU: its communication points, events, clocks, and the states it was saved in.

For the process in which it runs; what we ask it for is in `components.foreign.fmu.running.worker`.
"""

import ctypes as c
import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from components.foreign.fmu.running.clocks import Clocks
from components.foreign.fmu.running.values import FmuFailure, ValueGroup, make_failure

_EXACT = 2**53


class Instance:
    """One FMU instance, which steps between communication points and keeps saved states."""

    def __init__(self, folder: str, spec: dict[str, Any]) -> None:
        from fmpy import fmi2, fmi3

        self.spec, self.three = spec, spec["version"] == 3
        #: FMI's noSetFMUStatePriorToCurrentPoint: it is never taken back to an instant before.
        self.only_forward = not spec["rewinds"]
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
            options["logMessage"] = self._keep_log
            if spec["kind"] == "cs":
                options |= {"eventModeUsed": spec["events"], "earlyReturnAllowed": spec["events"]}
        else:
            calls = fmi2.fmi2CallbackFunctions()
            calls.logger = fmi2.fmi2CallbackLoggerTYPE(self._keep_log2)
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
            raise FmuFailure(f"it cannot be instantiated ({error}){self.last_log_text()}") from None
        self.component = c.c_void_p(self.fmu.component)
        self.saved: dict[int, Any] = {}
        self.slot = self.names = 0
        self.started = self.ended = False
        self.tick = 0
        self.next_event_s = math.inf  # when it wants an event
        self.clocks = Clocks(self, spec["clocks"], spec["raised"])
        self._make_value_groups()

    def _make_value_groups(self) -> None:
        spec = self.spec
        kinds = [(kind, [tuple(v) for v in variables]) for kind, variables in spec["outputs"]]
        self.numbers = [
            ValueGroup(self, k, v, "Get") for k, v in kinds if k not in ("String", "Binary")
        ]
        self.texts = [ValueGroup(self, k, v, "Get") for k, v in kinds if k in ("String", "Binary")]
        self.setters = [(ValueGroup(self, kind, v, "Set"), kind) for kind, v in spec["inputs"]]
        if not self.three:
            function = self.library_function("fmi2DoStep")
            function.argtypes = [c.c_void_p, c.c_double, c.c_double, c.c_int]
            self._do_step = function
        elif spec["kind"] == "cs":
            self._flags: Any = [c.c_bool(), c.c_bool(), c.c_bool(), c.c_double()]
            function = self.library_function("fmi3DoStep")
            pointer = c.c_void_p
            function.argtypes = [
                pointer, c.c_double, c.c_double, c.c_bool, pointer, pointer, pointer, pointer
            ]  # fmt: skip
            self._pointers = [c.addressof(flag) for flag in self._flags]
            self._do_step = function

    def library_function(self, name: str) -> Any:
        """Return a C function of the FMU's library, called without checks of its arguments."""
        if name not in self._functions:
            try:
                found = getattr(self.fmu.dll, name)
            except AttributeError:
                raise FmuFailure(f"its library has no {name}") from None
            found.restype = c.c_int
            self._functions[name] = found
        return self._functions[name]

    def _keep_log(self, _: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append(message.decode(errors="replace").strip())

    def _keep_log2(self, _: Any, __: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append(message.decode(errors="replace").strip())

    def last_log_text(self) -> str:
        """Return the FMU's last log messages as text to be added to an error, empty without any."""
        return f": {' | '.join(list(self.log)[-3:])}" if self.log else ""

    def raise_failure(self, call: str, status: int) -> None:
        """Raise an `FmuFailure` for a call's bad status, with the FMU's last log messages."""
        raise make_failure(call, status, self.last_log_text())

    # -- the life of an instance ---------------------------------------------------------------

    def start(self, time_s: float, first: Any) -> None:
        """Initialize the instance at a time (s) with its start values and first inputs."""
        spec, fmu = self.spec, self.fmu
        structural = [start for start in spec["start"] if start[3]]
        if structural:
            fmu.enterConfigurationMode()
            self._set_starts(structural)
            fmu.exitConfigurationMode()
        self._set_starts([start for start in spec["start"] if not start[3]])
        if self.three:
            fmu.enterInitializationMode(startTime=time_s)
        else:
            fmu.setupExperiment(startTime=time_s)
            fmu.enterInitializationMode()
        self._put_inputs(first)
        fmu.exitInitializationMode()
        self.started = True

    def _set_starts(self, starts: Any) -> None:
        for kind, reference, values, _ in starts:
            ValueGroup(self, kind, [(reference, len(values))], "Set").set_values(values)

    def _process_events(
        self, inputs: Any = None, due: Sequence[int] = (), raised: Any = None
    ) -> None:
        """Process events in event mode: set inputs, tick clocks, update until states settle.

        What of its own clocks ticks is added to `raised`.
        """
        fmu = self.fmu
        if inputs is not None:
            self._put_inputs(inputs)
        if due:
            self.clocks.tick_clocks(due)
        for _ in range(1000):
            self.clocks.add_output_ticks(raised)
            again, ended, _, _, defined, next_s = fmu.updateDiscreteStates()
            self.ended = self.ended or ended
            if not again:
                self.next_event_s = next_s if defined else math.inf
                return
        raise FmuFailure("its discrete states do not settle within 1000 updates")

    def _put_inputs(self, row: Any) -> None:
        at = 0
        for group, _ in self.setters:
            group.values[:] = row[at : at + group.count]
            group.get_or_set_buffer()
            at += group.count

    def _set_inputs_and_tick(
        self, inputs: Any, due: Sequence[int], tick: int, per_s: int, raised: Any
    ) -> None:
        """Set new inputs, if any, and tick the clocks due, in event mode where the FMU has one."""
        if self.spec["events"] and (due or (inputs is not None and self.spec["discrete"])):
            self.fmu.enterEventMode()
            self._process_events(inputs, due, raised)
            self._update_clocks_enter_step_mode(tick, per_s)
        elif inputs is not None:
            self._put_inputs(inputs)

    def _update_clocks_enter_step_mode(self, tick: int, per_s: int) -> None:
        self.clocks.update_pending_ticks(tick, per_s)
        self.fmu.enterStepMode()

    def step(self, start_s: float, end_s: float, raised: Any = None) -> bool:
        """Advance to the next communication point; return False if the FMU ended before it.

        Events on the way are handled. It may ask to end before, or there (`ended`).
        """
        if not self.three:
            return self._step_fmi2(start_s, end_s)
        event, ended, early, last = self._flags
        for _ in range(1_000_000):
            to_s = self.next_event_s if start_s < self.next_event_s < end_s else end_s
            size = to_s - start_s
            forward = self.only_forward
            status = self._do_step(self.component, start_s, size, forward, *self._pointers)
            if status > 1:
                self.raise_failure("fmi3DoStep", status)
            self.ended = self.ended or ended.value
            there_s = min(last.value, to_s) if early.value else to_s
            if (event.value or there_s >= self.next_event_s) and not ended.value:
                self.next_event_s = math.inf
                self._handle_event_at(there_s, raised)
            if self.ended:
                return end_s - there_s <= 1e-9 * max(1.0, abs(end_s))
            if there_s >= end_s:
                return True
            start_s = there_s
        raise FmuFailure("it returned early from a step 1000000 times")

    def _handle_event_at(self, now_s: float, raised: Any) -> None:
        if not self.spec["events"]:
            return
        self.fmu.enterEventMode()
        self._process_events(raised=raised)
        self._update_clocks_enter_step_mode(round(now_s * self.per_s), self.per_s)

    def _step_fmi2(self, start_s: float, end_s: float) -> bool:
        status = self._do_step(self.component, start_s, end_s - start_s, self.only_forward)
        if status == 2 and self.fmu.getBooleanStatus(3):
            self.ended = True
            last: float = self.fmu.getRealStatus(2)
            return end_s - last <= 1e-9 * max(1.0, abs(end_s))
        if status > 1:
            self.raise_failure("fmi2DoStep", status)
        return True

    # -- clocks --------------------------------------------------------------------------------

    def _step_to(self, before: int, tick: int, per_s: int, raised: Any) -> bool:
        """Advance to a tick, ticking clocks at their own times; return whether it was reached.

        Those that tick at the instant itself are left to whoever gives it its inputs there.
        """
        while True:
            at = min([tick, *self.clocks.next_ticks(before).values()])
            if not self.step(before / per_s, at / per_s, raised):
                return False
            if at == tick or self.ended:
                return at == tick
            due = self.clocks.pop_ticking_clocks(before, at)
            self._set_inputs_and_tick(None, due, at, per_s, raised)
            before = at

    # -- going back ----------------------------------------------------------------------------

    def restore_slot(self, slot: int, freed: list[int]) -> None:
        """Restore a saved state by number (0: before the start), and free those in ``freed``."""
        if slot != self.slot:
            if slot == 0:
                self.fmu.reset()
                self.started, self.ended, self.clocks.pending, self.tick = False, False, {}, 0
                self.next_event_s = math.inf
            else:
                state, self.tick, pending, self.ended, self.next_event_s = self.saved[slot]
                self.fmu.setFMUState(state)
                self.clocks.pending, self.started = dict(pending), True
            self.slot = slot
        for old in freed:
            if old in self.saved:
                self.fmu.freeFMUState(self.saved.pop(old)[0])

    def save(self) -> int:
        """Save the FMU's state and return the number under which it is kept."""
        self.names += 1
        state = self.fmu.getFMUState()
        kept = state, self.tick, dict(self.clocks.pending), self.ended, self.next_event_s
        self.saved[self.names] = kept
        self.slot = self.names
        return self.slot

    def run(self, request: dict[str, Any], beat: Any) -> dict[str, Any]:
        """Go through some communication points; return what is read at each."""
        self.restore_slot(request["slot"], request["freed"])
        ticks, per_s, rows = request["ticks"], request["per_s"], request["inputs"]
        changed, due, count = request["changed"], request["due"], len(request["ticks"])
        numbers = np.empty((count, sum(group.count for group in self.numbers)))
        raised = np.zeros((count, len(self.spec["raised"])))
        places, at = [], 0
        for group in self.numbers:
            places.append((group.get_or_set_buffer, group.values, slice(at, at + group.count)))
            at += group.count
        wide = [
            (group.values, place)
            for group, (_, _, place) in zip(self.numbers, places, strict=True)
            if group.kind in ("Int64", "UInt64")
        ]
        texts: list[list[str]] = []
        exact: dict[tuple[int, int], str] = {}
        scheduled, step = self.spec["kind"] == "se", self.step
        self.per_s = per_s
        clocked = bool(self.spec["clocks"]) and not scheduled
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
                    self.clocks.update_pending_ticks(tick, per_s)
                elif self.spec["events"]:
                    due_now = (
                        [*due[row], *self.clocks.pop_ticking_clocks(tick - 1, tick)]
                        if clocked
                        else ()
                    )
                    self._process_events(None, due_now, raised[row])
                    self._update_clocks_enter_step_mode(tick, per_s)
            elif clocked:
                if not self._step_to(self.tick, tick, per_s, raised[row]):
                    done = row
                    break
                now_due = [*due[row], *self.clocks.pop_ticking_clocks(tick - 1, tick)]
                self._set_inputs_and_tick(rows[row] if changed[row] else None, now_due, tick, per_s,
                               raised[row])  # fmt: skip
            elif not scheduled:
                if not step(before, time_s, raised[row]):
                    done = row
                    break
                if changed[row]:
                    self._set_inputs_and_tick(rows[row], (), tick, per_s, raised[row])
            if scheduled:
                if changed[row]:
                    self._put_inputs(rows[row])
                self.clocks.activate_partitions(due[row], tick, per_s, raised[row])
            before, self.tick = time_s, tick
            for exchange, values, place in places:
                exchange()
                numbers[row, place] = values
            for values, place in wide:
                for element in np.flatnonzero(np.abs(numbers[row, place]) >= _EXACT).tolist():
                    exact[row, place.start + element] = str(values[element])
            if self.texts:
                for group in self.texts:
                    group.get_or_set_buffer()
                texts.append([word for group in self.texts for word in group.read_texts()])
        slot = self.save() if request["save"] else self.slot
        return {
            "numbers": numbers,
            "texts": texts,
            "raised": raised,
            "exact": exact,
            "slot": slot,
            "done": done,
        }
