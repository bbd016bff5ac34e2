"""Measured detections in Parquet or CSV: read strictly, all that is wrong said at once.

A row is a detection, or a look that saw nothing where its angles are empty. Rows of one instant are
one look. Columns have the names of a run's ``detections.parquet``; those not named here are left.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from components.formats.text_rows import Problems, csv_table, did_you_mean, shown_columns
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.files.input_files import InputFileError, is_folder, read_input_bytes, read_input_text
from dsa_des.text.safe_text import shorten

_NEEDED = ("time_s", "azimuth_rad", "elevation_rad")
_QUARTER, _TURN = math.pi / 2, 2 * math.pi
_TINY = np.finfo(float).tiny
_ANY = (-1e12, 1e12)
_OWN = {
    "own_lat_deg": (-90.0, 90.0), "own_lon_deg": (-1080.0, 1080.0), "own_alt_m": (-1e4, 1e6),
    "own_heading_rad": (-_TURN, _TURN), "own_pitch_rad": (-_QUARTER, _QUARTER),
    "own_roll_rad": (-_TURN, _TURN),
}  # fmt: skip
#: Columns of numbers that are read, and within which limits their values must lie.
LIMITS: Mapping[str, tuple[float, float]] = {
    "time_s": (0.0, 1e12), "arrival_s": (0.0, 1e12), "scan": (0.0, 2.0**53),
    "azimuth_rad": (-_TURN, _TURN), "elevation_rad": (-_QUARTER, _QUARTER),
    "range_m": (_TINY, 1e12), "range_rate_m_s": (-1e6, 1e6),
    "azimuth_variance_rad2": (0.0, 1e3), "elevation_variance_rad2": (0.0, 1e3),
    "range_variance_m2": (0.0, 1e18), "range_rate_variance_m2_s2": (0.0, 1e12),
    "confidence": _ANY, "snr_db": _ANY, "detection_probability": (0.0, 1.0), "pixels": _ANY,
    "illuminated_s": (0.0, 1e12), "true_azimuth_rad": (-_TURN, _TURN),
    "true_elevation_rad": (-_QUARTER, _QUARTER), "true_range_m": (0.0, 1e12),
    "ned_azimuth_rad": (-_TURN, _TURN), "ned_elevation_rad": (-_QUARTER, _QUARTER),
    "own_velocity_north_m_s": (-1e6, 1e6), "own_velocity_east_m_s": (-1e6, 1e6),
    "own_velocity_down_m_s": (-1e6, 1e6), **_OWN,
}  # fmt: skip
_FLAGS = {"true": 1.0, "false": 0.0, "1": 1.0, "0": 0.0}


@dataclass(eq=False)
class Measurements:
    """A sensor's looks (scans) in order of time, and the detections of all, joined end to end.

    Entries ``offsets[i]:offsets[i + 1]`` belong to look i, NaN where a cell is empty; ``declared``
    and ``cued`` are 0 or 1. `looks` holds the ownship's pose and velocity, as far as the file says
    them, `target` the names of targets, and `where` the line or row of each entry, for messages;
    `notes` say what was left out.
    """

    time_s: FloatArray
    arrival_s: FloatArray
    scan: IntArray
    offsets: IntArray
    entries: dict[str, Any]
    looks: dict[str, FloatArray]
    target: tuple[str | None, ...]
    where: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(eq=False)
class _Table:
    path: Path
    problems: Problems
    numbers: dict[str, FloatArray] = field(default_factory=dict)
    texts: dict[str, list[str | None]] = field(default_factory=dict)
    line: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    word: str = "line"

    def add(self, row: int, column: str, what: str) -> None:
        """Add a problem of a cell."""
        if self.word == "line":
            self.problems.add(what, line=int(self.line[row]), column=column)
        else:
            self.problems.add(f"row {self.line[row]}, column {column}: {what}")

    def take(self, rows: IntArray) -> None:
        """Keep only the given rows of the table, in place."""
        self.numbers = {name: values[rows] for name, values in self.numbers.items()}
        self.texts = {n: [values[i] for i in rows.tolist()] for n, values in self.texts.items()}
        self.line = self.line[rows]


def read_measurements(
    path: Path,
    block: str | None = None,
    place: tuple[float, float, float] | None = None,
    asterix: bytes | None = None,
) -> Measurements:
    """Read a sensor's looks from a file; ValueError lists all that is wrong, by line or row.

    The file is ``.parquet`` or CSV; the folder of a run, whose ``scans.parquet`` then says empty
    looks and the ownship's pose; or ASTERIX (``.ast``), whose angles are from north and level.
    `block` says whose rows are read, where there are several, and `place` where a radar of ASTERIX
    is (degrees, m) that does not say it; `asterix` are its data blocks, of a file that holds more.
    """
    if path.suffix == ".ast" or asterix is not None:
        return _measurements_of_asterix(path, block, place, asterix)
    if not is_folder(path):
        table = _read_table(path, _NEEDED, block)
        _check_values(table)
        return _group_by_instant(table, None)
    scans = _read_table(path / "scans.parquet", ("time_s",), block)
    table = _read_table(path / "detections.parquet", _NEEDED, block)
    _check_values(scans)
    _check_values(table)
    return _group_by_instant(table, scans)


def _measurements_of_asterix(
    path: Path,
    radar: str | None,
    place: tuple[float, float, float] | None,
    asterix: bytes | None,
) -> Measurements:
    """Return one ASTERIX radar's plots as measurements of a level sensor facing north."""
    from components.formats.asterix_file import read_asterix_plots

    problems, plots = Problems(str(path)), read_asterix_plots(path, place, asterix)
    if radar is None and len(plots.radars) > 1:
        problems.fail(f"holds plots of {', '.join(plots.radars)}: the key block must name one")
    if radar is not None and radar not in plots.radars:
        problems.fail(f"there is no radar {radar!r}{did_you_mean(radar, plots.radars)}")
    mine = plots.scan_radar == (0 if radar is None else plots.radars.index(radar))
    number = np.cumsum(mine) - 1
    of = np.flatnonzero(mine[plots.scan])
    of = of[np.argsort(plots.scan[of], kind="stable")]
    notes = list(plots.notes)
    if np.isnan(plots.own_lat_deg[mine]).any():
        name = plots.radars[0] if radar is None else radar
        problems.fail(
            f"radar {name} does not say where it is (034, item 120): the keys radar_lat_deg, "
            "radar_lon_deg and radar_alt_m must"
        )
    flat = np.isnan(plots.elevation_rad[of])
    if flat.all():
        problems.fail(f"none of {len(of)} plots has a height: their elevations are not known")
    if flat.any():
        notes.append(f"{np.count_nonzero(flat)} of {len(of)} plots have no height and are left out")
        of = of[~flat]
    scan = number[plots.scan[of]]
    entries = {
        "azimuth_rad": plots.azimuth_rad[of], "elevation_rad": plots.elevation_rad[of],
        "range_m": plots.range_m[of], "range_rate_m_s": plots.range_rate_m_s[of],
    }  # fmt: skip
    time_s = plots.scan_s[mine]
    if (plots.time_s[of] != time_s[scan]).any():
        entries["illuminated_s"] = plots.time_s[of]
    position = (plots.own_lat_deg, plots.own_lon_deg, plots.own_alt_m)
    pose = [*(values[mine] for values in position), *np.zeros((3, len(time_s)))]
    # A plot may come before its scan is over: the look arrives with its last one.
    arrival_s = time_s.copy()
    np.maximum.at(arrival_s, scan, plots.time_s[of])
    return Measurements(
        time_s, arrival_s, np.arange(len(time_s)),
        np.searchsorted(scan, np.arange(len(time_s) + 1)).astype(np.int64), entries,
        dict(zip(_OWN, pose, strict=True)), (None,) * len(of),
        tuple(f"plot {k + 1}" for k in of.tolist()), tuple(notes),
    )  # fmt: skip


