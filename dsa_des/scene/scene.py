"""From a scene file to a scene that can be run, with every problem reported at once."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from textwrap import wrap
from typing import Any

import networkx as nx
from pydantic import ValidationError

from dsa_des.block.component import Component, Parameters, as_written
from dsa_des.block.registry import NotImported, UnknownType, find
from dsa_des.block.sections import section_models
from dsa_des.block.source_file import absolute
from dsa_des.block.strangers import Left, strangers_code
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.block import Block
from dsa_des.scene.changeable import Changeable
from dsa_des.scene.checks import check_activity, check_effects, check_lookalikes, check_times
from dsa_des.scene.graph import build_graph, check_graph, windowed_blocks
from dsa_des.scene.options import BlockOptions, split_options, with_latencies
from dsa_des.scene.overrides import apply_set, apply_swap, drop_of_other_type
from dsa_des.scene.parameter_errors import explain
from dsa_des.scene.processor import ProcessorParameters
from dsa_des.scene.scene_file import COMMAND_LINE, Key, SceneFile, dotted, read_scene_file
from dsa_des.scene.wiring import Wire, read_wires
from dsa_des.text.safe_text import printable, shortened
from dsa_des.time.clock import parse_rational

_TOP_LEVEL = ("title", "description", "duration_s", "seed", "blocks", "wires", "processors")
_TOLERANCE = "accuracy"
_MAX_SEED = 2**63
# Of what a scene is shown as in Python.
_WIDTH, _MOST_LINES = 84, 5


@dataclass(repr=False)
class Scene(Changeable):
    """A checked scene; `set` and `swap` give changed ones.

    Parameters
    ----------
    path : Path
    title : str
    description : str
    seed : int
    duration_s : Fraction or None
        None when the scene leaves it to its sources.
    blocks : dict
        Blocks by name, sorted.
    wires : list of Wire
        Sorted.
    graph : networkx.DiGraph
    ticks_per_s : int
        The resolution in which every clock, offset and delay of the scene is exact.
    sections : dict
        Tables that belong to no block, by name; those the scene leaves out have their defaults.
    processors : dict
        Shared processors by name.
    dropped : list of str
        Dotted keys of parameters that a swap dropped.
    notes : list of str
        What else was done to the scene that its files do not show.
    """

    path: Path
    title: str
    description: str
    seed: int
    duration_s: Fraction | None
    blocks: dict[str, Block]
    wires: list[Wire]
    graph: nx.DiGraph
    ticks_per_s: int
    sections: dict[str, Parameters] = field(default_factory=dict)
    processors: dict[str, ProcessorParameters] = field(default_factory=dict)
    dropped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __repr__(self) -> str:
        return described(self)

    @classmethod
    def _checked(cls, scene_file: SceneFile, problems: list[Problem]) -> "Scene":
        return check_scene(scene_file, problems)

    @property
    def tolerance(self) -> dict[str, float]:
        """What ``[accuracy]`` allows, by quantity; empty when the scene has no such table."""
        accuracy = self.sections.get(_TOLERANCE)
        return {} if accuracy is None else accuracy.model_dump(exclude_none=True)

    @property
    def classes(self) -> dict[str, type[Component]]:
        """Class of each block."""
        return {name: block.cls for name, block in self.blocks.items()}

    def problem(self, key: str, message: str) -> Problem:
        """Return what is wrong with a dotted key of this scene."""
        return Problem(str(self.path), key, message)

    def look_ahead_blocks(self) -> set[str]:
        """Return the blocks that may run in look-ahead windows."""
        queued = [name for name, block in self.blocks.items() if block.options.processor]
        return windowed_blocks(self.graph, self.classes, queued)

    def resolved(self) -> dict[str, Any]:
        """Return the scene with every parameter written out, as plain TOML values."""
        tables: dict[str, Any] = {"title": self.title}
        if self.description:
            tables["description"] = self.description
        if self.duration_s is not None:
            tables["duration_s"] = as_written(self.duration_s)
        tables["seed"] = self.seed
        tables["wires"] = [_wire_table(wire) for wire in self.wires]
        for name, section in self.sections.items():
            values = section.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
            if values:
                tables[name] = values
        if self.processors:
            tables["processors"] = {
                name: parameters.model_dump(mode="json")
                for name, parameters in self.processors.items()
            }
        tables["blocks"] = {
            name: {
                "type": block.type_name,
                **block.options.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
                **block.parameters.model_dump(mode="json", exclude_none=True),
            }
            for name, block in self.blocks.items()
        }
        return tables


def load_scene(
    path: Path | str,
    *,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    duration_s: object = None,
) -> Scene:
    """Read, override and check a scene.

    Parameters
    ----------
    path : path of the TOML file
    sets, swaps : texts ``key=value`` and ``block=type``
    seed, duration_s : override the scene's own

    Raises
    ------
    SceneError
        With every problem found.
    """
    return load_tables(
        read_scene_file(path), sets=sets, swaps=swaps, seed=seed, duration_s=duration_s
    )


def load_tables(scene_file: SceneFile, **overrides: Any) -> Scene:
    """Override and check tables that were read; see `load_scene`."""
    problems, dropped = _overridden(scene_file, **overrides)
    scene = check_scene(scene_file, problems)
    scene.dropped = dropped
    return scene


def open_scene(path: Path | str, **overrides: Any) -> tuple[SceneFile, list[Problem], list[str]]:
    """Read and override a scene without checking it.

    Parameters
    ----------
    path, **overrides
        As for `load_scene`.

    Returns
    -------
    SceneFile
    list of Problem
        What is wrong with the overrides.
    list of str
        Dotted keys of parameters that a swap dropped.

    Raises
    ------
    SceneError
        If a file cannot be read.
    """
    scene_file = read_scene_file(path)
    return scene_file, *_overridden(scene_file, **overrides)


def _overridden(
    scene_file: SceneFile,
    *,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    duration_s: object = None,
) -> tuple[list[Problem], list[str]]:
    """Override values, and return what is wrong and which parameters a swap dropped."""
    problems: list[Problem] = []
    dropped: list[str] = []
    for swap in swaps:
        found, gone = apply_swap(scene_file, swap)
        problems += found
        dropped += gone
    for assignment in sets:
        problems += apply_set(scene_file, assignment)
    if seed is not None:
        _override(scene_file, "seed", seed)
    if duration_s is not None:
        _override(scene_file, "duration_s", duration_s)
    return problems, dropped


def check_scene(scene_file: SceneFile, problems: list[Problem] | None = None) -> Scene:
    """Validate merged tables into a `Scene`.

    Raises
    ------
    SceneError
        With every problem found, after those given.
    """
    problems = [] if problems is None else problems
    data = scene_file.data
    known = (*_TOP_LEVEL, *section_models())
    for key in data:
        if key not in known:
            hint = did_you_mean(key, known)
            problems.append(scene_file.problem((key,), f"unknown key of a scene{hint}"))
    title = _text(scene_file, "title", problems) or Path(scene_file.path).stem
    description = _text(scene_file, "description", problems)
    seed = _seed(scene_file, problems)
    duration = _duration(scene_file, problems)
    sections = _sections(scene_file, problems)
    notes: list[str] = []
    classes, blocks = _blocks(scene_file, problems, notes)
    unsure: set[str] = set()
    processors = _processors(scene_file, blocks, problems)
    wires = with_latencies(
        read_wires(scene_file, classes, problems, unsure),
        {name: block.options for name, block in blocks.items()},
    )
    graph = build_graph(list(classes), wires)
    check_graph(scene_file, graph, classes, problems, unsure)
    ticks_per_s = check_times(scene_file, blocks, wires, duration, problems, processors)
    check_effects(scene_file, blocks, problems)
    if not unsure:
        check_activity(scene_file, blocks, wires, problems)
    if problems:
        raise SceneError(problems)
    return Scene(
        Path(scene_file.path),
        title,
        description,
        seed,
        duration,
        blocks,
        wires,
        graph,
        ticks_per_s,
        sections,
        processors,
        notes=notes,
    )


def described(scene: Scene) -> str:
    """Return a scene in at most ten lines."""
    length = "as long as its sources" if scene.duration_s is None else f"{scene.duration_s} s"
    types = ", ".join(f"{name} = {block.type_name}" for name, block in scene.blocks.items())
    blocks = wrap(printable(types), _WIDTH, break_long_words=True)
    lines = [
        f"Scene {shortened(repr(scene.title))} ({shortened(str(scene.path))})",
        f"  {length}, seed {scene.seed}, {len(scene.blocks)} blocks:",
        *(f"    {line}" for line in blocks[:_MOST_LINES]),
    ]
    if len(blocks) > _MOST_LINES:
        lines.append("    ...")
    if scene.dropped:
        lines.append(f"  dropped by swaps: {shortened(', '.join(scene.dropped), _WIDTH)}")
    return "\n".join(lines)


def _override(scene_file: SceneFile, key: str, value: object) -> None:
    scene_file.data[key] = value
    scene_file.sources[(key,)] = COMMAND_LINE


def _text(scene_file: SceneFile, key: str, problems: list[Problem]) -> str:
    value = scene_file.data.get(key, "")
    if not isinstance(value, str):
        problems.append(scene_file.problem((key,), "must be text", value))
        return ""
    return str(value)


def _seed(scene_file: SceneFile, problems: list[Problem]) -> int:
    seed = scene_file.data.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < _MAX_SEED:
        message = f"must be a whole number from 0 to {_MAX_SEED - 1}"
        problems.append(scene_file.problem(("seed",), message, seed))
        return 0
    return seed


def _duration(scene_file: SceneFile, problems: list[Problem]) -> Fraction | None:
    if "duration_s" not in scene_file.data:
        return None
    value = scene_file.data["duration_s"]
    try:
        duration = parse_rational(value)
        if duration <= 0:
            raise ValueError("must be greater than 0")
    except ValueError as error:
        problems.append(scene_file.problem(("duration_s",), str(error), value))
        return None
    return duration


def _sections(scene_file: SceneFile, problems: list[Problem]) -> dict[str, Parameters]:
    sections: dict[str, Parameters] = {}
    for name, model in section_models().items():
        table = scene_file.data.get(name, {})
        if not isinstance(table, dict):
            problems.append(scene_file.problem((name,), "must be a table", table))
            continue
        try:
            sections[name] = model.model_validate(table)
        except ValidationError as error:
            problems += explain(scene_file, (name,), f"[{name}]", model, error)
    return sections


def _blocks(
    scene_file: SceneFile, problems: list[Problem], notes: list[str]
) -> tuple[dict[str, Any], dict[str, Block]]:
    tables = scene_file.data.get("blocks", {})
    classes: dict[str, Any] = {}
    blocks: dict[str, Block] = {}
    if not isinstance(tables, dict) or not tables:
        problems.append(scene_file.problem(("blocks",), "a scene needs at least one block"))
        return classes, blocks
    for name in sorted(tables):
        key: Key = ("blocks", name)
        table = tables[name]
        classes[name] = None
        if not isinstance(table, dict):
            problems.append(scene_file.problem(key, "must be a table", table))
            continue
        type_name = table.get("type")
        if not isinstance(type_name, str):
            message = 'needs a type, for example type = "radar.swerling"'
            problems.append(scene_file.problem((*key, "type"), message))
            continue
        try:
            cls = find(type_name, dotted((*key, "type")), (scene_file.path.parent,))
        except NotImported:
            continue
        except UnknownType as error:
            problems.append(scene_file.problem((*key, "type"), str(error), str(type_name)))
            continue
        classes[name] = cls
        notes += drop_of_other_type(scene_file, name, cls)
        extra, given = split_options(table, cls.Parameters)
        try:
            with strangers_code(ValidationError):
                parameters = cls.Parameters.model_validate(given)
            options = BlockOptions.model_validate(extra)
        except ValidationError as error:
            problems += explain(scene_file, key, str(type_name), cls.Parameters, error)
            continue
        except Left as error:
            message = f"{cls.path()} cannot take its parameters: {error}"
            problems.append(scene_file.problem(key, message))
            continue
        check_lookalikes(scene_file, key, given, cls.Parameters, problems)
        blocks[name] = Block(name, str(absolute(type_name)), cls, parameters, options)
    return classes, blocks


def _processors(
    scene_file: SceneFile, blocks: Mapping[str, Block], problems: list[Problem]
) -> dict[str, ProcessorParameters]:
    tables = scene_file.data.get("processors", {})
    if not isinstance(tables, dict):
        problems.append(scene_file.problem(("processors",), "must hold one table per processor"))
        return {}
    found: dict[str, ProcessorParameters] = {}
    for name in sorted(tables):
        key: Key = ("processors", name)
        if not isinstance(tables[name], dict):
            problems.append(scene_file.problem(key, "must be a table", tables[name]))
            continue
        try:
            found[name] = ProcessorParameters.model_validate(tables[name])
        except ValidationError as error:
            problems += explain(scene_file, key, f"[{dotted(key)}]", ProcessorParameters, error)
    for name, block in blocks.items():
        wanted = block.options.processor
        if wanted is not None and wanted not in tables:
            message = f"the scene has no such processor{did_you_mean(wanted, tables)}"
            problems.append(scene_file.problem(("blocks", name, "processor"), message, str(wanted)))
    return found


def _wire_table(wire: Wire) -> dict[str, Any] | str:
    plain = Wire(wire.source, wire.output, wire.target, wire.input)
    if plain == replace(wire, latency_s=plain.latency_s, queued=plain.queued):
        return str(wire)
    table: dict[str, Any] = {
        "from": f"{wire.source}.{wire.output}",
        "to": f"{wire.target}.{wire.input}",
    }
    if wire.delay_scans:
        table["delay"] = f"{wire.delay_scans} scan{'s' if wire.delay_scans > 1 else ''}"
    elif wire.delay_s:
        table["delay_s"] = as_written(wire.delay_s)
    if wire.jitter_s:
        table["jitter_s"] = as_written(wire.jitter_s)
    if wire.drop_probability:
        table["drop_probability"] = wire.drop_probability
    if wire.holds is not None:
        table["holds"] = wire.holds
    return table
