"""Fig. 4.14 over the flights that it may have been: where the EO camera joins, for each of them.

The thesis prints the range, 5.1 km, but neither the aircraft nor how far to the left and how high
it passes.
"""

from dataclasses import dataclass
from pathlib import Path

from components.thesis.made import Columns, Picture
from components.thesis.plotting import BLUE, GREEN, GREY, ORANGE, legend_below, panels
from components.thesis.printed import printed
from components.thesis.project_files import aircraft
from components.thesis.row import Row
from components.thesis.scene_run import run, scene

#: Aircraft of Table 3.1, by file.
AIRCRAFT = {"king_air": "King Air", "f_16": "F-16", "boeing_787": "Boeing 787"}
LEFT_M = (500, 1500, 3000)
ABOVE_M = (200, 400, 800)
#: Long enough for a Boeing 787 to leave the camera's reach.
_DURATION_S = 260


@dataclass(frozen=True)
class Overtaking:
    """One overtaking flight and the range within which the EO camera joins."""

    file: str
    left_m: int
    above_m: int
    joins_km: float


def flown() -> list[Overtaking]:
    """Run the scene fig_4_14 with every aircraft, to every side and at every height."""
    return [
        Overtaking(file, left, above, _joins_km(file, left, above))
        for file in AIRCRAFT
        for above in ABOVE_M
        for left in LEFT_M
    ]


def spread(flights: list[Overtaking]) -> tuple[list[Row], Picture, Columns]:
    """Return nearest and farthest range of each aircraft, the figure and its data."""
    text = printed("fig-4.14", "joins_km")
    where = (
        f"Passing {LEFT_M[0]} to {LEFT_M[-1]} m to the left, {ABOVE_M[0]} to {ABOVE_M[-1]} m above."
    )
    rows = []
    for file, name in AIRCRAFT.items():
        ranges = sorted(one.joins_km for one in flights if one.file == file)
        inside = ranges[0] <= float(text) <= ranges[-1]
        says = f"{where} The printed {text} km is {'within' if inside else 'outside'} this spread."
        rows += [
            Row(f"EO joins, {name}, nearest of {len(ranges)} flights", ranges[0], "km", says),
            Row(f"EO joins, {name}, farthest of {len(ranges)} flights", ranges[-1], "km", says),
        ]

    def draw(path: Path) -> None:
        with panels(path) as (axes,):
            for (file, name), colour in zip(AIRCRAFT.items(), (BLUE, ORANGE, GREEN), strict=True):
                for above, style in zip(ABOVE_M, ("o:", "s--", "^-"), strict=True):
                    shown = [f for f in flights if f.file == file and f.above_m == above]
                    axes.plot([f.left_m for f in shown], [f.joins_km for f in shown], style,
                              color=colour, markersize=4, linewidth=1.0,
                              label=f"{name}, {above} m above")  # fmt: skip
            axes.axhline(float(text), color=GREY, linewidth=1.2, label=f"thesis: {text} km")
            axes.set_xlabel("distance to the left at which the intruder passes [m]")
            axes.set_ylabel("range within which the EO joins [km]")
            axes.set(xlim=(0, 3500), ylim=(0, 14))
            legend_below(axes, 3)

    data = {
        "aircraft": [one.file for one in flights],
        "left_m": [one.left_m for one in flights],
        "above_m": [one.above_m for one in flights],
        "joins_km": [one.joins_km for one in flights],
    }
    caption = (
        "The range within which the EO camera joins, by aircraft and by the flight, none of which "
        "the thesis prints: what it prints is one line across all of them."
    )
    return rows, Picture("fig_4_14_flights", caption, draw), data


def _joins_km(file: str, left_m: int, above_m: int) -> float:
    intruder = "blocks.traffic.intruders.overtaking"
    areas = aircraft(file).eo.model_dump(exclude={"silhouette_table", "made_for"})
    done = run(
        scene(
            "thesis/fig_4_14",
            f"duration_s={_DURATION_S}",
            f"{intruder}.east_m={-left_m}",
            f"{intruder}.up_m={above_m}",
            *(f"{intruder}.eo.{name}={area}" for name, area in areas.items()),
        )
    )
    seen = done.rows("fused", block="fusion")
    return float(seen["true_range_m"][seen["angle_source"] == "eo"].max()) / 1000.0
