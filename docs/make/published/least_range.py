"""NRC's least range of detection by azimuth, and the risk ratio that follows, from flights."""

from __future__ import annotations

import csv
import gzip
import itertools
import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import dsa_des
from components.geometry import line_of_sight
from components.thesis.drawing import BLUE, GREEN, GREY, ORANGE, panels
from components.well_clear.volume import FOOT_M
from docs.make.published.rows import PublishedRow, table

TITLE = "The least range of detection, and its risk ratio"
ORDER = 3
SCENE = "published/least_range"
FIGURE = "published_least_range.png"
DATA = Path(__file__).parents[4] / "shared" / "data" / "published" / "nrc_min_range"

KT_MPS = 1852.0 / 3600.0
OWN_KT, DISC_M = 60.0, 500.0 * FOOT_M
#: What is read off the published numbers: all ranges over closing speed are on this grid, if the
#: disc is counted as from so long before the collision; the search takes two of its steps.
STEP_S, BEFORE_S = 0.2, 190.0
#: Azimuths of the published risk ratios: as dense all around, but straight ahead and behind.
GRID_DEG = 0.25
AZIMUTHS_DEG = (0.25, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 45.0, 60.0, 75.0, 90.0, 105.0,
                120.0, 135.0, 150.0, 165.0, 175.0)  # fmt: skip
#: Risk ratio of a camera of 60 deg and 1000 m, by the intruder's speed in kt.
RATIOS = {35: 0.1549, 45: 0.3814, 55: 0.5472, 65: 0.8331, 105: 0.8331, 165: 0.8331, 175: 0.8512,
          185: 0.9889, 195: 1.0}  # fmt: skip
#: Speeds whose ranges are at hand.
SHOWN_KT = (35, 105, 195)
SHOWN_DEG = (0.25, 15.0, 30.0, 60.0, 90.0, 120.0, 150.0)
# From the disc to beyond where any of these turns is late.
_NEAREST_M, _FARTHEST_M = 155.0, 2500.0
_TRIES, _NEAR_ENOUGH_M = 12, 0.7


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
        """The same range as the publication counts it: to the disc, from far away."""
        return self.range_m - DISC_M**2 / (BEFORE_S * self.closing_mps)


def closing_speeds(azimuth_deg: float, intruder_mps: float) -> list[float]:
    """Return with which speeds an intruder may close in from an azimuth, the faster one first."""
    own_mps = OWN_KT * KT_MPS
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
        f"own_speed_kt = {OWN_KT:g}\nintruder_speed_kt = {intruder_kt:g}\n"
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
                f"blocks.avoidance.turn_deg={self.turn_deg}",
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

    def least_range_m(self, most_m: float) -> float:
        """Return the range up to a largest one at whose turn the disc is just cleared, or inf."""
        high, above = self.flown(most_m)
        if above < 0.0:
            return math.inf
        low, below = self.flown(_NEAREST_M)
        side = 0
        for _ in range(_TRIES):
            guess = low + (high - low) * below / (below - above)
            began, off = self.flown(min(max(guess, low + 1.0), high))
            if abs(off) < _NEAR_ENOUGH_M:
                return began
            # The end that stays counts for less and less (the Illinois rule).
            if off < 0.0:
                low, below, above = began, off, 0.5 * above if side < 0 else above
                side = -1
            else:
                high, above, below = began, off, 0.5 * below if side > 0 else below
                side = 1
            if high - low < 1.0:
                break
        return high


