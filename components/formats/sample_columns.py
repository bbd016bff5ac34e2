"""Columns of a table of samples: names, units, clocks, cells that say nothing, and numbers."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from components.formats.text_rows import (
    ALL_TOKENS,
    MOST_OF_A_CELL,
    NO_UNIT,
    UNIT_KINDS,
    Problems,
    clean_token,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.text.safe_text import shorten

#: Which altitude is read where there is more than one.
Altitude = Literal["geometric", "barometric"]
VELOCITIES = (("vx", "vy", "vz"), ("trk", "gs", "vs"))


@dataclass(frozen=True)
class ColumnSpec:
    """A quantity: the names its column may have, earlier ones first, and its unit by default."""

    names: tuple[str, ...]
    unit: str = ""
    required: bool = False

    @property
    def factors_by_unit(self) -> Mapping[str, float]:
        """Return the factor of each unit that the column may have, by the kind of its own unit."""
        return next(kind for kind in UNIT_KINDS if self.unit in kind)


def column_indices(columns: Mapping[str, ColumnSpec], names: Sequence[str]) -> dict[str, int]:
    """Return the index of the column of each quantity that is among the names."""
    name_of = {q: next((n for n in spec.names if n in names), None) for q, spec in columns.items()}
    return {quantity: names.index(name) for quantity, name in name_of.items() if name is not None}


def first_complete_velocity(there: Collection[str]) -> tuple[str, ...]:
    """Return the quantities of the first complete kind of velocity, or an empty tuple."""
    return next((parts for parts in VELOCITIES if all(q in there for q in parts)), ())


@dataclass(frozen=True)
class SampleColumn:
    """A column that is read: its index in the row, its header and its factor to s, m, m/s, deg."""

    index: int
    header: str
    factor: float


def unit_factor(
    problems: Problems, spec: ColumnSpec, token: str, *, line: int | None, header: str
) -> float:
    """Return a unit token's factor; an unknown one is added to the problems and taken as 1."""
    known = spec.factors_by_unit
    plain = clean_token(token)
    if plain in known:
        return known[plain]
    what = (
        "has no unit"
        if plain in NO_UNIT
        else f"unit {shorten(token, MOST_OF_A_CELL)!r} is unknown here"
    )
    problems.add(f"{what}: it must be one of {', '.join(known)}", line=line, column=header)
    return 1.0


#: What stands in a cell of which nothing is known; "ground" in place of an altitude.
_MISSING = frozenset(
    {"", "na", "n/a", "nan", "none", "null", "nil", "\\n", "-", "--", "ground", "grnd"}
)


def is_missing(cell: str) -> bool:
    """Return whether a cell is empty or a word for none, such as nan, none, n/a, - or ground."""
    return cell.strip().lower() in _MISSING


