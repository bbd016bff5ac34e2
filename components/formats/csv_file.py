"""Read aircraft from a CSV table with one header row, as ADS-B receivers and tools write them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import chain

import numpy as np

from components.formats.recording import Recording
from components.formats.sample_columns import (
    VELOCITIES,
    Altitude,
    ColumnSpec,
    SampleColumn,
    column_indices,
    convert_to_enu_velocity,
    first_complete_velocity,
    is_missing,
    name_and_unit,
    resolve_epoch_unit,
    time_parser,
    unit_factor,
)
from components.formats.sample_table import SampleTable
from components.formats.text_rows import (
    Problems,
    did_you_mean,
    quoted_rows,
    shown_columns,
    strip_frame,
)

_GEOMETRIC = ("geoaltitude", "altgeom", "geomaltitude", "geometricaltitude", "gnssaltitude")
_BAROMETRIC = ("baroaltitude", "altbaro", "barometricaltitude", "pressurealtitude")
_ANY_HEIGHT = ("alt", "altitude", "height")
_SEA_LEVEL = ("altitudeabovesealevel", "altitudemsl", "altmsl")
_ALTITUDES = (*_SEA_LEVEL, *_ANY_HEIGHT[:2], *_GEOMETRIC, "height", *_BAROMETRIC)
_ORDER: Mapping[Altitude | None, tuple[str, ...]] = {
    None: _ALTITUDES,
    "geometric": (*_GEOMETRIC, *_SEA_LEVEL, *_ANY_HEIGHT),
    "barometric": (*_BAROMETRIC, *_ANY_HEIGHT),
}
_CLIMBS = (
    "vs", "vertrate", "verticalrate", "verticalspeed", "climb", "climbrate", "geomrate", "barorate",
    "vspeed", "vertspeed",
)  # fmt: skip
# An address is one aircraft's, which a callsign need not be.
_ADDRESSES = ("icao24", "icao", "hex", "hexident", "icaoaddress", "address")
_IDENTITIES = (
    *_ADDRESSES, "id", "name", "callsign", "aircraft", "acid", "flight", "ident", "flightid",
)  # fmt: skip
#: When positions were received: state vectors repeat one until the next comes.
_OF_POSITIONS = ("timeposition", "lastposupdate", "lastposition")
_CLOCKS = (
    "time", "timestamp", "t", "posixtime", "unixtime", "utc", "datetime", "eventtime", "snapshotid",
    "networktime",
)  # fmt: skip
_TIMES = (*_OF_POSITIONS, *_CLOCKS)
_DATES = ("date", "utcdate")
#: Latitude and longitude in one cell.
_POSITIONS = ("position", "latlon", "latlng")
COLUMNS = {
    "id": ColumnSpec(_IDENTITIES, required=True),
    "time": ColumnSpec(_TIMES, "s", required=True),
    "lat": ColumnSpec(("lat", "latitude"), "deg", required=True),
    "lon": ColumnSpec(("lon", "long", "lng", "longitude"), "deg", required=True),
    "alt": ColumnSpec(_ALTITUDES, "m", required=True),
    "yaw": ColumnSpec(("heading", "yaw", "trueheading"), "deg"),
    "pitch": ColumnSpec(("pitch",), "deg"),
    "roll": ColumnSpec(("roll", "bank"), "deg"),
    "trk": ColumnSpec(("track", "trk", "truetrack", "direction"), "deg"),
    "gs": ColumnSpec(("gs", "groundspeed", "velocity", "speed", "spd"), "m/s"),
    "vs": ColumnSpec(_CLIMBS, "m/s"),
    **{name: ColumnSpec((name,), "m/s") for name in VELOCITIES[0]},
}
_NEEDED = frozenset(quantity for quantity, spec in COLUMNS.items() if spec.required)
#: Whose tables have names that no one else has, and are in feet, knots and feet per minute.
_FAMILIES = (
    ("readsb", ({"altgeom"}, {"altbaro"}, {"geomrate"}, {"barorate"})),
    (
        "FlightRadar24",
        (
            {"timestamp", "utc", "callsign", "speed", "direction"},
            {"snapshotid", "radarid"},
            {"networktime", "receivertime"},
        ),
    ),
    ("BaseStation", ({"hexident"},)),
    # Of OpenSky's data, in Python.
    ("the library traffic", ({"icao24", "altitude", "groundspeed", "verticalrate"},)),
)
#: Which family writes 0 for the altitude of what is on the ground, however high that is.
_ZERO_ON_GROUND = "FlightRadar24"
#: Fewer different ones may be in steps of 25 by chance.
_FEW_HEIGHTS = 5
_OF_FAMILIES = {"alt": "ft", "alt instead": "ft", "gs": "kt", "vs": "ft/min"}


def recording_of_table(
    problems: Problems,
    lines: Iterator[tuple[int, str]],
    ownship: str | None = None,
    altitude: Altitude | None = None,
    stem: str | None = None,
) -> Recording:
    """Return a `Recording` of the aircraft in a table, at least two, or with ``stem`` at least one,
    which is called so if no column names it.

    A table is separated by commas, semicolons, tabs or blanks; cells may be quoted. Header names
    are matched without regard to case, blanks and underscores, and may carry their unit:
    ``alt_ft``, ``Altitude (ft)``, ``time [ms]``; without one they are in seconds, degrees, metres,
    m/s, but for tables with columns that only readsb, FlightRadar24 or BaseStation write, which are
    in feet, knots and feet per minute. Time is a number or ISO 8601 (UTC unless it says otherwise).
    Latitude and longitude may stand in one cell. Rows without a time or a position are left out;
    heading, pitch, roll and velocity are used for aircraft where they have no gaps. One name of
    several aircraft that no one could be is told apart
    (`components.formats.recording.rename_duplicates`). With `altitude` the column of that kind is
    read, else the one whose name comes first. The ownship is the first aircraft unless its id is
    given; all that is wrong is one `TrafficFileError`.
    """
    (header_line, header_text), body = _header_and_rows(problems, strip_frame(lines))
    header_text = header_text.lstrip("#").strip(" ")
    delimiter = next((d for d in (",", ";", "\t", "|") if d in header_text), " ")
    ((_, headers),) = quoted_rows(iter([(header_line, header_text)]), delimiter)
    rows = quoted_rows((one for one in body if not one[1].startswith("#")), delimiter)
    return recording_of_rows(problems, headers, header_line, rows, ownship, altitude, stem)


def recording_of_rows(
    problems: Problems,
    headers: list[str],
    header_line: int,
    rows: Iterator[tuple[int, list[str]]],
    ownship: str | None = None,
    altitude: Altitude | None = None,
    stem: str | None = None,
    kind: str = "a table",
) -> Recording:
    """Return a `Recording` of a table's aircraft, given as rows of cells with line numbers."""
    at, position = len(headers), _joint_position_index(headers)
    is_nameless = stem is not None and _KNOWN_NAMES.isdisjoint(
        name_and_unit(header)[0] for header in headers
    )
    if is_nameless:
        headers.append("id")
    if position is not None:
        headers[position : position + 1] = ["lat", "lon"]
    columns, notes = _find_columns(problems, headers, header_line, altitude)
    identity, time = columns.pop("id").index, columns["time"].index
    plain = [name_and_unit(header)[0] for header in headers]
    is_address, is_zero_ground = (
        plain[identity] in _ADDRESSES,
        _writer_of_columns(plain) == _ZERO_ON_GROUND,
    )
    high = columns["alt"].index
    date = next((plain.index(name) for name in _DATES if name in plain), None)
    # Where a position's own time is not known, that of its row must do.
    other = next((plain.index(name) for name in _CLOCKS if name in plain), time)
    ahead = _rows_until_first_time(rows, time, other)
    if ahead and (begins := _time_cell(ahead[-1][1], time, other)):
        columns["time"] = resolve_epoch_unit(columns["time"], begins, headers[time], notes)
    table = SampleTable(
        problems, headers, identity, columns, time_parser(columns["time"]),
        columns.keys() - _NEEDED, gaps=True, shared=not is_address,
        instead={"alt": "alt instead"} if "alt instead" in columns else {},
        least=2 if stem is None else 1, repeats=plain[time] in _OF_POSITIONS,
    )  # fmt: skip
    table.notes.harmless += notes
    nameless = 0
    rows = chain(ahead, rows)
    if plain[time] == _OF_MESSAGES:
        rows = _drop_rows_within_second(rows, identity, columns, table.notes.warnings)
    for number, row in rows:
        if len(row) == at + 1 and not row[-1]:
            row.pop()  # a comma at the end
        if position is not None and len(row) == at:
            pair = re.split(r"[,;\s]+", row[position].strip("()[] "))
            row[position : position + 1] = pair if len(pair) == 2 else [row[position]] * 2
        if date is not None and len(row) >= at and ":" in row[time]:
            row[time] = f"{row[date]} {row[time]}"
        if other != time and len(row) >= at and is_missing(row[time]):
            row[time] = row[other]
        if is_nameless and len(row) == len(headers) - 1:
            row.append(str(stem))
        if is_zero_ground and len(row) >= at and row[high] == "0":
            row[high] = ""
        if is_address and len(row) > identity:
            row[identity] = row[identity].removeprefix("0x")
        if stem is not None and len(row) > identity and not row[identity]:
            row[identity], nameless = stem, nameless + 1
        table.add_row(number, row)
    if nameless:
        table.notes.warnings.append(f"{nameless} rows have no {headers[identity]}: called {stem}")
    height = columns["alt"].header
    units = next((note.partition(": ")[0] for note in notes if f"{height} in " in note), "")
    recording = table.recording(
        ownship, convert_to_enu_velocity, kind=kind, units=units or "the units of its header"
    )
    if f"{height} in m" in units and _has_altitudes_in_feet_steps(recording):
        said = "all its numbers are multiples of 25, as feet are"
        recording.notes.warnings.append(
            f"{height} has no unit and is read in m, but {said}: {height}_ft would say so"
        )
    return recording


