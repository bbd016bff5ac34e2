"""Effects of a run: which of those that blocks declare exist, and those of time.

Latencies, delays, loss, jitter, drift and shared processors are effects of the engine, judged and
listed as those of blocks are.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.effect import Effect, Verdict
from dsa_des.errors import shortened_repr
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import ticks_to_nanoseconds
from dsa_des.time.randomness import Stream


@dataclass(frozen=True, eq=False)
class Planned:
    """One effect of one block, whether it is simulated in the run, and why.

    It exists in the run if `built`; `because` is the reason, also that of a tolerance or of
    ``simulate_everything``.
    """

    block: str
    effect: Effect
    verdict: Verdict
    built: bool
    because: str

    def sentence(self) -> str:
        """Return, for example, ``rain: not simulated, [weather] rain_rate_mm_h is 0``."""
        return f"{self.effect.name}: {'' if self.built else 'not '}simulated, {self.because}"


#: Given each planned effect and what was built of it, returns what is used instead.
WrapEffect = Callable[[Planned, Any], Any]


def plan_effects(
    block: Component, tolerance: Mapping[str, float], *, everything: bool = False
) -> list[Planned]:
    """Return which of a block's effects are to be built (simulated), and why; builds nothing.

    `tolerance` is ``[accuracy]`` of the scene: by quantity, how large an error is allowed. Effects
    are left out, smallest first, as long as the sum of their bounds stays within it. With
    `everything`, all are built that can be parametrised neutrally.
    """
    verdicts = [(effect, effect.verdict(block)) for effect in type(block).effects]
    allowed = {} if everything else _omission_reasons_by_effect(verdicts, tolerance)
    planned = []
    for effect, verdict in verdicts:
        built, because = verdict.simulated, verdict.because
        if effect.name in allowed:
            built, because = False, allowed[effect.name]
        elif everything and not built and effect.neutral:
            built, because = True, f"though {verdict.because}: everything is simulated"
        planned.append(Planned(block.name, effect, verdict, built, because))
    return planned


def build_effects(
    block: Component,
    tolerance: Mapping[str, float],
    *,
    everything: bool = False,
    wrap: WrapEffect | None = None,
) -> list[Planned]:
    """Decide a block's simulated effects, build those into its context; return all decisions."""
    planned = plan_effects(block, tolerance, everything=everything)
    built = {item: _build_effect(block, item.effect) for item in planned if item.built}
    if not everything:
        block.context.tolerance = remaining_tolerance(planned, tolerance)
    block.context.effects = {
        item.effect.name: effect if wrap is None else wrap(item, effect)
        for item, effect in built.items()
    }
    return planned


def _build_effect(block: Component, effect: Effect[Any]) -> Any:
    """Return what an effect builds; ValueError where the block could not use it."""
    value = effect.build(block)
    for hook in block.all_hooks():
        if hook == effect.acts_on and hook.builds_callable != callable(value):
            what = "something to call" if hook.builds_callable else "a value"
            raise ValueError(
                f"effect {effect.name!r} of {type(block).import_path()} builds "
                f"{shortened_repr(value)}: "
                f"{hook} needs {what}, {hook.signature_text()}"
            )
    return value


def remaining_tolerance(
    planned: Sequence[Planned], tolerance: Mapping[str, float]
) -> dict[str, float]:
    """Return quantity → tolerance left after the error bounds of all effects that are left out."""
    left = dict(tolerance)
    for item in planned:
        if item.verdict.simulated and not item.built:
            for quantity, bound in item.verdict.bound.items():
                left[quantity] -= bound
    return left


def _omission_reasons_by_effect(
    verdicts: Sequence[tuple[Effect, Verdict]], tolerance: Mapping[str, float]
) -> dict[str, str]:
    """Return effect name → reason, for those left out as joint error bounds are tolerated."""
    left = dict(tolerance)
    allowed: dict[str, str] = {}
    bounded = [
        (max(verdict.bound[q] / tolerance[q] for q in verdict.bound), effect, verdict)
        for effect, verdict in verdicts
        if verdict.simulated and verdict.bound and all(q in tolerance for q in verdict.bound)
    ]
    for _, effect, verdict in sorted(bounded, key=lambda item: (item[0], item[1].name)):
        if all(bound <= left[quantity] for quantity, bound in verdict.bound.items()):
            for quantity, bound in verdict.bound.items():
                left[quantity] -= bound
            parts = [
                f"its influence on {quantity} is at most {bound:.2g}, and [accuracy] allows "
                f"{tolerance[quantity]:g}"
                for quantity, bound in sorted(verdict.bound.items())
            ]
            allowed[effect.name] = "; ".join(parts)
    return allowed


