"""Elevation rasters that lie side by side, put together into one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from components.terrain.raster import ElevationRaster, refuse_many_nodes

# Nodes of neighbours must fall onto each other to this share of a step.
_FIT = 1e-3


def mosaic(rasters: Sequence[ElevationRaster]) -> ElevationRaster:
    """Return one raster of several with the same steps, whose nodes fall onto each other.

    Parameters
    ----------
    rasters : sequence of ElevationRaster
        At least one; together they fill a rectangle. Where two overlap, the later one counts.

    Raises
    ------
    ValueError
        If their steps differ, their nodes do not fit, or the rectangle is not filled.
    """
    first = rasters[0]
    if len(rasters) == 1:
        return first
    steps = first.lat_step_deg, first.lon_step_deg
    corners = []
    for one in rasters:
        if not np.allclose((one.lat_step_deg, one.lon_step_deg), steps, rtol=1e-6):
            raise ValueError(
                f"{one.name} has nodes every {one.lat_step_deg:.6g} by {one.lon_step_deg:.6g} "
                f"degrees, {first.name} every {steps[0]:.6g} by {steps[1]:.6g}: they must be alike"
            )
        # The short way round, so that tiles on both sides of the antimeridian are neighbours.
        east = (one.west_deg - first.west_deg + 180.0) % 360.0 - 180.0
        corner = (one.south_deg - first.south_deg) / steps[0], east / steps[1]
        if any(abs(value - round(value)) > _FIT for value in corner):
            raise ValueError(
                f"the nodes of {one.name} do not fall onto those of {first.name}: one grid must "
                "hold them all"
            )
        corners.append((round(corner[0]), round(corner[1])))
    low = [min(corner[axis] for corner in corners) for axis in (0, 1)]
    high = [
        max(
            corner[axis] + one.height_m.shape[axis]
            for corner, one in zip(corners, rasters, strict=True)
        )
        for axis in (0, 1)
    ]
    rows, columns = high[0] - low[0], high[1] - low[1]
    refuse_many_nodes(f"{first.name} with the others", rows, columns)
    height = np.full((rows, columns), np.nan, dtype=np.float32)
    for (south, west), one in zip(corners, rasters, strict=True):
        at = slice(south - low[0], None), slice(west - low[1], None)
        height[at][: one.height_m.shape[0], : one.height_m.shape[1]] = one.height_m
    return ElevationRaster(
        first.south_deg + low[0] * steps[0],
        first.west_deg + low[1] * steps[1],
        *steps,
        height,
        f"{first.name} and {len(rasters) - 1} more",
    )
