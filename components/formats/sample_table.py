"""From rows of cells to trajectories, with everything that is wrong said at once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from components.arguments.units import FOOT_M
from components.formats.recording import ReadingNotes, Recording, rename_duplicates
from components.formats.sample_columns import (
    EPOCH_S,
    ONE_IN,
    GrowingColumns,
    SampleColumn,
    fill_gaps,
    int_as_float,
    is_missing,
    keep_rows,
    may_be_of_one_second,
)
from components.formats.text_rows import MOST_OF_A_CELL, MOST_PROBLEMS, Problems, TrafficFile
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.text.safe_text import shorten

_LIMITS = {
    "lat": (-90.0, 90.0, "lie in [-90, 90] degrees"),
    "lon": (-1080.0, 1080.0, "lie within ±1080 degrees"),
    "alt": (-1e4, 1e6, "lie in [-10000, 1000000] metres"),
    "pitch": (-90.0, 90.0, "lie in [-90, 90] degrees"),
    "sx": (-4e6, 4e6, "lie within ±4,000 km"),
    "sy": (-4e6, 4e6, "lie within ±4,000 km"),
    "sz": (-1e4, 1e6, "lie in [-10000, 1000000] metres"),
}
# A file in which no aircraft is seen for longer has a wrong time in it: a run would last years.
# Where both times count from 1970, days without a flight are nothing odd.
_LONGEST_SILENCE_S, _LONGEST_OF_DATES_S = 86400.0, 366 * 86400.0

_SEA_LEVEL = re.compile(r"sea[ _]?level|msl", re.IGNORECASE)
#: A pressure altitude differs by less from a height in the weather of most days.
_FAR_APART_M = 1000 * FOOT_M
# Samples closer than this are one instant, written twice.
_SHORTEST_STEP_S = 1e-6
#: Who is further from 0° N 0° E at some time is not there where only zeros stand, deg.
_NEAR_0_DEG = 1.0
#: What a row lacks that is left out; all other needed columns are its position.
_LACKS = {"time": "time", "alt": "height"}

Converter = Callable[[dict[str, FloatArray]], dict[str, FloatArray]]


class SampleTable:
    """Collects samples row by row and turns them into trajectories.

    A bad cell of an `optional` quantity is no error: a few take that of the nearest sample, else
    the aircraft goes without the whole column, and a note says so. With `gaps`, neither is a row
    without a time or a position: it is left out and counted; an aircraft that has no number at all
    in one column takes those of the column that `instead` names for it; and rows of an aircraft
    that say the same of an instant are one sample, as are a few that do not: the last one counts.
    With `shared` names several aircraft may have one (`rename_duplicates`). Where a position
    `repeats` until the next one comes, its height need not be the same. That an aircraft has none
    of a `seldom` column is not worth a word. `parse_time` reads a time cell where a plain number
    will not do.
    """

    def __init__(
        self,
        problems: Problems,
        headers: Sequence[str],
        name_column: int,
        columns: dict[str, SampleColumn],
        parse_time: Callable[[str], float] | None = None,
        optional: Collection[str] = (),
        *,
        gaps: bool = False,
        shared: bool = False,
        instead: Mapping[str, str] | None = None,
        rows: str = "rows",
        least: int = 2,
        seldom: Collection[str] = (),
        repeats: bool = False,
    ) -> None:
        self._repeats = repeats
        self._kind_of_rows, self._least, self._seldom = rows, least, frozenset(seldom)
        self._shared = shared
        self._instead = dict(instead or {})
        self._optional = frozenset(optional) - self._instead.keys() - {*self._instead.values()}
        self._needed = columns.keys() - self._optional - {*self._instead.values()}
        self._problems, self._name_column, self._columns = problems, name_column, columns
        self._parse_time, self._gaps = parse_time, gaps
        self._aircraft: dict[str, GrowingColumns] = {}
        self.notes = ReadingNotes()
        self._apart: dict[str, list[tuple[float, str]]] = {}
        self._second: dict[str, list[str]] = {}
        self._width = len(headers)
        self._plan = [
            (quantity, column.index, column.factor, *_limits(quantity)[:2])
            for quantity, column in columns.items()
        ]
        used = {name_column, *(column.index for column in columns.values())}
        if ignored := [one for i, one in enumerate(headers) if one and i not in used]:
            self.notes.harmless.append(f"columns ignored: {', '.join(ignored)}")

    def add_row(self, line: int, row: list[str] | int) -> None:
        """Add a row of cells as a sample, or a problem; an int stands for a wrong cell count."""
        if isinstance(row, int) or len(row) != self._width:
            count = row if isinstance(row, int) else len(row)
            self._problems.add(
                f"the row has {count} values: the header names {self._width} columns", line=line
            )
            return
        name = row[self._name_column]
        if not name:
            self._problems.add("the aircraft has no name", line=line)
            return
        # An aircraft counts as named even if its row is bad: it is there, only not usable.
        rows = self._columns_of_aircraft(name)
        numbers: list[float] = []
        whole = True
        for quantity, index, factor, low, high in self._plan:
            cell = row[index]
            try:
                value = float(cell) * factor
            except ValueError:
                value = math.nan
            if not low <= value <= high or "_" in cell:
                found = self._read_unusual_cell(line, quantity, cell)
                whole, value = whole and found is not None, found or 0.0
            numbers.append(value)
        if whole:
            rows.add(line, numbers)

    def add_numbers(self, line: int, name: str, values: Sequence[Any]) -> None:
        """Add a sample of values in the columns' order; what is no number counts as missing."""
        rows = self._columns_of_aircraft(name)
        if not name:
            self._problems.add("the aircraft has no name", line=line)
            return
        numbers: list[float] = []
        for (quantity, _, _, low, high), value in zip(self._plan, values, strict=True):
            number = value if type(value) is float else int_as_float(value)
            if not low <= number <= high:
                if quantity not in self._optional and math.isfinite(number):
                    self._number(line, quantity, self._columns[quantity], repr(number))
                    return
                number = math.nan
            numbers.append(number)
        rows.add(line, numbers)

    def _columns_of_aircraft(self, name: str) -> GrowingColumns:
        if name not in self._aircraft:
            self._aircraft[name] = GrowingColumns(self._columns)
        return self._aircraft[name]

    def _read_unusual_cell(self, line: int, quantity: str, cell: str) -> float | None:
        """Return an unusual cell's value: NaN if missing, or None after adding a problem."""
        if quantity in self._optional:
            return math.nan
        if self._gaps and is_missing(cell):
            return math.nan
        return self._number(line, quantity, self._columns[quantity], cell)

    def _describe_columns(self, key: str) -> str:
        """Return in words which column, or which two, a quantity was read from."""
        first, second = (self._columns.get(one) for one in (key, self._instead.get(key, "")))
        whom = len(self._second.get(key, ()))
        if first is None or second is None or not whom:
            return "" if first is None else first.header
        if whom == self._kept:
            return second.header
        return f"{first.header}, of {whom} aircraft {second.header}"

    def _aircraft_with_sea_heights(self, names: Collection[str]) -> list[str]:
        """Return the aircraft whose heights are above mean sea level by their column's header."""
        second = self._second.get("alt", ())
        columns = [self._columns.get("alt instead" if name in second else "alt") for name in names]
        return [
            name for name, column in zip(names, columns, strict=True)
            if column is not None and _SEA_LEVEL.search(column.header)
        ]  # fmt: skip

    def recording(self, ownship: str | None, to_geodetic: Converter, **said: Any) -> Recording:
        """Check the samples and return a `Recording`, with ``said`` as its further fields."""
        samples = {name: to_geodetic(one) for name, one in self.samples(ownship).items()}
        said = {
            "height": self._describe_columns("alt"),
            "above_sea": self._aircraft_with_sea_heights(samples),
            **said,
        }
        return Recording(self._problems, samples, self.notes, **said)

    def finish(self, ownship: str | None, to_geodetic: Converter) -> TrafficFile:
        """Check the samples and return them as the flights of a `TrafficFile`."""
        return self.recording(ownship, to_geodetic).flights()

    def samples(self, ownship: str | None) -> dict[str, dict[str, FloatArray]]:
        """Check the samples; return their columns by aircraft, ownship first, in time order."""
        kept = self._lines_and_gapless_columns()
        if self._shared:
            kept = rename_duplicates(kept, self.notes)
        names = list(kept)
        if not names:
            lacking = self._describe_missing_quantities(" or ")
            of = f": all {self._kind_of_rows} have {lacking}" if lacking else " in it"
            self._problems.fail(
                f"there are no samples{of}; time, latitude, longitude and height are needed"
            )
        if len(names) < self._least:
            self._problems.add(
                f"there is one aircraft only, {shorten(names[0])!r}: an ownship and at least "
                "one intruder are needed"
            )
        own = names[0] if ownship is None else ownship
        if own not in kept:
            self._problems.add(
                f"there is no aircraft {own!r}: it must be one of "
                f"{', '.join(shorten(name) for name in names[:MOST_PROBLEMS])}"
                f"{', …' if len(names) > MOST_PROBLEMS else ''}"
            )
        self._refuse_long_silence(kept)
        samples = {name: self._sort_by_time(name, *kept.pop(name)) for name in names}
        self._problems.raise_if_any()
        return {own: samples.pop(own), **samples}

    def _lines_and_gapless_columns(self) -> dict[str, tuple[IntArray, dict[str, FloatArray]]]:
        """Return each aircraft's line numbers and columns, without rows and columns with gaps."""
        kept = {}
        self._lacks: dict[str, int] = {}
        left_out, absent = 0, 0
        for name, rows in self._aircraft.items():
            lines = np.asarray(rows.lines)
            columns = {key: np.asarray(values) for key, values in rows.values.items()}
            rows.values.clear()  # those of many rows are not held beside what is kept of them
            if not len(lines):  # all its rows were bad, which has been noted row by row
                kept[name] = lines, dict.fromkeys(self._columns, np.empty(0))
                continue
            for key, other in self._instead.items():
                one = self._first_or_second(
                    name, key, columns.pop(key, None), columns.pop(other, None)
                )
                columns |= {} if one is None else {key: one}
            there = np.ones(len(lines), dtype=bool)
            for key in self._needed:
                lacks = np.isnan(columns[key]) if key in columns else np.True_
                if lacks.any():
                    self._lacks[_LACKS.get(key, "position")] = 1
                    there &= ~lacks
            if self._gaps and {"lat", "lon"} <= columns.keys():
                # Many write zeros where no position is known.
                nowhere = (columns["lat"] == 0.0) & (columns["lon"] == 0.0)
                if (
                    nowhere.any()
                    and np.nanmax(np.hypot(columns["lat"], columns["lon"])) > _NEAR_0_DEG
                ):
                    self._lacks["position"] = 1
                    there &= ~nowhere
            if not there.all():
                left_out += int(np.count_nonzero(~there))
                lines = lines[there]
                keep_rows(columns, there)
                if not len(lines):
                    absent += 1
                    continue
            for key in sorted(self._optional & self._columns.keys()):
                column = columns.pop(key, None)
                missing = len(lines) if column is None else int(np.count_nonzero(np.isnan(column)))
                filled = (
                    column if column is None or not missing else fill_gaps(columns["time"], column)
                )
                if filled is not None:
                    columns[key] = filled
                if missing and not (missing == len(lines) and key in self._seldom):
                    self.notes.note_aircraft(
                        name, f"gaps in {self._columns[key].header}",
                        f"column {self._columns[key].header} has no number in {missing} of its "
                        f"{len(lines)} samples" + (
                            " and is ignored" if filled is None
                            else ": that of the nearest one is taken"
                        ),
                        harmless=filled is not None or missing == len(lines),
                    )  # fmt: skip
            kept[name] = lines, columns
        self._kept = len(kept)
        self._second = {
            key: [name for name in names if name in kept] for key, names in self._second.items()
        }
        self._note_second_columns()
        if left_out:
            of = self._kind_of_rows[:-1] + " was" if left_out == 1 else f"{self._kind_of_rows} were"
            what = f"{left_out} {of} left out that had {self._describe_missing_quantities(' or ')}"
            self.notes.warnings.append(what + (f", {absent} aircraft wholly" if absent else ""))
        return kept

    def _describe_missing_quantities(self, between: str) -> str:
        """Return in words which quantities were missing in the rows that were left out."""
        kinds = ("time", "position", "height")
        return between.join(f"no {kind}" for kind in kinds if kind in self._lacks)

    def _first_or_second(
        self, name: str, key: str, first: FloatArray | None, second: FloatArray | None
    ) -> FloatArray | None:
        """Return an aircraft's first column of a quantity, else its second; note any difference."""
        if first is not None and second is not None:
            apart = np.abs(first - second)
            if not np.isnan(apart).all():
                self._apart.setdefault(key, []).append((float(np.nanmax(apart)), name))
        elif second is not None:
            self._second.setdefault(key, []).append(name)
            return second
        return first

    def _note_second_columns(self) -> None:
        """Add a note where two columns hold one quantity: which is read, how far they differ."""
        for key, other in self._instead.items():
            first, second = self._columns[key].header, self._columns[other].header
            if whom := self._second.get(key, []):
                if len(whom) == self._kept:
                    self.notes.harmless.append(f"{second} is read: there is no {first}")
                else:
                    more = f" (and {len(whom) - 1} more aircraft)" if len(whom) > 1 else ""
                    said = f"{second} is read beside {first} of others: it has no {first}"
                    self.notes.warnings.append(f"{whom[0]}{more}: {said}")
            if apart := self._apart.get(key):
                most, name = max(apart)
                said = (
                    f"{first} is read, {second} differs by up to {most:,.0f} m "
                    f"({most / FOOT_M:,.0f} ft, {name})"
                )
                (self.notes.warnings if most > _FAR_APART_M else self.notes.harmless).append(said)

    def _number(self, line: int, quantity: str, column: SampleColumn, cell: str) -> float | None:
        try:
            if quantity == "time" and self._parse_time is not None:
                value = self._parse_time(cell)
            else:
                value = float(cell) * column.factor
                # float() takes 1_000, which no file format means.
                if "_" in cell:
                    raise ValueError(cell)
        except ValueError:
            shown = shorten(cell, MOST_OF_A_CELL)
            hint = "; use a decimal point" if cell.replace(",", ".", 1) != cell else ""
            what = f"{shown!r} is not a number" if cell else "the cell is empty"
            needed = f"a finite number is needed{hint}"
            if quantity == "time" and self._parse_time is not None and re.search(r"\d[./:-]", cell):
                what = f"{shown!r} is no time"
                needed = "it must be seconds, or as 2024-06-01T12:00:00Z"
            self._problems.add(f"{what}: {needed}", line=line, column=column.header)
            return None
        if not math.isfinite(value):
            self._problems.add(
                f"{shorten(cell, MOST_OF_A_CELL)!r} is not finite: a finite number is needed",
                line=line,
                column=column.header,
            )
            return None
        low, high, allowed = _limits(quantity)
        if not low <= value <= high:
            self._problems.add(
                f"{shorten(cell, MOST_OF_A_CELL)} is out of range: it must {allowed}",
                line=line,
                column=column.header,
            )
            return None
        return value

    def _sort_by_time(
        self, name: str, lines: IntArray, columns: dict[str, FloatArray]
    ) -> dict[str, FloatArray]:
        """Return samples in order of time, each once; a problem if two positions at one time."""
        if not len(lines):
            return {}
        if np.any(columns["time"][1:] < columns["time"][:-1]):
            order = np.argsort(columns["time"], kind="stable")
            self.notes.note_aircraft(
                name,
                "order",
                "rows were not in the order of time and have been sorted",
                harmless=True,
            )
            lines = lines[order]
            keep_rows(columns, order)
        apart = self._optional | ({"alt"} if self._repeats else frozenset())
        where = [values for key, values in columns.items() if key not in apart]
        again = np.all([values[1:] == values[:-1] for values in where], axis=0) & self._gaps
        if again.any():
            count = int(np.count_nonzero(again))
            said = f"{count} of its samples stand there again and count once"
            self.notes.note_aircraft(name, "again", said, harmless=self._repeats)
            once = np.concatenate([[True], ~again])
            lines = lines[once]
            keep_rows(columns, once)
        times, header = columns["time"], self._columns["time"].header
        at_once = np.diff(times) < _SHORTEST_STEP_S
        count = int(np.count_nonzero(at_once))
        is_slip = count <= len(times) // ONE_IN or may_be_of_one_second(columns, at_once)
        if self._gaps and count and is_slip:
            said = f"several samples at one instant, {count} times: the last one counts"
            self.notes.note_aircraft(name, "at once", said)
            keep_rows(columns, np.append(~at_once, True))
            return columns
        for i in np.flatnonzero(at_once):
            of = f"{self._problems.of} {lines[i]}"
            what = f"{name} already has a sample at {times[i]:.15g} s, in {of}: "
            if times[i] == times[i + 1]:
                what += "an aircraft may have only one at a time"
            else:
                what += f"the next one must be at least {_SHORTEST_STEP_S:g} s later"
            self._problems.add(what, line=int(lines[i + 1]), column=header)
        return columns

    def _refuse_long_silence(
        self, kept: Mapping[str, tuple[IntArray, dict[str, FloatArray]]]
    ) -> None:
        """Add a problem for each gap in the times of the whole file that is too long."""
        times = np.concatenate([columns["time"] for _, columns in kept.values()])
        times.sort()
        for i in np.flatnonzero(np.diff(times) > _LONGEST_SILENCE_S):
            before_s, after_s = times[i : i + 2].tolist()
            if before_s > EPOCH_S and after_s - before_s <= _LONGEST_OF_DATES_S:
                continue
            last, first = (
                np.concatenate([lines[c["time"] == time_s] for lines, c in kept.values()])
                for time_s in (before_s, after_s)
            )
            self._problems.add(
                f"the time is {after_s:.15g} s, and the one before it, in "
                f"{self._problems.of} {last.max()}, is {before_s:.15g} s: the file may not be "
                f"without a sample for more than {_LONGEST_SILENCE_S:g} s, where it says dates "
                f"{_LONGEST_OF_DATES_S / _LONGEST_SILENCE_S:g} days",
                line=int(first.min()),
                column=self._columns["time"].header,
            )


def _limits(quantity: str) -> tuple[float, float, str]:
    plain = quantity.removesuffix(" instead")
    return _LIMITS.get(plain, (-1e12, 1e12, "lie within ±1e12"))
