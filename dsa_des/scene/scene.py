"""From a scene file to a scene that can be run, with every problem reported at once."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from html import escape
from pathlib import Path
from textwrap import wrap
from typing import Any

import networkx as nx

from dsa_des.block.component import Component, Context, Parameters, to_scene_number
from dsa_des.block.foreign_calls import REFUSALS, describe_error, is_stop_request
from dsa_des.block.registry import section_models
from dsa_des.errors import Problem, SceneError, UsageError, did_you_mean
from dsa_des.scene.block_table import Block, ProcessorParameters
from dsa_des.scene.changes import (
    CHANGES,
    Stretch,
    TimedChange,
    common_ticks_per_s,
    read_timed_changes,
    stretches_of,
)
from dsa_des.scene.checks import (
    check_blocks_can_run,
    check_effects,
    checked_ticks_per_s,
    read_block_classes_and_blocks,
    read_clocks,
    read_duration,
    read_outages,
    read_processors,
    read_sections,
    read_seed,
    read_text,
)
from dsa_des.scene.graph import build_graph, check_graph
from dsa_des.scene.keys import dotted_key
from dsa_des.scene.overrides import (
    IN_SET,
    IN_SWAP,
    Change,
    apply_changes,
    read_changes,
    read_python_changes,
    read_sets,
)
from dsa_des.scene.parameter_errors import problem_of_refusing_block
from dsa_des.scene.scene_file import SceneFile, read_scene_file
from dsa_des.scene.wiring import Wire, add_block_latencies, read_wires
from dsa_des.stretches.outage import Outage
from dsa_des.text.safe_text import escape_unprintable, shorten
from dsa_des.time.randomness import Streams

_TOP_LEVEL = (
    "title", "description", "duration_s", "seed", "blocks", "wires", "processors", "outages",
    CHANGES,
)  # fmt: skip
_TOLERANCE = "accuracy"
# Of what a scene is shown as in Python.
_WIDTH, _MOST_LINES = 84, 5


@dataclass(repr=False)
class Scene:
    """A scene that has been checked; `set` and `swap` return changed copies.

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
    changes : list of TimedChange
        What changes while a run lasts.
    stretches : list of Stretch
        What the scene is after each instant at which something changes; none where nothing does.
    outages : list of Outage
        Which blocks fail at random.
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
    changes: list[TimedChange] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)
    outages: list[Outage] = field(default_factory=list)
    #: What is in the file that it was made of, where that is no scene.
    about: list[str] = field(default_factory=list)
    #: The tables it was made of, changes included.
    _tables: SceneFile | None = field(default=None, init=False, compare=False)
    _origin: tuple[SceneFile, tuple[Change, ...]] | None = field(
        default=None, init=False, compare=False
    )

    def __repr__(self) -> str:
        return describe_scene(self)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(escape_unprintable(name))}<td>{escape(escape_unprintable(block.type_name))}"
            for name, block in self.blocks.items()
        )
        wires = "<br>".join(escape(escape_unprintable(wire)) for wire in self.wires)
        heading = escape(escape_unprintable(self.title))
        table = f"<table><tr><th>block</th><th>type</th></tr>{rows}</table>"
        return f"<p><b>{heading}</b>, seed {self.seed}</p>{table}<p>{wires}</p>"

    @property
    def origin(self) -> tuple[SceneFile, tuple[Change, ...]]:
        """The tables that the scene was made from, as read, and the changes made to them.

        Raises
        ------
        UsageError
            If it was not made by `dsa_des.load_scene`.
        """
        if self._origin is None:
            raise UsageError("this scene cannot be changed: it was not made by dsa_des.load_scene")
        return self._origin

    def set(self, values: Mapping[str, Any] | str, /, *more: str) -> "Scene":
        """Return a scene with other values; this one stays as it is.

        Parameters
        ----------
        values : mapping or str
            Dotted key → value, for example ``{"blocks.radar.scan_rate_hz": 2}``, or texts as
            ``--set`` takes them: ``"blocks.radar.scan_rate_hz=2"``. Relative paths are those of
            the working directory; a table may say ``extends``, as in a file.
        *more : str
            Further texts.

        Raises
        ------
        SceneError
            With every problem that the new scene has.
        """
        if isinstance(values, str):
            read, problems = read_sets((values, *more))
            if problems:
                raise SceneError(replace(one, source=IN_SET) for one in problems)
            values = dict(read)
        return self._change(values, IN_SET)

    def swap(
        self,
        types: "Mapping[str, str | type[Component]] | None" = None,
        /,
        **more: "str | type[Component]",
    ) -> "Scene":
        """Return a scene with other types in some blocks; this one stays as it is.

        A block keeps its name, its wires and the parameters that the new type knows; ``dropped``
        lists the others.

        Parameters
        ----------
        types, **more
            Block → type: a registered name, ``module:Class``, or a class.

        Raises
        ------
        SceneError
            With every problem that the new scene has.
        """
        return self._change({**(types or {}), **more}, IN_SWAP)

    def _change(self, values: Mapping[str, Any], source: str) -> "Scene":
        changes = read_python_changes(values, source)
        file, before = self.origin
        return scene_with_changes(file, (*before, *changes))

    @property
    def tolerance(self) -> dict[str, float]:
        """Largest allowed error by quantity, from ``[accuracy]``; empty without such a table."""
        accuracy = self.sections.get(_TOLERANCE)
        return {} if accuracy is None else accuracy.model_dump(exclude_none=True)

    @property
    def classes(self) -> dict[str, type[Component]]:
        """Class of each block."""
        return {name: block.cls for name, block in self.blocks.items()}

    def problem(self, key: str, message: str) -> Problem:
        """Return a `Problem` with this message at a dotted key of the scene."""
        return Problem(str(self.path), key, message)

    def problem_of_setup_refusal(self, name: str, text: str) -> Problem:
        """Return the problem with a block that refused to start, at the key that it names first."""
        if self._tables is None:
            return self.problem(dotted_key(("blocks", name)), text)
        return problem_of_refusing_block(self._tables, name, self.blocks[name].parameters, text)

    @property
    def blocks_by_shared_processor(self) -> dict[str, list[str]]:
        """Shared processor → the blocks whose messages queue at it."""
        queues: dict[str, list[str]] = {name: [] for name in sorted(self.processors)}
        for name, block in sorted(self.blocks.items()):
            if block.options.processor:
                queues[block.options.processor].append(name)
        return queues

    def resolved(self) -> dict[str, Any]:
        """Return the scene with every parameter written out, as plain TOML values."""
        tables: dict[str, Any] = {"title": self.title}
        if self.description:
            tables["description"] = self.description
        if self.duration_s is not None:
            tables["duration_s"] = to_scene_number(self.duration_s)
        tables["seed"] = self.seed
        tables["wires"] = [wire.to_entry() for wire in self.wires]
        for name, section in self.sections.items():
            values = section.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
            if values:
                tables[name] = values
        if self.changes:
            tables[CHANGES] = [change.to_table() for change in self.changes]
        if self.outages:
            written = (one.model_dump(mode="json", exclude_none=True) for one in self.outages)
            tables["outages"] = list(written)
        if self.processors:
            tables["processors"] = {
                name: parameters.model_dump(mode="json")
                for name, parameters in self.processors.items()
            }
        tables["blocks"] = {name: block.to_table() for name, block in self.blocks.items()}
        return tables