def _read_table(path: Path, needed: tuple[str, ...], block: str | None) -> _Table:
    table = _Table(path, Problems(str(path)))
    try:
        names = (
            _read_parquet_header(table) if path.suffix == ".parquet" else _read_csv_header(table)
        )
    except InputFileError as error:
        table.problems.fail(f"the file {error}")
    for name in needed:
        if name not in names:
            shown = shown_columns(names, not set(names).isdisjoint(LIMITS))
            hint = did_you_mean(name, names)
            table.problems.add(f"there is no column {name!r} among {shown}{hint}")
    table.problems.raise_if_any()
    _keep_rows_of_block(table, block)
    return table


def _read_csv_header(table: _Table) -> list[str]:
    def fail(what: str, line: int) -> Exception:
        table.problems.add(what, line=line)
        try:
            table.problems.raise_if_any()
        except ValueError as error:
            return error
        raise AssertionError

    names, rows = csv_table(read_input_text(table.path), fail)
    content = list(rows)
    table.line = np.array([line for line, _ in content], dtype=np.int64)
    for index, name in enumerate(names):
        cells = [row[index] for _, row in content]
        if name in ("block", "target"):
            table.texts[name] = [cell or None for cell in cells]
        elif name in LIMITS or name in ("declared", "cued"):
            values = np.full(len(cells), np.nan)
            for row, cell in enumerate(cells):
                if cell:
                    values[row] = _number(table, row, name, cell)
            table.numbers[name] = values
    return names


