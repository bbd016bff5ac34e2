"""The blocks of a scene, built and set up: with their neighbours known and their effects built."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from dsa_des.block.component import Component, Consumer, Context, Producer
from dsa_des.block.foreign_calls import REFUSALS, error_text, must_pass, why_refused
from dsa_des.errors import (
    BlockFailure,
    Problem,
    RunRefused,
    SceneError,
    SetupFailure,
    did_you_mean,
)
from dsa_des.record.recording import Recorder
from dsa_des.running.effects import Planned, WrapEffect, build_effects
from dsa_des.running.loops import telling_order
from dsa_des.running.timeline import Timeline
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
        """Say what carries each block: what its table names, or what carries those that feed it."""
        known = [name for names in self._sources.values() for name in names]
        problems: list[Problem] = []
        left = sorted(self.components.keys() - self._sources)
        for name in self.components:
            said = self._scene.blocks[name].options.platform
            if said is not None and (said not in known or name in self._sources):
                problems.append(self._no_platform(name, known, said))
            elif said is not None or name in left:
                by_sources = self._first_of_sources(name)
                self.components[name].context.platform = said or by_sources
        _raise_any(problems)
        found = True
        while found:  # down the chains, around loops too
            left = [name for name in left if not self.components[name].context.platform]
            found = False
            for name in left:
                if feeding := self._feeding(name):
                    self.components[name].context.platform = min(feeding)
                    found = True
        for name in left:
            self.components[name].context.platform = next(iter(known), "")
        for name in sorted(self.components.keys() - self._sources):
            mine, feeding = self.components[name].context.platform, self._feeding(name)
            for other in sorted(feeding.keys() - {mine}):
                by = f"{feeding[mine]} feeds it" if mine in feeding else "its key platform says"
                message = (
                    f"is carried by {mine!r}, as {by}, and {feeding[other]} on {other!r} feeds it "
                    "too: a block looks from one place; give each platform one of its own"
                )
                problems.append(self._scene.problem(f"blocks.{name}", message))
        _raise_any(problems)

    def _feeding(self, name: str) -> dict[str, str]:
        """Return what carries the blocks that feed one, with the first of these on each."""
        carrying: dict[str, str] = {}
        for wire in self._scene.wires:
            if wire.target == name and (on := self.components[wire.source].context.platform):
                carrying.setdefault(on, wire.source)
        return carrying

    def _first_of_sources(self, name: str) -> str:
        """Return what carries a block that nothing but sources feeds; empty for others."""
        feeding = [wire.source for wire in self._scene.wires if wire.target == name]
        alone = bool(feeding) and all(one in self._sources for one in feeding)
        return self._sources[feeding[0]][0] if alone else ""

    def _no_platform(self, name: str, known: Sequence[str], said: str) -> Problem:
        """Return why what a block's table names cannot carry it."""
        if name in self._sources:
            why = "it moves all platforms and is on none: name it at the blocks that look from it"
        elif known:
            why = f"there is no such aircraft or place{did_you_mean(said, known)}"
        else:
            why = "no block of this scene says which aircraft there are"
        return self._scene.refused(name, f"platform: {why}")

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
