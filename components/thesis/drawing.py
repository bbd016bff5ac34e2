"""What figures share: panels, colours, and scenes from above as the thesis draws them."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from components.display.map_view import outline_of
from components.display.symbols import add_grid, sensor_marks
from components.sensor import palette
from components.thesis.scenes import SceneRun
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.record.drawing import draw_to_png

#: Half a page.
WIDTH_IN, HEIGHT_IN = 6.6, 3.9

#: By kind, as in every other figure.
RADAR, EO, IR, FUSION = (
    mark.colour for mark in (palette.RADAR, palette.EO, palette.IR, palette.FUSION)
)
#: For whatever is no kind of sensor, beside those of `dsa_des.record.drawing`.
GREY = "#777777"


def draw_legend_below(axes: Any, columns: int = 4, *, without: str = "") -> None:
    """Draw the legend of one pair of axes below all of them; `without` names an entry."""
    entries = zip(*axes.get_legend_handles_labels(), strict=True)
    shown = [entry for entry in entries if entry[1] != without]
    axes.figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=columns)


@contextmanager
def panels_written_as_png(
    path: Path,
    rows: int = 1,
    columns: int = 1,
    *,
    width_in: float = WIDTH_IN,
    height_in: float = HEIGHT_IN,
    **shared: Any,
) -> Iterator[list[Any]]:
    """Yield the axes of a figure, row by row, and write it as PNG when the block is done."""
    with draw_to_png(width_in, height_in, path) as figure:
        figure.set_layout_engine("constrained")
        axes = list(figure.subplots(rows, columns, squeeze=False, **shared).flat)
        for one in axes:
            add_grid(one)
        yield axes


def draw_map(axes: Any, run: SceneRun, *, fields_of_view: tuple[str, ...] = ()) -> None:
    """Draw the flights, the ownship's position and sensors' fields of view."""
    from matplotlib.patches import Polygon

    flights = run.flights
    styles = sensor_marks(fields_of_view, run.simulation.components)
    for name in fields_of_view:
        sensor: Any = run.simulation.components[name]
        colour = styles[name].colour
        outline = outline_of(flights.start_yaw_rad, sensor.stated_reach, sensor.axes)
        if outline.closed:
            shape: dict[str, Any] = {"facecolor": colour, "edgecolor": colour, "alpha": 0.15}
            axes.add_patch(
                Polygon(
                    outline.corners_km,
                    **shape,
                    zorder=0.5,
                    label="field of view" + (f" of {name}" if len(fields_of_view) > 1 else ""),
                )
            )
    for number, track in enumerate(flights.targets):
        label = "intruder" if number == 0 else None
        axes.plot(track.east_km, track.north_km, color=GREY, linewidth=1.0, label=label)
    axes.plot([0.0], [0.0], "*", color="#000000", markersize=11, label="ownship", zorder=3)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("east (km)")
    axes.set_ylabel("north (km)")


def mark_true_target_positions(
    axes: Any, run: SceneRun, rows: dict[str, AnyArray], **style: Any
) -> None:
    """Plot each row's target on a map at its true position and time, for a recorded table."""
    east, north = true_target_positions_km(run, rows)
    defaults = {"linestyle": "none", "marker": "o", "markersize": 4.5, "fillstyle": "none",
                "color": RADAR, "zorder": 2}  # fmt: skip
    axes.plot(east, north, **{**defaults, **style})


def true_target_positions_km(
    run: SceneRun, rows: dict[str, AnyArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the true east and north position in km of each row's target at the row's time."""
    east, north = np.empty(len(rows["time_s"])), np.empty(len(rows["time_s"]))
    for name in np.unique(rows["target"].astype(str)):
        here = np.flatnonzero(rows["target"] == name)
        east[here], north[here] = run.flights.east_north_km(str(name), rows["time_s"][here])
    return east, north


def reported_positions_km(rows: dict[str, AnyArray]) -> tuple[FloatArray, FloatArray]:
    """Return east, north, km, by azimuth, elevation, range of a level ownship heading north."""
    ground_km = rows["range_m"] / 1000.0 * np.cos(rows["elevation_rad"])
    return ground_km * np.sin(rows["azimuth_rad"]), ground_km * np.cos(rows["azimuth_rad"])


def line_from_ownship(azimuth_deg: float, length_km: float) -> tuple[list[float], list[float]]:
    """Return east and north (km) of both ends of a line from the ownship along an azimuth."""
    angle = math.radians(azimuth_deg)
    return [0.0, length_km * math.sin(angle)], [0.0, length_km * math.cos(angle)]
