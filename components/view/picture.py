"""What the page is given: names, and columns of numbers, all in one plane and one time."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight_ned
from dsa_des.arrays.types import AnyArray, FloatArray

#: Number of the table's row, in 32 bits.
_INDEX = np.dtype("<i4")
_SINGLE, _DOUBLE = np.dtype("<f4"), np.dtype("<f8")


@dataclass
class RunPicture:
    """A run as the page shows it.

    Parameters
    ----------
    title : str
    facts : dict
        Said in the head: seed, version and so on.
    duration_s : float
    start_s : float
    sensors : list of dict
        ``name``, ``colour``, ``marker``, and where known ``azimuth_deg`` and ``range_m``; of a
        beam that sweeps clockwise over them ``sweep_s``, how long it takes from each scan on.
    targets : list of str
    tables : dict
        Columns of numbers by table: ``own``, ``truth``, ``scans``, ``detections``, ``fused``,
        ``tracks``, ``alerts``, ``manoeuvres``, ``bands``.
    """

    title: str
    facts: dict[str, Any]
    duration_s: float
    start_s: float = 0.0
    sensors: list[dict[str, Any]] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)
    tables: dict[str, dict[str, AnyArray]] = field(default_factory=dict)

    def packed(self) -> dict[str, Any]:
        """Return it for JSON; columns are little-endian numbers in base 64."""
        return {
            "title": self.title,
            "facts": self.facts,
            "duration_s": self.duration_s,
            "start_s": self.start_s,
            "sensors": self.sensors,
            "targets": self.targets,
            "tables": {name: _packed(table) for name, table in self.tables.items()},
        }


def _packed(table: Mapping[str, AnyArray]) -> dict[str, Any]:
    return {name: _column(name, values) for name, values in table.items()}


def _column(name: str, values: AnyArray) -> dict[str, str]:
    if values.dtype.kind in "iub":
        kind, stored = "i4", values.astype(_INDEX)
    elif name.endswith("_s"):  # instants are compared with each other
        kind, stored = "f8", values.astype(_DOUBLE)
    else:
        kind, stored = "f4", values.astype(_SINGLE)
    return {"kind": kind, "data": base64.b64encode(stored.tobytes()).decode("ascii")}


@dataclass(frozen=True)
class TangentPlane:
    """The tangent plane at a place of the Earth (WGS 84): east and north of it, m.

    Parameters
    ----------
    lat_deg, lon_deg : float
    """

    lat_deg: float
    lon_deg: float

    def east_north_m(
        self, lat_deg: AnyArray, lon_deg: AnyArray, alt_m: AnyArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return where positions lie in the plane; NaN where they are not known."""
        known = np.isfinite(lat_deg) & np.isfinite(lon_deg) & np.isfinite(alt_m)
        east, north = np.full(known.shape, np.nan), np.full(known.shape, np.nan)
        if known.any():
            north[known], east[known], _ = line_of_sight_ned(
                self.lat_deg, self.lon_deg, 0.0, lat_deg[known], lon_deg[known], alt_m[known]
            )
        return east, north
