"""Public formats of tracks, one or more aircraft in a file.

- em-pairing-uncor-importancesampling, tables: ID, Time (s), lat, lon (deg), alt_MSL_ft and more.
- The same, paired tracks in text: NAME, east, north, alt (ft), trk (rad), gs, vs (ft/s), time (s)
  under a line of units, all rows of the ownship before those of the intruder.
- em-model-manned-bayes: time_s, x_ft, y_ft, z_ft; x is along the heading of time 0, which is north.
- DEGAS traj.mat: matrices of 7 rows: time (s), north, east, altitude (ft) and velocities, one for
  each aircraft.

Positions and times are all that is taken. MATLAB's own objects (``ScriptedEncounter``) are no
matrices and cannot be read outside of it.
"""

import io
import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from components.arguments.units import FOOT_M
from components.formats.encounter_set import NAMES
from components.formats.set_file import EncounterSetError
from components.formats.text_rows import csv_table
from components.geometry import line_of_sight_ned
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import did_you_mean
from dsa_des.files.input_files import InputFileError, read_input_bytes, read_input_text

_PAIRED = ("NAME", "time", "east", "north", "alt")
_GEODETIC = ("ID", "Time", "lat", "lon", "alt_MSL_ft")
_PLANE = ("time_s", "x_ft", "y_ft", "z_ft")
_ROWS = 7
#: Of MATLAB's elements, the one that is packed.
_COMPRESSED = 15
#: How files of HDF5 begin, those of MATLAB behind its own header of 512 bytes.
_HDF5 = b"\x89HDF\r\n\x1a\n"
#: Time (s), north, east and altitude (m) of one aircraft.
Track = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
#: Tracks of one file, where their origin is if that is known, and what was done to its rows.
Tracks = tuple[list[Track], tuple[float, float] | None, list[str]]


def _error_at_line(path: Path, message: str, line: int | None = None) -> EncounterSetError:
    where = f"{path}: " if line is None else f"{path}: line {line}: "
    return EncounterSetError(where + message)


def _header_and_rows(path: Path) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    try:
        return csv_table(read_input_text(path), partial(_error_at_line, path))
    except InputFileError as error:
        raise _error_at_line(path, str(error)) from None


def _numbers(path: Path, line: int, cells: Sequence[str]) -> list[float]:
    """Return a row's cells as finite numbers, time first; EncounterSetError if not, or time < 0."""
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise _error_at_line(path, "holds something else than numbers", line)
    if values[0] < 0.0:
        raise _error_at_line(path, f"time = {values[0]:g} is negative", line)
    return values


def is_track_file(path: Path) -> bool:
    """Return whether a file is a track file of these formats, also if it cannot be read."""
    if path.suffix.lower() == ".mat":
        return True
    try:
        names = {*re.split(r"[,;\s]+", read_input_text(path)[:4096].split("\n")[0])}
    except InputFileError:
        return True
    return any(len(names & {*wanted}) >= len(wanted) - 1 for wanted in (_PAIRED, _GEODETIC, _PLANE))