def load_scene(
    path: Path | str,
    *,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    duration_s: object = None,
) -> Scene:
    """Read a scene, apply command-line changes, check it and return it.

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
    return scene_from_tables(read_scene_file(path), sets, swaps, seed, duration_s)


def scene_from_tables(
    scene_file: SceneFile,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    duration_s: object = None,
) -> Scene:
    """Return the checked scene of tables with command-line changes; see `load_scene`."""
    changes, scene_file.problems = read_changes(sets, swaps, seed, duration_s)
    dropped = apply_changes(scene_file, changes)
    scene = check_scene(scene_file)
    scene.dropped = dropped
    return scene


def scene_with_changes(file: SceneFile, changes: tuple[Change, ...]) -> Scene:
    """Return the checked scene of tables with a program's changes; the tables stay unchanged."""
    changed = file.copy()
    dropped = apply_changes(changed, changes, IN_SET, IN_SWAP, "")
    scene = check_scene(changed)
    scene.dropped, scene._origin = dropped, (file, changes)
    return scene


def check_scene(scene_file: SceneFile) -> Scene:
    """Check merged tables and return them as a `Scene`.

    Raises
    ------
    SceneError
        With every problem found, after those that reading and changing it had.
    """
    data = scene_file.data
    for key, what, command in (("scene", "study", "study"), ("study", "case", "evidence")):
        if key in data and "blocks" not in data:
            message = f"is a {what}, not a scene: dsa-des {command} takes it"
            raise SceneError([Problem(str(scene_file.path), "", message)])
    known = (*_TOP_LEVEL, *section_models())
    for key in data:
        if key not in known:
            hint = did_you_mean(key, known)
            scene_file.report((key,), f"unknown key of a scene{hint}")
    title = read_text(scene_file, "title") or Path(scene_file.path).stem
    description = read_text(scene_file, "description")
    seed = read_seed(scene_file)
    duration = read_duration(scene_file)
    sections = read_sections(scene_file)
    notes: list[str] = []
    classes, blocks = read_block_classes_and_blocks(scene_file, notes)
    unsure: set[str] = set()
    processors = read_processors(scene_file, blocks)
    wires = add_block_latencies(
        read_wires(scene_file, classes, unsure),
        {name: block.options for name, block in blocks.items()},
    )
    graph = build_graph(list(classes), wires)
    check_graph(scene_file, graph, classes, unsure)
    clocks = read_clocks(scene_file, blocks)
    ticks_per_s = checked_ticks_per_s(scene_file, blocks, clocks, wires, duration, processors)
    check_effects(scene_file, blocks)
    if not unsure:
        check_blocks_can_run(scene_file, blocks, clocks, wires)
    scene = Scene(
        Path(scene_file.path), title, description, seed, duration, blocks, wires, graph,
        ticks_per_s, sections, processors, notes=notes,
    )  # fmt: skip
    scene._tables = scene_file
    scene.outages = read_outages(scene_file, classes, duration)
    if CHANGES in data:
        scene.changes = read_timed_changes(scene_file, classes, wires)
        scene.stretches = stretches_of(scene_file, scene, scene.changes, check_scene)
        scene.ticks_per_s = common_ticks_per_s(scene_file, scene)
    if scene_file.problems and len(sections) == len(section_models()):
        scene_file.problems += _problems_of_unbuildable_blocks(scene)
    scene_file.raise_if_problems()
    return scene


