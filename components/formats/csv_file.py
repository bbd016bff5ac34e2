"""Read aircraft from a CSV table with one header row, as ADS-B receivers and tools write them."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from itertools import chain
from os import PathLike
from pathlib import Path

import numpy as np

from components.formats.receiver_logs import read_log
from components.formats.sample_columns import (
    VELOCITIES,
    Altitude,
    ColumnSpec,
    SampleColumn,
    complete_velocity,
    enu_velocity,
    indices_of,
    unit_factor,
)
from components.formats.sample_table import SampleTable
from components.formats.text_rows import (
    ALL_TOKENS,
    Problems,
    TrafficFile,
    clean_token,
    did_you_mean,
    lines_of,
    read_content,
    shown_columns,
)
from dsa_des.arrays.types import FloatArray

_GEOMETRIC = ("geoaltitude", "altgeom", "geomaltitude", "geometricaltitude", "gnssaltitude")
_BAROMETRIC = ("baroaltitude", "altbaro", "barometricaltitude", "pressurealtitude")
_ANY_HEIGHT = ("alt", "altitude", "height")
_ALTITUDES = (*_ANY_HEIGHT[:2], *_GEOMETRIC, "height", *_BAROMETRIC)
_ORDER: Mapping[Altitude | None, tuple[str, ...]] = {
    None: _ALTITUDES,
    "geometric": (*_GEOMETRIC, *_ANY_HEIGHT),
    "barometric": (*_BAROMETRIC, *_ANY_HEIGHT),
}
_CLIMBS = (
    "vs", "vertrate", "verticalrate", "verticalspeed", "climb", "climbrate", "geomrate", "barorate",
)  # fmt: skip
# An address is one aircraft's, which a callsign need not be.
_ADDRESSES = ("icao24", "icao", "hex", "hexident", "icaoaddress", "address")
_IDENTITIES = (
    *_ADDRESSES, "id", "name", "callsign", "aircraft", "acid", "flight", "ident",
)  # fmt: skip
_TIMES = ("time", "timestamp", "t", "posixtime", "unixtime", "utc", "datetime", "timeposition")
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
    ("FlightRadar24", ({"timestamp", "utc", "callsign", "speed", "direction"},)),
    ("BaseStation", ({"hexident"},)),
)
#: Fewer different ones may be in steps of 25 by chance.
_FEW_HEIGHTS = 5
_OF_FAMILIES = {"alt": "ft", "alt instead": "ft", "gs": "kt", "vs": "ft/min"}
#: A clock that counts from 1970 is beyond these numbers in ns, µs and ms, and in s never.
_EPOCHS = ((1e17, "ns"), (1e14, "µs"), (1e11, "ms"))


def read_csv(
    path: str | PathLike[str], ownship: str | None = None, altitude: Altitude | None = None
) -> TrafficFile:
    """Read a CSV file with columns for time, id, latitude, longitude and altitude, or a log.

    Logs are those that `components.formats.receiver_logs` knows; either may be packed (gzip). A
    table is separated by commas, semicolons, tabs or blanks; cells may be quoted. Header names are
    matched without regard to case, blanks and underscores, and may carry their unit: ``alt_ft``,
    ``Altitude (ft)``, ``time [ms]``; without one they are in seconds, degrees, metres, m/s, but for
    tables with columns that only readsb, FlightRadar24 or BaseStation write, which are in feet,
    knots and feet per minute. Time is a number or ISO 8601 (UTC unless it says otherwise). Latitude
    and longitude may stand in one cell. Rows without a time or a position are left out; heading,
    pitch, roll and velocity are used for aircraft where they have no gaps. One name of several
    aircraft that no one could be is told apart (`components.formats.shared_names`). With
    `altitude` the column of that kind is read, else the one whose name comes first. The ownship is
    the first aircraft unless its id is given; all that is wrong is one `TrafficFileError`.
    """
    problems = Problems(str(path))
    data = read_content(Path(path), problems)
    return read_log(problems, data, ownship, altitude) or _read_table(
        problems, lines_of(data, problems, comments=True), ownship, altitude
    )


def _read_table(
    problems: Problems, lines: list[tuple[int, str]], ownship: str | None, altitude: Altitude | None
) -> TrafficFile:
    lines = lines[_header_among(lines) :]
    header_line, header_text = lines[0]
    header_text = header_text.lstrip("#").strip(" ")
    delimiter = next((d for d in (",", ";", "\t", "|") if d in header_text), " ")
    ((_, headers),) = _rows(problems, [(header_line, header_text)], delimiter)
    at, position = len(headers), _single_position(headers)
    if position is not None:
        headers[position : position + 1] = ["lat", "lon"]
    columns, notes = _find_columns(problems, headers, header_line, altitude)
    identity, time = columns.pop("id").index, columns["time"].index
    plain = [_name_and_unit(header)[0] for header in headers]
    date = next((plain.index(name) for name in _DATES if name in plain), None)
    body = [(number, text) for number, text in lines[1:] if not text.startswith("#")]
    rows = _rows(problems, body, delimiter)
    first = next(rows, None)
    if first is not None and len(first[1]) > time:
        columns["time"] = _epoch(columns["time"], first[1][time], headers[time], notes)
    table = SampleTable(
        problems, headers, identity, columns, _time_parser(columns["time"]),
        columns.keys() - _NEEDED, gaps=True, shared=plain[identity] not in _ADDRESSES,
        instead={"alt": "alt instead"} if "alt instead" in columns else {},
    )  # fmt: skip
    table.notes += notes
    for number, row in chain([] if first is None else [first], rows):
        if len(row) == at + 1 and not row[-1]:
            row.pop()  # a comma at the end
        if position is not None and len(row) == at:
            pair = re.split(r"[,;\s]+", row[position].strip("()[] "))
            row[position : position + 1] = pair if len(pair) == 2 else [row[position]] * 2
        if date is not None and len(row) == len(headers) and ":" in row[time]:
            row[time] = f"{row[date]} {row[time]}"
        table.add_row(number, row)
    file = table.finish(ownship, _with_velocity)
    height = columns["alt"].header
    if f"{height} in m" in "".join(notes) and _seem_feet(file):
        said = "all its numbers are multiples of 25, as feet are"
        file.warnings.append(
            f"{height} has no unit and is read in m, but {said}: {height}_ft would say so"
        )
    return file


def _seem_feet(file: TrafficFile) -> bool:
    """Tell whether altitudes come in steps of 25, as transponders report feet."""
    heights = np.unique(np.concatenate([craft.alt_m for craft in file.aircraft]))
    steps = not np.any(heights % 25.0)
    return steps and len(heights) >= _FEW_HEIGHTS and bool(np.any(heights % 100.0))


def _header_among(lines: list[tuple[int, str]]) -> int:
    """Return which line names the columns: the first, or the last comment before it that does."""
    first = next((k for k, (_, text) in enumerate(lines) if not text.startswith("#")), 0)
    if lines[first][1].lower().startswith("sep=") and first + 1 < len(lines):
        return first + 1
    known = {name for spec in COLUMNS.values() for name in spec.names}

    def count(text: str) -> int:
        return sum(_name_and_unit(w)[0] in known for w in re.split(r"[,;|\t]+", text.lstrip("# ")))

    if first and count(lines[first][1]) < 2 <= count(lines[first - 1][1]):
        return first - 1
    return first


def _with_velocity(samples: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {**samples, **enu_velocity(samples)}


def _rows(
    problems: Problems, lines: list[tuple[int, str]], delimiter: str
) -> Iterator[tuple[int, list[str]]]:
    """Return each row's cells and the line where it begins; a quoted cell may go over several."""
    if delimiter == " ":
        yield from ((number, text.split()) for number, text in lines)
        return
    reader = csv.reader((text + "\n" for _, text in lines), delimiter=delimiter)
    while True:
        begins = reader.line_num
        try:
            row = next(reader, None)
        except csv.Error:  # a cell of over 131,072 characters: no row of ours
            row = []
        if row is None:
            return
        yield lines[begins][0], [cell.strip() for cell in row]


