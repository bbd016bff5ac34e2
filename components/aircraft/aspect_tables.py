"""Tables over the direction from which an aircraft is seen: radar cross-section and silhouette.

Azimuth 0 and elevation 0 is nose-on; azimuth grows towards the right wing (90: seen from the right,
180: from the tail), elevation is positive for an observer above the aircraft's wing plane.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, broadcast_flat, check_finite, refuse, unflatten
from components.arguments.units import FOOT_M
from components.geometry import remainder
from dsa_des.block.parameters import refuse_extremes
from dsa_des.files.input_files import InputFileError, read_input_text

# Beyond this the pole was meant and pi/2 was rounded.
_POLE_DEG = 90.0 + 1e-9
_SQUARE_FOOT_M2 = FOOT_M**2

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


def dbsm_to_m2(rcs_dbsm: ArrayLike) -> Any:
    """Return the RCS in m² of one in dBsm (dB above 1 m²)."""
    shape, (flat,) = broadcast_flat(rcs=check_finite("rcs_dbsm", rcs_dbsm))
    refuse("rcs_dbsm", flat, np.abs(flat) > 1000.0, "lie in [-1000, 1000]")
    return unflatten(np.power(10.0, flat / 10.0), shape)


@dataclass(frozen=True, eq=False)
class RcsTable:
    """An RCS (elevations, azimuths), dBsm, over the radar's direction in the target's body axes.

    Azimuths rise from 0 to below 360, elevations within [-90, 90]; spacing may vary. Interpolation
    is bilinear in dB; azimuth wraps, elevation is held beyond the outermost nodes. ValueError says
    what is no such table.
    """

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    rcs_dbsm: FloatArray

    def __post_init__(self) -> None:
        _convert_and_check_grid(self, "rcs_dbsm")

    def dbsm(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Return the RCS in dBsm seen from a direction."""
        nodes = self.azimuth_deg, self.elevation_deg
        return _interpolate(*nodes, self.rcs_dbsm, azimuth_rad, elevation_rad)

    def rcs_m2(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Return the RCS in m² seen from a direction; see `dbsm`."""
        return dbsm_to_m2(self.dbsm(azimuth_rad, elevation_rad))

    @staticmethod
    def from_rows(az_deg: ArrayLike, el_deg: ArrayLike, dbsm: ArrayLike) -> RcsTable:
        """Build a table from one row per node, in any order."""
        return RcsTable(*_grid_from_nodes(az_deg, el_deg, dbsm, "dbsm"))

    @staticmethod
    def from_csv(path: str | PathLike[str]) -> RcsTable:
        """Read a table from CSV with the columns az_deg, el_deg and dbsm."""
        nodes = _read_nodes(path, {"dbsm": 1.0}, "rcs_dbsm", "dbsm")
        try:
            return RcsTable.from_rows(*nodes)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


@dataclass(frozen=True, eq=False)
class SilhouetteTable:
    """A projected area (elevations, azimuths), m², over the direction of the observer in body axes.

    At least three azimuths within one turn, elevations from -90 to 90, none missing. Interpolation
    is bilinear and wraps in azimuth: exact at the nodes, continuous, never outside the four values
    around. ValueError says what is no such table.
    """

    azimuth_deg: FloatArray
    elevation_deg: FloatArray
    area_m2: FloatArray

    def __post_init__(self) -> None:
        _convert_and_check_grid(self, "area_m2")
        azimuth, elevation = self.azimuth_deg, self.elevation_deg
        refuse("area_m2", self.area_m2, ~(self.area_m2 >= 0.0), "be 0 or more")
        if azimuth.size < 3:
            raise ValueError(f"azimuth_deg is {azimuth}: it must hold at least 3 azimuths")
        if elevation[0] != -90.0 or elevation[-1] != 90.0:
            raise ValueError(
                f"the table has a hole: its elevations run from {elevation[0]:g} to "
                f"{elevation[-1]:g} degrees, they must reach from -90 to 90"
            )
        _refuse_gap_in_nodes("az_deg", np.append(azimuth, azimuth[0] + 360.0), wraps=True)
        _refuse_gap_in_nodes("el_deg", elevation, wraps=False)

    def area(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Any:
        """Return the area in m² seen from a direction."""
        nodes = self.azimuth_deg, self.elevation_deg
        return _interpolate(*nodes, self.area_m2, azimuth_rad, elevation_rad)


def silhouette_table_from_nodes(
    azimuth_deg: ArrayLike, elevation_deg: ArrayLike, area_m2: ArrayLike
) -> SilhouetteTable:
    """Build a table of areas from one row per node, in any order.

    The rows of the poles, where all azimuths are one direction, are averaged.
    """
    elevation, area = check_finite("elevation_deg", elevation_deg), check_finite("area_m2", area_m2)
    refuse("el_deg", elevation, ~(np.abs(elevation) <= 90.0), "be between -90 and 90")
    refuse("area_m2", area, ~(area >= 0.0), "be 0 or more")
    azimuths, elevations, rows = _grid_from_nodes(azimuth_deg, elevation, area, "area_m2")
    for row, el in zip(rows, elevations, strict=True):
        # From straight above every azimuth is the same direction: which node of an uneven row
        # were taken, the sign of a zero would decide.
        if abs(el) == 90.0 and np.ptp(row) > 0.0:
            row[:] = row.mean()
    return SilhouetteTable(azimuths, elevations, rows)


def read_silhouette_table(path: str | PathLike[str]) -> SilhouetteTable:
    """Read a table from CSV with the columns az_deg, el_deg and one of `AREA_COLUMNS`."""
    what = f"an area (one of {', '.join(AREA_COLUMNS)})"
    nodes = _read_nodes(path, AREA_COLUMNS, "area_m2", what)
    try:
        return silhouette_table_from_nodes(*nodes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _interpolate(
    nodes_deg: FloatArray,
    levels: FloatArray,
    table: FloatArray,
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
) -> Any:
    """Return the values of a table (elevations `levels`, azimuths `nodes_deg`, both in degrees) at
    directions, bilinear; azimuth wraps, elevation is held at the outermost levels.
    """
    shape, (azimuth, elevation) = broadcast_flat(
        azimuth_rad=check_finite("azimuth_rad", azimuth_rad),
        elevation_rad=check_finite("elevation_rad", elevation_rad),
    )
    degrees = elevation * (180.0 / np.pi)
    refuse("elevation_rad", elevation, np.abs(degrees) > _POLE_DEG, "lie in [-pi/2, pi/2]")
    first = nodes_deg[0]
    turned = remainder(azimuth * (180.0 / np.pi) - first, 360.0)
    nodes = np.append(nodes_deg - first, 360.0)
    left = np.searchsorted(nodes, turned, side="right") - 1
    right = np.where(left + 2 == nodes.size, 0, left + 1)
    across = (turned - nodes[left]) / (nodes[left + 1] - nodes[left])

    held = np.minimum(np.maximum(degrees, levels[0]), levels[-1])
    low = np.minimum(np.searchsorted(levels, held, side="right") - 1, max(levels.size - 2, 0))
    high = np.minimum(low + 1, levels.size - 1)
    step = np.where(high > low, levels[high] - levels[low], 1.0)
    up = (held - levels[low]) / step

    lower = table[low, left] * (1.0 - across) + table[low, right] * across
    upper = table[high, left] * (1.0 - across) + table[high, right] * across
    return unflatten(lower * (1.0 - up) + upper * up, shape)


def _convert_and_check_grid(table: Any, values: str) -> None:
    """Convert the nodes and values of a table to arrays in place, and raise ValueError unless nodes
    rise and the shape is (elevations, azimuths).
    """
    for field in ("azimuth_deg", "elevation_deg", values):
        object.__setattr__(table, field, np.array(check_finite(field, getattr(table, field))))
    azimuth, elevation = table.azimuth_deg, table.elevation_deg
    for name, nodes in (("azimuth_deg", azimuth), ("elevation_deg", elevation)):
        if nodes.ndim != 1 or nodes.size == 0 or np.any(np.diff(nodes) <= 0.0):
            raise ValueError(f"{name} is {nodes}: it must be a list that rises")
    refuse("azimuth_deg", azimuth, (azimuth < 0.0) | (azimuth >= 360.0), "lie in [0, 360)")
    refuse("elevation_deg", elevation, np.abs(elevation) > 90.0, "lie in [-90, 90]")
    shape = getattr(table, values).shape
    if shape != (elevation.size, azimuth.size):
        raise ValueError(
            f"{values} has shape {shape}: it must be {(elevation.size, azimuth.size)}, one row per "
            "elevation"
        )


def _grid_from_nodes(
    az_deg: ArrayLike, el_deg: ArrayLike, values: ArrayLike, name: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sorted azimuths, elevations and values (elevations, azimuths); ValueError on holes."""
    columns = [
        check_finite(column, given).reshape(-1)
        for column, given in (("az_deg", az_deg), ("el_deg", el_deg), (name, values))
    ]
    if len({column.size for column in columns}) != 1 or columns[0].size == 0:
        sizes = ", ".join(str(column.size) for column in columns)
        raise ValueError(f"az_deg, el_deg and {name} have {sizes} rows: they must agree")
    columns[0] = remainder(columns[0], 360.0)
    known: dict[tuple[float, float], float] = {}
    for az, el, value in zip(*(column.tolist() for column in columns), strict=True):
        if known.setdefault((az, el), value) != value:
            raise ValueError(
                f"{name} is {value:g} and {known[az, el]:g} at az_deg {az:g}, el_deg {el:g}: it "
                "must be one value (azimuths 0 and 360 are one node)"
            )
    azimuths = sorted({az for az, _ in known})
    elevations = sorted({el for _, el in known})
    for node in ((az, el) for el in elevations for az in azimuths):
        if node not in known:
            raise ValueError(
                f"the table has a hole: no value at az_deg {node[0]:g}, el_deg {node[1]:g}; "
                "it must have every azimuth at every elevation"
            )
    grid = np.array([[known[az, el] for az in azimuths] for el in elevations])
    return np.array(azimuths), np.array(elevations), grid


def _read_nodes(
    path: str | PathLike[str], values: Mapping[str, float], quantity: str, what: str
) -> FloatArray:
    """Return azimuths, elevations (deg) and values (3, nodes) of a CSV file.

    Columns may stand in any order among others, and their names be in capitals; `values` says by
    which names the values go, and what one unit of each is.
    """
    header: list[str] = []
    rows: list[list[float]] = []
    columns: list[int] = []
    factor = 1.0
    for number, cells in _iterate_csv_rows(path):
        if not header:
            header = [cell.strip().lower() for cell in cells]
            value = next((name for name in values if name in header), None)
            for name, shown in (("az_deg", "az_deg"), ("el_deg", "el_deg"), (value, what)):
                if name not in header:
                    raise ValueError(
                        f"{path}: none of its {len(header)} columns is {shown}; it must have "
                        f"az_deg, el_deg, {what}"
                    )
            assert value is not None
            columns = [header.index(name) for name in ("az_deg", "el_deg", value)]
            factor = values[value]
            continue
        quantities = ("az_deg", "el_deg", quantity)
        rows.append(_row_values(f"{path}, line {number}", header, cells, columns, quantities))
    if not rows:
        raise ValueError(f"{path} is empty: it must have a header and one row per direction")
    nodes: FloatArray = np.array(rows).T
    nodes[2] *= factor
    return nodes


def _iterate_csv_rows(path: str | PathLike[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield line number (from 1) and cells of each CSV row that is not empty or a comment (#).

    A cell never spans lines, so that a stray quote cannot swallow what follows it.
    """
    try:
        text = read_input_text(Path(path))
    except InputFileError as error:
        raise ValueError(f"{path}: {error}") from None
    for number, line in enumerate(text.replace("\r", "\n").split("\n"), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = next(csv.reader([line]))
        except csv.Error as error:
            raise ValueError(f"{path}, line {number}: cannot be read: {error}") from None
        if any(cell.strip() for cell in cells):
            yield number, cells


def _row_values(
    where: str,
    header: Sequence[str],
    cells: Sequence[str],
    columns: Sequence[int],
    quantities: Sequence[str],
) -> list[float]:
    """Return numbers in columns of a row; ValueError for one missing, not a number or absurd."""
    values = []
    for column, quantity in zip(columns, quantities, strict=True):
        try:
            value = float(cells[column].replace("_", "no number"))
        except (ValueError, IndexError):
            wanted = ", ".join(header[column] for column in columns)
            raise ValueError(
                f"{where}: it must have a number in each of the columns {wanted}"
            ) from None
        try:
            refuse_extremes(quantity, value)
        except ValueError as error:
            raise ValueError(f"{where}: {header[column]} is {value:g}: {error}") from None
        values.append(value)
    return values


def _refuse_gap_in_nodes(name: str, nodes: FloatArray, *, wraps: bool) -> None:
    """Raise ValueError where a step is much wider than both beside it, as if a node is missing."""
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
