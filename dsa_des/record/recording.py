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
    holds_only,
    is_constant,
    is_empty,
    null_column,
)
from dsa_des.arrays.run_ticks import RunTicks, runs_of_single
from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.block.message import Message, rows_of
from dsa_des.block.recorded_columns import LEADING, PLATFORM
from dsa_des.errors import nearest_name
from dsa_des.record.sinks import Sink
from dsa_des.record.text_codes import TextCodes
from dsa_des.time.runs import Runs

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

    def check(self, block: str, table: str, columns: Iterable[str], message: str) -> None:
        """Raise ValueError for what would be lost silently; the same columns again cost nothing."""
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
    """Return the declared name nearest to one that is not, and what is declared."""
    names = sorted(declared)
    close = nearest_name(name, names)
    shown = ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")
    asked = "" if close is None else f"; did you mean {close!r}?"
    return f"{asked} (declared: {shown or 'nothing'})"


class _AlikeMessages(NamedTuple):
    """Messages of one block that differ in nothing but their rows, and the tables they fill."""

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
    """Gathers what blocks send and hands it on in canonical order.

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
        #: What came since `_build_pieces`, and of it what more messages of a block may join.
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
        """Learn what the run's messages record; called once, before the run.

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
        """Note a message that `block` has sent; ValueError for a column that none declares."""
        for listener in self.listeners:
            listener(block, message)
        wanted = self._pending.keys()
        if self._wanted is not None and wanted.isdisjoint({*message.recorded, *message.may_hold}):
            return
        groups = self._open.get(block, [])
        group = next((one for one in groups if one.messages[0].is_alike(message)), None)
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
        """Return the tables of a message, all of whose columns are declared."""
        tables = list(self._tables(message))
        for table, columns in tables:
            self._declared.check(block, table, columns, type(message).__name__)
        return tables

    def _build_pieces(self) -> None:
        """Join recorded messages into a few long pieces of tables."""
        groups, self._groups, self._open = self._groups, [], {}
        for block, _, messages, first in groups:
            for table, columns in first or self._combined_tables(block, messages):
                if table in self._pending and len(columns["tick"]):
                    self._pending[table].append((block, columns))

    def _combined_tables(self, block: str, messages: list[Message]) -> list[tuple[str, Columns]]:
        """Return the tables of several messages; names the one that fails."""
        try:
            return self._checked_tables(block, type(messages[0]).concatenate(messages))
        except Exception:
            for message in messages:
                try:
                    self._checked_tables(block, message)
                except Exception as error:
                    raise NotRecordedError(block, message.tick) from error
            raise

    def _tables(self, message: Message) -> Iterator[tuple[str, Columns]]:
        """Give the tables of a message; of one that does not say it there, run by run."""
        tables = message.tables()
        if not self._replicas or all("replica" in columns for columns in tables.values()):
            yield from tables.items()
            return
        firsts = message.instants.first_of_each.tolist()
        for first, end in zip(firsts, [*firsts[1:], len(message)], strict=True):
            part = message.take(slice(first, end))
            for table, columns in part.tables().items():
                run = np.full(len(columns["tick"]), part.run[0], dtype=np.int64)
                yield table, {**columns, "replica": run}

    def mark(self) -> int:
        """Return how much was noted since the last `advance`, for `rewind`."""
        self._open = {}
        return len(self._groups)

    def rewind(self, mark: int) -> None:
        """Forget what was noted since `mark`."""
        self._open = {}
        del self._groups[mark:]

    def advance(self, run: int, tick: int) -> None:
        """Pass on the rows before a tick of a run, once there are enough; no more will come."""
        if self._noted[0] >= _ROWS_AT_ONCE or self._noted[1] >= _PIECES_AT_ONCE:
            self._noted = [0, 0]
            self._build_pieces()
            if tick > 0 or run > self._handed_on:  # else runs in lock step are all under way
                self._flush_before(run, tick)

    def _flush_before(self, run: int, tick: int) -> None:
        self._handed_on = run
        self._build_pieces()
        for table, pieces in self._pending.items():
            ready: list[tuple[str, Columns]] = []
            later: list[tuple[str, Columns]] = []
            for block, columns in pieces:
                instants = _instants_of_columns(columns)
                count = instants.count_before(run, tick)
                if count == len(instants):
                    ready.append((block, columns))
                    continue
                if count:
                    ready.append((block, rows_of(columns, slice(0, count))))
                later.append((block, rows_of(columns, slice(count, len(instants)))))
            self._pending[table] = later
            if ready:
                self._flush_table(table, ready)

    def close(self) -> None:
        """Hand on everything that is left and close the sinks."""
        self._flush_before(np.iinfo(np.int64).max - 1, 0)
        for sink in self.sinks:
            sink.close()

    def _flush_table(self, table: str, pieces: list[tuple[str, Columns]]) -> None:
        pieces.sort(key=lambda piece: piece[0])
        instants = RunTicks.concatenate([_instants_of_columns(columns) for _, columns in pieces])
        order = instants.order()
        if self._ends is not None and self._ends.early:
            kept = self._ends.is_before_ends(instants)
            order = np.flatnonzero(kept) if order is None else order[kept[order]]
        if order is not None:
            instants = instants.take(order)
        if len(instants) == 0:
            return
        ordered = {
            name: self._column(table, name, kind, pieces, order, instants)
            for name, kind in self._schemas[table].items()
        }
        self.rows[table] += len(instants)
        for sink in self.sinks:
            sink.write(table, ordered)

    def _column(
        self,
        table: str,
        name: str,
        kind: str,
        pieces: list[tuple[str, Columns]],
        order: IntArray | None,
        instants: RunTicks,
    ) -> Any:
        """Return a column of all pieces in their order; `instants` are in it already."""
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
            codes = _concatenate([text.codes(block, columns) for block, columns in pieces], order)
            return Text(codes, text.names)
        given: list[Any] = [columns.get(name) for _, columns in pieces]
        if all(isinstance(values, Instants) for values in given):
            ticks = _concatenate([values.ticks for values in given], order)
            return Instants(ticks, self._ticks_per_s)
        parts = [
            _column_values(self._to_seconds(values), kind, len(columns["tick"]))
            for values, (_, columns) in zip(given, pieces, strict=True)
        ]
        if all(map(is_empty, parts)):
            return null_column(len(instants))
        return _concatenate(parts, order)

    def _to_seconds(self, values: Any) -> Any:
        """Return instants as seconds since the start of their run."""
        return values.ticks / self._ticks_per_s if isinstance(values, Instants) else values


