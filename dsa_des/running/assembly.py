"""The blocks of a scene, built and set up: with their neighbours known and their effects built."""

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from dsa_des.block.component import Component, Consumer, Context, Producer
from dsa_des.block.foreign_calls import REFUSALS, error_text, must_pass, why_refused
from dsa_des.errors import BlockFailure, Problem, RunRefused, SceneError, SetupFailure
from dsa_des.record.recording import Recorder
from dsa_des.running.effects import Planned, WrapEffect, build_effects
from dsa_des.running.loops import telling_order
from dsa_des.running.timeline import Timeline
from dsa_des.scene.platforms import platforms_of
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import MAX_TICK


class Assembly:
    """The blocks of a scene, ready to run.

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
        self._scene = scene
        self._everything = simulate_everything
        self._rewinds = rewinds
        self._place = telling_order(scene.graph, scene.classes)
        self.components = self._build(timeline, recorder)
        self.duration_s = self._duration()
        #: Blocks that move what carries others, and the names of that.
        self._sources = {n: names for n, c in self.components.items() if (names := c.platforms())}
        self._put_on_platforms()
        self._offer_down_the_chain()
        self.plan = self._plan_effects(wrap_effect)
        self._set_up()

    def _build(self, timeline: Timeline, recorder: Recorder | None) -> dict[str, Component]:
        runs = timeline.count if recorder is None else max(timeline.count, recorder.runs)
        tables = () if recorder is None else recorder.wanted_tables
        components: dict[str, Component] = {}
        problems: list[Problem] = []
        for name, block in self._scene.blocks.items():
            context = Context(
                timeline.streams,
                self._scene.ticks_per_s,
                sections=self._scene.sections,
                simulate_everything=self._everything,
                recorded_runs=runs,
                recorded_tables=tables,
                rewinds=self._rewinds,
            )
            with self._preparing(name, problems):
                components[name] = block.cls(name, timeline.parameters(name), context)
        _raise_any(problems)
        return components

    def _duration(self) -> Fraction:
        if self._scene.duration_s is not None:
            return self._scene.duration_s
        lengths = [self._asked(name, "natural_duration_s") for name in self.components]
        known = [length for length in lengths if length is not None]
        if not known:
            message = "is required: no block of this scene has a length of its own"
            raise SceneError([self._scene.problem("duration_s", message)])
        longest = max(known)
        if longest * self._scene.ticks_per_s >= MAX_TICK:
            message = f"is {float(longest):.4g} s by the data of its blocks: give a shorter one"
            raise SceneError([self._scene.problem("duration_s", message)])
        return longest

    def _put_on_platforms(self) -> None:
        """Tell every block what carries it."""
        for name, platform in platforms_of(self._scene, self._sources).items():
            self.components[name].context.platform = platform

    def _offer_down_the_chain(self) -> None:
        """Tell every block what its producers offer, sources first: a block may pass it on.

        It comes before effects are planned, so that a verdict may rest on it.
        """
        for name in sorted(self.components, key=lambda name: (self._place[name], name)):
            self.components[name].context.producers = [
                Producer(
                    wire.source,
                    wire.input,
                    self._offer(wire),
                    wire.total_delay_s + Fraction(wire.jitter_s),
                    Fraction(wire.jitter_s),
                    wire.queued or wire.delay_scans > 0,
                    self.components[wire.source].context.platform,
                )
                for wire in self._scene.wires
                if wire.target == name
            ]

    def _offer(self, wire: Wire) -> Any:
        """Return what is offered over a wire, as what carries the receiver has it."""
        offer = self._asked(wire.source, "offer", wire.output)
        carrying = self.components[wire.target].context.platform
        if carrying in self._sources.get(wire.source, ()):
            return offer.seen_from(carrying)
        return offer

    def _plan_effects(self, wrap: WrapEffect | None) -> list[Planned]:
        """Decide which effects exist in this run and build them."""
        planned: list[Planned] = []
        problems: list[Problem] = []
        tolerance = self._scene.tolerance
        for name, component in self.components.items():
            component.context.duration_s = self.duration_s
            with self._preparing(name, problems):
                planned += build_effects(
                    component, tolerance, everything=self._everything, wrap=wrap
                )
        _raise_any(problems)
        return planned

    def _set_up(self) -> None:
        problems: list[Problem] = []
        for name in sorted(self.components, key=lambda name: (-self._place[name], name)):
            component = self.components[name]
            component.context.consumers = [
                Consumer(
                    wire.target,
                    wire.input,
                    self._asked(wire.target, "request", wire.input),
                    self.components[wire.target].context.platform,
                )
                for wire in self._scene.wires
                if wire.source == name
            ]
            with self._preparing(name, problems):
                component.setup()
        _raise_any(problems)

    @contextmanager
    def _preparing(self, name: str, problems: list[Problem]) -> Iterator[None]:
        """Make what a block raises before the run an error that names it."""
        try:
            yield
        except (SceneError, BlockFailure, RunRefused):
            raise
        except REFUSALS as error:
            problems.append(self._scene.refused(name, why_refused(error)))
        except BaseException as error:
            if must_pass(error):
                raise
            path = self._scene.blocks[name].cls.path()
            raise SetupFailure(name, path, 0.0, None, error_text(error)) from error

    def _asked(self, name: str, what: str, *arguments: Any) -> Any:
        """Return what a method of a block returns before the run."""
        problems: list[Problem] = []
        answer = None
        with self._preparing(name, problems):
            answer = getattr(self.components[name], what)(*arguments)
        _raise_any(problems)
        return answer


def _raise_any(problems: list[Problem]) -> None:
    if problems:
        raise SceneError(problems)
