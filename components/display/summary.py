"""Running summaries of a run: detections, fused lines of sight, tracks, alerts and manoeuvres.

They take the recorded rows as these come, and keep a few numbers per sensor, track and block
whatever the length of the run.
"""

import math
from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from components.messages.alerts import AlertLevels
from components.messages.detections import Detections
from components.messages.state_tracks import COASTED, CONFIRMED, STATUSES, StateTracks
from components.messages.steering import Manoeuvres
from components.metrics.censored import END, START, in_scan
from components.metrics.true_states import TargetsInFrame
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.record.sinks import Observer

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation

#: Columns of recorded rows; of text `dsa_des.block.message.Text`.
Columns = Any

#: Table of the tracks.
TABLE = "state_tracks"
#: A track that never comes so near to any target is false.
NEAR_M = 300.0
#: Instead of a target's name, for what is near none.
NO_TARGET = "no target"
_PLACE = ("north_m", "east_m", "down_m")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")
_HELD = (STATUSES[CONFIRMED], STATUSES[COASTED])
#: Distances of tracks and targets that are worked out at once.
_MOST_AT_ONCE = 200_000
_SKIPPED = "skipped_"
#: Said only where something stood before a target: most scenes have nothing that could.
_HIDDEN = "skipped_hidden"
SKIP_COLUMNS = tuple(name for name in Detections.recorded["scans"] if name.startswith(_SKIPPED))


class SensorSummary:
    """Counts each sensor's scans and detections and keeps its first and last detection.

    Each sensor gets an entry, also when it never scans or is switched off.
    """

    tables: ClassVar[frozenset[str]] = frozenset({"scans", "detections"})

    def __init__(self, sensors: Iterable[str], off: Collection[str] = ()) -> None:
        self._entries = {name: _Sensor() for name in sorted(sensors)}
        self._off = frozenset(off)

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``scans`` or ``detections``, in order of time."""
        for name, rows in rows_by_name(columns["block"]):
            entry = self._entries.setdefault(name, _Sensor())
            if table == "scans":
                entry.add_scans(columns, rows)
            else:
                entry.add_detections(columns, rows)

    def result(self) -> dict[str, Any]:
        """Return the section ``sensors``.

        Returns
        -------
        dict
            ``{"sensors": {block: {"scans", "evaluated", "detections", "false_alarms", "skipped",
            "first_detection", "last_detection"}}}``, and ``"enabled": False`` for a block that is
            switched off. ``detections`` are those of targets,
            ``false_alarms`` all others. ``evaluated`` counts target evaluations over all scans,
            ``skipped`` targets not evaluated, by reason. A detection is
            ``{"time_s", "range_m", "target"}`` or None, with ``at`` where it is in the sensor's
            first scan ("the start") or its last ("the end of the run"); ``range_m`` is the true
            slant range at that instant, for every sensor, also those that measure none; of
            several targets detected in one instant it is the nearest.
        """
        return {
            "sensors": {
                name: entry.result() | ({"enabled": False} if name in self._off else {})
                for name, entry in self._entries.items()
            }
        }


class FusedSummary:
    """Counts fused lines of sight per combination of sensors."""

    tables: ClassVar[frozenset[str]] = frozenset({"fused"})

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``fused``."""
        for name, rows in rows_by_name(columns["sensors"]):
            self._counts[name] = self._counts.get(name, 0) + len(rows)

    def result(self) -> dict[str, Any]:
        """Return the section ``fused``: combination (``"radar+eo"``) → rows, sorted by name.

        There is one row per target and instant, so one instant with two targets counts twice.
        """
        return {"fused": dict(sorted(self._counts.items()))}


def outcome_observers(simulation: "Simulation") -> list[Observer]:
    """Return running summaries for the kinds of blocks that a scene has."""
    found: list[Observer] = []
    if names := senders(simulation, StateTracks):
        found.append(TrackSummary(names, _recorded_targets(simulation)))
    if names := senders(simulation, AlertLevels):
        found.append(AlertSummary(names))
    if names := senders(simulation, Manoeuvres):
        found.append(ManoeuvreSummary(names))
    return found


