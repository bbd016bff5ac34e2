"""DEGAS's encounter seen by noisy sensors: how its times and its least separation are spread."""

from pathlib import Path
from typing import Any

import numpy as np

import dsa_des
from components.arguments.units import FOOT_M
from components.thesis.drawing import GREY, draw_legend_below, panels_written_as_png
from dsa_des.block.mark import BLUE, GREEN, ORANGE, RED

STUDY, FIGURE = "degas_sensors", "degas_sensors.png"
#: Of the study as it is shipped.
SEEDS = 1000
#: By the study's axis: what it is called, and its colour.
SENSORS = {
    "radar": ("radar", BLUE),
    "active": ("active surveillance", ORANGE),
    "ads_b": ("ADS-B", GREEN),
    "eo_ir": ("EO/IR", RED),
}
#: Column, what it is, its factor, and what perfect surveillance gives.
SEEN = (
    ("first_alert_time_s.filter", "first alert, s", 1.0, 78.0),
    ("first_manoeuvre_time_s", "manoeuvre, s", 1.0, 97.0),
    ("closest_approach_m", "least separation, ft", 1.0 / FOOT_M, 3571.40),
)

_TEXT = """
**With the sensors of DO-365's appendix Q.** The same encounter, with `sensors/do365_radar`,
`do365_active`, `do365_ads_b` and `do365_eo_ir` instead of perfect surveillance, a Kalman filter
behind each, and all else as above; {seeds} seeds each{of_all}:

(`dsa-des study degas_sensors`, 4,000 runs, some 15 minutes on a core.)

![Distributions of first alert, manoeuvre and least separation](images/{figure})

Medians, and in brackets the middle 99 % of the runs:

{table}

Lines in the figure are the results of perfect surveillance.

**Comparison with DEGAS.** The same: errors, ranges, sectors and probabilities of an answer; exact
navigation; guidance once a second, with the same filter, pilot and turn behind it. Different: its
sensors are simulated ten times a second and passed on unchanged; ours look once a second, with a
tracker in between, which reduces noise and needs some looks. EO/IR reaches no more than 2.5 nmi;
the radar acquires this intruder at 3.8 nmi, well before an alert is due.

A manoeuvre comes later than without noise if the height of a track is wrong for a while: then the
level falls below corrective, and the pilot's delays start again.
"""


def quantiles(values: Any) -> tuple[float, float, float]:
    """Return the median and where the middle 99 % lie, of the runs that have a value."""
    there = np.asarray(values, dtype=float)
    low, middle, high = np.quantile(there[np.isfinite(there)], [0.005, 0.5, 0.995])
    return float(low), float(middle), float(high)


def lines(runs: Any) -> list[str]:
    """Return the table of a study's runs."""
    names = [name for _, name, _, _ in SEEN]
    found = [
        f"| surveillance | {' | '.join(names)} | without a manoeuvre |",
        "|---|---|---|---|---|",
    ]
    for key, (name, _) in SENSORS.items():
        mine = _of(runs, key)
        cells = []
        for column, _, factor, _ in SEEN:
            low, middle, high = quantiles(factor * mine[column])
            cells.append(f"{middle:,.0f} ({low:,.0f} to {high:,.0f})")
        never = int(np.isnan(mine["first_manoeuvre_time_s"]).sum())
        count = len(mine["first_manoeuvre_time_s"])
        found.append(f"| {name} | {' | '.join(cells)} | {never} of {count} |")
    return found


def _of(runs: Any, key: str) -> dict[str, Any]:
    chosen = runs["surveillance"].to_numpy(zero_copy_only=False) == key
    return {
        column: runs[column].to_numpy(zero_copy_only=False).astype(float)[chosen]
        for column, *_ in SEEN
    }


def draw(path: Path, runs: Any) -> None:
    """Draw the distributions."""
    with panels_written_as_png(path, 1, 3, width_in=9.6) as every:
        for axes, (column, name, factor, perfect) in zip(every, SEEN, strict=True):
            for key, (label, colour) in SENSORS.items():
                values = np.sort(factor * _of(runs, key)[column])
                values = values[np.isfinite(values)]
                share = np.arange(1, len(values) + 1) / len(values)
                axes.step(values, share, where="post", color=colour, label=label)
            axes.axvline(perfect, color=GREY, linestyle="--", label="perfect surveillance")
            axes.set_xlabel(name)
        every[0].set_ylabel("share of runs")
        draw_legend_below(every[0])


def text(images: Path, runs: Any = None) -> str:
    """Run the study, or take its runs, draw the figure and return the text."""
    if runs is None:
        runs = dsa_des.study(STUDY, replicas=SEEDS).runs
    draw(images / FIGURE, runs)
    count = runs.num_rows // len(SENSORS)
    of_all = "" if count == SEEDS else f" (the study as it is shipped has {SEEDS:,})"
    return _TEXT.format(
        seeds=f"{count:,}", of_all=of_all, figure=FIGURE, table="\n".join(lines(runs))
    )
