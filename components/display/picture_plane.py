"""What pictures of a run have in common: a plane, and where what was recorded lies on the Earth.

The page of a run, globes, ASTERIX and the traffic display ask here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.display.recorded_run import POSE, RecordedTables
from components.estimation.frame import vectors_in_frame
from components.geometry import body_to_ned, enu_to_geodetic, line_of_sight_ned
from components.messages.columns import ORIGIN, POSITION
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.errors import UsageError

#: A measured line of sight, in body axes.
LINE = ("azimuth_rad", "elevation_rad", "range_m")


@dataclass(frozen=True)
class TangentPlane:
    """The tangent plane at a place of the Earth (WGS 84): east and north of it, m."""

    lat_deg: float
    lon_deg: float

    def east_north_m(
        self, lat_deg: AnyArray, lon_deg: AnyArray, alt_m: AnyArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return east and north of positions in the plane, m; NaN where a position is not known."""
        known = np.isfinite(lat_deg) & np.isfinite(lon_deg) & np.isfinite(alt_m)
        east, north = np.full(known.shape, np.nan), np.full(known.shape, np.nan)
        if known.any():
            north[known], east[known], _ = line_of_sight_ned(
                self.lat_deg, self.lon_deg, 0.0, lat_deg[known], lon_deg[known], alt_m[known]
            )
        return east, north

    def north_direction_rad(self, place: FloatArray | Sequence[FloatArray]) -> FloatArray:
        """Return where other places' (deg) north points, rad clockwise from the plane's north.

        Far from where the plane touches the Earth it is another direction than the plane's north.
        """
        there = np.array([place[0], place[1]])
        here = np.array([np.full(there.shape[1], v) for v in (self.lat_deg, self.lon_deg)])
        level = np.zeros((3, there.shape[1]))
        level[0] = 1.0
        north, east, _ = vectors_in_frame(here, there, level)
        return np.arctan2(east, north)


def geodetic_from_ned_offsets(
    ned_m: FloatArray, origin: FloatArray | Sequence[FloatArray]
) -> FloatArray:
    """Return latitude, longitude (deg), altitude (m), (3, n), of origins moved north, east, down.

    NaN where the offset (3, n) north, east and down is not known.
    """
    result = np.full(ned_m.shape, np.nan)
    known = np.isfinite(ned_m[0])
    if known.any():
        north_m, east_m, down_m = ned_m[:, known]
        lat_deg, lon_deg, alt_m = (part[known] for part in origin)
        result[:, known] = enu_to_geodetic(
            east_m, north_m, -down_m,
            reference_lat_deg=lat_deg, reference_lon_deg=lon_deg, reference_alt_m=alt_m,
        )  # fmt: skip
    return result


def bearings_and_end_points(line: FloatArray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return bearings of lines of sight, rad clockwise from north, and their ends: latitude,
    longitude (deg), height (m), (3, n).

    Lines (3, n) are those of `LINE`, poses (6, n) those of `POSE`, in degrees, metres and radians.
    What is not known is NaN.
    """
    azimuth_rad, elevation_rad, range_m = line
    known = np.flatnonzero(np.isfinite(pose[0]) & np.isfinite(azimuth_rad))
    ranged = known[np.isfinite(range_m[known])]

    def ned(rows: IntArray, far_m: Any) -> FloatArray:
        result = np.full((3, len(azimuth_rad)), np.nan)
        if len(rows):
            azimuth, elevation = azimuth_rad[rows], elevation_rad[rows]
            level = np.cos(elevation) * far_m
            body = level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation) * far_m
            result[:, rows] = body_to_ned(*body, *(angle[rows] for angle in pose[3:]))
        return result

    north, east, _ = ned(known, 1.0)
    return np.arctan2(east, north), geodetic_from_ned_offsets(
        ned(ranged, range_m[ranged]), pose[:3]
    )


def estimated_rows_and_positions(run: RecordedTables) -> tuple[IntArray, FloatArray]:
    """Return the indices of rows of ``state_tracks`` with a position, and latitude, longitude
    (deg), height (m) of each, (3, n).

    Latitude, longitude (deg) and height above the ellipsoid (m), (3, n), at ``state_s``.
    """
    if "state_tracks" not in run.tables:
        return np.empty(0, dtype=np.int64), np.empty((3, 0))
    ned_m = run.stack_columns("state_tracks", POSITION)
    rows = np.flatnonzero(np.isfinite(ned_m).all(axis=0))
    return rows, geodetic_from_ned_offsets(
        ned_m[:, rows], run.stack_columns("state_tracks", ORIGIN, rows)
    )


def held_range_rows_and_positions(run: RecordedTables) -> tuple[IntArray, FloatArray]:
    """Return, once per measurement, the index of a row of ``tracks`` with a range, and latitude,
    longitude (deg), height (m) there, (3, n).

    Places are as in `estimated_rows_and_positions`, at ``measured_s``.
    """
    nothing = np.empty(0, dtype=np.int64), np.empty((3, 0))
    if "tracks" not in run.tables:
        return nothing
    lines = run.stack_columns("tracks", LINE)
    measured_s = run.numbers("tracks", "measured_s")
    names, blocks = run.texts("tracks", "target"), run.texts("tracks", "block")
    measured: dict[tuple[str, str], float] = {}
    kept = []
    for row in np.flatnonzero(np.isfinite(lines).all(axis=0)).tolist():
        key = blocks[row] or "", names[row] or ""
        if measured.get(key) != measured_s[row]:
            measured[key] = float(measured_s[row])
            kept.append(row)
    if not kept:
        return nothing
    rows = np.array(kept)
    if run.has_columns("tracks", POSE[0]):  # as believed, where that is recorded
        pose = run.stack_columns("tracks", POSE, rows)
    else:
        pose = np.empty((len(POSE), len(rows)))
        on = run.texts("tracks", "platform") if run.has_columns("tracks", "platform") else []
        carrying = np.array([on[row] if on else None for row in kept], dtype=object)
        for platform in {*carrying.tolist()}:
            mine = np.flatnonzero(carrying == platform)
            true = run.true_poses(measured_s[rows[mine]], platform)
            if true is None:
                raise UsageError(
                    f"{run.folder}: truth.parquet does not say where {platform or 'the ownship'} "
                    "was when tracks were measured: record it with truth = true under [record]"
                )
            pose[:, mine] = true
    return rows, bearings_and_end_points(run.stack_columns("tracks", LINE, rows), pose)[1]
