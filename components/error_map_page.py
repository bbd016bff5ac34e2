"""The part of docs/accuracy-and-cost.md on where each model of the Earth is good enough."""

import math
import tempfile
from pathlib import Path

import numpy as np

from components.geometry.error_map import (
    CAMERA_DEG,
    RADAR_DEG,
    ErrorMap,
    draw_error_map,
    error_maps,
)
from dsa_des.output_file import write_file

FIGURE = "error_map_angle.png"
_LATITUDES_DEG = np.array([0.0, 30.0, 52.0, 75.0])
_RANGES_M = np.geomspace(100.0, 200e3, 1200)


def error_map_section(images: Path) -> str:
    """Draw the map of errors in direction and return the Markdown around it.

    Parameters
    ----------
    images : Path
        Folder that receives the figure.
    """
    with tempfile.TemporaryDirectory() as folder:
        drawn = {path.name: path for path in draw_error_map(Path(folder))}
        write_file(images / FIGURE, drawn[FIGURE].read_bytes())
    maps = {found.model: found for found in error_maps(_LATITUDES_DEG, _RANGES_M)}
    lines = [
        "`dsa-des cost --map geometry`",
        "",
        f"![Error in direction over range and latitude, one panel per model](images/{FIGURE})",
        "",
        "Largest range, km, up to which the direction stays within a camera's pixel "
        f"({CAMERA_DEG:g}°) and a radar's degree, whatever the bearing, at four latitudes:",
        "",
        "| model | limit | " + " | ".join(f"{lat:g}°" for lat in _LATITUDES_DEG) + " |",
        "|---|---|" + "---|" * len(_LATITUDES_DEG),
    ]
    for model in ("flat_earth", "local_radii", "geodesic"):
        for limit_deg in (CAMERA_DEG, RADAR_DEG):
            cells = [_good_up_to(maps[model], row, limit_deg) for row in range(len(_LATITUDES_DEG))]
            lines.append(f"| {model} | {limit_deg:g}° | {' | '.join(cells)} |")
    scale_deg = math.degrees(maps["flat_earth"].direction_rad[:, 0].max())
    exact = math.ceil(math.log10(maps["ellipsoid"].direction_rad.max()))
    lines += [
        "",
        f"Flat Earth takes a sphere for the ellipsoid, which turns directions by up to "
        f"{scale_deg:.2f}° at any range: a radar does not notice, a camera does wherever it looks "
        "but within a kilometre near 75°. Local radii cure that. What they leave out, the "
        "curvature, grows with range, and the convergence of the meridians with range and "
        "tan(latitude): close to a pole neither holds at any range. Azimuths along the geodesic "
        "with straight-line elevations miss the curvature only. The ellipsoid errs by less than "
        f"1e{exact} rad, which is the rounding of the targets' positions.",
    ]
    return "\n".join(lines)


def _good_up_to(found: ErrorMap, row: int, limit_deg: float) -> str:
    beyond = np.flatnonzero(found.direction_rad[row] > math.radians(limit_deg))
    if not len(beyond):
        return f"over {found.range_m[-1] / 1000:.0f}"
    if beyond[0] == 0:
        return "none"
    km = found.range_m[beyond[0] - 1] / 1000
    return f"{km:.0f}" if km >= 10 else f"{km:.1f}"
