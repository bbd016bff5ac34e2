"""Running summaries of what came of a run: tracks, alerts, manoeuvres, and who has which.

They take the recorded rows as `components.display.summary` does.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np

from components.display.summary import Columns, rows_by_name
from components.messages.alerts import AlertLevels
from components.messages.columns import ORIGIN, POSITION
from components.messages.state_tracks import StateTracks, is_confirmed_or_coasted
from components.messages.steering import Manoeuvres
from components.messages.targets import TrafficStates
from components.metrics.true_states import TargetsInFrame
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.record.sinks import Observer
from dsa_des.running.simulation import Simulation

#: Table of the tracks.
TABLE = "state_tracks"
#: A track that never comes so near to any target is false.
NEAR_M = 300.0
#: Instead of a target's name, for what is near none.
NO_TARGET = "no target"
#: Instead of a tracker's name, for alerts of what truly is.
TRUTH = "the truth"
#: Distances of tracks and targets that are worked out at once.
_MOST_AT_ONCE = 200_000


def outcome_observers(simulation: Simulation) -> list[Observer]:
    """Return summaries that follow a run, one for each of tracks, alerts and manoeuvres sent."""
    result: list[Observer] = []
    if names := blocks_sending(simulation, StateTracks):
        result.append(TrackSummary(names, _true_targets_factory(simulation)))
    if names := blocks_sending(simulation, AlertLevels):
        result.append(AlertSummary(_target_sources_by_alerter(simulation, names)))
    if names := blocks_sending(simulation, Manoeuvres):
        result.append(ManoeuvreSummary(names))
    return result


class TrackSummary:
    """Counts each tracker's confirmed tracks, and how far they lie from the truth.

    `targets` makes of a tracker what it may see in the frame of an origin, as it flies now; None
    where no truth is recorded.
    """

    tables: ClassVar[frozenset[str]] = frozenset({TABLE})

    def __init__(self, trackers: Iterable[str], targets: Any = None) -> None:
        self._entries = {
            name: _Tracker(None if targets is None else partial(targets, name)) for name in trackers
        }

    def update(self, table: str, columns: Columns) -> None:
        """Update the summary with rows of ``state_tracks``."""
        confirmed = is_confirmed_or_coasted(columns["track_status"])
        for name, rows in rows_by_name(columns["block"]):
            self._entries[name].add(columns, rows[confirmed[rows]])

    def result(self) -> dict[str, Any]:
        """Return section ``tracks``: by tracker counts, rms position error and first instants.

        Where truth is recorded: ``false`` tracks have a range and are never within `NEAR_M` of a
        target, ``position_error_m`` is the rms distance of the others' states from the nearest
        target. ``first_confirmed`` and, by target, ``targets`` are the first instant and the range
        estimated there, of several tracks the nearest. None is what there is none of.
        """
        return {"tracks": {name: entry.result() for name, entry in self._entries.items()}}


class AlertSummary:
    """Keeps from when to when each level of an alerter was on, and for which targets.

    `sources` are the blocks that tell each alerter of targets.
    """

    tables: ClassVar[frozenset[str]] = frozenset({AlertLevels.entry_table or ""})

    def __init__(self, sources: Mapping[str, Sequence[str]]) -> None:
        self._sources = {name: list(of) for name, of in sources.items()}
        self._entries: dict[str, dict[int, dict[str, list[float]]]] = {n: {} for n in sources}

    def update(self, table: str, columns: Columns) -> None:
        """Update the summary with rows of ``alerts``, in order of time."""
        level, time_s, target = columns["level"], columns["time_s"], columns["target"]
        for name, rows in rows_by_name(columns["block"]):
            rows = rows[level[rows] > 0]
            pairs = np.stack([level[rows], target.codes[rows]])
            (levels, codes), which = np.unique(pairs, axis=1, return_inverse=True)
            for index, (number, code) in enumerate(
                zip(levels.tolist(), codes.tolist(), strict=True)
            ):
                of_pair = time_s[rows[which.ravel() == index]]
                whom = target.names[code] if code >= 0 else NO_TARGET
                spans = self._entries[name].setdefault(number, {})
                spans.setdefault(whom, [float(of_pair[0]), 0.0])[1] = float(of_pair[-1])

    def result(self) -> dict[str, Any]:
        """Return section ``alerts``: by alerter and level when it was on, and for which targets.

        ``first_s`` and ``last_s`` are the first and the last instant at which any target had that
        level, ``targets`` the same by target; what is far from all targets is `NO_TARGET`. The
        section ``alerts_of`` says whose tracks each alerter goes by, or that it goes by the truth.
        """
        return {
            "alerts_of": self._sources,
            "alerts": {
                name: {str(level): _span_with_targets(levels[level]) for level in sorted(levels)}
                for name, levels in self._entries.items()
            },
        }


def _span_with_targets(of_target: dict[str, list[float]]) -> dict[str, Any]:
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
        """Update the summary with rows of ``manoeuvres``, in order of time."""
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


#: Sections of a summary that are by block.
_BY_BLOCK = ("sensors", "tracks", "late_looks", "alerts", "manoeuvres")


def platform_by_block(simulation: Simulation) -> dict[str, str]:
    """Return the platform's name by block, the ownship's blocks first; empty for one platform."""
    first = {name for one in simulation.components.values() for name in one.platforms()[:1]}
    carried = simulation.platforms.items()
    return dict(sorted(carried, key=lambda item: (item[1] not in first, item[1], item[0])))


class PlatformSummary:
    """Lists what each of several platforms carries, and its closest approaches in the flown run."""

    tables: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def update(self, table: str, columns: Any) -> None:
        """Ignore all rows: this summary uses none."""

    def result(self) -> dict[str, Any]:
        """Return the section ``platforms``: by name its ``blocks``, and for all but the ownship its
        closest approaches in ``targets``.
        """
        blocks: dict[str, list[str]] = {}
        for block, platform in sorted(self._simulation.platforms.items()):
            blocks.setdefault(platform, []).append(block)
        return {
            "platforms": {
                name: {"blocks": mine, **self._targets(name)} for name, mine in blocks.items()
            }
        }

    def _targets(self, platform: str) -> dict[str, Any]:
        for source in self._simulation.components.values():
            if isinstance(source, TrafficSource) and platform in source.platforms()[1:]:
                return {"targets": source.closest_approaches(platform)}
        return {}


def select_platform(summary: Mapping[str, Any], platform: str) -> dict[str, Any]:
    """Return only the parts of a summary on one platform's blocks and closest approaches."""
    carried = summary["platforms"][platform]
    blocks = set(carried["blocks"])
    result: dict[str, Any] = {"targets": carried.get("targets", summary.get("targets"))}
    for section in _BY_BLOCK:
        every = summary.get(section) or {}
        result[section] = {name: of for name, of in every.items() if name in blocks}
    every = summary.get("fused") or {}
    result["fused"] = {name: n for name, n in every.items() if blocks & {*name.split("+")}}
    return {**result, "alerts_of": summary.get("alerts_of", {})}


