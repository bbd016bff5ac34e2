"""Whatever holds encounters: one set, a file of waypoints in binary, or files of tracks.

Waypoints (em-core), little-endian: uint32 encounters, uint32 aircraft; for each encounter the start
of each aircraft (three doubles: north, east, altitude in ft), then for each aircraft a uint16 k and
k times four doubles (time in s, north, east, altitude).
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from components.arguments.units import FOOT_M
from components.formats.encounter_set import NAMES, TRACKS, EncounterSet
from components.formats.sample_columns import EPOCH_S
from components.formats.set_file import EncounterSetError, read_set
from components.formats.track_files import (
    Track,
    Tracks,
    is_track_file,
    name_tracks,
    read_paired_text,
    read_track_csv,
    read_track_matrices,
)
from dsa_des.arrays.types import IntArray
from dsa_des.errors import UsageError
from dsa_des.files.input_files import InputFileError, read_input_bytes

_MOST_AIRCRAFT = 1000


def set_of_tracks(
    source: str,
    numbers: Sequence[int],
    weights: Sequence[float],
    tracks: Sequence[Sequence[tuple[str, Track]]],
    reference_deg: tuple[float, float],
    skipped: int = 0,
) -> EncounterSet:
    """Return a set of sampled tracks, given by encounter as names with tracks, ownship first."""
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


def read_waypoints_and_damage(path: Path) -> tuple[list[list[tuple[str, Track]]], dict[int, str]]:
    """Read waypoints; return encounters' named tracks and, by index, the damaged ones' faults."""
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
        where = f"encounter {k}"
        starts = [take("<3d", where) for _ in range(aircraft)]
        encounter = []
        for n, start in enumerate(starts):
            (updates,) = (int(v) for v in take("<H", where))
            values = take(f"<{4 * updates}d", where)
            rows = np.array([(0.0, *start), *np.reshape(values, (-1, 4)).tolist()])
            if updates and rows[1, 0] == 0.0:  # the start is there twice
                rows = rows[1:]
            name = NAMES[n] if n < 2 else f"intruder {n}"
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


def waypoint_file_bytes(encounters: EncounterSet, dynamics: str = "euler") -> bytes:
    """Return a set as a file of waypoints."""
    counts = np.unique(np.diff(encounters.first_rows))
    if len(counts) > 1:
        raise EncounterSetError(
            f"{encounters.source}: encounters have {counts.min()} to {counts.max()} aircraft: a "
            "file of waypoints has the same number in all"
        )
    parts = [struct.pack("<II", len(encounters), int(counts[0]))]
    for index in range(len(encounters)):
        rows = range(int(encounters.first_rows[index]), int(encounters.first_rows[index + 1]))
        paths = [np.stack(encounters.path(row, dynamics)) for row in rows]
        for path in paths:
            path[1:] /= FOOT_M
            if path.shape[1] > 65_535:
                raise EncounterSetError(
                    f"{encounters.source}: encounter {encounters.numbers[index]}: {path.shape[1]} "
                    "samples: a file of waypoints holds 65,535 of each aircraft at most"
                )
            parts.append(path[1:, 0].astype("<f8").tobytes())
        for path in paths:
            parts.append(struct.pack("<H", path.shape[1]))
            parts.append(np.ascontiguousarray(path.T).astype("<f8").tobytes())
    return b"".join(parts)


TEXT, TABLE, MATRIX, WAYPOINTS, SET = ".txt", ".csv", ".mat", (".bin", ".dat"), ".parquet"
_OF_TRACKS = {TEXT, TABLE, MATRIX}
_MOST_SAID = 20
#: What reads a file of other tracks, given where the origin is put.
TrackReader = Callable[[Path, tuple[float, float] | None], Tracks]
#: Names and tracks of the aircraft of an encounter.
_Encounter = list[tuple[str, Track]]


def read_encounters(
    paths: Sequence[Path],
    at: tuple[float, float] | None,
    skip_damaged: bool,
    others: TrackReader | None = None,
) -> EncounterSet:
    """Read encounters from one set file, from one file of waypoints, or from files of tracks.

    Files of tracks are one encounter each; those of one aircraft each make an encounter two by two,
    the ownship's first. `others` reads files of recorded aircraft.
    """
    kinds = {path.suffix.lower() for path in paths}
    if kinds == {SET} and len(paths) == 1:
        encounter_set = read_set(paths[0], skip_damaged)
        return encounter_set if at is None else replace(encounter_set, reference_deg=at)
    if len(paths) == 1 and kinds <= set(WAYPOINTS):
        return _waypoints(paths[0], at or (0.0, 0.0), skip_damaged)
    if not paths or kinds & {SET, *WAYPOINTS} or (others is None and not kinds <= _OF_TRACKS):
        raise UsageError(
            f"{', '.join(map(str, paths[:5]))}: must be one set ({SET}), one file of waypoints "
            f"({' or '.join(WAYPOINTS)}), or tracks ({TEXT}, {TABLE}, {MATRIX}, or any file of "
            "recorded aircraft)"
        )
    wrong: list[str] = []
    notes: list[str] = []
    encounters: list[_Encounter] = []
    origins: list[tuple[float, float]] = []
    numbers: list[int] = []
    alone: tuple[Path, Tracks] | None = None
    number = 0
    for path in paths:
        try:
            tracks, origin, said = _tracks(path, at if alone is None else alone[1][1] or at, others)
            notes += said
            if len(tracks) == 1 and path.suffix.lower() != TEXT:
                if alone is None:
                    alone = path, (tracks, origin, said)
                    continue
                tracks, origin = [*alone[1][0], *tracks], alone[1][1]
                alone = None
            elif alone is not None:
                raise _single_aircraft_error(alone[0])
            encounters.append(name_tracks(_shift_to_start(tracks)))
            numbers.append(number)
            if origin is not None:
                origins.append(origin)
        except EncounterSetError as error:
            wrong.append(str(error))
            alone = None
        number += 1
    if alone is not None:
        wrong.append(str(_single_aircraft_error(alone[0])))
    if wrong and (not skip_damaged or not encounters):
        raise EncounterSetError("\n".join(wrong[:_MOST_SAID]))
    where = at or (origins[0] if origins else (0.0, 0.0))
    weights = [1.0] * len(numbers)
    found = set_of_tracks(str(paths[0].parent), numbers, weights, encounters, where, len(wrong))
    return replace(found, notes=tuple(notes))


def _single_aircraft_error(path: Path) -> EncounterSetError:
    return EncounterSetError(f"{path}: has one aircraft: an ownship and an intruder are needed")


def _shift_to_start(tracks: list[Track]) -> list[Track]:
    """Return tracks with times from the earliest if the times are dates, else unchanged."""
    start_s = min(float(track[0][0]) for track in tracks)
    if start_s < EPOCH_S:
        return tracks
    return [(time_s - start_s, north, east, up) for time_s, north, east, up in tracks]


def _tracks(path: Path, at: tuple[float, float] | None, others: TrackReader | None) -> Tracks:
    kind = path.suffix.lower()
    if others is not None and (kind not in _OF_TRACKS or not is_track_file(path)):
        return others(path, at)
    if kind == TABLE:
        return read_track_csv(path, at)
    if kind == MATRIX:
        return read_track_matrices(path)
    return read_paired_text(path)


def _waypoints(path: Path, at: tuple[float, float], skip_damaged: bool) -> EncounterSet:
    encounters, damaged = read_waypoints_and_damage(path)
    if damaged and (not skip_damaged or len(damaged) == len(encounters)):
        lines = [f"{path}: encounter {k}: {said}" for k, said in sorted(damaged.items())]
        raise EncounterSetError("\n".join(lines[:_MOST_SAID]))
    if not encounters:
        raise EncounterSetError(f"{path}: holds no encounter")
    every = range(len(encounters))
    encounter_set = set_of_tracks(
        str(path), every, np.ones(len(encounters)).tolist(), encounters, at
    )
    return encounter_set.drop(sorted(damaged)) if damaged else encounter_set
