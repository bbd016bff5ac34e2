"""The width of a radar's field of view, and the resolution cells that fill it."""

import math
from typing import Any

from components.geometry.angles import TWO_PI
from components.geometry.field_of_view import sector_width_rad
from components.messages.reach import Reach
from components.radar.resolution_cells import ResolutionCells, resolution_cells
from components.radar.resolution_parameters import CELL_SIZES


def azimuth_width_rad(reach: Reach) -> float:
    """Return the angle from the first to the second azimuth, clockwise, in (0, 2π]."""
    return min(sector_width_rad(*reach.azimuth_rad), TWO_PI)


def cell_size(parameters: Any) -> tuple[float, float, float]:
    """Return the size of a radar's resolution cell: its beam, or the step of its grid.

    Parameters
    ----------
    parameters : RadarParameters

    Returns
    -------
    azimuth_rad, elevation_rad, range_m : float
        0 where neither is given.
    """
    widths = [
        getattr(parameters, beam, None) or getattr(parameters, step) for beam, step in CELL_SIZES
    ]
    return math.radians(widths[0]), math.radians(widths[1]), float(widths[2])


def cells_of_radar(block: Any) -> ResolutionCells:
    """Return the resolution cells of a radar block's field of view.

    Parameters
    ----------
    block : Sensor
        A radar with a link budget.

    Returns
    -------
    ResolutionCells
        From the minimum range to ``range_km``.

    Raises
    ------
    ValueError
        If a resolution is 0 and no beamwidth given, ``range_km`` is not given, or there is no
        range between the two.
    """
    p = block.p
    azimuth_rad, elevation_rad, range_m = cell_size(p)
    for width, (_, name) in zip((azimuth_rad, elevation_rad, range_m), CELL_SIZES, strict=True):
        if width == 0:
            raise ValueError(
                f"{name} is 0: false alarms are counted by resolution cells, it must be above 0"
            )
    if p.range_km is None:
        raise ValueError(
            "range_km is not given: false alarms are counted by resolution cells up to it"
        )
    if block.budget.nearest_m >= block.reach.range_max_m:
        raise ValueError(
            f"range_km is {p.range_km:g}: it must be above the minimum range, "
            f"{block.budget.nearest_m / 1000:g} km"
        )
    return resolution_cells(
        azimuth_start_rad=block.reach.azimuth_rad[0],
        azimuth_width_rad=azimuth_width_rad(block.reach),
        lowest_elevation_rad=block.reach.elevation_rad[0],
        highest_elevation_rad=block.reach.elevation_rad[1],
        nearest_m=block.budget.nearest_m,
        farthest_m=block.reach.range_max_m,
        azimuth_cell_rad=azimuth_rad,
        elevation_cell_rad=elevation_rad,
        range_cell_m=range_m,
    )
