"""Encounters made by hand: a table of what they should be, swept and drawn, exact on the ellipsoid.

A quantity of the table is a number, a list (swept: every combination with the other lists), or
``{uniform = [low, high]}`` (drawn, for each encounter by its number).
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.arguments.units import FOOT_M, KNOT_M_S
from components.encounters.sampling import EncounterDraws
from components.flights.closest_geometry import (
    SENSES,
    Approach,
    both_intruder_headings_rad,
    fly_paths,
    project_to_north_east_m,
)
from components.formats.encounter_set import (
    LARGEST_WEIGHT,
    NAMES,
    TRACKS,
    EncounterSet,
    geometry_class,
)
from components.formats.set_file import EncounterSetError, is_origin
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import UsageError, did_you_mean, shortened_repr
from dsa_des.errors.budgets import check_sample_count
from dsa_des.files.input_files import (
    InputFileError,
    cache_file_reads,
    read_input_text,
    resolve_home,
)
from dsa_des.files.toml_files import parse_toml

_LENGTH, _SPEED = {"m": 1.0, "ft": FOOT_M}, {"mps": 1.0, "kt": KNOT_M_S}
_CLIMB, _ANGLE = {"mps": 1.0, "ft_min": FOOT_M / 60.0}, {"deg": math.pi / 180.0}
_TIME = {"s": 1.0}


@dataclass(frozen=True)
class _Quantity:
    """A quantity's units with factors to SI, its default (None if required), and limits in SI."""

    units: Mapping[str, float]
    default: float | None
    low: float
    high: float


QUANTITIES = {
    "closest": _Quantity(_TIME, None, 0.0, 86_400.0),
    "horizontal": _Quantity(_LENGTH, None, -1e5, 1e5),
    "vertical": _Quantity(_LENGTH, None, -1e4, 1e4),
    "bearing": _Quantity(_ANGLE, None, -2 * math.pi, 2 * math.pi),
    "own_speed": _Quantity(_SPEED, None, 0.1, 1000.0),
    "own_altitude": _Quantity(_LENGTH, 1000.0, -500.0, 30_000.0),
    "own_climb": _Quantity(_CLIMB, 0.0, -200.0, 200.0),
    "own_heading": _Quantity(_ANGLE, 0.0, -2 * math.pi, 2 * math.pi),
    "intruder_speed": _Quantity(_SPEED, None, 0.0, 1000.0),
    "intruder_climb": _Quantity(_CLIMB, 0.0, -200.0, 200.0),
}
GEOMETRIES = ("any", "head-on", "overtaking", "crossing")
COURSES = ("one", "every")
_OTHERS = ("count", "seed", "at", "duration_s", "geometry", "courses", "sense", "weight")
# What courses follow from.
_OF_COURSES = ("bearing", "own_speed", "intruder_speed")
_MOST = 1_000_000
_TRIES = 200


@dataclass(frozen=True)
class Recipe:
    """What a TOML table of encounters made by hand asks for, in SI units.

    Of each swept combination `fixed` gives every quantity, as a value or as (low, high) where it is
    drawn, `geometries` the geometry, and `courses` which of the two courses that lead there it
    takes (None: the first of its geometry). `count` encounters are made of each.
    """

    path: Path
    fixed: list[dict[str, Any]]
    geometries: list[str]
    count: int
    seed: int
    at_deg: tuple[float, float]
    duration_s: float
    weight: float
    sense: str
    courses: list[int] | None = None


def read_recipe(text: str) -> Recipe:
    """Return a TOML file's recipe of encounters; UsageError with everything wrong in it."""
    try:
        path = resolve_home(text)
        tables = parse_toml(read_input_text(path))
    except (InputFileError, ValueError) as error:
        raise UsageError(f"{text}: {error}") from None
    return _Recipes(path, tables).make_recipe()


