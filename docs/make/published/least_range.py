"""NRC's least range of detection by azimuth, and the risk ratio that follows, from flights.

``python -m docs.make.published.least_range SPEED_KT [AZIMUTH_DEG ...]`` prints those of one speed.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from components.arguments.units import KNOT_M_S
from components.thesis.drawing import GREY, panels_written_as_png
from docs.make.published.rows import PublishedRow, table
from docs.make.published.turn_flights import (
    LeastRange,
    closing_speeds,
    counted_m,
    least_ranges,
    turns_deg,
)
from docs.make.published.turn_geometry import least_range_m
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import BLUE, GREEN, ORANGE
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

TITLE = "The least range of detection, and its risk ratio"
ORDER = 3
FIGURE = "published_least_range.png"
DATA = Path(__file__).parents[4] / "shared" / "data" / "published" / "nrc_min_range"

#: Their search ends at instants 0.186 s apart, each to the next tenth of a second.
STEP_S = 0.2
# By what rounding their angles to 0.01 deg may move a range.
_ROUNDED_S = 5e-4
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


@dataclass(frozen=True)
class GridCourses:
    """The collision courses of the publication's grid of azimuths, and what each of them needs."""

    azimuth_deg: FloatArray
    flown_m: FloatArray
    #: As the publication would step, search and count it; and how far a step of its search is.
    counted_m: FloatArray
    step_m: FloatArray

    def risk_ratio(
        self, field_deg: float, range_m: float, *, steps_more: float = 0.0, as_flown: bool = False
    ) -> float:
        """Return the share of courses that a camera's turns do not lead out of.

        As the publication counts: courses from every azimuth alike; needed ranges as its search
        finds them, or so many of its steps longer, or as they are flown.
        """
        needed_m = self.flown_m if as_flown else self.counted_m + steps_more * self.step_m
        seen = self.azimuth_deg <= 0.5 * field_deg
        return 1.0 - float((seen & (needed_m < range_m)).mean())


def grid_courses(found: list[LeastRange], intruder_kt: float) -> GridCourses:
    """Return what all courses of the grid need, by flights from some of its azimuths.

    Between these azimuths what flights need more than geometry goes along straight lines; courses
    of which none was flown are not led out of.
    """
    rows = []
    for course in (0, 1):
        mine = [one for one in found if one.course == course]
        at_deg = np.array([one.azimuth_deg for one in mine])
        off_m = np.array([one.range_m - one.geometry_m for one in mine])
        for azimuth in np.arange(GRID_DEG, 180.0, GRID_DEG).tolist():
            closing = closing_speeds(azimuth, intruder_kt * KNOT_M_S)
            if len(closing) <= course:
                continue
            speed, flown_m, needed_m = closing[course], math.inf, math.inf
            if mine:
                more_m = float(np.interp(azimuth, at_deg, off_m))
                flown_m = least_range_m(azimuth, speed, turns_deg(azimuth)) + more_m
                needed_m = counted_m(azimuth, speed, more_m)
            rows.append((azimuth, flown_m, needed_m, STEP_S * speed))
    return GridCourses(*np.array(rows).T)


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
lucaswarburton/daamsim2 @ 645992c, MIT) determines the range from which a turn still clears a disc
of 500 ft: own speed 60 kt, bank 45°, roll rate 10°/s, no delay, straight collision courses from
all directions. We fly them: a camera that detects everything inside its range,
`avoidance.turn_away` with `bank_deg`, `roll_rate_deg_s` and `direction`, over the ellipsoid at
41° south (`configs/published/least_range.toml`; a camera looks 20 times a second, the turn begins
1 ms later, and its range is taken from the flights). By regula falsi over the camera's range the
least one is found at which the nearer of the two aircraft passes at 152.4 m. Any other speed:
`python -m docs.make.published.least_range SPEED_KT`.

**Origin of the differences.** The same turn in closed form over a flat Earth
(`docs/make/published/turn_geometry.py`: heading from the logarithm of cos p t, the latest range
as the largest root over all times) gives our flown ranges to {geometry_m:.2f} m and
{geometry_s:.4f} s of closing, at all {number} azimuths and courses. So the remaining differences
are in their stepping, search and counting. From the open code: they begin 190 s before the
collision, go by 0.1 s, and a turn that they count from t begins with the state two steps before;
the bank of a step is that of its end; they take D²/(190 s · v) less than the range. From the
numbers: every published range is that of an instant to which ten halvings of the 190 s lead, to
the next tenth of a second, 0.186 s apart; a turn ends before the step that would go beyond it.
Counted so (`stepped_least_range_m`, `as_searched_m`), geometry alone gives {stepped} of the
{every:,} published ranges to the digit, and the others to {most_s:.2f} s. So the page shows our
ranges as they would count them: the excess of our flights over geometry, {geometry_m:.2f} m at
most, is added to the stepped turn before the search. *Equal* is within one step of it, {step:g} s
at closing speed. As flown, ours differ by {longer_low:+.2f} to {longer_high:+.2f} s.

