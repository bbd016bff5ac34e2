"""Where the tracks of a recorded run were: those that trackers estimate, and those they hold."""

import numpy as np

from components.display.picture import offset_positions, sights
from components.display.recorded_run import OWNSHIP, RecordedTables
from components.messages.columns import ORIGIN, POSITION
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.errors import UsageError

#: What a pose is made of, as recorded with what was measured.
POSE = ("own_lat_deg", "own_lon_deg", "own_alt_m", "own_heading_rad", "own_pitch_rad",
        "own_roll_rad")  # fmt: skip


def estimated_positions(run: RecordedTables) -> tuple[IntArray, FloatArray]:
    """Return rows of ``state_tracks`` whose states have a range, and where they are.

    Latitude, longitude (deg) and height above the ellipsoid (m), (3, n), at ``state_s``.
    """
    if "state_tracks" not in run.tables:
        return np.empty(0, dtype=np.int64), np.empty((3, 0))
    ned = np.stack([run.numbers("state_tracks", name) for name in POSITION])
    rows = np.flatnonzero(np.isfinite(ned).all(axis=0))
    origin = [run.numbers("state_tracks", name)[rows] for name in ORIGIN]
    return rows, offset_positions(ned[:, rows], origin)


def held_positions(run: RecordedTables) -> tuple[IntArray, FloatArray]:
    """Return rows of ``tracks`` with a range, one for each measurement held, and where it was.

    Places are as in `estimated_positions`, at ``measured_s``.
    """
    nothing = np.empty(0, dtype=np.int64), np.empty((3, 0))
    if "tracks" not in run.tables:
        return nothing
    lines = [run.numbers("tracks", name) for name in ("azimuth_rad", "elevation_rad", "range_m")]
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
    azimuth, elevation, range_m = (part[rows] for part in lines)
    _, positions = sights(azimuth, elevation, range_m, _own_pose(run, measured_s[rows], rows))
    return rows, positions


def _own_pose(run: RecordedTables, time_s: FloatArray, rows: IntArray) -> list[FloatArray]:
    """Return the ownship's pose of tracks: as believed where that is recorded, else the truth."""
    if POSE[0] in run.table("tracks").column_names:
        return [run.numbers("tracks", name)[rows] for name in POSE]
    own = run.flights().get(OWNSHIP, {"time_s": np.zeros(0)})
    at = np.searchsorted(own["time_s"], time_s)
    if len(own["time_s"]) == 0 or (own["time_s"][np.minimum(at, len(own["time_s"]) - 1)]
                                   != time_s).any():  # fmt: skip
        raise UsageError(
            f"{run.folder}: truth.parquet does not say where the ownship was when tracks were "
            "measured: record it with truth = true under [record]"
        )
    return [own[name.removeprefix("own_")][at] for name in POSE]
