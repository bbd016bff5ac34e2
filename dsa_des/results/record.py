"""The record of a study in its folder, and the columns of its parts.

It is enough to read the tables of a study without scene or blocks: a folder may come from a
stranger, so it is checked when it is read, and nothing that it names is opened or imported. What is
saved of results, limits and figures is what the study itself uses.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from dsa_des.text.run_commands import format_set_option_value, shell_command_of_run

if TYPE_CHECKING:
    import pyarrow as pa

_Whole = Annotated[int, Field(ge=0, lt=2**63)]
_Label = str | int | float


class StrictRecord(BaseModel):
    """Base of the records stored in files: values are not converted, and numbers must be finite."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


#: Kinds of results: a number with a mean; a number from 0 to 1 with a mean, such as a share of the
#: time; an event that happens or not; a share of trials; the ratio of two events over all units of
#: a cell; the name of a class; a number that is a name, such as that of an encounter.
NUMBER, FRACTION, EVENT, SHARE = "number", "fraction", "event", "share"
RATIO, CLASS, KEY = "ratio", "class", "key"
#: What is put behind the name of a share for the column of its trials.
TRIALS = ".trials"
#: The column that says for how many runs each one stands, where only a sample is flown.
STANDS_FOR = "stands_for"


class ChangeWords(NamedTuple):
    """The words for a change of a result: ``radar``, ``sees a target earlier``, ``... later``.

    Parameters
    ----------
    who : str
    less, more : str
        What it does where the result is smaller, or larger; of an event, where it no longer
        happens, or now does.
    """

    who: str
    less: str
    more: str


@dataclass(frozen=True)
class RatioOf:
    """The columns and options from which a ratio of two events is computed.

    Parameters
    ----------
    below, above : str
        Events under and over the line (nominal and mitigated), of the same units.
    weight : str, optional
        A number: how often a unit happens.
    cluster : str, optional
        A number that runs share which hang together; they count as one unit.
    only : (column, class), optional
        Of which runs: those of this class.
    share : bool
        Whether events over the line are always also under it: an interval ends at 1.
    """

    below: str
    above: str
    weight: str | None = None
    cluster: str | None = None
    only: tuple[str, str] | None = None
    share: bool = False

    def columns_read(self) -> tuple[str, ...]:
        """Return the names of all columns it reads."""
        names = (self.below, self.above, self.weight, self.cluster, self.only and self.only[0])
        return tuple(name for name in names if name)


_Colour = Annotated[str, Field(pattern="^#[0-9A-Fa-f]{6}$")]
_Marker = Annotated[str, Field(pattern="^[osDdv^<>PXph8*]$")]