class _Recipes:
    def __init__(self, path: Path, tables: dict[str, Any]) -> None:
        self.path, self.tables = path, tables
        self.wrong: list[str] = []

    def add_error(self, key: str, message: str) -> None:
        shown = f" = {shortened_repr(self.tables[key])}" if key in self.tables else ""
        self.wrong.append(f"{self.path}: {key}{shown}: {message}")

    def make_recipe(self) -> Recipe:
        names = {f"{q}_{u}": (q, u) for q, spec in QUANTITIES.items() for u in spec.units}
        for key in self.tables:
            if key not in names and key not in _OTHERS:
                self.add_error(key, f"unknown key{did_you_mean(key, [*names, *_OTHERS])}")
        swept: dict[str, list[Any]] = {}
        for quantity, spec in QUANTITIES.items():
            given = [key for key, (q, _) in names.items() if q == quantity and key in self.tables]
            if len(given) > 1:
                self.add_error(given[1], f"is given twice, as {given[0]} too")
            if not given:
                if spec.default is None:
                    units = " or ".join(f"{quantity}_{unit}" for unit in spec.units)
                    self.add_error(f"{quantity}_{next(iter(spec.units))}", f"is required ({units})")
                swept[quantity] = [spec.default]
                continue
            swept[quantity] = self.read_values(given[0], spec, spec.units[names[given[0]][1]])
        geometries = self.tables.get("geometry", "any")
        geometries = geometries if isinstance(geometries, list) else [geometries]
        for name in geometries:
            if name not in GEOMETRIES:
                self.add_error("geometry", f"must be of {', '.join(GEOMETRIES)}")
        swept["geometry"] = geometries
        sense = self.tables.get("sense", "slant")
        if self.tables.get("courses", "one") not in COURSES:
            self.add_error("courses", f"must be {' or '.join(COURSES)}")
        elif self.tables.get("courses") == "every":
            drawn = [q for q in _OF_COURSES if any(isinstance(v, tuple) for v in swept[q])]
            if drawn:
                self.add_error("courses", f"is of numbers; {' and '.join(drawn)} must not be drawn")
        if sense not in SENSES:
            self.add_error("sense", f"must be {' or '.join(SENSES)}")
        count, seed = (
            self.read_whole_number("count", 1, 1, _MOST),
            self.read_whole_number("seed", 0, 0, 2**62),
        )
        duration = self.read_number("duration_s", 120.0, 0.1, 86_400.0)
        weight = self.read_number("weight", 1.0, 1e-100, LARGEST_WEIGHT)
        at = self.tables.get("at", [0.0, 0.0])
        if not is_origin(at):
            self.add_error("at", "must be [latitude, longitude] in degrees, within ±89 and ±360")
        if self.wrong:
            raise UsageError(*self.wrong)
        if count * math.prod(map(len, swept.values())) > _MOST:
            raise UsageError(f"{self.path}: makes more than {_MOST:,} encounters")
        total = count * math.prod(map(len, swept.values()))
        asked = f"{self.path}: {total:,} encounters of {duration:g} s"
        check_sample_count(asked, 2.0 * total * (duration + 1.0))
        every = [
            dict(zip(swept, values, strict=True)) for values in itertools.product(*swept.values())
        ]
        kinds = [str(one.pop("geometry")) for one in every]
        origin = float(at[0]), float(at[1])
        courses = None
        if self.tables.get("courses", "one") == "every":
            there = [(k, c) for k, one in enumerate(every) for c in _available_courses(one)]
            every, kinds = [every[k] for k, _ in there], [kinds[k] for k, _ in there]
            courses = [course for _, course in there]
            if not every:
                raise UsageError(f"{self.path}: no course of any intruder leads there")
        return Recipe(
            self.path, every, kinds, count, seed, origin, duration, weight, sense, courses
        )

    def read_values(self, key: str, spec: _Quantity, factor: float) -> list[Any]:
        """Return a quantity's values to sweep, SI: numbers, or (low, high) to draw from."""
        given = self.tables[key]
        result: list[Any] = []
        for item in given if isinstance(given, list) else [given]:
            ends = item.get("uniform") if isinstance(item, dict) and len(item) == 1 else [item]
            if not isinstance(ends, list) or not ends or not all(map(_is_number, ends)):
                self.add_error(
                    key, "must be a number, a list of numbers, or {uniform = [low, high]}"
                )
                return []
            if isinstance(item, dict) and (len(ends) != 2 or ends[1] < ends[0]):
                self.add_error(key, "uniform takes [low, high], the lower one first")
                return []
            scaled = [float(end) * factor for end in ends]
            if min(scaled) < spec.low or max(scaled) > spec.high:
                limits = f"{spec.low / factor:g} to {spec.high / factor:g}"
                self.add_error(key, f"must lie from {limits}")
                return []
            result.append(tuple(scaled) if isinstance(item, dict) else scaled[0])
        if not result:
            self.add_error(key, "is an empty list")
        return result

    def read_whole_number(self, key: str, default: int, low: int, high: int) -> int:
        value = self.tables.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.add_error(key, f"must be a whole number from {low} to {high}")
            return default
        return value

    def read_number(self, key: str, default: float, low: float, high: float) -> float:
        value = self.tables.get(key, default)
        if not _is_number(value) or not low <= value <= high:
            self.add_error(key, f"must be a number from {low:g} to {high:g}")
            return default
        return float(value)


def _available_courses(one: Mapping[str, Any]) -> list[int]:
    """Return which of courses 0 and 1 lead an intruder of this speed to the wanted bearing."""
    speeds = np.array([one["own_speed"]]), np.array([one["intruder_speed"]])
    both = both_intruder_headings_rad(np.zeros(1), *speeds, np.array([one["bearing"]]))
    return [k for k, heading in enumerate(both) if not np.isnan(heading[0])]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@cache_file_reads(32)
def read_made_set(path: Path) -> EncounterSet:
    """Return the encounter set of a TOML table; EncounterSetError if it cannot be used."""
    try:
        return make_set(read_recipe(str(path)))
    except UsageError as error:
        raise EncounterSetError(str(error)) from None


