"""Fields of messages and the columns they fill, declared once, where the field stands.

``azimuth_rad: FloatArray = column("rad", BODY, "measured azimuth")``: the schema of a table, the
metadata of its columns, the rows that are recorded, an empty message, the filling of what was not
given and the page of reference follow from that.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from inspect import get_annotations
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.column_values import Columns, Instants, Text, take_rows
from dsa_des.arrays.run_ticks import is_shared_single_run
from dsa_des.arrays.types import IntArray

# How a field of a message depends on its rows.
PER_ROW = "row"  # first axis is the rows
PER_ENTRY = "entry"  # first axis is the entries; `offsets[i]:offsets[i + 1]` belong to row i
STATIC = "static"  # the same for all rows

_KINDS = ("int64", "float64", "bool", "text")
_NOTHING = {"int64": np.int64, "float64": np.float64, "bool": np.bool_, "text": np.int64}
#: What a run's `Instants` are counted in where a message does not say.
_NANOSECONDS = 10**9


class Column(NamedTuple):
    """A recorded column.

    Parameters
    ----------
    unit, frame, meaning : str
        Empty where there is none.
    kind : {"float64", "int64", "bool", "text"}
    """

    unit: str = ""
    frame: str = ""
    meaning: str = ""
    kind: str = "float64"


#: Columns with which every table begins.
LEADING = {
    "block": Column("", "", "block that sent the message", "text"),
    "tick": Column(
        "ticks", "", "instant, in the scene's ticks (`ticks_per_s` of run.json)", "int64"
    ),
    "time_s": Column("s", "", "the same instant since the start of the run"),
}
#: Behind these, where blocks of a scene are on several platforms.
PLATFORM = "platform"
ON_PLATFORM = {PLATFORM: Column("", "", "what carries that block", "text")}


@dataclass(frozen=True)
class Filled:
    """How a message field is recorded: as one column, or one per key of a dict of arrays."""

    columns: Mapping[str, Column]
    many: bool = False
    value: Callable[[Any], Any] | None = None
    in_entries: bool = False
    for_entries: bool = False
    instant: bool = False


def per_row(**kwargs: Any) -> Any:
    """Declare a dataclass field that has one value per row and is not recorded."""
    return field(metadata={"per": PER_ROW}, **kwargs)


def per_entry(**kwargs: Any) -> Any:
    """Declare a dataclass field with one value per entry (some per row) that is not recorded.

    The class must have `offsets`.
    """
    return field(metadata={"per": PER_ENTRY}, **kwargs)


def static(**kwargs: Any) -> Any:
    """Declare a field with one value for the whole message, not one per row; it is not recorded."""
    return field(metadata={"per": STATIC}, **kwargs)


def column(
    unit: str,
    frame: str,
    meaning: str,
    kind: str = "float64",
    *,
    of: str = PER_ENTRY,
    name: str = "",
    value: Callable[[Any], Any] | None = None,
    in_entries: bool = False,
    for_entries: bool = False,
    instant: bool = False,
    **kwargs: Any,
) -> Any:
    """Declare a field that is recorded as a column, of the class's ``entry_table`` by default.

    Parameters
    ----------
    unit, frame, meaning, kind
        As of `Column`.
    of : {"entry", "row"}
        What its first axis is; columns of rows go to the class's ``row_table``.
    name : str
        The column's, where it is not the field's.
    value : callable, optional
        Given the message, returns what is recorded, where that is not the field itself; needed
        for text, which is recorded as `Text`.
    in_entries, for_entries : bool
        A row's value is also recorded with each of its entries, or not, but a `Run` shows it so.
    instant : bool
        It holds ticks, which are recorded in seconds.
    **kwargs
        Passed on to `dataclasses.field`. Numbers with ``default=None`` that are not given are NaN,
        in every entry.

    Raises
    ------
    ValueError
        If the column is of no kind that can be recorded.
    """
    filled = {name: Column(unit, frame, meaning, _checked_kind(kind))}
    how = Filled(filled, False, value, in_entries, for_entries, instant)
    return field(metadata={"per": of, _RECORDED: how}, **kwargs)


def columns(
    recorded: Mapping[str, Column],
    *,
    of: str = PER_ENTRY,
    value: Callable[[Any], Any] | None = None,
    for_entries: bool = False,
    **kwargs: Any,
) -> Any:
    """Declare a dict field recorded as one column per key; a missing key is recorded as null.

    Parameters
    ----------
    recorded : mapping of Column
        All that it may hold.
    of, value, for_entries, **kwargs
        As for `column`.
    """
    for one in recorded.values():
        _checked_kind(one.kind)
    how = Filled(dict(recorded), True, value, False, for_entries)
    return field(metadata={"per": of, _RECORDED: how}, **kwargs)


def columns_of_dataclass(group: type) -> dict[str, Column]:
    """Return the recorded columns, by name, that the fields of a dataclass declare."""
    found: dict[str, Column] = {}
    for item in fields(group):
        how: Filled = item.metadata[_RECORDED]
        found.update(zip(_column_names(item.name, how), how.columns.values(), strict=True))
    return found


def _checked_kind(kind: str) -> str:
    if kind not in _KINDS:
        raise ValueError(f"column is {kind!r}: it must be one of {', '.join(_KINDS)}")
    return kind


#: Key of the metadata of a field that says how it is recorded.
_RECORDED = "recorded"


def tick_and_replica_columns(message: Any, row: IntArray | None = None) -> Columns:
    """Return the columns ``tick`` and, if there are several runs, ``replica``: for each row of a
    message, or for each entry if `row` gives its row.
    """
    columns: Columns = {"tick": message.tick}
    if not is_shared_single_run(message.run):
        columns["replica"] = message.run
    if row is None:
        return columns
    return {name: take_rows(values, row) for name, values in columns.items()}  # type: ignore[arg-type]


class DerivedColumns:
    """The recorded columns declared by a message class's fields; those of mix-ins come last.

    TypeError if a field fills a column of a table that the class does not name, or two fill one
    column.
    """

    def __init__(self, message_type: Any, base: type) -> None:
        self._type = message_type
        #: Table → column.
        self.recorded: dict[str, dict[str, Column]] = {}
        #: By column of the table of rows, the table of entries to which it belongs as well.
        self.for_entries: dict[str, str] = {}
        #: Fields of entries that need not be given, and their kinds.
        self.optional: dict[str, str] = {}
        self._rows: list[tuple[str, Filled]] = []
        self._entries: list[tuple[str, Filled]] = []
        self._row_table: str = message_type.row_table
        self._entry_table: str = message_type.entry_table
        self._fields = {item.name: item for item in fields(message_type)}
        names = [name for name in _fields_in_order(message_type, base) if name in self._fields]
        if not issubclass(message_type.__mro__[1], base):
            # What only some fill comes behind what the mix-ins have.
            names.sort(key=lambda name: _is_entry_dict_field(self._fields[name]))
        for name in names:
            item = self._fields[name]
            how: Filled | None = item.metadata.get(_RECORDED)
            if how is None:
                continue
            if item.metadata["per"] == PER_ENTRY:
                self._add_recorded_field("entry_table", self._entries, name, how)
                if item.default is None and not (how.many or how.instant):
                    self.optional[name] = next(iter(how.columns.values())).kind
                continue
            self._add_recorded_field("row_table", self._rows, name, how)
            if how.in_entries:
                self._add_recorded_field("entry_table", self._entries, name, how)
            if how.for_entries:
                self.for_entries.update(dict.fromkeys(_column_names(name, how), self._entry_table))

    def _add_recorded_field(
        self, which: str, filled: list[tuple[str, Filled]], field_name: str, how: Filled
    ) -> None:
        owner = self._type.__qualname__
        table = getattr(self._type, which)
        if not table:
            raise TypeError(f"{owner}.{field_name} fills a column, but the class names no {which}")
        known = self.recorded.setdefault(table, {})
        for name, one in zip(_column_names(field_name, how), how.columns.values(), strict=True):
            if name in known:
                raise TypeError(f"{owner} has two fields for column {name!r}")
            known[name] = one
        filled.append((field_name, how))

    def empty_entry_fields(self) -> dict[str, Any]:
        """Return all recorded entry fields by name, as arrays (or dicts) of length 0."""
        made: dict[str, Any] = {}
        for name, item in self._fields.items():
            how: Filled | None = item.metadata.get(_RECORDED)
            if how is None or item.metadata["per"] != PER_ENTRY:
                continue
            none: dict[str, Any] = {
                key: np.empty(0, _NOTHING[one.kind]) for key, one in how.columns.items()
            }
            made[name] = none if how.many else next(iter(none.values()))
        return made

    def tables(self, message: Any) -> dict[str, Columns]:
        """Return the rows that a message records: table → column → values.

        ValueError if a dict of columns holds one that belongs to another field.
        """
        tables: dict[str, Columns] = {}
        if self._rows:
            tables[self._row_table] = self._fill_columns(
                message, self._rows, tick_and_replica_columns(message)
            )
        if self._entries:
            row = message.row_of_entries
            made = tick_and_replica_columns(message, row)
            tables[self._entry_table] = self._fill_columns(message, self._entries, made, row)
        return tables

    def _fill_columns(
        self,
        message: Any,
        filled: list[tuple[str, Filled]],
        made: Columns,
        row: IntArray | None = None,
    ) -> Columns:
        dicts = []
        for name, how in filled:
            if how.many:  # after the others, whose names they may not take
                dicts.append((name, how))
                continue
            values = getattr(message, name) if how.value is None else how.value(message)
            if values is None:
                continue
            if how.instant:
                values = Instants(values, getattr(message, "ticks_per_s", _NANOSECONDS))
            if how.in_entries and row is not None:
                values = _values_at_entries(values, row)
            made[_column_names(name, how)[0]] = values
        for name, how in dicts:
            held = getattr(message, name) if how.value is None else how.value(message)
            if not held:
                continue
            if not made.keys().isdisjoint(held):
                twice = sorted(made.keys() & held.keys())[0]
                raise ValueError(
                    f"{type(message).__name__}.{name} holds {twice!r}, which is a column "
                    "of another field: give it a name of its own"
                )
            made.update(held)
        return made


def _column_names(field_name: str, how: Filled) -> list[str]:
    return [name or field_name for name in how.columns]


def _is_entry_dict_field(item: Any) -> bool:
    how: Filled | None = item.metadata.get(_RECORDED)
    return how is not None and how.many and item.metadata["per"] == PER_ENTRY


def _fields_in_order(message_type: type, base: type) -> Iterator[str]:
    """Yield a message class's field names: message bases, oldest first, then mix-ins."""
    kinds = [kind for kind in message_type.__mro__ if hasattr(kind, "__dataclass_fields__")]
    messages = [kind for kind in reversed(kinds) if issubclass(kind, base)]
    mixed = [kind for kind in kinds if not issubclass(kind, base)]
    of_kinds = (get_annotations(kind) for kind in (*messages, *mixed))
    yield from dict.fromkeys(name for names in of_kinds for name in names)


def _values_at_entries(values: Any, row: IntArray) -> Any:
    if isinstance(values, Text):
        return Text(values.codes.take(row), values.names)
    return take_rows(values, row)