def _indices(path: Path, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    for name in wanted:
        if name not in names:
            raise _error_at_line(path, f"there is no column {name!r}{did_you_mean(name, names)}", 1)
    return [names.index(name) for name in wanted]


def read_track_csv(path: Path, at: tuple[float, float] | None = None) -> Tracks:
    """Read the tracks of a CSV table; one for each ``ID``, in order of their first rows."""
    names, rows = _header_and_rows(path)
    wanted = _PLANE if "time_s" in names else _GEODETIC
    indices = _indices(path, names, wanted)
    rows_of: dict[str, list[list[float]]] = {}
    for line, row in rows:
        name = row[indices[0]] if wanted is _GEODETIC else ""
        values = _numbers(path, line, [row[k] for k in indices[wanted is _GEODETIC :]])
        if wanted is _GEODETIC and not (abs(values[1]) <= 90.0 and abs(values[2]) <= 360.0):
            said = f"lat, lon = {values[1]:g}, {values[2]:g}: must lie within ±90 and ±360 degrees"
            raise _error_at_line(path, said, line)
        rows_of.setdefault(name, []).append(values)
    if not rows_of:
        raise _error_at_line(path, "a row of column names and rows of samples are needed")
    notes: list[str] = []
    tracks = [_sort_by_time(path, n, np.array(rows).T, notes) for n, rows in rows_of.items()]
    if wanted is _PLANE:
        return [_track_from_feet(t, x, y, z) for t, x, y, z in tracks], None, notes
    origin = at or (float(tracks[0][1, 0]), float(tracks[0][2, 0]))
    return [_project_to_plane(samples, origin) for samples in tracks], origin, notes


def _project_to_plane(samples: FloatArray, origin: tuple[float, float]) -> Track:
    """Return latitude, longitude, height (ft) as north, east, height (m) in the tangent plane."""
    time_s, lat, lon, alt_ft = samples
    north, east, _ = line_of_sight_ned(*origin, 0.0, lat, lon, np.zeros_like(lat))
    return time_s, north, east, alt_ft * FOOT_M


def _refuse_cut_off(file: bytes) -> None:
    """Refuse a file of level 5 whose elements are cut off: SciPy reads on beyond their ends."""
    order = {b"IM": "<", b"MI": ">"}.get(file[126:128])
    start = 128
    while order is not None and start + 8 <= len(file):
        kind, size = struct.unpack(f"{order}II", file[start : start + 8])
        start += 8 + size
        if start > len(file):
            raise ValueError(f"an element of {size} bytes is cut off at byte {len(file)}")
        if kind == _COMPRESSED:
            unpack = zlib.decompressobj()
            part = unpack.decompress(file[start - size : start], 2**20)
            while part and not unpack.eof:
                part = unpack.decompress(unpack.unconsumed_tail, 2**20)
            if not unpack.eof:
                raise ValueError(f"the packed element that ends at byte {start} is cut off")


def read_track_matrices(path: Path) -> Tracks:
    """Read the tracks of a MATLAB file: every matrix of 7 rows in it, in order of their names."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabObject, MatlabOpaque

    try:
        file = read_input_bytes(path)
        if file.startswith(b"MATLAB 7.3") or _HDF5 in (file[:8], file[512:520]):
            raise EncounterSetError(
                f"{path}: is a MATLAB 7.3 file (HDF5), which is not read: save it in MATLAB with "
                "the option -v7"
            )
        _refuse_cut_off(file)
        content = loadmat(io.BytesIO(file))
    except InputFileError as error:
        raise EncounterSetError(f"{path}: {error}") from None
    except EncounterSetError:
        raise
    except Exception as error:  # SciPy raises whatever comes of bytes that it does not check
        raise EncounterSetError(
            f"{path}: is no MATLAB file of version 7 or less: {str(error)[:200]}"
        ) from None
    matrices: list[FloatArray] = []
    classes: list[str] = []

    def number(name: str) -> list[object]:
        return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]

    def gather(value: object) -> None:
        if isinstance(value, MatlabObject):
            classes.append(value.classname)
        elif isinstance(value, MatlabOpaque):
            classes.append(value["s2"].item().decode("latin-1"))
        elif isinstance(value, np.ndarray) and value.dtype == object:
            for one in value.reshape(-1, order="F"):
                gather(one)
        elif isinstance(value, np.ndarray) and value.dtype.names:
            for name in value.dtype.names:
                gather(value[name])
        elif (
            isinstance(value, np.ndarray)
            and value.dtype.kind in "fiu"
            and value.ndim in (2, 3)
            and value.shape[0] == _ROWS
            and value.shape[1] >= 2
        ):
            matrix = value.astype(float)
            matrices.extend([matrix] if value.ndim == 2 else np.moveaxis(matrix, 2, 0))

    for name in sorted((n for n in content if not n.startswith("__")), key=number):
        gather(content[name])
    if classes:
        raise EncounterSetError(
            f"{path}: holds an object of MATLAB's class {classes[0]!r}, which cannot be read "
            "outside of MATLAB: its initial states and events are the columns of a set (.parquet), "
            f"its flown tracks are matrices of {_ROWS} rows"
        )
    if not matrices and any(np.ndim(v) == 2 and np.shape(v)[1] == 4 for v in content.values()):
        raise EncounterSetError(
            f"{path}: holds events (4 columns: time, vertical rate, turn rate, acceleration) and "
            "no initial state: both together are the columns of a set (.parquet)"
        )
    if not matrices:
        raise EncounterSetError(
            f"{path}: holds no matrix of {_ROWS} rows (time in s, north, east, altitude in ft, "
            "velocities), one for each aircraft"
        )
    notes: list[str] = []
    tracks: list[Track] = []
    for k, matrix in enumerate(matrices):
        if not np.isfinite(matrix[:4]).all():
            raise EncounterSetError(f"{path}: aircraft {k + 1}: holds something else than numbers")
        if matrix[0, 0] < 0.0:
            raise EncounterSetError(f"{path}: aircraft {k + 1}: time is negative")
        tracks.append(
            _track_from_feet(*_sort_by_time(path, f"aircraft {k + 1}", matrix[:4], notes))
        )
    return tracks, None, notes


def _sort_by_time(path: Path, name: str, samples: FloatArray, notes: list[str]) -> FloatArray:
    """Return samples (columns, n) by time, each once; EncounterSetError if two differ at a time."""
    name = name or "the track"
    order = np.argsort(samples[0], kind="stable")
    if (order[1:] < order[:-1]).any():
        notes.append(f"{path}: {name}: rows were not in the order of time and have been sorted")
        samples = samples[:, order]
    again = (samples[:, 1:] == samples[:, :-1]).all(axis=0)
    if again.any():
        count = int(np.count_nonzero(again))
        notes.append(f"{path}: {name}: {count} of its samples stand there again and count once")
        samples = samples[:, np.append(True, ~again)]
    twice = np.flatnonzero(np.diff(samples[0]) <= 0.0)
    if len(twice):
        when_s = samples[0, twice[0]]
        raise EncounterSetError(f"{path}: {name}: it is at two places at {when_s:.15g} s")
    return samples


def _track_from_feet(
    time_s: FloatArray, north: FloatArray, east: FloatArray, up: FloatArray
) -> Track:
    return time_s, north * FOOT_M, east * FOOT_M, up * FOOT_M


def name_tracks(tracks: list[Track]) -> list[tuple[str, Track]]:
    """Return the tracks with names, the first as the ownship and the others as intruders."""
    names = [*NAMES, *(f"intruder {k}" for k in range(2, len(tracks)))]
    return list(zip(names, tracks, strict=False))


def read_paired_text(path: Path) -> Tracks:
    """Read one encounter of paired tracks: a row of names, one of units, and samples."""
    names, rows = _header_and_rows(path)
    indices = _indices(path, names, _PAIRED)
    line, units = next(rows, (0, [""] * len(names)))
    factors = []
    for name, index in zip(_PAIRED[1:], indices[1:], strict=True):
        unit = units[index].strip("[]").lower()
        known = {"s": 1.0} if name == "time" else {"ft": FOOT_M, "m": 1.0}
        if unit not in known:
            raise _error_at_line(path, f"{name} is in {unit!r}: must be {' or '.join(known)}", line)
        factors.append(known[unit])
    rows_of: dict[str, list[list[float]]] = {}
    for line, row in rows:
        rows_of.setdefault(row[indices[0]], []).append(
            _numbers(path, line, [row[index] for index in indices[1:]])
        )
    if len(rows_of) < 2:
        raise _error_at_line(path, "has one aircraft: an ownship and an intruder are needed")
    notes: list[str] = []
    tracks: list[Track] = []
    for name, samples in rows_of.items():
        columns = np.array(samples).T * np.array(factors)[:, np.newaxis]
        time_s, east, north, up = _sort_by_time(path, name, columns, notes)
        tracks.append((time_s, north, east, up))
    return tracks, None, notes
