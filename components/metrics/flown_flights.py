"""True flights of a group of replicas, as planned and as platforms were steered."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from components.flights.many_flights import SteeredFleet, SteeredFlight, fleet_of
from components.messages.steering import Manoeuvre
from components.metrics.losses import FlightsTogether, run_times_first_within_s
from components.metrics.rows import TargetMetric
from components.metrics.separation import (
    ANY_TWO,
    RelativeFlight,
    only_traffic_block,
    relative_flights,
    traffic_and_duration,
)
from components.metrics.true_states import Coverage
from dsa_des.arrays.keyed_table import indices_by_occurrence
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.scene.platforms import platform_by_block
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import Group, Metric

_COLUMNS = Manoeuvre._fields

# Scores → levels that a pilot may choose, falling to the event: from 128 s and 512 sizes. Where
# all correct themselves to the end, few of those within 1.09 sizes come within 1: steps are of 2 %.
_SCORES: dict[str, FloatArray] = {
    "time_to_go": np.append(2.0 ** (np.arange(56, -9, -1) / 8.0), 0.0),
    "separation": 2.0 ** (np.array([*range(288, 16, -4), *range(16, -1, -1)]) / 32.0),
}


class ManoeuvresTold(NamedTuple):
    """Manoeuvres by arrival: when sent, arrived (s), steered aircraft (-1: ownship), fields."""

    told_s: FloatArray
    came_s: FloatArray
    steered: IntArray
    manoeuvre: FloatArray

    def take(self, which: slice | IntArray | BoolArray) -> "ManoeuvresTold":
        """Return a selection of the manoeuvres."""
        return ManoeuvresTold(
            self.told_s[which], self.came_s[which], self.steered[which], self.manoeuvre[which]
        )

    def of(self, platform: int) -> "ManoeuvresTold":
        """Return the manoeuvres that steer one aircraft, by its index (-1: the ownship)."""
        return self.take(self.steered == platform)


_NOTHING = ManoeuvresTold(
    np.empty(0), np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, len(_COLUMNS)))
)


def steered_flights(own: Sequence[Any], told: Sequence[ManoeuvresTold]) -> list[SteeredFlight]:
    """Return the flights of aircraft as their manoeuvres steer them; each needs one or more."""
    flights = SteeredFleet(fleet_of(own))
    if not told:
        return []
    number = np.repeat(np.arange(len(told)), [len(one.came_s) for one in told])
    time_s, given = (np.concatenate(parts) for parts in list(zip(*told, strict=True))[1::2])
    for one in indices_by_occurrence(number):  # the first of each aircraft, then the next
        flights = flights.add_manoeuvres(number[one], time_s[one], given[one])
    return list(flights)


class FlownMetric(TargetMetric):
    """A metric of true flights: as planned, or as recorded manoeuvres steered the aircraft.

    Distances are those from the ownship, or from the platform that the parameters name. Refused
    where manoeuvres reach the traffic block by wires of any but a fixed delay.
    """

    scores = _SCORES
    #: Whether ``platform = "*"`` asks for the distances between any two.
    of_any_two = False

    def __init__(self, parameters: Any, scene: Scene, *, steered: bool = True) -> None:
        super().__init__(parameters, scene)
        traffic = only_traffic_block(scene).name
        #: Who looks: a target by its index, -1 for the ownship.
        self.viewer = -1
        self._on: dict[str, int] = {}
        named = getattr(parameters, "platform", None)
        if named or any(block.options.platform for block in scene.blocks.values()):
            names = traffic_and_duration(scene)[0].platforms()
            any_two = named == "*" and self.of_any_two
            if named is not None and named not in names and not any_two:
                raise ValueError(f"platform: there is no {named!r}{did_you_mean(named, names)}")
            carrying = platform_by_block(scene, {traffic: names})
            self._on = {block: names.index(on) - 1 for block, on in carrying.items()}
            if any_two:
                self.viewer = ANY_TWO
            elif named is not None:
                self.viewer = names.index(named) - 1
        #: Block that steers → delay of its manoeuvres; of none where flights are those planned.
        self.delays_s: dict[str, float] = {}
        for wire in scene.wires if steered else ():
            if (wire.target, wire.input) == (traffic, "manoeuvres"):
                if wire.jitter_s or wire.drop_probability or wire.queued or wire.delay_scans:
                    raise ValueError(
                        f"the wire from {wire.source!r} to {traffic!r} must have a fixed delay in "
                        "seconds, without jitter, loss or a processor: when manoeuvres begin is "
                        "not recorded"
                    )
                self.delays_s[wire.source] = float(wire.total_delay_s)
        if self.delays_s:
            self.tables = {**self.tables, "manoeuvres": ("block", "time_s", *_COLUMNS)}

    def viewer_and_seen_flights(self, group: Group, number: int) -> list[Any]:
        """Return a replica's viewing platform's flight, as steered, then all it may see."""
        source = traffic_and_duration(group.scenes[number])[0]
        own, *others = source.seen_from(source.platforms()[self.viewer + 1])
        told = self._received_manoeuvres_by_replica(group).get(number, _NOTHING)
        places = [place for place in range(len(source.targets)) if place not in source.unseen]
        places = sorted({*places, self.viewer} - {-1})
        flights = [own, *others]
        of_each = [self.viewer, *(-1 if place == self.viewer else place for place in places)]
        for at, place in enumerate(of_each):
            there = _manoeuvres_while_present(place, flights[at], told.of(place))
            if len(there.came_s):
                name = flights[at].name
                (flights[at],) = steered_flights([flights[at]], [there])
                flights[at].name = name
        return flights

    def select_on_platform(self, blocks: Sequence[str]) -> list[str]:
        """Return those of the given blocks that are on the viewing platform."""
        return [block for block in blocks if self._on.get(block, -1) == self.viewer]

    def viewer_manoeuvres_by_replica(self, group: Group) -> Mapping[int, ManoeuvresTold]:
        """Return the viewing platform's manoeuvres by replica index, for replicas with any."""
        own = {
            k: told.of(self.viewer)
            for k, told in self._received_manoeuvres_by_replica(group).items()
        }
        return {k: told for k, told in own.items() if len(told.came_s)}

    def steered_replica_indices(self, group: Group) -> IntArray:
        """Return the indices of the replicas in which any aircraft is steered."""
        return np.array(sorted(self._received_manoeuvres_by_replica(group)), dtype=np.int64)

    def _received_manoeuvres_by_replica(self, group: Group) -> Mapping[int, ManoeuvresTold]:
        """Return the manoeuvres that arrived, by replica index, for replicas with any.

        What is told is known when all before it is.
        """
        if not self.delays_s:
            return {}
        table: Any = group.tables["manoeuvres"]
        names, codes = table["block"].names, table["block"].codes
        delay_s = np.array([self.delays_s.get(name, np.inf) for name in names] or [np.inf])
        steered = np.array([self._on.get(name, -1) for name in names] or [-1])
        nothing = np.full(len(codes), np.nan)
        told_s, replica = np.asarray(table["time_s"], dtype=np.float64), table["replica"]
        given = np.array([table.get(name, nothing) for name in _COLUMNS], dtype=np.float64).T
        came_s = told_s + delay_s[codes]
        every = ManoeuvresTold(told_s, came_s, steered[codes], given)
        rows = np.flatnonzero(came_s < np.asarray(group.duration_s)[replica])
        rows = rows[np.lexsort((came_s[rows], replica[rows]))]
        result, every = {}, every.take(rows)
        numbers, first = np.unique(replica[rows], return_index=True)
        ends = np.searchsorted(replica[rows], numbers, side="right").tolist()
        for number, begin, end in zip(numbers.tolist(), first.tolist(), ends, strict=True):
            told = every.take(slice(begin, end))
            result[number] = told._replace(told_s=np.maximum.accumulate(told.told_s))
        return result

    def evaluate_flights(
        self,
        group: Group,
        read: "Read",
        *,
        steered: bool = True,
        to_the_end: bool = False,
        some: IntArray | None = None,
    ) -> FloatArray:
        """Return ``read`` of the flights of `some` replicas, by default all, (values, replicas)."""
        runs, run_of = self._flights(group, steered, to_the_end, some)
        return read(runs)[:, run_of]

    def cylinders_m(self) -> Mapping[str, tuple[float, float]]:
        """Return (radius, half height), m, of each event that is an ownship cylinder, by name."""
        return {}

    def scored_events(self) -> Sequence[str]:
        """Return the names of the events with a cylinder; none if no block steers the ownship."""
        return list(self.cylinders_m()) if self.delays_s else []

    def reached_s(
        self, group: Group, event: str, score: str, levels: Sequence[float]
    ) -> FloatArray:
        """Return when replicas first reach a score's levels, (levels, replicas), s, or NaN.

        ``separation`` is the least distance of a target so far, in sizes of the cylinder.
        ``time_to_go`` is the least time so far that was left until the event if nothing more were
        told to the ownship, s. A manoeuvre is decided while aircraft are far apart and shows in
        their distance much later; the time to go parts runs by what is still open.
        """
        radius_m, half_m = self.cylinders_m()[event]
        if score == "separation":
            limits_m = [(level * radius_m, level * half_m) for level in levels]
            return self.evaluate_flights(
                group, partial(run_times_first_within_s, limits_m), to_the_end=True
            )
        told = self._received_manoeuvres_by_replica(group)
        result = np.full((len(levels), len(group)), np.inf)
        counts = np.zeros(len(group), dtype=np.int64)
        counts[list(told)] = [len(mine.came_s) for mine in told.values()]
        for count in range(1 + int(counts.max(initial=0))):
            # As if no more than so many manoeuvres were told: known from when the last of them is.
            some = np.flatnonzero(counts >= count)
            steering = {k: mine.take(slice(count)) for k, mine in told.items()}
            runs, run_of = distinct_runs_and_indices(
                group, self.p.step_s, None, steering, viewer=self.viewer
            )
            used, mine = np.unique(run_of[some], return_inverse=True)
            event_s = run_times_first_within_s([(radius_m, half_m)], [runs[k] for k in used])[
                0, mine
            ]
            known = [(0.0, *told.get(k, _NOTHING).told_s.tolist(), math.inf) for k in some.tolist()]
            from_s, until_s = np.array([times[count : count + 2] for times in known]).T
            for number, level in enumerate(levels):
                at_s = np.fmax(from_s, event_s - level)
                reached = (at_s < np.minimum(until_s, group.duration_s[some])) & ~np.isnan(event_s)
                better = np.where(reached, at_s, np.inf)
                result[number, some] = np.minimum(result[number, some], better)
        return np.where(np.isinf(result), np.nan, result)

    def evaluate_each_flight(
        self, group: Group, read: "Read", *, to_the_end: bool = False
    ) -> tuple[list[str], FloatArray]:
        """Return target names, and ``read`` of each flight singly, (values, replicas, targets).

        Values are (values, replicas, targets), NaN where a replica has no such target.
        """
        runs, run_of = self._flights(group, True, to_the_end)
        alone = [[flight] for run in runs for flight in run]
        names = _sorted_target_names(runs)
        index = {name: number for number, name in enumerate(names)}
        values = read(alone or [[]])
        result = np.full((len(values), len(runs), len(names)), np.nan)
        run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
        result[:, run, [index[flight.name] for (flight,) in alone]] = values[:, : len(alone)]
        return names, result[:, run_of]

    def slant_ranges_at_times_m(
        self, group: Group, time_s: FloatArray, *, to_the_end: bool
    ) -> FloatArray:
        """Return slant ranges to targets at a time for each, (replicas, targets), m.

        Targets are those of `evaluate_each_flight`; NaN where there is no time, or one is not
        there.
        """
        runs, run_of = self._flights(group, True, to_the_end)
        names = _sorted_target_names(runs)
        known = [(k, flight) for k, run in enumerate(runs) for flight in run]
        number_of = {(k, flight.name): n for n, (k, flight) in enumerate(known)}
        result = np.full(time_s.shape, np.nan)
        replica, target = np.nonzero(np.isfinite(time_s))
        of = zip(run_of[replica].tolist(), target.tolist(), strict=True)
        flight = np.array([number_of[k, names[t]] for k, t in of], dtype=np.int64)
        if len(flight):
            together = FlightsTogether([flight for _, flight in known])
            range_m = together.range_horizontal_vertical_at_m(flight, time_s[replica, target])[0]
            result[replica, target] = np.where(np.isfinite(range_m), range_m, np.nan)
        return result

    def _flights(
        self, group: Group, steered: bool, to_the_end: bool, some: IntArray | None = None
    ) -> tuple[list[list[RelativeFlight]], IntArray]:
        steering = self._received_manoeuvres_by_replica(group) if steered else {}
        target, step_s = getattr(self.p, "target", None), self.p.step_s
        return distinct_runs_and_indices(
            group, step_s, target, steering, to_the_end=to_the_end, some=some, viewer=self.viewer
        )


