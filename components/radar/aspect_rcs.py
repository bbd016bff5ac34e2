"""The mean RCS of each target at the aspect that the radar sees."""

import numpy as np

from components.geometry.attitude import aspect_angles
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray


def mean_rcs_m2(cells: Cells) -> FloatArray:
    """Return each cell's mean RCS: from the aircraft's table over aspect, else its constant.

    Parameters
    ----------
    cells : Cells

    Returns
    -------
    (cells,) array, m²
    """
    rcs: FloatArray = cells.of_target(cells.roster.rcs_m2)
    tables, place = cells.roster.tables("rcs_table")
    if not tables:
        return rcs
    # In a frame turned so that the line of sight has bearing 0, the target's yaw is its relative
    # heading.
    azimuth, elevation = aspect_angles(
        np.zeros(len(cells)),
        cells.elevation_rad,
        cells.relative_heading_rad,
        cells.target_pitch_rad,
        cells.target_roll_rad,
    )
    which = place[cells.craft]
    for index, table in enumerate(tables):
        chosen = np.flatnonzero(which == index)
        rcs[chosen] = table.rcs_m2(azimuth[chosen], elevation[chosen])
    return rcs