Choices: turns by 90° to the better side; from behind 140° also by 30°, 45°, 60° and 75°, since
theirs are better there than turns by 90°: an aircraft a little faster than the ownship (61 to
85 kt) is let by with less. Their numbers are not part of the project; those shown here are
read when the page is made.

{table}

{counted} The largest difference is {largest:.2f} s of closing; {same} are the same number.

From it the risk ratio of a camera of 60° by 1000 m, as they count: the share of courses, with
equal weight for all azimuths of their grid of 0.25°, that it does not resolve; the excess of our
flights over geometry is interpolated linearly between azimuths of 5°. In brackets: with all
ranges one of their steps shorter, or longer.

{ratios}

None of these ratios was used to infer their counting. At 175 and 185 kt the needed range is 1000
m to within a step of theirs throughout the field of a camera of 60°, so their steps decide: for
ranges as flown the ratios there are {exactly}. One azimuth of the grid is 0.0014, and at each of
these speeds one turns on less than 0.2 m. For geometry alone, counted in the same way, the ratios
of the table are {alone}.

![Least range by azimuth; risk ratio over field of view and range](images/{figure})

`dsa-des study field_and_range` flies the same question as a requirement map:
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
            one.published_m, "m", math.ceil(10.0 * (STEP_S + _ROUNDED_S) * one.closing_mps) / 10.0,
            digits=1,
        )
        for kt, ranges in found.items()
        for one in ranges
        if (kt, one.azimuth_deg, one.course) in published and one.azimuth_deg in SHOWN_DEG
    ]  # fmt: skip


def differences_s(found: dict[int, list[LeastRange]], *, as_flown: bool = False) -> list[float]:
    """Return how much longer than published ours are, s of closing, as searched or as flown."""
    published = published_ranges()
    return [
        ((one.flown_to_disc_m if as_flown else one.published_m) - theirs_m) / one.closing_mps
        for kt, ranges in found.items()
        for one in ranges
        if (theirs_m := published.get((float(kt), one.azimuth_deg, one.course))) is not None
    ]


def by_geometry(intruder_kt: float) -> list[LeastRange]:
    """Return least ranges of one azimuth's courses that need what geometry says, unflown."""
    azimuth = AZIMUTHS_DEG[0]
    closing = closing_speeds(azimuth, intruder_kt * KNOT_M_S)
    return [
        LeastRange(azimuth, course, speed, least_range_m(azimuth, speed, turns_deg(azimuth)))
        for course, speed in enumerate(closing)
    ]


def counted_alike() -> tuple[int, int, float]:
    """Return how many published ranges geometry alone gives, of how many, and to how many seconds.

    Of one side, as both are alike. An instant of their search is a tenth of a second, so whatever
    differs by less than a hundredth is the same one.
    """
    off = [
        (counted_m(azimuth, closing[course], 0.0) - theirs_m) / closing[course]
        for (kt, azimuth, course), theirs_m in published_ranges().items()
        if 0.0 < azimuth < 180.0 and len(closing := closing_speeds(azimuth, kt * KNOT_M_S)) > course
    ]
    return sum(abs(one) < 0.01 for one in off), len(off), max(map(abs, off))


