"""Reading elevation rasters: SRTM `.hgt` by NumPy alone, GeoTIFF by the extra ``geotiff``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import PlainSerializer, PlainValidator, TypeAdapter

from components.terrain.mosaic import mosaic
from components.terrain.raster import ElevationRaster, refuse_many_nodes
from dsa_des.block.component import ScenePath
from dsa_des.files.input_files import InputFileError, status_of
from dsa_des.text.safe_text import shortened

#: A raster of 3601 by 3601 nodes has 26 MB as .hgt; GeoTIFFs of several degrees are larger.
LARGEST_RASTER_BYTES = 1024 * 1024 * 1024

_VOID = -32768
_CORNER = re.compile(r"([NS])(\d{1,2})([EW])(\d{1,3})", re.IGNORECASE)
_TIFF = (".tif", ".tiff")
_PATH: TypeAdapter[Path] = TypeAdapter(ScenePath)


@dataclass(frozen=True)
class RasterOfFile:
    """A raster that was read while the scene was checked; equal where the same file was read once.

    Parameters
    ----------
    paths : tuple of Path
        Of one file, or of several that lie side by side.
    raster : ElevationRaster
    """

    paths: tuple[Path, ...]
    raster: ElevationRaster


def read_raster(path: Path) -> ElevationRaster:
    """Read an elevation raster; the file's ending says which kind it is.

    Parameters
    ----------
    path : Path
        ``.hgt``: one degree by one degree, its south-west corner in its name (N45W076.hgt), rows
        from north to south of big-endian 16-bit metres, as many rows as columns, the edges
        included. ``.tif``, ``.tiff``: GeoTIFF in longitude and latitude, north up.

    Raises
    ------
    ValueError
        If it cannot be read, is of another kind, has holes, or needs a package that is missing.
    """
    name = shortened(path.name, 80)
    if path.suffix.lower() == ".hgt":
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
    nodes = math.isqrt(path.stat().st_size // 2)
    refuse_many_nodes(name, nodes, nodes)
    data = path.read_bytes()
    if nodes < 2 or 2 * nodes * nodes != len(data):
        raise ValueError(
            f"{name} has {len(data):,} bytes: an .hgt file holds as many rows as columns of two "
            "bytes each (1201 or 3601 of them in SRTM)"
        )
    rows = np.frombuffer(data, dtype=">i2").reshape(nodes, nodes)[::-1]
    height = np.where(rows == _VOID, np.nan, rows).astype(np.float32)
    south = int(match[2]) * (1.0 if match[1].upper() == "N" else -1.0)
    west = int(match[4]) * (1.0 if match[3].upper() == "E" else -1.0)
    step = 1.0 / (nodes - 1)
    return ElevationRaster(south, west, step, step, height, name)


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
    height = np.ma.filled(band.astype(np.float32), np.nan)[::-1]
    # The transform gives the corners of pixels; heights are those of their middles.
    west = transform.c + 0.5 * transform.a
    south = transform.f + (height.shape[0] - 0.5) * transform.e
    return ElevationRaster(south, west, transform.a, -transform.e, np.array(height), name)


@lru_cache(maxsize=8)
def _read(path: Path, changed_ns: int, size: int) -> ElevationRaster:
    # Runs of a study that name the same file share one raster.
    return read_raster(path)


@lru_cache(maxsize=2)
def _together(rasters: tuple[ElevationRaster, ...]) -> ElevationRaster:
    return mosaic(rasters)


def _validated(value: Any) -> RasterOfFile:
    if isinstance(value, RasterOfFile):
        return value
    if isinstance(value, list) and not value:
        raise ValueError("must name at least one file")
    paths, rasters = [], []
    for item in value if isinstance(value, list) else [value]:
        path = _PATH.validate_python(item)
        name = shortened(str(path), 300)
        try:
            status = status_of(path, LARGEST_RASTER_BYTES)
            rasters.append(_read(path, status.st_mtime_ns, status.st_size))
        except InputFileError as error:
            raise ValueError(f"must be a raster that can be read: {name}: {error}") from None
        paths.append(path)
    return RasterOfFile(tuple(paths), _together(tuple(rasters)))


def _named(file: RasterOfFile) -> str | list[str]:
    names = [str(path) for path in file.paths]
    return names[0] if len(names) == 1 else names


#: An elevation raster, .hgt or GeoTIFF, or a list of such that lie side by side.
RasterFile = Annotated[RasterOfFile, PlainValidator(_validated), PlainSerializer(_named)]
