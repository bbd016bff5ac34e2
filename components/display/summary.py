"""Running summaries of a run: what each sensor detected, and what was fused.

They take the recorded rows as these come, and keep a few numbers per sensor, track and block
whatever the length of the run.
"""

import math
from collections.abc import Collection, Iterable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from components.messages.detections import Detections
from components.metrics.rows import END, START, is_at_boundary_scan
from dsa_des.arrays.types import IntArray

#: Columns of recorded rows; of text `dsa_des.block.message.Text`.
Columns = Any

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
        """Update the summary with rows of ``scans`` or ``detections``, in order of time."""
        for name, rows in rows_by_name(columns["block"]):
            entry = self._entries.setdefault(name, _Sensor())
            if table == "scans":
                entry.add_scans(columns, rows)
            else:
                entry.add_detections(columns, rows)

    def result(self) -> dict[str, Any]:
        """Return the section ``sensors``: block → counts, first and last detection.

        ``evaluated`` counts targets over all scans, ``skipped`` those not evaluated, by reason. A
        detection has its true range, of several at one instant the nearest, and ``at`` where it is
        in the sensor's first scan or its last; a block that is switched off ``"enabled": False``.
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
        """Update the summary with rows of ``fused``."""
        for name, rows in rows_by_name(columns["sensors"]):
            self._counts[name] = self._counts.get(name, 0) + len(rows)

    def result(self) -> dict[str, Any]:
        """Return the section ``fused``: combination (``"radar+eo"``) → rows, sorted by name.

        There is one row per target and instant, so one instant with two targets counts twice.
        """
        return {"fused": dict(sorted(self._counts.items()))}


class _Sensor:
    """Running counts, first and last detection of one sensor."""

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
            self._add_true_detections(columns, true)

    def _add_true_detections(self, columns: Columns, rows: IntArray) -> None:
        self.detections += len(rows)
        tick = columns["tick"]
        if self.first is None or self.first.tick == tick[rows[0]]:
            together = rows[: np.searchsorted(tick[rows], tick[rows[0]], side="right")]
            self.first = _select_nearer(self.first, _Sighting.nearest(columns, together))
        together = rows[np.searchsorted(tick[rows], tick[rows[-1]]) :]
        last = _Sighting.nearest(columns, together)
        same_instant = self.last is not None and self.last.tick == last.tick
        self.last = _select_nearer(self.last, last) if same_instant else last

    def result(self) -> dict[str, Any]:
        # Who looks at no target in particular, as a foreign sensor, cannot say whose they are.
        unnamed = 0
        if not (self.detections or self.evaluated or any(self.skipped.values())):
            unnamed = self.false_alarms
        return {
            "scans": self.scans,
            "evaluated": self.evaluated,
            "detections": self.detections,
            "false_alarms": self.false_alarms - unnamed,
            **({"unnamed_detections": unnamed} if unnamed else {}),
            "skipped": {
                name.removeprefix(_SKIPPED): n
                for name, n in self.skipped.items()
                if n or name != _HIDDEN
            },
            "first_detection": self._sighting_with_cut_off_end(self.first, 0),
            "last_detection": self._sighting_with_cut_off_end(self.last, 1),
        }

    def _sighting_with_cut_off_end(
        self, seen: "_Sighting | None", end: int
    ) -> dict[str, Any] | None:
        """Return a detection's fields, plus ``at`` (start or end) if it lies in the sensor's first
        or last scan, where the run cuts it off.
        """
        if seen is None:
            return None
        result = seen.result()
        if self.span is not None and is_at_boundary_scan(seen.tick, self.span[end]):
            result["at"] = (START, END)[end]
        return result


class _Sighting(NamedTuple):
    """Time, true range and target of one detection."""

    tick: int
    time_s: float
    range_m: float
    target: str

    @classmethod
    def nearest(cls, columns: Columns, rows: IntArray) -> "_Sighting":
        """Return the detection with the smallest true range among rows of one instant."""
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


def _select_nearer(one: _Sighting | None, other: _Sighting) -> _Sighting:
    if one is None or math.isnan(one.range_m):
        return other
    return other if other.range_m < one.range_m else one


def rows_by_name(column: Any) -> list[tuple[str, IntArray]]:
    """Return each name in a text column with its row indices, in the dictionary's order."""
    counts = np.bincount(column.codes + 1)[1:]  # code -1 is null
    return [
        (column.names[code], np.flatnonzero(column.codes == code))
        for code in np.flatnonzero(counts).tolist()
    ]
