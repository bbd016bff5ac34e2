"""The panel of altitudes beside the plan: what a view from above cannot show."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.display.flights import Flights
from components.display.positions import Positions
from components.display.styles import mark_of
from components.display.thinning import evenly, staggered
from dsa_des.block.mark import Mark

_SPACING_PX = 9.0
_MOST_MARKS = 5000
#: Least span of altitudes that is shown, m: level flights are level lines.
_LEAST_SPAN_M = 40.0


def draw_altitudes(
    axes: Any,
    flights: Flights,
    marks: Positions,
    styles: Mapping[str, Mark],
    px_per_s: float,
    colours: tuple[str, str],
) -> None:
    """Draw altitude above the ellipsoid over time, and where each sensor detected what.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    flights : Flights
    marks : Positions
    styles : mapping of str to Mark
        Of all sensors.
    px_per_s : float
        Scale of the time axis.
    colours : (str, str)
        Of the ownship and of targets.
    """
    from matplotlib.collections import LineCollection

    tracks = [*flights.targets, flights.own]
    many = len(tracks) > 20
    lines = [np.column_stack((track.time_s, track.alt_m)) for track in tracks]
    axes.add_collection(
        LineCollection(
            lines, colors=[colours[1]] * (len(tracks) - 1) + [colours[0]],
            linewidths=[0.6 if many else 1.0] * (len(tracks) - 1) + [2.0], zorder=1.0,
        ), autolim=False,
    )  # fmt: skip
    names = list(styles)
    for number, (name, style) in enumerate(styles.items()):
        points = []
        for track, time_s, _, _ in marks.get(name, []):
            phase = number / len(names)
            kept = time_s[staggered(time_s * px_per_s, _SPACING_PX * len(names), phase)]
            points.append(np.column_stack((kept, np.interp(kept, track.time_s, track.alt_m))))
        if points:
            where = np.concatenate(points)
            where = where[evenly(len(where), _MOST_MARKS)]
            axes.plot(where[:, 0], where[:, 1], **mark_of(style), zorder=2.0 + 1.0 / style.size_pt)
    every = np.concatenate([track.alt_m for track in tracks])
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)
    half = max(high - low, _LEAST_SPAN_M) * 0.58
    axes.set_ylim((low + high) / 2 - half, (low + high) / 2 + half)
    axes.set_xlim(0.0, max(flights.duration_s, 1e-9))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("altitude [m]")
    axes.grid(color="#DDDDDD", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.ticklabel_format(useOffset=False, style="plain")
