"""Replicas of one scene in lock step: one run whose rows are those of every replica.

Blocks that treat every row by itself serve all replicas at once; a block that remembers, or whose
parameters differ between replicas, is split into one instance each
(`dsa_des.replicas.split_block`). What is recorded equals the separate runs' recordings, with the
replica as an additional column.
"""

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import ClockedParameters, Component, Context
from dsa_des.block.foreign_calls import is_stop_request
from dsa_des.record.failure_counts import FailuresByRun, counts_by_run
from dsa_des.record.recording import Recorder
from dsa_des.replicas.drawn_columns import ReplicaScenes
from dsa_des.replicas.split_block import NotInLockStep, SplitBlock
from dsa_des.running.effects import build_effects
from dsa_des.running.grain import Grain
from dsa_des.running.loops import longest_delay_cut_edges
from dsa_des.running.simulation import Simulation
from dsa_des.running.timeline import Timeline
from dsa_des.running.windows import Rewinder, Windows
from dsa_des.scene.block_table import Block
from dsa_des.scene.scene import Scene
from dsa_des.stretches.stretched_block import StretchedBlock
from dsa_des.time.clock import ClockSpec
from dsa_des.time.randomness import Streams

__all__ = ["NotInLockStep", "Replicas", "make_lockstep_simulation"]

# Side by side, windows that hold fewer rows than this of each replica cost more than runs apart.
_MOST_WINDOWS_PER_SCAN = 10.0
# What only the engine reads of a clock: each replica has its own scan instants. How long a scan
# lasts, blocks read themselves.
_OF_THE_CLOCK = frozenset({"offset_s", "rate_error_ppm", "jitter_s"})
#: Takes a replica's number and what its blocks report (`Component.report`).
TakeReport = Callable[[int, dict[str, Any]], None]


def make_lockstep_simulation(
    scenes: Sequence[Scene],
    *,
    recorder: Recorder | None = None,
    report: TakeReport | None = None,
    window: int | None = None,
) -> Simulation:
    """Return one simulation of all replicas of a scene in lock step; it can be run once.

    The `scenes` have the same graph and block types, and other seeds or parameters. Every table of
    the recorder begins with the column ``replica``. `report` is called with a replica's number and
    what its blocks report, for blocks that are split; shared ones report for none. Raised are
    `NotInLockStep` if these replicas cannot run together, when made or while running, and
    `SceneError` if a block cannot be set up.
    """
    timeline = Replicas(scenes, report)
    return Simulation(scenes[0], timeline=timeline, recorder=recorder, window=window)