# Pieces of fewer rows, as scan by scan gives them, are joined sooner than they are compared.
_LEAST_ROWS = 16


def _concatenate(parts: list[AnyArray], order: IntArray | None) -> AnyArray:
    """Return the values of all parts in order; where all are the same, as one of them."""
    first, rows = parts[0][:1], sum(map(len, parts))
    if rows >= _LEAST_ROWS * len(parts) and all(holds_only(part, first) for part in parts):
        return constant_column(first[0], rows if order is None else len(order), first.dtype)
    values = np.concatenate(parts) if len(parts) > 1 else parts[0]
    return values if order is None else values.take(order)


def _instants_of_columns(columns: Columns) -> RunTicks:
    tick: Any = columns["tick"]
    run: Any = columns.get("replica")
    return RunTicks(runs_of_single(len(tick)) if run is None else run, tick)


def _column_values(values: Any, kind: str, count: int) -> AnyArray:
    if values is None:
        return null_column(count) if kind == "float64" else constant_column(0, count, kind)
    values = np.asarray(values)
    # Whole numbers may be narrower: sinks widen them where they must be wide.
    if values.dtype == kind or (kind == "int64" and values.dtype.kind == "i"):
        return values
    return constant_column(values[0], count, kind) if is_constant(values) else values.astype(kind)
