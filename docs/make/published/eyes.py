"""Eyes: Morris's table of who sees in time, and what pilots who look out leave of the risk."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import dsa_des
from components.visual.acquisition import VISUAL_RANGE_DEPTH, closing_opportunity, round_share
from components.well_clear.volume import FOOT_M, NAUTICAL_MILE_M
from docs.make.published.rows import PublishedRow, table

TITLE = "Eyes: the human baseline"
ORDER = 5
SCENE = "published/see_and_avoid"
CREWED = (Path(__file__).parents[4] / "shared" / "data" / "encounters" / "models"
          / "uncor_1200code_v1.txt")  # fmt: skip
KT_MPS = NAUTICAL_MILE_M / 3600.0
#: Probability to see and avoid an aircraft of 40 ft by closing speed in kt, of an observer who
#: scans all, two thirds and a third of the time (Morris 2005, abstract).
MORRIS = {200: (0.91, 0.60, 0.30), 300: (0.49, 0.32, 0.16), 400: (0.28, 0.18, 0.09),
          500: (0.15, 0.10, 0.05)}  # fmt: skip
SHARES = {"all the time": 1.0, "two thirds of it": 2.0 / 3.0, "a third of it": 1.0 / 3.0}
#: What gives that table: see the text.
SIZE_FT, SMALLEST_ARCMIN, ROUND_S, NEEDED_S = 40.0, 9.0, 36.0, 12.5
RUNS, ENCOUNTERS = 1000, 800
#: Risk ratios of NMAC and loss of well clear, of one pilot who looks and of both aircraft's.
ONE, BOTH = (0.625, 0.746), (0.331, 0.596)
_FROM_M = 6000.0


def in_closed_form(speed_kt: float, looking: float, size_ft: float = SIZE_FT) -> float:
    """Return the probability to see an aircraft in time, of a search that comes round."""
    speed = speed_kt * KT_MPS
    shown_m = size_ft * FOOT_M / math.radians(SMALLEST_ARCMIN / 60.0)
    return round_share(
        speed, from_m=shown_m, to_m=NEEDED_S * speed, round_s=ROUND_S, looking=looking
    )


def by_rate(speed_kt: float, area_ft2: float, visual_range_nmi: float) -> float:
    """Return the same by Andrews's rate, of one who looks out all the time."""
    speed = speed_kt * KT_MPS
    return -math.expm1(
        -closing_opportunity(
            area_ft2 * FOOT_M**2, speed, from_m=math.inf, to_m=NEEDED_S * speed,
            extinction_per_m=VISUAL_RANGE_DEPTH / (visual_range_nmi * NAUTICAL_MILE_M),
        )
    )  # fmt: skip


def course(speed_kt: float, looking: float, size_ft: float = SIZE_FT) -> dict[str, Any]:
    """Return a scene of two aircraft that fly at each other until it is too late to avoid."""
    speed = speed_kt * KT_MPS
    disc_m2 = math.pi / 4.0 * (size_ft * FOOT_M) ** 2
    blocks = {
        "traffic": {
            "type": "traffic.scripted",
            "ownship": {"lat_deg": 41.0, "lon_deg": -88.0, "alt_m": 1500.0, "heading_deg": 0.0,
                        "speed_mps": 0.5 * speed},
            "intruders": [{
                "name": "a", "east_m": 0.0, "north_m": _FROM_M,
                "up_m": -(_FROM_M**2) / 2.0 / 6.37e6, "heading_deg": 180.0,
                "speed_mps": 0.5 * speed,
                "eo": {"front_m2": disc_m2, "side_m2": 0.0, "horizontal_m2": 0.0},
            }],
        },
        "transform": {"type": "geometry.ellipsoid"},
        "gate": {"type": "gate"},
        "pilot": {
            "type": "visual.acquisition", "scan_rate_hz": 4, "search": "round",
            "round_s": ROUND_S, "smallest_arcmin": SMALLEST_ARCMIN, "looking": "spells",
            "left_looking": looking,
        },
    }  # fmt: skip
    return {
        "duration_s": round(_FROM_M / speed - NEEDED_S + 0.01, 3), "seed": 5,
        "wires": ["traffic -> transform -> gate -> pilot"], "blocks": blocks,
    }  # fmt: skip


def flown(speed_kt: float, looking: float, runs: int = RUNS) -> tuple[float, float, float]:
    """Return the share of runs in which the aircraft is seen in time, with its interval."""
    scene = course(speed_kt, looking)
    found = dsa_des.study(scene, metrics=["first_detection"], replicas=runs, seed=11, workers=1)
    (row,) = [r for r in found.summary.to_pylist() if r["result"] == "detected.pilot"]
    return row["value"], row["low"], row["high"]


