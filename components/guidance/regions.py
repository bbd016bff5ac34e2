"""Which manoeuvres lead clear of the volumes of each region, around all intruders."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.guidance.intervals import DOUBLES_APART, TINY, Interval, clear_intervals
from components.guidance.manoeuvre_kinds import Conflicts, ManoeuvreKind
from components.guidance.situation import Detector, State
from components.well_clear.detection import Bounds, select_bounds
from components.well_clear.relative_motion import is_surely_less, nearly_equal
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

# Which intruder, and what it is kept out of: levels often share a volume.
_Key = tuple[int, Volume | TcasAdvisory, bool]


class GuidedIntruders(NamedTuple):
    """One intruder of each of n ownships."""

    state: State  # (n,): in the plane of its ownship
    alerter: Alerter  # Of all of them
    early_level: IntArray  # (n,) of int: the level whose early alerting time counts; 0 for none
    # (n,) of bool, optional: where there is such an intruder; by default everywhere
    present: BoolArray | None = None
    # (n,), optional: how far the relative states may be wrong, for levels that heed
    # it
    bounds: Bounds | None = None

    def rows(self, which: AnyArray) -> "GuidedIntruders":
        """Return the intruders of the given ownships."""
        present = None if self.present is None else self.present[which]
        return GuidedIntruders(
            self.state.rows(which),
            self.alerter,
            self.early_level[which],
            present,
            select_bounds(self.bounds, which),
        )

    def is_present(self) -> BoolArray:
        """Return a mask (n,), True for ownships that have this intruder."""
        if self.present is None:
            return np.ones(len(self.early_level), dtype=bool)
        return self.present


class Concerned(NamedTuple):
    """An intruder whose volume counts for a region, with a mask of the ownships concerned."""

    intruder: int  # Index of the intruder
    level: Level  # Whose volume
    of_whom: BoolArray  # (n,) of bool
    horizon_s: FloatArray  # (n, 1): how long after a manoeuvre


class Regions:
    """Regions of guidance around n ownships, by one kind of their manoeuvres."""

    def __init__(
        self,
        configuration: Configuration,
        kind: ManoeuvreKind,
        own: State,
        intruders: list[GuidedIntruders],
    ) -> None:
        self._configuration, self._kind, self._own = configuration, kind, own
        self._intruders = intruders
        self._lookahead_s = configuration["lookahead_time"]
        # Levels often share a volume; when it is met is worked out once.
        self._conflicts: dict[_Key, Conflicts] = {}
        self._begins: dict[_Key, FloatArray] = {}
        self._concerned: dict[str, tuple[BoolArray, list[Concerned]]] = {}

    def conflicts(self, place: int, level: Level) -> Conflicts:
        """Return the manoeuvres' conflicts with a level's volume at an intruder, computed once."""
        key = place, level.volume, level.uncertain
        if key not in self._conflicts:
            intruder = self._intruders[place]
            bounds = select_bounds(intruder.bounds, (slice(None), np.newaxis))
            detector = Detector(level.volume, bounds=bounds if level.uncertain else None)
            self._conflicts[key] = self._kind.find_conflicts(intruder.state.columns(), detector)
        return self._conflicts[key]

    def has_region_and_concerned(self, region: str) -> tuple[BoolArray, list[Concerned]]:
        """Return which ownships (n,) have a level's region, and intruders whose volumes count."""
        if region not in self._concerned:
            self._concerned[region] = self._find_concerned(region)
        return self._concerned[region]

    def has_region_and_safe_values(self, region: str) -> tuple[BoolArray, BoolArray]:
        """Return which ownships (n,) have a level's region, and which values (n, k) are safe."""
        known, concerned = self.has_region_and_concerned(region)
        clear = self._kind.there.copy()
        for one in concerned:
            unsafe = self.conflicts(one.intruder, one.level).is_in_or_behind_conflict(
                0.0, one.horizon_s
            )
            clear &= ~(unsafe & one.of_whom[:, np.newaxis])
        return known, clear

    def has_clear_interval(self, clear: BoolArray) -> BoolArray:
        """Return a mask (n,), True for ownships with two neighbouring clear values in limits."""
        return has_neighbouring_clear_values(self._kind, clear)

    def is_in_corrective(self) -> BoolArray:
        """Return a mask (n,), True for ownships now inside an intruder's corrective volume."""
        inside = np.zeros(len(self._own.up_m), dtype=bool)
        for index, intruder in enumerate(self._intruders):
            level = self._configuration.first_corrective_level(intruder.alerter)
            if level is not None:
                inside |= (self._conflict_start_s(index, level) == 0.0) & intruder.is_present()
        return inside

    def _conflict_start_s(self, place: int, level: Level) -> FloatArray:
        """Return when (s) the ownships, flying on as they are, enter a level's volume around an
        intruder, within the lookahead.
        """
        key = place, level.volume, level.uncertain
        if key not in self._begins:
            intruder = self._intruders[place]
            bounds = intruder.bounds if level.uncertain else None
            span = Detector(level.volume, bounds=bounds).span(
                self._own, intruder.state, 0.0, self._lookahead_s
            )
            self._begins[key] = span.begin_s
        return self._begins[key]

    def _find_concerned(self, region: str) -> tuple[BoolArray, list[Concerned]]:
        known = np.zeros(len(self._own.up_m), dtype=bool)
        result = []
        for index, intruder in enumerate(self._intruders):
            numbered = _level_of(intruder.alerter, region)
            if numbered is None:
                continue
            number, level = numbered
            there = intruder.is_present()
            known |= there
            begin_s = self._conflict_start_s(index, level)
            early = intruder.early_level == number
            due_s = np.where(early, level.early_alerting_time_s, level.alerting_time_s)
            ahead = (begin_s == 0.0) | is_surely_less(begin_s, due_s)
            soon_s = min(level.alerting_time_s, self._lookahead_s)
            horizon_s = np.where(ahead, self._lookahead_s, soon_s)[:, np.newaxis]
            met = (
                self.conflicts(index, level).has_conflict_within_horizon(0.0, horizon_s).any(axis=1)
            )
            of_whom = there & (ahead | met)
            if of_whom.any():
                result.append(Concerned(index, level, of_whom, horizon_s))
        return known, result


def has_neighbouring_clear_values(kind: ManoeuvreKind, clear: BoolArray) -> BoolArray:
    """Return a mask (n,), True for rows with neighbouring clear values not both beyond a limit."""
    both = clear[:, :-1] & clear[:, 1:]
    if not kind.cyclic:
        low = np.maximum(kind.values[:, :-1], kind.least[:, np.newaxis])
        high = np.minimum(kind.values[:, 1:], kind.most[:, np.newaxis])
        both &= (low < high) & ~nearly_equal(low, high, DOUBLES_APART, TINY)
    return np.asarray(both.any(axis=1))


def clear_intervals_of_row(kind: ManoeuvreKind, row: int, clear: BoolArray) -> list[Interval]:
    """Return the intervals of values of one ownship that are clear."""
    there = kind.there[row]
    values = kind.values[row][there]
    least, most = float(kind.least[row]), float(kind.most[row])
    return clear_intervals(values, clear[row][there], least, most, kind.cyclic)


def _level_of(alerter: Alerter, region: str) -> tuple[int, Level] | None:
    for number, level in enumerate(alerter.levels, start=1):
        if level.region == region:
            return number, level
    return None
