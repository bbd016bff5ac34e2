"""The area of each target by its own measured silhouette."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.optical.silhouette import visible_area
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray


def table_of_targets(roster: Roster, path: str) -> list[Any]:
    """Return every target's own table over aspect.

    Parameters
    ----------
    roster : Roster
    path : {"eo.silhouette_table", "ir.silhouette_table"}

    Raises
    ------
    ValueError
        If a target has none.
    """
    tables, place = roster.tables(path)
    missing = np.flatnonzero(place < 0)
    if missing.size:
        name = roster.names[missing[0]]
        more = f" (and of {missing.size - 1} more)" if missing.size > 1 else ""
        raise ValueError(
            f"{path} of target {name!r}{more} is None: silhouette 'aspect_table' needs a table of "
            "every target"
        )
    return [tables[index] for index in place]


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
        chosen = np.flatnonzero(which[cells.craft] == index)
        area[chosen] = visible_area(
            cells.relative_heading_rad[chosen],
            cells.target_pitch_rad[chosen],
            cells.target_roll_rad[chosen],
            cells.elevation_rad[chosen],
            model=model,
            **{kind: item},
        )
    return area
