"""One run of one scene: blocks are built, connected, and driven window by window.

The run advances in windows [start, end) of ticks. Blocks that may look ahead handle a whole window
at its start; all others run at their own ticks inside it. Which grain a block runs at changes
nothing that is recorded.
"""

import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import count, pairwise
from typing import Any

import numpy as np
import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Consumer, Context, Producer
from dsa_des.block.message import Message
from dsa_des.block.strangers import is_ours_to_obey, told
from dsa_des.errors import BlockFailure, Problem, SceneError, SetupFailure
from dsa_des.record.recording import Recorder
from dsa_des.running.connections import check_reach, connect
from dsa_des.running.effect_plan import Planned, plan, unspent
from dsa_des.running.node import DEPTH_PRIORITY, WINDOW_PRIORITY, Abort, Node
from dsa_des.running.pinpoint import pinpoint
from dsa_des.running.processors import Processing, Processor, Service
from dsa_des.running.rewind import cannot_rewind, cut_loops, rewinding_windows, telling_order
from dsa_des.running.rewind_check import Witness
from dsa_des.running.run_state import RunningBlock
from dsa_des.running.timing_effects import timing_plan
from dsa_des.running.windowed_queue import WindowedQueue
from dsa_des.scene.graph import depths, in_cycles, queue_key, window_order
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import MAX_TICK, ScanClock
from dsa_des.time.randomness import Streams
from dsa_des.time.timeline import ReplicaTime

# A window of about this many target-scans keeps NumPy's calls long and its arrays in cache.
CELLS_PER_WINDOW = 131072
# At a microsecond each, the fewest that anything takes, eleven days.
_MOST_SCANS = 1e12
# What a block raises, before anything runs, because of what its table says: nothing it can be
# made of, or nothing that can be computed or held in memory.
_REFUSALS = (ValueError, OSError, ArithmeticError, MemoryError)


@dataclass
class Outcome:
    """What a run came to.

    Parameters
    ----------
    duration_s : float
        Simulated time.
    cpu_s : float
        Processor time of the simulation itself.
    windowed : list of str
        Blocks that ran in look-ahead windows.
    components : mapping
        The blocks, for `report`.
    """

    duration_s: float
    cpu_s: float
    windowed: list[str]
    components: Mapping[str, Component]

    @cached_property
    def report(self) -> dict[str, Any]:
        """Sections of the summary that blocks gave (`Component.report`), made when asked for."""
        sections: dict[str, Any] = {}
        for name, component in self.components.items():
            try:
                for section, content in component.report().items():
                    sections.setdefault(section, {}).update(content)
            except BaseException as error:
                if is_ours_to_obey(error):
                    raise
                raise _failure(name, type(component), self.duration_s, error) from error
        return sections