def _single_position(headers: list[str]) -> int | None:
    """Return the column that holds latitude and longitude, where none holds one of them alone."""
    plain = [_name_and_unit(header)[0] for header in headers]
    if any(name in plain for name in COLUMNS["lat"].names):
        return None
    return next((plain.index(name) for name in _POSITIONS if name in plain), None)


def _find_columns(
    problems: Problems, headers: list[str], line: int, altitude: Altitude | None
) -> tuple[dict[str, SampleColumn], list[str]]:
    """Match the headers, with notes on them; a missing required column ends the reading."""
    parsed = [_name_and_unit(header) for header in headers]
    names = [name for name, _ in parsed]
    specs = _specs(names, altitude)
    columns: dict[str, SampleColumn] = {}
    indices = indices_of(specs, names)
    shown = shown_columns(headers, bool(indices))
    family = next((who for who, marks in _FAMILIES if any(m <= {*names} for m in marks)), None)
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
    if "trk" not in columns and not complete_velocity(columns) and "yaw" in columns:
        # Receivers that log velocity call the track "heading".
        columns["trk"] = columns["yaw"]
    kept = complete_velocity(columns)
    for quantity in {q for parts in VELOCITIES for q in parts} - set(kept):
        columns.pop(quantity, None)
    return columns, notes