#: When a message came in, of whatever receiver: with its delay, and out of order.
_OF_MESSAGES = "networktime"


def _drop_rows_within_second(
    rows: Iterator[tuple[int, list[str]]], identity: int, columns: Mapping[str, SampleColumn],
    warnings: list[str],
) -> Iterator[tuple[int, list[str]]]:  # fmt: skip
    """Yield rows, but no position less than 1 s after the last kept one of the same aircraft."""
    time, lat, lon = (columns[key].index for key in ("time", "lat", "lon"))
    parse, last, left_out = time_parser(columns["time"]), dict[str, float](), 0
    for number, row in rows:
        if len(row) > max(time, lat, lon, identity) and (row[lat], row[lon]) != ("0", "0"):
            with suppress(ValueError):  # of another cell the table says what is wrong
                now_s = parse(row[time])
                if now_s - last.get(row[identity], -math.inf) < 1.0:
                    left_out += 1
                    continue
                last[row[identity]] = now_s
        yield number, row
    if left_out:
        said = "within a second of another: receivers' delays differ by as much"
        warnings.append(f"{left_out} positions were left out that came {said}")


#: How many rows may be without a time before the first that has one.
_MOST_AHEAD = 1000


def _rows_until_first_time(
    rows: Iterator[tuple[int, list[str]]], time: int, other: int
) -> list[tuple[int, list[str]]]:
    """Return the rows up to the first with a time, which can tell the unit of times."""
    ahead: list[tuple[int, list[str]]] = []
    for one in rows:
        ahead.append(one)
        if _time_cell(one[1], time, other) or len(ahead) > _MOST_AHEAD:
            break
    return ahead


