"""A run as ASTERIX: plots (048, with 034), tracks (062), ADS-B received and the ownship's (021)."""

from collections.abc import Iterator

import numpy as np

from components.display.picture_plane import (
    LINE,
    bearings_and_end_points,
    estimated_rows_and_positions,
    held_range_rows_and_positions,
)
from components.display.recorded_run import POSE, RecordedTables
from components.estimation.frame import frame_change
from components.formats.asterix_records import (
    ADS_B,
    NORTH_MARKER,
    PLOTS,
    SERVICE,
    SYSTEM_TRACKS,
    AsterixRecord,
    callsign_from_name,
    encode_records,
)
from components.messages.columns import ORIGIN, VELOCITY
from components.messages.state_tracks import COVARIANCE, covariance_matrices
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.errors import UsageError

#: Largest range rate that a plot holds.
_FASTEST_M_S = 511.0
#: Standard deviations that a track says of itself, and which of its state's variances they are of.
_ERRORS = {
    "north_error_m": 0, "east_error_m": 1, "alt_error_m": 2, "velocity_north_error_m_s": 3,
    "velocity_east_error_m_s": 4, "velocity_up_error_m_s": 5,
}  # fmt: skip
#: System area code of everything here: none is assigned to it.
_SAC = 0


def asterix_bytes(run: RecordedTables) -> bytes:
    """Return a run as the bytes of an ASTERIX file; second 0 of the run is midnight.

    Radars and trackers are numbered by their names from SIC 1, in SAC 0; the ownship is SIC 0.
    What has no range is no plot and no track. Everything says that it is simulated.
    """
    blocks = sorted(
        {
            name or ""
            for table in ("scans", "detections", "tracks", "state_tracks")
            if table in run.tables
            for name in run.texts(table, "block")
        }
    )
    sic = {name: number for number, name in enumerate(blocks, start=1)}
    records = [
        *_north_markers_and_plots(run, sic), *_position_report_records(run, sic),
        *_estimated_track_records(run, sic),
        *_stub_track_records(run, sic), *_ownship_truth_records(run),
    ]  # fmt: skip
    if not records:
        raise UsageError(
            f"{run.folder}: holds nothing that ASTERIX has a record for: detections or tracks with "
            "a range, or truth"
        )
    return encode_records(records)


def _north_markers_and_plots(run: RecordedTables, sic: dict[str, int]) -> Iterator[AsterixRecord]:
    """Yield each radar scan's north marker with position, and plots of detections with a range."""
    if "detections" not in run.tables or run.tables["detections"].num_rows == 0:
        return
    lines = run.stack_columns("detections", LINE)
    there = np.flatnonzero(np.isfinite(lines).all(axis=0) & ~_reported_position_mask(run))
    names = run.texts("detections", "block")
    radars = {names[row] or "" for row in there.tolist()}
    yield from _north_markers(run, sic, radars)
    if len(there) == 0:
        return
    pose = run.stack_columns("detections", POSE, there)
    unknown = ~np.isfinite(pose).all(axis=0)
    if unknown.any():
        sensor = names[int(there[np.argmax(unknown)])]
        raise UsageError(
            f"{run.folder}: {sensor} does not say where the ownship was: a plot of ASTERIX is "
            "counted from north and from a place"
        )
    lit = run.numbers("detections", "illuminated_s")[there]
    time_s = np.where(np.isfinite(lit), lit, run.numbers("detections", "time_s")[there])
    lines = run.stack_columns("detections", LINE, there)
    bearing, ends = bearings_and_end_points(lines, pose)
    rate_m_s = run.numbers("detections", "range_rate_m_s")[there]
    for k, row in enumerate(there.tolist()):
        yield AsterixRecord(
            PLOTS,
            float(time_s[k]),
            {
                "sac": _SAC,
                "sic": sic[names[row] or ""],
                "simulated": 1,
                "range_m": float(lines[2, k]),
                "azimuth_deg": float(np.degrees(bearing[k])),
                "alt_m": float(ends[2, k]),
                # What does not fit is left out: a speed that is cut off would be a wrong one.
                "range_rate_m_s": float(rate_m_s[k]) if abs(rate_m_s[k]) <= _FASTEST_M_S else None,
            },
        )


def _reported_position_mask(run: RecordedTables) -> BoolArray:
    """Return a mask over the detections, True where the aircraft reported its own position."""
    if not run.has_columns("detections", "reported_lat_deg"):
        return np.zeros(run.tables["detections"].num_rows, dtype=bool)
    return np.isfinite(run.numbers("detections", "reported_lat_deg"))


def _position_report_records(run: RecordedTables, sic: dict[str, int]) -> Iterator[AsterixRecord]:
    """Yield one record for each position that aircraft reported and that was received.

    Heights are pressure altitudes.
    """
    if "detections" not in run.tables or not _reported_position_mask(run).any():
        return
    names = ("lat_deg", "lon_deg", "alt_m", "north_m_s", "east_m_s", "climb_m_s", "s")
    reported = {name: run.numbers("detections", f"reported_{name}") for name in names}
    address = run.values("detections", "address")
    blocks, targets = (run.texts("detections", name) for name in ("block", "target"))
    sent: set[tuple[str, int, float]] = set()
    for row in np.flatnonzero(_reported_position_mask(run)).tolist():
        say = {name: float(values[row]) for name, values in reported.items()}
        key = blocks[row] or "", int(address[row]), say["s"]
        if key in sent or not np.isfinite(say["s"]):
            continue
        sent.add(key)
        values = {
            "sac": _SAC, "sic": sic[key[0]], "number": key[1] % 2**24, "simulated": 1,
            "name": callsign_from_name(targets[row] or ""), "lat_deg": say["lat_deg"],
            "lon_deg": say["lon_deg"],
        }  # fmt: skip
        if np.isfinite(say["alt_m"]):
            values["flight_level_m"] = say["alt_m"]
        if np.isfinite(say["north_m_s"]):
            values["speed_m_s"] = float(np.hypot(say["north_m_s"], say["east_m_s"]))
            values["track_deg"] = float(np.degrees(np.arctan2(say["east_m_s"], say["north_m_s"])))
        if np.isfinite(say["climb_m_s"]):
            values["barometric_climb_m_s"] = say["climb_m_s"]
        yield AsterixRecord(ADS_B, say["s"], values)


