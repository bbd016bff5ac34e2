"""Scores of the tracks of one run against the truth: errors, NEES, OSPA, GOSPA, SIAP, identities.

Sources: Schuhmacher, Vo, Vo, IEEE Trans. Signal Proc. 56 (2008), eq. 3 (OSPA); Rahmathullah,
García-Fernández, Svensson, *Generalized optimal sub-pattern assignment metric*, FUSION 2017, with
alpha = 2, where missed and false ones are told apart.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.results.statistics import chi_square_bounds

_AXES = ("north", "east", "down")
_SETS = (
    "track_ospa_m", "track_gospa_m", "track_gospa_localisation_m", "track_gospa_missed_m",
    "track_gospa_false_m",
)  # fmt: skip


class SetDistance(NamedTuple):
    """OSPA distance, 0 to cut-off, and GOSPA with localisation, missed and false track parts, m."""

    ospa_m: float
    gospa_m: float
    localisation_m: float
    missed_m: float
    false_m: float


def ospa_and_gospa(distance_m: FloatArray, cutoff_m: float, order: float = 2.0) -> SetDistance:
    """Return OSPA, GOSPA of distances (tracks, truths) with cut-off, m; `order` is p, 1 or more."""
    tracks, truths = distance_m.shape
    if tracks == 0 and truths == 0:
        return SetDistance(0.0, 0.0, 0.0, 0.0, 0.0)
    powers = np.minimum(distance_m, cutoff_m) ** order
    row, column = assign_least_cost(powers)
    near = powers[row, column]
    apart = abs(tracks - truths)
    ospa = (near.sum() + cutoff_m**order * apart) / max(tracks, truths)
    # A pair at the cut-off costs as much as one missed and one false: GOSPA leaves it unassigned.
    together = near[distance_m[row, column] < cutoff_m]
    half = 0.5 * cutoff_m**order
    missed, false = half * (truths - len(together)), half * (tracks - len(together))
    parts = [float(together.sum()), missed, false]
    return SetDistance(
        float(ospa) ** (1.0 / order),
        math.fsum(parts) ** (1.0 / order),
        *(part ** (1.0 / order) for part in parts),
    )


def assign_least_cost(cost: FloatArray) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the assignment that costs least."""
    if cost.size == 0:
        none = np.empty(0, dtype=np.int64)
        return none, none
    from scipy.optimize import linear_sum_assignment

    row, column = linear_sum_assignment(cost)
    return row, column


@dataclass(frozen=True, eq=False)
class ReportedTracks:
    """Confirmed tracks with a range at one instant and their errors against all targets, if any.

    Errors (targets, 6, tracks) are position and velocity north, east, down less those of each
    target: ``error`` of tracks that went on at their velocities since they were reported,
    ``error_as_reported`` of what was reported, to which the covariance (tracks, 6, 6) belongs.
    ``is_new`` says whose report is compared for the first time, ``confirmed_s`` when each was first
    reported as confirmed.
    """

    time_s: float
    number: IntArray
    error: FloatArray
    error_as_reported: FloatArray
    covariance: FloatArray
    is_new: BoolArray
    confirmed_s: FloatArray