def morris_rows(runs: int = RUNS) -> list[PublishedRow]:
    """Return the rows of Morris's table: closed form, with the interval of the flights."""
    rows = []
    for speed_kt, published in MORRIS.items():
        for (said, looking), number in zip(SHARES.items(), published, strict=True):
            _, low, high = flown(speed_kt, looking, runs)
            rows.append(PublishedRow(
                f"{speed_kt} kt, looks out {said}", number, in_closed_form(speed_kt, looking),
                within=0.01, interval=(low, high),
            ))  # fmt: skip
    return rows


def risk_rows(
    model: Path, encounters: int = ENCOUNTERS, workers: int | None = None
) -> list[PublishedRow]:
    """Return the rows of the risk ratios that one pilot leaves, and two as if independent."""
    scene = dsa_des.load_scene(SCENE, sets=[f"blocks.traffic.file={model}"])
    found = dsa_des.study(
        scene, metrics=[{"metric": "risk_ratio", "by": []}], replicas=encounters, seed=1,
        workers=workers,
        draws={"blocks.traffic.encounter": {"sequence": [0, 1]}},
    )  # fmt: skip
    rows = {row["result"]: row for row in found.summary.to_pylist()}
    lines, squares = [], []
    for event, said, one, both in zip(
        ("nmac", "well_clear_lost"), ("NMAC", "loss of well clear"), ONE, BOTH, strict=True
    ):
        row = rows[f"{event}_risk_ratio"]
        ratio, ends = row["value"], (row["low"], row["high"])
        lines.append(PublishedRow(f"{said}, one pilot looks", one, ratio, interval=ends))
        squared = ends[0] ** 2, ends[1] ** 2
        squares.append(PublishedRow(f"{said}, both look", both, ratio**2, interval=squared))
    return [*lines, *squares]


_TEXT = """
**Who sees in time.** C. C. Morris (*Midair collisions: limitations of the see-and-avoid concept
in civil aviation*, Aviation, Space, and Environmental Medicine 76, 2005; the abstract is open,
the text is not) gives upper bounds of the probability to see and avoid a converging aircraft of
40 ft. Its numbers are no Poisson search: two thirds of the time are worth two thirds of the
*probability*, where a rate would give more, and over closing speed V they fall as a/V - b. That
is a search that comes round once in T and must meet the aircraft between the range at which it
shows and t before the collision: P = (R/V - t)/T. The table fixes R/T and t/T alone. We took t =
12.5 s (FAA AC 90-48, to recognise and act), which leaves T = 36 s and R = 2.51 nmi, where 40 ft
are 9': 36 looks of a second, as over 180° by 20° in steps of 10°. T and R are read off this
table, then, not known beforehand; 12 numbers follow from two. `visual.acquisition` with `search =
"round"`, `looking = "spells"`; the number is the closed form, in brackets 95 % of {runs:,}
flights each.

{morris}

Published numbers are of two places, cut off ("less than"). Andrews's rate (β = 17,000 per
steradian and second, haze of 2.996 over the visual range) does not give this table with any area
and visual range: the nearest, 420 ft² and 6.2 nmi, has {rates} at 200, 300, 400 and 500 kt.

**What eyes leave of the risk.** Published with an updated model of Andrews: 0.625 of NMAC and
0.746 of losses of well clear if one pilot looks out, 0.331 and 0.596 if both do. Ours:
{encounters:,} weighted encounters of two aircraft of MIT Lincoln Laboratory's uncorrelated model
(`uncor_1200code_v1`, BSD-2, not part of the project), a pilot on the left by Andrews's rate in
clear air, the other as large as a Cessna 172, turns by DAIDALUS 5 s after an alert of whom he has
seen for 5 s (`configs/published/see_and_avoid.toml`; `dsa-des study see_and_avoid_risk` with a
made-up airspace). Both looking is not flown, as only the ownship is steered: it is the square of
one, as if they failed independently.

{risk}

Not open to us: what the published pilots do once they see, their encounters and their well clear.
Ours judges range and speed exactly, which pilots do not.
"""


def section(images: Path) -> str:
    """Fly the table and the encounters and return the section."""
    rates = [f"{by_rate(kt, 420.0, 6.2):.2f}" for kt in MORRIS]
    return _TEXT.format(
        runs=RUNS, encounters=ENCOUNTERS, morris=table(morris_rows()),
        rates=", ".join(rates[:-1]) + " and " + rates[-1], risk=table(risk_rows(CREWED)),
    )  # fmt: skip
