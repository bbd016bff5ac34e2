"""Tables of a study file: its keys, figures and requirements, and paths seen from anywhere."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from dsa_des.block.component import SourcedText
from dsa_des.errors import did_you_mean
from dsa_des.results.record import FigureKind, FigureRecord
from dsa_des.scene.checks import parse_table
from dsa_des.scene.keys import Key
from dsa_des.scene.scene_file import SceneFile
from dsa_des.studies.axes import Axis
from dsa_des.text.run_commands import format_set_option_value

#: Tables that name axes and results; ``wires[4].drop_probability`` is no pattern of files there.
_NAMING_RESULTS = ("title", "description", "figures", "compare", "over", "stop_when", "allocate",
                   "splitting")  # fmt: skip
#: The key of an axis whose values are patterns of file names.
_PATTERNS = "files"


def resolve_tables(
    data: Mapping[str, Any], swaps: Iterable[tuple[str, list[str]]]
) -> dict[str, Any]:
    """Return a study's tables with absolute paths, and with `swaps` added as axes."""
    tables = {
        key: value if key in _NAMING_RESULTS else _make_paths_absolute(value)
        for key, value in data.items()
    }
    for block, types in swaps:
        tables.setdefault("axes", {})[f"swap.{block}"] = types
    return tables


def _make_paths_absolute(value: Any, key: str = "") -> Any:
    if isinstance(value, Mapping):
        return {name: _make_paths_absolute(item, str(name)) for name, item in value.items()}
    if isinstance(value, list):
        return [_make_paths_absolute(item, key) for item in value]
    if isinstance(value, SourcedText) and hasattr(value, "folder"):
        if key == _PATTERNS and any(sign in value for sign in "*?["):
            try:
                return str((value.folder / Path(value).expanduser()).resolve())
            except (OSError, ValueError, RuntimeError):
                return value
        path = existing_file(value, value.folder)
        return value if path is None else str(path.resolve())
    return value


def existing_file(text: str, folder: Path) -> Path | None:
    """Return the file that a text names, seen from a folder; None if it names none.

    Any text may be asked about: too long for a name, with a NUL, or with an unknown user's ``~``.
    """
    try:
        path = folder / Path(text).expanduser()
        return path if path.is_file() else None
    except (OSError, ValueError, RuntimeError):
        return None


