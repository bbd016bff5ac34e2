"""How large is each target by its own measured silhouette?"""

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
    area = np.empty(len(cells))
    which = place[cells.target]
    for index, table in enumerate(tables):
        chosen = np.flatnonzero(which == index)
        area[chosen] = visible_area(
            cells.relative_heading_rad[chosen],
            cells.target_pitch_rad[chosen],
            cells.target_roll_rad[chosen],
            cells.elevation_rad[chosen],
            model="aspect_table",
            table=table,
        )
    return area
