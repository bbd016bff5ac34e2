"""Messages, which flow on wires: one row per scan, arrays over whatever the scan saw.

A `Message` holds a *batch* of rows in time order: a single row when blocks run scan by scan, many
when they run in a look-ahead window. Physics written over rows serves both.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from operator import attrgetter
from typing import Any, ClassVar, Self

import numpy as np

from dsa_des.arrays.column_values import Columns, Text, join_values, pick_rows, shared_nan_column
from dsa_des.arrays.entries import (
    offsets_from_entry_rows,
    rows_of_entries,
    selected_offsets_and_indices,
)
from dsa_des.arrays.run_ticks import (
    RunTicks,
    concatenate_runs,
    is_shared_single_run,
    shared_zero_run_numbers,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.recorded_columns import (
    PER_ENTRY,
    PER_ROW,
    STATIC,
    Column,
    DerivedColumns,
    column,
    columns,
    columns_of_dataclass,
    per_entry,
    per_row,
    static,
    tick_and_replica_columns,
)

__all__ = [
    "PER_ENTRY",
    "PER_ROW",
    "STATIC",
    "Column",
    "Columns",
    "Message",
    "Text",
    "column",
    "columns",
    "columns_of_dataclass",
    "derive_columns",
    "offsets_from_entry_rows",
    "per_entry",
    "per_row",
    "slice_columns",
    "static",
    "tick_and_replica_columns",
]

#: Numbers and truth values; no objects, no text.
_NUMBERS = frozenset("biuf")

#: Row, entry and static fields of every message type seen so far.
_LAYOUTS: dict[type, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {}
#: What each class records by its fields.
_DERIVED: dict[type, DerivedColumns] = {}


def _row_entry_static_field_names(
    message_type: type,
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    if message_type not in _LAYOUTS:
        names: dict[str, list[str]] = {PER_ROW: [], PER_ENTRY: [], STATIC: []}
        for item in fields(message_type):
            if item.name not in ("offsets", "run"):
                names[item.metadata.get("per", PER_ROW)].append(item.name)
        rows, entries, statics = map(tuple, names.values())
        _LAYOUTS[message_type] = rows, entries, statics
    return _LAYOUTS[message_type]


def slice_columns(columns: Columns, rows: slice) -> Columns:
    """Return the given slice of rows of each recorded column."""
    return {
        name: Text(values.codes[rows], values.names) if isinstance(values, Text) else values[rows]
        for name, values in columns.items()
    }


def derive_columns(message_type: type) -> DerivedColumns:
    """Return the recorded columns declared by a message class's fields; found once per class."""
    if message_type not in _DERIVED:
        _DERIVED[message_type] = DerivedColumns(message_type, Message)
    return _DERIVED[message_type]


class _DerivedRecorded:
    """`Message.recorded` of a class that does not write it itself."""

    def __get__(self, message: Any, owner: type) -> Mapping[str, Mapping[str, Column]]:
        # `dataclass` asks for it while it makes `Message` itself.
        return derive_columns(owner).recorded if is_dataclass(owner) else {}


class _Found:
    """What was computed from a message's arrays and is kept; not among its fields (`vars`)."""

    __slots__ = ("_found_instants", "_found_rows")

    _found_instants: RunTicks
    _found_rows: tuple[IntArray, IntArray]


