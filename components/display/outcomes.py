"""Running summaries of what came of detections: tracks, alerts and manoeuvres.

They take the recorded rows as these come, and keep a few numbers per track and block.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from components.display.drawn_tracks import NEAR_M, TABLE, Targets, distances
from components.display.summary import numbers, rows_by_name
from components.messages.alerts import AlertLevels
from components.messages.state_tracks import COASTED, CONFIRMED, STATUSES, StateTracks
from components.messages.steering import Manoeuvres
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import IntArray
from dsa_des.record.recording import Columns
from dsa_des.record.sinks import Observer

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation

_STATE = ("state_s", "north_m", "east_m", "down_m")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")
_HELD = (STATUSES[CONFIRMED], STATUSES[COASTED])
#: Distances of tracks and targets that are worked out at once.
_MOST_AT_ONCE = 200_000


def outcome_observers(simulation: "Simulation") -> list[Observer]:
    """Return running summaries for the kinds of blocks that a scene has."""
    found: list[Observer] = []
    if names := _senders(simulation, StateTracks):
        found.append(TrackSummary(names, _recorded_targets(simulation)))
    if names := _senders(simulation, AlertLevels):
        found.append(AlertSummary(names))
    if names := _senders(simulation, Manoeuvres):
        found.append(ManoeuvreSummary(names))
    return found


class TrackSummary:
    """Counts each tracker's confirmed tracks, and how far they lie from the truth.

    Parameters
    ----------
    trackers : iterable of str
        Each gets an entry, also without tracks.
    targets : callable, optional
        From the origin of a frame to `Targets`; None where no truth is recorded.
    """

    tables: ClassVar[frozenset[str]] = frozenset({TABLE})

    def __init__(self, trackers: Iterable[str], targets: Any = None) -> None:
        self._entries = {name: _Tracker(targets) for name in trackers}

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``state_tracks``."""
        status: Any = columns["track_status"]
        wanted = [code for code, name in enumerate(status.names) if name in _HELD]
        held = np.isin(status.codes, wanted)
        for name, rows in rows_by_name(columns["block"]):
            self._entries[name].add(columns, rows[held[rows]])

    def result(self) -> dict[str, Any]:
        """Return the section ``tracks``: tracker → what came of it.

        ``confirmed`` counts tracks that were ever confirmed. Where truth is recorded: ``false``
        of them have a range and are never within `NEAR_M` of a target (None where no track has
        a range), and ``position_error_m`` is the rms distance of the others' states from the
        nearest target within `NEAR_M`, None without any.
        """
        return {"tracks": {name: entry.result() for name, entry in self._entries.items()}}


class AlertSummary:
    """Keeps when each level of an alerter first came on."""

    tables: ClassVar[frozenset[str]] = frozenset({AlertLevels.entry_table or ""})

    def __init__(self, alerters: Iterable[str]) -> None:
        self._first_s: dict[str, dict[int, float]] = {name: {} for name in alerters}

    def update(self, table: str, columns: Columns) -> None:
        """Take rows of ``alerts``, in order of time."""
        level, time_s = numbers(columns, "level"), numbers(columns, "time_s")
        for name, rows in rows_by_name(columns["block"]):
            found, first = np.unique(level[rows], return_index=True)
            for number, row in zip(found.tolist(), rows[first].tolist(), strict=True):
                if number > 0:
                    self._first_s[name].setdefault(number, float(time_s[row]))

    def result(self) -> dict[str, Any]:
        """Return the section ``alerts``: alerter → level → time of its first alert, s."""
        return {
            "alerts": {
                name: {str(level): first[level] for level in sorted(first)}
                for name, first in self._first_s.items()
            }
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
        time_s = numbers(columns, "time_s")
        for name, rows in rows_by_name(columns["block"]):
            entry = self._entries[name]
            if not entry["count"]:
                entry["first_s"] = float(time_s[rows[0]])
            entry["count"] += len(rows)
            entry["last_s"] = float(time_s[rows[-1]])

    def result(self) -> dict[str, Any]:
        """Return the section ``manoeuvres``: block → ``count``, ``first_s``, ``last_s``."""
        return {"manoeuvres": self._entries}


class _Tracker:
    """What is kept of one tracker."""

    def __init__(self, targets: Any) -> None:
        self._at, self._targets = targets, None
        self._confirmed: set[int] = set()
        self._judged: set[int] = set()
        self._near: set[int] = set()
        self._squares_m2, self._count = 0.0, 0

    def add(self, columns: Columns, rows: IntArray) -> None:
        number = numbers(columns, "track")
        self._confirmed.update(np.unique(number[rows]).tolist())
        if self._at is None:
            return
        rows = rows[numbers(columns, "has_range")[rows]]
        self._judged.update(np.unique(number[rows]).tolist())
        if self._targets is None and len(rows):
            self._targets = self._at(tuple(float(numbers(columns, n)[rows[0]]) for n in _ORIGIN))
        step = _MOST_AT_ONCE // max(1, len(self._targets.names) if self._targets else 1) + 1
        for start in range(0, len(rows), step):
            self._compare(columns, rows[start : start + step])

    def _compare(self, columns: Columns, rows: IntArray) -> None:
        assert self._targets is not None
        one = {name: np.asarray(numbers(columns, name)[rows]) for name in _STATE}
        apart = distances(one, self._targets.at(one["state_s"]))
        # What is not there is no distance away; a scene may have no targets at all.
        nearest = np.fmin.reduce(apart, axis=0, initial=np.inf)
        near = nearest < NEAR_M
        self._near.update(np.unique(numbers(columns, "track")[rows[near]]).tolist())
        self._squares_m2 += float((nearest[near] ** 2).sum())
        self._count += int(near.sum())

    def result(self) -> dict[str, Any]:
        told: dict[str, Any] = {"confirmed": len(self._confirmed)}
        if self._at is not None:
            told["false"] = len(self._judged - self._near) if self._judged else None
            mean = self._squares_m2 / self._count if self._count else None
            told["position_error_m"] = None if mean is None else mean**0.5
        return told


def _recorded_targets(simulation: "Simulation") -> Any:
    """Return what makes `Targets` of an origin, where the truth is recorded."""
    sources = [b for b in simulation.components.values() if isinstance(b, TrafficSource)]
    if not sources or not all(source.says_truth for source in sources):
        return None
    return lambda origin: Targets(simulation, origin)


def _senders(simulation: "Simulation", message: type) -> list[str]:
    return sorted(
        name
        for name, component in simulation.components.items()
        if any(issubclass(output.message, message) for output in component.outputs.values())
    )