class Replicas(Timeline):
    """A lock-step simulation's timeline: replicas that share blocks' instances where they can."""

    says_replica = True

    def __init__(self, scenes: Sequence[Scene], report: TakeReport | None = None) -> None:
        super().__init__(scenes[0])
        self._scenes = scenes if isinstance(scenes, ReplicaScenes) else list(scenes)
        self._report = report
        self.count = len(self._scenes)
        #: Blocks that are split, by name; the engine still asks the blocks for all but `run`.
        self.split: dict[str, SplitBlock] = {}
        #: What runs blocks for all replicas that differ in more than their clocks.
        self.together: dict[str, Component] = {}
        #: What instances of split blocks could not do.
        self._failures: dict[str, dict[str, IntArray]] = {}
        _check_alike(self._scenes)
        self.seeds = _seeds_of(self._scenes)
        self.streams = Streams(self.seeds)

    def set_length(self, components: Mapping[str, Component], duration_s: Fraction) -> None:
        """Set the duration; make an instance per replica, or a joint one, of unshared blocks."""
        super().set_length(components, duration_s)
        self._faces = components
        for name, component in components.items():
            if self._is_shared(name, component):
                self.streams.forbid_draws_for_all(name)
            else:
                if component.process is not None:
                    raise NotInLockStep(f"block {name} has a process of its own")
                make = self._instance_maker(name, component)
                if (runner := self._combined_component(name, component)) is not None:
                    self.together[name] = runner
                    continue
                self.split[name] = SplitBlock(
                    tuple(component.outputs), make, self._collect_finished_instance
                )

    def _is_shared(self, name: str, component: Component) -> bool:
        """Return whether replicas can share an instance: parameters equal, apart from clocks."""
        # What was drawn when it was set up would be the first one's in all of them.
        if not component.serves_replicas() or self.streams.has_drawn_for_all(name):
            return False
        differing = self._differing_parameters(name)
        if isinstance(component.p, ClockedParameters):
            differing -= _OF_THE_CLOCK
        return not differing

    def _differing_parameters(self, name: str) -> set[str]:
        """Return the names of a block's parameters that differ between replicas."""
        if isinstance(self._scenes, ReplicaScenes):
            return self._scenes.differing_parameters(name)
        first = self._scenes[0].blocks[name].parameters
        names, fields, values = set[str](), type(first).model_fields, vars(first)
        for scene in self._scenes[1:]:
            other = vars(scene.blocks[name].parameters)
            if other is not values:  # what a copy shares need not be compared
                names.update(
                    n for n in fields if other[n] is not values[n] and other[n] != values[n]
                )
        return names

    def _combined_component(self, name: str, face: Component) -> Component | None:
        """Return one component for all replicas of differing parameters; None if there is none."""

        def make(number: int) -> Component:
            component = self._make_component(name, number)
            self._check_same_length(face, component)
            return component

        try:
            return face.make_for_all_runs(self._parameters_of(name), make)
        except BaseException as error:
            if is_stop_request(error):
                raise
            return None  # what is wrong with one of them shows when that one is made

    def _parameters_of(self, name: str, stretch: int | None = None) -> list[Any]:
        if stretch is not None and self.scene.stretches:
            scenes = [scene.stretches[stretch].scene for scene in self._scenes]
            return [scene.blocks[name].parameters for scene in scenes]
        if isinstance(self._scenes, ReplicaScenes):
            return self._scenes.parameters_of(name)
        return [scene.blocks[name].parameters for scene in self._scenes]

    def _make_component(self, name: str, number: int) -> Component:
        """Return a block as a replica has it, not set up."""
        scene, face = self._scenes[number], self._faces[name].context
        context = Context(
            Streams(scene.seed), self.scene.ticks_per_s, duration_s=face.duration_s,
            consumers=face.consumers, producers=face.producers, sections=scene.sections,
            recorded_runs=face.recorded_runs, recorded_tables=face.recorded_tables,
            platform=face.platform,
        )  # fmt: skip
        block = scene.blocks[name]
        return block.cls(name, block.parameters, context)

    def _instance_maker(self, name: str, face: Component) -> Callable[[int], Component]:
        def make(number: int) -> Component:
            scene, component = self._scenes[number], self._make_component(name, number)
            self._check_same_length(face, component)
            build_effects(component, scene.tolerance)
            component.setup()
            self._check_same_connections(face, component)
            return component

        return make

    def _check_same_connections(self, face: Component, component: Component) -> None:
        """Raise NotInLockStep if an instance records, requests or offers other than the first."""
        if [*component.records()] != [*face.records()]:
            raise NotInLockStep(f"block {face.name} records something else in some replica")
        for port in face.inputs:
            if component.request(port) != face.request(port):
                raise NotInLockStep(f"block {face.name} asks for something else in some replica")
        for port in face.outputs:
            if component.offer(port) != face.offer(port):
                raise NotInLockStep(
                    f"what block {face.name} tells its neighbours, of its targets for example, "
                    "differs between replicas"
                )

    def _check_same_length(self, face: Component, component: Component) -> None:
        """Raise NotInLockStep if an instance sets another duration than the first one does."""
        if self.scene.duration_s is not None:
            return
        if component.natural_duration_s() != face.natural_duration_s():
            raise NotInLockStep(f"block {face.name} gives some replica another duration")

    def rehearse(self) -> None:
        """Set up each replica's own instances once to raise their errors, and discard them.

        `NotInLockStep` if that shows a reason not to run them together.
        """
        for block in self.split.values():
            for number in range(len(self._scenes)):
                block.make(number)

    def failure_counts(self, components: Mapping[str, Component]) -> FailuresByRun:
        """Return failure counts of blocks in each run, of shared and of single instances."""
        shared = {n: c for n, c in components.items() if n not in self.split}
        return {**super().failure_counts(shared), **self._failures}

    def _collect_finished_instance(self, number: int, component: Component) -> None:
        of_all = self._failures.setdefault(component.name, {})
        for what, counts in counts_by_run(component.failure_counts(), 1).items():
            of_all.setdefault(what, np.zeros((2, self.count), dtype=np.int64))
            of_all[what][:, [number]] += counts
        if self._report is not None:
            if number in self.runs.ended_by:
                ended = Fraction(int(self.runs.ends[number]), self.scene.ticks_per_s)
                component.context.duration_s = ended
            self._report(number, component.report())

    def block_switching_by_stretch(self, instances: Sequence[Component]) -> StretchedBlock | None:
        """Return what runs the instance in force at each time for a block changed while it runs,
        None if one serves throughout; NotInLockStep if replicas cannot share them.
        """
        stretched, name = super().block_switching_by_stretch(instances), instances[0].name
        if stretched is not None and not all(self._is_shared(name, one) for one in instances):
            raise NotInLockStep(f"block {name} changes while it runs, and cannot be shared")
        return stretched

    def clock_specs(
        self, name: str, component: Component, stretch: int | None = None
    ) -> list[ClockSpec]:
        """Return each replica's specification of a block's clock, in stretch `stretch` of the run;
        empty if the block has none, NotInLockStep if only some replicas have one.
        """
        every: list[Any] = []
        known: dict[int, Any] = {}  # by the identity of parameters, which many replicas share
        for parameters in self._parameters_of(name, stretch):
            if id(parameters) not in known:
                known[id(parameters)] = component.clock_of(parameters)
            every.append(known[id(parameters)])
        specs = [spec for spec in every if spec is not None]
        if 0 < len(specs) < len(every):
            raise NotInLockStep(f"block {name} has a clock of its own in some replicas only")
        if len({(spec.rate_hz, spec.rate_error_ppm) for spec in specs}) > 1:
            for wire in self.scene.wires:
                if wire.delay_scans and name in (wire.source, wire.target):
                    raise NotInLockStep(f"wire {wire} counts its delay in scans that differ")

        return specs

    def runner(self, component: Component) -> Any:
        """Return what runs a block: itself, a component for all, or an instance per replica."""
        together = self.together.get(component.name)
        return self.split.get(component.name, component) if together is None else together

    def windows(
        self,
        longest_ticks: int,
        scans: float,
        horizon_ticks: int | None,
        rewinder: Rewinder | None,
    ) -> Windows:
        """Return the time windows blocks run in; NotInLockStep if loops need too many."""
        most = _MOST_WINDOWS_PER_SCAN * scans + 1000
        if horizon_ticks is not None and self.runs.run_ticks > horizon_ticks * most:
            said = f"{horizon_ticks / self.scene.ticks_per_s:.2g} s"
            raise NotInLockStep(f"a feedback loop comes back after {said}: scans are farther apart")
        return super().windows(longest_ticks, scans, horizon_ticks, rewinder)

    def grain(self, window: int | None) -> Grain:
        """Return how blocks run: all in time windows, loops cut at their longest delays."""
        return Grain(set(self.scene.blocks), False, longest_delay_cut_edges(self.scene), {})

    def finish(self, components: Mapping[str, Component]) -> Mapping[str, Component]:
        """Close single replicas' instances and collect their reports; return {}."""
        for block in self.split.values():
            block.close_instances(len(self._scenes))
        if self._report is not None:
            for name in self.together:
                make = self._instance_maker(name, components[name])
                for number in range(len(self._scenes)):
                    self._collect_finished_instance(number, make(number))
        return {}


