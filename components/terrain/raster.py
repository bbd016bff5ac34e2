"""An elevation raster: heights of the ground at the nodes of a grid in latitude and longitude."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from components.arguments.checks import FloatArray
from components.geometry.ellipsoid import radii_of_curvature
from components.geometry.normals import RAD_PER_DEG
from components.geometry.wrapping import past

# Longitudes are met to this share of a step at the raster's edges: a degree is not exact in them.
_EDGE = 1e-6

#: Heights that are held at most: seven square degrees at 30 m, some 0.4 GB, thrice that while read.
MOST_NODES = 100_000_000


def refuse_many_nodes(name: str, rows: int, columns: int) -> None:
    """Raise ValueError if a raster is larger than what is held; before any of it is read."""
    if rows * columns > MOST_NODES:
        raise ValueError(
            f"{name} spans {rows:,} by {columns:,} nodes: at most {MOST_NODES:,} are held; cut it "
            "to where the scene's flights are (gdalwarp -te WEST SOUTH EAST NORTH) or make it "
            "coarser (-tr)"
        )


@dataclass(frozen=True, eq=False)
class ElevationRaster:
    """Heights at nodes, between which they are bilinear.

    Parameters
    ----------
    south_deg, west_deg : float
        Latitude of the first row, longitude of the first column.
    lat_step_deg, lon_step_deg : float
        Above 0.
    height_m : (rows, columns)
        Rows from south to north, columns from west to east; finite.
    name : str
        The file, for messages.

    Raises
    ------
    ValueError
        If there are holes, or the grid is none.
    """

    south_deg: float
    west_deg: float
    lat_step_deg: float
    lon_step_deg: float
    height_m: npt.NDArray[np.floating[Any]]
    name: str = "raster"

    def __post_init__(self) -> None:
        rows, columns = self.height_m.shape
        if rows < 2 or columns < 2:
            raise ValueError(f"{self.name} has {rows} by {columns} nodes: at least 2 by 2 make one")
        if not (self.lat_step_deg > 0.0 and self.lon_step_deg > 0.0):
            raise ValueError(f"{self.name}: the steps between its nodes must be above 0")
        north = self.south_deg + (rows - 1) * self.lat_step_deg
        turn = (columns - 1) * self.lon_step_deg
        if self.south_deg < -90.0 - _EDGE or north > 90.0 + _EDGE or turn > 360.0 + _EDGE:
            raise ValueError(
                f"{self.name} runs over latitudes {self.south_deg:g} to {north:g} and {turn:g} "
                "degrees of longitude: it must lie within -90 to 90 and one turn"
            )
        holes = ~np.isfinite(self.height_m)
        if count := int(np.count_nonzero(holes)):
            row, column = (int(i) for i in np.argwhere(holes)[0])
            raise ValueError(
                f"{self.name} has {_holes(count)} at latitude "
                f"{self.south_deg + row * self.lat_step_deg:.6g}, longitude "
                f"{self.west_deg + column * self.lon_step_deg:.6g}: every node must have a height; "
                "fill them first"
            )

    @property
    def north_deg(self) -> float:
        """Latitude of the last row."""
        return self.south_deg + (self.height_m.shape[0] - 1) * self.lat_step_deg

    @property
    def east_deg(self) -> float:
        """Longitude of the last column, from the first one on."""
        return self.west_deg + (self.height_m.shape[1] - 1) * self.lon_step_deg

    @cached_property
    def highest_m(self) -> float:
        """Height of the highest node."""
        return float(self.height_m.max())

    @cached_property
    def spacing_m(self) -> float:
        """Shortest way between neighbouring nodes over the ground."""
        lat = np.array([self.south_deg, self.north_deg])
        meridian, prime_vertical = radii_of_curvature(lat)
        along = float(meridian.min()) * self.lat_step_deg * RAD_PER_DEG
        across = prime_vertical * np.cos(lat * RAD_PER_DEG) * self.lon_step_deg * RAD_PER_DEG
        # Next to a pole the columns meet: a tenth of the rows' step is fine enough there.
        return min(along, max(float(across.min()), 0.1 * along))

    @cached_property
    def largest_step_m(self) -> float:
        """Largest difference in height between neighbouring nodes."""
        steps = (np.abs(np.diff(self.height_m, axis=axis)).max() for axis in (0, 1))
        return float(max(steps))

    def box(self) -> str:
        """Return what it covers, for messages."""
        return (
            f"latitudes {self.south_deg:.6g} to {self.north_deg:.6g}, longitudes "
            f"{self.west_deg:.6g} to {self.east_deg:.6g}"
        )

    def place(self, lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places in rows from the south and columns from the west, with fractions."""
        v = (lat_deg - self.south_deg) / self.lat_step_deg
        # Whichever turn the longitude is given in; what lies a rounding west of the first column
        # is on it.
        edge = _EDGE * self.lon_step_deg
        return v, (past(lon_deg - self.west_deg + edge, 360.0) - edge) / self.lon_step_deg

    def height(
        self, lat_deg: FloatArray, lon_deg: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return the heights of the ground (m) at some places, and which lie on the raster.

        Parameters
        ----------
        lat_deg, lon_deg : arrays of one shape

        Returns
        -------
        height_m : array
            Bilinear between nodes; -inf beside the raster, where no ground is known.
        inside : array of bool
        """
        rows, columns = self.height_m.shape
        v, u = self.place(lat_deg, lon_deg)
        inside = (v >= -_EDGE) & (v <= rows - 1 + _EDGE) & (u <= columns - 1 + _EDGE)
        v, u = np.clip(v, 0.0, rows - 1), np.clip(u, 0.0, columns - 1)
        row = np.minimum(v.astype(np.int64), rows - 2)
        column = np.minimum(u.astype(np.int64), columns - 2)
        up, right = v - row, u - column
        flat = self.height_m.reshape(-1)
        at = row * columns + column
        south = flat[at] * (1.0 - right) + flat[at + 1] * right
        at = at + columns
        north = flat[at] * (1.0 - right) + flat[at + 1] * right
        return np.where(inside, south * (1.0 - up) + north * up, -np.inf), inside


def _holes(count: int) -> str:
    if count == 1:
        return "1 hole (a node without a height)"
    return f"{count:,} holes (nodes without a height), the first"
