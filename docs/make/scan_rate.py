"""``python -m docs.make.scan_rate docs/scan-rate.md``: make the page and its figures."""

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from components.thesis.drawing import GREY, RADAR, draw_legend_below, panels_written_as_png
from docs.make.declaration_ranges import (
    HeadOn,
    certain_range_m,
    fading_section,
    in_km,
    known_snr_at_1_m,
    mean_range_m,
    ranges_of_declaration,
)
from docs.make.stamp import stamped
from dsa_des.block.mark import BLUE, PINK
from dsa_des.files.output_file import write_file
from dsa_des.library.study import StudyResult, study
from dsa_des.scene.examples import find_example
from dsa_des.scene.scene import Scene
from dsa_des.studies.study import changed_scene
from dsa_des.studies.study_file import read_study
from dsa_des.terminal.interruption import exit_plainly_on_signal

STUDY = "radar_dwell"
FIGURE = "scan_rate.png"
M, N = 3, 5
CERTAIN = 0.95
_TICKS_HZ = (0.1, 0.2, 0.5, 1, 2, 5)

_HEAD = """# Choosing a scan rate

How often should a radar scan?

> `dsa-des study radar_dwell`

![Range of declaration over scan rate, free and with a budget of time](images/{figure})

In the thesis a faster scan costs nothing: every look has the same energy, and the fastest declares
an intruder farthest out. A real beam points in one direction at a time. With beamwidths, a PRF and
`budget = "dwell"` each of a scan's beams gets the time that the scan leaves for it (`T = beams ·
dwell`), and the energy of a look follows from its pulses. Without beamwidths, PRF and dwell a scan
stays free; with beams and dwell but no `budget`, a scan rate that does not fit is refused:

```text
scan_rate_hz = 2: 38 x 7 beams of 0.003759 s (its dwell) take 1 s, and a scan has 0.5 s; it must be
at most 1, or budget 'free' for a scan without cost
```

The study takes the thesis's radar (5 pulses a beam at 1 Hz) and a small aircraft head-on, which
comes nearer at {closing} m/s. It is declared after {m} detections in {n} looks. Points are
{replicas} runs each with their 95 % intervals; lines are computed from Pd alone
(`docs/make/declaration_ranges.py`), without a run.

"""

_WHY = """
**The optimum.** {first} {second} {third}

Declaration by 95 % is relevant for keeping well clear; the mean has its optimum at {mean_best} Hz.
A single detection needs no second look, so its own optimum lies below 0.1 Hz, where the target
comes nearer by a tenth of its range between looks (Mallett & Brennan, Proc. IEEE 51(4), 1963).
Pulses that are summed in power (`integration = "noncoherent"`, dotted) gain less from a
longer look, so that the best rate is higher.
"""


def page(images: Path) -> str:
    """Run the study, draw the figure and return the page."""
    result = study(STUDY)
    found = simulated(result)
    approach = approach_of(study_scene())
    rates = sorted({rate for _, rate in found})
    draw(images / FIGURE, found, approach, rates)
    count = len(next(iter(found.values())))
    text = _HEAD.format(
        closing=f"{approach.closing_m_s:g}", m=M, n=N, replicas=count, figure=FIGURE
    )
    text += "\n".join(table(found, approach, rates)) + "\n"
    return text + _explained(approach) + fading_section(images, approach, M, N, CERTAIN)


def simulated(result: StudyResult) -> dict[tuple[str, float], Any]:
    """Return (budget, scan rate) → range of declaration of each run, m; NaN where there is none."""
    runs = result.runs.to_pydict()
    found: dict[tuple[str, float], list[float]] = {}
    for budget, rate, range_m in zip(
        runs["radar.budget"],
        runs["radar.scan_rate_hz"],
        runs["declaration_range_m.radar"],
        strict=True,
    ):
        of = found.setdefault((budget, float(rate)), [])
        of.append(math.nan if range_m is None else range_m)
    return {key: np.array(ranges) for key, ranges in found.items()}


def study_scene() -> Scene:
    """Return the study's scene, before any axis changes it."""
    path = find_example(STUDY, "study")
    assert path is not None
    described = read_study(path)
    return changed_scene(described.base, described.swaps, described.sets, str(path))


def approach_of(scene: Scene) -> HeadOn:
    """Return the encounter of the study, from its scene's own numbers."""
    radar: Any = scene.blocks["radar"].parameters
    traffic: Any = scene.blocks["traffic"].parameters
    duration_s = 0.0 if scene.duration_s is None else float(scene.duration_s)
    target = next(one for one in traffic.intruders if one.name == "head_on")
    closing = traffic.ownship.speed_mps + target.speed_mps
    away_m = math.hypot(target.east_m, target.north_m, target.up_m)
    return HeadOn(
        known_snr_at_1_m(
            rcs_dbsm=radar.calibrate.rcs_dbsm,
            range_m=1000.0 * radar.calibrate.range_km,
            pd=radar.calibrate.pd,
            false_alarm_probability=radar.calibrated_pfa,
            of_dbsm=target.rcs_dbsm,
        ),
        radar.pulses_per_dwell,
        closing,
        away_m,
        away_m - closing * duration_s,
        radar.false_alarm_probability,
    )


def of_budget(
    approach: HeadOn, budget: str, rate_hz: float, m: int = M, n: int = N
) -> tuple[Any, Any]:
    """Return ranges and probabilities with a free scan, or what the scan leaves of 5 pulses."""
    pulses = approach.pulses
    if budget != "free":
        pulses = math.floor(pulses / rate_hz + 1e-9)
    return ranges_of_declaration(
        approach, rate_hz, m, n, pulses=pulses, summed=budget == "noncoherent"
    )