class TrackSummary:
    """Counts each tracker's confirmed tracks, and how far they lie from the truth.

    `targets` makes targets in the frame of an origin; None where no truth is recorded.
    """

    tables: ClassVar[frozenset[str]] = frozenset({TABLE})

    def __init__(self, trackers: Iterable[str], targets: Any = None) -> None:
        self._entries = {name: _Tracker(targets) for name in trackers}

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``state_tracks``."""
        status = columns["track_status"]
        wanted = [code for code, name in enumerate(status.names) if name in _HELD]
        held = np.isin(status.codes, wanted)
        for name, rows in rows_by_name(columns["block"]):
            self._entries[name].add(columns, rows[held[rows]])

    def result(self) -> dict[str, Any]:
        """Return the section ``tracks``: tracker → what came of it.

        ``confirmed`` counts tracks that were ever confirmed. Where truth is recorded: ``false``
        of them have a range and are never within `NEAR_M` of a target (None where no track has
        a range), and ``position_error_m`` is the rms distance of the others' states from the
        nearest target within `NEAR_M`, None without any. ``first_confirmed`` is the first
        instant with a confirmed track and its range from the ownship as estimated there (of
        several the nearest, None without a range), None without any; ``targets`` is the same for
        each target that a track with a range came within `NEAR_M` of.
        """
        return {"tracks": {name: entry.result() for name, entry in self._entries.items()}}


class AlertSummary:
    """Keeps from when to when each level of an alerter was on, and for which targets."""

    tables: ClassVar[frozenset[str]] = frozenset({AlertLevels.entry_table or ""})

    def __init__(self, alerters: Iterable[str]) -> None:
        self._entries: dict[str, dict[int, dict[str, list[float]]]] = {n: {} for n in alerters}

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``alerts``, in order of time."""
        level, time_s, target = columns["level"], columns["time_s"], columns["target"]
        for name, rows in rows_by_name(columns["block"]):
            rows = rows[level[rows] > 0]
            pairs = np.stack([level[rows], target.codes[rows]])
            (levels, codes), which = np.unique(pairs, axis=1, return_inverse=True)
            for place, (number, code) in enumerate(
                zip(levels.tolist(), codes.tolist(), strict=True)
            ):
                of_pair = time_s[rows[which.ravel() == place]]
                whom = target.names[code] if code >= 0 else NO_TARGET
                spans = self._entries[name].setdefault(number, {})
                spans.setdefault(whom, [float(of_pair[0]), 0.0])[1] = float(of_pair[-1])

    def result(self) -> dict[str, Any]:
        """Return the section ``alerts``: alerter → level → when, and of which targets.

        ``first_s`` and ``last_s`` are the first and the last instant at which any target had that
        level, ``targets`` the same by target; what is far from all targets is `NO_TARGET`.
        """
        return {
            "alerts": {
                name: {str(level): _spans(levels[level]) for level in sorted(levels)}
                for name, levels in self._entries.items()
            }
        }


def _spans(of_target: dict[str, list[float]]) -> dict[str, Any]:
    firsts, lasts = zip(*of_target.values(), strict=True)
    return {
        "first_s": min(firsts),
        "last_s": max(lasts),
        "targets": {
            name: {"first_s": first_s, "last_s": last_s}
            for name, (first_s, last_s) in sorted(of_target.items())
        },
    }


