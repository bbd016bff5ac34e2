"""Read aircraft from a CSV table with one header row, as ADS-B receivers and tools write them."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path

from components.formats.sample_table import (
    VELOCITIES,
    ColumnSpec,
    SampleColumn,
    SampleTable,
    complete_velocity,
    enu_velocity,
    indices_of,
    unit_factor,
)
from components.formats.text_rows import (
    ALL_TOKENS,
    Problems,
    TrafficFile,
    clean_token,
    did_you_mean,
    read_lines,
    shown_columns,
)
from dsa_des.arrays.types import FloatArray

_ALTITUDES = ("alt", "altitude", "geoaltitude", "altgeom", "height", "baroaltitude", "altbaro")
_CLIMBS = ("vs", "vertrate", "verticalrate", "verticalspeed", "climb", "climbrate")
_IDENTITIES = (
    "id", "name", "icao24", "icao", "callsign", "hex", "aircraft", "acid", "flight", "ident",
)  # fmt: skip
_TIMES = ("time", "timestamp", "t", "posixtime", "unixtime", "utc")
COLUMNS = {
    "id": ColumnSpec(_IDENTITIES, required=True),
    "time": ColumnSpec(_TIMES, "s", required=True),
    "lat": ColumnSpec(("lat", "latitude"), "deg", required=True),
    "lon": ColumnSpec(("lon", "long", "lng", "longitude"), "deg", required=True),
    "alt": ColumnSpec(_ALTITUDES, "m", required=True),
    "yaw": ColumnSpec(("heading", "yaw", "trueheading"), "deg"),
    "pitch": ColumnSpec(("pitch",), "deg"),
    "roll": ColumnSpec(("roll", "bank"), "deg"),
    "trk": ColumnSpec(("track", "trk", "truetrack"), "deg"),
    "gs": ColumnSpec(("gs", "groundspeed", "velocity", "speed"), "m/s"),
    "vs": ColumnSpec(_CLIMBS, "m/s"),
    **{name: ColumnSpec((name,), "m/s") for name in VELOCITIES[0]},
}


def read_csv(path: str | PathLike[str], ownship: str | None = None) -> TrafficFile:
    """Read a CSV file with columns for time, id, latitude, longitude and altitude.

    It is separated by commas, semicolons, tabs or blanks; cells may be quoted. Header names are
    matched without regard to case, blanks and underscores, and may carry their unit: ``alt_ft``,
    ``Altitude (ft)``, ``time [ms]``; without one they are in seconds, degrees, metres, m/s. Time is
    a number or ISO 8601 (UTC unless it says otherwise). Rows in which latitude, longitude and
    altitude are all empty (receivers that log velocity messages) are skipped. Heading, pitch and
    roll are used where given. The ownship is the first aircraft unless its id is given; all that is
    wrong is one `TrafficFileError`.
    """
    problems = Problems(str(path))
    lines = read_lines(Path(path), problems)
    header_line, header_text = lines[0]
    delimiter = next((d for d in (",", ";", "\t") if d in header_text), " ")
    headers = _split(header_text, delimiter)
    columns = _find_columns(problems, headers, header_line)
    identity = columns.pop("id").index
    parse_time = _time_parser(columns["time"])
    table = SampleTable(problems, headers, identity, columns, parse_time=parse_time)
    skipped = 0
    for number, text in lines[1:]:
        row = _split(text, delimiter)
        fits = len(row) == len(headers)
        if fits and not any(row[columns[q].index] for q in ("lat", "lon", "alt")):
            skipped += 1
        else:
            table.add_row(number, row)
    if skipped:
        table.notes.append(f"{skipped} rows without a position were skipped")
    return table.finish(ownship, _with_velocity)


def _with_velocity(samples: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {**samples, **enu_velocity(samples)}


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error:  # a cell of over 131,072 characters: no row of ours
        return []


def _find_columns(problems: Problems, headers: list[str], line: int) -> dict[str, SampleColumn]:
    """Match the headers; a missing required column ends the reading."""
    parsed = [_name_and_unit(header) for header in headers]
    names = [name for name, _ in parsed]
    columns: dict[str, SampleColumn] = {}
    indices = indices_of(COLUMNS, names)
    shown = shown_columns(headers, bool(indices))
    for quantity, spec in COLUMNS.items():
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
            unit = parsed[index][1] or spec.unit
            factor = unit_factor(problems, spec, unit, line=line, header=headers[index])
        columns[quantity] = SampleColumn(index, headers[index], factor)
    problems.raise_if_any()
    if "trk" not in columns and not complete_velocity(columns) and "yaw" in columns:
        # Receivers that log velocity call the track "heading".
        columns["trk"] = columns["yaw"]
    kept = complete_velocity(columns)
    for quantity in {q for parts in VELOCITIES for q in parts} - set(kept):
        columns.pop(quantity, None)
    return columns


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


def _time_parser(column: SampleColumn) -> Callable[[str], float]:
    """Make a function that reads a number in the column's unit, or an ISO 8601 instant."""

    def parse(cell: str) -> float:
        try:
            if "_" in cell:
                raise ValueError(cell)
            return float(cell) * column.factor
        except ValueError:
            if "-" not in cell[1:]:
                raise
            instant = datetime.fromisoformat(cell)
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
