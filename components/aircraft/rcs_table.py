"""An aircraft's radar cross-section as a table over the direction of the radar."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.table_rows import row_values, table_rows
from components.arguments.checks import FloatArray, broadcast_flat, finite, refuse, unflatten
from components.geometry.angles import past

# Beyond this the pole was meant and pi/2 was rounded.
_POLE_DEG = 90.0 + 1e-9


def dbsm_to_m2(rcs_dbsm: ArrayLike) -> Any:
    """Return the RCS in m² of one in dBsm (dB above 1 m²).

    Raises
    ------
    ValueError
        If a value is not within ±1000 dBsm.
    """
    shape, (flat,) = broadcast_flat(rcs=finite("rcs_dbsm", rcs_dbsm))
    refuse("rcs_dbsm", flat, np.abs(flat) > 1000.0, "lie in [-1000, 1000]")
    return unflatten(np.power(10.0, flat / 10.0), shape)


@dataclass(frozen=True, eq=False)
class RcsTable:
    """Hold an RCS over the direction of the radar in the target's body axes.

    Azimuth 0 and elevation 0 is nose-on; azimuth grows towards the right wing (90: seen from the
    right, 180: from the tail), elevation is positive for a radar above the target's wing plane.
    Interpolation is bilinear in dB; azimuth wraps, elevation is held beyond the outermost nodes.

    Parameters
    ----------
    azimuth_deg : (n,) array, degrees
        Rising, from 0 to below 360; spacing may vary.
    elevation_deg : (m,) array, degrees
        Rising, within [-90, 90]; spacing may vary.
    rcs_dbsm : (m, n) array, dBsm
        One row per elevation.

    Raises
    ------
    ValueError
        If the nodes are not in order, the shape does not fit or a value is not finite.
    """

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    rcs_dbsm: FloatArray

    def __post_init__(self) -> None:
        for field in ("azimuth_deg", "elevation_deg", "rcs_dbsm"):
            object.__setattr__(self, field, np.array(finite(field, getattr(self, field))))
        azimuth, elevation = self.azimuth_deg, self.elevation_deg
        for name, nodes in (("azimuth_deg", azimuth), ("elevation_deg", elevation)):
            if nodes.ndim != 1 or nodes.size == 0 or np.any(np.diff(nodes) <= 0.0):
                raise ValueError(f"{name} is {nodes}: it must be a list that rises")
        refuse("azimuth_deg", azimuth, (azimuth < 0.0) | (azimuth >= 360.0), "lie in [0, 360)")
        refuse("elevation_deg", elevation, np.abs(elevation) > 90.0, "lie in [-90, 90]")
        if self.rcs_dbsm.shape != (elevation.size, azimuth.size):
            raise ValueError(
                f"rcs_dbsm has shape {self.rcs_dbsm.shape}: it must be "
                f"{(elevation.size, azimuth.size)}, one row per elevation"
            )

    def dbsm(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Return the RCS in dBsm seen from a direction.

        Parameters
        ----------
        azimuth_rad, elevation_rad : array_like, rad
            Direction of the radar in the target's body axes: any azimuth, elevation within
            [-pi/2, pi/2].

        Returns
        -------
        array of the broadcast shape, dBsm

        Raises
        ------
        ValueError
            If a direction is not finite or an elevation lies beyond the poles.
        """
        shape, (azimuth, elevation) = broadcast_flat(
            azimuth_rad=finite("azimuth_rad", azimuth_rad),
            elevation_rad=finite("elevation_rad", elevation_rad),
        )
        degrees = elevation * (180.0 / np.pi)
        beyond = np.abs(degrees) > _POLE_DEG
        refuse("elevation_rad", elevation, beyond, "lie in [-pi/2, pi/2]")
        first = self.azimuth_deg[0]
        turned = past(azimuth * (180.0 / np.pi) - first, 360.0)
        nodes = np.append(self.azimuth_deg - first, 360.0)
        left = np.searchsorted(nodes, turned, side="right") - 1
        right = np.where(left + 2 == nodes.size, 0, left + 1)
        across = (turned - nodes[left]) / (nodes[left + 1] - nodes[left])

        levels = self.elevation_deg
        held = np.minimum(np.maximum(degrees, levels[0]), levels[-1])
        low = np.minimum(np.searchsorted(levels, held, side="right") - 1, max(levels.size - 2, 0))
        high = np.minimum(low + 1, levels.size - 1)
        step = np.where(high > low, levels[high] - levels[low], 1.0)
        up = (held - levels[low]) / step

        table = self.rcs_dbsm
        lower = table[low, left] * (1.0 - across) + table[low, right] * across
        upper = table[high, left] * (1.0 - across) + table[high, right] * across
        return unflatten(lower * (1.0 - up) + upper * up, shape)

    def rcs_m2(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Return the RCS in m² seen from a direction; see `dbsm`."""
        return dbsm_to_m2(self.dbsm(azimuth_rad, elevation_rad))

    @staticmethod
    def from_rows(
        az_deg: ArrayLike, el_deg: ArrayLike, dbsm: ArrayLike, *, symmetric: bool = False
    ) -> RcsTable:
        """Build a table from one row per node, in any order.

        Parameters
        ----------
        az_deg, el_deg, dbsm : (k,) array_like
            Azimuths in any turn; a node that appears twice (0 and 360) must say the same.
        symmetric : bool
            The rows cover azimuths 0 to 180; the left side mirrors the right one.

        Returns
        -------
        RcsTable

        Raises
        ------
        ValueError
            If a node is missing (it is named), contradicts itself or is out of range.
        """
        columns = [
            finite(name, value).reshape(-1)
            for name, value in (("az_deg", az_deg), ("el_deg", el_deg), ("dbsm", dbsm))
        ]
        if len({column.size for column in columns}) != 1 or columns[0].size == 0:
            sizes = ", ".join(str(column.size) for column in columns)
            raise ValueError(f"az_deg, el_deg and dbsm have {sizes} rows: they must agree")
        if symmetric:
            outside = (columns[0] < 0.0) | (columns[0] > 180.0)
            refuse("az_deg", columns[0], outside, "lie in [0, 180] in a symmetric table")
        values: dict[tuple[float, float], float] = {}
        for az, el, value in zip(*(column.tolist() for column in columns), strict=True):
            # 360 is 0; the mirror image of az is 360 - az.
            for turned in {az % 360.0, -az % 360.0} if symmetric else {az % 360.0}:
                node = (0.0 if turned == 360.0 else turned, el)
                if values.setdefault(node, value) != value:
                    raise ValueError(
                        f"dbsm is {value:g} and {values[node]:g} at az_deg {node[0]:g}, "
                        f"el_deg {el:g}: it must be one value"
                    )
        azimuths = sorted({az for az, _ in values})
        elevations = sorted({el for _, el in values})
        for node in ((az, el) for el in elevations for az in azimuths):
            if node not in values:
                raise ValueError(
                    f"the table has a hole: no value at az_deg {node[0]:g}, el_deg {node[1]:g}; "
                    "it must have every azimuth at every elevation"
                )
        grid = [[values[az, el] for az in azimuths] for el in elevations]
        return RcsTable(np.array(azimuths), np.array(elevations), np.array(grid))

    @staticmethod
    def from_csv(path: str | PathLike[str], *, symmetric: bool = False) -> RcsTable:
        """Read a table from CSV with the columns az_deg, el_deg and dbsm.

        Column names may be written in capitals, in any order, among others; rows may be in any
        order; blank lines and lines that start with # are skipped.

        Parameters
        ----------
        path : path of the file
        symmetric : bool
            As for `from_rows`.

        Returns
        -------
        RcsTable

        Raises
        ------
        ValueError
            If a column is missing, a cell is not a number, or the table has a hole.
        """
        wanted = ("az_deg", "el_deg", "dbsm")
        header: list[str] = []
        rows: list[list[float]] = []
        for number, cells in table_rows(path):
            if not header:
                header = [cell.strip().lower() for cell in cells]
                for name in wanted:
                    if name not in header:
                        raise ValueError(
                            f"{path}: none of its {len(header)} columns is {name}; it must have "
                            f"{', '.join(wanted)}"
                        )
                continue
            columns = [header.index(name) for name in wanted]
            quantities = ("az_deg", "el_deg", "rcs_dbsm")
            rows.append(row_values(f"{path}, line {number}", header, cells, columns, quantities))
        if not rows:
            raise ValueError(f"{path} is empty: it must have a header and one row per direction")
        nodes = np.array(rows)
        try:
            return RcsTable.from_rows(*nodes.T, symmetric=symmetric)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
