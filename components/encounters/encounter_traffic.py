"""Traffic of encounters: one of a set (``traffic.encounters``), or one that a model makes.

Which one it is is a parameter, so that a study has one encounter per replica. An encounter is a
function of its number: the same in every scene and condition.
"""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from components.encounters.made_encounters import read_made
from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules, pairing_rules
from components.encounters.pairing import PairSampler, set_of_pairs
from components.flights.fleet import CELLS_AT_ONCE
from components.flights.sampled_flight import SampledTrajectory
from components.flights.scripted_flights import ScriptedTrajectory
from components.formats.encounter_set import TRACKS, EncounterSet, flown_events
from components.formats.set_file import read_set
from components.formats.text_rows import TrafficFile
from components.geometry import enu_to_geodetic, line_of_sight
from components.traffic.files import FileParameters, RecordedTraffic
from components.traffic.scripted import Ownship, flight_arguments
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Parameters, ScenePath
from dsa_des.block.ladder import Verified

#: An encounter: its set, and its index there.
Encounter = tuple[EncounterSet, int]
#: Time (s), north, east and altitude (m) of aircraft that are known at the same times.
_Paths = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

#: Flights that were flown last, with their sets.
_FLOWN: OrderedDict[Any, tuple[EncounterSet, list[SampledTrajectory]]] = OrderedDict()
#: So many encounters' flights are kept: a study asks for each of a chunk several times.
MOST_FLOWN = 600


def encounter_flights(
    encounter_set: EncounterSet, index: int, dynamics: str
) -> list[SampledTrajectory]:
    """Return the flights of an encounter, by its index in the set, the ownship's first."""
    key = _key(encounter_set, index, dynamics)
    if key not in _FLOWN:
        (flights,) = flights_of([(encounter_set, index)], dynamics)
        _keep(key, encounter_set, flights)
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
    for key, (encounter_set, _), one in zip(new, encounters, flights, strict=False):
        _keep(key, encounter_set, one)


def flights_of(encounters: Sequence[Encounter], dynamics: str) -> list[list[SampledTrajectory]]:
    """Return the flights of each encounter, to the bit as if it were asked for alone."""
    aircraft = [
        (encounter_set, row)
        for encounter_set, index in encounters
        for row in range(encounter_set.first_rows[index], encounter_set.first_rows[index + 1])
    ]
    alike: dict[Any, list[int]] = {}
    for number, (encounter_set, row) in enumerate(aircraft):
        lasts = number if encounter_set.kind == TRACKS else encounter_set.seconds(row)
        alike.setdefault((encounter_set.kind, lasts, encounter_set.reference_deg), []).append(
            number
        )
    made: dict[int, SampledTrajectory] = {}
    for numbers in alike.values():
        for some in _in_parts(numbers, len(_paths([aircraft[numbers[0]]], dynamics)[0])):
            flights = _flown_alike([aircraft[number] for number in some], dynamics)
            made.update(zip(some, flights, strict=True))
    each = iter(range(len(aircraft)))
    return [
        [
            made[next(each)]
            for _ in range(encounter_set.first_rows[index], encounter_set.first_rows[index + 1])
        ]
        for encounter_set, index in encounters
    ]


