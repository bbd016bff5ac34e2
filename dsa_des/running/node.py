"""Blocks as SimPy processes: when each wakes, what it reads, and where its messages go.

Within an instant SimPy orders events by priority. Blocks in look-ahead windows come first, then
the others by depth; ties within a depth go by name, or at random under ``shuffle_ties``.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
import simpy

from dsa_des.arrays.run_ticks import (
    RunTicks,
    last_position_at_or_before,
    positions_with_found_mask,
    shared_zero_run_numbers,
    union_of_instants,
)
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.component import Component, RunEnd
from dsa_des.block.foreign_calls import is_stop_request
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake, checked_messages
from dsa_des.errors import RunRefused
from dsa_des.running.channel import Channel, Inputs
from dsa_des.running.events import (
    LEAVE_PRIORITY,
    Abort,
    Bell,
    BlockEnvironment,
    RunState,
    WakeUp,
)
from dsa_des.running.processors import Processor
from dsa_des.running.windows import Demand, Window
from dsa_des.stretches.outages import Outages
from dsa_des.stretches.stretched_block import StretchedBlock
from dsa_des.time.clock import MAX_TICK
from dsa_des.time.run_clock import RunClock


@dataclass
class Node:
    """Runs one block: wakes it, gives it its inputs, and delivers what it sends.

    Invariants: `run_at` is called with increasing ticks; at each of them every undelayed sender
    has run; only here are a channel's rows collected.
    """

    simulation: RunState
    component: Component
    windowed: bool
    priority: Callable[[], float]
    clock: RunClock | None = None
    #: When it runs though nothing comes.
    pulse: RunClock | None = None
    demands: list[Demand] = field(default_factory=list)
    on_demand: bool = False
    processor: Processor | None = None
    channels: dict[str, list[Channel]] = field(default_factory=dict)
    subscribers: dict[str, list[tuple[Channel, "Node", str]]] = field(default_factory=dict)
    #: What handles the wakes: the block itself, or its instances, one per replica.
    runner: Any = None
    #: Its instances in each stretch of time, where it changes while it runs.
    stretched: StretchedBlock | None = None
    #: When it is out, where it fails at random.
    outages: Outages | None = None
    #: Whether it may run ahead of the window (`Window.ahead`).
    ahead: bool = False

    def __post_init__(self) -> None:
        self.name = self.component.name
        self.runner = self.component
        self._scheduled: set[int] = set()
        self._scan_at: dict[int, int] = {}
        self._missed = False
        #: In which runs it has run, and whether in all.
        self._ran: BoolArray = np.zeros(0, dtype=bool)
        self._all_ran = False
        inputs = self.component.inputs
        self._trigger_ports = [port for port in inputs if inputs[port].mode == "trigger"]

    @cached_property
    def _trigger_wires(self) -> list[Channel]:
        return [wire for port in self._trigger_ports for wire in self.channels.get(port, ())]

    @property
    def current_component(self) -> Component:
        """The instance of the block that is in force now, with its state."""
        return self.component if self.stretched is None else self.stretched.current_instance

    @property
    def state_objects(self) -> list[object]:
        """All objects whose attributes hold the block's state."""
        failing = [] if self.outages is None else [self.outages]
        if self.stretched is not None:
            return [*failing, *self.stretched.state_objects]
        return [*failing, self.component, *self.component.context.effects.values()]

    @property
    def wires(self) -> list[Channel]:
        """The wires into all inputs."""
        return [wire for wires in self.channels.values() for wire in wires]

    # -- the life of the process ---------------------------------------------------------------

    def start(self) -> None:
        """Start the block's SimPy process."""
        env = self.simulation.env
        self._bell = Bell(env)
        own = self.component.process
        env.process(self._run_at_each_bell() if own is None else self._own_process(own))

    def _run_at_each_bell(self) -> Generator[simpy.Event, None, None]:
        while True:
            yield self._bell
            self._bell = Bell(self.simulation.env)
            if self.windowed:
                window = self.simulation.window
                self._run_window(window.start, self._window_end(window))
            else:
                self._run_at(int(self.simulation.env.now))

    def _own_process(self, own: Any) -> Generator[simpy.Event, None, None]:
        try:
            env = BlockEnvironment(self)
            yield env.timeout(0)  # start at its own place in the first instant
            yield from own(env)
        except Abort:
            raise
        except BaseException as error:
            if is_stop_request(error):
                raise
            ticks = np.array([int(self.simulation.env.now)], dtype=np.int64)
            self.simulation.fail(self, ticks, error)

    def failure_counts(self) -> Mapping[str, IntArray]:
        """Return kind of failure → (failures, cases), (2, runs): that it never ran, or outages."""
        out = {} if self.outages is None else self.outages.failure_counts()
        if self.component.process is not None or self._all_ran:
            return out
        ports = [name for name in self.channels if self.component.inputs[name].is_held]
        why = f", for nothing came at {' and '.join(sorted(ports))}" if ports else ""
        idle = ~self._ran if len(self._ran) else np.ones(self.simulation.runs.count, dtype=bool)
        never = np.array([idle, np.ones(len(idle))], dtype=np.int64)
        return {f"it never ran{why}": never, **out}

    def schedule_at(self, tick: int) -> None:
        """Schedule the block to run at `tick`; further calls for the same tick change nothing."""
        if tick in self._scheduled:
            return
        self._scheduled.add(tick)
        env = self.simulation.env
        event = WakeUp(env, tick - int(env.now), self.priority())
        event.callbacks.append(self._on_wake_up)

    def _on_wake_up(self, event: simpy.Event) -> None:
        self._scheduled.discard(int(self.simulation.env.now))
        if self._bell.callbacks:
            self._bell.ring()
        else:
            self._missed = True

    def wait(self) -> Bell | WakeUp:
        """Return the event of the next trigger arrival, for a block with its own process.

        What arrived while the process was busy, and was not received yet, counts as arriving now.
        """
        if self._missed:
            self._missed = False
            return WakeUp(self.simulation.env, 0, self.priority())
        if self._bell.callbacks is None:
            self._bell = Bell(self.simulation.env)
        return self._bell

    # -- when ----------------------------------------------------------------------------------

    def schedule_block_in_window(self, window: Window) -> None:
        """Schedule all that the block's clock calls for in a window."""
        start, end = window.start, window.end
        if self.processor is not None:
            self.processor.schedule_service_of_window(start, end)
        if self.windowed:
            if self._window_end(window) > start:
                self.schedule_at(start)
            return
        if self.clock is not None:
            scans, instants = self.clock.scans_between(start, end)
            self._scan_at = dict(zip(instants.tick.tolist(), scans.tolist(), strict=True))
            for tick in self._scan_at:
                self.schedule_at(tick)
        elif self.on_demand:
            for tick in self._demanded_instants(start, end).tick.tolist():
                self.schedule_at(tick)
        if self.pulse is not None:
            for tick in self.pulse.scans_between(start, end)[1].tick.tolist():
                self.schedule_at(tick)

    def lower_bound_of_next_run(self, start: int, ahead: int) -> int:
        """Return a tick, `start` or later, before which a block run in windows does not run.

        It has come up to `ahead` if it runs ahead.
        """
        start = max(start, ahead) if self.ahead else start
        clocks = [] if self.clock is None else [(self.clock, 0)]
        if self.on_demand:
            clocks += [(demand.clock, demand.lead_ticks) for demand in self.demands]
        if self.pulse is not None:
            clocks.append((self.pulse, 0))
        ticks = [clock.lower_bound_of_next_scan(start + lead) - lead for clock, lead in clocks]
        ticks += [wire.earliest_waiting_tick() for wire in self._trigger_wires]
        return max(start, min(ticks, default=MAX_TICK))

    def _window_end(self, window: Window) -> int:
        """Return the tick that ends a block's window, later for blocks that run ahead of loops."""
        return window.ahead if self.ahead else window.end

    def _demanded_instants(self, start: int, end: int) -> RunTicks:
        return _union_of_instants([demand.instants_between(start, end) for demand in self.demands])

    # -- what ----------------------------------------------------------------------------------

    def _run_at(self, tick: int) -> None:
        runs = self.simulation.runs
        if runs.early and runs.have_all_ended(tick):
            return
        scan = self._scan_at.get(tick, -1)
        idle = None
        if self.pulse is not None and scan < 0:
            # What came while the block was out does not come now.
            new = [wire.arrivals_before(tick + 1).tick for wire in self._trigger_wires]
            idle = np.array([not any((arrival == tick).any() for arrival in new)])
        waiting = idle is not None and bool(idle[0])
        if not waiting and self.processor is not None and self.processor.skip_if_busy(self.name):
            for wire in self._trigger_wires:
                wire.pop_arrived_rows(tick + 1)  # what came to be worked on now is left out with it
            return
        self._run(_single_instant(tick), np.array([scan], dtype=np.int64), tick + 1, idle)

    def _run_window(self, start: int, end: int) -> None:
        if self.clock is not None:
            scans, instants = self.clock.scans_between(start, end)
        else:
            instants = self._demanded_instants(start, end) if self.on_demand else RunTicks.empty()
            scans = _placeholder_scan_numbers(len(instants))
        arrivals = [wire.arrivals_before(end) for wire in self._trigger_wires]
        if any(len(part.tick) for part in arrivals):
            own, numbers = instants, scans
            instants = _union_of_instants([own, *arrivals])
            scans = _placeholder_scan_numbers(len(instants))
            if len(own) and self.clock is not None:
                scans = scans.copy()
                scans[last_position_at_or_before(instants, own)] = numbers
        idle = None
        if self.pulse is not None and len(pulses := self.pulse.scans_between(start, end)[1]):
            busy = instants
            instants = _union_of_instants([busy, pulses])
            idle = np.ones(len(instants), dtype=bool)
            if len(busy):
                rows = last_position_at_or_before(instants, busy)
                scans, numbers = np.full(len(instants), -1), scans
                scans[rows], idle[rows] = numbers, False
            else:
                scans = _placeholder_scan_numbers(len(instants))
        runs = self.simulation.runs
        if runs.early:
            kept = runs.is_before_ends(instants)
            instants, scans = instants.take(kept), scans[kept]
            idle = None if idle is None else idle[kept]
        if len(instants.tick):
            self._run(instants, scans, end, idle)

    @cached_property
    def _inputs(self) -> Inputs:
        run = self.simulation
        return Inputs(self.component.inputs, self.channels, run.ticks_per_s, run.runs)

    def _run(
        self, instants: RunTicks, scans: IntArray, end: int, idle: BoolArray | None = None
    ) -> None:
        before = None if self.clock is None else self.clock.previous_ticks
        if self.outages is not None and not (up := self.outages.is_up(instants)).all():
            instants, scans = instants.take(up), scans[up]
            idle = None if idle is None else idle[up]
            if not len(instants):
                return
        wake = self._inputs.make_wake(
            instants, scans, end, self._row_indices_by_demanding_block, clock=before, idle=idle
        )
        if wake is None:
            return
        if self.outages is not None:
            wake = self.outages.drop_arrivals_during_outage(wake)
        ticks = wake.ticks
        if not self._all_ran:
            if not len(self._ran):
                self._ran = np.zeros(self.simulation.runs.count, dtype=bool)
            self._ran[wake.run[wake.instants.first_position_of_runs]] = True
            self._all_ran = bool(self._ran.all())
        try:
            if self.stretched is None:
                self.send(self.runner.run(wake), wake.instants)
            else:
                for runner, part in self.stretched.split_by_stretch(wake):
                    self.send(runner.run(part), part.instants)
        except (Abort, RunRefused):
            raise
        except BaseException as error:
            if is_stop_request(error):
                raise
            self.simulation.fail(self, ticks, error, int(wake.scans[0]))

    def _row_indices_by_demanding_block(self, instants: RunTicks) -> Mapping[str, IntArray]:
        if not self.demands or self.clock is not None:
            return {}
        start, end = int(instants.tick[0]), int(instants.tick[-1]) + 1
        if self.windowed:  # clocks know the scans of the window: they were asked for before
            window = self.simulation.window
            start, end = window.start, self._window_end(window)
        rows = {}
        for demand in self.demands:
            asked = demand.instants_between(start, end)
            rows_asked, there = positions_with_found_mask(instants, asked)
            rows[demand.block] = rows_asked if there is None else rows_asked[there]
        return rows

    def receive(self) -> Wake:
        """Return the inputs as they are now, for a block with its own process."""
        self._missed = False
        tick = int(self.simulation.env.now)
        scans = np.array([-1], dtype=np.int64)
        wake = self._inputs.make_wake(_single_instant(tick), scans, tick + 1, complete=False)
        assert wake is not None
        return wake

    # -- sending -------------------------------------------------------------------------------

    def send(self, result: Any, ran: RunTicks, leaves: int | None = None) -> None:
        """Send what a block returned when it ran: a message, or messages by output name.

        `ran` are the instants that it ran at; it sets out at `leaves`, where that is later.
        """
        for port, message in checked_messages(result, self.component.outputs, ran):
            if self.outages is not None:
                message = self.outages.corrupt_output(port, message)
            if isinstance(message, RunEnd):
                self.simulation.runs.note_ends(message.instants, self.name)
            if self.simulation.recorder is not None:
                self.simulation.recorder.record(self.name, message)
            if leaves is not None and leaves > ran.tick[0]:
                event = WakeUp(self.simulation.env, leaves - int(ran.tick[0]), LEAVE_PRIORITY)
                event.callbacks.append(partial(self._deliver_to_port, port, message, leaves))
            else:
                self._deliver_to_port(port, message)

    def _deliver_to_port(
        self, port: str, message: Message, sent: int | None = None, event: Any = None
    ) -> None:
        if self.processor is None:
            self._deliver(port, message, sent)
        else:
            self.processor.submit(self.name, message, partial(self._deliver, port))

    def _deliver(self, port: str, message: Message, sent: int | IntArray | None = None) -> None:
        for channel, node, target_port in self.subscribers.get(port, []):
            arrivals = channel.push(message, sent)
            if node.component.inputs[target_port].mode == "sampled":
                channel.drop_superseded_rows(self.simulation.window.start)
            if not node.windowed and target_port in node._trigger_ports:
                for arrival in arrivals.tick.tolist():
                    node.schedule_at(arrival)


def _union_of_instants(parts: Sequence[RunTicks]) -> RunTicks:
    """Return the union of the (run, tick) instants of all parts, in order."""
    filled = [part for part in parts if len(part.tick)]
    if len(filled) > 1:
        return union_of_instants(filled)
    return filled[0] if filled else RunTicks.empty()


#: The scan number at instants that are none of a block's own scans, seen as often as asked for.
_NO_SCAN = np.broadcast_to(np.int64(-1), 1 << 40)


def _placeholder_scan_numbers(rows: int) -> IntArray:
    return _NO_SCAN[:rows]


def _single_instant(tick: int) -> RunTicks:
    return RunTicks(shared_zero_run_numbers(1), np.array([tick], dtype=np.int64))