def _specs(names: list[str], altitude: Altitude | None) -> Mapping[str, ColumnSpec]:
    """Return the columns that are looked for: with the altitude that is asked for, and another."""
    specs = COLUMNS | {"alt": ColumnSpec(_ORDER[altitude], "m", required=True)}
    there = [name for name in _ORDER[altitude] if name in names]
    if altitude is None and len(there) > 1:
        specs["alt instead"] = ColumnSpec(tuple(there[1:]), "m")
    return specs


def _name_and_unit(header: str) -> tuple[str, str | None]:
    """Split 'Altitude (ft)', 'alt_ft' or 'alt [ft]' into a plain name and a unit."""
    unit = None
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", header)
    if match:
        header, unit = match[1], match[2]
    else:
        base, _, suffix = header.rpartition("_")
        if base and clean_token(suffix) in ALL_TOKENS:
            header, unit = base, suffix
    return re.sub(r"[\s_\-.]", "", header).lower(), unit


def _epoch(column: SampleColumn, cell: str, header: str, notes: list[str]) -> SampleColumn:
    """Return the column of time in the unit that its first number must be in."""
    if _name_and_unit(header)[1] is not None or not re.fullmatch(r"\d{12,19}(\.\d*)?", cell):
        return column
    unit = next(unit for least, unit in _EPOCHS if float(cell) >= least)
    notes.append(f"{header} is taken in {unit}: its numbers are too large for seconds")
    return SampleColumn(column.index, column.header, COLUMNS["time"].units[unit])


def _time_parser(column: SampleColumn) -> Callable[[str], float]:
    """Make a function that reads a number in the column's unit, an ISO 8601 instant or a clock."""

    def parse(cell: str) -> float:
        try:
            if "_" in cell:
                raise ValueError(cell)
            return float(cell) * column.factor
        except ValueError:
            if clock := re.fullmatch(r"(\d{1,2}):(\d\d):(\d\d(?:\.\d*)?)Z?", cell):
                return 3600.0 * int(clock[1]) + 60.0 * int(clock[2]) + float(clock[3])
            if "-" not in cell[1:] and "/" not in cell:
                raise
            instant = datetime.fromisoformat(cell.replace("/", "-").removesuffix(" UTC"))
            if instant.tzinfo is None:
                instant = instant.replace(tzinfo=UTC)
            return instant.timestamp()

    return parse


def csv_columns() -> list[tuple[str, ...]]:
    """Return quantity, accepted names, unit by default, and whether it is needed."""
    return [
        (quantity, ", ".join(spec.names), spec.unit, "yes" if spec.required else "")
        for quantity, spec in COLUMNS.items()
    ]
