"""The flights of encounters, made for many of them at once and kept for all who ask for them."""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from components.encounters.encounter_set import TRACKS, EncounterSet, flown_events
from components.geometry import enu_to_geodetic
from components.traffic.trajectory import CELLS_AT_ONCE, SampledTrajectory
from dsa_des.arrays.types import FloatArray

#: An encounter: its set, and its place there.
Encounter = tuple[EncounterSet, int]
#: Time (s), north, east and altitude (m) of aircraft that are known at the same times.
_Paths = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

#: Flights that were flown last, with their sets.
_FLOWN: OrderedDict[Any, tuple[EncounterSet, list[SampledTrajectory]]] = OrderedDict()
#: So many encounters' flights are kept: a study asks for each of a chunk several times.
MOST_FLOWN = 600


def encounter_flights(found: EncounterSet, place: int, dynamics: str) -> list[SampledTrajectory]:
    """Return the flights of an encounter, the ownship's first.

    Parameters
    ----------
    found : EncounterSet
    place : int
        Of the encounter, from 0.
    dynamics : {"euler", "point_mass"}
        How events are flown.
    """
    key = _key(found, place, dynamics)
    if key not in _FLOWN:
        (flights,) = flights_of([(found, place)], dynamics)
        _keep(key, found, flights)
    return _FLOWN[key][1]


def prepare_flights(wanted: Iterable[Encounter], dynamics: str) -> None:
    """Make the flights of many encounters, which will be asked for one after the other."""
    new = {_key(*one, dynamics): one for one in wanted}
    new = {key: one for key, one in new.items() if key not in _FLOWN}
    encounters = list(new.values())[:MOST_FLOWN]
    try:
        flights = flights_of(encounters, dynamics)
    except ValueError:  # of one of them, which says so when it is asked for
        return
    for key, (found, _), one in zip(new, encounters, flights, strict=False):
        _keep(key, found, one)


def flights_of(encounters: Sequence[Encounter], dynamics: str) -> list[list[SampledTrajectory]]:
    """Return the flights of each encounter, to the bit as if it were asked for alone."""
    aircraft = [
        (found, row)
        for found, place in encounters
        for row in range(found.first_rows[place], found.first_rows[place + 1])
    ]
    alike: dict[Any, list[int]] = {}
    for number, (found, row) in enumerate(aircraft):
        lasts = number if found.kind == TRACKS else found.seconds(row)
        alike.setdefault((found.kind, lasts, found.reference_deg), []).append(number)
    made: dict[int, SampledTrajectory] = {}
    for numbers in alike.values():
        for some in _in_parts(numbers, len(_paths([aircraft[numbers[0]]], dynamics)[0])):
            flights = _made([aircraft[number] for number in some], dynamics)
            made.update(zip(some, flights, strict=True))
    each = iter(range(len(aircraft)))
    return [
        [made[next(each)] for _ in range(found.first_rows[place], found.first_rows[place + 1])]
        for found, place in encounters
    ]


def _in_parts(numbers: list[int], samples: int) -> list[list[int]]:
    width = max(1, CELLS_AT_ONCE // samples)
    return [numbers[first : first + width] for first in range(0, len(numbers), width)]


def _paths(aircraft: Sequence[tuple[EncounterSet, int]], dynamics: str) -> _Paths:
    found, row = aircraft[0]
    if found.kind != TRACKS:
        return flown_events(aircraft, dynamics)
    time_s, north, east, altitude = found.path(row)
    return time_s, north[:, np.newaxis], east[:, np.newaxis], altitude[:, np.newaxis]


def _made(aircraft: Sequence[tuple[EncounterSet, int]], dynamics: str) -> list[SampledTrajectory]:
    time_s, north, east, altitude = _paths(aircraft, dynamics)
    origin = aircraft[0][0].reference_deg
    lat, lon, _ = enu_to_geodetic(
        east, north, 0.0,
        reference_lat_deg=origin[0], reference_lon_deg=origin[1], reference_alt_m=0.0,
    )  # fmt: skip
    names = [found.names[row] for found, row in aircraft]
    return SampledTrajectory.together(names, time_s, lat, lon, altitude)


def _key(found: EncounterSet, place: int, dynamics: str) -> Any:
    # Of a set put elsewhere what was read is the same: the arrays stand for it.
    return id(found.starts), found.reference_deg, place, dynamics


def _keep(key: Any, found: EncounterSet, flights: list[SampledTrajectory]) -> None:
    _FLOWN[key] = found, flights
    while len(_FLOWN) > MOST_FLOWN:
        _FLOWN.popitem(last=False)
