"""The record of a study in its folder: enough to read its tables without scene or blocks.

It is written when the study is begun and checked when it is read, since a folder may come from a
stranger. Nothing that it names is opened or imported.
"""

import json
from collections.abc import Mapping
from dataclasses import astuple, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator

from dsa_des.block.mark import Mark, marks_of
from dsa_des.record.version import __version__
from dsa_des.scene.scene import Scene
from dsa_des.studies.axes import Axis
from dsa_des.studies.metric import RatioOf, Result, Told
from dsa_des.studies.study import Study, run_command, set_text
from dsa_des.studies.study_tables import json_safe

if TYPE_CHECKING:
    import pyarrow as pa

_Whole = Annotated[int, Field(ge=0, lt=2**63)]
_Marker = Literal["o", "s", "D", "d", "^", "v", "<", ">", "P", "X", "p", "h", "8", "*"]
_Label = str | int | float


class StrictRecord(BaseModel):
    """What a file of ours holds: nothing is converted, and a number is finite."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


class AxisRecord(StrictRecord):
    """An axis: its column, its values, and what each changes in the scene, as texts."""

    column: str
    values: list[_Label]
    over: bool
    numeric: bool
    #: Whether its numbers are names: nothing lies between two of them.
    category: bool = False
    sets: list[list[tuple[str, str]]]
    swaps: list[list[tuple[str, str]]]


class DrawRecord(StrictRecord):
    """A drawn value: its key in the scene, its column, and whether it is a number."""

    key: str
    column: str
    numeric: bool


class RatioRecord(StrictRecord):
    """Columns of a ratio; see `RatioOf`."""

    below: str
    above: str
    weight: str | None = None
    cluster: str | None = None
    only: tuple[str, str] | None = None


class ResultRecord(StrictRecord):
    """A result of a metric; see `Result`."""

    name: str
    kind: Literal["number", "fraction", "event", "share", "ratio", "class"]
    meaning: str
    cut_off: str | None = None
    told: tuple[str, str, str] | None = None
    block: str | None = None
    mark: tuple[Annotated[str, Field(pattern="^#[0-9A-Fa-f]{6}$")], _Marker] | None = None
    ratio: RatioRecord | None = None


class StopRecord(StrictRecord):
    """When a cell had enough replicas."""

    metric: str
    half_width: float


class FigureRecord(StrictRecord):
    """A figure; see `read_figures`."""

    kind: Literal["axis", "heat", "map", "polar", "histogram", "cdf", "series", "run"]
    metric: str | None = None
    title: str | None = None
    axis: str | None = None
    lines: str | None = None
    x: str | None = None
    y: str | None = None
    limits: list[float] = []
    freedom: float | None = None
    cell: _Whole = 0
    replica: _Whole = 0


class RequirementRecord(StrictRecord):
    """A limit on a result; see `Requirement`."""

    metric: str
    axis: str
    limit: float
    below: bool = True
    cheap_last: bool = False


class StudyHead(StrictRecord):
    """Which study a folder holds."""

    #: The study's file.
    study: str
    #: Of all that fixes its results.
    study_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class StudyRecord(StudyHead):
    """A study as its tables need it.

    Raises
    ------
    pydantic.ValidationError
        If something is missing, of a wrong type, or names what is not there.
    """

    title: str
    scene: str
    seed: int
    cells: _Whole
    replicas: _Whole
    axes: list[AxisRecord]
    draws: list[DrawRecord]
    results: list[ResultRecord]
    sets: list[tuple[str, str]]
    swaps: list[tuple[str, str]]
    compare: tuple[str, _Label] | None
    stop_when: StopRecord | None
    confidence: Annotated[float, Field(gt=0.5, lt=1.0)]
    interval: Literal["t", "bootstrap"]
    figures: list[FigureRecord]
    requirements: list[RequirementRecord] = []
    compare_weight: str | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "StudyRecord":
        axes = {axis.column: axis for axis in self.axes}
        columns = self.schema_of_parts().names
        if len(set(columns)) < len(columns):
            raise ValueError("two columns have one name")
        for result in self.results:
            if (result.kind == "ratio") != (result.ratio is not None):
                raise ValueError("a ratio, and nothing else, says of which columns it is")
            if result.ratio is not None and not set(RatioOf(**vars(result.ratio)).reads()) <= {
                *columns
            }:
                raise ValueError("a ratio names no column")
        if self.compare is not None and self.compare[0] not in axes:
            raise ValueError("compare names no axis")
        if any(len(a.values) != len(a.sets) or len(a.values) != len(a.swaps) for a in self.axes):
            raise ValueError("an axis has values without changes")
        for figure in self.figures:
            for name in (figure.axis, figure.lines, figure.x, figure.y):
                if name is not None and name not in axes:
                    raise ValueError("a figure names no axis")
            if figure.kind == "map" and len(axes) < 2:
                raise ValueError("a map needs two axes")
            if figure.kind == "polar" and figure.axis and not axes[figure.axis].numeric:
                raise ValueError("a polar figure needs numbers")
            if figure.kind != "run" and figure.metric is None:
                raise ValueError("a figure needs a metric")
        numbers = {result.name for result in self.results if result.kind == "number"}
        if self.compare_weight is not None and self.compare_weight not in numbers:
            raise ValueError("compare names no number as its weight")
        if any(item.axis not in axes for item in self.requirements):
            raise ValueError("a requirement names no axis")
        return self

    def schema_of_parts(self) -> "pa.Schema":
        """Return the columns of the study's parts."""
        from dsa_des.studies.chunk import columns_of

        return columns_of(
            [(axis.column, axis.numeric) for axis in self.axes],
            [(draw.column, draw.numeric) for draw in self.draws],
            self.results_list(),
        )

    @property
    def over(self) -> tuple[str, ...]:
        """Columns of axes that are a sample."""
        return tuple(axis.column for axis in self.axes if axis.over)

    def results_list(self) -> list[Result]:
        """Return what the metrics gave."""
        return [
            Result(
                r.name, r.kind, r.meaning, r.cut_off,
                None if r.told is None else Told(*r.told), r.block, r.mark,
                None if r.ratio is None else RatioOf(**vars(r.ratio)),
            )
            for r in self.results
        ]  # fmt: skip

    def command(self, row: Mapping[str, Any]) -> str:
        """Return the command that repeats a run.

        Parameters
        ----------
        row : mapping
            Column → value of its row in the parts.
        """
        return run_command(self.scene, int(row["seed"]), *self.changes(row))

    def changes(
        self, row: Mapping[str, Any]
    ) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
        """Return the swaps and the values that make the scene of a run."""
        swaps, sets = list(self.swaps), list(self.sets)
        place = int(row["cell"])
        places = []
        for axis in reversed(self.axes):
            place, index = divmod(place, len(axis.values))
            places.append(index)
        for axis, index in zip(self.axes, reversed(places), strict=True):
            swaps += axis.swaps[index]
            sets += axis.sets[index]
        sets += [(draw.key, set_text(row[draw.column])) for draw in self.draws]
        return swaps, sets