@dataclass(frozen=True)
class _OfKey(Effect):
    """An effect that is simulated where a key of a wire, a block or a clock is given and not 0.

    `everywhere` stands for all places that have none of it: "every wire".
    """

    name: str  # type: ignore[misc]  # of the object, as there is one object for each
    key: str
    everywhere: str
    outside_the_proof: str = ""  # type: ignore[misc]
    neutral: bool = True  # type: ignore[misc]

    def verdict(self, block: Any) -> Verdict:
        """Return whether a wire's, block's or clock's key is given and not 0, and a text on it."""
        value = getattr(block, self.key)
        if self.key == "delay_s" and block.delay_scans:
            return Verdict(True, f"delay is {block.delay_scans} scans")
        if value is None:
            return Verdict(False, f"{self.key} is not given")
        if isinstance(value, str):
            return Verdict(True, f"{self.key} is {value!r}")
        return Verdict(bool(value), f"{self.key} is {float(value):g}")


WIRE_JITTER = _OfKey("wire jitter", "jitter_s", "every wire")
LOSS = _OfKey("loss", "drop_probability", "every wire")
OF_BLOCKS = (
    _OfKey("latency", "latency_s", "every block"),
    _OfKey(
        "shared processor", "processor", "every block",
        "work on a message takes a tick or more: no processor adds no time", False,
    ),
)  # fmt: skip
OF_WIRES = (_OfKey("delay", "delay_s", "every wire"), WIRE_JITTER, LOSS)
OF_CLOCKS = (
    _OfKey("clock drift", "rate_error_ppm", "every clock"),
    _OfKey("clock jitter", "jitter_s", "every clock"),
)


def plan_timing_effects(scene: Scene, *, everything: bool = False) -> list[Planned]:
    """Return which timing effects are simulated and why, per block or wire that each acts on.

    Where a scene calls for an effect nowhere, or only in some places, one entry speaks for all
    the others.
    """
    blocks = [(name, block.options) for name, block in sorted(scene.blocks.items())]
    wires = [(str(wire), wire) for wire in scene.wires]
    specs = [
        (name, block.cls.clock_of(block.parameters)) for name, block in sorted(scene.blocks.items())
    ]
    clocks = [(name, spec) for name, spec in specs if spec is not None]
    planned: list[Planned] = []
    for effects, places in ((OF_BLOCKS, blocks), (OF_WIRES, wires), (OF_CLOCKS, clocks)):
        for effect in effects:
            planned += _plan_effect_of_key(effect, places, everything)
    return planned


def _plan_effect_of_key(
    effect: _OfKey, places: list[tuple[str, Any]], everything: bool
) -> Iterator[Planned]:
    verdicts = [(place, effect.verdict(thing)) for place, thing in places]
    for place, verdict in verdicts:
        if verdict.simulated:
            yield Planned(place, effect, verdict, True, verdict.because)
    rest = [verdict for _, verdict in verdicts if not verdict.simulated]
    if not rest:
        return
    place = effect.everywhere
    if len(rest) < len(verdicts):
        place = place.replace("every ", "every other ")
    because = rest[0].because
    built = everything and effect.neutral
    if built:
        because = f"though {because}: everything is simulated"
    yield Planned(place, effect, rest[0], built, because)


def has_simulated_loss_or_jitter(wire: Wire, everything: bool) -> bool:
    """Return whether loss or jitter is simulated for the messages of a wire."""
    return everything or LOSS.verdict(wire).simulated or WIRE_JITTER.verdict(wire).simulated


@dataclass(frozen=True)
class WireFaults:
    """Random loss and delay of a wire's rows, fixed by the wire, the row's run and its instant.

    Each row is late by `late_ticks` and a uniformly drawn part of `jitter_ticks`; draws are named
    after the wire. From each of `from_ticks` on, rows that are made have the next value of each.
    """

    from_ticks: IntArray
    late_ticks: IntArray
    jitter_ticks: FloatArray
    drop_probability: FloatArray
    jitter: Stream
    drops: Stream
    ticks_per_s: int

    def is_kept(self, made: RunTicks) -> BoolArray:
        """Return a mask of rows made at these instants, True for those that are not lost."""
        return (
            self._draw_uniform(self.drops, made) >= self.drop_probability[self._stretch_index(made)]
        )

    def lateness_ticks(self, made: RunTicks) -> IntArray:
        """Return the extra delay of each row made at these instants, in ticks."""
        of = self._stretch_index(made)
        drawn = np.rint(self._draw_uniform(self.jitter, made) * self.jitter_ticks[of]).astype(
            np.int64
        )
        return self.late_ticks[of] + drawn

    def _stretch_index(self, made: RunTicks) -> IntArray:
        of: IntArray = np.searchsorted(self.from_ticks, made.tick, side="right") - 1
        return of

    def _draw_uniform(self, stream: Stream, sent: RunTicks) -> FloatArray:
        instant = ticks_to_nanoseconds(sent.tick, self.ticks_per_s)
        return stream.of_runs(sent.run, instant).uniform(instant.astype(np.uint64), 0)