def convert_to_enu_velocity(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return columns with velocity east, north, up (ve, vn, vu) for vx vy vz or trk gs vs."""
    kinds = [[columns.pop(part, None) for part in parts] for parts in VELOCITIES]
    for kind, (first, second, third) in enumerate(kinds):
        if first is not None and second is not None and third is not None:
            if kind == 1:
                track = np.radians(first)
                first, second = second * np.sin(track), second * np.cos(track)
            return {**columns, "ve": first, "vn": second, "vu": third}
    return columns


_DAY_S, _NIGHT_S = 86400.0, 7200.0
#: Clocks that read more count from 1970.
EPOCH_S = 1e8
#: A clock that counts from 1970 is beyond these numbers in ns, µs and ms, and in s never.
_EPOCHS = ((1e17, "ns"), (1e14, "µs"), (1e11, "ms"))


def name_and_unit(header: str) -> tuple[str, str | None]:
    """Split 'Altitude (ft)', 'alt_ft' or 'alt [ft]' into a plain name and a unit."""
    unit = None
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", header)
    if match:
        header, unit = match[1], match[2]
    else:
        base, _, suffix = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]*$)", "_", header).rpartition("_")
        if base and clean_token(suffix) in ALL_TOKENS:
            header, unit = base, suffix
    return re.sub(r"[\s_\-.]", "", header).lower(), unit


def resolve_epoch_unit(
    column: SampleColumn, cell: str, header: str, notes: list[str]
) -> SampleColumn:
    """Return the time column with its header's unit, else that implied by its first number."""
    if name_and_unit(header)[1] is not None or not re.fullmatch(r"\d{12,19}(\.\d*)?", cell):
        return column
    unit = next(unit for least, unit in _EPOCHS if float(cell) >= least)
    notes.append(f"{header} is taken in {unit}: its numbers are too large for seconds")
    return SampleColumn(column.index, column.header, ColumnSpec((), "s").factors_by_unit[unit])


def time_parser(column: SampleColumn) -> Callable[[str], float]:
    """Return a function that reads cells as seconds: in the column's unit, ISO 8601, clock time.

    Clocks that go on soon after midnight are of the next day.
    """
    last = 0.0

    def parse(cell: str) -> float:
        try:
            if "_" in cell:
                raise ValueError(cell)
            return float(cell) * column.factor
        except ValueError:
            if clock := re.fullmatch(r"(\d{1,2}):(\d\d):(\d\d(?:\.\d*)?)Z?", cell):
                nonlocal last
                now = 3600.0 * int(clock[1]) + 60.0 * int(clock[2]) + float(clock[3])
                day = min(round((last - now) / _DAY_S), math.floor(last / _DAY_S))
                if now < _NIGHT_S and last % _DAY_S > _DAY_S - _NIGHT_S:
                    day = math.floor(last / _DAY_S) + 1
                last = now + _DAY_S * max(day, 0)
                return last
            if "-" not in cell[1:] and "/" not in cell:
                raise
            plain = cell.replace("/", "-").replace("Z.", ".").removesuffix(" UTC")
            instant = datetime.fromisoformat(plain)
            if instant.tzinfo is None:
                instant = instant.replace(tzinfo=UTC)
            return instant.timestamp()

    return parse


#: At most one of so many samples may be at the instant of another, or lack an optional number that
#: the nearest sample has within so many seconds: more is no slip of a recorder.
ONE_IN, _NEAR_S = 10, 5.0
#: However many, they are one aircraft's by a clock of whole seconds, where no two are further apart
#: than this.
_OF_A_SECOND = {"lat": 0.0008, "lon": 0.0008, "alt": 50.0}


class GrowingColumns:
    """The samples of one aircraft as they are read; a column is created at its first number."""

    def __init__(self, quantities: Collection[str]) -> None:
        self.lines = array("I")
        self.values: dict[str, array[float]] = {}
        self._unseen = list(enumerate(quantities))
        self._appends: list[tuple[int, Callable[[float], None]]] = []

    def add(self, line: int, numbers: Sequence[float]) -> None:
        """Add a sample by its line and a number for each quantity, NaN where there is none."""
        for k, quantity in [one for one in self._unseen if numbers[one[0]] == numbers[one[0]]]:
            self._unseen.remove((k, quantity))
            column = self.values[quantity] = array("d", [math.nan]) * len(self.lines)
            self._appends.append((k, column.append))
        self.lines.append(line)
        for k, append in self._appends:
            append(numbers[k])


def int_as_float(value: Any) -> float:
    """Return an int as float, NaN for anything else, such as ``None`` or the text ``ground``."""
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) > 2**62:
        return math.nan
    return float(value)


def keep_rows(columns: dict[str, FloatArray], rows: Any) -> None:
    """Keep only the given rows of each column, in place, column by column to save memory."""
    for key in columns:
        columns[key] = columns[key][rows]


def may_be_of_one_second(columns: dict[str, FloatArray], at_once: Any) -> bool:
    """Return whether samples of equal times are so close that a clock of seconds may be why."""
    return columns.keys() >= _OF_A_SECOND.keys() and all(
        bool((np.abs(np.diff(columns[key])[at_once]) <= most).all())
        for key, most in _OF_A_SECOND.items()
    )


def fill_gaps(times: FloatArray, values: FloatArray) -> FloatArray | None:
    """Return values with gaps (NaN) filled from the nearest sample; None if too many or long."""
    order = np.argsort(times, kind="stable")
    known = order[~np.isnan(values[order])]
    gaps = np.flatnonzero(np.isnan(values))
    if len(gaps) > len(values) // ONE_IN:
        return None
    after = np.searchsorted(times[known], times[gaps])
    before, after = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
    is_before = times[gaps] - times[before] <= times[after] - times[gaps]
    is_before = (is_before & (times[before] <= times[gaps])) | (times[after] < times[gaps])
    nearest = np.where(is_before, before, after)
    if np.any(np.abs(times[nearest] - times[gaps]) > _NEAR_S):
        return None
    filled = values.copy()
    filled[gaps] = values[nearest]
    return filled
