"""The figure of an encounter's alerts: levels and times over time, and the flights from above."""

from pathlib import Path
from typing import Any

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.alerting.alert_tables import BandsOverTime, bands_over_time
from components.alerting.encounter import Encounter
from components.alerting.levels import Alerts
from components.arguments.units import NAUTICAL_MILE_M
from components.well_clear.volume import Volume
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts

#: Colour of each level from 0; levels beyond the last share its colour.
_COLOURS = ("#7f7f7f", "#e6b800", "#e07b00", "#c1121f")
#: Colour of each region's bands; NONE is left blank.
_REGIONS = {"FAR": "#f2d66b", "MID": "#e07b00", "NEAR": "#c1121f", "RECOVERY": "#5aa469"}
_STYLES = ("-", "--", "-.", ":")
_MOST_NAMED = 6


def draw_alerts(
    path: Path,
    title: str,
    configuration: Configuration,
    encounter: Encounter,
    alerts: Alerts,
) -> None:
    """Draw the alerts of one encounter into a PNG file."""
    with draw_to_png(9.0, 7.5, path) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
        over_time = figure.add_subplot(grid[0, 0])
        _draw_levels(over_time, configuration, encounter, alerts)
        _draw_violation_times(figure.add_subplot(grid[1, 0], sharex=over_time), encounter, alerts)
        bands = bands_over_time("hdir", configuration, encounter, alerts)
        _draw_direction_bands(figure.add_subplot(grid[2, 0], sharex=over_time), encounter, bands)
        _draw_plan(figure.add_subplot(grid[:, 1]), configuration, encounter, alerts)
        figure.suptitle(figure_text(title))
        fit_axes_to_texts(figure)


def _seconds_since_start(encounter: Encounter) -> Any:
    return encounter.time_s - encounter.time_s[0]


def _draw_levels(
    axes: Any, configuration: Configuration, encounter: Encounter, alerts: Alerts
) -> None:
    """Draw each target's alert level as steps."""
    for number, target in enumerate(encounter.targets):
        level = np.where(encounter.present[:, number], alerts.level[:, number], np.nan)
        name = figure_text(target) if number < _MOST_NAMED else None
        axes.step(_seconds_since_start(encounter), level, where="post", linewidth=1.3, label=name)
    axes.set_yticks(range(configuration.most_levels + 1))
    axes.set_ylim(-0.2, configuration.most_levels + 0.2)
    axes.set_ylabel("alert level")
    axes.set_title("alert level", loc="left")
    _put_legend_above(axes)


def _draw_violation_times(axes: Any, encounter: Encounter, alerts: Alerts) -> None:
    """Draw for each level the least time to violation over all targets, against time."""
    least = np.min(
        np.where(encounter.present[:, :, np.newaxis], alerts.violation_s, np.inf), axis=1
    )
    for number in range(least.shape[1]):
        axes.plot(
            _seconds_since_start(encounter),
            np.where(np.isfinite(least[:, number]), least[:, number], np.nan),
            color=_level_colour(number + 1),
            linestyle=_STYLES[number % len(_STYLES)],
            linewidth=2.4 - 0.5 * min(number, 3),
            label=f"level {number + 1}",
        )
    axes.set_ylabel("time to violation, s")
    axes.set_title("time to each level's volume", loc="left")
    axes.set_ylim(bottom=0.0)
    _put_legend_above(axes)