@dataclass(frozen=True)
class Result:
    """One column of a study's results.

    Parameters
    ----------
    name : str
        With its unit, for example ``declaration_time_s.radar``.
    kind : {"number", "fraction", "event", "share", "ratio", "class", "key"}
        A number may be NaN (no value in this run), and so may a fraction, which lies between 0 and
        1, as does the interval of its mean; an event is 0 or 1; a share has a second
        column ``NAME.trials``, and is NaN without trials. A class is a text or None, a key a
        number that names something; neither stands in a summary. A ratio has no column: it is made
        of others (`ratio`) over the runs of a cell.
    meaning : str
    cut_off : str, optional
        Name of a further column, a text: where the run's start or end cut this value off (``at the
        start``, ``never``), nothing where it did not. Results may share one.
    told : Told, optional
        The words of comparisons for a change of it.
    block : str, optional
        The block it is of, if that is not what stands behind the dot of its name.
    mark : (colour, marker), optional
        How figures mark that block; a study fills it in.
    least, most : float, optional
        What no value of a number can lie below or above, such as 0 for a distance; the interval of
        its mean ends there.
    quantile : float, optional
        Of a number: it is summed up by this quantile over the units, not the mean.
    unseen : str, optional
        Of a number that is 0 where nothing was seen: the column of what one event would have added;
        where all units have 0, the interval reaches to what may be unseen.
    """

    name: str
    kind: Annotated[str, Field(pattern="^(number|fraction|event|share|ratio|class|key)$")]
    meaning: str
    cut_off: str | None = None
    told: ChangeWords | None = None
    block: str | None = None
    mark: tuple[_Colour, _Marker] | None = None
    ratio: RatioOf | None = None
    least: float | None = None
    most: float | None = None
    quantile: Annotated[float, Field(gt=0, lt=1)] | None = None
    unseen: str | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """(Smallest, largest) possible value of the result; infinite where none is known."""
        low = 0.0 if self.kind in (FRACTION, EVENT, SHARE, RATIO) else self.least
        high = 1.0 if self.kind in (FRACTION, EVENT, SHARE) else self.most
        return -math.inf if low is None else low, math.inf if high is None else high

    @property
    def is_summarised(self) -> bool:
        """Whether the summary has the result's mean, share or ratio; not for classes and keys."""
        return self.kind not in (CLASS, KEY)

    @property
    def is_number(self) -> bool:
        """Whether each run has a number of its own as this result: not for ratios and classes."""
        return self.kind not in (RATIO, CLASS)


#: What became of a run: it has results; it failed, and will again; its process died.
DONE, FAILED, CRASHED = "done", "failed", "crashed"


@dataclass(frozen=True)
class StopWhen:
    """Settings for stopping a cell: interval half-width to reach, and replicas between checks."""

    metric: str
    half_width: float
    batch: int


@dataclass(frozen=True)
class Requirement:
    """A limit on a result, and the axis whose cheapest value that meets it is wanted."""

    metric: str
    axis: str
    limit: float
    #: Whether the result must be at most the limit; otherwise at least.
    below: bool = True
    #: Whether the last value of the axis is the cheapest; otherwise the first.
    cheap_last: bool = False

    def text(self) -> str:
        """Return ``nmac_risk_ratio at most 0.3``."""
        return f"{self.metric} at {'most' if self.below else 'least'} {self.limit:g}"

    def is_met(self, low: float, high: float) -> bool:
        """Return whether an interval (or a value, given twice) lies within the limit."""
        return high <= self.limit if self.below else low >= self.limit


class AxisRecord(StrictRecord):
    """An axis: its column, its values, and what each changes in the scene, as texts."""

    column: str
    #: The column with the names of what it counts, as wires; empty where it counts nothing.
    words: str = ""
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


FigureKind = Literal["axis", "heat", "map", "polar", "histogram", "cdf", "series", "run"]


class FigureRecord(StrictRecord):
    """One figure of a study: its kind, result, axes and limits (``limit`` in a study file)."""

    kind: FigureKind
    metric: str | None = None
    title: str | None = None
    axis: str | None = None
    lines: str | None = None
    x: str | None = None
    y: str | None = None
    limits: list[float] = []
    #: Degrees of freedom.
    freedom: Annotated[float, Field(gt=0, le=1e6)] | None = None
    cell: _Whole = 0
    replica: _Whole = 0


