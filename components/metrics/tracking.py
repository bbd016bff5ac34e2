"""How good estimated tracks are against the truth (``tracking``)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import Field

from components.messages.state_tracks import COVARIANCE, STATUSES
from components.metrics.rows import is_named
from components.metrics.set_distances import assigned, chi_square_bounds, set_distance
from components.metrics.true_states import RecordedTruth
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Parameters
from dsa_des.errors import did_you_mean
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import NUMBER, Group, Metric, Result, recorded_by

_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")
_TABLE = "state_tracks"

_RESULTS = {
    "track_nees_mean": "mean normalised error squared of tracks' states; 6 where they are honest",
    "track_nees_inside": "share of them within the 95 % bounds of chi-square with 6 degrees",
    "track_position_error_m": "distance of tracks from their targets, rms, m",
    "track_horizontal_error_m": "its horizontal part, rms, m",
    "track_vertical_error_m": "its vertical part, rms, m",
    "track_velocity_error_m_s": "error of their velocity, rms, m/s",
    "track_ospa_m": "OSPA distance of tracks and targets, mean over time, m",
    "track_gospa_m": "GOSPA distance, mean over time, m",
    "track_gospa_localisation_m": "its part of pairs, mean over time, m",
    "track_gospa_missed_m": "its part of targets without a track, mean over time, m",
    "track_gospa_false_m": "its part of tracks without a target, mean over time, m",
    "track_completeness": "share of the targets' time that they have a track (SIAP)",
    "track_ambiguity": "tracks of a target that has any, mean over time (SIAP)",
    "track_spuriousness": "share of the tracks' time that they have no target (SIAP)",
    "track_longest_share": "longest time of one track on a target by all its time, mean (SIAP)",
    "track_confirmation_s": "time from a target's first detection to its first confirmed track, "
    "mean, s",
    "track_false_per_hour": "confirmed tracks that never have a target, per hour",
    "track_broken": "times that a target's track goes on under a new number",
    "track_swapped": "times that it goes on under a number that was another target's",
}


class TrackingParameters(Parameters):
    """When tracks are compared with the truth, and what belongs together."""

    block: str | None = Field(
        default=None,
        description="Whose tracks; results then bear its name. By default those of the blocks "
        "whose tracks go into no other's.",
    )
    step_s: float = Field(
        default=0.5, gt=0, le=60, description="Time from one comparison to the next, s."
    )
    from_s: float = Field(
        default=0.0, ge=0, description="Time from which on instants count, s: starts left out."
    )
    within_m: float = Field(
        default=300.0, gt=0,
        description="Distance up to which a track may be a target's; cut-off of OSPA and GOSPA, m.",
    )  # fmt: skip
    order: float = Field(default=2.0, ge=1, le=10, description="Power p of OSPA and GOSPA.")


@dataclass
class _Tally:
    """What is added up over the instants of one run."""

    nees: list[float] = field(default_factory=list)
    error: list[FloatArray] = field(default_factory=list)
    sets: list[tuple[float, ...]] = field(default_factory=list)
    present: int = 0
    tracked: int = 0
    near_tracks: int = 0
    tracks: int = 0
    spurious: int = 0
    numbers: dict[int, list[int]] = field(default_factory=dict)
    since: dict[int, float] = field(default_factory=dict)
    confirmed: set[int] = field(default_factory=set)
    owned: set[int] = field(default_factory=set)
    steps_present: dict[int, int] = field(default_factory=dict)


class Tracking(Metric):
    """Compares confirmed tracks that have a range with all targets, instant by instant.

    At every instant of the grid the last tracks told before it count, each at the instant its state
    speaks of. Tracks and targets are assigned so that the sum of distances is least.
    """

    Parameters = TrackingParameters
    tables = {
        _TABLE: (
            "block", "time_s", "state_s", "track", "track_status", "has_range", *_STATE, *_ORIGIN,
            *COVARIANCE.values(),
        ),
        "detections": ("time_s", "target"),
    }  # fmt: skip

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        known, block = recorded_by(scene, _TABLE), self.p.block
        if block is not None and block not in known:
            raise ValueError(f"block: {block!r} tells no tracks{did_you_mean(block, known)}")

    def results(self) -> list[Result]:
        """Return errors, honesty, distances of sets, and identities."""
        of = "" if self.p.block is None else f".{self.p.block}"
        return [Result(name + of, NUMBER, says) for name, says in _RESULTS.items()]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return all of every replica."""
        columns: Any = group.tables[_TABLE]
        of = "" if self.p.block is None else f".{self.p.block}"
        found = {name + of: np.full(len(group), np.nan) for name in _RESULTS}
        held = np.isin(columns["track_status"].codes, _codes(columns["track_status"].names))
        replica = np.asarray(columns["replica"])
        for number, scene in enumerate(group.scenes):
            told = _told_by(columns["block"], scene, self.p.block)
            mine = np.flatnonzero((replica == number) & told)
            first = _first_detections(group.tables["detections"], number)
            values = self._of_run(
                columns, mine, held, scene, first, float(group.duration_s[number])
            )
            for name, value in values.items():
                found[name + of][number] = value
        return found

    def _of_run(
        self,
        columns: Any,
        rows: IntArray,
        held: Any,
        scene: Scene,
        first: Mapping[str, float],
        duration_s: float,
    ) -> dict[str, float]:
        truth = RecordedTruth(scene)
        tally = _Tally()
        time_s = columns["time_s"][rows]
        instants, start = np.unique(time_s, return_index=True)
        ends = np.append(start[1:], len(rows))
        grid = np.arange(self.p.step_s, duration_s + 1e-9, self.p.step_s)
        place = np.searchsorted(instants, grid, side="right") - 1
        told = np.unique(place[(place >= 0) & (grid >= self.p.from_s)])
        messages = [rows[start[i] : ends[i]] for i in told.tolist()]
        messages = [m[held[m] & columns["has_range"][m]] for m in messages]
        every = np.concatenate([rows[:0], *messages])
        origin = np.stack([columns[name][every] for name in _ORIGIN])
        state, _ = truth.at(columns["state_s"][every], origin)
        _, there = truth.at(instants[told], np.zeros((3, len(told))))
        first_row = 0
        for k, message in enumerate(messages):
            last_row = first_row + len(message)
            present = np.flatnonzero(there[:, k])
            true = state[:, :, first_row:last_row]
            self._compare(columns, message, float(instants[told[k]]), true, present, tally)
            first_row = last_row
        return _summed(tally, truth.names, first, duration_s)

    def _compare(
        self,
        columns: Any,
        rows: IntArray,
        time_s: float,
        state: FloatArray,
        present: IntArray,
        tally: _Tally,
    ) -> None:
        count = len(rows)
        estimate = np.stack([columns[name][rows] for name in _STATE])
        apart = np.empty((count, len(present)))
        for k, target in enumerate(present.tolist()):
            apart[:, k] = np.sqrt(((estimate[:3] - state[target, :3]) ** 2).sum(axis=0))
        numbers = columns["track"][rows]
        limit = self.p.within_m
        found = set_distance(apart, limit, self.p.order)
        tally.sets.append(
            (found.ospa_m, found.gospa_m, found.localisation_m, found.missed_m, found.false_m)
        )
        near = apart < limit
        tally.present += len(present)
        tally.tracked += int(near.any(axis=0).sum())
        tally.near_tracks += int(near.sum())
        tally.tracks += count
        tally.spurious += int((~near.any(axis=1)).sum())
        tally.confirmed |= set(numbers.tolist())
        for target in present.tolist():
            tally.steps_present[target] = tally.steps_present.get(target, 0) + 1
        for track, k in zip(*assigned(np.minimum(apart, limit)), strict=True):
            if apart[track, k] >= limit:
                continue
            target = int(present[k])
            error = estimate[:, track] - state[target, :, track]
            spread = np.empty((6, 6))
            for (i, j), name in COVARIANCE.items():
                spread[i, j] = spread[j, i] = columns[name][rows[track]]
            tally.nees.append(float(error @ np.linalg.solve(spread, error)))
            tally.error.append(error)
            tally.numbers.setdefault(target, []).append(int(numbers[track]))
            tally.since.setdefault(target, time_s)
            tally.owned.add(int(numbers[track]))