class _Tracker:
    """Running counts, errors and first instants of one tracker's confirmed tracks."""

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
        self._first = _earliest_time_and_range(self._first, columns, rows)
        if self._at is None:
            return
        rows = rows[columns["has_range"][rows]]
        self._judged.update(np.unique(number[rows]).tolist())
        if len(rows):
            self._targets = self._at(tuple(float(columns[n][rows[0]]) for n in ORIGIN))
        step = _MOST_AT_ONCE // max(1, len(self._targets.names) if self._targets else 1) + 1
        for start in range(0, len(rows), step):
            self._compare_with_truth(columns, rows[start : start + step])

    def _compare_with_truth(self, columns: Columns, rows: IntArray) -> None:
        assert self._targets is not None
        apart = distances_to_targets(
            columns, rows, self._targets.positions_at(columns["state_s"][rows])
        )
        # What is not there is no distance away; a scene may have no targets at all.
        nearest = np.fmin.reduce(apart, axis=0, initial=np.inf)
        near = nearest < NEAR_M
        self._near.update(np.unique(columns["track"][rows[near]]).tolist())
        closest = np.nanargmin(apart[:, near], axis=0) if near.any() else np.empty(0, np.int64)
        for target in np.unique(closest).tolist():
            name = self._targets.names[target]
            first = _earliest_time_and_range(
                self._firsts.get(name), columns, rows[near][closest == target]
            )
            assert first is not None
            self._firsts[name] = first
        self._squares_m2 += float((nearest[near] ** 2).sum())
        self._count += int(near.sum())

    def result(self) -> dict[str, Any]:
        result: dict[str, Any] = {"confirmed": len(self._confirmed)}
        if self._at is not None:
            result["false"] = len(self._judged - self._near) if self._judged else None
            mean = self._squares_m2 / self._count if self._count else None
            result["position_error_m"] = None if mean is None else mean**0.5
        result["first_confirmed"] = (
            None if self._first is None else _time_and_range_fields(self._first)
        )
        if self._at is not None:
            result["targets"] = {
                n: _time_and_range_fields(self._firsts[n]) for n in sorted(self._firsts)
            }
        return result