def _number(table: _Table, row: int, name: str, cell: str) -> float:
    try:
        value = _FLAGS[cell.lower()] if name not in LIMITS else float(cell)
        if math.isfinite(value) and "_" not in cell:
            return value
    except (ValueError, KeyError):
        pass
    needed = "a finite number" if name in LIMITS else "true or false"
    table.add(row, name, f"{shorten(cell, 24)!r}: {needed} is needed, or nothing")
    return math.nan


def _read_parquet_header(table: _Table) -> list[str]:
    content = read_input_bytes(table.path)
    import pyarrow as pa
    import pyarrow.parquet as pq

    table.word = "row"
    try:
        read = pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        table.problems.fail(f"is no Parquet file that can be read ({error})")
    table.line = np.arange(1, read.num_rows + 1)
    for name in read.column_names:
        column = read.column(name)
        if name in ("block", "target"):
            table.texts[name] = [None if one is None else str(one) for one in column.to_pylist()]
        elif name in LIMITS or name in ("declared", "cued"):
            try:
                whole = column.combine_chunks().cast(pa.float64())
            except pa.ArrowException:
                table.problems.add(f"column {name}: is of {column.type}: numbers are needed")
                continue
            values = whole.to_numpy(zero_copy_only=False)
            bad = ~np.isfinite(values) & ~np.asarray(whole.is_null())
            for row in np.flatnonzero(bad).tolist():
                table.add(row, name, f"{values[row]}: a finite number is needed, or nothing")
            table.numbers[name] = values
    return list(read.column_names)


def _keep_rows_of_block(table: _Table, block: str | None) -> None:
    """Keep one sensor's rows only, in place; an error if there are several and none is named."""
    if "block" not in table.texts:
        return
    known = dict.fromkeys(name for name in table.texts["block"] if name is not None)
    if block is None and len(known) > 1:
        table.problems.fail(
            f"holds detections of {', '.join(shorten(name) for name in known)}: the key block "
            "must name one"
        )
    if block is not None and block not in known and table.path.name != "detections.parquet":
        table.problems.fail(f"there are no rows of block {block!r}{did_you_mean(block, known)}")
    wanted = [block is None or name == block for name in table.texts["block"]]
    table.take(np.flatnonzero(wanted))


