"""A scene whose time belongs to a host program: it calls, and the blocks run within the call.

There is no event queue here. A call names an instant and hands in the message of the scene's
source; every sensor whose scan is due looks at it, and what depends on them follows in the order
of depth. `Simulator`, the interface for a host, is registered by a package under the entry-point
group ``dsa_des.embed``.
"""

import math
from collections.abc import Container, Iterable, Set
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from networkx import ancestors

from dsa_des.arrays.run_ticks import RunTicks, shared_zero_run_numbers
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Input, may_end_its_run
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.foreign_calls import is_stop_request
from dsa_des.block.message import Message
from dsa_des.block.shadowed_packages import load_unnamed_entry_point
from dsa_des.errors import Problem, SceneError
from dsa_des.running.channel import Inputs
from dsa_des.running.node import Node
from dsa_des.running.simulation import Simulation, block_failure
from dsa_des.scene.graph import loop_number_by_block
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire as WireOfScene
from dsa_des.time.clock import MAX_TICK, ScanCursor, parse_rational

EMBED = "dsa_des.embed"

#: A host may add up so many steps of its own from one call to the next, or in a second.
_SUBSTEPS = 16
_STEPS_PER_S = 1000
#: What a time may be off a scan that is meant: never more than this part of the host's step.
_NEAR = 100

_FIRST_ROW = np.zeros(1, dtype=np.int64)
_NO_ROW = np.empty(0, dtype=np.int64)
_NO_SCAN = np.full(1, -1, dtype=np.int64)
for _constant in (_FIRST_ROW, _NO_ROW, _NO_SCAN):
    _constant.flags.writeable = False