def _problems_of_unbuildable_blocks(scene: Scene) -> list[Problem]:
    """Return the problems of blocks that refuse to be built, to show along with other errors.

    Each is made alone: a file that is not there, or two intruders of one name, show by that.
    """
    problems: list[Problem] = []
    for name, block in scene.blocks.items():
        context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
        try:
            block.cls(name, block.parameters, context)
        except REFUSALS as error:
            problems.append(scene.problem_of_setup_refusal(name, describe_error(error)))
        except BaseException as error:
            if is_stop_request(error):
                raise
    return problems


def describe_scene(scene: Scene) -> str:
    """Return a description of a scene in at most ten lines: title, length, seed, blocks."""
    length = "as long as its sources" if scene.duration_s is None else f"{scene.duration_s} s"
    types = ", ".join(f"{name} = {block.type_name}" for name, block in scene.blocks.items())
    blocks = wrap(escape_unprintable(types), _WIDTH, break_long_words=True)
    lines = [
        f"Scene {shorten(repr(scene.title))} ({shorten(str(scene.path))})",
        f"  {length}, seed {scene.seed}, {len(scene.blocks)} blocks:",
        *(f"    {line}" for line in blocks[:_MOST_LINES]),
    ]
    if len(blocks) > _MOST_LINES:
        lines.append("    ...")
    if scene.dropped:
        lines.append(f"  dropped by swaps: {shorten(', '.join(scene.dropped), _WIDTH)}")
    return "\n".join(lines)
