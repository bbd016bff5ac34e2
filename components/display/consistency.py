"""``consistency.png``: errors of tracks and innovations beside the bounds that they should keep."""

from pathlib import Path
from typing import Any

import numpy as np

from components.display.outcomes import NEAR_M, distances_to_targets
from components.display.tracks import COLOURS, MOST_SPREADS, STATE, DrawnTracks
from components.messages.state_tracks import covariance_matrices
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts, set_plain_log_ticks
from dsa_des.results.statistics import chi_square_bounds

_MOST_ERRORS = 2000
_LOWEST, _HIGHEST = 0.02, 1000.0
#: Stretches of time over which innovations are averaged.
_STRETCHES = 40


def nees_of_nearest_target(one: dict[str, Any], states: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return rows' NEES to the nearest target, NaN if none is within `NEAR_M`, and whether one is.

    States (targets, 6, rows) are those of the targets at the same times.
    """
    count = len(one["state_s"])
    if len(states) == 0:
        return np.full(count, np.nan), np.zeros(count, dtype=bool)
    apart = distances_to_targets(one, slice(None), states[:, :3])
    apart = np.where(np.isnan(apart), np.inf, apart)
    nearest: IntArray = apart.argmin(axis=0)
    rows = np.arange(count)
    known = apart[nearest, rows] < NEAR_M
    error = np.stack([one[name] for name in STATE]) - states[nearest, :, rows].T
    spread = np.moveaxis(covariance_matrices(one, slice(None)), -1, 0).copy()
    result = np.full(count, np.nan)
    solved = np.linalg.solve(spread[known], error.T[known][:, :, np.newaxis])[:, :, 0]
    result[known] = (error.T[known] * solved).sum(axis=1)
    return result, known


def draw_consistency(path: Path, drawn: DrawnTracks) -> Path | None:
    """Draw the tracks' NEES and NIS over time with 95 % bounds; None if no track is near a target.

    A row of a track that has a target counts; the bounds hold 95 % of consistent ones. None is
    drawn where no track is near a target.
    """
    shown: list[tuple[Any, FloatArray, FloatArray]] = []
    for track in drawn.tracks:
        count = len(track.columns["state_s"])
        one = {k: v[:: max(1, count // _MOST_ERRORS)] for k, v in track.columns.items()}
        result, known = nees_of_nearest_target(
            one, drawn.seen_by[track.block].states(one["state_s"])
        )
        if known.any():
            shown.append((track, one["state_s"], result))
    if not shown:
        return None
    of_block = {
        block: np.concatenate([values[~np.isnan(values)] for _, _, values in own])
        for block in drawn.blocks
        if (own := [one for one in shown if one[0].block == block])
    }
    low, high = chi_square_bounds(6)
    said = {
        block: f"{every.mean():.3g}, {_percentage_text((every >= low) & (every <= high))} inside"
        for block, every in of_block.items()
    }
    with draw_to_png(9.0, 6.4, path) as figure:
        errors, innovations = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        names = {block: f"{figure_text(block, 16)}: {words}" for block, words in said.items()}
        if len(shown) > MOST_SPREADS:
            _draw_median_and_95_percent(errors, drawn, shown, names)
        else:
            labelled: set[str] = set()
            for track, time_s, values in shown:
                label = f"track {track.number}"
                if len(drawn.blocks) > 1:
                    label = "" if track.block in labelled else names[track.block]
                    labelled.add(track.block)
                errors.plot(time_s, values, color=track.colour, linewidth=0.9, label=label or None)
        errors.axhspan(low, high, color="#999999", alpha=0.3, linewidth=0, zorder=0)
        errors.axhline(6.0, color="#666666", linewidth=0.8, zorder=0)
        # Trackers are not pooled: each has its own mean, in the legend.
        pooled = "" if len(drawn.blocks) > 1 else f": mean {next(iter(said.values()))}"
        errors.set_title(
            f"Error squared by its covariance (NEES){pooled} (honest: 6, 95 %)", loc="left"
        )
        if len(shown) <= 6 or len(drawn.blocks) > 1 or len(shown) > MOST_SPREADS:
            errors.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        _draw_innovations(innovations, drawn)
        errors.set_yscale("log")
        bottom, top = errors.get_ylim()
        errors.set_ylim(max(bottom, _LOWEST), min(max(top, 20.0), _HIGHEST))
        set_plain_log_ticks(errors.yaxis)
        innovations.set_ylim(bottom=0.0)
        innovations.set_xlabel("time (s)")
        fit_axes_to_texts(figure)
    return path


def _draw_median_and_95_percent(
    axes: Any,
    drawn: DrawnTracks,
    shown: list[tuple[Any, FloatArray, FloatArray]],
    names: dict[str, str],
) -> None:
    """Draw the median of all tracks and where 95 % of them lie: single lines cover each other."""
    edges = np.linspace(drawn.time_s[0], drawn.time_s[1] + 1e-9, _STRETCHES + 1)
    for index, block in enumerate(drawn.blocks):
        held = [(time_s, values) for track, time_s, values in shown if track.block == block]
        if not held:
            continue
        time_s, values = (np.concatenate(parts) for parts in zip(*held, strict=True))
        time_s, values = time_s[~np.isnan(values)], values[~np.isnan(values)]
        stretch = np.digitize(time_s, edges) - 1
        used = np.unique(stretch)
        low, median, high = np.array(
            [np.quantile(values[stretch == one], (0.025, 0.5, 0.975)) for one in used.tolist()]
        ).T
        middle = 0.5 * (edges[1:] + edges[:-1])[used]
        colour, several = COLOURS[index % len(COLOURS)], len(drawn.blocks) > 1
        axes.fill_between(middle, low, high, color=colour, alpha=0.2, linewidth=0,
                          label=None if several else f"95 % of {len(held)} tracks")  # fmt: skip
        axes.plot(middle, median, color=colour, marker=".", linewidth=1.2,
                  label=names[block] if several else "median")  # fmt: skip


def _draw_innovations(axes: Any, drawn: DrawnTracks) -> None:
    for index, block in enumerate(drawn.blocks):
        held = [one.columns for one in drawn.tracks if one.block == block]
        label = figure_text(block, 16) if len(drawn.blocks) > 1 else ""
        _draw_innovations_of_tracker(axes, held, drawn.time_s, COLOURS[index % len(COLOURS)], label)
    if drawn.blocks[1:]:
        axes.set_title(
            "Innovation squared by its covariance (NIS) per quantity, stretches inside "
            "(honest: 1, 95 %)", loc="left",
        )  # fmt: skip
    if axes.get_legend_handles_labels()[1]:
        axes.axhline(1.0, color="#666666", linewidth=0.8, zorder=0)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _draw_innovations_of_tracker(
    axes: Any,
    held: list[dict[str, Any]],
    span_s: tuple[float, float],
    colour: str,
    tracker: str,
) -> None:
    time_s, nis, freedom = (
        np.concatenate([columns[name] for columns in held])
        for name in ("state_s", "nis", "nis_freedom")
    )
    mine = freedom > 0
    time_s, nis, freedom = time_s[mine], nis[mine], freedom[mine]
    if len(nis) == 0:
        axes.set_title("Innovation squared (NIS): this tracker tells none", loc="left")
        return
    edges = np.linspace(span_s[0], span_s[1] + 1e-9, _STRETCHES + 1)
    total, many = (np.histogram(time_s, edges, weights=values)[0] for values in (nis, freedom))
    middle = 0.5 * (edges[1:] + edges[:-1])[many > 0]
    total, many = total[many > 0], many[many > 0]
    low, high = np.array([chi_square_bounds(n) for n in many.tolist()]).T / many
    axes.fill_between(middle, low, high, color=colour if tracker else "#999999",
                      alpha=0.15 if tracker else 0.3, linewidth=0, zorder=0,
                      label=None if tracker else "95 %")  # fmt: skip
    inside = (total / many >= low) & (total / many <= high)
    said = f"{nis.sum() / freedom.sum():.3g}, {_percentage_text(inside)}"
    axes.plot(middle, total / many, color=colour, marker=".", linewidth=0.9,
              label=f"{tracker}: {said}" if tracker else "mean per quantity")  # fmt: skip
    axes.set_title(
        f"Innovation squared by its covariance (NIS) per quantity: {said} of stretches inside "
        "(honest: 1, 95 %)", loc="left",
    )  # fmt: skip


def _percentage_text(inside: BoolArray) -> str:
    return f"{100.0 * np.mean(inside):.0f} %"
