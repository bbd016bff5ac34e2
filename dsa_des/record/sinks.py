"""Where recorded rows go: into memory or to observers; attempts that may fail and end no run."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Protocol

import numpy as np

from dsa_des.arrays.column_values import (
    Columns,
    Instants,
    Schema,
    Text,
    has_same_bits,
    instants_to_seconds,
)
from dsa_des.arrays.types import AnyArray


def call_or_note(
    what: str,
    notes: list[str],
    call: Callable[..., Any],
    *arguments: Any,
    unless: type[Exception] = BrokenPipeError,
) -> Any:
    """Return a function's result; note any error but `unless` in `notes` and return None."""
    try:
        return call(*arguments)
    except unless:
        raise
    except Exception as error:  # MemoryError is one of them
        notes.append(f"{what} failed: {_error_reason(error)}")
        return None


def _error_reason(error: Exception) -> str:
    text = str(error).strip().split("\n")[0]
    if isinstance(error, MemoryError):
        return f"out of memory{': ' if text else ''}{text}"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


class Sink(Protocol):
    """Something that takes recorded rows: a file, memory, or a running summary."""

    def open(self, schemas: Mapping[str, Schema]) -> None:
        """Prepare for the tables of a run, given the kind of each of their columns."""

    def write(self, table: str, columns: Columns) -> None:
        """Add rows to one table; they come in their final order."""

    def close(self) -> None:
        """Finish the output; no more rows will follow."""


# Smaller pieces are kept as they come: to look at them costs more than they hold.
_WORTH_PACKING = 4096


class _Keeping:
    """Keeps all rows in memory: whole numbers as narrow as they are, what tables share once."""

    def __init__(self) -> None:
        self._schemas: Mapping[str, Schema] = {}
        self._parts: dict[str, list[Columns]] = {}

    def open(self, schemas: Mapping[str, Schema]) -> None:
        """Prepare for the tables of a run, given the kind of each of their columns."""
        self._schemas = schemas
        self._parts = {table: [] for table in schemas}

    def write(self, table: str, columns: Columns) -> None:
        """Store rows of one table in memory."""
        if len(next(iter(columns.values()), ())) >= _WORTH_PACKING:
            columns = {
                name: self._shrink_or_share(name, values) for name, values in columns.items()
            }
        self._parts[table].append(columns)

    def _shrink_or_share(self, name: str, values: Any) -> Any:
        if isinstance(values, Text):
            return Text(_in_narrowest_integer_type(values.codes), values.names)
        if isinstance(values, Instants):  # most often those of the rows
            return Instants(self._shrink_or_share("tick", values.ticks), values.ticks_per_s)
        if values.dtype.kind == "i":
            values = _in_narrowest_integer_type(values)
        if not values.strides[0]:
            return values
        for parts in self._parts.values():
            other: Any = parts[-1].get(name) if parts else None
            if other is not None and has_same_bits(other, values):
                return other
        return values

    def close(self) -> None:
        """Nothing to do."""


def _in_narrowest_integer_type(values: AnyArray) -> AnyArray:
    """Return whole numbers in the narrowest of int8 to int32; a stride-0 column stays unchanged."""
    if not values.strides[0]:
        return values
    ends = np.array([values.min(), values.max()])
    for kind in (np.int8, np.int16, np.int32):
        if values.dtype.itemsize > np.dtype(kind).itemsize and (ends == ends.astype(kind)).all():
            return values.astype(kind)
    return values


class ColumnSink(_Keeping):
    """Keeps all rows in memory; `tables` gives them as columns."""

    def tables(self) -> dict[str, Columns]:
        """Return table name → column name → values."""
        return {table: self._concatenate(table, parts) for table, parts in self._parts.items()}

    def _concatenate(self, table: str, parts: list[Columns]) -> Columns:
        joined: Columns = {}
        for name, kind in self._schemas[table].items():
            pieces: list[Any] = [instants_to_seconds(part[name]) for part in parts]
            if kind == "text":  # later pieces know at least the names of earlier ones
                codes = [piece.codes for piece in pieces]
                names = pieces[-1].names if pieces else ()
                joined[name] = Text(_join_column(codes, np.int32), names)
            else:
                joined[name] = _join_column(pieces, np.dtype(kind))
        return joined


def _join_column(pieces: list[AnyArray], kind: Any) -> AnyArray:
    if len(pieces) == 1:
        return pieces[0].astype(kind, copy=False)
    return np.concatenate(pieces, dtype=kind) if pieces else np.empty(0, dtype=kind)


class MemorySink(_Keeping):
    """Keeps all rows in memory; `tables` gives them as Arrow tables."""

    def tables(self) -> dict[str, Any]:
        """Return table name → ``pyarrow.Table``."""
        import pyarrow as pa

        from dsa_des.record.arrow import arrow_schema, to_arrow

        return {
            table: pa.Table.from_batches(
                [to_arrow(columns, schema) for columns in self._parts[table]],
                schema=arrow_schema(schema),
            ).combine_chunks()
            for table, schema in self._schemas.items()
        }


class Observer(Protocol):
    """A running summary over recorded rows, for reports and metrics."""

    tables: ClassVar[frozenset[str]]

    def update(self, table: str, columns: Columns) -> None:
        """Add rows of one of the tables that this observer reads."""

    def result(self) -> dict[str, Any]:
        """Return sections of the run's summary."""


def _observer_column(values: Any) -> Any:
    """Return an observer column: instants as seconds, integers as int64, others unchanged."""
    if isinstance(values, Text):
        return values
    values = instants_to_seconds(values)
    return values.astype(np.int64, copy=False) if values.dtype.kind == "i" else values


class ObserverSink:
    """Passes rows on to observers.

    With a list of `notes`, an observer that raises is left out from then on and noted there, so
    that the run goes on; without one the run ends.
    """

    def __init__(self, observers: Iterable[Observer], notes: list[str] | None = None) -> None:
        self.observers = list(observers)
        self._notes = notes

    def open(self, schemas: Mapping[str, Schema]) -> None:
        """Nothing to do."""

    def write(self, table: str, columns: Columns) -> None:
        """Pass rows to every observer of this table."""
        asked = [observer for observer in self.observers if table in observer.tables]
        if asked:
            columns = {name: _observer_column(values) for name, values in columns.items()}
        for observer in asked:
            self._call_observer(observer, observer.update, table, columns)

    def close(self) -> None:
        """Nothing to do."""

    def result(self) -> dict[str, Any]:
        """Return the sections of all observers."""
        sections: dict[str, Any] = {}
        for observer in list(self.observers):
            sections.update(self._call_observer(observer, observer.result) or {})
        return sections

    def _call_observer(self, observer: Observer, call: Callable[..., Any], *arguments: Any) -> Any:
        if self._notes is None:
            return call(*arguments)
        count = len(self._notes)
        answer = call_or_note(
            f"the summary {type(observer).__name__}", self._notes, call, *arguments
        )
        if len(self._notes) > count:
            self.observers.remove(observer)
        return answer
