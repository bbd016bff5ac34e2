"""The sensors' fields of view on the plan."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry.field_of_view import sector_width_rad
from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import Mark


@dataclass
class Outline:
    """A field of view from above.

    Parameters
    ----------
    corners_km : (corners, 2)
        East and north; unless `closed`, the two edges' directions.
    radius_km : float
    closed : bool
        Whether it has a range limit.
    """

    corners_km: FloatArray
    radius_km: float
    closed: bool


def outline_of(yaw_rad: float, reach: Any, axes: Any) -> Outline:
    """Return a reach from above, for a level ownship at the origin with its nose at `yaw_rad`.

    Parameters
    ----------
    yaw_rad : float
    reach : Reach
        In the sensor's axes; drawn as its plane of elevation 0, which a tilted sensor foreshortens.
    axes : BodyAxes
        How the sensor is mounted.
    """
    width = sector_width_rad(*reach.azimuth_rad)
    everywhere = width >= 2 * math.pi - 1e-9
    closed = math.isfinite(reach.range_max_m)
    angle = reach.azimuth_rad[0] + np.linspace(0.0, min(width, 2 * math.pi), 181)
    if not closed:
        angle = angle[:0] if everywhere else angle[[0, -1]]
    radius_km = reach.range_max_m / 1000 if closed else 1.0
    azimuth, elevation = axes.pointing(angle, np.zeros(len(angle)))
    bearing = yaw_rad + azimuth
    level_km = radius_km * np.cos(elevation) if closed else np.ones(len(angle))
    corners = np.column_stack((np.sin(bearing), np.cos(bearing))) * level_km[:, np.newaxis]
    if closed and not everywhere:
        corners = np.vstack((corners, [[0.0, 0.0]]))
    return Outline(corners, radius_km, closed)


def draw_outline(
    axes: Any, outline: Outline, styles: Mapping[str, Mark], name: str, far_km: float
) -> None:
    """Draw a field of view: filled up to a range limit, or dashed edges without end.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    outline : Outline
    styles : mapping of str to Mark
        Of all sensors.
    name : str
        Whose field of view this is.
    far_km : float
        Beyond every corner of the plot.
    """
    from matplotlib.patches import Polygon

    colour = styles[name].colour
    corners = outline.corners_km
    if outline.closed:
        axes.add_patch(Polygon(corners, facecolor=colour, alpha=0.06, zorder=0.5))
        axes.add_patch(Polygon(corners, fill=False, edgecolor=colour, linewidth=1.0, zorder=0.6))
        return
    shift = 4 * list(styles).index(name)
    for edge in corners * far_km:
        # Shifted dashes keep two fields of view with the same edges apart.
        axes.plot(
            [0.0, edge[0]], [0.0, edge[1]], color=colour, linewidth=1.2,
            linestyle=(shift, (6, 5)), zorder=0.7, scalex=False, scaley=False,
        )  # fmt: skip


def reach_text(reach: Any, axes: Any) -> str:
    """Return a reach in words, round the boresight where that is not the nose."""
    if not reach.enabled:
        return "switched off"
    low, high = (math.degrees(angle) for angle in reach.azimuth_rad)
    field = f"±{high:.4g}°" if low == -high else f"{low:.4g}° to {high:.4g}°"
    azimuth, elevation = (
        round(math.degrees(angle[0]), 6) for angle in axes.pointing(*np.zeros((2, 1)))
    )
    if azimuth or elevation:
        field += f"\nround {azimuth:.4g}°"
        field += f", {abs(elevation):.4g}° {'up' if elevation > 0 else 'down'}" if elevation else ""
    if math.isfinite(reach.range_max_m):
        return f"field of view {field},\nto {reach.range_max_m / 1000:g} km"
    return f"field of view {field},\nno range limit (dashed)"