class Simulation:
    """A scene made ready to run once.

    Parameters
    ----------
    scene : Scene
    window : int, optional
        Most scans (of all clocks together) in a look-ahead window; 1 runs every block scan by
        scan. By default sized by the number of targets.
    shuffle_ties : int, optional
        Seed that randomises the order of blocks within one depth, to show that nothing depends
        on it.
    recorder : Recorder, optional
    trace : list, optional
        Receives ``(tick, block)`` for every instant a block runs at, in order of execution.
    simulate_everything : bool
        Build also the effects that the scene does not call for, where they can be neutral.
    wrap_effect : callable, optional
        Given each planned effect and what was built of it, returns what is used instead.
    cuts : iterable of int
        Ticks at which look-ahead windows are cut in two; results do not depend on them.
    check_rewinding : bool
        Run every window a second time from its saved state and compare all that blocks send and
        remember; the first that did something else is the `BlockFailure` of the run.

    Raises
    ------
    SceneError
        If the scene has no length, a block cannot be set up, or `check_rewinding` is asked for
        where a block cannot be rewound.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        window: int | None = None,
        shuffle_ties: int | None = None,
        recorder: Recorder | None = None,
        trace: list[tuple[int, str]] | None = None,
        simulate_everything: bool = False,
        wrap_effect: Callable[[Planned, Any], Any] | None = None,
        cuts: Iterable[int] = (),
        check_rewinding: bool = False,
    ) -> None:
        if window is not None and window < 1:
            raise ValueError(f"window is {window}: it must be 1 or more scans")
        self.scene = scene
        self.recorder = recorder
        self.trace = trace
        self.ticks_per_s = scene.ticks_per_s
        self.env = simpy.Environment(initial_time=0)
        self.window = (0, 0)
        self.failure: tuple[BlockFailure, BaseException] | None = None
        #: The instants of the call in which a block failed.
        self.failed_at = np.empty(0, dtype=np.int64)
        self._window = window
        self._everything = simulate_everything
        self._has_run = False
        self.cuts = sorted(cuts)
        self._depth = depths(scene.graph)
        #: Blocks that cannot be rewound, and why: with one of them, loops run scan by scan.
        queued = {name for name, block in scene.blocks.items() if block.options.processor}
        self.unwound = cannot_rewind(scene.classes, queued)
        loops = bool(in_cycles(scene.graph))
        self._rewinds = window != 1 and not self.unwound and (loops or check_rewinding)
        if check_rewinding and not self._rewinds:
            raise self._nothing_rewinds()
        self.cut_edges = cut_loops(scene.graph, scene.classes) if self._rewinds else set()
        self._place = telling_order(scene.graph, scene.classes)
        self.streams = self._make_streams()
        self.components = self._build_components(simulate_everything)
        self.duration_s = self._duration()
        self._offer_down_the_chain()
        self.plan = self._plan_effects(simulate_everything, wrap_effect)
        self._set_up_components()
        self.nodes = self._build_nodes(window, shuffle_ties)
        self.witness = Witness(self.components.values()) if check_rewinding else None
        if self.witness is not None:
            for node in self.nodes.values():
                node.runner = self.witness.runner(node.component)
        connect(scene, self.nodes, self.replicas, everything=simulate_everything)
        if self.replicas is None:  # replicas in lock step were judged one by one
            check_reach(scene, self.nodes, self.end_tick)
            self._refuse_endless_work()
        self.window_ticks = self._window_length(window)

    #: Whether a failure inside a window is traced to its instant by running the scene again.
    pinpoints = True
    #: When replicas share this run (`dsa_des.replicas.lockstep`): how they lie on its timeline.
    replicas: ReplicaTime | None = None

    @property
    def span_ticks(self) -> int:
        """Ticks from one replica's start to the next; 0 for a single run."""
        return 0 if self.replicas is None else self.replicas.span_ticks

    def _nothing_rewinds(self) -> SceneError:
        said = "check_rewinding: nothing is rewound in this scene"
        if not self.unwound:
            return SceneError([self._problem("blocks", f"{said} with a window of one scan")])
        return SceneError(
            self._problem(f"blocks.{name}.type", f"{said}: {self.scene.classes[name].path()} {why}")
            for name, why in self.unwound.items()
        )

    # -- building ------------------------------------------------------------------------------

    def _make_streams(self) -> Streams:
        return Streams(self.scene.seed)

    def _build_components(self, simulate_everything: bool) -> dict[str, Component]:
        components: dict[str, Component] = {}
        problems: list[Problem] = []
        for name, block in self.scene.blocks.items():
            context = Context(
                self.streams,
                self.ticks_per_s,
                sections=self.scene.sections,
                simulate_everything=simulate_everything,
            )
            with self._preparing(name, problems):
                components[name] = block.cls(name, self._parameters(name), context)
        if problems:
            raise SceneError(problems)
        return components

    @contextmanager
    def _preparing(self, name: str, problems: list[Problem]) -> Iterator[None]:
        """Make what a block raises before the run an error that names it."""
        try:
            yield
        except (SceneError, BlockFailure):
            raise
        except _REFUSALS as error:
            problems.append(self._problem(f"blocks.{name}", reason_of(error)))
        except BaseException as error:
            if is_ours_to_obey(error):
                raise
            path = self.scene.blocks[name].cls.path()
            raise SetupFailure(name, path, 0.0, None, told(error)) from error

    def _asked(self, name: str, what: str, *arguments: Any) -> Any:
        """Return what a method of a block returns before the run."""
        problems: list[Problem] = []
        answer = None
        with self._preparing(name, problems):
            answer = getattr(self.components[name], what)(*arguments)
        if problems:
            raise SceneError(problems)
        return answer

    def _parameters(self, name: str) -> Any:
        return self.scene.blocks[name].parameters

    def _problem(self, key: str, what: object) -> Problem:
        return Problem(str(self.scene.path), key, str(what))

    def _duration(self) -> Fraction:
        if self.scene.duration_s is not None:
            return self.scene.duration_s
        lengths = [self._asked(name, "natural_duration_s") for name in self.components]
        known = [length for length in lengths if length is not None]
        if not known:
            message = "is required: no block of this scene has a length of its own"
            raise SceneError([self._problem("duration_s", message)])
        longest = max(known)
        if longest * self.ticks_per_s >= MAX_TICK:
            message = f"is {float(longest):.4g} s by the data of its blocks: give a shorter one"
            raise SceneError([self._problem("duration_s", message)])
        return longest

    def _offer_down_the_chain(self) -> None:
        """Tell every block what its producers offer, sources first: a block may pass it on.

        It comes before effects are planned, so that a verdict may rest on it.
        """
        for name in sorted(self.components, key=lambda name: (self._place[name], name)):
            self.components[name].context.producers = [
                Producer(wire.source, wire.input, self._asked(wire.source, "offer", wire.output))
                for wire in self.scene.wires
                if wire.target == name
            ]

    def _plan_effects(
        self, everything: bool, wrap: Callable[[Planned, Any], Any] | None
    ) -> list[Planned]:
        """Decide which effects exist in this run and build them."""
        planned: list[Planned] = []
        problems: list[Problem] = []
        for name, component in self.components.items():
            component.context.duration_s = self.duration_s
            known = len(problems)
            with self._preparing(name, problems):
                found = plan(component, self.scene.tolerance, everything=everything)
                built = {i: i.effect.build(component) for i in found if i.built}
            if len(problems) > known:
                continue
            planned += found
            if not everything:
                component.context.tolerance = unspent(found, self.scene.tolerance)
            component.context.effects = {
                item.effect.name: effect if wrap is None else wrap(item, effect)
                for item, effect in built.items()
            }
        if problems:
            raise SceneError(problems)
        return planned

    def _set_up_components(self) -> None:
        problems: list[Problem] = []
        for name in sorted(self.components, key=lambda name: (-self._place[name], name)):
            component = self.components[name]
            component.context.consumers = [
                Consumer(wire.target, wire.input, self._asked(wire.target, "request", wire.input))
                for wire in self.scene.wires
                if wire.source == name
            ]
            with self._preparing(name, problems):
                component.setup()
        if problems:
            raise SceneError(problems)

    def _build_nodes(self, window: int | None, shuffle_ties: int | None) -> dict[str, Node]:
        graph = self.scene.graph
        windowed = set() if window == 1 else self.scene.look_ahead_blocks()
        if self._rewinds:
            windowed = set(self.components)
        at_once = set() if window == 1 else self.scene.windowed_queues()
        queues = {name: self.scene.queues[name] for name in at_once}
        order = window_order(graph, windowed, self.cut_edges, queues)
        processors = self._build_processors(order)
        shuffle = None if shuffle_ties is None else random.Random(shuffle_ties)
        nodes = {}
        for number, (name, component) in enumerate(sorted(self.components.items())):
            base = (
                WINDOW_PRIORITY + order[name]
                if name in windowed
                else DEPTH_PRIORITY + self._depth[name]
            )
            by_name = base + number / (len(self.components) + 1)
            node = Node(self, component, name in windowed, _priority(base, by_name, shuffle))
            node.clock = self._clock(name, component)
            node.processor = processors.get(self.scene.blocks[name].options.processor or "")
            node.on_demand = component.clocked == "demand" and node.clock is None
            nodes[name] = node
        return nodes

    def _clock(self, name: str, component: Component) -> ScanClock | None:
        spec = component.clock_of(component.p)
        if spec is None:
            return None
        return ScanClock(
            spec,
            self.ticks_per_s,
            self.streams.scan_normals(name, "clock jitter"),
            always_draws=self._everything,
        )

    def _build_processors(self, order: Mapping[str, int]) -> dict[str, Processor | WindowedQueue]:
        """Start the shared processors of the scene: in `order` those that serve windows."""
        streams = Streams(self.scene.seed)
        processors: dict[str, Processor | WindowedQueue] = {}
        for name, p in self.scene.processors.items():
            try:
                service = Service(name, p, self.ticks_per_s, streams.stream(name, "service time"))
            except ValueError as error:
                raise SceneError([self._problem("processors", error)]) from error
            depth = order.get(queue_key(name))
            if depth is None:
                processors[name] = Processor(
                    name, p, service, self.env, self.ticks_per_s, self._record
                )
            else:
                processors[name] = WindowedQueue(
                    name,
                    service,
                    p.when_busy == "drop_oldest",
                    self.env,
                    self.ticks_per_s,
                    self.end_tick,
                    self._record,
                    WINDOW_PRIORITY + depth,
                )
            processors[name].start()
        return processors

    def _record(self, block: str, message: Message) -> None:
        if self.recorder is not None:
            self.recorder.record(block, message)

    @property
    def timing_plan(self) -> list[Planned]:
        """Which effects of time exist in this run: latencies, wires, clocks, processors."""
        return timing_plan(self.scene, everything=self._everything)

    @property
    def scans(self) -> float:
        """How many scans of all clocks together the run has, about."""
        clocks = [node.clock for node in self.nodes.values() if node.clock is not None]
        return float(sum(self.end_tick / clock.period for clock in clocks))

    def _refuse_endless_work(self) -> None:
        if self.scans > _MOST_SCANS:
            message = (
                f"is {float(self.duration_s):.4g} s, in which the clocks of this scene make "
                f"{self.scans:.2g} scans: at most {_MOST_SCANS:.0e} are simulated"
            )
            raise SceneError([self._problem("duration_s", message)])

    def _window_length(self, window: int | None) -> int:
        """Return the ticks of a window that holds about the wanted number of scans."""
        width = max(component.width for component in self.components.values())
        scans = window if window not in (None, 1) else max(1, CELLS_PER_WINDOW // max(1, width))
        clocks = [node.clock for node in self.nodes.values() if node.clock is not None]
        if not clocks:
            return self.end_tick
        scans_per_tick = sum(1 / clock.period for clock in clocks)
        return max(1, int(scans / scans_per_tick))

    def limit_windows(self, longest_s: float) -> None:
        """Let no look-ahead window be longer than this simulated time; results stay the same."""
        longest = max(1, int(min(longest_s * self.ticks_per_s, self.end_tick)))
        self.window_ticks = min(self.window_ticks, longest)

    # -- running -------------------------------------------------------------------------------

    @property
    def end_tick(self) -> int:
        """First tick that is no longer simulated: runs cover [0, T)."""
        ticks = self.duration_s * self.ticks_per_s
        return -(-ticks.numerator // ticks.denominator)

    def run(self, progress: Callable[[float], None] | None = None) -> Outcome:
        """Run the scene to its end.

        Parameters
        ----------
        progress : callable, optional
            Called with the simulated time in s after each window.

        Raises
        ------
        RuntimeError
            If it has run before.
        SceneError
            If a block waits for a host program.
        BlockFailure
            If a block raised an exception.
        """
        hosted = [
            self._problem(f"blocks.{name}.type", component.needs_host)
            for name, component in self.components.items()
            if component.needs_host
        ]
        if hosted:
            raise SceneError(hosted)
        if self._has_run:
            raise RuntimeError(
                "a simulation runs once, and this one has run: its blocks hold what they have "
                "seen; make another Simulation of the scene to run it again"
            )
        self._has_run = True
        started = time.process_time()
        end = self.end_tick
        if self.recorder is not None:
            outputs = [o for c in self.components.values() for o in c.outputs.values()]
            messages: list[type[Message]] = [output.message for output in outputs]
            if self.scene.processors:
                messages.append(Processing)
            self.recorder.open(messages, self.ticks_per_s, self.span_ticks)
        for node in self.nodes.values():
            node.start()
        for window in rewinding_windows(self, end) if self._rewinds else self._windows(end):
            if not self._rewinds:
                self.window = window
                self.run_window(*window)
            if self.recorder is not None:
                self.recorder.advance(self.window[1])
            if progress is not None:
                progress(self.window[1] / self.ticks_per_s)
        if self.recorder is not None:
            self.recorder.close()
        return Outcome(
            float(self.duration_s),
            time.process_time() - started,
            sorted(name for name, node in self.nodes.items() if node.windowed),
            self.components,
        )

    def _windows(self, end: int) -> Iterator[tuple[int, int]]:
        for number in count():
            start = number * self.window_ticks
            if start >= end:
                return
            stop = min(start + self.window_ticks, end)
            inner = [cut for cut in self.cuts if start < cut < stop]
            yield from pairwise([start, *inner, stop])

    def raise_failure(self) -> None:
        """Raise what a block raised in a window that may be rewound, if one did."""
        if self.failure is not None:
            failure, cause = self.failure
            raise failure from cause

    def run_window(self, start: int, end: int) -> None:
        """Run every block over [start, end)."""
        if self.witness is not None:
            self.witness.begin()
        for node in self.nodes.values():
            node.open_window(start, end)
        try:
            # A window that may be rewound leaves the clock at its start, where all of it runs.
            self.env.run(until=None if self._rewinds else end)
        except Abort:
            if self.failure is None:
                raise
            failure, cause = self.failure
            if self.pinpoints and len(self.failed_at) > 1 and not self.cuts:
                exact = pinpoint(self._again, self.failed_at)
                if exact is not None:
                    raise exact from exact.__cause__
            raise failure from cause

    def _again(self, cuts: set[int]) -> "Simulation":
        return Simulation(self.scene, window=self._window, cuts=cuts)

    def fail(
        self, node: RunningBlock, ticks: IntArray, error: BaseException, scan: int = -1
    ) -> None:
        """Note that a block raised when it handled `ticks`, and leave SimPy."""
        if self.failure is not None:
            return  # a window that may be rewound goes on; the first failure counts
        self.failed_at = ticks
        time_s = int(ticks[0]) / self.ticks_per_s
        failure = _failure(node.name, type(node.component), time_s, error, scan)
        self.failure = (failure, error)
        if not self._rewinds:
            raise Abort


def reason_of(error: BaseException) -> str:
    """Return what an exception says, with its kind where its text alone says little."""
    if isinstance(error, ArithmeticError):
        return f"its numbers are too large or too small to be computed with ({error})"
    if isinstance(error, MemoryError):
        return f"needs more memory than there is ({error})" if str(error) else "needs more memory"
    return str(error)


def _failure(
    name: str, cls: type[Component], time_s: float, error: BaseException, scan: int = -1
) -> BlockFailure:
    return BlockFailure(name, cls.path(), time_s, scan if scan >= 0 else None, told(error))


def _priority(base: float, by_name: float, shuffle: random.Random | None) -> Callable[[], float]:
    if shuffle is None:
        return lambda: by_name
    return lambda: base + shuffle.random()