#: What is read of runs, each a list of its flights: (values, runs).
Read = Callable[[Sequence[list[RelativeFlight]]], FloatArray]


def make_run_by_run_reader(read: Callable[[list[RelativeFlight]], tuple[float, ...]]) -> Read:
    """Return a function that applies `read` run by run and stacks its values, (values, runs)."""
    return lambda runs: np.array([read(flights) for flights in runs]).T


def distinct_runs_and_indices(
    group: Group,
    step_s: float | None,
    target: str | None,
    steering: Mapping[int, ManoeuvresTold] | None = None,
    *,
    to_the_end: bool = False,
    some: IntArray | None = None,
    viewer: int = -1,
) -> tuple[list[list[RelativeFlight]], IntArray]:
    """Return all distinct runs' flights, and the run index for each of `some` replicas.

    All are by default. Flights are computed once for all replicas that share them. Distances are
    taken every `step_s`; None looks between them for losses. A target of None is all of them. The
    aircraft of a replica fly as `steering` says, if anything. A run that ended early is looked at
    `to_the_end` of it, or as long as it was meant to last.
    """
    steering = steering or {}
    traffic = only_traffic_block(group.scene)
    block = f"blocks.{traffic.name}."
    if any(key.startswith(block) for replica in group.replicas for key in replica.changes):
        cls: Any = traffic.cls
        cls.prepare(group.parameters_of(traffic.name))
    runs: list[list[RelativeFlight]] = []
    known: dict[Any, int] = {}
    numbers = range(len(group)) if some is None else some.tolist()
    run_of, steered = np.empty(len(group), dtype=np.int64), []
    for number in numbers:
        replica = group.replicas[number]
        mine = {k: v for k, v in replica.changes.items() if k.startswith((block, "duration_s"))}
        until_s = math.inf
        if to_the_end and group.ended_early[number]:
            until_s = float(group.duration_s[number])
        key = (until_s, *sorted((k, repr(v)) for k, v in mine.items()))
        alone = number in steering
        run_of[number] = known.setdefault((key, number if alone else None), len(runs))
        if run_of[number] < len(runs):
            continue
        scene = group.scenes[number] if mine else group.scene
        make = partial(relative_flights, scene, step_s, until_s, viewer)
        flights = group.cached(("separations", step_s, viewer, key), make)
        runs.append([flight for flight in flights if target in (None, flight.name)])
        if alone and runs[-1]:
            steered.append(number)
    told = [
        (number, place, flight, there)
        for number in steered
        for place, flight in _flights_by_index(runs[run_of[number]]).items()
        if len(
            (there := _manoeuvres_while_present(place, flight, steering[number].of(place))).came_s
        )
    ]
    flown = steered_flights([one[2] for one in told], [one[3] for one in told])
    by_run: dict[int, dict[int, SteeredFlight]] = {}
    for (number, place, *_), new in zip(told, flown, strict=True):
        by_run.setdefault(number, {})[place] = new
    for number, new_flights in by_run.items():
        runs[run_of[number]] = [
            flight.replace_flights(new_flights) for flight in runs[run_of[number]]
        ]
    return runs, run_of if some is None else run_of[some]


