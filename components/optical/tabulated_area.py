"""How large is each target by its own measured silhouette?"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from components.optical.silhouette import visible_area
from components.sensor import Cells
from dsa_des.types import FloatArray


def tabulated_area(cells: Cells, path: str) -> FloatArray:
    """Look each cell's area up in its aircraft's table over aspect.

    Parameters
    ----------
    cells : Cells
    path : {"eo.silhouette_table", "ir.silhouette_table"}

    Returns
    -------
    (cells,) array, m²

    Raises
    ------
    ValueError
        If a target has no such table, whether in sight or not.
    """
    tables, place = cells.roster.tables(path)
    missing = np.flatnonzero(place < 0)
    if missing.size:
        name = cells.roster.names[missing[0]]
        raise ValueError(
            f"{path} of target {name!r} is None: silhouette 'aspect_table' needs a table of every "
            "target"
        )
    return area_by_table(cells, {"table": [tables[index] for index in place]}, "aspect_table")


def area_by_table(cells: Cells, of_target: Mapping[str, Sequence[Any]], model: str) -> FloatArray:
    """Look each cell's area up in what its target has: a table over aspect, or a mesh.

    Parameters
    ----------
    cells : Cells
    of_target : mapping
        ``table`` or ``mesh``, one per target of the roster; equal ones may be shared.
    model : {"aspect_table", "convex_hull"}

    Returns
    -------
    (cells,) array, m²
    """
    ((kind, measured),) = of_target.items()
    distinct = list({id(item): item for item in measured}.values())
    which = np.array([next(i for i, d in enumerate(distinct) if d is m) for m in measured])
    area = np.empty(len(cells))
    for index, item in enumerate(distinct):
        chosen = np.flatnonzero(which[cells.target] == index)
        area[chosen] = visible_area(
            cells.relative_heading_rad[chosen],
            cells.target_pitch_rad[chosen],
            cells.target_roll_rad[chosen],
            cells.elevation_rad[chosen],
            model=model,
            **{kind: item},
        )
    return area