def _draw_direction_bands(axes: Any, encounter: Encounter, found: BandsOverTime) -> None:
    """Draw the bands of direction over time, and the direction that is flown."""
    time_s = found.time_s - encounter.time_s[0]
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    ends_s = np.append(time_s[1:], time_s[-1] + step_s)
    # Bands hold until the next instant, but not over a gap in the recording.
    ends_s = np.minimum(ends_s, time_s + 3.0 * step_s)
    stretches: dict[str, list[Any]] = {region: [] for region in _REGIONS}
    for begin_s, end_s, bands in zip(time_s.tolist(), ends_s.tolist(), found.bands, strict=True):
        for band in bands:
            if band.region in stretches:
                low, high = np.degrees([band.low, band.high]).tolist()
                stretches[band.region].append(
                    [(begin_s, low), (end_s, low), (end_s, high), (begin_s, high)]
                )
    for region, corners in stretches.items():
        if corners:
            _fill_rectangles(axes, corners, _REGIONS[region], region)
    axes.plot(time_s, np.degrees(found.own_value), "k.", markersize=1.5, label="flown")
    axes.set_xlim(0.0, max(float(ends_s[-1]), 1e-3))
    axes.set_ylim(0.0, 360.0)
    axes.set_yticks((0, 90, 180, 270, 360))
    axes.set_ylabel("direction, deg")
    axes.set_xlabel(f"time since {encounter.time_s[0]:.10g} s, s")
    axes.set_title("bands of direction", loc="left")
    _put_legend_above(axes)


def _fill_rectangles(axes: Any, corners: list[Any], colour: str, label: str) -> None:
    """Fill rectangles, given by corners, in one colour without seams between adjacent ones."""
    from matplotlib.collections import PolyCollection

    axes.add_collection(
        PolyCollection(
            corners, facecolor=colour, edgecolor=colour, linewidth=0.3, zorder=1, label=label
        )
    )


def _put_legend_above(axes: Any) -> None:
    """Draw the legend above the axes, at the right, where it covers no curve."""
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(handles), frameon=False,
            borderaxespad=0.1, handlelength=1.2, columnspacing=0.9, fontsize="small",
        )  # fmt: skip


def _draw_plan(
    axes: Any, configuration: Configuration, encounter: Encounter, alerts: Alerts
) -> None:
    """Draw the flights in the plane of the first sample, the ownship coloured by its alerts."""
    own = encounter.own_plane / NAUTICAL_MILE_M
    highest = np.max(np.where(encounter.present, alerts.level, 0), axis=1, initial=0)
    axes.plot(*own, color="black", linewidth=0.8, label=figure_text(encounter.ownship))
    for level in range(1, int(highest.max(initial=0)) + 1):
        at = highest == level
        if at.any():
            axes.plot(
                *own[:, at], ".", color=_level_colour(level), markersize=4, label=f"level {level}"
            )
    for number, target in enumerate(encounter.targets):
        there = encounter.present[:, number]
        plane = np.where(there, encounter.target_plane[:, :, number], np.nan) / NAUTICAL_MILE_M
        name = figure_text(target) if number < _MOST_NAMED else None
        axes.plot(*plane, linewidth=1.2, label=name)
        if there.any():
            axes.plot(*plane[:, np.argmax(there)], "o", color="black", markersize=3)
    axes.plot(*own[:, 0], "o", color="black", markersize=3)
    _draw_corrective_volume(axes, configuration, encounter)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, nmi")
    axes.set_ylabel("north, nmi")
    axes.set_title("flights, and the volume where they are closest")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False, fontsize="small"
    )


def _draw_corrective_volume(axes: Any, configuration: Configuration, encounter: Encounter) -> None:
    """Draw the radius of the corrective volume around the ownship at the closest approach."""
    if not encounter.present.any():
        return
    range_m = np.hypot(encounter.relative[0], encounter.relative[1])
    row, column = np.unravel_index(
        int(np.argmin(np.where(encounter.present, range_m, np.inf))), range_m.shape
    )
    alerter = configuration.alerters[int(encounter.alerter[row, column])]
    level = configuration.first_corrective_level(alerter)
    if level is None or not isinstance(level.volume, Volume):
        return
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    radius = level.volume.horizontal_m / NAUTICAL_MILE_M
    east, north = encounter.own_plane[:, row] / NAUTICAL_MILE_M
    axes.plot(east + radius * np.sin(turn), north + radius * np.cos(turn), "k:", linewidth=1.0)


def _level_colour(level: int) -> str:
    return _COLOURS[min(level, len(_COLOURS) - 1)]
