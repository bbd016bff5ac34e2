"""Columns that follow from the fields of a message: declared once, where the field stands.

A field says which column it fills (``per_entry(column="float64")``). What the class declares to a
recorder (`recorded`) and what it hands over (`tables`) are derived from that, in the order of the
fields.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, IntArray


@dataclass(frozen=True, eq=False)
class Text:
    """A text column kept as codes into a tuple of names (code -1 is null).

    Parameters
    ----------
    codes : ndarray of int
    names : tuple of str
    """

    codes: AnyArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.codes)


@dataclass(frozen=True, eq=False)
class Instants:
    """A column of instants: ticks, which are recorded as seconds since the start of the run.

    Parameters
    ----------
    ticks : ndarray of int64
    ticks_per_s : int
        As the message knows it (its field of that name, 10⁹ without one); a recorder knows it
        itself. A single value is given in seconds.
    """

    ticks: IntArray
    ticks_per_s: int = 10**9

    def __len__(self) -> int:
        return len(self.ticks)

    def __getitem__(self, rows: Any) -> Any:
        if isinstance(rows, int):
            return self.ticks[rows] / self.ticks_per_s
        return Instants(self.ticks[rows], self.ticks_per_s)


#: Recorded columns by name, and what kind each is: "int64", "float64", "bool" or "text".
#: In float64, NaN means null.
#: Beside arrays and text, `Instants` on the way to a recorder, which makes seconds of them.
Columns = dict[str, AnyArray | Text]
Schema = dict[str, str]


def nothing_in(rows: int) -> AnyArray:
    """Return a float64 column that is null in all rows: one NaN, seen `rows` times."""
    column: AnyArray = np.ndarray((rows,), np.float64, buffer=_NAN, strides=(0,))
    return column


def is_empty(values: Any) -> bool:
    """Return whether a column is known to be null in all rows, without a look at them."""
    return isinstance(values, np.ndarray) and values.base is _NAN


_NAN = np.full((), np.nan)
_NAN.flags.writeable = False

#: Key of the metadata of a field that says how it is recorded.
RECORDED = "recorded"
_KINDS = ("int64", "float64", "bool", "text")


@dataclass(frozen=True)
class FieldColumns:
    """How a field is recorded.

    Parameters
    ----------
    kinds : mapping
        Column → kind; the name "" stands for the field's own.
    many : bool
        Whether the field is a dict of columns; those it does not hold are null.
    value : callable, optional
        Given the message, returns what is recorded, where that is not the field itself.
    in_entries : bool
        Whether a column per row is repeated for each of the row's entries too.
    instant : bool
        Whether the field holds ticks, to be recorded as seconds.
    """

    kinds: Mapping[str, str]
    many: bool
    value: Callable[[Any], Any] | None
    in_entries: bool
    instant: bool = False


def recorded_as(
    column: str | None = None,
    columns: Mapping[str, str] | None = None,
    name: str = "",
    value: Callable[[Any], Any] | None = None,
    in_entries: bool = False,
) -> dict[str, FieldColumns]:
    """Return the metadata of a field that fills a column, or a dict of them; empty for neither.

    Raises
    ------
    ValueError
        If a column is of no kind that can be recorded, or a field has both.
    """
    if column is not None and columns is not None:
        raise ValueError("a field fills one column or several: give column or columns")
    kinds = {name: column} if column is not None else dict(columns or {})
    for kind in kinds.values():
        if kind not in _KINDS:
            raise ValueError(f"column is {kind!r}: it must be one of {', '.join(_KINDS)}")
    if not kinds:
        return {}
    return {RECORDED: FieldColumns(kinds, columns is not None, value, in_entries)}


class DerivedColumns:
    """What one message class records by its fields.

    Parameters
    ----------
    message_type : type of Message
    is_entry : callable
        Whether a field, by its metadata, has entries.

    Raises
    ------
    TypeError
        If a field fills a column of a table that the class does not name, or two fill one column.
    """

    def __init__(self, message_type: Any, is_entry: Callable[[Mapping[str, Any]], bool]) -> None:
        self.recorded: dict[str, dict[str, str]] = {}
        self._rows: list[_Filled] = []
        self._entries: list[_Filled] = []
        for item in fields(message_type):
            how = item.metadata.get(RECORDED)
            if how is None:
                continue
            filled = _Filled(item.name, how)
            if is_entry(item.metadata):
                self._add(message_type, "entry_table", self._entries, filled)
                continue
            self._add(message_type, "row_table", self._rows, filled)
            if how.in_entries:
                self._add(message_type, "entry_table", self._entries, filled)
        self._row_table: str = message_type.row_table
        self._entry_table: str = message_type.entry_table

    def _add(self, owner: Any, which: str, filled: "list[_Filled]", new: "_Filled") -> None:
        table = getattr(owner, which)
        if not table:
            raise TypeError(
                f"{owner.__qualname__}.{new.field} fills a column, but the class names no {which}"
            )
        columns = self.recorded.setdefault(table, {})
        for name, kind in new.kinds.items():
            if name in columns:
                raise TypeError(f"{owner.__qualname__} has two fields for column {name!r}")
            columns[name] = kind
        filled.append(new)

    def tables(self, message: Any) -> dict[str, Columns]:
        """Return the rows to record of a message.

        Raises
        ------
        ValueError
            If a dict of columns holds one that belongs to another field.
        """
        tables: dict[str, Columns] = {}
        if self._rows:
            tables[self._row_table] = self._filled(message, self._rows, {"tick": message.tick})
        if self._entries:
            counts = np.diff(message.offsets)
            columns: Columns = {"tick": np.repeat(message.tick, counts)}
            tables[self._entry_table] = self._filled(message, self._entries, columns, counts)
        return tables

    def _filled(
        self,
        message: Any,
        filled: "list[_Filled]",
        columns: Columns,
        counts: IntArray | None = None,
    ) -> Columns:
        dicts = []
        for item in filled:
            if item.many:  # after the others, whose names they may not take
                dicts.append(item)
                continue
            values = getattr(message, item.field) if item.value is None else item.value(message)
            if item.instant:
                values = Instants(values, getattr(message, "ticks_per_s", 10**9))
            if item.in_entries and counts is not None:
                values = _repeated(values, counts)
            columns[item.name] = values
        for item in dicts:
            held = getattr(message, item.field) if item.value is None else item.value(message)
            if not columns.keys().isdisjoint(held):
                twice = sorted(columns.keys() & held.keys())[0]
                raise ValueError(
                    f"{type(message).__name__}.{item.field} holds {twice!r}, which is a column "
                    "of another field: give it a name of its own"
                )
            columns.update(held)
        return columns


class _Filled:
    """A field and the columns it fills."""

    def __init__(self, field_name: str, how: FieldColumns) -> None:
        self.field, self.many, self.in_entries = field_name, how.many, how.in_entries
        self.kinds = {name or field_name: kind for name, kind in how.kinds.items()}
        self.name = next(iter(self.kinds))
        self.value, self.instant = how.value, how.instant


def _repeated(values: Any, counts: IntArray) -> Any:
    if isinstance(values, Text):
        return Text(np.repeat(values.codes, counts), values.names)
    return np.repeat(values, counts)
