"""The silhouette of a measured aircraft: a table over aspect, interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.table_rows import row_values, table_rows
from components.arguments.checks import FloatArray, broadcast_flat, finite, refuse, unflatten
from components.geometry.angles import past

_SQUARE_FOOT_M2 = 0.3048**2

# Column names for the area, and what one unit of them is in square metres.
AREA_COLUMNS = {
    "area_m2": 1.0,
    "a_m2": 1.0,
    "area": 1.0,
    "area_ft2": _SQUARE_FOOT_M2,
    "a_ft2": _SQUARE_FOOT_M2,
    "a_ft": _SQUARE_FOOT_M2,
}

# A step this much wider than both of its neighbours means that a whole row of nodes is missing.
_WIDEST_STEP_TO_NEIGHBOUR = 1.5


@dataclass(frozen=True, eq=False)
class SilhouetteTable:
    """Hold a projected area over the direction of the observer in the target's body axes.

    Azimuth 0 and elevation 0 is nose-on; azimuth grows towards the right wing (90 = from the
    right, 180 = from the tail), elevation is positive for an observer above the target's wing
    plane, i.e. one who sees its upper side. Interpolation is bilinear in azimuth and elevation
    and wraps in azimuth: exact at the nodes, continuous, never outside the four values around.

    Parameters
    ----------
    azimuth_deg : (n,) array, degrees
        At least three nodes, rising, within one turn [0, 360).
    elevation_deg : (m,) array, degrees
        Rising nodes from -90 to 90.
    area_m2 : (m, n) array, m²
        One row per elevation.

    Raises
    ------
    ValueError
        If the nodes are not in order, leave a hole, or an area is negative or not finite.
    """

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    area_m2: FloatArray

    def __post_init__(self) -> None:
        azimuth = finite("azimuth_deg", self.azimuth_deg)
        elevation = finite("elevation_deg", self.elevation_deg)
        area = finite("area_m2", self.area_m2)
        refuse("area_m2", area, ~(area >= 0.0), "be 0 or more")
        if azimuth.ndim != 1 or azimuth.size < 3:
            raise ValueError(
                f"azimuth_deg has shape {azimuth.shape}: it must hold at least 3 azimuths"
            )
        if elevation.ndim != 1 or elevation.size < 2:
            raise ValueError(
                f"elevation_deg has shape {elevation.shape}: it must hold at least 2 elevations"
            )
        if area.shape != (elevation.size, azimuth.size):
            raise ValueError(
                f"area_m2 has shape {area.shape}: it must be one row per elevation and one column "
                f"per azimuth, {(elevation.size, azimuth.size)}"
            )
        if np.any(np.diff(azimuth) <= 0.0) or azimuth[0] < 0.0 or azimuth[-1] >= 360.0:
            raise ValueError("azimuth_deg must rise from node to node within [0, 360)")
        if np.any(np.diff(elevation) <= 0.0):
            raise ValueError("elevation_deg must rise from node to node")
        if elevation[0] != -90.0 or elevation[-1] != 90.0:
            raise ValueError(
                f"the table has a hole: its elevations run from {elevation[0]:g} to "
                f"{elevation[-1]:g} degrees, they must reach from -90 to 90"
            )
        _refuse_missing_nodes("az_deg", np.append(azimuth, azimuth[0] + 360.0), wraps=True)
        _refuse_missing_nodes("el_deg", elevation, wraps=False)
        object.__setattr__(self, "azimuth_deg", azimuth)
        object.__setattr__(self, "elevation_deg", elevation)
        object.__setattr__(self, "area_m2", area)

    def area(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Interpolate the area at an observer's direction in the target's body axes.

        Parameters
        ----------
        azimuth_rad, elevation_rad : array_like, rad
            Direction of the observer seen from the target; elevation within [-pi/2, pi/2].

        Returns
        -------
        array of the broadcast shape, m²

        Raises
        ------
        ValueError
            If a direction is not finite or an elevation lies beyond the poles.
        """
        elevation = finite("elevation_rad", elevation_rad)
        refuse(
            "elevation_rad",
            elevation,
            ~(np.abs(elevation) <= 0.5 * np.pi + 1e-12),
            "be between -pi/2 and pi/2",
        )
        shape, (azimuth, elevation) = broadcast_flat(
            azimuth_rad=finite("azimuth_rad", azimuth_rad), elevation_rad=elevation
        )
        first = self.azimuth_deg[0]
        turned = past(np.degrees(azimuth) - first, 360.0)
        offsets = self.azimuth_deg - first
        left = np.searchsorted(offsets, turned, side="right") - 1
        right = np.where(left + 1 == offsets.size, 0, left + 1)
        width = np.diff(np.append(offsets, 360.0))[left]
        along = (turned - offsets[left]) / width

        degrees = np.clip(np.degrees(elevation), -90.0, 90.0)
        low = np.searchsorted(self.elevation_deg, degrees, side="right") - 1
        low = np.minimum(low, self.elevation_deg.size - 2)
        upward = (degrees - self.elevation_deg[low]) / np.diff(self.elevation_deg)[low]

        area = self.area_m2
        below = area[low, left] * (1.0 - along) + area[low, right] * along
        above = area[low + 1, left] * (1.0 - along) + area[low + 1, right] * along
        return unflatten(below * (1.0 - upward) + above * upward, shape)


