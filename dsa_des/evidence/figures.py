"""The pictures of a pack: how estimates settle, and what a changed parameter does."""

import io
import math
from collections.abc import Sequence

import numpy as np

from dsa_des.block.mark import BLUE, RED, SKY
from dsa_des.evidence.findings import Finding, ParameterChange
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts, set_plain_log_ticks

_BAND, _LINE, _LIMIT, _RULE = SKY, BLUE, RED, "#999999"
_MOST_BARS = 24
_LONGEST = 60


def draw_convergence(findings: Sequence[Finding], confidence: float) -> bytes:
    """Return a PNG: the running estimate of every requirement with its interval and its limit."""
    drawn = io.BytesIO()
    with draw_to_png(8.6, 2.9 * len(findings) + 0.3, drawn) as figure:
        grid = figure.subplots(len(findings), 1, squeeze=False)[:, 0]
        for axes, one in zip(grid, findings, strict=True):
            c, asked = one.convergence, one.requirement
            value = np.array([e.value for e in c.estimates])
            low, high = (np.array([getattr(e, end) for e in c.estimates]) for end in
                         ("low", "high"))  # fmt: skip
            axes.fill_between(c.counts, low, high, color=_BAND, alpha=0.35, lw=0,
                              label=f"{100 * confidence:g} % interval")  # fmt: skip
            axes.plot(c.counts, value, color=_LINE, label="running estimate")
            axes.axhline(
                asked.limit, color=_LIMIT, ls="--", label=f"asked: {asked.describe_limit()}"
            )
            if math.isfinite(value[-1]):
                span = [c.last_from, c.counts[-1]]
                for side in (-1.0, 1.0):
                    edge = value[-1] + side * c.allowed
                    axes.plot(span, [edge, edge], color=_RULE, lw=1, ls=":",
                              label="may move within" if side > 0 else None)  # fmt: skip
            known = np.concatenate([value[c.counts.index(c.counts[-1]) :], [asked.limit]])
            top = np.nanmax([*known, np.nanquantile(high, 0.8)]) if np.isfinite(high).any() else 1
            axes.set_ylim(0.0, 1.15 * float(top))
            axes.set_xscale("log")
            set_plain_log_ticks(axes.xaxis)
            axes.set_ylabel(figure_text(asked.name, _LONGEST))
            # Above the plot: beside it, the words would take a third of its width.
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
        grid[-1].set_xlabel("encounters")
        fit_axes_to_texts(figure)
    return drawn.getvalue()


def draw_sensitivity(changes: Sequence[ParameterChange]) -> bytes:
    """Return a PNG: the paired difference that every change makes, one panel per result."""
    drawn = io.BytesIO()
    results = list(dict.fromkeys(one.result for one in changes))
    rows = list(dict.fromkeys((one.key, one.value) for one in changes))[:_MOST_BARS]
    with draw_to_png(8.6, 0.32 * len(rows) + 1.3, drawn) as figure:
        grid = figure.subplots(1, len(results), squeeze=False, sharey=True)[0]
        places = {row: len(rows) - 1 - k for k, row in enumerate(rows)}
        for axes, result in zip(grid, results, strict=True):
            for one in changes:
                if one.result != result or (one.key, one.value) not in places:
                    continue
                at, d = places[one.key, one.value], one.difference
                axes.plot([d.low, d.high], [at, at], color=_BAND, lw=3, solid_capstyle="butt")
                axes.plot([d.value], [at], "o", color=_LINE, ms=4)
            axes.axvline(0.0, color=_RULE, lw=1)
            axes.set_xlabel(figure_text(f"change of {result}", _LONGEST))
        grid[0].set_yticks(
            list(places.values()),
            [figure_text(f"{key.removeprefix('blocks.')} = {value}", _LONGEST)
             for key, value in places],
        )  # fmt: skip
        fit_axes_to_texts(figure)
    return drawn.getvalue()