def json_safe(value: Any) -> Any:
    """Return a value that JSON can hold: what it has no form for becomes text."""
    if isinstance(value, Mapping):
        return {str(key): json_safe(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_safe(item) for item in value]
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, int):
        # Digits in base 16 can always be written; those in base 10 only up to some thousand.
        return value if abs(value) < 2**63 else hex(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    return format_set_option_value(value)


def _as_list(items: Any) -> Any:
    if not isinstance(items, list):
        raise ValueError("must be a list of tables, each under its name in [[ ]]")
    return items


def _check_name(name: Any) -> Any:
    if not isinstance(name, str):
        raise ValueError("must be the name of a result")
    return name


_Tables = Annotated[list[Any], BeforeValidator(_as_list)]
_ResultName = Annotated[str, BeforeValidator(_check_name)]
_Whole = Annotated[int, Field(ge=0)]


class StudyTable(BaseModel):
    """Base of the tables of a study file, which checks what can be checked without the scene."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class StudyKeys(StudyTable):
    """The keys of a study file; those of type Any are checked one by one later."""

    title: Any = None
    description: Any = None
    scene: Any = None
    set: dict[str, Any] = {}
    swap: dict[str, Any] = {}
    seed: _Whole = 0
    replicas: int = Field(default=1, ge=1)
    axes: dict[str, Any] = {}
    draws: dict[str, Any] = {}
    metrics: Any = None
    figures: _Tables = []
    requirements: _Tables = []
    stop_when: Any = None
    allocate: str | list[str] | None = None
    splitting: Any = None
    compare: Any = None
    over: str | list[str] | None = None
    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)
    interval: Literal["t", "bootstrap"] = "t"
    runs_per_chunk: int | None = Field(default=None, ge=1)


class StopWhenTable(StudyTable):
    """Settings for when a cell has enough replicas."""

    metric: _ResultName
    half_width: float = Field(gt=0)
    batch: int | None = Field(default=None, ge=2)


class SplittingTable(StudyTable):
    """Settings for estimating the probability of a rare event by splitting."""

    event: _ResultName
    runs: int = Field(default=200, ge=10, le=100_000)
    score: str = "time_to_go"
    levels: list[Annotated[float, Field(gt=0)]] | None = None

    @field_validator("levels")
    @classmethod
    def _check_levels_fall(cls, levels: list[float] | None) -> list[float] | None:
        if levels is not None and any(b >= a for a, b in pairwise(levels)):
            raise ValueError("must fall, from far to near, for example [20, 12]")
        return levels


class CompareTable(StudyTable):
    """The axis, and the value of it, with which the others are compared."""

    axis: str
    baseline: Any
    weight: _ResultName | None = None


def _wrap_limits_in_list(limits: Any) -> Any:
    return limits if isinstance(limits, list) else [limits]


class FigureTable(FigureRecord):
    """A figure as a study file writes it; `_KEYS_OF_FIGURES` has the keys of each kind."""

    kind: FigureKind = "axis"
    limits: Annotated[list[float], BeforeValidator(_wrap_limits_in_list)] = Field(
        default=[], alias="limit"
    )


_KEYS_OF_FIGURES = {
    "axis": ("metric", "axis", "lines"),
    "heat": ("metric", "x", "y"),
    "map": ("metric", "x", "y", "limit"),
    "polar": ("metric", "axis"),
    "histogram": ("metric", "axis"),
    "cdf": ("metric", "axis"),
    "series": ("metric", "freedom", "limit"),
    "run": ("cell", "replica"),
}
_AXES_OF_FIGURES = ("axis", "lines", "x", "y")


def read_figures(
    file: SceneFile,
    tables: Sequence[Any],
    axes: Sequence[Axis],
    runs: Mapping[str, int],
    column_of: Callable[[Key, Any], str | None],
) -> tuple[FigureRecord, ...]:
    """Return the figures of a study; what is wrong with them is added to the file's problems.

    `runs` says how many cells and replicas it has, and `column_of` which axis a name means.
    """
    figures: list[FigureRecord] = []
    for number, item in enumerate(tables):
        key: Key = ("figures", number)
        figure = parse_table(file, key, FigureTable, item)
        if figure is None:
            continue
        kind, allowed = figure.kind, ("kind", "title", *_KEYS_OF_FIGURES[figure.kind])
        columns: dict[str, str] = {}
        for name, value in item.items():
            at = (*key, name)
            if name not in allowed:
                hint = did_you_mean(name, allowed)
                file.report(at, f"unknown key of a {kind} figure{hint}")
            elif name in _AXES_OF_FIGURES:
                columns[name] = column_of(at, value) or ""
            elif name in runs and value >= runs[name]:
                message = f"must be the number of a {name} of this study: 0 to {runs[name] - 1}"
                file.report(at, message, value)
        if kind != "run" and figure.metric is None:
            file.report(key, "needs a metric: the name of a result")
        if kind in ("heat", "map") and len(axes) < 2:
            what = "heat map" if kind == "heat" else "map"
            file.report(key, f"a {what} needs two axes; the study has {len(axes)}")
        chosen = [axis for axis in axes if columns.get("axis", axes[0].column) == axis.column]
        if kind == "polar" and chosen and not chosen[0].is_numeric:
            said = f"a polar figure needs an axis in degrees; {chosen[0].column} is no number"
            file.report(key, said)
        # What is wrong with it is reported, and then no study is made.
        figures.append(figure.model_copy(update={"kind": kind, **columns}))
    return tuple(figures)


class RequirementTable(StudyTable):
    """A limit on a result, and the axis along which the cheapest value is looked for."""

    metric: _ResultName
    axis: str
    most: float | None = None
    least: float | None = None
    cheaper: Literal["first", "last"] = "first"

    @model_validator(mode="after")
    def _check_one_limit(self) -> Self:
        if (self.most is None) == (self.least is None):
            raise ValueError("needs one limit: most = NUMBER, or least = NUMBER")
        return self
