"""The recorder: what blocks send, checked against what messages declare, in canonical order."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.column_values import (
    Columns,
    Instants,
    Schema,
    Text,
    constant_column,
    has_only_value,
    is_shared_nan_column,
    is_stored_once,
    shared_nan_column,
)
from dsa_des.arrays.run_ticks import RunTicks, shared_zero_run_numbers
from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.block.message import Message, slice_columns
from dsa_des.block.recorded_columns import LEADING, PLATFORM
from dsa_des.errors import nearest_name
from dsa_des.record.sinks import Sink
from dsa_des.record.text_codes import TextCodes
from dsa_des.time.timeline_runs import Runs

# Declared names that an error lists.
_MOST_NAMES = 30


class DeclaredColumns:
    """The columns of a run's tables (by kind), also those that are not wanted.

    `leading` are those that the engine adds.
    """

    def __init__(self, schemas: Mapping[str, Schema], leading: Iterable[str]) -> None:
        self._columns = {table: frozenset(schema) for table, schema in schemas.items()}
        self._leading = frozenset(leading)
        #: By block and table, the columns that are known to be declared.
        self._sound: dict[tuple[str, str], tuple[str, ...]] = {}

    def check_declared(self, block: str, table: str, columns: Iterable[str], message: str) -> None:
        """Raise ValueError for an undeclared table or column, or a table without ``tick``."""
        names = tuple(name for name in columns if name != "replica")
        if self._sound.get((block, table)) == names:
            return
        where = f"block {block!r}: its {message} records"
        how = "; a message class declares what it records, table by table, in `recorded`"
        known = self._columns.get(table)
        if known is None:
            raise ValueError(
                f"{where} a table {table!r} that no message of the run declares"
                f"{_suggest_declared(table, self._columns)}{how}"
            )
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ValueError(
                f"{where} a column {unknown[0]!r} in table {table!r} that no message of the run "
                f"declares{_suggest_declared(unknown[0], known - self._leading)}{how}"
            )
        if "tick" not in names:
            raise ValueError(f"{where} a table {table!r} without a column 'tick'")
        self._sound[block, table] = names


def _suggest_declared(name: str, declared: Iterable[str]) -> str:
    """Return text with the declared name closest to an undeclared one, and all declared ones."""
    names = sorted(declared)
    close = nearest_name(name, names)
    shown = ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")
    asked = "" if close is None else f"; did you mean {close!r}?"
    return f"{asked} (declared: {shown or 'nothing'})"


class _AlikeMessages(NamedTuple):
    """Messages of one block with one layout, so they can be joined, and the tables they fill."""

    block: str
    tables: frozenset[str]
    messages: list[Message]
    #: The tables, while there is one message only.
    first: list[tuple[str, Columns]]


# So many rows, or pieces of them, are handed on at a time: a few would cost as much.
_ROWS_AT_ONCE, _PIECES_AT_ONCE = 16_384, 2048
_LEADING: Schema = {name: column.kind for name, column in LEADING.items()}


class NotRecordedError(Exception):
    """A message cannot be recorded; its cause says why."""

    def __init__(self, block: str, ticks: IntArray) -> None:
        super().__init__(block, ticks)
        self.block, self.ticks = block, ticks


class Recorder:
    """Collects what blocks record and passes the rows to its sinks, sorted by run and tick.

    `wanted` are the columns to record, by table, everything by default: what is not wanted costs
    nothing. `runs` is how many runs of the scene are recorded for the same purpose, here and
    elsewhere.
    """

    def __init__(
        self,
        sinks: Iterable[Sink],
        *,
        wanted: Mapping[str, Collection[str]] | None = None,
        runs: int = 1,
    ) -> None:
        self.runs = runs
        self.sinks = list(sinks)
        #: Told of every message when it is sent, by block: also of what a window that is undone
        #: had sent, and before the rows are in their order.
        self.listeners: list[Callable[[str, Message], None]] = []
        self._wanted = wanted
        self._ticks_per_s = 1
        self._schemas: dict[str, Schema] = {}
        self._platforms: Mapping[str, str] = {}
        self._pending: dict[str, list[tuple[str, Columns]]] = {}
        #: What came since `_join_recorded_messages`, and of it what more messages of a block may
        # join.
        self._groups: list[_AlikeMessages] = []
        self._open: dict[str, list[_AlikeMessages]] = {}
        self._texts: dict[tuple[str, str], TextCodes] = {}
        self._declared = DeclaredColumns({}, _LEADING)
        self.rows: dict[str, int] = {}
        self._ends: Runs | None = None
        #: Rows and pieces noted since some were handed on; more where a window was undone.
        self._noted = [0, 0]
        #: The run before which all was handed on.
        self._handed_on = 0

    @property
    def wanted_tables(self) -> Collection[str] | None:
        """The tables that are recorded; None for all that there are."""
        return None if self._wanted is None else self._wanted.keys()

    def open(
        self,
        messages: Iterable[type[Message]],
        ticks_per_s: int,
        ends: Runs | None = None,
        *,
        replicas: bool = False,
        platforms: Mapping[str, str] | None = None,
    ) -> None:
        """Set up all tables and columns, and open the sinks; called once, before the run.

        With `replicas` every table begins with the number of the run; with `platforms` the platform
        of each row's block is a column. Rows of when a run has ended, as `ends` knows when they
        are handed on, are left out.
        """
        self._ends, self._platforms = ends, platforms or {}
        self._ticks_per_s = ticks_per_s
        self._replicas = replicas
        leading = {"replica": "int64", **_LEADING} if replicas else _LEADING
        leading = {**leading, PLATFORM: "text"} if platforms else leading
        for message in messages:
            for table, columns in message.recorded.items():
                kinds = {name: column.kind for name, column in columns.items()}
                self._schemas.setdefault(table, dict(leading)).update(kinds)
        self._declared = DeclaredColumns(self._schemas, leading)
        if self._wanted is not None:
            self._schemas = {
                table: {
                    name: kind
                    for name, kind in schema.items()
                    if name == "replica" or name in self._wanted[table]
                }
                for table, schema in self._schemas.items()
                if table in self._wanted
            }
        self._schemas = dict(sorted(self._schemas.items()))
        self._pending = {table: [] for table in self._schemas}
        self.rows = dict.fromkeys(self._schemas, 0)
        for sink in self.sinks:
            sink.open(self._schemas)

    def record(self, block: str, message: Message) -> None:
        """Add a message sent by `block`; ValueError for an undeclared table or column."""
        for listener in self.listeners:
            listener(block, message)
        wanted = self._pending.keys()
        if self._wanted is not None and wanted.isdisjoint({*message.recorded, *message.may_hold}):
            return
        groups = self._open.get(block, [])
        group = next((one for one in groups if one.messages[0].has_same_layout(message)), None)
        if group is None:
            first = self._checked_tables(block, message)
            if not (tables := frozenset(table for table, _ in first)):
                return
            group = _AlikeMessages(block, tables, [], first)
            self._groups.append(group)
            # Rows of one instant stay in the order in which their block sent them.
            still = [one for one in groups if one.tables.isdisjoint(tables)]
            self._open[block] = [*still, group]
        else:
            group.first.clear()
        group.messages.append(message)
        self._noted[0] += message.size
        self._noted[1] += 1

    def _checked_tables(self, block: str, message: Message) -> list[tuple[str, Columns]]:
        """Return the tables of a message; raise ValueError if a table or column is not declared."""
        tables = list(self._tables_with_run(message))
        for table, columns in tables:
            self._declared.check_declared(block, table, columns, type(message).__name__)
        return tables

    def _join_recorded_messages(self) -> None:
        """Join messages recorded so far into a few long pieces of each table, to be written."""
        groups, self._groups, self._open = self._groups, [], {}
        for block, _, messages, first in groups:
            for table, columns in first or self._tables_of_messages(block, messages):
                if table in self._pending and len(columns["tick"]):
                    self._pending[table].append((block, columns))

    def _tables_of_messages(self, block: str, messages: list[Message]) -> list[tuple[str, Columns]]:
        """Return messages' tables joined into one; NotRecordedError for a message that is wrong."""
        try:
            return self._checked_tables(block, type(messages[0]).concatenate(messages))
        except Exception:
            for message in messages:
                try:
                    self._checked_tables(block, message)
                except Exception as error:
                    raise NotRecordedError(block, message.tick) from error
            raise

    def _tables_with_run(self, message: Message) -> Iterator[tuple[str, Columns]]:
        """Yield a message's tables; in lock step with the run's number as column ``replica``."""
        tables = message.tables()
        if not self._replicas or all("replica" in columns for columns in tables.values()):
            yield from tables.items()
            return
        firsts = message.instants.first_position_of_runs.tolist()
        for first, end in zip(firsts, [*firsts[1:], len(message)], strict=True):
            part = message.take(slice(first, end))
            for table, columns in part.tables().items():
                run = np.full(len(columns["tick"]), part.run[0], dtype=np.int64)
                yield table, {**columns, "replica": run}

    def count_for_rewind(self) -> int:
        """Return the number of message groups recorded so far, to which `rewind` can go back."""
        self._open = {}
        return len(self._groups)

    def rewind(self, mark: int) -> None:
        """Drop everything recorded since `mark` was returned."""
        self._open = {}
        del self._groups[mark:]

    def flush_if_large(self, run: int, tick: int) -> None:
        """Write the rows before a tick of a run if they are many; no earlier rows may follow."""
        if self._noted[0] >= _ROWS_AT_ONCE or self._noted[1] >= _PIECES_AT_ONCE:
            self._noted = [0, 0]
            self._join_recorded_messages()
            if tick > 0 or run > self._handed_on:  # else runs in lock step are all under way
                self._flush_before(run, tick)

    def _flush_before(self, run: int, tick: int) -> None:
        self._handed_on = run
        self._join_recorded_messages()
        for table, pieces in self._pending.items():
            ready: list[tuple[str, Columns]] = []
            later: list[tuple[str, Columns]] = []
            for block, columns in pieces:
                instants = _instants_of_columns(columns)
                count = instants.count_before_run_tick(run, tick)
                if count == len(instants):
                    ready.append((block, columns))
                    continue
                if count:
                    ready.append((block, slice_columns(columns, slice(0, count))))
                later.append((block, slice_columns(columns, slice(count, len(instants)))))
            self._pending[table] = later
            if ready:
                self._flush_table(table, ready)

    def close(self) -> None:
        """Write all rows that are left to the sinks, and close these."""
        self._flush_before(np.iinfo(np.int64).max - 1, 0)
        for sink in self.sinks:
            sink.close()

    def _flush_table(self, table: str, pieces: list[tuple[str, Columns]]) -> None:
        pieces.sort(key=lambda piece: piece[0])
        instants = RunTicks.concatenate([_instants_of_columns(columns) for _, columns in pieces])
        order = instants.sort_indices()
        if self._ends is not None and self._ends.early:
            kept = self._ends.is_before_ends(instants)
            order = np.flatnonzero(kept) if order is None else order[kept[order]]
        if order is not None:
            instants = instants.take(order)
        if len(instants) == 0:
            return
        ordered = {
            name: self._joined_column(table, name, kind, pieces, order, instants)
            for name, kind in self._schemas[table].items()
        }
        self.rows[table] += len(instants)
        for sink in self.sinks:
            sink.write(table, ordered)

    def _joined_column(
        self,
        table: str,
        name: str,
        kind: str,
        pieces: list[tuple[str, Columns]],
        order: IntArray | None,
        instants: RunTicks,
    ) -> Any:
        """Return a column of all pieces, joined and ordered; `instants` has that order already."""
        if name == "replica":
            return instants.run
        if name == "tick":
            return instants.tick
        if name == "time_s":
            return Instants(instants.tick, self._ticks_per_s)
        if kind == "text":
            says: dict[str, Callable[[str], str | None]]
            says = {"block": str, PLATFORM: self._platforms.get}
            text = self._texts.setdefault((table, name), TextCodes(name, says.get(name)))
            codes = _concatenate(
                [text.translate_codes(block, columns) for block, columns in pieces], order
            )
            return Text(codes, text.names)
        given: list[Any] = [columns.get(name) for _, columns in pieces]
        if all(isinstance(values, Instants) for values in given):
            ticks = _concatenate([values.ticks for values in given], order)
            return Instants(ticks, self._ticks_per_s)
        parts = [
            _column_values(self._to_seconds(values), kind, len(columns["tick"]))
            for values, (_, columns) in zip(given, pieces, strict=True)
        ]
        if all(map(is_shared_nan_column, parts)):
            return shared_nan_column(len(instants))
        return _concatenate(parts, order)

    def _to_seconds(self, values: Any) -> Any:
        """Return instants as seconds since the start of their run."""
        return values.ticks / self._ticks_per_s if isinstance(values, Instants) else values