class ManoeuvreSummary:
    """Counts manoeuvres, and keeps when the first and last were begun."""

    tables: ClassVar[frozenset[str]] = frozenset({Manoeuvres.row_table or ""})

    def __init__(self, deciders: Iterable[str]) -> None:
        self._entries: dict[str, dict[str, Any]] = {
            name: {"count": 0, "first_s": None, "last_s": None} for name in deciders
        }

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``manoeuvres``, in order of time."""
        time_s = columns["time_s"]
        for name, rows in rows_by_name(columns["block"]):
            entry = self._entries[name]
            if not entry["count"]:
                entry["first_s"] = float(time_s[rows[0]])
            entry["count"] += len(rows)
            entry["last_s"] = float(time_s[rows[-1]])

    def result(self) -> dict[str, Any]:
        """Return the section ``manoeuvres``: block → ``count``, ``first_s``, ``last_s``."""
        return {"manoeuvres": self._entries}


class _Sensor:
    """What is kept of one sensor."""

    def __init__(self) -> None:
        self.scans = 0
        self.evaluated = 0
        self.detections = 0
        self.false_alarms = 0
        self.skipped = dict.fromkeys(SKIP_COLUMNS, 0)
        self.first: _Sighting | None = None
        self.last: _Sighting | None = None
        #: Ticks of the first and the last scan.
        self.span: tuple[int, int] | None = None

    def add_scans(self, columns: Columns, rows: IntArray) -> None:
        tick = columns["tick"]
        begin = int(tick[rows[0]]) if self.span is None else self.span[0]
        self.span = begin, int(tick[rows[-1]])
        self.scans += len(rows)
        self.evaluated += int(columns["evaluated"][rows].sum())
        for name in self.skipped:
            if name in columns:
                self.skipped[name] += int(columns[name][rows].sum())

    def add_detections(self, columns: Columns, rows: IntArray) -> None:
        true = rows[columns["target"].codes[rows] >= 0]
        self.false_alarms += len(rows) - len(true)
        if len(true):
            self._add_true(columns, true)

    def _add_true(self, columns: Columns, rows: IntArray) -> None:
        self.detections += len(rows)
        tick = columns["tick"]
        if self.first is None or self.first.tick == tick[rows[0]]:
            together = rows[: np.searchsorted(tick[rows], tick[rows[0]], side="right")]
            self.first = _nearer(self.first, _Sighting.nearest(columns, together))
        together = rows[np.searchsorted(tick[rows], tick[rows[-1]]) :]
        last = _Sighting.nearest(columns, together)
        same_instant = self.last is not None and self.last.tick == last.tick
        self.last = _nearer(self.last, last) if same_instant else last

    def result(self) -> dict[str, Any]:
        return {
            "scans": self.scans,
            "evaluated": self.evaluated,
            "detections": self.detections,
            "false_alarms": self.false_alarms,
            "skipped": {
                name.removeprefix(_SKIPPED): n
                for name, n in self.skipped.items()
                if n or name != _HIDDEN
            },
            "first_detection": self._with_end(self.first, 0),
            "last_detection": self._with_end(self.last, 1),
        }

    def _with_end(self, seen: "_Sighting | None", end: int) -> dict[str, Any] | None:
        """Return a sighting, and whether the sensor's first or last scan censors it."""
        if seen is None:
            return None
        found = seen.result()
        if self.span is not None and in_scan(seen.tick, self.span[end]):
            found["at"] = (START, END)[end]
        return found


class _Sighting(NamedTuple):
    """One detection."""

    tick: int
    time_s: float
    range_m: float
    target: str

    @classmethod
    def nearest(cls, columns: Columns, rows: IntArray) -> "_Sighting":
        """Return the nearest of some rows of one instant."""
        range_m = columns["true_range_m"][rows]
        # A block that knows no true range records NaN, which is never the nearest.
        row = rows[np.argmin(np.where(np.isnan(range_m), np.inf, range_m))]
        target = columns["target"]
        return cls(
            int(columns["tick"][row]),
            float(columns["time_s"][row]),
            float(columns["true_range_m"][row]),
            target.names[target.codes[row]],
        )

    def result(self) -> dict[str, Any]:
        range_m = None if math.isnan(self.range_m) else self.range_m
        return {"time_s": self.time_s, "range_m": range_m, "target": self.target}


def _nearer(one: _Sighting | None, other: _Sighting) -> _Sighting:
    if one is None or math.isnan(one.range_m):
        return other
    return other if other.range_m < one.range_m else one


def rows_by_name(column: Any) -> list[tuple[str, IntArray]]:
    """Return each name that occurs in a text column and its rows, ascending."""
    counts = np.bincount(column.codes + 1)[1:]  # code -1 is null
    return [
        (column.names[code], np.flatnonzero(column.codes == code))
        for code in np.flatnonzero(counts).tolist()
    ]


