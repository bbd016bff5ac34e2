# ruff: noqa: E501 (the lines of a Markdown page)
"""Does an open tracker keep within DO-365's bounds of tracks? Errors by range over encounters."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import dsa_des
from components.arguments.units import FOOT_M, FOOT_PER_MINUTE_M_S, KNOT_M_S
from components.thesis.drawing import panels_written_as_png
from dsa_des.block.mark import BLUE, GREEN, ORANGE

TITLE = "Open trackers against DO-365's bounds"
ORDER = 2
STUDY = "do365_tracks"
FIGURE = "published_track_bounds.png"
RANGES_NMI = (1, 2, 3, 4, 5, 6)
TRACKERS = {"tracking.ekf": BLUE, "tracking.ukf": GREEN, "tracking.imm": ORANGE}

#: By sensor: result, what it is, unit, and the bound at a range of R nmi (Table 2-20 as quoted).
Bound = tuple[str, str, str, Callable[[float], float]]
BOUNDS: Mapping[str, tuple[Bound, ...]] = {
    "radar": (
        ("error_across_m", "across", "m", lambda r: (250 + 125 * (r - 1)) * FOOT_M),
        ("error_vertical_m", "in height", "m", lambda r: (150 + 100 * (r - 1)) * FOOT_M),
        ("error_horizontal_rate_m_s", "horizontal rate", "m/s", lambda r: (40 + 10 * r) * KNOT_M_S),
        ("error_vertical_rate_m_s", "vertical rate", "m/s",
         lambda r: (800 + 280 * (r - 1)) * FOOT_PER_MINUTE_M_S),
    ),
    "active surveillance": (
        ("error_horizontal_m", "horizontal", "m", lambda r: (1250 + 1000 * (r - 0.5)) * FOOT_M),
        ("error_horizontal_rate_m_s", "horizontal rate", "m/s",
         lambda r: (85 + 33 * (r - 0.5)) * KNOT_M_S),
    ),
    "ADS-B": (
        ("error_horizontal_m", "horizontal", "m", lambda _: 900 * FOOT_M),
        ("error_vertical_m", "in height", "m", lambda _: 300 * FOOT_M),
        ("error_horizontal_rate_m_s", "horizontal rate", "m/s", lambda _: 30 * KNOT_M_S),
        ("error_vertical_rate_m_s", "vertical rate", "m/s", lambda _: 400 * FOOT_PER_MINUTE_M_S),
    ),
}  # fmt: skip

Lines = dict[tuple[str, str, str], dict[str, Any]]


def lines_of(table: list[dict[str, Any]]) -> Lines:
    """Return the lines of a study's summary by tracker, sensor and result."""
    return {(row["swap.tracker"], row["sensor"], row["result"]): row for row in table}


def verdict(line: Mapping[str, Any], bound: float) -> str:
    """Return whether the interval of a quantile lies within a bound, beyond it, or about it."""
    if line["high"] <= bound:
        return "met"
    return "not met" if line["low"] > bound else "not shown"


def valid_at(lines: Lines, tracker: str, sensor: str) -> list[int]:
    """Return the ranges at which every bound is met."""
    return [
        r
        for r in RANGES_NMI
        if all(
            verdict(lines[tracker, sensor, f"{name}.{r}"], bound(r)) == "met"
            for name, _, _, bound in BOUNDS[sensor]
        )
    ]


def table(lines: Lines, tracker: str, sensor: str) -> str:
    """Return the table of one tracker: by range each quantile, its interval, and the bound."""
    heads = [f"{what}, {unit}" for _, what, unit, _ in BOUNDS[sensor]]
    rows = [f"| nmi | with a track | {' | '.join(heads)} |", f"|---|---|{'---|' * len(heads)}"]
    for r in RANGES_NMI:
        tracked = lines[tracker, sensor, f"tracked.{r}"]
        cells = [str(r), f"{100 * tracked['value']:.0f} % of {tracked['count']}"]
        for name, _, unit, bound in BOUNDS[sensor]:
            line, most = lines[tracker, sensor, f"{name}.{r}"], bound(r)
            d = 0 if unit == "m" else 1
            numbers = f"{line['value']:.{d}f} ({line['low']:.{d}f} to {line['high']:.{d}f})"
            said = verdict(line, most)
            cells.append(f"{numbers} of {most:.{d}f}" + f", **{said}**" * (said != "met"))
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def draw(lines: Lines, path: Path) -> None:
    """Draw the radar's quantiles over range beside the bounds."""
    with panels_written_as_png(path, 1, 4, width_in=10.5, height_in=3.2) as axes:
        for panel, (name, what, unit, bound) in zip(axes, BOUNDS["radar"], strict=True):
            for place, (tracker, colour) in enumerate(TRACKERS.items()):
                some = [lines.get((tracker, "radar", f"{name}.{r}")) for r in RANGES_NMI]
                if None in some:
                    continue
                x = np.array(RANGES_NMI) + 0.12 * (place - 1)
                value, low, high = (
                    np.array([line[k] for line in some if line is not None])
                    for k in ("value", "low", "high")
                )
                panel.errorbar(x, value, [value - low, high - value], fmt="o", ms=3, lw=1.2,
                               color=colour, label=tracker)  # fmt: skip
            panel.plot(RANGES_NMI, [bound(r) for r in RANGES_NMI], "k--", lw=1.2,
                       label="Table 2-20")  # fmt: skip
            panel.set_title(f"{what}, {unit}", loc="left")
            panel.set_xlabel("range, nmi")
            panel.set_ylim(bottom=0.0)
        axes[0].legend(loc="upper left")


