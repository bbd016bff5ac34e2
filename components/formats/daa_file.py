"""Read DAIDALUS `.daa` and `.xyz` encounter files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import chain
from operator import add, mul
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from components.formats.recording import Recording
from components.formats.sample_columns import (
    ColumnSpec,
    SampleColumn,
    column_indices,
    convert_to_enu_velocity,
    first_complete_velocity,
    unit_factor,
)
from components.formats.sample_table import SampleTable
from components.formats.text_rows import (
    ALL_TOKENS,
    Problems,
    TrafficFile,
    clean_token,
    did_you_mean,
    iterate_lines,
    read_content,
    shown_columns,
    split_cells,
    text_of,
    tokens,
)
from components.geometry import Vector, east_north_up_axes, enu_to_geodetic
from dsa_des.arrays.types import FloatArray

# Units are what DAIDALUS itself assumes where a file has no row of units.
COLUMNS = {
    "name": ColumnSpec(("name", "id", "aircraft", "acid", "callsign", "ident")),
    "time": ColumnSpec(("time", "t", "clock"), "s"),
    "lat": ColumnSpec(("lat", "latitude"), "deg"),
    "lon": ColumnSpec(("lon", "long", "longitude", "lng"), "deg"),
    "alt": ColumnSpec(("alt", "altitude"), "ft"),
    "sx": ColumnSpec(("sx", "x"), "nmi"),
    "sy": ColumnSpec(("sy", "y"), "nmi"),
    "sz": ColumnSpec(("sz", "z"), "ft"),
    "trk": ColumnSpec(("trk", "track"), "deg"),
    "gs": ColumnSpec(("gs", "groundspeed", "ground_speed"), "knot"),
    "vs": ColumnSpec(("vs", "verticalspeed", "vertical_speed"), "fpm"),
    "vx": ColumnSpec(("vx",), "knot"),
    "vy": ColumnSpec(("vy",), "knot"),
    "vz": ColumnSpec(("vz",), "fpm"),
}
# Where the nose points, which the track does not say in wind; and what alerting reads besides:
# which alerter an intruder belongs to, and standard deviations; those of "en" are signed square
# roots of the covariances of east and north.
EXTRA_COLUMNS = {
    "yaw": ColumnSpec(("heading", "hdg", "true_heading", "trueheading", "yaw"), "deg"),
    "airspeed": ColumnSpec(("airspeed", "air_speed", "tas", "true_airspeed"), "knot"),
    "alerter": ColumnSpec(("alerter",)),
    **{
        name: ColumnSpec((name,), unit)
        for kind, unit in (("s", "m"), ("v", "m/s"))
        for name in (*(f"{kind}_{axes}_std" for axes in ("ew", "ns", "en")), f"{kind}z_std")
    },
}
#: What such a file is called.
DAIDALUS = "a file of DAIDALUS"
# Extras that are no error where they cannot be read: files in the wild hold gaps there.
_OPTIONAL = frozenset({"yaw", "airspeed"})


def read_daa(
    path: str | PathLike[str],
    reference_lat_deg: float = 0.0,
    reference_lon_deg: float = 0.0,
    reference_alt_m: float = 0.0,
) -> TrafficFile:
    """Read a `.daa` or `.xyz` file: one row of names, one of units, then samples.

    Which of the two kinds it is shows in its columns, not in its name. The reference point (deg, m)
    is where the origin of an `.xyz` file is put: its sx and sy are east and north in the tangent
    plane there, its sz is the altitude above it, so that aircraft at one sz are level however far
    apart. Columns may come in any order; only name, time and position are required. Velocity is
    taken from `vx vy vz` (east, north, up) or `trk gs vs` where all three are there. A column
    `heading` is where the nose points, from true north; an aircraft whose column has gaps, or a
    column that is in no unit of angle, is read without it. Without a row of units those of
    DAIDALUS are taken, which the notes say. The first aircraft named is the ownship; all that is
    wrong is one `TrafficFileError`.
    """
    problems = Problems(str(path))
    text = text_of(read_content(Path(path), problems), problems)
    reference = (reference_lat_deg, reference_lon_deg, reference_alt_m)
    return recording_of_daa(problems, iterate_lines(text), reference).flights()


def recording_of_daa(
    problems: Problems, lines: Iterator[tuple[int, str]], reference: tuple[float, float, float]
) -> Recording:
    """Return a `Recording` of the aircraft in a `.daa` or `.xyz` file."""
    table, columns = _table(problems, lines, ("yaw",))
    notes = table.notes.harmless
    if "sx" in columns:
        notes.append(
            f"positions are offsets from a reference point, put at latitude {reference[0]:g}, "
            f"longitude {reference[1]:g}, altitude {reference[2]:g} m"
        )
    assumed = next((note for note in notes if note.startswith("there is no row of units")), "")
    return table.recording(
        None, lambda samples: _to_geodetic(samples, reference), kind=DAIDALUS,
        units=assumed or "those of its row of units",
        height=columns["sz" if "sx" in columns else "alt"].header,
    )  # fmt: skip


def read_daa_samples(
    path: str | PathLike[str], extra: Sequence[str] = ()
) -> dict[str, dict[str, FloatArray]]:
    """Return the samples of a `.daa` or `.xyz` file by aircraft, in its order.

    They are time (s), lat, lon (deg) and alt or sx, sy, sz (m), ve, vn, vu (m/s) where there are
    velocities, and `extra` of its columns.
    """
    problems = Problems(str(path))
    text = text_of(read_content(Path(path), problems), problems)
    table, _ = _table(problems, iterate_lines(text), extra)
    return {name: convert_to_enu_velocity(samples) for name, samples in table.samples(None).items()}


def _table(
    problems: Problems, lines: Iterator[tuple[int, str]], extra: Sequence[str]
) -> tuple[SampleTable, dict[str, SampleColumn]]:
    """Read a file's rows into a table of samples, not checked yet against each other."""
    lines = (one for one in lines if not one[1].lstrip().startswith("#"))
    header_line, header_text = next(lines, (0, ""))
    if not header_line:
        problems.fail("the file is empty: a row of column names and rows of samples are needed")
    headers = tokens(header_text)
    indices = _find_columns(problems, headers, header_line, extra)
    notes: list[str] = []
    units, body = _units_and_sample_rows(problems, headers, indices, lines, notes)
    columns = {}
    for quantity in [*_quantities_to_read(indices), *(q for q in extra if q in indices)]:
        index = indices[quantity]
        line, token = units[quantity]
        if (
            quantity in _OPTIONAL
            and clean_token(token) not in EXTRA_COLUMNS[quantity].factors_by_unit
        ):
            notes.append(f"column {headers[index]} is in {token}, no unit of angle, and is ignored")
            continue
        spec = (COLUMNS | EXTRA_COLUMNS)[quantity]
        factor = unit_factor(problems, spec, token, line=line, header=headers[index])
        columns[quantity] = SampleColumn(index, headers[index], factor)
    table = SampleTable(problems, headers, indices["name"], columns, optional=_OPTIONAL)
    table.notes.harmless[:0] = notes
    for number, text in body:
        table.add_row(number, split_cells(text, len(headers), indices["name"]))
    return table, columns