def least_ranges(
    intruder_kt: float, azimuths_deg: Iterable[float] = AZIMUTHS_DEG
) -> list[LeastRange]:
    """Return by azimuth and course the least range at which one of the turns clears the disc.

    Turns are by 90 deg to either side, or by 60 where the intruder comes from behind.
    """
    azimuths = list(azimuths_deg)
    courses = [
        (azimuth, course, speed)
        for azimuth in azimuths
        for course, speed in enumerate(closing_speeds(azimuth, intruder_kt * KT_MPS))
    ]
    # Long enough that all begin well outside of what the slowest needs.
    slowest = min(speed for *_, speed in courses)
    closest_s = min(max(30.0, 450.0 / slowest), 300.0)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = table_of_courses(Path(folder), azimuths, intruder_kt, closest_s)
        for encounter, (azimuth, course, speed) in enumerate(courses):
            turns = (60.0, 90.0) if azimuth > 140.0 else (90.0,)
            least_m = math.inf
            for direction, turn_deg in itertools.product(("away", "towards"), turns):
                flight = _FlownCourse(file, encounter, direction, turn_deg, closest_s + 25.0)
                most_m = min(_FARTHEST_M, speed * closest_s, least_m)
                least_m = min(least_m, flight.least_range_m(most_m))
            found.append(LeastRange(azimuth, course, speed, least_m))
    return found


def risk_ratio(
    found: list[LeastRange], intruder_kt: float, field_deg: float, range_m: float
) -> float:
    """Return the share of collision courses that a camera's turns do not lead out of.

    As the publication counts: courses from every azimuth of its grid alike.
    """
    azimuths = np.arange(GRID_DEG, 180.0, GRID_DEG)
    courses = [closing_speeds(azimuth, intruder_kt * KT_MPS) for azimuth in azimuths]
    every, cleared = sum(map(len, courses)), 0
    for course in (0, 1):
        mine = [one for one in found if one.course == course]
        if not mine:
            continue
        there = np.array([len(speeds) > course for speeds in courses])
        needed = np.interp(
            azimuths, [one.azimuth_deg for one in mine], [one.published_m for one in mine]
        )
        cleared += int((there & (azimuths <= 0.5 * field_deg) & (needed < range_m)).sum())
    return 1.0 - cleared / every


def published_ranges() -> dict[tuple[float, float, int], float]:
    """Return the published ranges by speed (kt), azimuth (deg) and course, if they are at hand."""
    found = {}
    with gzip.open(DATA / "rmin_by_azimuth_35_105_195kt.csv.gz", "rt") as text:
        for row in csv.DictReader(text):
            where = float(row["intruder_kt"]), float(row["azimuth_deg"])
            for course, name in enumerate(("oncoming", "overtake")):
                if (value := float(row[f"rmin_{name}_m"])) == value:
                    found[(*where, course)] = value
    return found


_TEXT = """
NRC's study of detect and avoid for small aircraft (method of nrc-cnrc/daamsim; numbers of
lucaswarburton/daamsim2 @ 645992c, MIT) asks from which range on a turn still clears a disc of 500
ft: own speed 60 kt, bank 45°, roll rate 10°/s, no delay, straight collision courses from all
around. We fly them: a camera that sees all inside its range, `avoidance.turn_away` with
`bank_deg`, `roll_rate_deg_s` and `direction`, over the ellipsoid at 41° south
(`configs/published/least_range.toml`; a camera looks 20 times a second, the turn begins 1 ms
later, and its range is taken from the flights). By regula falsi over the camera's range the least
one is found at which the nearer of the two aircraft passes at 152.4 m.

What was chosen: turns by 90° to the better side, or by 60° from behind 140°, as theirs are
nowhere better than that. How theirs is counted is read off the numbers: every one is a whole
number of tenths of a second times the closing speed v, to 5 digits, if D²/(190 s · v) is taken
off for the disc; so ours are shown less that. Their search goes by {step:g} s, so *equal* is
within that time at closing speed. They are not at hand in the project; what stands here of them
is read where the page is made.

{table}

{counted} The largest difference is {largest:.2f} s of closing; ours are nearly everywhere the
larger ones, as their bank runs one step ahead.

From it the risk ratio of a camera of 60° by 1000 m, as they count: the share of courses, all
azimuths of their grid of 0.25° alike, that it does not lead out of; our ranges between azimuths
of 5° by straight lines.

{ratios}

At 175 and 185 kt the needed range is 1000 m for some azimuths but for a step of theirs, and
decides.

![Least range by azimuth; risk ratio over field of view and range](images/{figure})

`dsa-des study configs/studies/field_and_range.toml` flies the same question as a requirement map:
the risk ratio of NMAC over field of view and range, turn by turn, with intervals.
"""