def _north_markers(
    run: RecordedTables, sic: dict[str, int], radars: set[str]
) -> Iterator[AsterixRecord]:
    if "scans" not in run.tables:
        return
    positions = run.stack_columns("scans", POSE[:3]).T.tolist()
    times = run.numbers("scans", "time_s").tolist()
    for name, time_s, position in zip(run.texts("scans", "block"), times, positions, strict=True):
        if (name or "") in radars:
            known = dict(zip(("lat_deg", "lon_deg", "alt_m"), position, strict=True))
            values = {"sac": _SAC, "sic": sic[name or ""], "message": NORTH_MARKER}
            yield AsterixRecord(
                SERVICE, time_s, values | (known if np.isfinite(position).all() else {})
            )


def _track_time_and_values(
    sic: int, number: int, name: str | None, time_s: float, position: FloatArray
) -> tuple[float, dict[str, object]]:
    lat, lon, alt = position.tolist()
    return time_s, {
        "sac": _SAC, "sic": sic, "number": number, "name": name, "simulated": 1, "tentative": 0,
        "last": 0, "coasted": 0, "lat_deg": lat, "lon_deg": lon, "alt_m": alt,
    }  # fmt: skip


def _estimated_track_records(run: RecordedTables, sic: dict[str, int]) -> Iterator[AsterixRecord]:
    """Yield estimated tracks, at the instants for which their states are valid."""
    rows, positions = estimated_rows_and_positions(run)
    if len(rows) == 0:
        return
    origin = run.stack_columns("state_tracks", ORIGIN, rows)
    # Velocities and errors are along the axes of the frame's origin; the track's own have turned.
    turned = frame_change(origin, positions)
    moves = turned.vectors(run.stack_columns("state_tracks", VELOCITY, rows))
    table = {name: run.numbers("state_tracks", name) for name in COVARIANCE.values()}
    spread = turned.covariances(covariance_matrices(table, rows))
    errors = np.sqrt(np.maximum(np.stack([spread[i, i] for i in _ERRORS.values()]), 0.0))
    stated = np.asarray(np.isfinite(errors).all(axis=0))
    blocks, statuses = (run.texts("state_tracks", name) for name in ("block", "track_status"))
    numbers = run.values("state_tracks", "track")
    state_s = run.numbers("state_tracks", "state_s")
    for k, row in enumerate(rows.tolist()):
        time_s, values = _track_time_and_values(
            sic[blocks[row] or ""], int(numbers[row]), None, float(state_s[row]), positions[:, k]
        )
        values |= {
            "tentative": int(statuses[row] == "tentative"),
            "coasted": int(statuses[row] == "coasted"),
            "last": int(statuses[row] == "deleted"),
            "velocity_east_m_s": float(moves[1][k]),
            "velocity_north_m_s": float(moves[0][k]),
            "velocity_up_m_s": -float(moves[2][k]),
        }
        if stated[k]:
            values |= dict(zip(_ERRORS, errors[:, k].tolist(), strict=True))
        yield AsterixRecord(SYSTEM_TRACKS, time_s, values)


def _stub_track_records(run: RecordedTables, sic: dict[str, int]) -> Iterator[AsterixRecord]:
    """Yield a system-track record (category 062) for each stub track's row, at measurement time."""
    rows, positions = held_range_rows_and_positions(run)
    if len(rows) == 0:
        return
    names, blocks = run.texts("tracks", "target"), run.texts("tracks", "block")
    measured_s = run.numbers("tracks", "measured_s")
    number: dict[tuple[str, str], int] = {}
    for k, row in enumerate(rows.tolist()):
        key = blocks[row] or "", names[row] or ""
        number.setdefault(key, len(number) + 1)
        what = (
            sic[key[0]],
            number[key],
            callsign_from_name(key[1]),
            float(measured_s[row]),
            positions[:, k],
        )
        yield AsterixRecord(SYSTEM_TRACKS, *_track_time_and_values(*what))


def _ownship_truth_records(run: RecordedTables) -> Iterator[AsterixRecord]:
    """Yield the ownship's true flight as ADS-B records (category 021), one for each time."""
    if "truth" not in run.tables:
        return
    own = run.true_flights().get(run.own_name)
    if own is None:
        return
    north, east = own["velocity_north_m_s"], own["velocity_east_m_s"]
    columns = {
        "lat_deg": own["lat_deg"], "lon_deg": own["lon_deg"], "alt_m": own["alt_m"],
        "speed_m_s": np.hypot(north, east),
        "track_deg": np.degrees(np.arctan2(east, north)),
        "velocity_up_m_s": -own["velocity_down_m_s"],
    }  # fmt: skip
    fixed = {
        "sac": _SAC,
        "sic": 0,
        "number": 1,
        "simulated": 1,
        "name": callsign_from_name(run.own_name),
    }
    for k, time_s in enumerate(own["time_s"].tolist()):
        yield AsterixRecord(ADS_B, time_s, fixed | {n: float(v[k]) for n, v in columns.items()})
