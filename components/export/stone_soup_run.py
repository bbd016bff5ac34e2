"""A recorded run as Stone Soup's objects (`components.export.stone_soup`)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.movable import MovingMovable
from stonesoup.platform.base import MovingPlatform
from stonesoup.reader import DetectionReader
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState

from components.display.recorded_run import POSE, RecordedTables
from components.estimation.frame import pose_in_frame, vectors_in_frame
from components.geometry import north_east_up_offsets_m
from components.messages.columns import ORIGIN
from components.stone_soup.objects import (
    POSITION,
    VELOCITY,
    Poses,
    make_detections,
    state_vectors,
    to_datetime,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import UsageError

_MEASURED = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
_VARIANCES = (
    "azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2",
    "range_rate_variance_m2_s2",
)  # fmt: skip
_MOVES = ("own_velocity_north_m_s", "own_velocity_east_m_s", "own_velocity_down_m_s")
_PLACE = ("lat_deg", "lon_deg", "alt_m")
_VELOCITY = ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")

#: Latitude and longitude (deg) and height above the ellipsoid (m).
Origin = tuple[float, float, float]


class RecordedDetector(DetectionReader):
    """A Stone Soup detector yielding each recorded scan: time and set of detections (or none)."""

    looks: "list[tuple[datetime, set[Detection]]]"

    @BufferedGenerator.generator_method
    def detections_gen(self) -> Iterator[tuple[datetime, set[Detection]]]:
        """Yield the detections of every look of every sensor, in order of time."""
        yield from self.looks


class RecordedMovement(MovingMovable):
    """The ownship's movement in Stone Soup, by its believed positions and attitudes."""

    @property
    def orientation(self) -> StateVector:
        """Return the last state's roll, pitch, yaw as a vector in Stone Soup's sign convention."""
        return self.states[-1].metadata["orientation"]


@dataclass(frozen=True)
class StoneSoupRun:
    """A recorded run as Stone Soup's objects.

    All states are ``[x, vx, y, vy, z, vz]``: x east, y north, z up at `origin`, axes parallel to
    themselves, metres and seconds. Instants count from 1 January 2000.

    Parameters
    ----------
    detector : RecordedDetector
        Every look in order, for a tracker's ``detector``: instant and set of `Detection`. Each
        detection has its own measurement model, with the pose that was believed then, and the
        variances of its errors; its ``metadata`` names ``sensor`` and ``scan``, and no target.
    platform : MovingPlatform
        The ownship with the poses believed at its detections; the ``metadata`` of a state holds its
        ``orientation``. Its velocity is the true one, NaN where no truth is recorded.
    truth : set of GroundTruthPath
        The targets' true flights; ``id`` is a target's name.
    ownship : GroundTruthPath or None
        The ownship's true flight.
    origin : tuple
        Latitude and longitude (deg) and height (m) of the frame, WGS 84.
    """

    detector: RecordedDetector
    platform: MovingPlatform
    truth: "set[GroundTruthPath]"
    ownship: "GroundTruthPath | None"
    origin: Origin


def recorded_run(
    run: RecordedTables, origin: Origin | None = None, range_rates: bool = False
) -> StoneSoupRun:
    """Return a run's detections, poses and truth."""
    flights = run.true_flights() if "truth" in run.tables else {}
    columns = _detection_columns(run)
    pose = _ownship_poses(run, columns, flights)
    origin = origin or _origin(run, pose)
    lat, lon, alt = (np.full(pose.shape[1], value) for value in origin)
    moves = np.stack([columns[name] for name in _MOVES]) if range_rates else None
    position = pose_in_frame(
        (lat, lon, alt), (pose[0], pose[1], pose[2]), (pose[3], pose[4], pose[5]), moves
    )
    paths = {name: _path(name, flight, origin) for name, flight in flights.items()}
    own = paths.pop(run.own_name, None)
    detector = RecordedDetector()
    detector.looks = list(_detections_by_scan(run, columns, Poses(position)))
    return StoneSoupRun(
        detector,
        _platform(run.own_name, columns["time_s"], position, flights.get(run.own_name), origin),
        set(paths.values()),
        own,
        origin,
    )


def _detection_columns(run: RecordedTables) -> dict[str, Any]:
    """Return detections' columns by name; time is of illumination where a sweeping beam has one."""
    if "detections" not in run.tables or run.tables["detections"].num_rows == 0:
        raise UsageError(f"{run.folder}: has no detections")
    names = [*_MEASURED, *_VARIANCES, *POSE, "illuminated_s", "time_s"]
    columns: dict[str, Any] = {name: run.numbers("detections", name) for name in names}
    for name in _MOVES:  # runs before sensors measured range rates have none
        known = name in run.table("detections").column_names
        nothing = np.full(len(columns["time_s"]), np.nan)
        columns[name] = run.numbers("detections", name) if known else nothing
    columns["scan"] = run.values("detections", "scan")
    columns["block"] = np.array(run.texts("detections", "block"), dtype=object)
    # A sweeping beam measures when it meets the target, after its scan has begun.
    lit = columns["illuminated_s"]
    columns["time_s"] = np.where(np.isfinite(lit), lit, columns["time_s"])
    for name, value in zip(_VARIANCES[:3], _MEASURED[:3], strict=True):
        bad = np.isfinite(columns[value]) & ~(columns[name] > 0.0)
        if bad.any():
            sensor = columns["block"][np.argmax(bad)]
            raise UsageError(
                f"{run.folder}: {sensor} states no error of its {value} ({name} is not above 0): "
                "a tracker weighs measurements by it; give it a grid, or errors = 'stated'"
            )
    return columns