def range_rows(found: dict[int, list[LeastRange]]) -> list[PublishedRow]:
    """Return the rows of the azimuths that are shown."""
    published = published_ranges()
    names = "", ", the slower course"
    return [
        PublishedRow(
            f"{kt} kt from {one.azimuth_deg:g}°{names[one.course]}",
            published[float(kt), one.azimuth_deg, one.course],
            one.published_m, "m", round(STEP_S * one.closing_mps, 1), digits=1,
        )
        for kt, ranges in found.items()
        for one in ranges
        if (kt, one.azimuth_deg, one.course) in published and one.azimuth_deg in SHOWN_DEG
    ]  # fmt: skip


def differences_s(found: dict[int, list[LeastRange]]) -> list[float]:
    """Return how much earlier than published our ownships must turn, s, over all azimuths."""
    published = published_ranges()
    return [
        (one.published_m - published[float(kt), one.azimuth_deg, one.course]) / one.closing_mps
        for kt, ranges in found.items()
        for one in ranges
        if (kt, one.azimuth_deg, one.course) in published
    ]


def section(images: Path) -> str:
    """Fly all speeds and return the section."""
    in_view = [azimuth for azimuth in AZIMUTHS_DEG if azimuth <= 30.0]
    found = {kt: least_ranges(kt, AZIMUTHS_DEG if kt in SHOWN_KT else in_view) for kt in RATIOS}
    off = differences_s(found)
    equal = sum(abs(one) <= STEP_S for one in off)
    ratios = [
        PublishedRow(f"risk ratio at {kt} kt", published, risk_ratio(found[kt], kt, 60.0, 1000.0),
                     within=5e-4, digits=4)
        for kt, published in RATIOS.items()
    ]  # fmt: skip
    _draw(images / FIGURE, found)
    counted = f"Of all {len(off)} azimuths and courses flown, {equal} are equal."
    return _TEXT.format(
        step=STEP_S, table=table(range_rows(found)), counted=counted,
        largest=max(map(abs, off)), ratios=table(ratios), figure=FIGURE,
    )  # fmt: skip


def _draw(path: Path, found: dict[int, list[LeastRange]]) -> None:
    published = published_ranges()
    with panels(path, 1, 2, width_in=9.0, height_in=3.8) as (ranges, ratios):
        for kt, colour in ((35, GREEN), (105, BLUE), (195, ORANGE)):
            theirs = [(a, r) for (v, a, c), r in sorted(published.items()) if v == kt and a > 0]
            ranges.plot(*zip(*theirs, strict=True), ".", color=GREY, markersize=1.5)
            for course in (0, 1):
                mine = [o for o in found[kt] if o.course == course]
                label = f"{kt} kt" if course == 0 else None
                ranges.plot([o.azimuth_deg for o in mine], [o.published_m for o in mine],
                            "o-", color=colour, markersize=3, label=label)  # fmt: skip
        ranges.set(xlabel="azimuth (°)", ylabel="least range (m)", title="flown; grey: published")
        ranges.legend()
        fields, reaches = np.arange(20.0, 361.0, 10.0), np.arange(200.0, 1501.0, 50.0)
        ratio = [[risk_ratio(found[105], 105, f, r) for f in fields] for r in reaches]
        lines = ratios.contour(fields, reaches, ratio, levels=[0.1, 0.3, 0.5, 0.7, 0.9])
        ratios.clabel(lines)
        ratios.set(xlabel="field of view (°)", ylabel="range (m)", title="risk ratio, 105 kt")