def _in_parts(numbers: list[int], samples: int) -> list[list[int]]:
    width = max(1, CELLS_AT_ONCE // samples)
    return [numbers[first : first + width] for first in range(0, len(numbers), width)]


def _paths(aircraft: Sequence[tuple[EncounterSet, int]], dynamics: str) -> _Paths:
    encounter_set, row = aircraft[0]
    if encounter_set.kind != TRACKS:
        return flown_events(aircraft, dynamics)
    time_s, north, east, altitude = encounter_set.path(row)
    return time_s, north[:, np.newaxis], east[:, np.newaxis], altitude[:, np.newaxis]


def _flown_alike(aircraft: Sequence[Encounter], dynamics: str) -> list[SampledTrajectory]:
    time_s, north, east, altitude = _paths(aircraft, dynamics)
    origin = aircraft[0][0].reference_deg
    lat, lon, _ = enu_to_geodetic(
        east, north, 0.0,
        reference_lat_deg=origin[0], reference_lon_deg=origin[1], reference_alt_m=0.0,
    )  # fmt: skip
    names = [encounter_set.names[row] for encounter_set, row in aircraft]
    return SampledTrajectory.together(names, time_s, lat, lon, altitude)


def _key(encounter_set: EncounterSet, index: int, dynamics: str) -> Any:
    # Of a set put elsewhere what was read is the same: the arrays stand for it.
    return id(encounter_set.starts), encounter_set.reference_deg, index, dynamics


def _keep(key: Any, encounter_set: EncounterSet, flights: list[SampledTrajectory]) -> None:
    _FLOWN[key] = encounter_set, flights
    while len(_FLOWN) > MOST_FLOWN:
        _FLOWN.popitem(last=False)


#: Beyond it nothing can meet; the plane in which encounters lie is far above the ground there.
_FARTHEST_M = 1e6


class OneEncounter(FileParameters):
    """Parameters of traffic that is one encounter of many."""

    encounter: int = Field(
        default=0, ge=0, le=2**53, description="Number of the encounter that is flown."
    )
    dynamics: Literal["euler", "point_mass"] = Field(
        default="euler",
        description="How initial states and events are flown: steps of 1 s with straight paths "
        "between them, or a point mass at 0.1 s with limits on turn, bank and pitch rate.",
    )
    lat_deg: float | None = Field(
        default=None, ge=-89, le=89, description="Where the origin is put, instead of the set's."
    )
    lon_deg: float | None = Field(
        default=None, ge=-360, le=360, description="Its longitude; given with `lat_deg`."
    )
    scripted_ownship: Ownship | None = Field(
        default=None,
        description="A start and a flight in the scene, which the ownship flies instead of the "
        "encounter's own, as in `traffic.scripted`; the intruders stay.",
    )


class SetParameters(OneEncounter):
    """Parameters of traffic from a set of encounters."""

    file: ScenePath = Field(
        description="The set: a Parquet file of `dsa-des encounters`, or the table (`.toml`) of "
        "encounters made by hand."
    )
    skip_damaged: bool = Field(
        default=False,
        description="Use the set without its damaged encounters; otherwise any is an error.",
    )


class MissDistances(Parameters):
    """How often encounters of a model pass at which distance; their weights undo it."""

    edges_ft: tuple[float, ...] = Field(description="Rising edges of steps, ft.")
    proportions: tuple[float, ...] = Field(
        description="Of each step between two edges: of horizontal distances the share of "
        "encounters in it, of vertical ones the chance (at most 1) with which they are accepted."
    )


class ModelParameters(OneEncounter):
    """Parameters of traffic that an encounter model makes."""

    file: ScenePath = Field(description="Text file of the encounter model of the ownship.")
    intruder_file: ScenePath | None = Field(
        default=None, description="That of the intruder; left out, the same."
    )
    model_seed: int = Field(
        default=0,
        ge=0,
        description="Seed of the encounters; the scene's own seed does not change them.",
    )
    horizontal: MissDistances | None = Field(
        default=None,
        description="Of the signed horizontal miss distance; by default as published. Encounters "
        "that pass farther than the outer edges do not happen.",
    )
    vertical: MissDistances | None = Field(
        default=None, description="Of the vertical miss distance, the intruder's height above."
    )

    @model_validator(mode="after")
    def _densities(self) -> Any:
        self.pairing_rules()
        return self

    def pairing_rules(self) -> PairingRules:
        """Return how tracks become encounters; ValueError where edges or proportions do not fit."""
        return pairing_rules(
            *(given and (given.edges_ft, given.proportions)
              for given in (self.horizontal, self.vertical))
        )  # fmt: skip


class _EncounterTraffic(RecordedTraffic):
    """One encounter; its first aircraft is the ownship."""

    Parameters = OneEncounter
    encounter_set: EncounterSet
    index: int

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        if (own := self.p.scripted_ownship) is not None:
            self._refuse_another_place(own.lat_deg, own.lon_deg)
            self.own = ScriptedTrajectory(
                "ownship", lat_deg=own.lat_deg, lon_deg=own.lon_deg,
                **flight_arguments(own, self.wind),
            )  # fmt: skip

    def read(self) -> TrafficFile:
        """Return the flights of the encounter."""
        if (self.p.lat_deg is None) != (self.p.lon_deg is None):
            raise ValueError("lat_deg and lon_deg belong together: give both, or neither")
        self.encounter_set, self.index = _encounter_of(type(self), self.p)
        own, *others = encounter_flights(self.encounter_set, self.index, self.p.dynamics)
        notes = [f"encounter {self.encounter_set.numbers[self.index]} of {len(self.encounter_set)}"]
        if self.encounter_set.skipped:
            notes.append(f"{self.encounter_set.skipped} damaged encounters of the set were skipped")
        return TrafficFile(own, others, 0.0, notes)

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Make the flights that many blocks will ask for, all at once."""
        wanted: dict[str, list[tuple[EncounterSet, int]]] = {}
        for p in parameters[:MOST_FLOWN]:
            # What is wrong is said by the block that asks for it.
            with suppress(ValueError):
                wanted.setdefault(p.dynamics, []).append(_encounter_of(cls, p))
        for dynamics, encounters in wanted.items():
            prepare_flights(encounters, dynamics)

    def _refuse_another_place(self, lat_deg: float, lon_deg: float) -> None:
        at = self.encounter_set.reference_deg
        apart_m = float(line_of_sight(lat_deg, lon_deg, 0.0, *at, 0.0)[2])
        if apart_m > _FARTHEST_M:
            raise ValueError(
                f"scripted_ownship: starts {apart_m / 1000:.0f} km from the encounter, whose "
                f"origin is at {at[0]:g}, {at[1]:g}; lat_deg and lon_deg of the block put the "
                f"encounter elsewhere (at most {_FARTHEST_M / 1000:.0f} km are allowed)"
            )

    def report(self) -> dict[str, Any]:
        """Return closest approaches, and the encounter with its weight."""
        which = {
            "number": int(self.encounter_set.numbers[self.index]),
            "weight": float(self.encounter_set.weights[self.index]),
        }
        return {**super().report(), "encounter": which}


class SetTraffic(_EncounterTraffic):
    """Traffic of one encounter of a set, told by its number."""

    Parameters = SetParameters
    lockstep = True


class ModelTraffic(_EncounterTraffic):
    """Traffic of one encounter that a pair of encounter models makes, told by its number."""

    Parameters = ModelParameters
    lockstep = True
    verified = (
        Verified("sampled tracks", "exact distributions of the network, by enumeration",
                 "chi-square and 4 standard errors", "tests/encounters/test_sampling.py"),
        Verified("pairs and their weights", "the gas model's closed form; a plain Monte Carlo",
                 "4 standard errors", "tests/encounters/test_pairing.py"),
    )  # fmt: skip

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Make the encounters and flights that many blocks will ask for, all at once."""
        wanted: dict[Any, set[int]] = {}
        for p in parameters:
            wanted.setdefault(_model_key(p), set()).add(p.encounter)
        for key, numbers in wanted.items():
            new = np.array(sorted(n for n in numbers if (*key, n) not in _MADE), dtype=np.int64)
            for run in np.split(new, np.flatnonzero(np.diff(new) != 1) + 1):
                if len(run) > 1:
                    _make(key, range(int(run[0]), int(run[-1]) + 1))
        super().prepare(parameters)


def chosen_encounter(cls: type, parameters: Any) -> tuple[EncounterSet, int]:
    """Return the set of an encounter that a block's parameters name, and its index there."""
    if issubclass(cls, ModelTraffic):
        return _made(_model_key(parameters), parameters.encounter), 0
    if parameters.file.suffix == ".toml":
        encounter_set = read_made(parameters.file)
    else:
        encounter_set = read_set(parameters.file, parameters.skip_damaged)
    return encounter_set, encounter_set.index_of(parameters.encounter)


def _encounter_of(cls: type, parameters: Any) -> tuple[EncounterSet, int]:
    """Return the set of an encounter where the scene puts it, and its index there."""
    encounter_set, index = chosen_encounter(cls, parameters)
    at = parameters.lat_deg, parameters.lon_deg
    return (encounter_set if None in at else replace(encounter_set, reference_deg=at)), index


#: What makes encounters of a model: both files, the seed, and how miss distances are drawn.
_ModelKey = tuple[Path, Path, int, MissDistances | None, MissDistances | None]
#: Encounters of models that were made last, each a set of its own, by model and number.
_MADE: OrderedDict[Any, EncounterSet] = OrderedDict()
# So many are kept: a study asks for each encounter of a chunk several times.
_MOST_MADE = 1200


def _model_key(parameters: Any) -> _ModelKey:
    p = parameters
    return p.file, p.intruder_file or p.file, p.model_seed, p.horizontal, p.vertical


def _made(key: _ModelKey, number: int) -> EncounterSet:
    if (*key, number) not in _MADE:
        _make(key, range(number, number + 1))
    return _MADE[(*key, number)]


def _make(key: _ModelKey, numbers: range) -> None:
    sampler = _sampler(key)
    pairs, rules = sampler.pairs(numbers, paths=False), sampler.rules
    for index, number in enumerate(numbers):
        one = pairs if len(numbers) == 1 else pairs.take(np.array([index]))
        made = set_of_pairs(one, rules.closest_s, (0.0, 0.0), str(key[0]))
        _MADE[(*key, number)] = made
    while len(_MADE) > _MOST_MADE:
        _MADE.popitem(last=False)


@lru_cache(maxsize=4)
def _sampler(key: _ModelKey) -> PairSampler:
    file, intruder, seed, horizontal, vertical = key
    drawn = ModelParameters(file=file, horizontal=horizontal, vertical=vertical)
    return PairSampler(read_model(file), read_model(intruder), seed, drawn.pairing_rules())
