"""Traffic of encounters: one of a set (``traffic.encounters``), or one that a model makes.

Which one it is is a parameter, so that a study has one encounter per replica. An encounter is a
function of its number: the same in every scene and condition.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from components.encounters.made_encounters import read_made_set
from components.encounters.model_file import read_model
from components.encounters.pair_densities import MissDistances, PairingRules, pairing_rules
from components.encounters.pairing import PairSampler, encounter_set_of_pairs
from components.flights.fleet import CELLS_AT_ONCE
from components.flights.sampled_flight import SampledTrajectory
from components.flights.sampled_segments import STRAIGHT_ROWS
from components.formats.encounter_set import TRACKS, EncounterSet, fly_events
from components.formats.set_file import read_set
from components.formats.text_rows import TrafficFile
from components.geometry import enu_to_geodetic, line_of_sight
from components.traffic.recorded import FileParameters, RecordedTraffic
from components.traffic.scripted import Ownship, scripted_flight
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import ScenePath
from dsa_des.block.ladder import Verified

#: An encounter: its set, and its index there.
Encounter = tuple[EncounterSet, int]
#: An aircraft: its encounter's set, its row there, and how its events are flown.
_Craft = tuple[EncounterSet, int, str]


class MadeTogether:
    """A cache of things that are made for many keys at once and then looked up one by one.

    The last batch is kept whole, however many it holds, until the next one takes its place: what a
    batch needs is never made twice. Of keys that no batch named the last few are kept.
    """

    def __init__(self, make: Callable[[list[Any]], Iterable[Any]]) -> None:
        self._make = make
        self._batch: dict[Any, Any] = {}
        self._single: dict[Any, Any] = {}

    def prepare(self, keys: Iterable[Any]) -> None:
        """Make and keep what these keys lack, all at once, and drop everything for other keys.

        What was made of a key alone is made again: what is made at once lies together in memory.
        """
        wanted = dict.fromkeys(keys)
        self._batch = {key: self._batch[key] for key in wanted if key in self._batch}
        new = [key for key in wanted if key not in self._batch]
        self._batch.update(zip(new, self._make(new), strict=True))

    def __getitem__(self, key: Any) -> Any:
        if key in self._batch:
            return self._batch[key]
        if key not in self._single:
            if len(self._single) >= _SINGLE:
                del self._single[next(iter(self._single))]
            (self._single[key],) = self._make([key])
        return self._single[key]


_SINGLE = 16


def encounter_flights(
    encounter_set: EncounterSet, index: int, dynamics: str
) -> list[SampledTrajectory]:
    """Return the flights of the encounter at an index of a set, the ownship's first; cached."""
    flights: list[SampledTrajectory] = _FLIGHTS[encounter_set, index, dynamics]
    return flights


