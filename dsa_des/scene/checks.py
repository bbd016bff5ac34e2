"""Checks of a scene that need both its wiring and the parameters of its blocks.

Values of the wrong kind, clocks that 64-bit ticks cannot hold, blocks that would never run, and
wires that would hold a message where no block looks for it.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ValidationError

from dsa_des.block.component import Parameters
from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.registry import NotImported, UnknownType, find_component, section_models
from dsa_des.block.source_file import absolute_type_name
from dsa_des.errors import did_you_mean, nearest_name
from dsa_des.scene.block_table import (
    Block,
    BlockOptions,
    ProcessorParameters,
    split_engine_and_own_keys,
)
from dsa_des.scene.graph import unfed_required_inputs
from dsa_des.scene.keys import Key, dotted_key
from dsa_des.scene.overrides import drop_parameters_of_other_type
from dsa_des.scene.parameter_errors import explain_validation_error
from dsa_des.scene.scene_file import SceneFile
from dsa_des.scene.wiring import Wire, explain_bad_block_name
from dsa_des.stretches.outage import Outage
from dsa_des.text.safe_text import shorten
from dsa_des.time.clock import MAX_TICK, ClockSpec, common_ticks_per_second, parse_rational

if TYPE_CHECKING:
    from dsa_des.scene.block_table import Block, ProcessorParameters


# Assumed where a scene leaves its length to its sources.
_A_DAY = Fraction(86400)


def report_silent_conversions(scene: SceneFile, key: Key, given: Any, parsed: Any) -> None:
    """Report truth values or text that pydantic took for numbers, or numbers for truth values."""
    if isinstance(given, Mapping):
        fields = vars(parsed) if isinstance(parsed, BaseModel) else parsed
        for name, value in given.items():
            if isinstance(fields, Mapping) and name in fields:
                report_silent_conversions(scene, (*key, name), value, fields[name])
    elif isinstance(given, list) and isinstance(parsed, list | tuple):
        for index, pair in enumerate(zip(given, parsed, strict=False)):
            report_silent_conversions(scene, (*key, index), *pair)
    elif isinstance(parsed, bool) != isinstance(given, bool):
        if isinstance(parsed, bool | int | float):
            needed = "true or false" if isinstance(parsed, bool) else "a number"
            scene.report(key, f"must be {needed}", _str_subclass_to_str(given))
    elif isinstance(given, str) and isinstance(parsed, int | float):
        scene.report(key, "must be a number", _str_subclass_to_str(given))


def _str_subclass_to_str(value: Any) -> Any:
    return str(value) if isinstance(value, str) else value


def checked_ticks_per_s(
    scene: SceneFile,
    blocks: "Mapping[str, Block]",
    clocks: Mapping[str, ClockSpec | None],
    wires: Sequence[Wire],
    duration_s: Fraction | None,
    processors: "Mapping[str, ProcessorParameters] | None" = None,
) -> int:
    """Return the ticks per second that make all times whole; report times too long for 64 bits."""
    late = [wire for wire in wires if wire.total_delay_s or wire.jitter_s]
    times = [wire.total_delay_s for wire in late]
    known = {name: spec for name, spec in clocks.items() if spec is not None}
    for spec in known.values():
        times += spec.times_needing_whole_ticks()
    ticks_per_s = common_ticks_per_second(times)
    longest_s = Fraction(MAX_TICK, ticks_per_s)
    if longest_s <= _A_DAY and longest_s <= 1 + (duration_s or _A_DAY):
        shown = (
            shorten(f"{name} {spec.rate_hz} Hz + {spec.offset_s} s", 100)
            for name, spec in known.items()
        )
        message = (
            "these clocks have no common tick that fits 64 bits for the whole run: "
            f"{', '.join(shown)}; give offsets to fewer digits or rates as simpler fractions"
        )
        scene.report(("blocks",), message)
        return ticks_per_s
    limit = f"must be at most {float(longest_s):.4g} s: that is how far this scene's ticks reach"
    if duration_s is not None and 1 + duration_s >= longest_s:
        value = scene.data.get("duration_s")
        scene.report(("duration_s",), limit, value)
    for wire in late:
        if wire.total_delay_s + wire.jitter_s >= longest_s:
            scene.report(("wires",), f"{wire}: delay_s {limit}")
    for name, processor in (processors or {}).items():
        for what in ("service_s", "service_spread_s"):
            if (time_s := getattr(processor, what)) >= longest_s:
                key: Key = ("processors", name, what)
                scene.report(key, limit, str(time_s))
    for name, block in blocks.items():
        for what, value in block.parameters:
            # Exact times of a block's own, such as gates and pauses, are counted in ticks too.
            own = isinstance(value, Fraction) and what.endswith("_s") and what != "offset_s"
            if own and abs(value) >= longest_s:
                scene.report(("blocks", name, what), limit, str(value))
    for name, spec in known.items():
        _check_clock(scene, ("blocks", name), spec, ticks_per_s)
    return ticks_per_s


def read_clocks(scene: SceneFile, blocks: "Mapping[str, Block]") -> dict[str, ClockSpec | None]:
    """Return block → its scan clock or None; a class that fails to say is reported and left out."""
    clocks: dict[str, ClockSpec | None] = {}
    for name, block in blocks.items():
        try:
            with wrap_foreign_errors():
                spec = block.cls.clock_of(block.parameters)
        except ForeignFailure as error:
            message = f"{block.cls.import_path()} cannot say its clock (clock_of): {error}"
            scene.report(("blocks", name), message)
            continue
        if spec is None or isinstance(spec, ClockSpec):
            clocks[name] = spec
        else:
            of = block.cls.import_path()
            message = f"{of} gives no clock: clock_of must return a ClockSpec or None"
            scene.report(("blocks", name), message)
    return clocks


def _check_clock(scene: SceneFile, key: Key, spec: ClockSpec, ticks_per_s: int) -> None:
    longest_s = Fraction(MAX_TICK, ticks_per_s)
    speed = 1 + spec.rate_error_ppm / 1_000_000 if spec.rate_error_ppm else 1
    if speed <= 0:
        message = "must be greater than -1000000: a clock cannot stand still or run backwards"
        scene.report((*key, "rate_error_ppm"), message, str(spec.rate_error_ppm))
    elif spec.period_s / speed >= longest_s:
        message = f"is too slow: the time between scans must be below {float(longest_s):.4g} s"
        scene.report((*key, "scan_rate_hz"), message, str(spec.rate_hz))
    elif spec.period_s / speed * ticks_per_s < 1:
        message = f"is too fast: there are {ticks_per_s} ticks per second"
        scene.report((*key, "scan_rate_hz"), message, str(spec.rate_hz))
    if spec.offset_s >= longest_s:
        message = f"must be below {float(longest_s):.4g} s"
        scene.report((*key, "offset_s"), message, str(spec.offset_s))


def check_effects(scene: SceneFile, blocks: "Mapping[str, Block]") -> None:
    """Report effects that no hook of their block calls, and those of a block that share a name."""
    for name, block in blocks.items():
        cls, hooks = block.cls, block.cls.all_hooks()
        said = [
            f"{cls.import_path()} has an effect {effect.name!r} that acts on {effect.acts_on!r}, "
            f"which is "
            f"no hook of the block{did_you_mean(effect.acts_on, hooks) or '; it has none'}"
            for effect in cls.effects
            if effect.acts_on not in hooks
        ]
        names = [effect.name for effect in cls.effects]
        said += [
            f"{cls.import_path()} has two effects named {twice!r}: each needs a name of its own"
            for twice in sorted({n for n in names if names.count(n) > 1})
        ]
        key = ("blocks", name, "type")
        for message in said:
            scene.report(key, message, block.type_name)


def check_blocks_can_run(
    scene: SceneFile,
    blocks: "Mapping[str, Block]",
    clocks: Mapping[str, ClockSpec | None],
    wires: Sequence[Wire],
) -> None:
    """Report blocks that would never run, and initial messages for inputs that cannot hold one."""
    woken = {
        wire.target
        for wire in wires
        if wire.target in blocks and blocks[wire.target].cls.inputs[wire.input].mode == "trigger"
    }
    for name, block in blocks.items():
        alive = block.cls.clocked == "demand" or block.cls.process is not None or name in woken
        if unfed_required_inputs(name, block.cls, wires):  # that is said already
            continue
        if not alive and name in clocks and clocks[name] is None:
            message = (
                "would never run: it has no scan clock, no process of its own, and no wire into "
                "a trigger input"
            )
            scene.report(("blocks", name), message)
    for wire in wires:
        if isinstance(wire.holds, dict) and wire.target in blocks:
            declared = blocks[wire.target].cls.inputs[wire.input]
            if declared.mode == "queued" or declared.many:
                message = (
                    f"{wire}: holds must be 'nothing': only a sampled or trigger input with one "
                    "writer can hold a message"
                )
                scene.report(("wires",), message)
                continue
            try:
                with wrap_foreign_errors(TypeError, ValueError):
                    declared.message.make_initial(wire.holds)
            except (TypeError, ValueError, ForeignFailure) as error:
                scene.report(("wires",), f"{wire}: holds: {error}")


_MAX_SEED = 2**63
_Model = TypeVar("_Model", bound=BaseModel)


def read_text(scene_file: SceneFile, key: str) -> str:
    """Return a text of a scene, such as its title; empty where there is none."""
    value = scene_file.data.get(key, "")
    if not isinstance(value, str):
        scene_file.report((key,), "must be text", value)
        return ""
    return str(value)


def read_seed(scene_file: SceneFile) -> int:
    """Return the seed; 0 where there is none."""
    seed = scene_file.data.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < _MAX_SEED:
        message = f"must be a whole number from 0 to {_MAX_SEED - 1}"
        scene_file.report(("seed",), message, seed)
        return 0
    return seed


def read_duration(scene_file: SceneFile) -> Fraction | None:
    """Return the length of the run in s; None where the scene leaves it to its sources."""
    if "duration_s" not in scene_file.data:
        return None
    value = scene_file.data["duration_s"]
    try:
        duration = parse_rational(value)
        if duration <= 0:
            raise ValueError("must be greater than 0")
    except ValueError as error:
        scene_file.report(("duration_s",), str(error), value)
        return None
    return duration


def read_sections(scene_file: SceneFile) -> dict[str, Parameters]:
    """Return name → section for the tables of no block; those left out have their defaults."""
    read = {
        name: parse_table(scene_file, (name,), model, scene_file.data.get(name, {}))
        for name, model in section_models().items()
    }
    return {name: section for name, section in read.items() if section is not None}


def parse_table(
    scene_file: SceneFile, key: Key, model: type[_Model], table: Any, what: str = ""
) -> _Model | None:
    """Return a table as an instance of `model`; None, with a report, if anything is wrong.

    Messages call it `what`, by default by its key.
    """
    if not isinstance(table, dict):
        scene_file.report(key, "must be a table", table)
        return None
    try:
        read = model.model_validate(table)
    except ValidationError as error:
        scene_file.problems += explain_validation_error(
            scene_file, key, what or f"[{dotted_key(key)}]", model, error
        )
        return None
    report_silent_conversions(scene_file, key, table, read)
    return read


def read_block_classes_and_blocks(
    scene_file: SceneFile, notes: list[str]
) -> tuple[dict[str, Any], dict[str, Block]]:
    """Return block → its class, None if unknown, and name → `Block` for the faultless blocks."""
    tables = scene_file.data.get("blocks", {})
    classes: dict[str, Any] = {}
    blocks: dict[str, Block] = {}
    if not isinstance(tables, dict) or not tables:
        scene_file.report(("blocks",), "a scene needs at least one block")
        return classes, blocks
    for name in sorted(tables):
        key: Key = ("blocks", name)
        table = tables[name]
        classes[name] = None
        if reason := explain_bad_block_name(str(name)):
            scene_file.report(key, reason, str(name))
        if not isinstance(table, dict):
            scene_file.report(key, "must be a table", table)
            continue
        type_name = table.get("type")
        if not isinstance(type_name, str):
            typed = [one for one, of in tables.items() if isinstance(of, dict) and "type" in of]
            close = nearest_name(str(name), typed)
            message = 'needs a type, for example type = "radar.swerling"'
            message += f"; or did you mean the block {close!r}?" if close else ""
            scene_file.report((*key, "type"), message)
            continue
        try:
            cls = find_component(type_name, dotted_key((*key, "type")), (scene_file.path.parent,))
        except NotImported:
            continue
        except UnknownType as error:
            scene_file.report((*key, "type"), str(error), str(type_name))
            continue
        classes[name] = cls
        notes += drop_parameters_of_other_type(scene_file, name, cls)
        for index, lost in scene_file.replaced.items():
            if index[:2] == key:
                source, gone = scene_file.source_file_of(index), ", ".join(lost)
                notes.append(
                    f"blocks.{name}: {dotted_key(index[2:])} of {source} takes the place of the "
                    f"whole list, {gone} too; a table [{dotted_key(index)}.NAME] changes one item "
                    "or adds one"
                )
        extra, given = split_engine_and_own_keys(table, cls.Parameters)
        given = _fill_from_first_file(scene_file, key, given, cls.Parameters)
        try:
            with wrap_foreign_errors(ValidationError):
                parameters = cls.Parameters.model_validate(given)
                cls = classes[name] = cls.class_for(parameters)
            options = BlockOptions.model_validate(extra)
        except ValidationError as error:
            scene_file.problems += explain_validation_error(
                scene_file, key, str(type_name), cls.Parameters, error, BlockOptions.model_fields
            )
            continue
        except ForeignFailure as error:
            message = f"{cls.import_path()} cannot take its parameters: {error}"
            scene_file.report(key, message)
            continue
        report_silent_conversions(scene_file, key, given, parameters)
        report_silent_conversions(scene_file, key, extra, options)
        blocks[name] = Block(name, str(absolute_type_name(type_name)), cls, parameters, options)
    return classes, blocks


def _fill_from_first_file(
    scene_file: SceneFile, key: Key, given: dict[str, Any], model: Any
) -> dict[str, Any]:
    """Return a block's parameters in which inner tables get missing keys from the values that stood
    beside them in the file that first wrote them.
    """
    for (name, inner), outer in getattr(model, "as_written_with", {}).items():
        table, beside = given.get(name), scene_file.beside.get((*key, name))
        if isinstance(table, dict) and beside is not None and inner not in table:
            then = beside.get(outer, model.model_fields[outer].default)
            given = {**given, name: {**table, inner: then}}
    return given


def read_processors(
    scene_file: SceneFile, blocks: Mapping[str, Block]
) -> dict[str, ProcessorParameters]:
    """Return name → shared processor; blocks that name a processor the scene lacks are reported."""
    tables = scene_file.data.get("processors", {})
    if not isinstance(tables, dict):
        scene_file.report(("processors",), "must hold one table per processor")
        return {}
    read = {
        name: parse_table(scene_file, ("processors", name), ProcessorParameters, tables[name])
        for name in sorted(tables)
    }
    for name, block in blocks.items():
        wanted = block.options.processor
        if wanted is not None and wanted not in tables:
            declared = did_you_mean(wanted, tables) or f"; [processors.{wanted}] would declare it"
            message = f"the scene has no such processor{declared}"
            scene_file.report(("blocks", name, "processor"), message, str(wanted))
    return {name: processor for name, processor in read.items() if processor is not None}


#: Outages of a run, on average: more are a slip of the pen.
_MOST_OUTAGES = 100_000


def read_outages(scene_file: SceneFile, blocks: Mapping[str, Any], duration_s: Any) -> list[Outage]:
    """Return the outages of a scene; what is wrong with them is added to its problems."""
    entries = scene_file.data.get("outages", [])
    if not isinstance(entries, list):
        scene_file.report(("outages",), "must be a list of tables: [[outages]]", entries)
        return []
    read: list[Outage] = []
    for number, entry in enumerate(entries):
        outage = parse_table(scene_file, ("outages", number), Outage, entry)
        if outage is None:
            continue
        for key, message, value in outage.refusals(blocks):
            scene_file.report(("outages", number, *key), message, value)
        if outage.key in [one.key for one in read]:
            message = "fails already: give each a name of its own, which keys its draws"
            scene_file.report(("outages", number), message, outage.key)
        if duration_s is not None and duration_s > _MOST_OUTAGES * outage.mean_between_s:
            message = f"must be longer: at most {_MOST_OUTAGES:,} failures of a run are drawn"
            scene_file.report(("outages", number, "mean_between_s"), message, outage.mean_between_s)
        read.append(outage)
    return read