def _ownship_poses(
    run: RecordedTables, columns: Mapping[str, Any], flights: Mapping[str, Any]
) -> FloatArray:
    """Return ownship poses at detections, (6, n): by navigation where recorded, else true ones."""
    pose = np.stack([columns[name] for name in POSE])
    unknown = np.isnan(pose).any(axis=0)
    if not unknown.any():
        return pose
    if run.own_name not in flights:
        raise UsageError(
            f"{run.folder}: its detections have no pose of the ownship and there is no "
            "truth.parquet: record one with fusion = fusion.pass_through or truth = true under "
            "[record]"
        )
    true = run.true_poses(columns["time_s"][unknown])
    if true is None:
        raise UsageError(
            f"{run.folder}: its detections have no pose of the ownship, and truth.parquet has none "
            "at their instants: record them with fusion = fusion.pass_through"
        )
    pose[:, unknown] = true
    return pose


def _origin(run: RecordedTables, pose: FloatArray) -> Origin:
    tracks = run.tables.get("state_tracks")
    if tracks is not None and tracks.num_rows:
        lat, lon, alt = (float(tracks[name][0].as_py()) for name in ORIGIN)
    else:
        lat, lon, alt = pose[:3, 0].tolist()
    return lat, lon, alt


def _detections_by_scan(
    run: RecordedTables, columns: Mapping[str, Any], poses: Poses
) -> Iterator[tuple[datetime, set[Detection]]]:
    """Yield times and detections of scans, by time, then those with ranges first, then by name."""
    block, time_s = columns["block"], columns["time_s"]
    ranged = set(block[np.isfinite(columns["range_m"])])
    result: dict[tuple[float, bool, str], list[int]] = {}
    for i, (name, when) in enumerate(zip(block.tolist(), time_s.tolist(), strict=True)):
        result.setdefault((when, name not in ranged, name or ""), []).append(i)
    sweeping = set(block[np.isfinite(columns["illuminated_s"])])
    if "scans" in run.tables:
        names = run.texts("scans", "block")
        for name, when in zip(names, run.numbers("scans", "time_s").tolist(), strict=True):
            if name not in sweeping:  # a scan of a sweeping beam has no one instant
                result.setdefault((when, name not in ranged, name or ""), [])
    values = np.stack([columns[name] for name in _MEASURED])
    variances = np.stack([columns[name] for name in _VARIANCES])
    for (when, _, name), rows_of in sorted(result.items()):
        says = [{"sensor": name, "scan": int(columns["scan"][i])} for i in rows_of]
        at = to_datetime(when)
        yield (
            at,
            make_detections(poses, rows_of, at, values[:, rows_of], variances[:, rows_of], says),
        )


def _path(name: str, flight: Mapping[str, FloatArray], origin: Origin) -> GroundTruthPath:
    position = [np.ascontiguousarray(flight[key]) for key in _PLACE]
    here = [np.full(len(position[0]), value) for value in origin]
    north, east, up = north_east_up_offsets_m(*here, *position)
    states = state_vectors(np.stack([north, east, -up]), _velocity_in_frame(flight, position, here))
    return GroundTruthPath(
        [
            GroundTruthState(state, timestamp=to_datetime(time_s), metadata={"name": name})
            for state, time_s in zip(states, flight["time_s"].tolist(), strict=True)
        ],
        id=name,
    )


def _velocity_in_frame(
    flight: Mapping[str, FloatArray], position: list[FloatArray], here: list[FloatArray]
) -> FloatArray:
    """Return velocities along the common axes, from those along each position's own horizon."""
    own = np.stack([flight[name] for name in _VELOCITY])
    return vectors_in_frame(np.array(here), np.array(position), own)


def _platform(
    name: str,
    time_s: FloatArray,
    position: Any,
    own: Mapping[str, FloatArray] | None,
    origin: Origin,
) -> MovingPlatform:
    when, first = np.unique(time_s, return_index=True)
    velocity = np.full((3, len(when)), np.nan)
    if own is not None:
        at = [np.ascontiguousarray(own[key]) for key in _PLACE]
        known = _velocity_in_frame(own, at, [np.full(len(at[0]), value) for value in origin])
        velocity = np.stack([np.interp(when, own["time_s"], part) for part in known])
    states = state_vectors(position.position_m[:, first], velocity)
    poses = Poses(position.take(first))
    movement = RecordedMovement(
        states=[
            GroundTruthState(
                state, timestamp=to_datetime(at_s), metadata={"orientation": poses.orientation(i)}
            )
            for i, (state, at_s) in enumerate(zip(states, when.tolist(), strict=True))
        ],
        position_mapping=POSITION,
        velocity_mapping=VELOCITY,
        transition_model=None,
    )
    return MovingPlatform(movement_controller=movement, id=name)
