"""An elevation raster: heights of the ground at the nodes of a grid in latitude and longitude."""

from __future__ import annotations

import gzip
import io
import math
import re
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import PlainSerializer, PlainValidator, TypeAdapter

from components.geometry import RAD_PER_DEG, radii_of_curvature, remainder
from components.terrain.voids import MOST_VOIDS, fill_voids
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import ScenePath
from dsa_des.files.input_files import InputFileError, cache_file_reads, readable_file_status
from dsa_des.text.safe_text import shorten

# Longitudes are met to this share of a step at the raster's edges: a degree is not exact in them.
_EDGE = 1e-6

#: Heights that are held at most: seven square degrees at 30 m, some 0.4 GB, thrice that while read.
MOST_NODES = 100_000_000


def refuse_many_nodes(name: str, rows: int, columns: int) -> None:
    """Raise ValueError, before it is read, if a raster has more nodes than memory may hold."""
    if rows * columns > MOST_NODES:
        raise ValueError(
            f"{name} spans {rows:,} by {columns:,} nodes: at most {MOST_NODES:,} are held; cut it "
            "to where the scene's flights are (gdalwarp -te WEST SOUTH EAST NORTH) or make it "
            "coarser (-tr)"
        )


@dataclass(frozen=True, eq=False)
class ElevationRaster:
    """Terrain heights at the nodes of a regular grid, interpolated bilinearly between them."""

    south_deg: float  # Latitude of the first row, longitude of the first column
    west_deg: float
    lat_step_deg: float  # Above 0
    lon_step_deg: float
    # (rows, columns): rows from south to north, columns from west to east; finite
    height_m: npt.NDArray[np.floating[Any]]
    name: str = "raster"  # The file, for messages
    filled: int = 0  # How many nodes had no height in the file, and have one of their rim

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
                f"{self.name} has {_holes_text(count)} at latitude "
                f"{self.south_deg + row * self.lat_step_deg:.6g}, longitude "
                f"{self.west_deg + column * self.lon_step_deg:.6g}: every node must have a height, "
                f"and up to {MOST_VOIDS:.0%} of a file's nodes are filled from around them; fill "
                "them first"
            )

    @property
    def north_deg(self) -> float:
        """Latitude of the northernmost row, deg."""
        return self.south_deg + (self.height_m.shape[0] - 1) * self.lat_step_deg

    @property
    def east_deg(self) -> float:
        """Longitude of the last column, deg, counted from the first without wrapping at 180."""
        return self.west_deg + (self.height_m.shape[1] - 1) * self.lon_step_deg

    @cached_property
    def highest_m(self) -> float:
        """Height of the highest node."""
        return float(self.height_m.max())

    @cached_property
    def spacing_m(self) -> float:
        """Smallest horizontal distance between neighbouring nodes, m."""
        lat = np.array([self.south_deg, self.north_deg])
        meridian, prime_vertical = radii_of_curvature(lat)
        along = float(meridian.min()) * self.lat_step_deg * RAD_PER_DEG
        across = prime_vertical * np.cos(lat * RAD_PER_DEG) * self.lon_step_deg * RAD_PER_DEG
        # Next to a pole the columns meet: a tenth of the rows' step is fine enough there.
        return min(along, max(float(across.min()), 0.1 * along))

    @cached_property
    def largest_height_step_m(self) -> float:
        """Largest height difference between neighbouring nodes, m."""
        steps = (np.abs(np.diff(self.height_m, axis=axis)).max() for axis in (0, 1))
        return float(max(steps))

    def bounds_text(self) -> str:
        """Return the bounds of the raster as text, for messages."""
        return (
            f"latitudes {self.south_deg:.6g} to {self.north_deg:.6g}, longitudes "
            f"{self.west_deg:.6g} to {self.east_deg:.6g}"
        )

    def fractional_row_and_column(
        self, lat_deg: FloatArray, lon_deg: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return positions as fractional rows from the south and columns from the west."""
        v = (lat_deg - self.south_deg) / self.lat_step_deg
        # Whichever turn the longitude is given in; what lies a rounding west of the first column
        # is on it.
        edge = _EDGE * self.lon_step_deg
        return v, (remainder(lon_deg - self.west_deg + edge, 360.0) - edge) / self.lon_step_deg

    def heights_and_coverage(
        self, lat_deg: FloatArray, lon_deg: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return ground heights (m; -inf outside the raster) and which positions are on it."""
        rows, columns = self.height_m.shape
        v, u = self.fractional_row_and_column(lat_deg, lon_deg)
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


def _holes_text(count: int) -> str:
    if count == 1:
        return "1 hole (a node without a height)"
    return f"{count:,} holes (nodes without a height), the first"


# Nodes of neighbours must fall onto each other to this share of a step.
_FIT = 1e-3


def mosaic(rasters: Sequence[ElevationRaster]) -> ElevationRaster:
    """Return one raster that joins several rasters of the same steps whose nodes coincide.

    Together they fill a rectangle; where two overlap, the later one counts. ValueError if their
    steps differ, their nodes do not fit, or the rectangle is not filled.
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
        sum(one.filled for one in rasters),
    )


#: A raster of 3601 by 3601 nodes has 26 MB as .hgt; GeoTIFFs of several degrees are larger.
LARGEST_RASTER_BYTES = 1024 * 1024 * 1024

_VOID = -32768
_CORNER = re.compile(r"([NS])(\d{1,2})([EW])(\d{1,3})", re.IGNORECASE)
_TIFF = (".tif", ".tiff")
_PATH: TypeAdapter[Path] = TypeAdapter(ScenePath)


@dataclass(frozen=True)
class RasterOfFile:
    """A raster that was read when the scene was checked, with the paths of its files."""

    paths: tuple[Path, ...]  # Of one file, or of several that lie side by side
    raster: ElevationRaster


def read_raster(path: Path) -> ElevationRaster:
    """Read an elevation raster; the file's ending says which kind it is.

    Parameters
    ----------
    path : Path
        ``.hgt``: one degree by one degree, its south-west corner in its name (N45W076.hgt), rows
        from north to south of big-endian 16-bit metres, as many rows as columns, the edges
        included; also packed (``.hgt.zip``, ``.hgt.gz``). ``.tif``, ``.tiff``: GeoTIFF in
        longitude and latitude, north up.

    Raises
    ------
    ValueError
        If it cannot be read, is of another kind, has more holes than are filled, or needs a package
        that is missing.
    """
    name = shorten(path.name, 80)
    if re.fullmatch(r".*\.hgt(\.zip|\.gz)?", path.name.lower()):
        return _read_hgt(path, name)
    if path.suffix.lower() in _TIFF:
        return _read_geotiff(path, name)
    raise ValueError(f"{name}: an elevation raster must be .hgt (SRTM), .tif or .tiff (GeoTIFF)")


def _read_hgt(path: Path, name: str) -> ElevationRaster:
    match = _CORNER.match(path.stem)
    if match is None:
        raise ValueError(
            f"{name}: the name of an .hgt file must say its south-west corner, as N45W076.hgt does"
        )
    data = _content_of_file_or_archive(path, name)
    nodes = math.isqrt(len(data) // 2)
    refuse_many_nodes(name, nodes, nodes)
    if nodes < 2 or 2 * nodes * nodes != len(data):
        raise ValueError(
            f"{name} has {len(data):,} bytes: an .hgt file holds as many rows as columns of two "
            "bytes each (1201 or 3601 of them in SRTM)"
        )
    rows = np.frombuffer(data, dtype=">i2").reshape(nodes, nodes)[::-1]
    height, filled = fill_voids(np.where(rows == _VOID, np.nan, rows).astype(np.float32))
    south = int(match[2]) * (1.0 if match[1].upper() == "N" else -1.0)
    west = int(match[4]) * (1.0 if match[3].upper() == "E" else -1.0)
    step = 1.0 / (nodes - 1)
    return ElevationRaster(south, west, step, step, height, name, filled)


def _content_of_file_or_archive(path: Path, name: str) -> bytes:
    """Return the content of a file, or of the one .hgt in an archive."""
    refuse_many_nodes(name, 1, path.stat().st_size // 2)
    data = path.read_bytes()
    most = 2 * MOST_NODES + 1
    try:
        if data.startswith(b"\x1f\x8b"):
            with gzip.open(io.BytesIO(data)) as file:
                return file.read(most)
        if data.startswith(b"PK\x03\x04"):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                inside = [one for one in archive.namelist() if one.lower().endswith(".hgt")]
                if len(inside) != 1:
                    raise ValueError(f"{name} holds {len(inside)} .hgt files: one is needed")
                with archive.open(inside[0]) as file:
                    return file.read(most)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
    ) as e:
        raise ValueError(f"{name} is a damaged archive: {e}") from None
    return data


def _read_geotiff(path: Path, name: str) -> ElevationRaster:
    try:
        import rasterio
        from rasterio.errors import RasterioError
    except ImportError:
        raise ValueError(
            f"{name}: reading a GeoTIFF needs the package rasterio: "
            "pip install 'dsa-des[geotiff]', or give the raster as .hgt"
        ) from None
    try:
        with rasterio.open(path) as file:
            refuse_many_nodes(name, file.height, file.width)
            band = file.read(1, masked=True)
            crs, transform = file.crs, file.transform
    except (RasterioError, OSError) as error:
        raise ValueError(f"{name} is no GeoTIFF that can be read: {error}") from None
    if crs is None or not crs.is_geographic:
        raise ValueError(
            f"{name} is in the coordinate system {crs}: it must be in longitude and latitude "
            "(such as EPSG:4326); gdalwarp -t_srs EPSG:4326 makes one"
        )
    if transform.b or transform.d or transform.a <= 0.0 or transform.e >= 0.0:
        raise ValueError(f"{name} is turned or upside down: its rows must run from north to south")
    height, filled = fill_voids(np.ma.filled(band.astype(np.float32), np.nan)[::-1])
    # The transform gives the corners of pixels; heights are those of their middles.
    west = transform.c + 0.5 * transform.a
    south = transform.f + (height.shape[0] - 0.5) * transform.e
    return ElevationRaster(south, west, transform.a, -transform.e, np.array(height), name, filled)


#: Runs of a study that name the same file share one raster.
_read_once = cache_file_reads(8)(read_raster)


@lru_cache(maxsize=2)
def _join_rasters(rasters: tuple[ElevationRaster, ...]) -> ElevationRaster:
    return mosaic(rasters)


def _validate(value: Any) -> RasterOfFile:
    if isinstance(value, RasterOfFile):
        return value
    if isinstance(value, list) and not value:
        raise ValueError("must name at least one file")
    paths, rasters = [], []
    for item in value if isinstance(value, list) else [value]:
        path = _PATH.validate_python(item)
        name = shorten(str(path), 300)
        try:
            readable_file_status(path, LARGEST_RASTER_BYTES)
            rasters.append(_read_once(path))
        except InputFileError as error:
            raise ValueError(f"must be a raster that can be read: {name}: {error}") from None
        paths.append(path)
    return RasterOfFile(tuple(paths), _join_rasters(tuple(rasters)))


def _file_names(file: RasterOfFile) -> str | list[str]:
    names = [str(path) for path in file.paths]
    return names[0] if len(names) == 1 else names


#: An elevation raster, .hgt or GeoTIFF, or a list of such that lie side by side.
RasterFile = Annotated[RasterOfFile, PlainValidator(_validate), PlainSerializer(_file_names)]
