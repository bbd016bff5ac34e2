"""Sets of encounters as arrays: the flights of each of thousands, and its weight.

An aircraft is a row; rows of an encounter stand together, the ownship's first. A row holds either
an initial state and *events* (climb, turn and acceleration, held from an instant on), or a sampled
*track*. Lists of all rows lie end to end in flat arrays, cut by `starts`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from components.arguments.units import FOOT_M
from components.flights.point_mass import DYNAMICS
from components.well_clear.plane_pairs import PairPaths
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray

EVENTS, TRACKS = "events", "tracks"
STATE = ("north_m", "east_m", "altitude_m", "speed_mps", "heading_rad", "duration_s")
LISTS = {
    EVENTS: ("time_s", "climb_mps", "turn_rad_s", "acceleration_mps2"),
    TRACKS: ("time_s", "north_m", "east_m", "altitude_m"),
}
#: Sums of weights, and of their cubes, stay numbers.
LARGEST_WEIGHT = 1e90


class NoSuchEncounter(ValueError):
    """A set holds no encounter of that number."""


@dataclass(frozen=True, eq=False)
class EncounterSet:
    """Encounters; arrays over encounters (n), over aircraft (rows) and over list entries.

    `source` is the file, for messages; `kind` is "events" or "tracks"; numbers rise. The rows of
    encounter k are ``first_rows[k]`` up to ``first_rows[k + 1]``, the lists of a row begin at its
    `starts` (rows + 1,). `state` holds `STATE` of sets of events, `lists` the `LISTS` of the kind,
    `extra` (n,) geometry and classes as far as the file gives them. The origin is at
    `reference_deg` (latitude, longitude); altitudes are above the ellipsoid. `skipped` damaged
    encounters were left out; `notes` say what was done to a file's rows.
    """

    source: str
    kind: str
    numbers: IntArray
    weights: FloatArray
    first_rows: IntArray
    names: tuple[str, ...]
    state: dict[str, FloatArray]
    starts: IntArray
    lists: dict[str, FloatArray]
    reference_deg: tuple[float, float] = (0.0, 0.0)
    extra: dict[str, AnyArray] = field(default_factory=dict)
    skipped: int = 0
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.numbers)

    def index_of(self, number: int) -> int:
        """Return the index of the encounter with this number; `NoSuchEncounter` if none."""
        at = int(np.searchsorted(self.numbers, number))
        if at < len(self) and self.numbers[at] == number:
            return at
        close = self.numbers[np.abs(self.numbers - number).argmin()]
        raise NoSuchEncounter(
            f"{self.source}: there is no encounter {number}; it holds {len(self)}, numbered from "
            f"{self.numbers[0]} to {self.numbers[-1]}; the nearest is {close}"
        )

    def take(self, indices: IntArray) -> "EncounterSet":
        """Return a set of the encounters at the indices, each as often as its index occurs."""
        counts, lengths = np.diff(self.first_rows), np.diff(self.starts)
        rows = _concatenated_ranges(self.first_rows[indices], counts[indices])
        entries = _concatenated_ranges(self.starts[rows], lengths[rows])
        return replace(
            self,
            numbers=self.numbers[indices],
            weights=self.weights[indices],
            first_rows=np.concatenate([[0], np.cumsum(counts[indices])]),
            names=tuple(self.names[row] for row in rows.tolist()),
            state={name: values[rows] for name, values in self.state.items()},
            starts=np.concatenate([[0], np.cumsum(lengths[rows])]),
            lists={name: values[entries] for name, values in self.lists.items()},
            extra={name: values[indices] for name, values in self.extra.items()},
        )

    def drop(self, indices: Sequence[int]) -> "EncounterSet":
        """Return the set without the encounters at the indices; ``skipped`` counts them."""
        kept = self.take(np.delete(np.arange(len(self)), indices))
        return replace(kept, skipped=self.skipped + len(indices))

    def common_times_and_positions(
        self, index: int
    ) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
        """Yield by intruder shared times (n,), both positions (3, n): north, east, altitude (m)."""
        first, end = (int(self.first_rows[index + k]) for k in (0, 1))
        own = self.path(first)
        for row in range(first + 1, end):
            other = self.path(row)
            times = np.union1d(own[0], other[0])
            low, high = max(own[0][0], other[0][0]), min(own[0][-1], other[0][-1])
            times = times[(times >= low) & (times <= high)]
            paths = [
                [np.interp(times, path[0], path[k]) for k in (1, 2, 3)] for path in (own, other)
            ]
            yield times, np.array(paths[0]), np.array(paths[1])

    def path(
        self, row: int, dynamics: str = "euler"
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return time (s), north, east and altitude (m) along the path of one aircraft."""
        if self.kind == TRACKS:
            lists = self._list_values_of_row(row)
            return lists["time_s"], lists["north_m"], lists["east_m"], lists["altitude_m"]
        time_s, *position = fly_events([(self, row)], dynamics)
        return time_s, *(part[:, 0] for part in position)  # type: ignore[return-value]

    def flown_seconds_of_row(self, row: int) -> int:
        """Return how long an aircraft of a set of events flies, rounded up to whole seconds."""
        return int(np.ceil(self.state["duration_s"][row]))

    def _list_values_of_row(self, row: int) -> dict[str, FloatArray]:
        entries = slice(int(self.starts[row]), int(self.starts[row + 1]))
        return {name: values[entries] for name, values in self.lists.items()}


