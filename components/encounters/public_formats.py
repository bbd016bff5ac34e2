"""Public formats of encounters: paired tracks in text, and waypoint files in binary.

Paired tracks (em-pairing-uncor-importancesampling): columns NAME, east, north, alt (ft), trk (rad),
gs, vs (ft/s), time (s) under a line of units, all rows of the ownship before those of the
intruder. Its own reader divides vs by 60; the unit line, and the altitudes, say ft/s. Positions
are all that is taken.

Waypoints (em-core), little-endian: uint32 encounters, uint32 aircraft; for each encounter the start
of each aircraft (three doubles: north, east, altitude in ft), then for each aircraft a uint16 k and
k times four doubles (time in s, north, east, altitude).
"""

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from components.encounters.encounter_set import TRACKS, EncounterSet
from components.encounters.set_file import EncounterSetError
from components.well_clear.volume import FOOT_M
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.files.input_files import InputFileError, read_input_bytes, read_input_text

_COLUMNS = ("NAME", "east", "north", "alt", "time")
_MOST_AIRCRAFT = 1000
#: Time (s), north, east and altitude (m) of one aircraft.
Track = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def set_of_tracks(
    source: str,
    numbers: Sequence[int],
    weights: Sequence[float],
    tracks: Sequence[Sequence[tuple[str, Track]]],
    reference_deg: tuple[float, float],
    skipped: int = 0,
) -> EncounterSet:
    """Return a set of sampled tracks: for each encounter names and tracks, the ownship's first."""
    rows = [one for encounter in tracks for one in encounter]
    lists = {
        name: np.concatenate([track[k] for _, track in rows])
        for k, name in enumerate(("time_s", "north_m", "east_m", "altitude_m"))
    }
    starts: IntArray = np.concatenate([[0], np.cumsum([len(track[0]) for _, track in rows])])
    first: IntArray = np.concatenate([[0], np.cumsum([len(one) for one in tracks])])
    return EncounterSet(
        source, TRACKS, np.array(numbers, dtype=np.int64), np.array(weights, dtype=float), first,
        tuple(name for name, _ in rows), {}, starts, lists, reference_deg, {}, skipped,
    )  # fmt: skip


def read_paired_text(path: Path) -> list[tuple[str, Track]]:
    """Read one encounter of paired tracks.

    Raises
    ------
    EncounterSetError
        Naming file and line.
    """

    def fail(message: str, line: int | None = None) -> EncounterSetError:
        where = f"{path}: " if line is None else f"{path}: line {line}: "
        return EncounterSetError(where + message)

    try:
        lines = read_input_text(path).split("\n")
    except InputFileError as error:
        raise fail(str(error)) from None
    rows = [
        (number, [cell.strip() for cell in line.split(",")])
        for number, line in enumerate(lines, start=1)
        if line.strip()
    ]
    if len(rows) < 3:
        raise fail("a row of names, one of units and rows of samples are needed")
    names, units = rows[0][1], rows[1][1]
    place = {}
    for name in _COLUMNS:
        if name not in names:
            raise fail(f"there is no column {name!r}{did_you_mean(name, names)}", rows[0][0])
        place[name] = names.index(name)
    factors = []
    for name in _COLUMNS[1:]:
        unit = units[place[name]].strip("[]").lower() if place[name] < len(units) else ""
        known = {"s": 1.0} if name == "time" else {"ft": FOOT_M, "m": 1.0}
        if unit not in known:
            raise fail(f"{name} is in {unit!r}: must be {' or '.join(known)}", rows[1][0])
        factors.append(known[unit])
    found: dict[str, list[list[float]]] = {}
    for number, row in rows[2:]:
        if len(row) != len(names):
            raise fail(f"has {len(row)} values, but there are {len(names)} columns", number)
        try:
            values = [float(row[place[name]]) for name in _COLUMNS[1:]]
        except ValueError:
            raise fail("holds something else than numbers", number) from None
        if values[-1] < 0.0:
            raise fail(f"time = {values[-1]:g} is negative", number)
        found.setdefault(row[place["NAME"]], []).append(values)
    if len(found) < 2:
        raise fail("has one aircraft: an ownship and an intruder are needed")
    encounter = []
    for name, samples in found.items():
        east, north, up, time_s = np.array(samples).T * np.array(factors)[:, np.newaxis]
        if not np.isfinite([east, north, up, time_s]).all() or (np.diff(time_s) <= 0.0).any():
            raise fail(f"{name}: samples must be numbers, and their times must rise")
        encounter.append((name.lower(), (time_s, north, east, up)))
    return encounter