def table_from_nodes(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, area_m2: ArrayLike) -> Any:
    """Build a table from one row per node, in any order.

    Azimuths may lie in any turn; a node given twice (0 and 360) must say the same both times. The
    rows of the poles, where all azimuths are one direction, are averaged.

    Parameters
    ----------
    azimuth_deg, elevation_deg : (k,) array_like, degrees
    area_m2 : (k,) array_like, m²

    Returns
    -------
    SilhouetteTable

    Raises
    ------
    ValueError
        If a node is missing (the first one is named), contradicts itself, or is out of range.
    """
    azimuth = finite("azimuth_deg", azimuth_deg).ravel()
    elevation = finite("elevation_deg", elevation_deg).ravel()
    area = finite("area_m2", area_m2).ravel()
    refuse("el_deg", elevation, ~(np.abs(elevation) <= 90.0), "be between -90 and 90")
    refuse("area_m2", area, ~(area >= 0.0), "be 0 or more")
    turned = past(azimuth, 360.0)
    nodes: dict[tuple[float, float], float] = {}
    for az, el, value in zip(turned.tolist(), elevation.tolist(), area.tolist(), strict=True):
        if nodes.setdefault((az, el), value) != value:
            raise ValueError(
                f"the table gives two areas for the node az_deg {az:g}, el_deg {el:g}: "
                f"{nodes[az, el]:g} and {value:g} m² (azimuths 0 and 360 are one node)"
            )
    azimuths = sorted({az for az, _ in nodes})
    elevations = sorted({el for _, el in nodes})
    for el in elevations:
        for az in azimuths:
            if (az, el) not in nodes:
                raise ValueError(
                    f"the table has a hole: no area for the node az_deg {az:g}, el_deg {el:g}; "
                    "every azimuth needs every elevation"
                )
    rows = np.array([[nodes[az, el] for az in azimuths] for el in elevations])
    for row, el in zip(rows, elevations, strict=True):
        # From straight above every azimuth is the same direction: which node of an uneven row
        # were taken, the sign of a zero would decide.
        if abs(el) == 90.0 and np.ptp(row) > 0.0:
            row[:] = row.mean()
    return SilhouetteTable(np.array(azimuths), np.array(elevations), rows)


def read_aspect_table(path: str | PathLike[str]) -> SilhouetteTable:
    """Read a table from CSV with the columns az_deg, el_deg and an area.

    The area column carries its unit in its name: `area_m2`, `a_m2` or plain `area` are square
    metres, `area_ft2`, `a_ft2` and `a_ft` square feet. Other columns, blank lines and lines that
    start with # are ignored. See `SilhouetteTable` for the axes.

    Parameters
    ----------
    path : path of the file

    Returns
    -------
    SilhouetteTable

    Raises
    ------
    ValueError
        If a column is missing, a cell is not a number, or the table has a hole.
    """
    rows: list[tuple[float, float, float]] = []
    header: list[str] | None = None
    factor = 1.0
    columns: tuple[int, int, int] = (0, 0, 0)
    for number, cells in table_rows(path):
        if header is None:
            header = [cell.strip().lower() for cell in cells]
            columns, factor = _find_columns(path, header)
            continue
        az, el, area = row_values(
            f"{path}, line {number}", header, cells, columns, ("az_deg", "el_deg", "area_m2")
        )
        rows.append((az, el, area * factor))
    if header is None or not rows:
        raise ValueError(f"{path} is empty: it must hold a header and one row per direction")
    nodes = np.array(rows)
    try:
        table: SilhouetteTable = table_from_nodes(nodes[:, 0], nodes[:, 1], nodes[:, 2])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return table


def _find_columns(
    path: str | PathLike[str], header: list[str]
) -> tuple[tuple[int, int, int], float]:
    area_name = next((name for name in AREA_COLUMNS if name in header), None)
    for name in ("az_deg", "el_deg"):
        if name not in header:
            raise ValueError(
                f"{path}: none of its {len(header)} columns is {name}; it must have az_deg, el_deg "
                "and an area"
            )
    if area_name is None:
        raise ValueError(
            f"{path}: none of its {len(header)} columns is an area "
            f"(one of {', '.join(AREA_COLUMNS)})"
        )
    columns = (header.index("az_deg"), header.index("el_deg"), header.index(area_name))
    return columns, AREA_COLUMNS[area_name]


def _refuse_missing_nodes(name: str, nodes: FloatArray, *, wraps: bool) -> None:
    """Refuse a grid in which one step is much wider than the steps on both of its sides."""
    steps = np.diff(nodes)
    if steps.size < 3:
        return
    before, after = np.roll(steps, 1), np.roll(steps, -1)
    if not wraps:
        before[0], after[-1] = after[0], before[-1]
    neighbour = np.maximum(before, after)
    wide = np.flatnonzero(steps > _WIDEST_STEP_TO_NEIGHBOUR * neighbour)
    if wide.size:
        at = int(wide[0])
        missing = float(nodes[at] + neighbour[at]) % 360.0 if wraps else nodes[at] + neighbour[at]
        raise ValueError(
            f"the table has a hole: {name} has no node between {nodes[at]:g} and "
            f"{nodes[at + 1]:g} (expected one near {missing:g})"
        )