def _told_by(column: Any, scene: Scene, block: str | None) -> Any:
    """Return which rows are of the block that is asked for, or of those that are last."""
    names = column.names
    if block is None:
        fed = {
            source for source, target in scene.graph.edges if source in names and target in names
        }
        wanted = [i for i, name in enumerate(names) if name not in fed]
    else:
        wanted = [i for i, name in enumerate(names) if name == block]
    return np.isin(column.codes, wanted)


def _summed(
    tally: _Tally, names: list[str], first: Mapping[str, float], duration_s: float
) -> dict[str, float]:
    low, high = chi_square_bounds(6)
    nees = np.array(tally.nees)
    error = np.array(tally.error).reshape(-1, 6)
    sets = np.array(tally.sets).reshape(-1, 5)
    with np.errstate(invalid="ignore", divide="ignore"):
        square = error**2
        rms = {
            "track_position_error_m": square[:, :3].sum(axis=1),
            "track_horizontal_error_m": square[:, :2].sum(axis=1),
            "track_vertical_error_m": square[:, 2],
            "track_velocity_error_m_s": square[:, 3:].sum(axis=1),
        }
        found = {name: _mean(values) ** 0.5 for name, values in rms.items()}
    names_of_sets = [name for name in _RESULTS if "ospa" in name]
    found |= {name: _mean(sets[:, i]) for i, name in enumerate(names_of_sets)}
    found["track_nees_mean"] = _mean(nees)
    found["track_nees_inside"] = _mean((nees >= low) & (nees <= high))
    found["track_completeness"] = _ratio(tally.tracked, tally.present)
    found["track_ambiguity"] = _ratio(tally.near_tracks, tally.tracked)
    found["track_spuriousness"] = _ratio(tally.spurious, tally.tracks)
    longest = [
        max(numbers.count(n) for n in set(numbers)) / tally.steps_present[target]
        for target, numbers in tally.numbers.items()
    ]
    found["track_longest_share"] = _mean(np.array(longest))
    delays = [since - first[names[t]] for t, since in tally.since.items() if names[t] in first]
    found["track_confirmation_s"] = _mean(np.array(delays))
    found["track_false_per_hour"] = 3600.0 * len(tally.confirmed - tally.owned) / duration_s
    found["track_broken"], found["track_swapped"] = _changes(tally.numbers)
    return found


def _changes(numbers: Mapping[int, list[int]]) -> tuple[float, float]:
    """Return how often tracks of targets go on under new numbers, and under another's."""
    broken = swapped = 0
    for target, own in numbers.items():
        others = {n for other, theirs in numbers.items() if other != target for n in theirs}
        for before, after in pairwise(own):
            if before != after:
                swapped += after in others
                broken += after not in others
    return float(broken), float(swapped)


def _first_detections(columns: Any, replica: int) -> dict[str, float]:
    mine = np.asarray(columns["replica"]) == replica
    found = {}
    for name in columns["target"].names:
        rows = mine & is_named(columns["target"], name)
        if rows.any():
            found[name] = float(columns["time_s"][rows].min())
    return found


def _codes(names: tuple[str, ...]) -> list[int]:
    wanted = set(STATUSES[1:3])
    return [code for code, name in enumerate(names) if name in wanted]


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")
