"""Ranges of first detection and declaration head-on: computed, and drawn where fades last."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.detection import detection_probability, first_declaration_probability
from components.thesis.drawing import GREY, draw_legend_below, panels_written_as_png
from dsa_des.block.mark import BLUE, GREEN
from dsa_des.library.study import study

# Phases of the scan clock against the encounter; more change no digit that is shown.
_PHASES = 32


@dataclass(frozen=True)
class HeadOn:
    """Describe a head-on encounter and the one look whose Pd is known."""

    #: Linear SNR of the known look, times the fourth power of its range in metres.
    snr_at_1_m: float
    #: Pulses of that look.
    pulses: int
    #: The target comes from the one range to the other.
    closing_m_s: float
    from_m: float
    to_m: float
    false_alarm_probability: float


def known_snr_at_1_m(
    *, rcs_dbsm: float, range_m: float, pd: float, false_alarm_probability: float, of_dbsm: float
) -> float:
    """Return the SNR of a Swerling I target of `of_dbsm` at 1 m, where Pd of another is known."""
    # Pd = Pfa^(1 / (1 + SNR)) of one look, and SNR goes with σ / R⁴.
    known = math.log(false_alarm_probability) / math.log(pd) - 1.0
    return float(known * 10.0 ** (0.1 * (of_dbsm - rcs_dbsm)) * range_m**4)


def ranges_of_declaration(
    approach: HeadOn, scan_rate_hz: float, m: int, n: int, *, pulses: int, summed: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return ranges of all phases' looks (phases, looks) and the chance of a first declaration.

    Pulses are `summed` in power, or else in amplitude; m = n = 1 is the first detection.
    """
    a = approach
    per_scan_m = a.closing_m_s / scan_rate_hz
    first_m = a.from_m - per_scan_m * (np.arange(_PHASES)[:, np.newaxis] + 0.5) / _PHASES
    looks = math.ceil((a.from_m - a.to_m) / per_scan_m)
    range_m = first_m - per_scan_m * np.arange(looks)
    # Where the run has ended nothing is detected.
    over = range_m < a.to_m
    snr = a.snr_at_1_m / np.where(over, a.to_m, range_m) ** 4 / a.pulses
    pd = detection_probability(
        snr if summed else snr * pulses,
        pulses=pulses if summed else 1,
        false_alarm_probability=a.false_alarm_probability,
    )
    return range_m, first_declaration_probability(np.where(over, 0.0, pd), m, n) / _PHASES


def mean_range_m(range_m: FloatArray, probability: FloatArray) -> float:
    """Return the mean range of those that are declared."""
    return float(np.sum(range_m * probability) / np.sum(probability))


def certain_range_m(range_m: FloatArray, probability: FloatArray, share: float) -> float:
    """Return the range at which so large a share is declared; NaN if it never is."""
    order = np.argsort(-range_m, axis=None)
    declared = np.cumsum(probability.reshape(-1)[order])
    place = int(np.searchsorted(declared, share))
    return math.nan if place == len(declared) else float(range_m.reshape(-1)[order][place])


STUDY = "radar_fading"
FIGURE = "scan_rate_fading.png"
TRIALS = 10_000
_TICKS_HZ = (0.2, 0.5, 1, 2, 5)

_TEXT = """
## Fades that last

`dsa-des study radar_fading`

With `fluctuation_correlation_s` the echo of each target is a complex Gauss-Markov amplitude: the
correlation of its power falls as exp(-2 |dt| / τ), whenever the radar looks, and a look is detected
with a steady target's Pd at the power it meets. Over looks far apart that is the Swerling model's
own Pd; a radar that looks again soon meets the same fade again. Swerling I and III last, and II and
IV where a look is one pulse; without the key each scan draws its own fade. With
`scintillation_extent_m` the echo is that of scatterers spread over the target, and changes as fast
as the target turns or passes; both together forget by either.

Range in km by which 95 % are declared ({m} of {n}), and its mean; in brackets computed by recursion
of amplitudes from look to look (`docs/make/declaration_ranges.py`), {trials:,} times:

{table}

![Range of declaration over scan rate by how long a fade lasts](images/{figure})

Where looks are independent, five of them tell nearly all. Where a fade lasts longer than five
looks take, they are one look: who is strong is declared at once and farther out, which raises the
mean, and who is in a fade stays in it, which lowers the range that 95 % reach. So what a free scan
gains by its rate is smaller than independent looks promise ({gain_fast} instead of {gain} from
{slow:g} to {fast:g} Hz, for τ = {tau:g} s), and a rule of m of n is no remedy for a fade that
outlasts n scans.
"""


