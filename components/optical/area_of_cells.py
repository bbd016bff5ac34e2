"""The area that each cell's target shows, by the camera's choice of silhouette."""

from typing import Any

import numpy as np

from components.optical.infrared_area import infrared_area
from components.optical.sampled_silhouette import body_mesh, sampled_table
from components.optical.silhouette import visible_area
from components.optical.tabulated_area import area_by_table, tabulated_area
from components.sensor import Cells
from dsa_des.types import FloatArray

# Cells worked on together, so that what is in flight stays in the processor's cache.
CELLS_AT_ONCE = 8192

_BODIES = ("front_m2", "side_m2", "horizontal_m2")


def area_of_cells(cells: Cells, band: str, silhouette: str) -> FloatArray:
    """Return each cell's area.

    Parameters
    ----------
    cells : Cells
    band : {"eo", "ir"}
        Whose areas of the aircraft; ``ir`` has a back of its own.
    silhouette : str
        A model of `components.optical.silhouette.visible_area`, ``sampled_table`` or ``mesh``.

    Returns
    -------
    (cells,) array, m²

    Raises
    ------
    ValueError
        If a target lacks what the silhouette needs, whether in sight or not.
    """
    if silhouette == "aspect_table":
        return tabulated_area(cells, f"{band}.silhouette_table")
    names = (*_BODIES, "back_m2") if band == "ir" else _BODIES
    areas = {name: cells.roster.column(f"{band}.{name}") for name in names}
    if silhouette == "sampled_table":
        tables = [sampled_table(*map(float, row)) for row in zip(*areas.values(), strict=True)]
        return area_by_table(cells, {"table": tables}, "aspect_table")
    if silhouette == "mesh":
        return area_by_table(cells, {"mesh": _meshes(cells, areas)}, "convex_hull")
    compute: Any = infrared_area if band == "ir" else visible_area
    view = (
        cells.relative_heading_rad,
        cells.target_pitch_rad,
        cells.target_roll_rad,
        cells.elevation_rad,
    )
    shown = {name: cells.of_target(column) for name, column in areas.items()}
    if len(cells) <= CELLS_AT_ONCE:
        small: FloatArray = compute(*view, model=silhouette, validate=False, **shown)
        return small
    area = np.empty(len(cells))
    for start in range(0, len(cells), CELLS_AT_ONCE):
        block = slice(start, start + CELLS_AT_ONCE)
        area[block] = compute(
            *(angle[block] for angle in view),
            model=silhouette,
            validate=False,
            **{name: values[block] for name, values in shown.items()},
        )
    return area


def _meshes(cells: Cells, areas: dict[str, FloatArray]) -> list[object]:
    meshes: list[object] = []
    for target, name in enumerate(cells.roster.names):
        front, side, horizontal = (float(areas[key][target]) for key in _BODIES)
        if "back_m2" in areas and areas["back_m2"][target] != front:
            raise ValueError(
                f"target {name!r} has ir.back_m2 {areas['back_m2'][target]:g} and ir.front_m2 "
                f"{front:g}: silhouette 'mesh' needs them alike, a mesh has one shape"
            )
        meshes.append(body_mesh(front, side, horizontal))
    return meshes