def _earliest_time_and_range(
    first: tuple[float, float] | None, columns: Columns, rows: IntArray
) -> tuple[float, float] | None:
    """Return the first time and estimated range, a former result included; at a tie the nearest."""
    if not len(rows):
        return first
    rows = rows[columns["time_s"][rows] == columns["time_s"][rows].min()]
    apart = [columns[name][rows] - columns[f"own_{name}"][rows] for name in POSITION]
    range_m = np.where(columns["has_range"][rows], np.sqrt(sum(d**2 for d in apart)), np.inf)
    here = float(columns["time_s"][rows[0]]), float(np.fmin.reduce(range_m))
    return here if first is None else min(first, here)


def _time_and_range_fields(first: tuple[float, float]) -> dict[str, float | None]:
    return {"time_s": first[0], "range_m": first[1] if math.isfinite(first[1]) else None}


def _true_targets_factory(simulation: Simulation) -> Any:
    """Return a function from tracker and origin to true targets in that frame; None if no truth."""
    sources = [b for b in simulation.components.values() if isinstance(b, TrafficSource)]
    if not sources or not all(source.says_truth for source in sources):
        return None
    return lambda tracker, origin: TargetsInFrame(
        flights_of_other_aircraft(simulation, tracker), origin
    )


def flights_of_other_aircraft(simulation: Simulation, block: str) -> list[Any]:
    """Return the true flights of all aircraft other than the platform that carries a block."""
    sources = [b for b in simulation.components.values() if isinstance(b, TrafficSource)]
    platform = simulation.components[block].context.platform
    return [
        flight
        for source in sources
        for flight in source.seen_from(platform if platform in source.platforms() else "")[1:]
    ]


def distances_to_targets(columns: Columns, rows: Any, ned_m: FloatArray) -> FloatArray:
    """Return the distances, m (targets, rows), of track rows from target positions (targets, 3,
    rows) at the same times.
    """
    estimate = np.stack([columns[name][rows] for name in POSITION])
    return np.asarray(np.sqrt(((ned_m - estimate) ** 2).sum(axis=1)))


def _target_sources_by_alerter(
    simulation: Simulation, names: Iterable[str]
) -> dict[str, list[str]]:
    """Return each alerter's blocks that tell it of targets, or `TRUTH` if only traffic feeds it."""
    traffic = set(blocks_sending(simulation, TrafficStates))
    result = {}
    for name in names:
        of = sorted({wire.source for wire in simulation.scene.wires if wire.target == name})
        result[name] = [source for source in of if source not in traffic] or [TRUTH]
    return result


def blocks_sending(simulation: Simulation, message: type) -> list[str]:
    """Return the sorted names of all blocks that send this class of message."""
    return sorted(
        name
        for name, component in simulation.components.items()
        if any(issubclass(output.message, message) for output in component.outputs.values())
    )
