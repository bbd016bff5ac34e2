"""The number of resolution cells in a radar's field of view."""

from __future__ import annotations

import math
from dataclasses import dataclass

from components.arguments.checks import positive

MOST_CELLS = 10**15


@dataclass(frozen=True)
class ResolutionCells:
    """Describe the grid of resolution cells that fills a radar's field of view.

    Build it with `resolution_cells`.

    Parameters
    ----------
    azimuth, elevation, range : int
        Number of cells along each axis.
    azimuth_rad, elevation_rad, range_m : (float, float)
        First edge and width of the field of view along each axis.
    """

    azimuth: int
    elevation: int
    range: int
    azimuth_rad: tuple[float, float]
    elevation_rad: tuple[float, float]
    range_m: tuple[float, float]

    @property
    def count(self) -> int:
        """Number of resolution cells."""
        return self.azimuth * self.elevation * self.range


def resolution_cells(
    *,
    azimuth_width_rad: float,
    lowest_elevation_rad: float,
    highest_elevation_rad: float,
    nearest_m: float,
    farthest_m: float,
    azimuth_cell_rad: float,
    elevation_cell_rad: float,
    range_cell_m: float,
    azimuth_start_rad: float = 0.0,
) -> ResolutionCells:
    """Return the grid of resolution cells of a field of view.

    Parameters
    ----------
    azimuth_start_rad, azimuth_width_rad : float, rad
        The field of view runs clockwise from the start over the width, (0, 2π].
    lowest_elevation_rad, highest_elevation_rad : float, rad
    nearest_m, farthest_m : float, m
        Ranges processed; blind range excluded.
    azimuth_cell_rad, elevation_cell_rad, range_cell_m : float
        Size of a resolution cell, above 0. A remainder counts as a cell; the cells of an axis are
        then made equally a little smaller, so that they fill the field of view.

    Returns
    -------
    ResolutionCells

    Raises
    ------
    ValueError
        If an argument is out of range, or there would be over 1e15 cells.
    """
    values = {
        "azimuth_cell_rad": azimuth_cell_rad,
        "elevation_cell_rad": elevation_cell_rad,
        "range_cell_m": range_cell_m,
        "azimuth_width_rad": azimuth_width_rad,
    }
    for name, value in values.items():
        positive(name, value)
    if not azimuth_width_rad <= 2.0 * math.pi * (1.0 + 1e-12):
        raise ValueError(f"azimuth_width_rad is {azimuth_width_rad:g}: it must be at most 2π")
    if not lowest_elevation_rad <= highest_elevation_rad:
        raise ValueError(
            f"highest_elevation_rad is {highest_elevation_rad:g}: it must be at least "
            f"lowest_elevation_rad, {lowest_elevation_rad:g}"
        )
    if not (0.0 <= nearest_m < farthest_m and math.isfinite(farthest_m)):
        raise ValueError(
            f"farthest_m is {farthest_m:g}: it must be finite and above nearest_m, {nearest_m:g}, "
            "which must be 0 or more"
        )
    widths = (
        (azimuth_width_rad, azimuth_cell_rad),
        (highest_elevation_rad - lowest_elevation_rad, elevation_cell_rad),
        (farthest_m - nearest_m, range_cell_m),
    )
    # A width that is a whole number of cells up to rounding has that many.
    counts = [max(1, math.ceil(width / cell - 1e-9)) for width, cell in widths]
    cells = ResolutionCells(
        azimuth=counts[0],
        elevation=counts[1],
        range=counts[2],
        azimuth_rad=(azimuth_start_rad, widths[0][0]),
        elevation_rad=(lowest_elevation_rad, widths[1][0]),
        range_m=(nearest_m, widths[2][0]),
    )
    if cells.count > MOST_CELLS:
        raise ValueError(
            f"the field of view has {cells.count:g} resolution cells: it must have at most 1e15; "
            "make the cells larger"
        )
    return cells
