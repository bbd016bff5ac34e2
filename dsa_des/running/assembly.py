"""The blocks of a scene, built and set up: with their neighbours known and their effects built."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from dsa_des.block.component import Component, Consumer, Context, Producer
from dsa_des.block.foreign_calls import (
    REFUSALS,
    describe_error,
    error_text_with_type,
    is_stop_request,
)
from dsa_des.errors import BlockFailure, Problem, RunRefused, SceneError, SetupFailure
from dsa_des.record.recording import Recorder
from dsa_des.running.effects import Planned, WrapEffect, build_effects
from dsa_des.running.loops import offer_order
from dsa_des.running.timeline import Timeline
from dsa_des.scene.platforms import platform_by_block
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import MAX_TICK


class Assembly:
    """Builds and sets up a scene's block instances for each stretch between timed changes.

    Where something changes while the scene runs, `stretches` are the blocks of each stretch. A
    block goes on as it is unless its own parameters, the scene's sections or what its neighbours
    offer are others: then another instance of it is set up, as long as it says what it remembers.
    What is asked of a block is what is asked in any stretch.

    A `SceneError` says why the scene has no length, or which block cannot be built or set up.
    """

    def __init__(
        self,
        scene: Scene,
        timeline: Timeline,
        recorder: Recorder | None,
        simulate_everything: bool,
        wrap_effect: WrapEffect | None,
        rewinds: bool,
    ) -> None:
        self._scene, self._timeline, self._recorder = scene, timeline, recorder
        self._everything = simulate_everything
        self._rewinds = rewinds
        self._scenes = [scene, *(stretch.scene for stretch in scene.stretches)]
        self._place = offer_order(scene.graph, scene.classes)
        #: The blocks of each stretch, the first one that of the start.
        self.stretches: list[dict[str, Component]] = [{} for _ in self._scenes]
        for number in range(len(self._scenes)):
            self._build_stretch(number)
        self.components = self.stretches[0]
        self.duration_s = self._duration_s()
        self._refuse_late_changes()
        #: Blocks that move what carries others, and the names of that.
        self._sources = {n: names for n, c in self.components.items() if (names := c.platforms())}
        self._assign_platforms()
        #: Blocks that go on by what their neighbours said at first, and the stretch from which on
        #: these say otherwise: they do not say what they remember.
        self.unheard: dict[str, int] = {}
        for number in range(len(self._scenes)):
            self._pass_offers_downstream(number)
        #: What became of the effects of each stretch.
        self.plans = self._plan_and_build_effects(wrap_effect)
        self._set_up()

    def _build_stretch(self, number: int) -> None:
        components = self.stretches[number]
        before = self.stretches[number - 1] if number else {}
        problems: list[Problem] = []
        for name in self._scenes[number].blocks:
            if number:
                components[name] = before[name]
            if not number or self._has_changed_in_stretch(name, number):
                with self._naming_failed_block(name, problems):
                    made = self._make_component(name, number)
                    if number and made.heeds_changes:
                        from_s = self._scene.stretches[number - 1].from_s
                        components[name].apply_change(from_s, made)
                    else:
                        components[name] = made
        _raise_if_problems(problems)

    def _has_changed_in_stretch(self, name: str, number: int) -> bool:
        """Return whether a block's parameters, or the scene's sections, differ from the stretch
        before; SceneError if the block cannot change.
        """
        scene, before = self._scenes[number], self._scenes[number - 1]
        block, old = scene.blocks[name], before.blocks[name]
        if block.parameters is not old.parameters and block.parameters != old.parameters:
            heeds = block.cls.remembers is not None or block.cls.heeds_changes
            if block.cls is not old.cls or not heeds:
                message = (
                    f"cannot change while a run lasts: {block.cls.import_path()} is made anew by it"
                )
                raise SceneError([self._scene.problem(f"blocks.{name}", message)])
            return True
        return block.cls.remembers is not None and scene.sections != before.sections

    def _make_component(self, name: str, number: int) -> Component:
        scene, timeline, recorder = self._scenes[number], self._timeline, self._recorder
        context = Context(
            timeline.streams,
            self._scene.ticks_per_s,
            sections=scene.sections,
            simulate_everything=self._everything,
            recorded_runs=max(timeline.count, 0 if recorder is None else recorder.runs),
            recorded_tables=() if recorder is None else recorder.wanted_tables,
            rewinds=self._rewinds,
        )
        block = scene.blocks[name]
        parameters = block.parameters if number else timeline.parameters(name)
        return block.cls(name, parameters, context)

    def _duration_s(self) -> Fraction:
        if self._scene.duration_s is not None:
            return self._scene.duration_s
        lengths = [self._call_method(one, "natural_duration_s") for one in self.components.values()]
        known = [length for length in lengths if length is not None]
        if not known:
            message = "is required: no block of this scene has a length of its own"
            raise SceneError([self._scene.problem("duration_s", message)])
        longest = max(known)
        if longest * self._scene.ticks_per_s >= MAX_TICK:
            message = f"is {float(longest):.4g} s by the data of its blocks: give a shorter one"
            raise SceneError([self._scene.problem("duration_s", message)])
        return longest

    def _refuse_late_changes(self) -> None:
        for stretch in self._scene.stretches if self._scene.duration_s is None else ():
            if stretch.from_s > self.duration_s:
                ends_s = f"the run's end, {float(self.duration_s):g} s"
                message = f"something changes at {float(stretch.from_s):g} s, beyond {ends_s}"
                raise SceneError([self._scene.problem("changes", message)])

    def _assign_platforms(self) -> None:
        """Set the platform (aircraft or place) of all block instances; timed changes keep it."""
        self.platforms = platform_by_block(self._scene, self._sources)
        on, first = set(self.platforms.values()), {names[0] for names in self._sources.values()}
        #: Whether blocks are on several platforms, or on another one than the first.
        self.is_shared = len(on) > 1 or bool(self._sources and on - first)
        for components in self.stretches:
            for name, platform in self.platforms.items():
                components[name].context.platform = platform

    def _pass_offers_downstream(self, number: int) -> None:
        """Give every block its producers with what each offers, sources first as offers pass on.

        It comes before effects are planned, so that a verdict may rest on it.
        """
        components = self.stretches[number]
        for name in sorted(components, key=lambda name: (self._place[name], name)):
            producers = [
                Producer(
                    wire.source,
                    wire.input,
                    self._offer_over_wire(wire, components),
                    wire.total_delay_s + Fraction(wire.jitter_s),
                    Fraction(wire.jitter_s),
                    wire.queued or wire.delay_scans > 0,
                    components[wire.source].context.platform,
                )
                for wire in self._scenes[number].wires
                if wire.target == name
            ]
            if number and components[name] is self.stretches[number - 1][name]:
                told_by = components[name]
                if _is_equal(producers, told_by.context.producers):
                    continue
                if type(components[name]).remembers is None:
                    self.unheard.setdefault(name, number)
                    continue
                problems: list[Problem] = []
                with self._naming_failed_block(name, problems):
                    components[name] = self._make_component(name, number)
                _raise_if_problems(problems)
                components[name].context.platform = told_by.context.platform
            components[name].context.producers = producers

    def _offer_over_wire(self, wire: Wire, components: Mapping[str, Component]) -> Any:
        """Return what a wire's sender offers as seen from the receiver's platform; None if none."""
        offer = self._call_method(components[wire.source], "offer", wire.output)
        carrying = components[wire.target].context.platform
        if offer is not None and carrying in self._sources.get(wire.source, ()):
            return offer.seen_from(carrying)
        return offer

    def _instances_of(self, name: str) -> list[Component]:
        """Return the distinct instances of a block over all stretches, in order of time."""
        return list({id(of[name]): of[name] for of in self.stretches}.values())

    def _plan_and_build_effects(self, wrap: WrapEffect | None) -> list[list[Planned]]:
        """Decide which effects are simulated in each stretch, build those, return all decisions."""
        planned: dict[int, list[Planned]] = {}
        problems: list[Problem] = []
        for component in (one for of in self.stretches for one in of.values()):
            component.context.duration_s = self.duration_s  # a verdict may ask others about the run
        for number, components in enumerate(self.stretches):
            tolerance = self._scenes[number].tolerance
            for name, component in components.items():
                if id(component) in planned:
                    continue
                planned[id(component)] = []
                with self._naming_failed_block(name, problems):
                    planned[id(component)] = build_effects(
                        component, tolerance, everything=self._everything, wrap=wrap
                    )
        _raise_if_problems(problems)
        return [
            [item for component in of.values() for item in planned[id(component)]]
            for of in self.stretches
        ]

    def _set_up(self) -> None:
        problems: list[Problem] = []
        for name in sorted(self.components, key=lambda name: (-self._place[name], name)):
            consumers = self._consumers(name)
            each = self._instances_of(name)
            for component in each:
                component.context.consumers = consumers
                with self._naming_failed_block(name, problems):
                    component.setup()
            for component in each[1:] if not problems else ():
                if [*component.records()] != [*each[0].records()]:
                    message = "records something else after a change: that it cannot"
                    problems.append(self._scene.problem(f"blocks.{name}", message))
        _raise_if_problems(problems)

    def _consumers(self, name: str) -> list[Consumer]:
        """Return a `Consumer` per input that a block feeds: receiver's platform and request."""
        consumers: list[Consumer] = []
        for wire in self._scene.wires:
            if wire.source == name:
                of_wire: list[Consumer] = []
                for target in self._instances_of(wire.target):
                    asked = self._call_method(target, "request", wire.input)
                    platform = target.context.platform
                    consumer = Consumer(wire.target, wire.input, asked, platform)
                    if not any(_is_equal(consumer, one) for one in of_wire):
                        of_wire.append(consumer)
                consumers += of_wire
        return consumers

    @contextmanager
    def _naming_failed_block(self, name: str, problems: list[Problem]) -> Iterator[None]:
        """Turn a block's error before the run into a problem or SetupFailure that names it."""
        try:
            yield
        except (SceneError, BlockFailure, RunRefused):
            raise
        except REFUSALS as error:
            problems.append(self._scene.problem_of_setup_refusal(name, describe_error(error)))
        except BaseException as error:
            if is_stop_request(error):
                raise
            path = self._scene.blocks[name].cls.import_path()
            raise SetupFailure(name, path, 0.0, None, error_text_with_type(error)) from error

    def _call_method(self, component: Component, what: str, *arguments: Any) -> Any:
        """Call a block's method before the run and return its result; SceneError if it refuses."""
        problems: list[Problem] = []
        answer = None
        with self._naming_failed_block(component.name, problems):
            answer = getattr(component, what)(*arguments)
        _raise_if_problems(problems)
        return answer


def _is_equal(one: Any, other: Any) -> bool:
    """Return whether two blocks' offers or requests are equal; False if not comparable."""
    try:
        return bool(one == other)
    except ValueError:  # arrays
        return False


def _raise_if_problems(problems: list[Problem]) -> None:
    if problems:
        raise SceneError(problems)
