"""From rows of cells to trajectories, with everything that is wrong said at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.flights.sampled_flight import SampledTrajectory
from components.formats.text_rows import (
    MOST_OF_A_CELL,
    MOST_PROBLEMS,
    NO_UNIT,
    UNIT_KINDS,
    Problems,
    TrafficFile,
    clean_token,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.text.safe_text import shortened

_LIMITS = {
    "lat": (-90.0, 90.0, "lie in [-90, 90] degrees"),
    "lon": (-1080.0, 1080.0, "lie within ±1080 degrees"),
    "alt": (-1e4, 1e6, "lie in [-10000, 1000000] metres"),
    "pitch": (-90.0, 90.0, "lie in [-90, 90] degrees"),
    "sx": (-4e6, 4e6, "lie within ±4,000 km"),
    "sy": (-4e6, 4e6, "lie within ±4,000 km"),
    "sz": (-1e4, 1e6, "lie in [-10000, 1000000] metres"),
}
# A file in which no aircraft is seen for longer than this has a wrong time in it: a run would
# simulate the years in between.
_LONGEST_SILENCE_S = 86400.0

# Samples closer than this are one instant, written twice.
_SHORTEST_STEP_S = 1e-6
# No aircraft, and no spacecraft, flies so far from one sample to the next, m/s.
_FASTEST_MPS = 1e6

Converter = Callable[[dict[str, FloatArray]], dict[str, FloatArray]]


VELOCITIES = (("vx", "vy", "vz"), ("trk", "gs", "vs"))


@dataclass(frozen=True)
class ColumnSpec:
    """A quantity: the names its column may have, earlier ones first, and its unit by default."""

    names: tuple[str, ...]
    unit: str = ""
    required: bool = False

    @property
    def units(self) -> Mapping[str, float]:
        """What the units are worth that its column may have: those of the kind of its own."""
        return next(kind for kind in UNIT_KINDS if self.unit in kind)


def indices_of(columns: Mapping[str, ColumnSpec], names: Sequence[str]) -> dict[str, int]:
    """Return in which column of a file each quantity stands that is there."""
    name_of = {q: next((n for n in spec.names if n in names), None) for q, spec in columns.items()}
    return {quantity: names.index(name) for quantity, name in name_of.items() if name is not None}


def complete_velocity(there: Collection[str]) -> tuple[str, ...]:
    """Return the quantities of the first velocity that is complete: half of one is no use."""
    return next((parts for parts in VELOCITIES if all(q in there for q in parts)), ())


@dataclass(frozen=True)
class SampleColumn:
    """A column that is read: its index in the row, its header and its factor to s, m, m/s, deg."""

    index: int
    header: str
    factor: float


@dataclass
class _Rows:
    """The samples of one aircraft as they come."""

    lines: list[int] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)


def unit_factor(
    problems: Problems, spec: ColumnSpec, token: str, *, line: int | None, header: str
) -> float:
    """Look up what a unit token is worth; an unknown one is noted and taken as 1."""
    known = spec.units
    plain = clean_token(token)
    if plain in known:
        return known[plain]
    what = (
        "has no unit"
        if plain in NO_UNIT
        else f"unit {shortened(token, MOST_OF_A_CELL)!r} is unknown here"
    )
    problems.add(f"{what}: it must be one of {', '.join(known)}", line=line, column=header)
    return 1.0


class SampleTable:
    """Collects samples row by row and turns them into trajectories.

    A bad cell of an `optional` quantity is no error: the aircraft goes without the whole column,
    and a note says so. `parse_time` reads a time cell where a plain number will not do.
    """

    def __init__(
        self,
        problems: Problems,
        headers: Sequence[str],
        name_column: int,
        columns: dict[str, SampleColumn],
        parse_time: Callable[[str], float] | None = None,
        optional: Collection[str] = (),
    ) -> None:
        self._optional = frozenset(optional)
        self._problems, self._name_column, self._columns = problems, name_column, columns
        self._parse_time = parse_time
        self._aircraft: dict[str, _Rows] = {}
        self.notes: list[str] = []
        self._width = len(headers)
        used = {name_column, *(column.index for column in columns.values())}
        if ignored := [header for i, header in enumerate(headers) if i not in used]:
            self.notes.append(f"columns ignored: {', '.join(ignored)}")

    def add_row(self, line: int, row: list[str] | int) -> None:
        """Add a sample, or note what is wrong; a row may be the number of its cells alone."""
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
        numbers = {
            quantity: _number_or_nan(column, row[column.index])
            if quantity in self._optional
            else self._number(line, quantity, column, row[column.index])
            for quantity, column in self._columns.items()
        }
        # An aircraft counts as named even if its row is bad: it is there, only not usable.
        rows = self._aircraft.setdefault(name, _Rows())
        if any(value is None for value in numbers.values()):
            return
        rows.lines.append(line)
        for quantity, value in numbers.items():
            rows.values.setdefault(quantity, []).append(value or 0.0)

    def finish(self, ownship: str | None, to_geodetic: Converter) -> TrafficFile:
        """Check each aircraft's samples and make the trajectories."""
        samples = self.samples(ownship)
        own = next(iter(samples))
        start = min(float(columns["time"][0]) for columns in samples.values())
        made = {}
        for name, columns in samples.items():
            columns["time"] = elapsed_times(columns["time"], start)
            geodetic = to_geodetic(columns)
            made[name] = self._trajectory(name, geodetic)
            if (speed_mps := made[name].max_speed_mps) > _FASTEST_MPS:
                self._problems.add(
                    f"{name} flies at up to {speed_mps:.3g} m/s from one sample to the next: at "
                    f"most {_FASTEST_MPS:g} m/s can be meant"
                )
        self._problems.raise_if_any()
        intruders = [trajectory for name, trajectory in made.items() if name != own]
        return TrafficFile(made[own], intruders, start, self.notes)

    def samples(self, ownship: str | None) -> dict[str, dict[str, FloatArray]]:
        """Check each aircraft's samples and return them as columns, in the order of time."""
        names = list(self._aircraft)
        if not names:
            self._problems.fail("there are no samples: at least two aircraft are needed")
        if len(names) == 1:
            self._problems.add(
                f"there is one aircraft only, {shortened(names[0])!r}: an ownship and at least "
                "one intruder are needed"
            )
        own = names[0] if ownship is None else ownship
        if own not in self._aircraft:
            self._problems.add(
                f"there is no aircraft {own!r}: it must be one of "
                f"{', '.join(shortened(name) for name in names[:MOST_PROBLEMS])}"
                f"{', …' if len(names) > MOST_PROBLEMS else ''}"
            )
        samples = {name: self._sorted(name, rows) for name, rows in self._aircraft.items()}
        self._refuse_long_silence()
        self._problems.raise_if_any()
        return {own: samples.pop(own), **samples}

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
            shown = shortened(cell, MOST_OF_A_CELL)
            hint = "; use a decimal point" if cell.replace(",", ".", 1) != cell else ""
            what = f"{shown!r} is not a number" if cell else "the cell is empty"
            self._problems.add(
                f"{what}: a finite number is needed{hint}", line=line, column=column.header
            )
            return None
        if not math.isfinite(value):
            self._problems.add(
                f"{shortened(cell, MOST_OF_A_CELL)!r} is not finite: a finite number is needed",
                line=line,
                column=column.header,
            )
            return None
        low, high, allowed = _LIMITS.get(quantity, (-1e12, 1e12, "lie within ±1e12"))
        if not low <= value <= high:
            self._problems.add(
                f"{shortened(cell, MOST_OF_A_CELL)} is out of range: it must {allowed}",
                line=line,
                column=column.header,
            )
            return None
        return value

    def _sorted(self, name: str, rows: _Rows) -> dict[str, FloatArray]:
        """Put an aircraft's samples in the order of time; two at one time are a problem."""
        columns = {key: np.array(values) for key, values in rows.values.items()}
        for key in sorted(self._optional & columns.keys()):
            if missing := int(np.count_nonzero(np.isnan(columns[key]))):
                header = self._columns[key].header
                self.notes.append(
                    f"{name}: column {header} has no number in {missing} of its "
                    f"{len(columns[key])} samples and is ignored"
                )
                del columns[key]
        if not columns:
            # All its rows were bad, which has been noted row by row.
            return columns
        times = columns["time"]
        order = np.argsort(times, kind="stable")
        if np.any(order[1:] < order[:-1]):
            self.notes.append(f"{name}: rows were not in the order of time and have been sorted")
        header = self._columns["time"].header
        gaps = np.diff(times[order])
        for i in np.flatnonzero(gaps < _SHORTEST_STEP_S):
            first, second = rows.lines[order[i]], rows.lines[order[i + 1]]
            what = f"{name} already has a sample at {times[order[i]]:.15g} s, in line {first}: "
            if gaps[i] == 0.0:
                what += "an aircraft may have only one at a time"
            else:
                what += f"the next one must be at least {_SHORTEST_STEP_S:g} s later"
            self._problems.add(what, line=second, column=header)
        return {key: values[order] for key, values in columns.items()}

    def _refuse_long_silence(self) -> None:
        """Note times after which the whole file falls silent for more than a day."""
        seen = [
            (time_s, line)
            for rows in self._aircraft.values()
            for time_s, line in zip(rows.values.get("time", ()), rows.lines, strict=True)
        ]
        if not seen:
            return
        seen.sort()
        times = np.array([time_s for time_s, _ in seen])
        for i in np.flatnonzero(np.diff(times) > _LONGEST_SILENCE_S):
            (before_s, line_before), (after_s, line) = seen[i], seen[i + 1]
            self._problems.add(
                f"the time is {after_s:.15g} s, and the one before it, in line {line_before}, is "
                f"{before_s:.15g} s: the file may not be without a sample for more than "
                f"{_LONGEST_SILENCE_S:g} s",
                line=line,
                column=self._columns["time"].header,
            )

    def _trajectory(self, name: str, columns: dict[str, FloatArray]) -> SampledTrajectory:
        velocity = None
        if {"ve", "vn", "vu"} <= columns.keys():
            velocity = (columns["ve"], columns["vn"], columns["vu"])
        angles: dict[str, Any] = {
            f"{key}_rad": np.radians(columns[key])
            for key in ("yaw", "pitch", "roll")
            if key in columns
        }
        trajectory = SampledTrajectory(
            name,
            columns["time"],
            columns["lat"],
            columns["lon"],
            columns["alt"],
            velocity_enu_mps=velocity,
            **angles,
        )
        if trajectory.velocity_was_ignored:
            self.notes.append(
                f"{name}: its velocities do not fit its positions (another unit, or airspeed?) "
                "and were ignored"
            )
        if len(columns["time"]) == 1:
            self.notes.append(f"{name}: has one sample only and is there at that instant only")
        else:
            gaps = np.diff(columns["time"])
            if gaps.max() > max(30.0, 10.0 * float(np.median(gaps))):
                at = float(columns["time"][int(np.argmax(gaps))])
                self.notes.append(
                    f"{name}: no sample for {gaps.max():.0f} s after {at:.1f} s; positions there "
                    "are interpolated"
                )
        return trajectory


