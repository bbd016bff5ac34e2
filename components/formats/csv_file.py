"""Read aircraft from a CSV table with one header row, as ADS-B receivers and tools write them."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path

from components.formats.sample_table import (
    UNITS,
    SampleColumn,
    SampleTable,
    enu_velocity,
    unit_factor,
)
from components.formats.text_rows import (
    ALL_TOKENS,
    Problems,
    TrafficFile,
    TrafficFileError,
    clean_token,
    did_you_mean,
    read_lines,
    shown_columns,
)
from components.geometry.angles import FloatArray

__all__ = ["TrafficFile", "TrafficFileError", "read_csv"]

# Earlier names win where a file has several.
HEADERS = {
    "id": (
        "id",
        "name",
        "icao24",
        "icao",
        "callsign",
        "hex",
        "aircraft",
        "acid",
        "flight",
        "ident",
    ),
    "time": ("time", "timestamp", "t", "posixtime", "unixtime", "utc"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "long", "lng", "longitude"),
    "alt": ("alt", "altitude", "geoaltitude", "altgeom", "height", "baroaltitude", "altbaro"),
    "yaw": ("heading", "yaw", "trueheading"),
    "pitch": ("pitch",),
    "roll": ("roll", "bank"),
    "trk": ("track", "trk", "truetrack"),
    "gs": ("gs", "groundspeed", "velocity", "speed"),
    "vs": ("vs", "vertrate", "verticalrate", "verticalspeed", "climb", "climbrate"),
    "vx": ("vx",),
    "vy": ("vy",),
    "vz": ("vz",),
}
REQUIRED = ("time", "id", "lat", "lon", "alt")
DEFAULT_UNITS = {"time": "s", "alt": "m", "gs": "m/s", "vs": "m/s"} | dict.fromkeys(
    ("vx", "vy", "vz"), "m/s"
)


def read_csv(path: str | PathLike[str], ownship: str | None = None) -> TrafficFile:
    """Read a CSV file with columns for time, id, latitude, longitude and altitude.

    Parameters
    ----------
    path : path-like
        The file; separated by commas, semicolons, tabs or blanks; cells may be quoted.
    ownship : str, optional
        The ownship's id; left out, the first aircraft in the file.

    Returns
    -------
    TrafficFile
        Times count from the earliest sample.

    Raises
    ------
    TrafficFileError
        With all problems of the file (up to 20): line, column, value, what is allowed.

    Notes
    -----
    Header names are matched without regard to case, blanks and underscores, and may carry their
    unit: ``alt_ft``, ``Altitude (ft)``, ``time [ms]``. Without a unit: seconds, degrees, metres,
    m/s. Time is a number or ISO 8601 (UTC unless it says otherwise). Rows in which latitude,
    longitude and altitude are all empty (receivers that log velocity messages) are skipped.
    Heading, pitch and roll are used where given and derived from the path where not; altitude
    is taken as the height above the ellipsoid.
    """
    problems = Problems(str(path))
    lines = read_lines(Path(path), problems)
    header_line, header_text = lines[0]
    delimiter = next((d for d in (",", ";", "\t") if d in header_text), " ")
    headers = _split(header_text, delimiter)
    columns = _find_columns(problems, headers, header_line)
    identity = columns.pop("id").index
    table = SampleTable(problems, identity, columns, parse_time=_time_parser(columns["time"]))
    used = {identity, *(column.index for column in columns.values())}
    if ignored := [header for i, header in enumerate(headers) if i not in used]:
        table.notes.append(f"columns ignored: {', '.join(ignored)}")
    skipped = 0
    for number, text in lines[1:]:
        row = _split(text, delimiter)
        if len(row) != len(headers):
            problems.add(
                f"the row has {len(row)} values: the header names {len(headers)} columns",
                line=number,
            )
        elif any(row[columns[q].index] for q in ("lat", "lon", "alt")):
            table.add_row(number, row)
        else:
            skipped += 1
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
    found: dict[str, SampleColumn] = {}
    ours = {alias for aliases in HEADERS.values() for alias in aliases}
    shown = shown_columns(headers, not ours.isdisjoint(names))
    for quantity, aliases in HEADERS.items():
        index = next((names.index(alias) for alias in aliases if alias in names), None)
        if index is None:
            if quantity in REQUIRED:
                hint = did_you_mean(quantity, names).replace("did you mean", "is it")
                problems.add(
                    f"there is no column {quantity!r} among {shown}{hint}; accepted names are "
                    f" {', '.join(aliases)}",
                    line=line,
                )
            continue
        unit = parsed[index][1] or DEFAULT_UNITS.get(quantity, "deg")
        factor = 1.0
        if quantity in UNITS:
            factor = unit_factor(problems, quantity, unit, line=line, header=headers[index])
        found[quantity] = SampleColumn(index, headers[index], factor)
    problems.raise_if_any()
    # Velocity counts only when it is complete; half of one is no use.
    if not all(q in found for q in ("vx", "vy", "vz")):
        if "trk" not in found and "yaw" in found and "gs" in found and "vs" in found:
            # Receivers that log velocity call the track "heading".
            found["trk"] = found["yaw"]
        if not all(q in found for q in ("trk", "gs", "vs")):
            for quantity in ("trk", "gs", "vs"):
                found.pop(quantity, None)
        for quantity in ("vx", "vy", "vz"):
            found.pop(quantity, None)
    else:
        for quantity in ("trk", "gs", "vs"):
            found.pop(quantity, None)
    return found


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
        (
            quantity,
            ", ".join(names),
            DEFAULT_UNITS.get(quantity, "" if quantity == "id" else "deg"),
            "yes" if quantity in REQUIRED else "",
        )
        for quantity, names in HEADERS.items()
    ]
