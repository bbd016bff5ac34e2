"""``consistency.png``: whether tracks are as wrong as they say, over time."""

from pathlib import Path
from typing import Any

import numpy as np

from components.display.drawn_tracks import DrawnTracks, errors_squared
from components.display.tracks import colour_of
from dsa_des.arrays.types import FloatArray
from dsa_des.record.drawing import drawing, plain_log_ticks, tight
from dsa_des.results.statistics import chi_square_bounds

_MOST_POINTS = 2000
_LOWEST, _HIGHEST = 0.02, 1000.0
#: Stretches of time over which innovations are averaged.
_STRETCHES = 40


def draw_consistency(path: Path, told: DrawnTracks) -> Path | None:
    """Draw normalised errors squared of tracks, and of what they expected of detections.

    A row of a track that has a target counts; the bounds hold 95 % of honest ones.

    Parameters
    ----------
    path : Path
        The PNG to write.
    told : DrawnTracks

    Returns
    -------
    Path or None
        None where no track is near a target.
    """
    shown: list[tuple[Any, FloatArray, FloatArray]] = []
    for track in told.tracks:
        count = len(track.columns["state_s"])
        one = {k: v[:: max(1, count // _MOST_POINTS)] for k, v in track.columns.items()}
        found, known = errors_squared(one, told.targets.states(one["state_s"]))
        if known.any():
            shown.append((track, one["state_s"], found))
    if not shown:
        return None
    every = np.concatenate([values[~np.isnan(values)] for _, _, values in shown])
    with drawing(7.5, 6.4, path) as figure:
        errors, innovations = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for track, time_s, values in shown:
            errors.plot(time_s, values, color=colour_of(track), linewidth=0.9,
                        label=f"track {track.number}")  # fmt: skip
        low, high = chi_square_bounds(6)
        errors.axhspan(low, high, color="#999999", alpha=0.3, linewidth=0, zorder=0)
        errors.axhline(6.0, color="#666666", linewidth=0.8, zorder=0)
        inside = np.mean((every >= low) & (every <= high))
        errors.set_title(
            f"Error squared by its covariance (NEES): mean {every.mean():.3g} (honest: 6), "
            f"{inside:.0%} inside", loc="left",
        )  # fmt: skip
        if len(shown) <= 6:
            errors.legend(loc="upper right", ncols=3)
        _draw_innovations(innovations, told)
        errors.set_yscale("log")
        bottom, top = errors.get_ylim()
        errors.set_ylim(max(bottom, _LOWEST), min(max(top, 20.0), _HIGHEST))
        plain_log_ticks(errors.yaxis)
        innovations.set_ylim(bottom=0.0)
        innovations.set_xlabel("time [s]")
        tight(figure)
    return path


def _draw_innovations(axes: Any, told: DrawnTracks) -> None:
    held = [one.columns for one in told.tracks]
    time_s, nis, freedom = (
        np.concatenate([columns[name] for columns in held])
        for name in ("state_s", "nis", "nis_freedom")
    )
    mine = freedom > 0
    time_s, nis, freedom = time_s[mine], nis[mine], freedom[mine]
    if len(nis) == 0:
        axes.set_title("Innovation squared (NIS): this tracker tells none", loc="left")
        return
    edges = np.linspace(told.time_s[0], told.time_s[1] + 1e-9, _STRETCHES + 1)
    total, many = (np.histogram(time_s, edges, weights=values)[0] for values in (nis, freedom))
    middle = 0.5 * (edges[1:] + edges[:-1])[many > 0]
    total, many = total[many > 0], many[many > 0]
    low, high = np.array([chi_square_bounds(n) for n in many.tolist()]).T / many
    axes.fill_between(middle, low, high, color="#999999", alpha=0.3, linewidth=0, label="95 %")
    axes.plot(middle, total / many, color="#0072B2", marker=".", linewidth=0.9,
              label="mean per quantity")  # fmt: skip
    axes.axhline(1.0, color="#666666", linewidth=0.8, zorder=0)
    inside = np.mean((total / many >= low) & (total / many <= high))
    axes.set_title(
        f"Innovation squared by its covariance (NIS): {nis.sum() / freedom.sum():.3g} per quantity "
        f"(honest: 1), {inside:.0%} of stretches inside", loc="left",
    )  # fmt: skip
    axes.legend(loc="upper right")