def _sorted_target_names(runs: Sequence[list[RelativeFlight]]) -> list[str]:
    """Return the sorted names of all targets in the runs."""
    return sorted({flight.name for run in runs for flight in run})


def _flights_by_index(run: Sequence[RelativeFlight]) -> dict[int, Any]:
    """Return the flights of all aircraft of a run, by aircraft index (-1: the ownship)."""
    return {
        place: flight
        for one in run
        for place, flight in zip(one.places, (one.own, one.target), strict=True)
    }


def _manoeuvres_while_present(place: int, flight: Any, told: ManoeuvresTold) -> ManoeuvresTold:
    """Return the manoeuvres that arrive while an aircraft is present; all for the ownship."""
    if place < 0:
        return told
    first_s, last_s = flight.interval_present()
    return told.take((first_s <= told.came_s) & (told.came_s <= last_s))


class PlatformTracks(Metric):
    """A metric of the tracks on the ownship, or on the platform that the parameters name.

    Flights are those planned; as steered where blocks are on several platforms.
    """

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        several = any(block.options.platform for block in scene.blocks.values())
        named = parameters.platform is not None
        self._flown = FlownMetric(parameters, scene) if several or named else None
        if self._flown is not None:
            self.tables = {**self._flown.tables, **self.tables}

    def blocks_on_board(self, blocks: Sequence[str]) -> list[str]:
        """Return those of the given blocks that are on the platform."""
        return [*blocks] if self._flown is None else self._flown.select_on_platform(blocks)

    def flights(self, group: Group, number: int) -> list[Any]:
        """Return the platform's flight in one replica, then those of all aircraft it may see."""
        if self._flown is None:
            flights: list[Any] = traffic_and_duration(group.scenes[number])[0].seen_from()
            return flights
        return self._flown.viewer_and_seen_flights(group, number)

    def coverage(self, scene: Scene, flights: Sequence[Any]) -> Coverage:
        """Return the coverage by the platform's sensors of the given flights."""
        return Coverage(scene, flights, self.blocks_on_board([*scene.blocks]))