def _find_columns(
    problems: Problems, headers: list[str], line: int, extra: Sequence[str]
) -> dict[str, int]:
    """Return each quantity's column index; TrafficFileError if a required one is missing."""
    plain = [header.lower() for header in headers]
    indices = column_indices({**COLUMNS, **{q: EXTRA_COLUMNS[q] for q in extra}}, plain)
    offsets = any(q in indices for q in ("sx", "sy", "sz")) and "lat" not in indices
    required = ("name", "time", *(("sx", "sy", "sz") if offsets else ("lat", "lon", "alt")))
    unused = [h for i, h in enumerate(plain) if i not in indices.values()]
    for quantity in required:
        if quantity not in indices:
            hint = did_you_mean(quantity, unused).replace("did you mean", "is it")
            problems.add(
                f"there is no column {quantity!r} among {shown_columns(headers, bool(indices))}"
                f"{hint}",
                line=line,
            )
    problems.raise_if_any()
    for quantity in ("lat", "lon", "alt") if offsets else ("sx", "sy", "sz"):
        indices.pop(quantity, None)
    return indices


def _quantities_to_read(indices: dict[str, int]) -> list[str]:
    """List the quantities to read: time, position and one complete velocity."""
    wanted: list[str] = [q for q in ("time", "lat", "lon", "alt", "sx", "sy", "sz") if q in indices]
    return [*wanted, *first_complete_velocity(indices)]