class StudyHead(StrictRecord):
    """File name and hash of the study that a folder holds."""

    #: The study's file.
    study: str
    #: Of all that fixes its results.
    study_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class StudyRecord(StudyHead):
    """What a study's tables need, as its folder stores it; names of missing columns are refused."""

    title: str
    scene: str
    seed: int
    cells: _Whole
    replicas: _Whole
    axes: list[AxisRecord]
    draws: list[DrawRecord]
    results: list[Result]
    sets: list[tuple[str, str]]
    swaps: list[tuple[str, str]]
    compare: tuple[str, _Label] | None
    stop_when: StopWhen | None
    confidence: Annotated[float, Field(gt=0.5, lt=1.0)]
    interval: Literal["t", "bootstrap"]
    figures: list[FigureRecord]
    requirements: list[Requirement] = []
    compare_weight: str | None = None
    #: The numbers by which runs are told apart before they are flown; none where all are flown.
    geometry: list[str] = []
    #: The command line that runs the study again; empty in folders of versions that kept none.
    repeat: str = ""

    @model_validator(mode="after")
    def _check_columns(self) -> "StudyRecord":
        axes = {axis.column: axis for axis in self.axes}
        columns = self.schema_of_parts().names
        if len(set(columns)) < len(columns):
            raise ValueError("two columns have one name")
        for result in self.results:
            if (result.kind == "ratio") != (result.ratio is not None):
                raise ValueError("a ratio, and nothing else, says of which columns it is")
            if result.ratio is not None and not set(result.ratio.columns_read()) <= {*columns}:
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
        """Return the Arrow schema of the study's part files."""
        return part_schema(
            [(axis.column, axis.numeric) for axis in self.axes],
            [(draw.column, draw.numeric) for draw in self.draws],
            self.results,
            self.geometry,
        )

    @property
    def sample_columns(self) -> tuple[str, ...]:
        """Columns of the axes whose values are a sample of independent units."""
        return tuple(axis.column for axis in self.axes if axis.over)

    def command(self, row: Mapping[str, Any]) -> str:
        """Return the command that repeats the run of a row of the parts."""
        return shell_command_of_run(self.scene, int(row["seed"]), *self.swaps_and_sets(row))

    def swaps_and_sets(
        self, row: Mapping[str, Any]
    ) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
        """Return (swaps, sets), lists of (name, value), that turn the base scene into a row's."""
        swaps, sets = list(self.swaps), list(self.sets)
        indices = np.unravel_index(int(row["cell"]), [len(axis.values) for axis in self.axes])
        for axis, index in zip(self.axes, indices, strict=True):
            swaps += axis.swaps[index]
            sets += axis.sets[index]
        sets += [(draw.key, format_set_option_value(row[draw.column])) for draw in self.draws]
        return swaps, sets


def part_schema(
    axes: Sequence[tuple[str, bool]],
    draws: Sequence[tuple[str, bool]],
    results: Sequence[Result],
    geometry: Sequence[str] = (),
) -> "pa.Schema":
    """Return a part file's Arrow schema; axes and draws are (column, whether it holds numbers).

    Where only a sample of the runs is flown, each says for how many it stands, and by which
    geometry it was chosen.
    """
    import pyarrow as pa

    fields = [("cell", pa.int64()), ("replica", pa.int64()), ("seed", pa.int64())]
    fields += [(STANDS_FOR, pa.float64())] * bool(geometry)
    fields += [(geometry_column(name), pa.float64()) for name in geometry]
    fields += [
        (name, pa.float64() if numeric else pa.string()) for name, numeric in [*axes, *draws]
    ]
    cut_off: set[str] = set()
    for result in results:
        if result.kind == RATIO:
            continue
        fields.append((result.name, pa.string() if result.kind == CLASS else pa.float64()))
        if result.kind == SHARE:
            fields.append((result.name + TRIALS, pa.float64()))
        if result.cut_off is not None and result.cut_off not in cut_off:
            cut_off.add(result.cut_off)
            fields.append((result.cut_off, pa.string()))
    fields += [("status", pa.string()), ("error", pa.string()), ("command", pa.string())]
    return pa.schema(fields)


def geometry_column(name: str) -> str:
    """Return ``geometry.NAME``, the column of a quantity known of a run before it is flown."""
    return f"geometry.{name}"


def predicted_column(event: str) -> str:
    """Return ``predicted.EVENT``, the geometric quantity that predicts an event before flight."""
    return f"predicted.{event}"


def draw_column(key: str) -> str:
    """Return the column in the results of the drawn value of a scene key."""
    return f"draw.{key.removeprefix('blocks.')}"