def _make_flights(keys: Sequence[tuple[EncounterSet, int, str]]) -> list[list[SampledTrajectory]]:
    """Return the flights of each encounter; bit for bit the same whether made alone or together."""
    rows = [range(*of.first_rows[index : index + 2].tolist()) for of, index, _ in keys]
    aircraft = [
        (of, row, dynamics) for (of, _, dynamics), mine in zip(keys, rows, strict=True)
        for row in mine
    ]  # fmt: skip
    alike: dict[Any, list[int]] = {}
    for number, (of, row, dynamics) in enumerate(aircraft):
        lasts = number if of.kind == TRACKS else of.flown_seconds_of_row(row)
        alike.setdefault((of.kind, lasts, of.reference_deg, dynamics), []).append(number)
    made: dict[int, SampledTrajectory] = {}
    for numbers in alike.values():
        count = len(_time_and_positions([aircraft[numbers[0]]])[0])
        table = np.empty((len(numbers) * count, STRAIGHT_ROWS))
        width = max(1, CELLS_AT_ONCE // count)
        for first in range(0, len(numbers), width):
            some = numbers[first : first + width]
            flown = _fly_same_times([aircraft[k] for k in some], (table, first * count))
            made.update(zip(some, flown, strict=True))
    each = iter(range(len(aircraft)))
    return [[made[next(each)] for _ in mine] for mine in rows]


_FLIGHTS = MadeTogether(_make_flights)


def _time_and_positions(aircraft: Sequence[_Craft]) -> tuple[FloatArray, ...]:
    """Return time (s), north, east, altitude (m), (times, aircraft), of aircraft sharing times."""
    encounter_set, row, dynamics = aircraft[0]
    if encounter_set.kind != TRACKS:
        return fly_events([(of, row) for of, row, _ in aircraft], dynamics)
    time_s, *position = encounter_set.path(row)
    return time_s, *(part[:, np.newaxis] for part in position)


def _fly_same_times(
    aircraft: Sequence[_Craft], place: tuple[FloatArray, int]
) -> list[SampledTrajectory]:
    time_s, north, east, altitude = _time_and_positions(aircraft)
    origin = aircraft[0][0].reference_deg
    lat, lon, _ = enu_to_geodetic(
        east, north, 0.0,
        reference_lat_deg=origin[0], reference_lon_deg=origin[1], reference_alt_m=0.0,
    )  # fmt: skip
    names = [encounter_set.names[row] for encounter_set, row, _ in aircraft]
    return SampledTrajectory.from_common_times(names, time_s, lat, lon, altitude, place)


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
    def _check_densities(self) -> Any:
        self.pairing_rules()
        return self

    def pairing_rules(self) -> PairingRules:
        """Return the pairing rules; ValueError where edges or proportions do not fit."""
        both = self.horizontal, self.vertical
        return pairing_rules(*(None if one is None else one.edges_and_proportions for one in both))


class _EncounterTraffic(RecordedTraffic):
    """One encounter; its first aircraft is the ownship."""

    lockstep = True
    Parameters = OneEncounter
    encounter_set: EncounterSet
    index: int
    #: Which height its altitudes are, where that is known.
    said_height = ""

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        if (own := self.p.scripted_ownship) is not None:
            self._refuse_another_place(own.lat_deg, own.lon_deg)
            own = own.with_ellipsoid_heights(self.air)
            self.own = scripted_flight(own, own.start, self.wind)
            self._set_ownship_properties(own)

    def read(self) -> TrafficFile:
        """Return the named encounter's flights, as a traffic file would give them."""
        if (self.p.lat_deg is None) != (self.p.lon_deg is None):
            raise ValueError("lat_deg and lon_deg belong together: give both, or neither")
        self.encounter_set, self.index = _moved_encounter_of_parameters(type(self), self.p)
        own, *others = encounter_flights(self.encounter_set, self.index, self.p.dynamics)
        notes = [f"encounter {self.encounter_set.numbers[self.index]}{self.set_size_text()}"]
        if self.encounter_set.skipped:
            notes.append(f"{self.encounter_set.skipped} damaged encounters of the set were skipped")
        return TrafficFile(own, others, 0.0, notes, notes[1:], height=self.said_height)

    def set_size_text(self) -> str:
        """Return in words how many encounters the set has, to follow the flown one's number."""
        return f" of {len(self.encounter_set)}"

    @classmethod
    def choose_encounters(cls, parameters: Sequence[Any]) -> list[Encounter]:
        """Return for each block's parameters an encounter set and the encounter's index in it."""
        return [encounter_of_parameters(cls, p) for p in parameters]

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Make and cache the flights of many blocks' encounters at once."""
        with suppress(ValueError):  # what is wrong is said by the block that asks for it
            _FLIGHTS.prepare(
                [(*_moved_encounter_of_parameters(cls, p), p.dynamics) for p in parameters]
            )

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
    """Traffic of one encounter of a set, by its number."""

    Parameters = SetParameters


class ModelTraffic(_EncounterTraffic):
    """Traffic of one encounter that a pair of encounter models makes, by its number."""

    Parameters = ModelParameters
    said_height = "pressure altitude, as the radars behind encounter models had it of transponders"
    verified = (
        Verified("sampled tracks", "exact distributions of the network, by enumeration",
                 "chi-square and 4 standard errors", "tests/encounters/test_sampling.py"),
        Verified("pairs and their weights", "the gas model's closed form; a plain Monte Carlo",
                 "4 standard errors", "tests/encounters/test_pairing.py"),
    )  # fmt: skip

    def warnings(self) -> list[str]:
        """Return warnings on units of the encounter models that had to be interpreted."""
        models = dict.fromkeys((self.p.file, self.p.intruder_file or self.p.file))
        notes = [f"file {path}: {note}" for path in models for note in read_model(path).notes]
        return notes + super().warnings()

    def set_size_text(self) -> str:
        """Return an empty text, as a model makes any number of encounters."""
        return ""

    @classmethod
    def choose_encounters(cls, parameters: Sequence[Any]) -> list[Encounter]:
        """Return for each block a sampled set and its encounter's index, all sampled at once."""
        keys = [_pair_key(p) for p in parameters]
        _PAIRS.prepare(keys)
        return [_PAIRS[key] for key in keys]

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Sample and cache the encounters and the flights of many blocks at once."""
        _PAIRS.prepare([_pair_key(p) for p in parameters])
        super().prepare(parameters)


def encounter_of_parameters(cls: type, parameters: Any) -> tuple[EncounterSet, int]:
    """Return the set that a block's parameters name, not moved, and the encounter's index in it."""
    if issubclass(cls, ModelTraffic):
        found: Encounter = _PAIRS[_pair_key(parameters)]
        return found
    if parameters.file.suffix == ".toml":
        encounter_set = read_made_set(parameters.file)
    else:
        encounter_set = read_set(parameters.file, parameters.skip_damaged)
    return encounter_set, encounter_set.index_of(parameters.encounter)


def _moved_encounter_of_parameters(cls: type, parameters: Any) -> tuple[EncounterSet, int]:
    """Return the encounter's set, moved to the origin in the parameters, and its index there."""
    encounter_set, index = encounter_of_parameters(cls, parameters)
    at = parameters.lat_deg, parameters.lon_deg
    made_there = None in at or at == encounter_set.reference_deg
    return (encounter_set if made_there else _move_set(encounter_set, at)), index


@lru_cache(maxsize=16)
def _move_set(encounter_set: EncounterSet, reference_deg: tuple[float, float]) -> EncounterSet:
    """Return the set moved to an origin, the same object each time, as flights are cached by it."""
    return replace(encounter_set, reference_deg=reference_deg)


@dataclass(frozen=True, eq=False)
class _Model:
    """The models, seed, miss distances and origin that determine a sequence of encounters.

    It is itself a key, of one object for all that are alike (`_model_of`).
    """

    file: Path
    intruder: Path
    seed: int
    horizontal: MissDistances | None
    vertical: MissDistances | None
    lat_deg: float | None
    lon_deg: float | None

    @property
    def sampler(self) -> PairSampler:
        return _make_pair_sampler(
            self.file, self.intruder, self.seed, self.horizontal, self.vertical
        )

    @property
    def reference_deg(self) -> tuple[float, float]:
        lat_deg, lon_deg = self.lat_deg, self.lon_deg
        return (0.0, 0.0) if lat_deg is None or lon_deg is None else (lat_deg, lon_deg)


_model_of = lru_cache(maxsize=64)(_Model)


def _pair_key(parameters: Any) -> tuple[_Model, int]:
    p = parameters
    made_by = p.file, p.intruder_file or p.file, p.model_seed, p.horizontal, p.vertical
    return _model_of(*made_by, p.lat_deg, p.lon_deg), p.encounter


def _sample_pairs(keys: Sequence[tuple[_Model, int]]) -> list[Encounter]:
    """Return by model and number a set and its encounter's index, sampled together by model."""
    numbers_of: dict[_Model, set[int]] = {}
    for model, number in keys:
        numbers_of.setdefault(model, set()).add(number)
    made: dict[tuple[_Model, int], Encounter] = {}
    for model, chosen in numbers_of.items():
        sampler, numbers = model.sampler, np.array(sorted(chosen), dtype=np.int64)
        for first in range(0, len(numbers), _PAIRS_AT_ONCE):
            pairs = sampler.sample_pairs(numbers[first : first + _PAIRS_AT_ONCE], paths=False)
            closest_s, source = sampler.rules.closest_s, str(model.file)
            some = encounter_set_of_pairs(pairs, closest_s, model.reference_deg, source)
            made |= {(model, n): (some, index) for index, n in enumerate(pairs.numbers.tolist())}
    return [made[key] for key in keys]


#: So many encounters of a model make one set: their arrays stay small.
_PAIRS_AT_ONCE = 4096
_PAIRS = MadeTogether(_sample_pairs)


@lru_cache(maxsize=4)
def _make_pair_sampler(
    file: Path,
    intruder: Path,
    seed: int,
    horizontal: MissDistances | None,
    vertical: MissDistances | None,
) -> PairSampler:
    drawn = ModelParameters(file=file, horizontal=horizontal, vertical=vertical)
    return PairSampler(read_model(file), read_model(intruder), seed, drawn.pairing_rules())