def declared_by_recursion(
    approach: HeadOn,
    scan_rate_hz: float,
    m: int,
    n: int,
    *,
    pulses: int,
    correlation_s: float,
    trials: int = TRIALS,
) -> FloatArray:
    """Return the ranges of declaration of many approaches, NaN for none, drawn look after look.

    Swerling I with pulses added in amplitude: echo and noise are complex Gaussian, and detected is
    what exceeds -ln Pfa in power. The echo goes on from look to look by
    ρ = exp(-1 / (rate · τ)) of itself and sqrt(1 - ρ²) of a new draw.
    """
    a = approach
    draw = np.random.default_rng(20)

    def normal() -> Any:
        return (draw.standard_normal(trials) + 1j * draw.standard_normal(trials)) / math.sqrt(2.0)

    kept = math.exp(-1.0 / (scan_rate_hz * correlation_s))
    per_scan_m = a.closing_m_s / scan_rate_hz
    range_m = a.from_m - per_scan_m * draw.random(trials)
    declared = np.full(trials, np.nan)
    last = np.zeros((n, trials), dtype=bool)
    echo = normal()
    for look in range(math.ceil((a.from_m - a.to_m) / per_scan_m)):
        there = range_m > a.to_m
        snr = a.snr_at_1_m * pulses / a.pulses / np.where(there, range_m, 1.0) ** 4
        power = np.abs(np.sqrt(snr) * echo + normal()) ** 2
        last[look % n] = there & (power > -math.log(a.false_alarm_probability))
        new = np.isnan(declared) & there & (last.sum(axis=0) >= m)
        declared[new] = range_m[new]
        echo = kept * echo + math.sqrt(1.0 - kept * kept) * normal()
        range_m = range_m - per_scan_m
    return declared


def fading_section(images: Path, approach: HeadOn, m: int, n: int, certain: float) -> str:
    """Run the study of fades that last, draw its figure and return the section."""
    found = _simulated()
    cells = {
        key: (ranges, declared_by_recursion(
            approach, key[1], m, n, correlation_s=key[2],
            pulses=approach.pulses if key[0] == "free" else round(approach.pulses / key[1]),
        ))
        for key, ranges in found.items()
    }  # fmt: skip
    lasts = sorted({key[2] for key in cells})
    rates = sorted({key[1] for key in cells})

    def reached(ranges: FloatArray) -> float:
        return float(np.sort(np.nan_to_num(ranges))[math.floor((1.0 - certain) * len(ranges))])

    lines = [
        "| | scan rate, Hz | " + " | ".join(f"τ = {tau:g} s" for tau in lasts) + " |",
        "|---|---|" + "---|" * len(lasts),
    ]
    for budget in ("free", "dwell"):
        for rate in rates:
            texts = []
            for tau in lasts:
                run, drawn = cells[budget, rate, tau]
                texts.append(
                    f"{in_km(reached(run))} ({in_km(reached(drawn))}), mean "
                    f"{np.nanmean(run) / 1000:.2f} ({np.nanmean(drawn) / 1000:.2f})"
                )
            lines.append(f"| {budget} | {rate:.3g} | {' | '.join(texts)} |")
    _draw(images / FIGURE, cells, rates, lasts, reached, certain)

    def gain(tau: float) -> str:
        slow, fast = (reached(cells["free", rate, tau][1]) for rate in (rates[0], rates[-1]))
        return f"{(fast - slow) / 1000:.1f} km"

    return _TEXT.format(
        m=m, n=n, trials=TRIALS, table="\n".join(lines), figure=FIGURE, gain=gain(lasts[0]),
        gain_fast=gain(lasts[-1]), slow=rates[0], fast=rates[-1], tau=lasts[-1],
    )  # fmt: skip


def in_km(range_m: float) -> str:
    """Return a range for a table; 0 stands for runs that declare too seldom."""
    return f"{range_m / 1000:.2f}" if range_m > 0 else "never"


def _simulated() -> dict[tuple[str, float, float], FloatArray]:
    """Return (budget, scan rate, τ) → range of declaration of each run; NaN where there is none."""
    runs = study(STUDY).runs.to_pydict()
    columns = ("budget", "scan_rate_hz", "fluctuation_correlation_s")
    keys = zip(*(runs[f"radar.{name}"] for name in columns), strict=True)
    found: dict[tuple[str, float, float], list[float]] = {}
    for (budget, rate, tau), range_m in zip(keys, runs["declaration_range_m.radar"], strict=True):
        of = found.setdefault((budget, float(rate), float(tau)), [])
        of.append(math.nan if range_m is None else range_m)
    return {key: np.array(ranges) for key, ranges in found.items()}


def _draw(
    path: Path, cells: Any, rates: list[float], lasts: list[float], reached: Any, certain: float
) -> None:
    titles = {"free": "free scan (thesis)", "dwell": "budget of time"}
    with panels_written_as_png(path, 1, 2, sharex=True, sharey=True) as both:
        for axes, (budget, title) in zip(both, titles.items(), strict=True):
            for tau, colour in zip(lasts, (GREY, BLUE, GREEN), strict=True):
                drawn = [cells[budget, rate, tau][1] for rate in rates]
                label = f"fades last {tau:g} s"
                kept = [reached(ranges) / 1000 for ranges in drawn]
                mean = [np.nanmean(ranges) / 1000 for ranges in drawn]
                axes.plot(rates, kept, "-", color=colour, label=f"{label}: by {certain:.0%}")
                axes.plot(rates, mean, ":", color=colour, label=f"{label}: mean")
                for value, marker in ((reached, "s"), (np.nanmean, "o")):
                    points = [value(cells[budget, rate, tau][0]) / 1000 for rate in rates]
                    axes.plot(rates, points, marker, color=colour, ms=3.5)
            axes.set_xscale("log")
            axes.set_title(title, fontsize=10)
            axes.set_xlabel("scan rate, Hz")
            axes.set_xticks(_TICKS_HZ, [f"{tick:g}" for tick in _TICKS_HZ])
            axes.set_xticks([], minor=True)
            axes.set_ylim(0, None)
        both[0].set_ylabel("range of declaration, km")
        draw_legend_below(both[0], 3)