def read_waypoints(path: Path) -> tuple[list[list[tuple[str, Track]]], dict[int, str]]:
    """Read a file of waypoints.

    Returns
    -------
    encounters : list
        Names and tracks of all, those damaged too.
    damaged : dict
        Place of an encounter → what is wrong with it.

    Raises
    ------
    EncounterSetError
        If the file is cut short, or is none.
    """
    try:
        content = read_input_bytes(path)
    except InputFileError as error:
        raise EncounterSetError(f"{path}: {error}") from None

    at = 0

    def take(form: str, what: str) -> tuple[float, ...]:
        nonlocal at
        size = struct.calcsize(form)
        if at + size > len(content):
            raise EncounterSetError(f"{path}: {what}: the file is cut short at byte {len(content)}")
        at += size
        return struct.unpack_from(form, content, at - size)

    count, aircraft = (int(n) for n in take("<II", "its first line"))
    if not 2 <= aircraft <= _MOST_AIRCRAFT:
        raise EncounterSetError(
            f"{path}: says that each encounter has {aircraft} aircraft: 2 or more are needed, and "
            f"{_MOST_AIRCRAFT} at most"
        )
    encounters: list[list[tuple[str, Track]]] = []
    damaged: dict[int, str] = {}
    for k in range(count):
        told = f"encounter {k}"
        starts = [take("<3d", told) for _ in range(aircraft)]
        encounter = []
        for n, start in enumerate(starts):
            (updates,) = (int(v) for v in take("<H", told))
            values = take(f"<{4 * updates}d", told)
            rows = np.array([(0.0, *start), *np.reshape(values, (-1, 4)).tolist()])
            if updates and rows[1, 0] == 0.0:  # the start is there twice
                rows = rows[1:]
            name = "ownship" if n == 0 else "intruder" if n == 1 else f"intruder {n}"
            if not np.isfinite(rows).all():
                damaged.setdefault(k, f"{name}: holds something else than numbers")
            elif (rows[:, 0] < 0.0).any():
                damaged.setdefault(k, f"{name}: time is negative")
            elif (np.diff(rows[:, 0]) <= 0.0).any():
                damaged.setdefault(k, f"{name}: times must rise")
            time_s, north, east, up = rows.T
            encounter.append((name, (time_s, north * FOOT_M, east * FOOT_M, up * FOOT_M)))
        encounters.append(encounter)
    if at != len(content):
        raise EncounterSetError(
            f"{path}: {len(content) - at} bytes are left behind the last encounter"
        )
    return encounters, damaged


def waypoints_of(found: EncounterSet, dynamics: str = "euler") -> bytes:
    """Return a set as a file of waypoints.

    Raises
    ------
    EncounterSetError
        If its encounters have different numbers of aircraft, or a track too many samples.
    """
    counts = np.unique(np.diff(found.first_rows))
    if len(counts) > 1:
        raise EncounterSetError(
            f"{found.source}: encounters have {counts.min()} to {counts.max()} aircraft: a file of "
            "waypoints has the same number in all"
        )
    parts = [struct.pack("<II", len(found), int(counts[0]))]
    for place in range(len(found)):
        rows = range(int(found.first_rows[place]), int(found.first_rows[place + 1]))
        paths = [np.stack(found.path(row, dynamics)) for row in rows]
        for path in paths:
            path[1:] /= FOOT_M
            if path.shape[1] > 65_535:
                raise EncounterSetError(
                    f"{found.source}: encounter {found.numbers[place]}: {path.shape[1]} samples: a "
                    "file of waypoints holds 65,535 of each aircraft at most"
                )
            parts.append(path[1:, 0].astype("<f8").tobytes())
        for path in paths:
            parts.append(struct.pack("<H", path.shape[1]))
            parts.append(np.ascontiguousarray(path.T).astype("<f8").tobytes())
    return b"".join(parts)