def _seeds_of(scenes: Sequence[Scene]) -> Sequence[int]:
    if isinstance(scenes, ReplicaScenes):
        return scenes.seeds
    return [scene.seed for scene in scenes]


def _check_alike(scenes: Sequence[Scene]) -> None:
    """Raise NotInLockStep if the scenes differ in more than seeds and parameters of blocks."""
    first = scenes[0]
    late = sorted(n for n, cls in first.classes.items() if not cls.windowed or cls.process)
    if late:
        raise NotInLockStep(f"blocks that run scan by scan: {', '.join(late)}")
    if first.processors:
        raise NotInLockStep("shared processors order messages of one run")
    if isinstance(scenes, ReplicaScenes):  # which differ in nothing else
        return
    for scene in scenes[1:]:
        same = (
            scene.wires == first.wires
            and scene.duration_s == first.duration_s
            and scene.ticks_per_s == first.ticks_per_s
            and scene.classes == first.classes
            and scene.outages == first.outages
            and all(scene.sections[name] == model for name, model in first.sections.items())
        )
        if not same:
            raise NotInLockStep("the replicas differ in wires, types, duration, ticks or sections")
        if not _have_same_changes(scene, first):
            raise NotInLockStep("the replicas differ in what changes while they run")


def _have_same_changes(scene: Scene, first: Scene) -> bool:
    """Return whether two scenes' stretches begin together and changing blocks' parameters agree."""
    if [one.from_s for one in scene.stretches] != [one.from_s for one in first.stretches]:
        return False
    pairs = [(a.scene, b.scene) for a, b in zip(scene.stretches, first.stretches, strict=True)]
    return all(
        one.wires == other.wires
        and one.sections == other.sections
        and all(
            _parameters_without_clock(one.blocks[name]) == _parameters_without_clock(block)
            for name, block in other.blocks.items()
            if block.parameters != first.blocks[name].parameters
        )
        for one, other in pairs
    )


def _parameters_without_clock(block: Block) -> dict[str, Any]:
    """Return a block's parameters by name, without those only read for its clock."""
    clocked = isinstance(block.parameters, ClockedParameters)
    values = dict(block.parameters)
    return {n: v for n, v in values.items() if not clocked or n not in _OF_THE_CLOCK}