class _Tracker:
    """What is kept of one tracker."""

    def __init__(self, targets: Any) -> None:
        self._at, self._targets = targets, None
        self._confirmed: set[int] = set()
        self._judged: set[int] = set()
        self._near: set[int] = set()
        self._squares_m2, self._count = 0.0, 0
        #: Time and range, of any track and by the target it is near.
        self._first: tuple[float, float] | None = None
        self._firsts: dict[str, tuple[float, float]] = {}

    def add(self, columns: Columns, rows: IntArray) -> None:
        number = columns["track"]
        self._confirmed.update(np.unique(number[rows]).tolist())
        self._first = _earlier(self._first, columns, rows)
        if self._at is None:
            return
        rows = rows[columns["has_range"][rows]]
        self._judged.update(np.unique(number[rows]).tolist())
        if self._targets is None and len(rows):
            self._targets = self._at(tuple(float(columns[n][rows[0]]) for n in _ORIGIN))
        step = _MOST_AT_ONCE // max(1, len(self._targets.names) if self._targets else 1) + 1
        for start in range(0, len(rows), step):
            self._compare(columns, rows[start : start + step])

    def _compare(self, columns: Columns, rows: IntArray) -> None:
        assert self._targets is not None
        apart = distances(columns, rows, self._targets.at(columns["state_s"][rows]))
        # What is not there is no distance away; a scene may have no targets at all.
        nearest = np.fmin.reduce(apart, axis=0, initial=np.inf)
        near = nearest < NEAR_M
        self._near.update(np.unique(columns["track"][rows[near]]).tolist())
        closest = np.nanargmin(apart[:, near], axis=0) if near.any() else np.empty(0, np.int64)
        for target in np.unique(closest).tolist():
            name = self._targets.names[target]
            first = _earlier(self._firsts.get(name), columns, rows[near][closest == target])
            assert first is not None
            self._firsts[name] = first
        self._squares_m2 += float((nearest[near] ** 2).sum())
        self._count += int(near.sum())

    def result(self) -> dict[str, Any]:
        found: dict[str, Any] = {"confirmed": len(self._confirmed)}
        if self._at is not None:
            found["false"] = len(self._judged - self._near) if self._judged else None
            mean = self._squares_m2 / self._count if self._count else None
            found["position_error_m"] = None if mean is None else mean**0.5
        found["first_confirmed"] = None if self._first is None else _first_result(self._first)
        if self._at is not None:
            found["targets"] = {n: _first_result(self._firsts[n]) for n in sorted(self._firsts)}
        return found


def _earlier(
    first: tuple[float, float] | None, columns: Columns, rows: IntArray
) -> tuple[float, float] | None:
    """Return time and estimated range of the first of rows and what was before, then nearest."""
    if not len(rows):
        return first
    rows = rows[columns["time_s"][rows] == columns["time_s"][rows].min()]
    apart = [columns[name][rows] - columns[f"own_{name}"][rows] for name in _PLACE]
    range_m = np.where(columns["has_range"][rows], np.sqrt(sum(d**2 for d in apart)), np.inf)
    here = float(columns["time_s"][rows[0]]), float(np.fmin.reduce(range_m))
    return here if first is None else min(first, here)


def _first_result(first: tuple[float, float]) -> dict[str, float | None]:
    return {"time_s": first[0], "range_m": first[1] if math.isfinite(first[1]) else None}


def _recorded_targets(simulation: "Simulation") -> Any:
    """Return what makes `TargetsInFrame` of an origin, where the truth is recorded."""
    sources = [b for b in simulation.components.values() if isinstance(b, TrafficSource)]
    if not sources or not all(source.says_truth for source in sources):
        return None
    targets = [target for source in sources for target in source.targets]
    return lambda origin: TargetsInFrame(targets, origin)


def distances(columns: Columns, rows: Any, ned_m: FloatArray) -> FloatArray:
    """Return how far rows of tracks are from targets (targets, 3, rows) at the same times, m."""
    estimate = np.stack([columns[name][rows] for name in _PLACE])
    return np.asarray(np.sqrt(((ned_m - estimate) ** 2).sum(axis=1)))


def senders(simulation: "Simulation", message: type) -> list[str]:
    """Return the names of all blocks that send a kind of message, sorted."""
    return sorted(
        name
        for name, component in simulation.components.items()
        if any(issubclass(output.message, message) for output in component.outputs.values())
    )