def __getattr__(name: str) -> Any:
    if name in entry_points_of(EMBED):
        return load_unnamed_entry_point(entry_points_of(EMBED)[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


@dataclass
class Step:
    """What one call by the host did: which scans the blocks made, and which messages they sent.

    Parameters
    ----------
    tick : int
    scans : dict of int
        Number of the scan that each due block made.
    missed : dict of int
        How many earlier scans of it fell between the calls and were not made; zeros are left out.
    sent : dict of Message
        By block, or by block and output where it has several: (block, output) pairs.
    """

    tick: int
    scans: dict[str, int]
    missed: dict[str, int]
    sent: dict[tuple[str, str], Message] = field(default_factory=dict)

    def of(self, block: str) -> Any:
        """Return a block's message in this step (of the first output), or None if none was sent."""
        for (name, _), message in self.sent.items():
            if name == block:
                return message
        return None


class _Wire:
    """One wire into a block: keeps the last message, or all messages since its last run."""

    def __init__(self, sender: tuple[str, str], declared: Input) -> None:
        self.sender, self.source = sender, sender[0]
        self.held, self.trigger = declared.is_held, declared.mode == "trigger"
        self._last: Message | None = None
        self._waiting: list[tuple[int, Message]] = []

    def push(self, tick: int, message: Message) -> None:
        """Store a message that arrives: in place of the last one, or at the end of the queue."""
        if self.held:
            self._last = message
        else:
            self._waiting.append((tick, message))

    def held_rows_at_instants(self, asked: RunTicks, end: int) -> tuple[Message, IntArray] | None:
        """Return the last message and the index of its last row; None if none has arrived."""
        return None if self._last is None else (self._last, _index_of_last_row(self._last))

    def pop_arrived_rows(self, end: int) -> tuple[RunTicks, Message] | None:
        """Empty the queue; return its messages as one, with arrival instants; None if empty."""
        if not self._waiting:
            return None
        messages = [message for _, message in self._waiting]
        ticks = [np.array([tick] * len(message)) for tick, message in self._waiting]
        self._waiting.clear()
        message = type(messages[0]).concatenate(messages)
        return RunTicks(message.run, np.concatenate(ticks)), message


class _Runner:
    """One block with its wires."""

    def __init__(self, node: Node, cursor: ScanCursor | None, wires: Iterable[WireOfScene]) -> None:
        component = self.component = node.component
        self.name, self.cursor = component.name, cursor
        self.before = None if node.clock is None else node.clock.previous_ticks
        self.pulse = None if node.pulse is None else ScanCursor(node.pulse.first_run_clock)
        self.demands = [] if cursor else [demand.block for demand in node.demands]
        into: dict[str, list[_Wire]] = {}
        for wire in wires:
            if wire.target == self.name:
                end = _Wire((wire.source, wire.output), component.inputs[wire.input])
                into.setdefault(wire.input, []).append(end)
        self.wires = [wire for ends in into.values() for wire in ends]
        self.inputs = Inputs(component.inputs, into, node.simulation.ticks_per_s)
        self.only_output = next(iter(component.outputs)) if len(component.outputs) == 1 else None


class HostDriven:
    """An open-loop scene that runs when it is called.

    Parameters
    ----------
    scene : Scene
    source : str
        The block in whose place the host speaks: it runs on demand, and its `Component.run` is
        never called.
    wanted : iterable of str, optional
        Blocks whose messages the host wants: those that they do not depend on never run. By
        default all.

    Raises
    ------
    SceneError
        If the scene has what only an event queue can serve: feedback, wires with delay, jitter or
        loss, latencies, shared processors, blocks with a process of their own, other sources.
    """

    def __init__(self, scene: Scene, source: str, wanted: Iterable[str] | None = None) -> None:
        problems = list(_unsupported_parts(scene, source))
        if problems:
            raise SceneError(problems)
        self.scene = scene
        self.source = source
        self.simulation = Simulation(scene)
        self.ticks_per_s = scene.ticks_per_s
        self.components = self.simulation.components
        #: Tick of the last call, -1 before the first.
        self.last_tick = -1
        self._calls, self._first_tick = 0, 0
        names = set(scene.blocks) if wanted is None else set(wanted)
        self._runners = self._make_runners(names.union(*(ancestors(scene.graph, n) for n in names)))
        self._cursors = {r.name: r.cursor for r in self._runners if r.cursor is not None}
        self._source_key = (source, next(iter(self.components[source].outputs)))

    def _make_runners(self, needed: Set[str]) -> list[_Runner]:
        nodes = self.simulation.nodes
        runners = []
        for name in sorted(nodes, key=lambda name: nodes[name].priority()):
            node = nodes[name]
            if name == self.source or name not in needed:
                continue
            cursor = None if node.clock is None else ScanCursor(node.clock.first_run_clock)
            runners.append(_Runner(node, cursor, self.scene.wires))
        return runners

    # -- time ----------------------------------------------------------------------------------

    def tick_of(self, time_s: object) -> int:
        """Return the tick nearest to a time: a number, or a text such as "1/3".

        A number that lies as near to a scan as its own rounding, and that of all steps added up,
        may have led it means that scan. ValueError if it is not finite and from 0 on, or too large
        for 64-bit ticks.
        """
        ulp_s = 0.0
        if isinstance(time_s, float | np.floating):
            ulp_s = float(np.spacing(time_s)) if math.isfinite(time_s) else 0.0
            time_s = float(time_s)
        if isinstance(time_s, float):  # the usual case, without a Fraction
            ticks = time_s * self.ticks_per_s
            if not math.isfinite(time_s):
                raise ValueError(f"time_s is {time_s}: it must be a finite number of seconds")
            # A float of seconds is meant as the decimal it was written as; above 2^53 ticks the
            # product is no longer whole ticks and Python's integers decide.
            tick = (
                round(ticks) if abs(ticks) < 2**53 else round(Fraction(time_s) * self.ticks_per_s)
            )
        else:
            if isinstance(time_s, np.generic):
                time_s = time_s.item()
            try:
                tick = round(parse_rational(time_s) * self.ticks_per_s)
            except ValueError as error:
                raise ValueError(f"time_s is {time_s!r}: it {error}") from None
        if not 0 <= tick < MAX_TICK:
            raise ValueError(
                f"time_s is {time_s}: it must lie from 0 to {MAX_TICK / self.ticks_per_s:g}"
            )
        elapsed = tick - self._first_tick if self._calls else 0
        steps = max(_SUBSTEPS * self._calls, _STEPS_PER_S * elapsed // self.ticks_per_s)
        drift = int((1 + steps) * ulp_s * self.ticks_per_s)
        return self._snap_to_scan(tick, drift) if drift else tick

    def _snap_to_scan(self, tick: int, drift: int) -> int:
        """Return the tick of the block's scan within `drift` of the given tick, or that tick."""
        if self.last_tick - drift <= tick < self.last_tick:
            return self.last_tick  # that scan was made already
        drift = min(drift, (tick - self.last_tick) // _NEAR)
        scans = [cursor.next_scan_tick(tick - drift - 1) for cursor in self._cursors.values()]
        scan = min(scans, key=lambda at: abs(at - tick), default=tick)
        return scan if abs(scan - tick) <= drift else tick

    def next_scan_s(self, after_s: object = None) -> float:
        """Return the time of the first scan of any block after a time, s.

        That is by default the last call's; before the first call that is the very first scan.
        """
        return self.next_scan_after_tick_s(
            self.last_tick if after_s is None else self.tick_of(after_s)
        )

    def next_scan_after_tick_s(self, after: int) -> float:
        """Return the time, s, of the first scan of any block after the tick `after`."""
        return (
            min(cursor.next_scan_tick(after) for cursor in self._cursors.values())
            / self.ticks_per_s
        )

    def start_step(self, tick: int) -> Step:
        """Move clocks on to `tick`; return a step with each block's scan and missed scans.

        Of the scans since the last call each block makes its latest one, now: a call takes as long
        as one scan of each, however long ago the last one was. The first call makes the scans of
        its own instant only.

        ValueError if `tick` lies before the last call's.
        """
        if tick < self.last_tick:
            raise ValueError(
                f"time_s is {tick / self.ticks_per_s:g}: it must not go back, the last call was at "
                f"{self.last_tick / self.ticks_per_s:g}"
            )
        if self.last_tick < 0 < tick:
            self._first_tick = tick
            for cursor in self._cursors.values():
                cursor.seek(tick)
        self.last_tick = tick
        self._calls += 1
        scans: dict[str, int] = {}
        missed: dict[str, int] = {}
        for name, cursor in self._cursors.items():
            due = cursor.pop_due_scan(tick)
            if due is not None:
                scans[name], late = due
                if late:
                    missed[name] = late
        return Step(tick, scans, missed)

    # -- running -------------------------------------------------------------------------------

    def run(self, step: Step, message: Message) -> Step:
        """Run every block that is due, and what they trigger, on the source's message.

        The message is one row at ``step.tick``; what blocks send is put into the step, which is
        from `due`. BlockFailure if a block raised an exception.
        """
        sent, scans, tick = step.sent, step.scans, step.tick
        sent[self._source_key] = message
        now = RunTicks(shared_zero_run_numbers(1), np.array([tick], dtype=np.int64))
        for runner in self._runners:
            triggered = False
            for wire in runner.wires:
                new = sent.get(wire.sender)
                if new is not None:
                    triggered = triggered or wire.trigger
                    wire.push(tick, new)
            scan = scans.get(runner.name)
            idle = None
            if runner.pulse is not None:
                # It acts at the first call at or after each of its instants.
                acts = runner.pulse.pop_due_scan(tick) is not None
                idle = np.array([scan is None and not triggered])
                triggered = triggered or acts
            if scan is None and not triggered:
                continue
            own = _NO_SCAN if scan is None else np.array([scan], dtype=np.int64)
            demand = partial(_scanning_rows, runner.demands, scans) if runner.demands else None
            wake = runner.inputs.make_wake(
                now, own, tick + 1, demand, clock=runner.before, idle=idle
            )
            if wake is None:
                continue
            try:
                result = runner.component.run(wake)
            except BaseException as error:
                if is_stop_request(error):
                    raise
                time_s = tick / self.ticks_per_s
                raise block_failure(runner.component, time_s, error, scan) from error
            if result is None:
                continue
            if isinstance(result, Message):
                assert runner.only_output is not None
                result = {runner.only_output: result}
            for output, given in result.items():
                if len(given.tick):
                    given.check()
                    sent[runner.name, output] = given
        return step


def _index_of_last_row(message: Message) -> IntArray:
    count = len(message.tick)
    return _FIRST_ROW if count == 1 else np.array([count - 1])


def _scanning_rows(
    blocks: Iterable[str], scanning: Container[str], asked: RunTicks
) -> dict[str, IntArray]:
    """Return for each block the row index 0 if it scans in this step, else no index."""
    return {name: _FIRST_ROW if name in scanning else _NO_ROW for name in blocks}


def _unsupported_parts(scene: Scene, source: str) -> list[Problem]:
    """Return a problem for each part that a host cannot drive as it needs an event queue."""
    refusals: list[tuple[str, str]] = []
    looped = loop_number_by_block(scene.graph)
    if looped:
        refusals.append(("wires", f"feedback between {', '.join(sorted(looped))}"))
    if scene.changes:
        refusals.append(("changes", "something that changes while it runs"))
    if scene.outages:
        refusals.append(("outages", "blocks that fail at random"))
    for wire in scene.wires:
        if wire.is_delayed or wire.jitter_s or wire.drop_probability:
            refusals.append(("wires", f"{wire} has a delay, jitter, latency or loss"))
    for name, block in scene.blocks.items():
        if block.options.processor is not None:
            message = f"its messages queue for processor {block.options.processor!r}"
            refusals.append((f"blocks.{name}", message))
        if block.cls.process is not None:
            refusals.append((f"blocks.{name}", "it has a process of its own"))
        if may_end_its_run(block.cls):
            refusals.append((f"blocks.{name}", "it ends its run, and a host ends when it likes"))
        fed = any(port.required for port in block.cls.inputs.values())
        if not fed and name != source:
            refusals.append((f"blocks.{name}", f"it is a second source beside {source!r}"))
    why = "; a host drives an open-loop scene only: every message at the instant of the call"
    return [Problem(str(scene.path), key, message + why) for key, message in refusals]
