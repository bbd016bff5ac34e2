"""One run of one scene: blocks are built, connected, and driven window by window.

The run advances in windows [start, end) of ticks. Blocks that may look ahead handle a whole window
at its start; all others run at their own ticks inside it. Which grain a block runs at changes
nothing that is recorded. Which windows there are is asked of them (`dsa_des.running.windows`), and
whether one run goes through them or many of its timeline (`dsa_des.running.timeline`).
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, may_end_its_run
from dsa_des.block.foreign_calls import error_text_with_line, is_stop_request
from dsa_des.block.message import Message
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.failure_counts import FailureCounts, FailuresByRun, sum_counts_over_runs
from dsa_des.record.recording import NotRecordedError, Recorder
from dsa_des.running.assembly import Assembly
from dsa_des.running.effects import Planned, WrapEffect, plan_timing_effects
from dsa_des.running.events import Abort
from dsa_des.running.grain import refuse_endless_work, scans_per_run, window_length_ticks
from dsa_des.running.nodes import (
    build_nodes,
    build_processors,
    check_latest_arrival_fits,
    connect_nodes,
    shortest_delay_ticks,
)
from dsa_des.running.pacing import Pacer
from dsa_des.running.processors import Processing
from dsa_des.running.timeline import Timeline
from dsa_des.running.windows import Failure, Rewinder, RunningBlock, Window, Windows
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import MAX_TICK

#: Up to so many scans a run that failed in a window is run again, to say at which of them.
_MOST_SCANS_AGAIN = 20_000


@dataclass
class Outcome:
    """The result of a run: its length, CPU time, final components and failures.

    Of runs that share a timeline, `duration_s` is the longest it may be. `windowed` are the blocks
    that ran in look-ahead windows; `components` speak for the whole run. `failures_by_run` is what
    blocks could not do.
    """

    duration_s: float
    cpu_s: float
    windowed: list[str]
    components: Mapping[str, Component]
    failures_by_run: FailuresByRun

    @cached_property
    def failure_counts(self) -> FailureCounts:
        """Block → kind of failure → (failed, attempts), summed over all runs."""
        return sum_counts_over_runs(self.failures_by_run, slice(None))

    @cached_property
    def report(self) -> dict[str, Any]:
        """Summary sections that blocks return from `Component.report`, made at the first access."""
        sections: dict[str, Any] = {}
        for component in self.components.values():
            try:
                for section, content in component.report().items():
                    sections.setdefault(section, {}).update(content)
            except BaseException as error:
                if is_stop_request(error):
                    raise
                raise block_failure(component, self.duration_s, error) from error
        return sections


class Simulation:
    """A scene that is set up and can be run once.

    By default there is one run of the scene (`timeline`), and windows are sized by the number of
    targets: `window` is the most scans of all clocks together in one; 1 runs every block scan by
    scan. `shuffle_ties` is a seed that randomises the order of blocks within one depth, to show
    that nothing depends on it. `simulate_everything` builds also the effects that the scene does
    not call for, where they can be neutral; `wrap_effect`, given each planned effect and what was
    built of it, returns what is used instead. A `SceneError` says why the scene has no length, or
    which block cannot be set up.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        timeline: Timeline | None = None,
        window: int | None = None,
        shuffle_ties: int | None = None,
        recorder: Recorder | None = None,
        simulate_everything: bool = False,
        wrap_effect: WrapEffect | None = None,
    ) -> None:
        if window is not None and window < 1:
            raise ValueError(f"window is {window}: it must be 1 or more scans")
        self.scene = scene
        self._everything = simulate_everything
        if timeline is None:
            timeline = Timeline(scene, everything=simulate_everything)
        self.timeline = timeline
        self.recorder = recorder
        self.ticks_per_s = scene.ticks_per_s
        self.env = simpy.Environment(initial_time=0)
        self.window = Window(0, 0, 0)
        #: What a block raised in the window that runs now.
        self.failure: Failure | None = None
        self._has_run = False
        grain = self.timeline.grain(window)
        #: Where blocks are kept from looking ahead: which ones are the reason, and why each.
        self.slow = grain.slow
        assembly = Assembly(
            scene, timeline, recorder, simulate_everything, wrap_effect, grain.rewinds
        )
        self.components: Mapping[str, Component] = assembly.components
        #: What carries each block; nothing where one carries all, and that is the first of all.
        self.platforms = assembly.platforms if assembly.is_shared else {}
        #: The blocks of each stretch of time between two changes, and what became of their effects.
        self.stretches, self.plans = assembly.stretches, assembly.plans
        self.unheard = assembly.unheard
        self.duration_s: Fraction = assembly.duration_s
        self.plan = self.plans[0]
        self.timeline.set_length(self.components, self.duration_s)
        #: How the runs lie in time, and when they end.
        self.runs = self.timeline.runs
        self._refuse_early_ends_with_processors()
        self._processors = build_processors(timeline, grain, self.env, self._record)
        self.nodes = build_nodes(
            self, self.timeline, self.stretches, grain, self._processors, shuffle_ties
        )
        connect_nodes(scene, self.nodes, self.timeline)
        check_latest_arrival_fits(scene, self.nodes, self.runs.run_ticks)
        #: How many scans of all clocks together a run has, about.
        self.scans = scans_per_run(self.nodes, self.runs)
        refuse_endless_work(scene, self.scans, float(self.duration_s))
        rewinder = None
        if grain.rewinds:
            rewinder = Rewinder(self.nodes.values(), grain.cut_edges, recorder, self.runs)
        longest = window_length_ticks(self.nodes, self.runs, window)
        #: Which windows the run goes through.
        self.windows: Windows = self.timeline.windows(
            longest, self.scans, shortest_delay_ticks(self.nodes, grain.cut_edges), rewinder
        )

    @property
    def timing_plan(self) -> list[Planned]:
        """Which timing effects (latency, wire, clock) are simulated at the run's start, and why."""
        return self.timing_plan_of(0)

    def timing_plan_of(self, stretch: int) -> list[Planned]:
        """Return the timing effects simulated in a stretch of the scene and why; 0 is the first."""
        scene = self.scene.stretches[stretch - 1].scene if stretch else self.scene
        return plan_timing_effects(scene, everything=self._everything)

    @property
    def end_tick(self) -> int:
        """First tick that is no longer simulated: runs cover [0, T)."""
        return self.runs.run_ticks

    def run(
        self, progress: Callable[[float], None] | None = None, pacer: Pacer | None = None
    ) -> Outcome:
        """Run the scene to its end.

        `progress` is called with the simulated time in s after each window; `pacer` waits for the
        wall clock after each window, which it keeps short, and may stop the run. Raised are
        `BlockFailure` for what a block raised, `SceneError` if one waits for a host program, and
        `RuntimeError` if it has run before.
        """
        self._check_ready()
        started = time.process_time()
        self._open_recorder()
        going = range(0)
        if pacer is not None:
            self.windows.limit_length(int(pacer.longest_window_s * self.ticks_per_s))
            pacer.start()
        else:
            self.windows.next_instant = self._lower_bound_of_next_run
        while (window := self.windows.next()) is not None:
            if pacer is not None and pacer.stopped:
                break
            if self.runs.going != going:
                going = self.runs.going
                self._start(going)
            if self.runs.have_all_ended(window.start):
                if going.stop == self.runs.count:
                    break
                self.windows.commit(window, None)  # nothing is left to run in it
                continue
            failure = self.run_window(window)
            final = self.windows.commit(window, failure)
            if final is None:
                continue
            if failure is not None:
                self._raise_with_exact_instant(failure)
            if self.recorder is not None:
                self._call_recorder(
                    self.recorder.flush_if_large, *self.runs.rows_complete_before(final, going)
                )
            if pacer is not None:
                pacer(final / self.ticks_per_s)
            if progress is not None:
                progress(final / self.ticks_per_s)
        if self.recorder is not None:
            self._call_recorder(self.recorder.close)
        self.components = {name: node.current_component for name, node in self.nodes.items()}
        if self.runs.early and self.runs.count == 1:
            self.duration_s = Fraction(int(self.runs.ends[0]), self.ticks_per_s)
            for component in self.components.values():
                component.context.duration_s = self.duration_s  # what it reports is up to there
        speaking = self.timeline.finish(self.components)
        stopped = pacer is not None and pacer.stopped
        idle = {} if stopped else {name: node.failure_counts() for name, node in self.nodes.items()}
        said = self.timeline.failure_counts(self.components)
        return Outcome(
            float(self.duration_s),
            time.process_time() - started,
            sorted(name for name, node in self.nodes.items() if node.windowed),
            speaking,
            {name: {**said.get(name, {}), **idle.get(name, {})} for name in self.nodes},
        )

    def _start(self, runs: range) -> None:
        """Start all blocks' processes for the runs, in a new SimPy environment if not the first."""
        if runs.start > 0:
            self.env = simpy.Environment(initial_time=0)
        for node in self.nodes.values():
            node.start()

    def _lower_bound_of_next_run(self, tick: int, ahead: int) -> int:
        soonest = MAX_TICK
        for node in self.nodes.values():
            soonest = min(soonest, node.lower_bound_of_next_run(tick, ahead))
            if soonest <= tick:
                break  # as most often
        return soonest

    def _refuse_early_ends_with_processors(self) -> None:
        """Raise SceneError if a block may end its run early in a scene with shared processors,
        whose waiting messages would be lost.
        """
        if self.scene.processors:
            ending = [n for n, cls in sorted(self.scene.classes.items()) if may_end_its_run(cls)]
            said = "it ends its run early, which a scene with shared processors does not allow"
            if ending:
                raise SceneError(
                    [self.scene.problem(f"blocks.{name}.type", said) for name in ending]
                )

    def _check_ready(self) -> None:
        """Raise if a block still waits for a host program, or the simulation has already run."""
        hosted = [
            self.scene.problem(f"blocks.{name}.type", component.needs_host)
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

    def recorded_message_types(self) -> list[type[Message]]:
        """Return the message types whose tables are recorded."""
        blocks = self.components.values()
        messages = [message for block in blocks for message in block.records()]
        return [*messages, Processing] if self.scene.processors else messages

    def _open_recorder(self) -> None:
        if self.recorder is not None:
            self.recorder.open(
                self.recorded_message_types(), self.ticks_per_s, self.runs,
                replicas=self.timeline.says_replica, platforms=self.platforms,
            )  # fmt: skip

    def _call_recorder(self, call: Callable[..., None], *arguments: Any) -> None:
        """Call a recorder method, and raise what it cannot record as the block's failure."""
        try:
            call(*arguments)
        except NotRecordedError as error:
            cause = error.__cause__ or error
            component = self.nodes[error.block].component
            said = block_failure(component, int(error.ticks[0]) / self.ticks_per_s, cause)
            self._raise_with_exact_instant(Failure(said, cause, error.ticks[:1]))

    def _record(self, block: str, message: Message) -> None:
        if self.recorder is not None:
            self.recorder.record(block, message)

    def run_window(self, window: Window) -> Failure | None:
        """Run every block over a window, and return the first failure of a block, or None."""
        self.window, self.failure = window, None
        for node in self.nodes.values():
            node.schedule_block_in_window(window)
        try:
            # A provisional window leaves the clock at its start, where all of it runs.
            self.env.run(until=None if window.provisional else window.end)
        except Abort:
            if self.failure is None:
                raise
        for processor in self._processors.values():
            processor.record_job_outcomes()
        return self.failure

    def fail(
        self, node: RunningBlock, ticks: IntArray, error: BaseException, scan: int = -1
    ) -> None:
        """Record a block's error at `ticks`; leave SimPy unless this window may be undone."""
        if self.failure is None:  # a provisional window goes on; the first failure counts
            time_s, number = int(ticks[0]) / self.ticks_per_s, scan if scan >= 0 else None
            said = block_failure(node.component, time_s, error, number)
            self.failure = Failure(said, error, ticks)
        if not self.window.provisional:
            raise Abort

    def _raise_with_exact_instant(self, failure: Failure) -> None:
        """Raise a block's failure, if possible with its exact instant from a rerun scan by scan."""
        for component in self.components.values():
            component.close()
        before = self.scans * int(failure.ticks[0]) / self.runs.run_ticks
        if len(failure.ticks) > 1 and self.runs.count == 1 and before < _MOST_SCANS_AGAIN:
            try:
                Simulation(self.scene, window=1, simulate_everything=self._everything).run()
            except SceneError:  # a block waits for what only `prepare` handed over
                pass
            except BlockFailure as exact:
                raise exact from exact.__cause__
        raise failure.said from failure.cause


def block_failure(
    component: Component, time_s: float, error: BaseException, scan: int | None = None
) -> BlockFailure:
    """Return a `BlockFailure` that describes the exception which a block raised at an instant."""
    cls = type(component)
    return BlockFailure(
        component.name, cls.import_path(), time_s, scan, error_text_with_line(error, cls)
    )