def _time_cell(row: list[str], time: int, other: int) -> str:
    for index in (time, other):
        if len(row) > index and not is_missing(row[index]):
            return row[index]
    return ""


def _has_altitudes_in_feet_steps(recording: Recording) -> bool:
    """Return whether altitudes come in steps of 25, as transponders report feet."""
    heights = np.unique(np.concatenate([one["alt"] for one in recording.samples.values()]))
    steps = not np.any(heights % 25.0)
    return steps and len(heights) >= _FEW_HEIGHTS and bool(np.any(heights % 100.0))


_KNOWN_NAMES = frozenset(_IDENTITIES)
_KNOWN = {name for spec in COLUMNS.values() for name in spec.names}


def count_known_columns(headers: Iterable[str]) -> int:
    """Return how many different headers are names of columns that a table may have."""
    return len({name_and_unit(header)[0] for header in headers} & _KNOWN)


def _header_and_rows(
    problems: Problems, lines: Iterator[tuple[int, str]]
) -> tuple[tuple[int, str], Iterator[tuple[int, str]]]:
    """Return the line with the column names, and an iterator over the lines after it.

    It is the first that is no comment, or the comment before it where only that names columns.
    """

    def count(text: str) -> int:
        words = re.split(r"[,;|\t]+", text.lstrip("# "))
        return sum(name_and_unit(word)[0] in _KNOWN for word in words)

    comment: tuple[int, str] | None = None
    for one in lines:
        if one[1].startswith("#"):
            comment = one
        elif comment is not None and count(one[1]) < 2 <= count(comment[1]):
            return comment, chain([one], lines)
        elif not one[1].lower().startswith("sep="):
            return one, lines
    problems.fail("the file is empty: a row of column names and rows of samples are needed")


