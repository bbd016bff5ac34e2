"""Flights of the latest turn that clears a disc: collision courses, flown to the metre."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import dsa_des
from components.arguments.units import KNOT_M_S
from components.geometry import line_of_sight
from docs.make.published.turn_geometry import (
    BEFORE_S,
    DISC_M,
    OWN_MPS,
    as_searched_m,
    stepped_least_range_m,
)
from docs.make.published.turn_geometry import least_range_m as by_geometry_m

SCENE = "published/least_range"
#: Turns that are tried: by 90 deg, or somewhat less where the intruder comes from behind.
_BEHIND_DEG, TURNS_DEG, TURNS_BEHIND_DEG = 140.0, (90.0,), (30.0, 45.0, 60.0, 75.0, 90.0)
# From the disc to beyond where any of these turns is late; how far from a guess is looked first.
_NEAREST_M, _FARTHEST_M, _ABOUT_M = 155.0, 2500.0, 8.0
_TRIES, _NEAR_ENOUGH_M = 20, 0.2


@dataclass(frozen=True)
class LeastRange:
    """The least range of a collision course."""

    azimuth_deg: float
    #: 0: the intruder comes the faster one of its two ways; 1: the slower.
    course: int
    closing_mps: float
    range_m: float

    @property
    def published_m(self) -> float:
        """The same range as the publication would step, search and count it."""
        flown_more_m = self.range_m - self.geometry_m
        return counted_m(self.azimuth_deg, self.closing_mps, flown_more_m)

    @property
    def flown_to_disc_m(self) -> float:
        """The same range with the publication's allowance for the disc, but not its search."""
        return self.range_m - DISC_M**2 / (BEFORE_S * self.closing_mps)

    @property
    def geometry_m(self) -> float:
        """The same range from geometry alone, over a flat Earth."""
        return by_geometry_m(self.azimuth_deg, self.closing_mps, turns_deg(self.azimuth_deg))


def turns_deg(azimuth_deg: float) -> tuple[float, ...]:
    """Return the turns that are tried for an intruder who comes from an azimuth."""
    return TURNS_BEHIND_DEG if abs(azimuth_deg) > _BEHIND_DEG else TURNS_DEG


def counted_m(azimuth_deg: float, closing_mps: float, flown_more_m: float) -> float:
    """Return a least range as NRC counts it, of flights that need so much more than geometry."""
    stepped_m = stepped_least_range_m(azimuth_deg, closing_mps, turns_deg(azimuth_deg))
    return as_searched_m(stepped_m + flown_more_m, closing_mps)


def closing_speeds(azimuth_deg: float, intruder_mps: float) -> list[float]:
    """Return with which speeds an intruder may close in from an azimuth, the faster one first."""
    own_mps = OWN_MPS
    along = own_mps * math.cos(math.radians(azimuth_deg))
    rest = along**2 - own_mps**2 + intruder_mps**2
    if rest < 0.0:
        return []
    both = along + math.sqrt(rest), along - math.sqrt(rest)
    return [speed for speed in both if speed > 1e-6]


def table_of_courses(
    folder: Path, azimuths_deg: Iterable[float], intruder_kt: float, closest_s: float
) -> Path:
    """Write the table of the collision courses from some azimuths, for `traffic.encounters`."""
    path = folder / f"courses_{intruder_kt:g}.toml"
    bearings = ", ".join(f"{azimuth:g}" for azimuth in azimuths_deg)
    path.write_text(
        f"closest_s = {closest_s:g}\nduration_s = {closest_s + 40.0:g}\nhorizontal_m = 0\n"
        f"vertical_m = 0\nbearing_deg = [{bearings}]\ncourses = 'every'\n"
        f"own_speed_kt = {OWN_MPS / KNOT_M_S:g}\nintruder_speed_kt = {intruder_kt:g}\n"
        "own_heading_deg = 217\nown_altitude_m = 1000\nat = [-41.3, 174.8]\n",
        encoding="utf-8",
    )
    return path