def text_of(lines: Lines) -> str:
    """Return the text of the section."""
    known = list(dict.fromkeys((tracker, sensor) for tracker, sensor, _ in lines))
    runs = {
        sensor: line["count"] + line["missing"]
        for (_, sensor, result), line in lines.items()
        if result == "tracked.1"
    }
    said = ", ".join(f"{many:,} of {sensor}" for sensor, many in runs.items())
    parts = [_HEAD.format(runs=said, figure=FIGURE)]
    reach = [
        f"| {sensor} | `{tracker}` | {_ranges(valid_at(lines, tracker, sensor))} |"
        for tracker, sensor in sorted(known, key=lambda one: one[1])
    ]
    parts.append(
        "\n".join(["| sensor | tracker | all bounds met at, nmi |", "|---|---|---|", *reach])
    )
    for sensor in BOUNDS:
        # Trackers that agree to the last digit shown have one table.
        alike: dict[str, list[str]] = {}
        for tracker in TRACKERS:
            if (tracker, sensor) in known:
                alike.setdefault(table(lines, tracker, sensor), []).append(f"`{tracker}`")
        for text, trackers in alike.items():
            parts.append(f"**{sensor}, {' and '.join(trackers)}**\n\n{text}")
    return "\n\n".join([*parts, _TAIL])


def _ranges(found: list[int]) -> str:
    return ", ".join(map(str, found)) or "none"


def section(images: Path) -> str:
    """Run the study, draw its figure, and return the text of the section."""
    with tempfile.TemporaryDirectory() as folder:
        result = dsa_des.study(STUDY, out=Path(folder) / "study")
        lines = lines_of(result.summary.to_pylist())
    draw(lines, images / FIGURE)
    return text_of(lines)


_HEAD = """Appendix Q of RTCA DO-365 gives the errors of sensors, its Table 2-20 bounds for 95 % of the
errors of a track. `dsa-des study do365_tracks` flies encounters of a model (here {runs}), and
takes, in each, one sample at every nautical mile, from 30 s after the start on; an entry is the
95 % quantile over encounters, with its 95 % interval by order statistics, of the bound (`inf`: of
too few tracks there is no upper end).

![Quantiles of the radar's tracks over range, beside the bounds](images/{figure})"""

_TAIL = """**Choices.** The bounds are second hand: quoted in comments and constants of
[mit-ll/degas-core](https://github.com/mit-ll/degas-core) (`surveillanceLib/SC228_SensorModels`,
X11); of the radar 125 (R - 1) + 250 ft across, 100 (R - 1) + 150 ft in height, 10 (R - 1) + 50 kt
and 280 (R - 1) + 800 ft/min. "Cross-track" is taken as across the line of sight, in the
horizontal. The ownship's position error is left out; its attitude has errors. The encounters are
of our made-up airspace (`light_aircraft.txt`). The radar acquires slow targets and those off the
nose later, so that at 5 and 6 nmi many have no track yet.

One key of the trackers is set, for all of them: a new track may climb at 10 m/s (1 sigma, 2,000
ft/min: `start_climb_m_s`), whereas by default it is assumed to climb as fast as aircraft fly, 70
m/s. Those of the model climb at 900 ft/min at most. It matters at 6 nmi, at which a track is some
looks old and an elevation of 1 degree is 190 m.

**Possible improvements.** Interacting models treat manoeuvres as noise in turns only, which helps
at close range. Active surveillance's bearings err by 9 degrees: positions improve only with many
looks."""
