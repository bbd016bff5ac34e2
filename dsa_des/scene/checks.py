"""Checks of a scene that need both its wiring and the parameters of its blocks.

Values of the wrong kind, clocks that 64-bit ticks cannot hold, blocks that would never run, and
wires that would hold a message where no block looks for it.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import UnionType
from typing import TYPE_CHECKING, Any, Union, get_args, get_origin

from dsa_des.block.strangers import Left, strangers_code
from dsa_des.errors import Problem, did_you_mean
from dsa_des.scene.scene_file import Key, SceneFile
from dsa_des.scene.wiring import Wire
from dsa_des.text.safe_text import shortened
from dsa_des.time.clock import MAX_TICK, ClockSpec, resolution

if TYPE_CHECKING:
    from dsa_des.scene.block import Block
    from dsa_des.scene.processor import ProcessorParameters

# Assumed where a scene leaves its length to its sources.
_A_DAY = Fraction(86400)


def check_lookalikes(
    scene: SceneFile, key: Key, given: Mapping[str, Any], model: Any, problems: list[Problem]
) -> None:
    """Add values that pydantic would quietly convert: ``true`` or ``"5"`` for a number."""
    for name, value in given.items():
        declared = model.model_fields.get(name)
        if declared is None:
            continue
        union = get_origin(declared.annotation) in (Union, UnionType)
        options = get_args(declared.annotation) if union else (declared.annotation,)
        kinds = set(options) - {type(None)}
        message = ""
        if kinds <= {int, float} and isinstance(value, bool | str):
            message = "must be a number"
        elif kinds == {bool} and not isinstance(value, bool):
            message = "must be true or false"
        if message:
            shown = str(value) if isinstance(value, str) else value
            problems.append(scene.problem((*key, name), message, shown))


def check_times(
    scene: SceneFile,
    blocks: "Mapping[str, Block]",
    wires: Sequence[Wire],
    duration_s: Fraction | None,
    problems: list[Problem],
    processors: "Mapping[str, ProcessorParameters] | None" = None,
) -> int:
    """Return the ticks per second of a scene; times that 64-bit ticks cannot hold are problems."""
    clocks = _clocks(scene, blocks, problems)
    late = [wire for wire in wires if wire.total_delay_s or wire.jitter_s]
    times = [wire.total_delay_s for wire in late]
    for spec in clocks.values():
        times += spec.exact_times()
    ticks_per_s = resolution(times)
    longest_s = Fraction(MAX_TICK, ticks_per_s)
    if longest_s <= _A_DAY and longest_s <= 1 + (duration_s or _A_DAY):
        shown = (
            shortened(f"{name} {spec.rate_hz} Hz + {spec.offset_s} s", 100)
            for name, spec in clocks.items()
        )
        message = (
            "these clocks have no common tick that fits 64 bits for the whole run: "
            f"{', '.join(shown)}; give offsets to fewer digits or rates as simpler fractions"
        )
        problems.append(scene.problem(("blocks",), message))
        return ticks_per_s
    limit = f"must be at most {float(longest_s):.4g} s: that is how far this scene's ticks reach"
    if duration_s is not None and 1 + duration_s >= longest_s:
        value = scene.data.get("duration_s")
        problems.append(scene.problem(("duration_s",), limit, value))
    for wire in late:
        if wire.total_delay_s + wire.jitter_s >= longest_s:
            problems.append(scene.problem(("wires",), f"{wire}: delay_s {limit}"))
    for name, processor in (processors or {}).items():
        for what in ("service_s", "service_spread_s"):
            if (time_s := getattr(processor, what)) >= longest_s:
                key: Key = ("processors", name, what)
                problems.append(scene.problem(key, limit, str(time_s)))
    for name, block in blocks.items():
        for what, value in block.parameters:
            # Exact times of a block's own, such as gates and pauses, are counted in ticks too.
            own = isinstance(value, Fraction) and what.endswith("_s") and what != "offset_s"
            if own and abs(value) >= longest_s:
                problems.append(scene.problem(("blocks", name, what), limit, str(value)))
    for name, spec in clocks.items():
        _check_clock(scene, ("blocks", name), spec, ticks_per_s, problems)
    return ticks_per_s


def _clocks(
    scene: SceneFile, blocks: "Mapping[str, Block]", problems: list[Problem]
) -> dict[str, ClockSpec]:
    """Return the scan clock of every block that has one; a class that cannot say is a problem."""
    clocks: dict[str, ClockSpec] = {}
    for name, block in blocks.items():
        try:
            with strangers_code():
                spec = block.cls.clock_of(block.parameters)
        except Left as error:
            message = f"{block.cls.path()} cannot say its clock (clock_of): {error}"
            problems.append(scene.problem(("blocks", name), message))
            continue
        if isinstance(spec, ClockSpec):
            clocks[name] = spec
        elif spec is not None:
            message = f"{block.cls.path()} gives no clock: clock_of must return a ClockSpec or None"
            problems.append(scene.problem(("blocks", name), message))
    return clocks


def _check_clock(
    scene: SceneFile, key: Key, spec: ClockSpec, ticks_per_s: int, problems: list[Problem]
) -> None:
    longest_s = Fraction(MAX_TICK, ticks_per_s)
    speed = 1 + spec.rate_error_ppm / 1_000_000 if spec.rate_error_ppm else 1
    if speed <= 0:
        message = "must be greater than -1000000: a clock cannot stand still or run backwards"
        problems.append(scene.problem((*key, "rate_error_ppm"), message, str(spec.rate_error_ppm)))
    elif spec.period_s / speed >= longest_s:
        message = f"is too slow: the time between scans must be below {float(longest_s):.4g} s"
        problems.append(scene.problem((*key, "scan_rate_hz"), message, str(spec.rate_hz)))
    elif spec.period_s / speed * ticks_per_s < 1:
        message = f"is too fast: there are {ticks_per_s} ticks per second"
        problems.append(scene.problem((*key, "scan_rate_hz"), message, str(spec.rate_hz)))
    if spec.offset_s >= longest_s:
        message = f"must be below {float(longest_s):.4g} s"
        problems.append(scene.problem((*key, "offset_s"), message, str(spec.offset_s)))


def check_effects(scene: SceneFile, blocks: "Mapping[str, Block]", problems: list[Problem]) -> None:
    """Add effects that nothing would ever call, or of which only one could be told."""
    for name, block in blocks.items():
        cls, hooks = block.cls, block.cls.all_hooks()
        said = [
            f"{cls.path()} has an effect {effect.name!r} that acts on {effect.acts_on!r}, which is "
            f"no hook of the block{did_you_mean(effect.acts_on, hooks) or '; it has none'}"
            for effect in cls.effects
            if effect.acts_on not in hooks
        ]
        names = [effect.name for effect in cls.effects]
        said += [
            f"{cls.path()} has two effects named {twice!r}: each needs a name of its own"
            for twice in sorted({n for n in names if names.count(n) > 1})
        ]
        key = ("blocks", name, "type")
        problems += [scene.problem(key, message, block.type_name) for message in said]


def check_activity(
    scene: SceneFile,
    blocks: "Mapping[str, Block]",
    wires: Sequence[Wire],
    problems: list[Problem],
) -> None:
    """Add blocks that would never run, and wires that hold a message for a queued input."""
    faults: list[Problem] = []
    clocks = _clocks(scene, blocks, faults)
    if faults:  # said before
        return
    woken = {
        wire.target
        for wire in wires
        if wire.target in blocks and blocks[wire.target].cls.inputs[wire.input].mode == "trigger"
    }
    for name, block in blocks.items():
        alive = block.cls.clocked == "demand" or block.cls.process is not None or name in woken
        if not alive and name not in clocks:
            message = (
                "would never run: it has no scan clock, no process of its own, and no wire into "
                "a trigger input"
            )
            problems.append(scene.problem(("blocks", name), message))
    for wire in wires:
        if isinstance(wire.holds, dict) and wire.target in blocks:
            declared = blocks[wire.target].cls.inputs[wire.input]
            if declared.mode == "queued" or declared.many:
                message = (
                    f"{wire}: holds must be 'nothing': only a sampled or trigger input with one "
                    "writer can hold a message"
                )
                problems.append(scene.problem(("wires",), message))
                continue
            try:
                with strangers_code(TypeError, ValueError):
                    declared.message.initial(wire.holds)
            except (TypeError, ValueError, Left) as error:
                problems.append(scene.problem(("wires",), f"{wire}: holds: {error}"))