@dataclass(eq=False)
class Message(_Found):
    """A batch of rows; subclasses add fields.

    Parameters
    ----------
    tick : ndarray of int64, shape (rows,)
        The instant at which its block made each row, in order within each run: one of those at
        which the block ran. It may arrive later, and speak of what was there earlier.
    run : ndarray of int64, shape (rows,)
        Of which run of the scene each row is, ascending. A block need not say it where all rows
        are of one run, or where they are those of its wake.
    """

    tick: IntArray
    run: IntArray = field(default=None, kw_only=True)  # type: ignore[arg-type]

    #: Tables of the columns that fields declare (`column`, `columns`).
    row_table: ClassVar[str] = ""
    entry_table: ClassVar[str] = ""

    #: What a recorder writes: table → column → `Column`. Columns block, tick and time_s are added
    #: by the engine. It follows from the fields; a class whose columns do not writes it, and
    #: `tables`, itself.
    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = _DerivedRecorded()  # type: ignore[assignment]

    #: Tables that `tables` may hold besides; other types declare them (`Component.also_records`).
    may_hold: ClassVar[frozenset[str]] = frozenset()

    #: Quantities of which a bit may stick (`with_stuck_bit`), as a scene names them. A block that
    #: sends a message without any cannot give wrong values.
    may_stick: ClassVar[tuple[str, ...]] = ()

    #: Static fields that may differ between messages: `concatenate` brings them together.
    joins_static: ClassVar[frozenset[str]] = frozenset()

    def __post_init__(self) -> None:
        """Let columns of entries that were not given be null, and whole numbers 0."""
        self.run = self._runs()
        for name, kind in derive_columns(type(self)).optional.items():
            if getattr(self, name) is None:
                count = int(self.offsets[-1])  # type: ignore[attr-defined]
                none = shared_nan_column(count) if kind == "float64" else np.zeros(count, np.int64)
                setattr(self, name, none)

    def __len__(self) -> int:
        return len(self.tick)

    @property
    def size(self) -> int:
        """The number of rows plus the number of entries."""
        offsets = getattr(self, "offsets", None)
        return len(self.tick) + (0 if offsets is None else int(offsets[-1]))

    def _runs(self) -> IntArray:
        """Return the run number of each row; zeros where the message has none."""
        return shared_zero_run_numbers(len(self.tick)) if self.run is None else self.run

    @property
    def instants(self) -> RunTicks:
        """Run and tick of each row, for searches among them (`dsa_des.arrays.run_ticks`)."""
        run, known = self._runs(), getattr(self, "_found_instants", None)
        if known is None or known.tick is not self.tick or known.run is not run:
            known = self._found_instants = RunTicks(run, self.tick)
        return known

    @instants.setter
    def instants(self, known: RunTicks) -> None:
        self.run, self.tick, self._found_instants = known.run, known.tick, known

    @property
    def row_of_entries(self) -> IntArray:
        """The row number of each entry, in a class with `offsets`."""
        offsets = self.offsets  # type: ignore[attr-defined]
        known = getattr(self, "_found_rows", None)
        if known is None or known[0] is not offsets:
            known = self._found_rows = offsets, rows_of_entries(offsets)
        return known[1]

    @row_of_entries.setter
    def row_of_entries(self, row: IntArray) -> None:
        """Take the rows that `offsets` were made of."""
        self._found_rows = self.offsets, row  # type: ignore[attr-defined]

    def _copy(self) -> Self:
        """Return a message of the same fields; several times faster than `copy.copy`."""
        result = object.__new__(type(self))
        result.__dict__.update(self.__dict__)
        return result

    @classmethod
    def empty(cls, **others: Any) -> Self:
        """Return a message of one row, at tick 0, without entries, with `others` as fields."""
        start, none = np.zeros(1, dtype=np.int64), np.zeros(2, dtype=np.int64)
        return cls(
            tick=start, **{"offsets": none, **derive_columns(cls).empty_entry_fields(), **others}
        )

    def check(self) -> None:
        """Raise TypeError or ValueError if a field's length is not that of rows or entries.

        Once per message that is sent: whoever reads it would else take one row's values for
        another's, or leave some out, without a word.

        Raises
        ------
        TypeError, ValueError
            With the class, the field, its length and that which it must have.
        """
        rows, (row_names, entry_names, _) = (
            len(self.tick),
            _row_entry_static_field_names(type(self)),
        )
        self.run = self._runs()
        if len(self.run) != rows:
            raise ValueError(f"{_describe_field(self, 'run')} has {len(self.run)} of {rows} rows")
        _check_lengths(self, row_names, rows, "rows")
        offsets = getattr(self, "offsets", None)
        if offsets is None:
            return
        if not isinstance(offsets, np.ndarray) or offsets.dtype.kind not in "iu":
            raise TypeError(
                f"{_describe_field(self, 'offsets')} is {_array_kind(offsets)}: whole numbers are "
                f"needed"
            )
        if offsets.shape != (rows + 1,) or (
            rows > 1 and np.count_nonzero(offsets[1:] < offsets[:-1])
        ):
            raise ValueError(
                f"{_describe_field(self, 'offsets')} of shape {offsets.shape} must be ascending, "
                f"one more than the {rows} rows"
            )
        _check_lengths(self, entry_names, int(offsets[-1]) - int(offsets[0]), "entries")

    def take(self, rows: slice | IntArray) -> Self:
        """Return the message of the given rows (slices give views, index arrays give copies)."""
        if isinstance(rows, slice):
            start, stop, step = rows.indices(len(self))
            if step != 1:
                return self.take(np.arange(start, stop, step))
            if start == 0 and stop == len(self):
                return self
        row_names, entry_names, _ = _row_entry_static_field_names(type(self))
        result = self._copy()
        values = result.__dict__
        for name in row_names:
            values[name] = pick_rows(values[name], rows)
        run = self._runs()
        result.run = (
            shared_zero_run_numbers(len(result.tick)) if is_shared_single_run(run) else run[rows]
        )
        if entry_names or "offsets" in values:
            values["offsets"], index = selected_offsets_and_indices(values["offsets"], rows)
            for name in entry_names:
                values[name] = pick_rows(values[name], index)
        return result

    def reorder(self, order: IntArray) -> Self:
        """Return the message with its entries in another order, each still of its row."""
        result = self._copy()
        for name in _row_entry_static_field_names(type(self))[1]:
            setattr(result, name, pick_rows(getattr(self, name), order))
        return result

    def seen_from(self, platform: str) -> Self:
        """Return the message as seen by a block on the given platform; by default unchanged."""
        return self

    def with_runs(self, run: IntArray) -> Self:
        """Return a copy of the message whose rows have the given run numbers."""
        result = self._copy()
        result.run = run
        return result

    def has_same_layout(self, other: "Message") -> bool:
        """Return whether another message has equal class, types, keys and static values."""
        if self.__class__ is not other.__class__:
            return False
        mine, others = self.__dict__, other.__dict__
        kinds = [*map(type, mine.values())]
        if kinds != [*map(type, others.values())] or [*mine] != [*others]:
            return False
        if dict in kinds:
            names = [name for name, kind in zip(mine, kinds, strict=True) if kind is dict]
            if any(mine[name].keys() != others[name].keys() for name in names):
                return False
        return all(
            mine.get(name) is others.get(name)
            for name in _row_entry_static_field_names(type(self))[2]
        )

    def tables(self) -> dict[str, Columns]:
        """Return the rows to record: table → column → values, as declared in `recorded`.

        Every table has a column ``tick``, in order; by default what the fields declare.
        """
        return derive_columns(type(self)).tables(self)

    def repeat_rows(self, of: Self, source: IntArray, later_s: FloatArray) -> Self:
        """Return this message with, in row i, the entries of row ``source[i]`` of `of` (none if
        below 0), as if measured again ``later_s[i]`` later.

        Row i has those of row ``source[i]`` of the other, ``later_s[i]`` older; none where that is
        below 0. What rows say besides stays.
        """
        offsets, index = selected_offsets_and_indices(of.offsets, np.maximum(source, 0))  # type: ignore[attr-defined]
        there = np.repeat(source >= 0, np.diff(offsets))
        result = of.reorder(np.asarray(index)[there])
        for name in (
            *_row_entry_static_field_names(type(self))[0],
            *_row_entry_static_field_names(type(self))[2],
        ):
            setattr(result, name, getattr(self, name))
        result.run = self._runs()
        kept = np.where(source >= 0, np.diff(offsets), 0)
        result.offsets = np.concatenate(([0], np.cumsum(kept)))  # type: ignore[attr-defined]
        return result

    def with_stuck_bit(self, rows: BoolArray, quantity: str, worth: float) -> Self:
        """Return the message with one bit of `quantity`, worth `worth` in its unit, set in the rows
        of a mask; by default unchanged.

        `quantity` is one of `may_stick`, and `worth` what the bit is worth in its unit.
        """
        return self

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return one message with the rows of all parts, in the order given."""
        if len(parts) == 1:
            return parts[0]
        row_names, entry_names, _ = _row_entry_static_field_names(type(parts[0]))
        # Static fields come from the last part: what a wire held before its first message may
        # know less than a real one.
        result = parts[-1]._copy()
        rows = [len(part) for part in parts]
        for name in row_names:
            setattr(result, name, join_values([*map(attrgetter(name), parts)], rows))
        result.run = concatenate_runs([part._runs() for part in parts])
        if entry_names or hasattr(result, "offsets"):
            offsets = [part.offsets for part in parts]  # type: ignore[attr-defined]
            starts = np.cumsum([0] + [int(o[-1] - o[0]) for o in offsets])
            joined = [o[:-1] - o[0] + s for o, s in zip(offsets, starts, strict=False)]
            result.offsets = np.concatenate([*joined, starts[-1:]])  # type: ignore[attr-defined]
            entries = np.diff(starts).tolist()
            for name in entry_names:
                setattr(result, name, join_values([*map(attrgetter(name), parts)], entries))
        return result

    @classmethod
    def make_initial(cls, values: Mapping[str, Any]) -> Self:
        """Return what a delayed wire holds before its first message, from the scene's values.

        Parameters
        ----------
        values : mapping
            The inline table written in the scene.

        Raises
        ------
        ValueError
            If this message type cannot be written in a scene (the default).
        """
        raise ValueError(f"{cls.__name__} cannot be written in a scene; allowed: 'nothing'")


def _describe_field(message: Message, name: str) -> str:
    return f"{type(message).__qualname__}.{name}"


def _array_kind(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    return f"of type {type(value).__name__}"


def _check_lengths(message: Message, names: tuple[str, ...], count: int, what: str) -> None:
    """Raise unless each named array, also in dicts, has `count` values along its first axis."""
    fields_of = message.__dict__
    for name in names:
        value = fields_of.get(name)
        if value.__class__ is np.ndarray:
            if not value.ndim or len(value) != count or value.dtype.kind not in _NUMBERS:
                _check_unusual_array(message, name, value, count, what)
        elif value.__class__ is dict:
            for key, item in value.items():
                fits = item.__class__ is np.ndarray and item.ndim and len(item) == count
                if not (fits or item is None or hasattr(item, "take_rows")):
                    _check_unusual_array(message, f"{name}[{key!r}]", item, count, what)
        elif value is not None and not hasattr(value, "take_rows"):
            _check_unusual_array(message, name, value, count, what)


def _check_unusual_array(message: Message, name: str, value: Any, count: int, what: str) -> None:
    """Raise TypeError or ValueError unless the value is an array of `count` numbers."""
    said = f"{_describe_field(message, name)} is {_array_kind(value)}"
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{said}: an array of {count} {what} is needed")
    if value.ndim == 0 or len(value) != count:
        raise ValueError(f"{said} where the message has {count} {what}")
    # Whole numbers of any size, such as sets of more than 63 sensors, are objects.
    if value.dtype.kind == "O" and all(isinstance(one, int) for one in value.flat):
        return
    if value.dtype.kind not in _NUMBERS:
        raise TypeError(f"{said}: numbers are needed")
