"""What globes show of a run: flights, tracks, alerts and detections, in the colours of the kit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from components.display.picture_plane import (
    LINE,
    bearings_and_end_points,
    estimated_rows_and_positions,
    held_range_rows_and_positions,
)
from components.display.recorded_run import POSE, RecordedTables
from components.display.symbols import LEVELS_ON_DARK, ON_DARK, block_marks
from components.export.alert_levels import Alert, alerts_of
from components.messages.state_tracks import HELD
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.mark import Mark
from dsa_des.errors import UsageError

#: A run has no date; its second 0 is put here.
START = datetime(2000, 1, 1, tzinfo=UTC)
#: How long a detection is shown, s.
DETECTION_LASTS_S = 4.0
_PLACE = ("lon_deg", "lat_deg", "alt_m")


@dataclass(frozen=True)
class Course:
    """The path of a flight, of a track, or of what an alert is about meanwhile; times ascend."""

    name: str
    colour: str
    time_s: FloatArray
    #: Longitude, latitude (deg) and height above the ellipsoid (m), (n, 3).
    position: FloatArray
    #: The tracker or the alerting block; empty of a flight.
    group: str = ""
    #: Of an alert, else 0.
    level: int = 0

    def times_and_positions_between(
        self, start_s: float, end_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return times (n,), positions (n, 3) from start to end, interpolated linearly at both."""
        start_s, end_s = (float(np.clip(t, *self.time_s[[0, -1]])) for t in (start_s, end_s))
        inside = (self.time_s > start_s) & (self.time_s < end_s)
        time_s = np.unique(np.concatenate(([start_s], self.time_s[inside], [end_s])))
        lon, lat, alt = self.position.T
        # Across the date line longitudes go on.
        columns = (np.unwrap(lon, period=360.0), lat, alt)
        result = np.stack([np.interp(time_s, self.time_s, column) for column in columns], axis=1)
        result[:, 0] = (result[:, 0] + 180.0) % 360.0 - 180.0
        return time_s, result


@dataclass(frozen=True)
class DetectedPlace:
    """Detection with range: sensor, target, time, (longitude, latitude, height) as in `Course`."""

    sensor: str
    target: str
    time_s: float
    position: tuple[float, float, float]

    @property
    def name(self) -> str:
        """Return the sensor's name, followed by the target's name if a target was detected."""
        return f"{self.sensor} {self.target}".strip()


@dataclass(frozen=True)
class GlobeRun:
    """What a globe shows of a run: flights, tracks, alerts and detections; ``marks`` says how each
    sensor and tracker is drawn.
    """

    name: str
    end_s: float
    flights: list[Course]
    tracks: list[Course]
    alerts: list[Course]
    seen: list[DetectedPlace]
    marks: Mapping[str, Mark]


def globe_run(run: RecordedTables) -> GlobeRun:
    """Collect what a globe shows of a run: flights, tracks, alerts and detections."""
    flights = [
        Course(
            name, ON_DARK["own" if name == run.own_name else "truth"], flight["time_s"],
            np.stack([flight[key] for key in _PLACE], axis=1),
        )
        for name, flight in run.true_flights().items()
    ]  # fmt: skip
    end_s = max(float(one.time_s[-1]) for one in flights)
    seen = list(detections_with_range(run))
    tracks = [*_estimated_courses(run), *_stub_track_courses(run)]
    marks = marks_of_blocks(run, {one.sensor for one in seen} | {one.group for one in tracks})
    painted = [
        Course(one.name, marks[one.group].colour, one.time_s, one.position, one.group)
        for one in tracks
    ]
    alerts = [
        Course(
            f"{alert.name}: alert {level}", LEVELS_ON_DARK[min(level, 3) - 1],
            *about.times_and_positions_between(start_s, stop_s), alert.block, level,
        )
        for alert in alerts_of(run)
        if (about := _course_of_alert(alert, flights, tracks)) is not None
        for start_s, stop_s, level in alert.level_periods(end_s)
        if start_s <= about.time_s[-1] and stop_s >= about.time_s[0]
    ]  # fmt: skip
    name = run.folder.resolve().name
    return GlobeRun(name, end_s, flights, painted, alerts, seen, marks)


