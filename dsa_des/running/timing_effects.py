"""Timing as effects: what a scene says of latencies, wires, clocks and processors, and why.

They belong to the engine, not to a block, but they are judged like any other effect: simulated
because a key says so, left out because it is 0. With everything simulated, loss, wire jitter and
clock jitter are drawn and added as zeros; a shared processor is not (`SharedProcessor`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from dsa_des.block.component import Component
from dsa_des.block.effect import Effect, Verdict
from dsa_des.running.effect_plan import Planned
from dsa_des.scene.block_table import Block
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import ClockSpec


@dataclass(frozen=True)
class _OfKey(Effect):
    """An effect that exists where one number of a wire, a block or a clock is not 0.

    Parameters
    ----------
    name : str
    key : str
        The key in the scene file.
    everywhere : str
        What stands for all places that have none of it: "every wire".
    """

    name: str  # type: ignore[misc]  # of the object, as there is one object for each
    key: str
    everywhere: str
    acts_on: ClassVar[str] = "time"

    def verdict(self, block: Any) -> Verdict:
        """Ask a wire, a block's options or a clock for the key."""
        value = getattr(block, self.key)
        return Verdict(bool(value), f"{self.key} is {float(value):g}")


class _Delay(_OfKey):
    def verdict(self, block: Any) -> Verdict:
        if block.delay_scans:
            return Verdict(True, f"delay is {block.delay_scans} scans")
        return super().verdict(block)


class SharedProcessor(Effect):
    """Messages that queue for a processor."""

    name = "shared processor"
    acts_on = "time"
    neutral = False
    outside_the_proof = "work on a message takes a tick or more: no processor adds no time"
    key = "processor"
    everywhere = "every block"

    def verdict(self, block: Any) -> Verdict:
        """Ask a block's options for ``processor``."""
        if block.processor is None:
            return Verdict(False, "processor is not given")
        return Verdict(True, f"processor is {block.processor!r}")


LATENCY = _OfKey("latency", "latency_s", "every block")
DELAY = _Delay("delay", "delay_s", "every wire")
WIRE_JITTER = _OfKey("wire jitter", "jitter_s", "every wire")
LOSS = _OfKey("loss", "drop_probability", "every wire")
CLOCK_DRIFT = _OfKey("clock drift", "rate_error_ppm", "every clock")
CLOCK_JITTER = _OfKey("clock jitter", "jitter_s", "every clock")
PROCESSOR = SharedProcessor()

OF_BLOCKS = (LATENCY, PROCESSOR)
OF_WIRES = (DELAY, WIRE_JITTER, LOSS)
OF_CLOCKS = (CLOCK_DRIFT, CLOCK_JITTER)


def timing_plan(scene: Scene, *, everything: bool = False) -> list[Planned]:
    """Return what became of each timing effect: one entry for each place where it is simulated.

    Where a scene calls for an effect nowhere, or only in some places, one entry speaks for all
    the others.

    Parameters
    ----------
    scene : Scene
    everything : bool
        Whether effects that the scene does not call for are simulated with zeros.
    """
    blocks = [(name, block.options) for name, block in sorted(scene.blocks.items())]
    wires = [(str(wire), wire) for wire in scene.wires]
    clocks = list(_clocks(scene))
    found: list[Planned] = []
    for effects, places in ((OF_BLOCKS, blocks), (OF_WIRES, wires), (OF_CLOCKS, clocks)):
        for effect in effects:
            found += _judged(effect, places, everything)
    return found


def _judged(effect: Any, places: list[tuple[str, Any]], everything: bool) -> Iterator[Planned]:
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


def _clocks(scene: Scene) -> Iterator[tuple[str, ClockSpec]]:
    for name, block in sorted(scene.blocks.items()):
        spec = clock_of(block)
        if spec is not None:
            yield name, spec


def clock_of(block: Block) -> ClockSpec | None:
    """Return the clock that a block's parameters describe, or None."""
    cls: type[Component] = block.cls
    return cls.clock_of(block.parameters)


def may_be_late(wire: Wire, everything: bool) -> bool:
    """Return whether loss and jitter are drawn for the messages of a wire."""
    return everything or LOSS.verdict(wire).simulated or WIRE_JITTER.verdict(wire).simulated
