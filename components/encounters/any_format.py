"""Encounters of any format that is read: sets, waypoints, paired tracks, tables and matrices."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from components.encounters.encounter_set import EncounterSet
from components.encounters.public_formats import (
    Track,
    read_paired_text,
    read_waypoints,
    set_of_tracks,
)
from components.encounters.set_file import EncounterSetError, read_set, without
from components.encounters.track_tables import (
    Tracks,
    encounter_of,
    read_track_csv,
    read_track_matrices,
)
from dsa_des.errors import UsageError

TEXT, TABLE, MATRIX, WAYPOINTS, SET = ".txt", ".csv", ".mat", (".bin", ".dat"), ".parquet"
_MOST_SAID = 20
#: Names and tracks of the aircraft of an encounter.
_Encounter = list[tuple[str, Track]]


def read_encounters(
    paths: Sequence[Path], at: tuple[float, float] | None, skip_damaged: bool
) -> EncounterSet:
    """Return what is in one set, in one file of waypoints, or in files of tracks.

    Parameters
    ----------
    paths : sequence of Path
        Files of tracks are one encounter each; those of one aircraft each make an encounter two by
        two, the ownship's first.
    at : (latitude, longitude), optional
        Where the origin is put.
    skip_damaged : bool
        Whether damaged encounters are left out and counted.

    Raises
    ------
    UsageError, EncounterSetError
        With what is wrong, naming file and encounter.
    """
    kinds = {path.suffix.lower() for path in paths}
    if kinds == {SET} and len(paths) == 1:
        found = read_set(paths[0], skip_damaged)
        return found if at is None else EncounterSet(**{**vars(found), "reference_deg": at})
    if len(paths) == 1 and kinds <= set(WAYPOINTS):
        return _waypoints(paths[0], at or (0.0, 0.0), skip_damaged)
    if not paths or not kinds <= {TEXT, TABLE, MATRIX}:
        raise UsageError(
            f"{', '.join(map(str, paths[:5]))}: must be one set ({SET}), one file of waypoints "
            f"({' or '.join(WAYPOINTS)}), or tracks ({TEXT}, {TABLE}, {MATRIX})"
        )
    wrong: list[str] = []
    encounters: list[_Encounter] = []
    origins: list[tuple[float, float]] = []
    numbers: list[int] = []
    alone: tuple[Path, Tracks] | None = None
    number = 0
    for path in paths:
        try:
            tracks, origin = _tracks(path, at if alone is None else alone[1][1] or at)
            if len(tracks) == 1 and path.suffix.lower() != TEXT:
                if alone is None:
                    alone = path, (tracks, origin)
                    continue
                tracks, origin = [*alone[1][0], *tracks], alone[1][1]
                alone = None
            elif alone is not None:
                raise _one_aircraft(alone[0])
            encounters.append(encounter_of(tracks))
            numbers.append(number)
            if origin is not None:
                origins.append(origin)
        except EncounterSetError as error:
            wrong.append(str(error))
            alone = None
        number += 1
    if alone is not None:
        wrong.append(str(_one_aircraft(alone[0])))
    if wrong and (not skip_damaged or not encounters):
        raise EncounterSetError("\n".join(wrong[:_MOST_SAID]))
    where = at or (origins[0] if origins else (0.0, 0.0))
    weights = [1.0] * len(numbers)
    return set_of_tracks(str(paths[0].parent), numbers, weights, encounters, where, len(wrong))


def _one_aircraft(path: Path) -> EncounterSetError:
    return EncounterSetError(f"{path}: has one aircraft: an ownship and an intruder are needed")


def _tracks(path: Path, at: tuple[float, float] | None) -> Tracks:
    kind = path.suffix.lower()
    if kind == TABLE:
        return read_track_csv(path, at)
    if kind == MATRIX:
        return read_track_matrices(path)
    return [track for _, track in read_paired_text(path)], None


def _waypoints(path: Path, at: tuple[float, float], skip_damaged: bool) -> EncounterSet:
    encounters, damaged = read_waypoints(path)
    if damaged and (not skip_damaged or len(damaged) == len(encounters)):
        lines = [f"{path}: encounter {k}: {said}" for k, said in sorted(damaged.items())]
        raise EncounterSetError("\n".join(lines[:_MOST_SAID]))
    if not encounters:
        raise EncounterSetError(f"{path}: holds no encounter")
    every = range(len(encounters))
    found = set_of_tracks(str(path), every, np.ones(len(encounters)).tolist(), encounters, at)
    return without(found, sorted(damaged)) if damaged else found