@dataclass(frozen=True)
class _FlownCourse:
    """One encounter of a table, flown with one turn."""

    file: Path
    encounter: int
    direction: str
    turn_deg: float
    duration_s: float

    def flown(self, range_m: float) -> tuple[float, float]:
        """Return the range at which the turn began, and by how much the disc was cleared."""
        scene = dsa_des.load_scene(
            SCENE,
            sets=[
                f"blocks.traffic.file={self.file}", f"blocks.traffic.encounter={self.encounter}",
                f"blocks.camera.range_km={range_m / 1000.0}",
                "blocks.camera.azimuth_deg=[-180, 180]",
                f"blocks.avoidance.direction={self.direction}",
                f"blocks.avoidance.turn_deg={self.turn_deg}", "record.truth=true",
            ],
            duration_s=f"{self.duration_s:g}",
        )  # fmt: skip
        run = dsa_des.run(scene)
        truth = run["truth"]
        is_own = truth["target"].is_null().to_numpy()
        columns = [truth[name].to_numpy() for name in ("lat_deg", "lon_deg", "alt_m", "time_s")]
        own, other = ([column[who] for column in columns] for who in (is_own, ~is_own))
        distance_m = np.asarray(line_of_sight(*own[:3], *other[:3])[2])
        began_s = float(run["manoeuvres"]["time_s"][0].as_py()) + 0.001
        return float(np.interp(began_s, own[3], distance_m)), float(distance_m.min()) - DISC_M

    def least_range_m(self, guess_m: float, most_m: float) -> float:
        """Return the range up to a largest one at whose turn the disc is just cleared, or inf.

        A guess only says where to look first: both ends of the bracket are flown.
        """
        # Of the farthest turn that fails and the nearest that clears the disc: the range of the
        # camera, that at which the turn began, and by how much the disc was cleared.
        low = min(guess_m, most_m) - _ABOUT_M
        high = min(guess_m + _ABOUT_M, most_m)
        high_began, above = self.flown(high)
        if above < 0.0:
            high_began, above = self.flown(high := most_m)
            if above < 0.0:
                return math.inf
        low_began, below = self.flown(low)
        if below >= 0.0:
            low_began, below = self.flown(low := _NEAREST_M)
        for _ in range(_TRIES):
            if high - low < 1.0 or min(above, -below) < _NEAR_ENOUGH_M:
                break
            guess = low + (high - low) * below / (below - above)
            guess = min(max(guess, low + 0.5), high - 0.5)
            began, off = self.flown(guess)
            if off < 0.0:
                low, low_began, below = guess, began, off
            else:
                high, high_began, above = guess, began, off
        return low_began + (high_began - low_began) * below / (below - above)


def least_ranges(intruder_kt: float, azimuths_deg: Iterable[float]) -> list[LeastRange]:
    """Return by azimuth and course the least range at which one of the turns clears the disc.

    Turns are by 90 deg to either side, or by 75 where the intruder comes from behind.
    """
    azimuths = list(azimuths_deg)
    courses = [
        (azimuth, course, speed)
        for azimuth in azimuths
        for course, speed in enumerate(closing_speeds(azimuth, intruder_kt * KNOT_M_S))
    ]
    # Long enough that all begin well outside of what the slowest needs.
    slowest = min(speed for *_, speed in courses)
    closest_s = min(max(30.0, 450.0 / slowest), 300.0)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = table_of_courses(Path(folder), azimuths, intruder_kt, closest_s)
        for encounter, (azimuth, course, speed) in enumerate(courses):
            least_m = math.inf
            # What geometry has for the best first, so that the others need but one flight.
            sides = {"away": -math.copysign(1.0, azimuth), "towards": math.copysign(1.0, azimuth)}
            tried = sorted(
                (by_geometry_m(azimuth, speed, [turn], [side]), direction, turn)
                for direction, side in sides.items()
                for turn in turns_deg(azimuth)
            )
            for guess_m, direction, turn in tried:
                flight = _FlownCourse(file, encounter, direction, turn, closest_s + 25.0)
                most_m = min(_FARTHEST_M, speed * closest_s, least_m)
                least_m = min(least_m, flight.least_range_m(guess_m, most_m))
            found.append(LeastRange(azimuth, course, speed, least_m))
    return found