def _units_and_sample_rows(
    problems: Problems,
    headers: list[str],
    indices: dict[str, int],
    lines: Iterator[tuple[int, str]],
    notes: list[str],
) -> tuple[dict[str, tuple[int | None, str]], Iterator[tuple[int, str]]]:
    """Return quantities' units as (line, token), from the units' row or default, and other rows."""
    assumed = {q: spec.unit for q, spec in (COLUMNS | EXTRA_COLUMNS).items() if q != "name"}
    defaults: dict[str, tuple[int | None, str]] = {q: (None, u) for q, u in assumed.items()}
    line, text = next(lines, (0, ""))
    if not line:
        problems.fail("there are no samples after the row of column names")
    row = tokens(text)
    bracketed = "[" in text
    known = sum(clean_token(token) in ALL_TOKENS for token in row)
    if not bracketed and known < max(2, len(row) // 2):
        used = [f"{headers[indices[q]]} [{u}]" for q, u in assumed.items() if q in indices]
        notes.append(f"there is no row of units; assumed {', '.join(used)}")
        return defaults, chain([(line, text)], lines)
    if len(row) != len(headers):
        problems.fail(
            f"the row of units has {len(row)} entries: the header names {len(headers)} columns",
            line=line,
        )
    units: dict[str, tuple[int | None, str]] = {
        q: (line, row[indices[q]]) for q in indices if q != "name"
    }
    return units, lines


def _to_geodetic(
    samples: dict[str, FloatArray], reference: tuple[float, float, float]
) -> dict[str, FloatArray]:
    """Return an aircraft's columns with geodetic positions, and velocity, heading by local axes."""
    samples = convert_to_enu_velocity(samples)
    if "sx" not in samples:
        return samples
    lat, lon, _ = enu_to_geodetic(
        samples["sx"],
        samples["sy"],
        samples["sz"],
        reference_lat_deg=reference[0],
        reference_lon_deg=reference[1],
        reference_alt_m=reference[2],
    )
    # The file's axes are the reference point's; the aircraft's own have turned a little.
    origin = east_north_up_axes(np.array([reference[0]]), np.array([reference[1]]))
    here = east_north_up_axes(lat, lon)
    velocity = {}
    if "ve" in samples:
        along = [samples[key] for key in ("ve", "vn", "vu")]
        velocity = dict(zip(("ve", "vn", "vu"), _rotate_to_axes(along, origin, here), strict=True))
    attitude = {}
    if "yaw" in samples:
        # A heading counts from the reference point's north as well.
        nose = np.radians(samples["yaw"])
        east, north, _ = _rotate_to_axes([np.sin(nose), np.cos(nose)], origin, here)
        attitude = {"yaw": np.degrees(np.arctan2(east, north))}
    # What the file calls height is an altitude: aircraft at one sz are level, however far apart.
    alt = samples["sz"] + reference[2]
    return {"time": samples["time"], "lat": lat, "lon": lon, "alt": alt, **velocity, **attitude}


def _rotate_to_axes(
    parts: Sequence[FloatArray], origin: Sequence[Vector], axes: Sequence[Vector]
) -> Any:
    """Return a vector of east, north (and up) at an origin by the axes of other positions."""
    by_axis = zip(*origin[: len(parts)], strict=True)
    xyz = [reduce(add, map(mul, parts, of_all)) for of_all in by_axis]
    return [reduce(add, map(mul, xyz, axis)) for axis in axes]


def daa_column_descriptions() -> list[tuple[str, ...]]:
    """Return of each column, as text: quantity, accepted names, default unit."""
    return [
        (quantity, ", ".join(spec.names), spec.unit)
        for quantity, spec in (*COLUMNS.items(), ("yaw", EXTRA_COLUMNS["yaw"]))
    ]