def make_set(recipe: Recipe) -> EncounterSet:
    """Return the set of encounters of a recipe, swept combination after combination."""
    total = recipe.count * len(recipe.fixed)
    combination = np.repeat(np.arange(len(recipe.fixed)), recipe.count)
    draws = EncounterDraws(recipe.seed, "made encounters")
    names = list(QUANTITIES)
    values, course = np.zeros((len(names), total)), np.full(total, np.nan)
    left = np.arange(total)
    for attempt in range(_TRIES):
        drawn = draws.uniform_fast(left, len(names) + 1, attempt)
        for k, name in enumerate(names):
            ends = [recipe.fixed[c][name] for c in combination[left]]
            low, high = np.array([e if isinstance(e, tuple) else (e, e) for e in ends]).T
            values[k, left] = low + (high - low) * drawn[k]
        course[left] = _intruder_headings(
            recipe, combination[left], dict(zip(names, values[:, left], strict=True))
        )
        approach = _make_approach(
            recipe, dict(zip(names, values[:, left], strict=True)), course[left]
        )
        possible = ~np.isnan(course[left])
        possible &= fly_paths(approach, np.zeros(len(left)), np.zeros(1))[3]
        free = np.array([any(isinstance(v, tuple) for v in recipe.fixed[c].values())
                         for c in combination[left]])  # fmt: skip
        stuck = left[~possible & ~free]
        if len(stuck):
            _raise_impossible_encounter(
                recipe, int(stuck[0]), int(combination[stuck[0]]), bool(np.isnan(course[stuck[0]]))
            )
        left = left[~possible]
        if not len(left):
            break
    else:
        _raise_impossible_encounter(
            recipe, int(left[0]), int(combination[left[0]]), bool(np.isnan(course[left[0]]))
        )
    return _columns_to_set(recipe, dict(zip(names, values, strict=True)), course)


def _raise_impossible_encounter(
    recipe: Recipe, number: int, combination: int, no_course: bool
) -> None:
    wanted = recipe.geometries[combination]
    why = (
        f"no course of an intruder at this speed comes from this bearing"
        f"{'' if wanted == 'any' else f' and is {wanted}'}"
        if no_course
        else "it climbs or sinks too fast past so small a horizontal distance to be closest there; "
        'sense = "horizontal" asks for the horizontal distance alone'
    )
    raise UsageError(f"{recipe.path}: encounter {number}: {why}")


def _intruder_headings(recipe: Recipe, combination: Any, v: dict[str, FloatArray]) -> FloatArray:
    """Return intruder headings, rad, for the wanted geometry; NaN where none gives the bearing."""
    both = both_intruder_headings_rad(
        v["own_heading"], v["own_speed"], v["intruder_speed"], v["bearing"]
    )
    course = np.full(len(combination), np.nan)
    wanted = np.array([recipe.geometries[c] for c in combination])
    for k, heading in enumerate(both):
        off = np.degrees(heading - v["own_heading"]) % 360.0
        kind = np.array([str(name).split(" ")[0] for name in geometry_class(np.nan_to_num(off))])
        good = ~np.isnan(heading) & ((wanted == "any") | (wanted == kind)) & np.isnan(course)
        if recipe.courses is not None:
            good &= np.array(recipe.courses)[combination] == k
        course = np.where(good, heading, course)
    return course


def _make_approach(recipe: Recipe, v: dict[str, FloatArray], course: FloatArray) -> Approach:
    return Approach(
        *recipe.at_deg,
        np.stack([v["own_altitude"], v["own_altitude"] + v["vertical"]]),
        np.stack([v["own_heading"], np.nan_to_num(course)]),
        np.stack([v["own_speed"], v["intruder_speed"]]),
        np.stack([v["own_climb"], v["intruder_climb"]]),
        v["horizontal"],
        v["vertical"],
        recipe.sense,
    )


def _columns_to_set(recipe: Recipe, v: dict[str, FloatArray], course: FloatArray) -> EncounterSet:
    total = len(course)
    time_s = np.append(np.arange(0.0, recipe.duration_s, 1.0), recipe.duration_s)
    lat, lon, alt, _ = fly_paths(_make_approach(recipe, v, course), v["closest"], time_s)
    # Rows of the file: both aircraft of each encounter in turn.
    lat, lon, alt = (x.transpose(1, 0, 2).reshape(-1) for x in (lat, lon, alt))
    north, east = project_to_north_east_m(lat, lon, recipe.at_deg)
    off = np.degrees(course - v["own_heading"]) % 360.0
    return EncounterSet(
        str(recipe.path),
        TRACKS,
        np.arange(total),
        np.full(total, recipe.weight),
        2 * np.arange(total + 1),
        NAMES * total,
        {},
        len(time_s) * np.arange(2 * total + 1),
        {"time_s": np.tile(time_s, 2 * total), "north_m": north, "east_m": east, "altitude_m": alt},
        recipe.at_deg,
        {
            "horizontal_miss_m": v["horizontal"],
            "vertical_miss_m": v["vertical"],
            "closest_s": v["closest"],
            "course_deg": off,
            "bearing_deg": np.degrees(v["bearing"]) % 360.0,
            "geometry": geometry_class(off),
        },
    )
