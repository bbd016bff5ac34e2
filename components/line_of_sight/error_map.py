"""Maps of the error of each model of the line of sight over range and latitude."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.geometry import (
    EARTH_MODELS,
    LineOfSight,
    angle_of_chord,
    chord_between,
    enu_to_geodetic,
    unit_vector,
    wrap_by_sines,
)
from dsa_des.arrays.types import FloatArray

ALTITUDE_M = 1000.0
RADAR_DEG, CAMERA_DEG = 1.0, 0.03
RADAR_RANGE_M, FINE_RANGE_M = 76.2, 1.0

# East and west are alike; the northern bearings differ from the southern ones.
_BEARINGS_RAD = np.radians(np.linspace(0.0, 180.0, 9))
_COLOURS = "viridis"


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """Errors of one model, the worst of all bearings, shape (latitudes, ranges)."""

    model: str
    lat_deg: FloatArray  # Of the ownship, and the true slant range
    range_m: FloatArray
    # Angle between the model's line of sight and the true one, and its parts in NED
    direction_rad: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    range_error_m: FloatArray

    def rows(self) -> list[dict[str, float | str]]:
        """Return one flat record per latitude and range, for JSON; angles in deg, ranges in m."""
        return [
            {
                "rung": self.model,
                "lat_deg": float(self.lat_deg[i]),
                "range_m": float(self.range_m[j]),
                "direction_error_deg": math.degrees(self.direction_rad[i, j]),
                "azimuth_error_deg": math.degrees(self.azimuth_rad[i, j]),
                "elevation_error_deg": math.degrees(self.elevation_rad[i, j]),
                "range_error_m": float(self.range_error_m[i, j]),
            }
            for i in range(len(self.lat_deg))
            for j in range(len(self.range_m))
        ]


def error_maps_of_earth_models(
    lat_deg: FloatArray | None = None, range_m: FloatArray | None = None
) -> list[ErrorMap]:
    """Compute the errors of every model of the Earth over latitude and range."""
    if lat_deg is None:
        lat_deg = np.append(np.arange(0.0, 90.0, 2.0), [89.0, 89.9, 89.99995])
    if range_m is None:
        range_m = np.geomspace(100.0, 200e3, 34)
    shape = (len(lat_deg), len(range_m), len(_BEARINGS_RAD))
    phi: Any
    phi, distance, bearing = (
        np.ascontiguousarray(np.broadcast_to(axis, shape)).reshape(-1)
        for axis in (lat_deg[:, None, None], range_m[None, :, None], _BEARINGS_RAD)
    )
    # As high as the ownship, over an Earth of 6371 km to a metre or so.
    up = -(distance**2) / (2.0 * (6371e3 + ALTITUDE_M))
    level = np.sqrt(distance**2 - up**2)
    placed = (level * np.sin(bearing), level * np.cos(bearing), up)
    target = enu_to_geodetic(
        *placed, reference_lat_deg=phi, reference_lon_deg=0.0, reference_alt_m=ALTITUDE_M
    )
    pairs = (phi, 0.0, ALTITUDE_M, *target)
    true = LineOfSight().in_ned(*pairs)
    truth = dict.fromkeys(EARTH_MODELS, true)
    truth["ellipsoid"] = (bearing, np.arctan2(up, level), distance)
    maps = []
    for name in EARTH_MODELS:
        azimuth, elevation, slant_range = LineOfSight(name).in_ned(*pairs)
        turn = azimuth - truth[name][0]
        chord = chord_between(unit_vector(azimuth, elevation), unit_vector(*truth[name][:2]))
        errors = (
            angle_of_chord(chord),
            np.abs(wrap_by_sines(turn)),
            np.abs(elevation - truth[name][1]),
            np.abs(slant_range - truth[name][2]),
        )
        maps.append(
            ErrorMap(name, lat_deg, range_m, *(e.reshape(shape).max(axis=2) for e in errors))
        )
    return maps


def draw_error_map(folder: Path) -> list[Path]:
    """Draw the error in angle and in range of every model over range and latitude."""
    maps = error_maps_of_earth_models()
    exact = maps[-1]
    off_rad, off_m = exact.direction_rad.max(), exact.range_error_m.max()
    rounding = (
        "The ellipsoid, with the rounding of its targets, errs by "
        f"{off_rad:.0e} rad and {off_m:.0e} m at most"
    )
    return [
        _draw(
            folder / "error_map_angle.png",
            maps[:-1],
            [np.degrees(m.direction_rad) for m in maps[:-1]],
            "Error of the line of sight's direction (deg)",
            rounding,
            "deg",
            (1e-5, 1e2),
            {CAMERA_DEG: "0.03°, a camera's pixel", RADAR_DEG: "1°, a radar's resolution"},
        ),
        _draw(
            folder / "error_map_range.png",
            maps[:-1],
            [m.range_error_m for m in maps[:-1]],
            "Error of the slant range (m)",
            rounding,
            "m",
            (1e-3, 1e5),
            {FINE_RANGE_M: "1 m", RADAR_RANGE_M: "76.2 m, a radar's resolution"},
        ),
    ]


def _draw(
    path: Path,
    maps: list[ErrorMap],
    errors: list[FloatArray],
    title: str,
    note: str,
    unit: str,
    limits: tuple[float, float],
    contours: dict[float, str],
) -> Path:
    from matplotlib.colors import LogNorm
    from matplotlib.lines import Line2D

    from dsa_des.block.mark import RED
    from dsa_des.record.drawing import draw_to_png

    styles: list[Any] = list(zip(contours, ("#FFFFFF", RED), ("--", "-"), strict=True))
    # A column for each model, and one for the bar of shades.
    width_in = 1.4 + 2.0 * len(maps)
    left, pitch = 0.56 / width_in, 2.0 / width_in
    with draw_to_png(width_in, 3.5, path) as figure:
        figure.suptitle(
            f"{title}, worst of all bearings, both aircraft 1 km high\n{note}",
            x=0.06,
            ha="left",
            fontsize=9,
        )
        shades: Any = None
        for column, (shown, error) in enumerate(zip(maps, errors, strict=True)):
            axes = figure.add_axes((left + pitch * column, 0.235, 0.92 * pitch, 0.53))
            inside = np.clip(error, *limits)
            shades = axes.pcolormesh(
                shown.range_m / 1000.0,
                shown.lat_deg,
                inside,
                norm=LogNorm(*limits),
                cmap=_COLOURS,
                shading="gouraud",
                rasterized=True,
            )
            for level, colour, dashes in styles:
                axes.contour(
                    shown.range_m / 1000.0, shown.lat_deg, inside,
                    levels=[level], colors=[colour], linestyles=[dashes], linewidths=1.6,
                )  # fmt: skip
            axes.set_xscale("log")
            axes.set_xlabel("slant range (km)")
            axes.set_xticks([0.1, 1, 10, 100], ["0.1", "1", "10", "100"])
            axes.set_yticks(np.arange(0, 91, 15), [] if column else None)
            axes.set_title(shown.model.replace("_", " "), loc="left")
            if column == 0:
                axes.set_ylabel("latitude (deg)")
        box = (left + pitch * len(maps), 0.235, 0.13 / width_in, 0.53)
        bar = figure.colorbar(shades, cax=figure.add_axes(box))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.set_title(unit, fontsize=9)
        handles = [
            Line2D([], [], color=colour, linestyle=dashes, linewidth=1.6, label=contours[level])
            for level, colour, dashes in styles
        ]
        legend = figure.legend(handles=handles, loc="lower left", ncols=2, bbox_to_anchor=(0.06, 0))
        legend.get_frame().set_facecolor("#5B7C99")
        for text in legend.get_texts():
            text.set_color("#FFFFFF")
    return path