# Pieces of fewer rows, as scan by scan gives them, are joined sooner than they are compared.
_LEAST_ROWS = 16


def _concatenate(parts: list[AnyArray], order: IntArray | None) -> AnyArray:
    """Return all parts' values joined and ordered; as one stored value if all are equal."""
    first, rows = parts[0][:1], sum(map(len, parts))
    if rows >= _LEAST_ROWS * len(parts) and all(has_only_value(part, first) for part in parts):
        return constant_column(first[0], rows if order is None else len(order), first.dtype)
    values = np.concatenate(parts) if len(parts) > 1 else parts[0]
    return values if order is None else values.take(order)


def _instants_of_columns(columns: Columns) -> RunTicks:
    tick: Any = columns["tick"]
    run: Any = columns.get("replica")
    return RunTicks(shared_zero_run_numbers(len(tick)) if run is None else run, tick)


def _column_values(values: Any, kind: str, count: int) -> AnyArray:
    if values is None:
        return shared_nan_column(count) if kind == "float64" else constant_column(0, count, kind)
    values = np.asarray(values)
    # Whole numbers may be narrower: sinks widen them where they must be wide.
    if values.dtype == kind or (kind == "int64" and values.dtype.kind == "i"):
        return values
    return (
        constant_column(values[0], count, kind) if is_stored_once(values) else values.astype(kind)
    )