def _joint_position_index(headers: list[str]) -> int | None:
    """Return the index of a joint latitude-longitude column, or None if none or separate ones."""
    plain = [name_and_unit(header)[0] for header in headers]
    if any(name in plain for name in COLUMNS["lat"].names):
        return None
    return next((plain.index(name) for name in _POSITIONS if name in plain), None)


def _find_columns(
    problems: Problems, headers: list[str], line: int, altitude: Altitude | None
) -> tuple[dict[str, SampleColumn], list[str]]:
    """Return the columns by quantity, and notes; TrafficFileError if a required one is missing."""
    parsed = [name_and_unit(header) for header in headers]
    names = [name for name, _ in parsed]
    specs = _column_specs(names, altitude)
    columns: dict[str, SampleColumn] = {}
    indices = column_indices(specs, names)
    shown = shown_columns(headers, bool(indices))
    family = _writer_of_columns(names)
    notes, taken = [], []
    for quantity, spec in specs.items():
        if quantity not in indices:
            if spec.required:
                hint = did_you_mean(quantity, names).replace("did you mean", "is it")
                problems.add(
                    f"there is no column {quantity!r} among {shown}{hint}; accepted names are "
                    f" {', '.join(spec.names)}",
                    line=line,
                )
            continue
        index = indices[quantity]
        factor = 1.0
        if spec.unit:
            own = _OF_FAMILIES.get(quantity) if family else None
            unit = parsed[index][1] or own or spec.unit
            if parsed[index][1] is None and quantity in _OF_FAMILIES:
                taken.append(f"{headers[index]} in {unit}")
            factor = unit_factor(problems, spec, unit, line=line, header=headers[index])
        columns[quantity] = SampleColumn(index, headers[index], factor)
    problems.raise_if_any()
    if taken:
        why = f"as {family} writes it" if family else "no unit is given"
        notes.append(f"{', '.join(taken)}: {why}")
    if "trk" not in columns and not first_complete_velocity(columns) and "yaw" in columns:
        # Receivers that log velocity call the track "heading".
        columns["trk"] = columns["yaw"]
    kept = first_complete_velocity(columns)
    for quantity in {q for parts in VELOCITIES for q in parts} - set(kept):
        columns.pop(quantity, None)
    return columns, notes


def _writer_of_columns(names: Collection[str]) -> str | None:
    return next((who for who, marks in _FAMILIES if any(m <= {*names} for m in marks)), None)


def _column_specs(names: list[str], altitude: Altitude | None) -> Mapping[str, ColumnSpec]:
    """Return columns to look for, with the given altitude kind, or else with a second if any."""
    specs = COLUMNS | {"alt": ColumnSpec(_ORDER[altitude], "m", required=True)}
    there = [name for name in _ORDER[altitude] if name in names]
    if altitude is None and len(there) > 1:
        specs["alt instead"] = ColumnSpec(tuple(there[1:]), "m")
    return specs


def csv_column_descriptions() -> list[tuple[str, ...]]:
    """Return of each column, as text: quantity, accepted names, default unit, if it is needed."""
    return [
        (quantity, ", ".join(spec.names), spec.unit, "yes" if spec.required else "")
        for quantity, spec in COLUMNS.items()
    ]