def section(images: Path) -> str:
    """Fly all speeds and return the section."""
    in_view = [azimuth for azimuth in AZIMUTHS_DEG if azimuth <= 30.0]
    found = {kt: least_ranges(kt, AZIMUTHS_DEG if kt in SHOWN_KT else in_view) for kt in RATIOS}
    flown = [one for ranges in found.values() for one in ranges]
    off_m = [abs(one.range_m - one.geometry_m) for one in flown]
    off_s = [off / one.closing_mps for off, one in zip(off_m, flown, strict=True)]
    off, longer = differences_s(found), differences_s(found, as_flown=True)
    equal = sum(abs(one) < STEP_S + _ROUNDED_S for one in off)
    _draw(images / FIGURE, found)
    courses = {kt: grid_courses(ranges, kt) for kt, ranges in found.items()}
    exact = [f"{courses[kt].risk_ratio(60.0, 1000.0, as_flown=True):.4f}" for kt in (175, 185)]
    stepped, every, most_s = counted_alike()
    alone = [grid_courses(by_geometry(kt), kt).risk_ratio(60.0, 1000.0) for kt in RATIOS]
    return _TEXT.format(
        stepped=f"{stepped:,}", every=every, most_s=most_s,
        alone=", ".join(f"{ratio:.4f}" for ratio in alone),
        step=STEP_S, table=table(range_rows(found)), number=len(flown), geometry_m=max(off_m),
        geometry_s=max(off_s), longer_low=min(longer), longer_high=max(longer),
        counted=f"Of all {len(off)} azimuths and courses that are published, {equal} are equal.",
        same=sum(abs(one) < 1e-3 for one in off), largest=max(map(abs, off)),
        ratios=table(ratio_rows(courses)), exactly=" and ".join(exact), figure=FIGURE,
    )  # fmt: skip


def ratio_rows(courses: dict[int, GridCourses]) -> list[PublishedRow]:
    """Return the rows of the risk ratios."""
    return [
        PublishedRow(
            f"risk ratio at {kt} kt", published, courses[kt].risk_ratio(60.0, 1000.0),
            within=5e-4, digits=4,
            interval=(courses[kt].risk_ratio(60.0, 1000.0, steps_more=-1.0),
                      courses[kt].risk_ratio(60.0, 1000.0, steps_more=1.0)),
        )
        for kt, published in RATIOS.items()
    ]  # fmt: skip


def _draw(path: Path, found: dict[int, list[LeastRange]]) -> None:
    published = published_ranges()
    with panels_written_as_png(path, 1, 2, width_in=9.0, height_in=3.8) as (ranges, ratios):
        for kt, colour in ((35, GREEN), (105, BLUE), (195, ORANGE)):
            theirs = [(a, r) for (v, a, c), r in sorted(published.items()) if v == kt and a > 0]
            ranges.plot(*zip(*theirs, strict=True), ".", color=GREY, markersize=1.5)
            for course in (0, 1):
                mine = [o for o in found[kt] if o.course == course]
                label = f"{kt} kt" if course == 0 else None
                ranges.plot([o.azimuth_deg for o in mine], [o.range_m for o in mine],
                            "o-", color=colour, markersize=3, label=label)  # fmt: skip
        ranges.set(xlabel="azimuth (°)", ylabel="least range (m)", title="flown; grey: published")
        ranges.legend()
        fields, reaches = np.arange(20.0, 361.0, 10.0), np.arange(200.0, 1501.0, 50.0)
        needed = grid_courses(found[105], 105)
        ratio = [[needed.risk_ratio(f, r) for f in fields] for r in reaches]
        lines = ratios.contour(fields, reaches, ratio, levels=[0.1, 0.3, 0.5, 0.7, 0.9])
        ratios.clabel(lines)
        ratios.set(xlabel="field of view (°)", ylabel="range (m)", title="risk ratio, 105 kt")


def main(arguments: list[str] | None = None) -> None:
    """Print the least ranges of one speed, and the risk ratio of a camera."""
    parser = argparse.ArgumentParser(description="Least ranges of detection against one speed.")
    parser.add_argument("speed_kt", type=float)
    parser.add_argument("azimuth_deg", type=float, nargs="*", default=list(AZIMUTHS_DEG))
    parser.add_argument("--field-deg", type=float, default=60.0)
    parser.add_argument("--range-m", type=float, default=1000.0)
    given = parser.parse_args(arguments)
    found = least_ranges(given.speed_kt, sorted(given.azimuth_deg))
    say("azimuth deg, course, closing m/s, flown m, in closed form m, as NRC searches m")
    for one in found:
        say(f"{one.azimuth_deg:g}, {one.course}, {one.closing_mps:.4f}, {one.range_m:.1f}, "
            f"{one.geometry_m:.1f}, {one.published_m:.1f}")  # fmt: skip
    courses = grid_courses(found, given.speed_kt)
    ratio = courses.risk_ratio(given.field_deg, given.range_m)
    say(f"risk ratio of {given.field_deg:g} deg by {given.range_m:g} m: {ratio:.4f}")


if __name__ == "__main__":
    with exit_plainly_on_signal():
        main()