def best_rate(
    approach: HeadOn, value: Callable[[Any, Any], float], budget: str = "dwell"
) -> tuple[float, float]:
    """Return the scan rate at which a range is largest, of 5 Hz over whole numbers, and that."""
    rates = [approach.pulses / pulses for pulses in range(1, 61)]
    ranges = [value(*of_budget(approach, budget, rate)) for rate in rates]
    best = int(np.nanargmax(ranges))
    return rates[best], ranges[best]


def _certain(range_m: Any, probability: Any) -> float:
    return certain_range_m(range_m, probability, CERTAIN)


def table(found: dict[tuple[str, float], Any], approach: HeadOn, rates: list[float]) -> list[str]:
    """Return the lines of the table: range declared by 95 % and on average, run and computed."""
    lines = [
        "| scan rate, Hz | pulses | free: 95 %, km | computed | mean | with a budget: 95 %, km "
        "| computed | mean | computed |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for rate in rates:
        cells = [f"{rate:.3g}", f"{math.floor(approach.pulses / rate + 1e-9)}"]
        for budget in ("free", "dwell"):
            expected = of_budget(approach, budget, rate)
            cells += [in_km(_certain_of(found[budget, rate])), in_km(_certain(*expected)),
                      in_km(float(np.nanmean(found[budget, rate])))]  # fmt: skip
            if budget == "dwell":
                cells.append(in_km(mean_range_m(*expected)))
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _certain_of(ranges_m: Any) -> float:
    """Return the range by which 95 % of runs have declared; NaN if fewer ever do."""
    return float(np.sort(np.nan_to_num(ranges_m))[math.floor((1 - CERTAIN) * len(ranges_m))])


def _explained(approach: HeadOn) -> str:
    rate, range_m = best_rate(approach, _certain)
    mean_rate, _ = best_rate(approach, mean_range_m)
    scan_m = approach.closing_m_s / rate
    return _WHY.format(
        first=f"With a budget, {CERTAIN:.0%} of the intruders are declared by "
        f"{range_m / 1000:.2f} km at {rate:.2g} Hz, and nearer at any other rate.",
        second="Faster, each look has less energy in proportion, and more looks of a target that "
        f"has hardly come nearer do not make up for it: {M} detections of {N} want a high Pd, "
        "which falls steeply with SNR.",
        third=f"Slower, looks are strong but few: {M} of {N} take at least {M - 1} scans, in which "
        f"the intruder comes {(M - 1) * scan_m / 1000:.1f} km nearer at {rate:.2g} Hz and "
        f"{(M - 1) * approach.closing_m_s / 0.1 / 1000:.1f} km at 0.1 Hz, and a fade costs another "
        "scan.",
        mean_best=f"{mean_rate:.2g}",
    )


def draw(
    path: Path, found: dict[tuple[str, float], Any], approach: HeadOn, rates: list[float]
) -> None:
    """Draw ranges over scan rate: on average, and declared by 95 %."""
    fine = [approach.pulses / pulses for pulses in range(1, 51)]
    with panels_written_as_png(path, 1, 2, sharex=True) as (left, right):
        for axes, value, title in (
            (left, mean_range_m, "mean"),
            (right, _certain, f"declared by {CERTAIN:.0%}"),
        ):
            for budget, colour, style, label in (
                ("free", GREY, "-", "free scan (thesis)"),
                ("dwell", RADAR, "-", "budget of time"),
                ("noncoherent", PINK, ":", "budget, pulses summed in power"),
            ):
                ranges = [value(*of_budget(approach, budget, rate)) / 1000 for rate in fine]
                axes.plot(fine, ranges, style, color=colour, linewidth=1.2, label=label)
            rate, range_m = best_rate(approach, value)
            axes.plot([rate], [range_m / 1000], "*", color=BLUE, markersize=11, label="optimum")
            axes.set_xscale("log")
            axes.set_title(title, fontsize=10)
            axes.set_xlabel("scan rate, Hz")
            axes.set_xticks(_TICKS_HZ, [f"{tick:g}" for tick in _TICKS_HZ])
            axes.set_xticks([], minor=True)
        left.set_ylabel("range of declaration, km")
        for budget, colour in (("free", GREY), ("dwell", RADAR)):
            for rate in rates:
                ranges = found[budget, rate] / 1000
                there = ranges[~np.isnan(ranges)]
                half = 1.96 * float(np.std(there, ddof=1)) / math.sqrt(len(there))
                left.errorbar([rate], [np.mean(there)], [half], fmt="s", color=colour, ms=3.5)
                low, middle, high = _quantile_interval(found[budget, rate] / 1000)
                if low > 0:
                    right.errorbar(
                        [rate], [middle], [[middle - low], [high - middle]], fmt="s",
                        color=colour, ms=3.5,
                    )  # fmt: skip
        for axes in (left, right):
            axes.set_ylim(0, None)
        draw_legend_below(left, 2)


def _quantile_interval(ranges: Any) -> tuple[float, float, float]:
    """Return the range declared by 95 %, between the ends of its interval (order statistics)."""
    ordered = np.sort(np.nan_to_num(ranges))
    count, share = len(ordered), 1.0 - CERTAIN
    spread = 1.96 * math.sqrt(count * share * CERTAIN)
    places = [count * share + step for step in (-spread, 0.0, spread)]
    low, middle, high = (ordered[min(max(int(place), 0), count - 1)] for place in places)
    return float(low), float(middle), float(high)


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.scan_rate",
        description="Run the study of scan rates and write its page; figures go to images/.",
    )
    parser.add_argument("page", type=Path)
    target = parser.parse_args(arguments).page
    text = page(target.parent / "images")
    write_file(target, stamped(text, "python -m docs.make.scan_rate docs/scan-rate.md").encode())
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