def iso_time(time_s: float) -> str:
    """Return a time of a run as ISO 8601 text in UTC, counted from a fixed date."""
    moment = START + timedelta(microseconds=round(1e6 * time_s))
    return moment.isoformat().replace("+00:00", "Z")


def marks_of_blocks(run: RecordedTables, names: set[str]) -> dict[str, Mark]:
    """Return how each named block is drawn (its `Mark`), from its type in the run's scene."""
    try:
        return block_marks(run.block_types(names))
    except (UsageError, AttributeError):  # another program's scene
        return block_marks(dict.fromkeys(names, ""))


def _course_of_alert(
    alert: Alert, flights: Sequence[Course], tracks: Sequence[Course]
) -> Course | None:
    """Return the path of an alert's target, or else of its track; None if there is none."""
    if alert.target is not None:
        return next((one for one in flights if one.name == alert.target), None)
    # Several trackers may have a track of that number.
    end = f" #{alert.track}"
    mine = [one for one in tracks if one.name.endswith(end) and one.time_s[0] <= alert.start_s]
    return max(mine, key=lambda one: float(one.time_s[-1]), default=None)


def detections_with_range(run: RecordedTables) -> Iterator[DetectedPlace]:
    """Yield sensor, target, time and position of detections with a range and an ownship pose."""
    if "detections" not in run.tables:
        return
    names = ("time_s", *LINE, *POSE)
    number = run.stack_columns("detections", names)
    there = np.flatnonzero(~np.isnan(number).any(axis=0))
    known = np.where(np.isnan(number), 0.0, number)
    run.refuse_large_values("detections", dict(zip(names, known, strict=True)))
    if len(there) == 0:
        return
    number = run.stack_columns("detections", names, there)
    _, (lat, lon, alt) = bearings_and_end_points(number[1:4], number[4:])
    sensors, targets = (run.texts("detections", name) for name in ("block", "target"))
    rows = zip(*(part.tolist() for part in (there, number[0], lon, lat, alt)), strict=True)
    for row, at_s, *position in rows:
        yield DetectedPlace(sensors[row] or "", targets[row] or "", at_s, tuple(position))


def _estimated_courses(run: RecordedTables) -> Iterator[Course]:
    """Yield the paths of all tracks confirmed at some time, without states marked as deleted."""
    rows, positions = estimated_rows_and_positions(run)
    if len(rows) == 0:
        return
    status = np.array(run.texts("state_tracks", "track_status"), dtype=object)[rows]
    numbers = np.asarray(run.values("state_tracks", "track"))[rows].tolist()
    blocks = run.texts("state_tracks", "block")
    names = [(blocks[row] or "", f"#{n}") for row, n in zip(rows.tolist(), numbers, strict=True)]
    lives = status != "deleted"
    sure = np.isin(status, HELD)
    for name, mine in _group_indices_by_name(names):
        if sure[mine].any():
            mine = mine[lives[mine]]
            yield _course(
                name, run.numbers("state_tracks", "state_s")[rows[mine]], positions[:, mine]
            )


def _stub_track_courses(run: RecordedTables) -> Iterator[Course]:
    rows, positions = held_range_rows_and_positions(run)
    blocks, targets = (
        (run.texts("tracks", name) for name in ("block", "target")) if len(rows) else ([], [])
    )
    names = [(blocks[row] or "", targets[row] or "") for row in rows.tolist()]
    for name, mine in _group_indices_by_name(names):
        yield _course(name, run.numbers("tracks", "measured_s")[rows[mine]], positions[:, mine])


def _group_indices_by_name(
    names: Sequence[tuple[str, str]],
) -> Iterator[tuple[tuple[str, str], IntArray]]:
    """Yield each distinct name, sorted, with the indices at which it occurs in the sequence."""
    result: dict[tuple[str, str], list[int]] = {}
    for position, name in enumerate(names):
        result.setdefault(name, []).append(position)
    for name, positions in sorted(result.items()):
        yield name, np.array(positions)


def _course(name: tuple[str, str], time_s: FloatArray, positions: FloatArray) -> Course:
    time_s, first = np.unique(time_s, return_index=True)
    lat, lon, alt = positions[:, first]
    return Course(" ".join(name), "", time_s, np.stack([lon, lat, alt], axis=1), name[0])