@dataclass
class TrackTally:
    """Sums over the instants of one run.

    At every instant tracks and targets are assigned one to one so that the sum of distances is
    least. A track that is left over belongs to the nearest target, as one too many, if that is
    within `within_m`, the cut-off of OSPA and GOSPA of an order; otherwise it is spurious. Instants
    are `step_s` apart, and those without any track count like all others. What rests on covariances
    counts once for each report.
    """

    within_m: float
    order: float
    step_s: float
    nees: list[float] = field(default_factory=list)
    error: list[FloatArray] = field(default_factory=list)
    paired_s: list[float] = field(default_factory=list)
    accuracy: list[tuple[float, float]] = field(default_factory=list)
    sets: list[SetDistance] = field(default_factory=list)
    present: int = 0
    tracked: int = 0
    tracks: int = 0
    spurious: int = 0
    numbers: dict[int, list[int]] = field(default_factory=dict)
    since: dict[int, float] = field(default_factory=dict)
    confirmed: set[int] = field(default_factory=set)
    owned: set[int] = field(default_factory=set)
    steps_present: dict[int, int] = field(default_factory=dict)
    before_s: float = 0.0

    def add(self, tracks: ReportedTracks, present: IntArray) -> None:
        """Compare tracks at one instant with the present targets (indices); add to the sums."""
        count = len(tracks.number)
        apart = np.sqrt((tracks.error[present, :3] ** 2).sum(axis=1)).T
        result = ospa_and_gospa(apart, self.within_m, self.order)
        self.sets.append(result)
        self.present += len(present)
        self.tracks += count
        self.confirmed |= set(tracks.number.tolist())
        for target in present.tolist():
            self.steps_present[target] = self.steps_present.get(target, 0) + 1
        left = set(range(count))
        for track, k in zip(*assign_least_cost(np.minimum(apart, self.within_m)), strict=True):
            if apart[track, k] >= self.within_m:
                continue
            left.discard(int(track))
            self._record_pair(tracks, int(track), int(present[k]))
        for track in left:
            near = int(np.argmin(apart[track])) if len(present) else -1
            if near < 0 or apart[track, near] >= self.within_m:
                self.spurious += 1
                continue
            self.owned.add(int(tracks.number[track]))
            self._record_accuracy(tracks.error[present[near], :, track])
        self.before_s = tracks.time_s

    def _record_pair(self, tracks: ReportedTracks, track: int, target: int) -> None:
        self.tracked += 1
        if tracks.is_new[track]:
            error = tracks.error_as_reported[target, :, track]
            self.nees.append(float(error @ np.linalg.solve(tracks.covariance[track], error)))
            self.error.append(error)
            self.paired_s.append(tracks.time_s)
        self._record_accuracy(tracks.error[target, :, track])
        number = int(tracks.number[track])
        self.numbers.setdefault(target, []).append(number)
        # Between two instants it was confirmed when that was reported, not at the next instant.
        self.since.setdefault(target, max(float(tracks.confirmed_s[track]), self.before_s))
        self.owned.add(number)

    def _record_accuracy(self, error: FloatArray) -> None:
        self.accuracy.append((float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))))

    def results(
        self,
        names: list[str],
        detected_s: Mapping[str, float],
        covered_s: Mapping[str, float],
        duration_s: float,
    ) -> dict[str, float]:
        """Return scores by name, from targets' first detection and coverage times (by name, s)."""
        results = self._error_results()
        sets = np.array(self.sets).reshape(-1, len(_SETS))
        results |= {name: mean_or_nan(sets[:, i]) for i, name in enumerate(_SETS)}
        associated = len(self.accuracy)
        results["track_completeness"] = _ratio_or_nan(self.tracked, self.present)
        results["track_ambiguity"] = _ratio_or_nan(associated, self.tracked)
        results["track_spuriousness"] = _ratio_or_nan(self.spurious, self.tracks)
        accuracy = np.array(self.accuracy).reshape(-1, 2)
        results["track_positional_accuracy_m"] = mean_or_nan(accuracy[:, 0])
        results["track_velocity_accuracy_m_s"] = mean_or_nan(accuracy[:, 1])
        longest = sum(max(own.count(n) for n in set(own)) for own in self.numbers.values())
        results["track_longest_share"] = _ratio_or_nan(longest, sum(self.steps_present.values()))
        broken, swapped = count_breaks_and_swaps(self.numbers)
        results["track_broken"], results["track_swapped"] = broken, swapped
        results["track_number_changes_per_s"] = _ratio_or_nan(
            broken + swapped, self.tracked * self.step_s
        )
        since = {names[t]: value for t, value in self.since.items()}
        results["track_confirmation_s"] = _mean_delay_s(since, detected_s)
        results["track_confirmation_from_coverage_s"] = _mean_delay_s(since, covered_s)
        there = [name for name in covered_s if names.index(name) in self.steps_present]
        results["track_confirmed_share"] = _ratio_or_nan(sum(n in since for n in there), len(there))
        false = len(self.confirmed - self.owned)
        results["track_false_per_hour"] = _ratio_or_nan(3600.0 * false, duration_s)
        return results

    def mean_nees_at_last_instant(self, after_s: float, up_to_s: float) -> float:
        """Return the mean NEES at the last instant with one in (after_s, up_to_s]; else NaN."""
        time_s = np.array(self.paired_s)
        inside = (time_s > after_s) & (time_s <= up_to_s)
        if not inside.any():
            return float("nan")
        return float(np.mean(np.array(self.nees)[time_s == time_s[inside].max()]))

    def _error_results(self) -> dict[str, float]:
        low, high = chi_square_bounds(6)
        nees = np.array(self.nees)
        square = np.array(self.error).reshape(-1, 6) ** 2
        parts = {
            "track_position_error_m": square[:, :3].sum(axis=1),
            "track_horizontal_error_m": square[:, :2].sum(axis=1),
            "track_vertical_error_m": square[:, 2],
            "track_velocity_error_m_s": square[:, 3:].sum(axis=1),
        }
        for i, axis in enumerate(_AXES):
            parts[f"track_{axis}_error_m"] = square[:, i]
            parts[f"track_{axis}_error_m_s"] = square[:, 3 + i]
        result = {name: mean_or_nan(values) ** 0.5 for name, values in parts.items()}
        result["track_nees_mean"] = mean_or_nan(nees)
        result["track_nees_inside"] = mean_or_nan((nees >= low) & (nees <= high))
        return result


def innovation_results(nis: FloatArray, freedom: IntArray) -> dict[str, float]:
    """Return the NIS per degree of freedom and the share of NIS in the chi-square bounds."""
    inside = np.zeros(len(nis), dtype=bool)
    for many in np.unique(freedom).tolist():
        low, high = chi_square_bounds(many)
        mine = freedom == many
        inside[mine] = (nis[mine] >= low) & (nis[mine] <= high)
    return {
        "track_nis_per_freedom": _ratio_or_nan(float(nis.sum()), float(freedom.sum())),
        "track_nis_inside": mean_or_nan(inside),
    }


def count_breaks_and_swaps(numbers: Mapping[int, list[int]]) -> tuple[float, float]:
    """Return how often targets continue under a new number (broken) or another's (swapped)."""
    broken = swapped = 0
    for target, own in numbers.items():
        others = {n for other, theirs in numbers.items() if other != target for n in theirs}
        for before, after in pairwise(own):
            if before != after:
                swapped += after in others
                broken += after not in others
    return float(broken), float(swapped)


def _mean_delay_s(since: Mapping[str, float], begin_s: Mapping[str, float]) -> float:
    return mean_or_nan(np.array([since[name] - begin_s[name] for name in since if name in begin_s]))


def mean_or_nan(values: Any) -> float:
    """Return the mean of the values; NaN if there are none."""
    return float(np.mean(values)) if len(values) else float("nan")


def _ratio_or_nan(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")