def _check_values(table: _Table) -> None:
    """Refuse bad values, decreasing times, lone angles; missing arrival times become the time."""
    numbers = table.numbers
    for name, values in numbers.items():
        low, high = LIMITS.get(name, (0.0, 1.0))
        for row in np.flatnonzero((values < low) | (values > high)).tolist():
            table.add(row, name, f"{values[row]:g}: it must lie in [{low:g}, {high:g}]")
    time_s = numbers["time_s"]
    for row in np.flatnonzero(np.isnan(time_s)).tolist():
        table.add(row, "time_s", "a finite number is needed")
    for row in (np.flatnonzero(np.diff(time_s) < 0.0) + 1).tolist():
        before = f"{time_s[row]:g} comes after {time_s[row - 1]:g}"
        table.add(row, "time_s", f"{before}: rows must be in the order of time")
    arrival_s = numbers.get("arrival_s")
    if arrival_s is not None:
        arrival_s = numbers["arrival_s"] = np.where(np.isnan(arrival_s), time_s, arrival_s)
        for row in np.flatnonzero(arrival_s < time_s).tolist():
            said = f"{arrival_s[row]:g} is before time_s {time_s[row]:g}"
            table.add(row, "arrival_s", said)
        differs = (np.diff(time_s) == 0.0) & (np.diff(arrival_s) != 0.0)
        for row in (np.flatnonzero(differs) + 1).tolist():
            said = (
                f"{arrival_s[row]:g}, but the row before, of the same look, {arrival_s[row - 1]:g}"
            )
            table.add(row, "arrival_s", said)
    if "azimuth_rad" in numbers:
        half = np.isnan(numbers["azimuth_rad"]) != np.isnan(numbers["elevation_rad"])
        for row in np.flatnonzero(half).tolist():
            table.add(row, "elevation_rad", "azimuth and elevation must both be there, or neither")
    own = [name for name in _OWN if name in numbers]
    if own and len(own) < len(_OWN):
        missing = ", ".join(name for name in _OWN if name not in numbers)
        table.problems.add(f"the ownship's pose lacks {missing}: all six are needed, or none")
    table.problems.raise_if_any()
    if len(time_s) == 0 and table.path.name != "detections.parquet":
        table.problems.fail("there are no rows")


def _group_by_instant(table: _Table, scans: _Table | None) -> Measurements:
    """Group the rows of each time into a look (scan); ``scans``, if given, has all looks' times."""
    of = table if scans is None else scans
    time_s, first = np.unique(of.numbers["time_s"], return_index=True)
    arrival_s = of.numbers.get("arrival_s", of.numbers["time_s"])[first]
    if scans is not None and "arrival_s" in table.numbers:  # detections alone may say it
        index = np.searchsorted(time_s, table.numbers["time_s"])
        arrival_s = arrival_s.copy()
        arrival_s[index] = table.numbers["arrival_s"]
    if "scan" in of.numbers:
        scan = np.nan_to_num(of.numbers["scan"][first]).astype(np.int64)
    else:
        scan = np.arange(len(time_s))
    table.take(np.flatnonzero(~np.isnan(table.numbers["azimuth_rad"])))
    when = table.numbers["time_s"]
    if scans is not None and not np.isin(when, time_s).all():
        table.problems.fail("has a detection at an instant that scans.parquet does not have")
    offsets = np.append(np.searchsorted(when, time_s), len(when)).astype(np.int64)
    return Measurements(
        time_s, arrival_s, scan, offsets,
        {n: v for n, v in table.numbers.items() if n not in ("time_s", "arrival_s", "scan")},
        {n: v[first] for n, v in of.numbers.items() if n.startswith("own_")},
        tuple(table.texts.get("target", [None] * len(when))),
        tuple(f"{table.word} {line}" for line in table.line.tolist()),
    )  # fmt: skip