def _number_or_nan(column: SampleColumn, cell: str) -> float:
    """Read a cell of an optional column; what is no finite number of sense is NaN."""
    try:
        value = math.nan if "_" in cell else float(cell) * column.factor
    except ValueError:
        return math.nan
    return value if abs(value) <= 1e12 else math.nan


def elapsed_times(time_s: FloatArray, start_s: float) -> FloatArray:
    """Subtract the start, and with it the rounding that a large clock reading carries.

    325374.3 - 325374.2 is 0.0999999999767 in doubles. The difference is rounded to the digits
    that the readings can hold (at most nanoseconds), so that a tenth of a second is the double
    0.1 and a scan at 0.1 s meets the sample itself.
    """
    elapsed = time_s - start_s
    resolution = float(np.spacing(max(abs(start_s), float(np.abs(time_s).max()))))
    decimals = min(9, math.floor(-math.log10(4.0 * resolution)))
    rounded = np.round(elapsed, decimals)
    return rounded if np.all(np.diff(rounded) > 0.0) else elapsed


def enu_velocity(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Give east, north, up velocity from vx vy vz or trk gs vs; nothing if neither is complete."""
    if {"vx", "vy", "vz"} <= columns.keys():
        return {"ve": columns["vx"], "vn": columns["vy"], "vu": columns["vz"]}
    if {"trk", "gs", "vs"} <= columns.keys():
        track = np.radians(columns["trk"])
        return {
            "ve": columns["gs"] * np.sin(track),
            "vn": columns["gs"] * np.cos(track),
            "vu": columns["vs"],
        }
    return {}