def fly_events(
    aircraft: Sequence[tuple[EncounterSet, int]], dynamics: str
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return times (s), north, east, altitude (m) of aircraft flown from initial states by events.

    All have as many `EncounterSet.seconds`; returns times (instants,) in s, and north, east and
    altitude (instants, aircraft) in m.
    """
    whole = np.arange(aircraft[0][0].flown_seconds_of_row(aircraft[0][1]) + 1.0)
    state = {name: np.empty(len(aircraft)) for name in STATE}
    commands = np.empty((3, len(whole), len(aircraft)))
    columns_of: dict[int, list[int]] = {}
    for column, (of, _) in enumerate(aircraft):
        columns_of.setdefault(id(of), []).append(column)
    for columns in columns_of.values():
        of, rows = aircraft[columns[0]][0], np.array([aircraft[column][1] for column in columns])
        for name, values in state.items():
            values[columns] = of.state[name][rows]
        at = of.starts[rows] + _count_begun_events(of, rows, len(whole)) - 1
        for k, name in enumerate(LISTS[EVENTS][1:]):
            commands[k][:, columns] = of.lists[name][at]
    climb, turn, acceleration = commands
    flown = DYNAMICS[dynamics](
        state["altitude_m"] / FOOT_M,
        state["speed_mps"] / FOOT_M,
        acceleration_ft_s2=acceleration / FOOT_M,
        climb_ft_s=climb / FOOT_M,
        turn_rad_s=turn,
        start_heading_rad=state["heading_rad"],
    )
    time_s: FloatArray = np.arange(float(len(flown.up_ft))) * flown.step_s
    return (
        time_s,
        state["north_m"] + flown.north_ft * FOOT_M,
        state["east_m"] + flown.east_ft * FOOT_M,
        flown.up_ft * FOOT_M,
    )


#: Pairs whose paths are flown together.
_PAIRS_AT_ONCE = 256


def pair_paths(
    encounters: Sequence[tuple[EncounterSet, int]], dynamics: str
) -> Iterator[tuple[IntArray, PairPaths]]:
    """Yield blocks of ownship and intruder paths, with each pair's encounter index in sequence.

    Encounters are a set and an index there; of an encounter the intruders are in order.
    """
    alike: dict[tuple[int, int], list[tuple[int, EncounterSet, int, int]]] = {}
    for number, (of, index) in enumerate(encounters):
        if of.kind == TRACKS:
            for time_s, own, other in of.common_times_and_positions(index):
                paths = PairPaths(time_s, own[:, :, np.newaxis], other[:, :, np.newaxis])
                yield np.array([number]), paths
            continue
        first, end = of.first_rows[index : index + 2].tolist()
        for row in range(first + 1, end):
            lasts = of.flown_seconds_of_row(first), of.flown_seconds_of_row(row)
            alike.setdefault(lasts, []).append((number, of, first, row))
    for pairs in alike.values():
        for start in range(0, len(pairs), _PAIRS_AT_ONCE):
            some = pairs[start : start + _PAIRS_AT_ONCE]
            one = fly_events([(of, row) for _, of, row, _ in some], dynamics)
            two = fly_events([(of, row) for _, of, _, row in some], dynamics)
            shorter = min(len(one[0]), len(two[0]))
            own_m, other_m = (np.array(each[1:])[:, :shorter] for each in (one, two))
            paths = PairPaths(one[0][:shorter], own_m, other_m)
            yield np.array([pair[0] for pair in some]), paths


def _count_begun_events(of: EncounterSet, rows: IntArray, seconds: int) -> IntArray:
    """Return how many events of each row have begun by each whole second, (seconds, rows)."""
    lengths = np.diff(of.starts)[rows]
    time_s = of.lists["time_s"][_concatenated_ranges(of.starts[rows], lengths)]
    first = np.clip(np.ceil(time_s), 0.0, float(seconds)).astype(np.int64)
    column = np.repeat(np.arange(len(rows)), lengths)
    marks = np.bincount(first * len(rows) + column, minlength=(seconds + 1) * len(rows))
    begun: IntArray = marks.reshape(-1, len(rows))[:seconds].cumsum(axis=0)
    return begun


def _concatenated_ranges(firsts: IntArray, lengths: IntArray) -> IntArray:
    """Return the integers first, first + 1, ... of every range, one range after the other."""
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if len(ends) else 0
    entries: IntArray = np.arange(total) + np.repeat(firsts - (ends - lengths), lengths)
    return entries


NAMES = ("ownship", "intruder")


#: What `geometry_class` gives.
GEOMETRIES = ("head-on", "overtaking", "crossing from the left", "crossing from the right")


def geometry_class(course_deg: FloatArray) -> AnyArray:
    """Return each intruder's encounter geometry name, by its course relative to the ownship's.

    Within 20° of opposite it is ``head-on``, within 70° of the same ``overtaking`` (either may be
    the one that overtakes), else ``crossing from the left`` (its course leads to the right) or
    ``crossing from the right``; the sectors are those of the rules of the air (14 CFR 91.113), the
    widths ours for head-on.
    """
    off = np.abs((course_deg + 180.0) % 360.0 - 180.0)
    side = np.where(course_deg % 360.0 < 180.0, "crossing from the left", "crossing from the right")
    geometry: AnyArray = np.where(
        off >= 160.0, "head-on", np.where(off <= 70.0, "overtaking", side)
    )
    return geometry


#: The column of a set that says of which encounter each is a copy.
FAMILY = "family"