def results_of(study: Study) -> list[Result]:
    """Return the results that a study's metrics give."""
    scene = study.scene(0)
    found = [result for spec in study.metrics for result in spec.build(scene).results()]
    marks = marks_of({name: block.cls for name, block in scene.blocks.items()})
    return [_marked(result, scene, marks) for result in found]


def _marked(result: Result, scene: Scene, marks: Mapping[str, Mark]) -> Result:
    """Return a result with the mark of its block, if that block's class has one."""
    name = result.block or result.name.partition(".")[2]
    if name not in scene.blocks or getattr(scene.blocks[name].cls, "mark", None) is None:
        return result
    return replace(result, mark=(marks[name].colour, marks[name].marker))


def is_category(axis: Axis, scene: Scene) -> bool:
    """Return whether an axis sets what is one of a few names: a type, a flag, a model's number."""
    for key, _ in axis.sets[0] if axis.sets else ():
        parts = key.split(".")
        if len(parts) != 3 or parts[0] != "blocks" or parts[1] not in scene.blocks:
            return False
        known = scene.blocks[parts[1]].cls.Parameters.model_fields.get(parts[2])
        if known is None or not _of_names(known.annotation):
            return False
    return bool(axis.swaps and axis.swaps[0]) or bool(axis.sets and axis.sets[0])


def _of_names(annotation: Any) -> bool:
    if get_origin(annotation) is Literal or annotation is bool:
        return True
    parts = [part for part in get_args(annotation) if part is not type(None)]
    return bool(parts) and all(_of_names(part) for part in parts)


def record_text(study: Study, digest: str) -> str:
    """Return the content of ``study.json``.

    Parameters
    ----------
    study : Study
    digest : str
        SHA-256 of all that fixes its results.
    """
    from dsa_des.studies.chunk import draw_column

    content = {
        "study": str(study.path.resolve()),
        "study_sha256": digest,
        "title": study.title,
        "scene": str(study.scene_path.resolve()),
        "seed": study.seed,
        "cells": len(study.cells),
        "replicas": study.replicas,
        "axes": [
            {
                "column": axis.column,
                "values": axis.labels,
                "over": axis.column in study.over,
                "numeric": axis.numeric,
                "category": is_category(axis, study.scene(0)),
                "sets": [[(key, set_text(value)) for key, value in one] for one in axis.sets],
                "swaps": axis.swaps,
            }
            for axis in study.axes
        ],
        "draws": [
            {"key": draw.key, "column": draw_column(draw.key), "numeric": draw.numeric}
            for draw in study.draws
        ],
        "results": [
            vars(result)
            | {"told": None if result.told is None else astuple(result.told)}
            | {"ratio": None if result.ratio is None else vars(result.ratio)}
            for result in results_of(study)
        ],
        "sets": [(key, set_text(value)) for key, value in study.sets],
        "swaps": study.swaps,
        "compare": study.baseline,
        "compare_weight": study.compare_weight,
        "stop_when": None if study.stop_when is None else vars(study.stop_when),
        "confidence": study.confidence,
        "interval": study.interval,
        "figures": [
            {k: v if isinstance(v, int | float | list) else str(v) for k, v in figure.items()}
            for figure in study.figures
        ],
        "requirements": [vars(requirement) for requirement in study.requirements],
        "version": __version__,
        "tables": study.tables,
    }
    return json.dumps(json_safe(content), indent=2, allow_nan=False) + "\n"
