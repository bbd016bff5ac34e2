"""True flights of a group of replicas, as planned and as platforms were steered."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from components.flights.many_flights import SteeredFleet, SteeredFlight, fleet_of
from components.messages.steering import Manoeuvre
from components.metrics.losses import FlightsTogether, first_within_s
from components.metrics.rows import TargetMetric
from components.metrics.separation import (
    ANY_TWO,
    RelativeFlight,
    separations,
    traffic_block,
    traffic_of,
)
from components.metrics.true_states import Coverage
from dsa_des.arrays.keyed_table import occurrences_by_turn
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.scene.platforms import platform_by_block
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import Group, Metric

_COLUMNS = Manoeuvre._fields

# Scores → levels that a pilot may choose, falling to the event: from 128 s and 512 sizes.
_SCORES: dict[str, FloatArray] = {
    "time_to_go": np.append(2.0 ** (np.arange(56, -9, -1) / 8.0), 0.0),
    "separation": 2.0 ** (np.arange(72, -1, -1) / 8.0),
}


class ManoeuvresTold(NamedTuple):
    """Manoeuvres (n,), in order of coming: when each was told and came, s, who is steered (-1 for
    the ownship), and what it is, (n, fields of `Manoeuvre`).
    """

    told_s: FloatArray
    came_s: FloatArray
    steered: IntArray
    manoeuvre: FloatArray

    def take(self, which: slice | IntArray | BoolArray) -> "ManoeuvresTold":
        """Return some of them."""
        return ManoeuvresTold(
            self.told_s[which], self.came_s[which], self.steered[which], self.manoeuvre[which]
        )

    def of(self, platform: int) -> "ManoeuvresTold":
        """Return those that steer one aircraft."""
        return self.take(self.steered == platform)


_NOTHING = ManoeuvresTold(
    np.empty(0), np.empty(0), np.empty(0, dtype=np.int64), np.empty((0, len(_COLUMNS)))
)


def flown_as_steered(own: Sequence[Any], told: Sequence[ManoeuvresTold]) -> list[SteeredFlight]:
    """Return what aircraft fly, each steered by at least one manoeuvre."""
    flights = SteeredFleet(fleet_of(own))
    if not told:
        return []
    number = np.repeat(np.arange(len(told)), [len(one.came_s) for one in told])
    time_s, given = (np.concatenate(parts) for parts in list(zip(*told, strict=True))[1::2])
    for one in occurrences_by_turn(number):  # the first of each aircraft, then the next
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
        traffic = traffic_block(scene).name
        #: Who looks: a target by its index, -1 for the ownship.
        self.viewer = -1
        self._on: dict[str, int] = {}
        named = getattr(parameters, "platform", None)
        if named or any(block.options.platform for block in scene.blocks.values()):
            names = traffic_of(scene)[0].platforms()
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

    def flights_seen(self, group: Group, number: int) -> list[Any]:
        """Return the flight of the viewing platform in a replica, as steered, then of all it may
        see.
        """
        source = traffic_of(group.scenes[number])[0]
        own, *others = source.seen_from(source.platforms()[self.viewer + 1])
        told = self._received_manoeuvres(group).get(number, _NOTHING)
        places = [place for place in range(len(source.targets)) if place not in source.unseen]
        places = sorted({*places, self.viewer} - {-1})
        flights = [own, *others]
        of_each = [self.viewer, *(-1 if place == self.viewer else place for place in places)]
        for at, place in enumerate(of_each):
            there = _limit_to_presence(place, flights[at], told.of(place))
            if len(there.came_s):
                name = flights[at].name
                (flights[at],) = flown_as_steered([flights[at]], [there])
                flights[at].name = name
        return flights

    def select_on_platform(self, blocks: Sequence[str]) -> list[str]:
        """Return those of some blocks that are on the platform that looks."""
        return [block for block in blocks if self._on.get(block, -1) == self.viewer]

    def manoeuvres(self, group: Group) -> Mapping[int, ManoeuvresTold]:
        """Return the manoeuvres of who looks, of every replica of a group that has any."""
        own = {k: told.of(self.viewer) for k, told in self._received_manoeuvres(group).items()}
        return {k: told for k, told in own.items() if len(told.came_s)}

    def steered_runs(self, group: Group) -> IntArray:
        """Return the replicas in which any aircraft is steered."""
        return np.array(sorted(self._received_manoeuvres(group)), dtype=np.int64)

    def _received_manoeuvres(self, group: Group) -> Mapping[int, ManoeuvresTold]:
        """Return the manoeuvres of every replica that has any; see `ManoeuvresTold`.

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

    def read_flights(
        self,
        group: Group,
        read: "Read",
        *,
        steered: bool = True,
        to_the_end: bool = False,
        some: IntArray | None = None,
    ) -> FloatArray:
        """Return what `read` makes of the flights of `some` replicas, or all, (values, those)."""
        runs, run_of = self._flights(group, steered, to_the_end, some)
        return read(runs)[:, run_of]

    def cylinders_m(self) -> Mapping[str, tuple[float, float]]:
        """Return of each event that is a cylinder about the ownship its radius and half height."""
        return {}

    def scored_events(self) -> Sequence[str]:
        """Return those events, where the ownship is steered."""
        return list(self.cylinders_m()) if self.delays_s else []

    def reached_s(
        self, group: Group, event: str, score: str, levels: Sequence[float]
    ) -> FloatArray:
        """Return when runs first reach levels of a score of an event's cylinder.

        ``separation`` is the least distance of a target so far, in sizes of the cylinder.
        ``time_to_go`` is the least time so far that was left until the event if nothing more were
        told to the ownship, s. A manoeuvre is decided while aircraft are far apart and shows in
        their distance much later; the time to go parts runs by what is still open.
        """
        radius_m, half_m = self.cylinders_m()[event]
        if score == "separation":
            limits_m = [(level * radius_m, level * half_m) for level in levels]
            return self.read_flights(group, partial(first_within_s, limits_m), to_the_end=True)
        told = self._received_manoeuvres(group)
        result = np.full((len(levels), len(group)), np.inf)
        counts = np.zeros(len(group), dtype=np.int64)
        counts[list(told)] = [len(mine.came_s) for mine in told.values()]
        for count in range(1 + int(counts.max(initial=0))):
            # As if no more than so many manoeuvres were told: known from when the last of them is.
            some = np.flatnonzero(counts >= count)
            steering = {k: mine.take(slice(count)) for k, mine in told.items()}
            runs, run_of = flights_of(group, self.p.step_s, None, steering, viewer=self.viewer)
            used, mine = np.unique(run_of[some], return_inverse=True)
            event_s = first_within_s([(radius_m, half_m)], [runs[k] for k in used])[0, mine]
            known = [(0.0, *told.get(k, _NOTHING).told_s.tolist(), math.inf) for k in some.tolist()]
            from_s, until_s = np.array([times[count : count + 2] for times in known]).T
            for number, level in enumerate(levels):
                at_s = np.fmax(from_s, event_s - level)
                reached = (at_s < np.minimum(until_s, group.duration_s[some])) & ~np.isnan(event_s)
                better = np.where(reached, at_s, np.inf)
                result[number, some] = np.minimum(result[number, some], better)
        return np.where(np.isinf(result), np.nan, result)

    def read_each_flight(
        self, group: Group, read: "Read", *, to_the_end: bool = False
    ) -> tuple[list[str], FloatArray]:
        """Return names of targets, and what `read` makes of each by itself.

        Values are (values, replicas, targets), NaN where a replica has no such target.
        """
        runs, run_of = self._flights(group, True, to_the_end)
        alone = [[flight] for run in runs for flight in run]
        names = _names(runs)
        index = {name: number for number, name in enumerate(names)}
        values = read(alone or [[]])
        result = np.full((len(values), len(runs), len(names)), np.nan)
        run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
        result[:, run, [index[flight.name] for (flight,) in alone]] = values[:, : len(alone)]
        return names, result[:, run_of]

    def ranges_m(self, group: Group, time_s: FloatArray, *, to_the_end: bool) -> FloatArray:
        """Return the slant range of each target, at a time (replicas, targets) of its own, m.

        Targets are those of `read_each_flight`; NaN where there is no time, or one is not there.
        """
        runs, run_of = self._flights(group, True, to_the_end)
        names = _names(runs)
        known = [(k, flight) for k, run in enumerate(runs) for flight in run]
        number_of = {(k, flight.name): n for n, (k, flight) in enumerate(known)}
        result = np.full(time_s.shape, np.nan)
        replica, target = np.nonzero(np.isfinite(time_s))
        of = zip(run_of[replica].tolist(), target.tolist(), strict=True)
        flight = np.array([number_of[k, names[t]] for k, t in of], dtype=np.int64)
        if len(flight):
            together = FlightsTogether([flight for _, flight in known])
            range_m = together.apart_m(flight, time_s[replica, target])[0]
            result[replica, target] = np.where(np.isfinite(range_m), range_m, np.nan)
        return result

    def _flights(
        self, group: Group, steered: bool, to_the_end: bool, some: IntArray | None = None
    ) -> tuple[list[list[RelativeFlight]], IntArray]:
        steering = self._received_manoeuvres(group) if steered else {}
        target, step_s = getattr(self.p, "target", None), self.p.step_s
        return flights_of(
            group, step_s, target, steering, to_the_end=to_the_end, some=some, viewer=self.viewer
        )


#: What is read of runs, each a list of its flights: (values, runs).
Read = Callable[[Sequence[list[RelativeFlight]]], FloatArray]


def read_runs_singly(read: Callable[[list[RelativeFlight]], tuple[float, ...]]) -> Read:
    """Return what reads the flights of one run after the other."""
    return lambda runs: np.array([read(flights) for flights in runs]).T


def flights_of(
    group: Group,
    step_s: float | None,
    target: str | None,
    steering: Mapping[int, ManoeuvresTold] | None = None,
    *,
    to_the_end: bool = False,
    some: IntArray | None = None,
    viewer: int = -1,
) -> tuple[list[list[RelativeFlight]], IntArray]:
    """Return the flights of runs that differ, and which of these each of `some` replicas is.

    All are by default. Flights are computed once for all replicas that share them. Distances are
    taken every `step_s`; None looks between them for losses. A target of None is all of them. The
    aircraft of a replica fly as `steering` says, if anything. A run that ended early is looked at
    `to_the_end` of it, or as long as it was meant to last.
    """
    steering = steering or {}
    traffic = traffic_block(group.scene)
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
        make = partial(separations, scene, step_s, until_s, viewer)
        flights = group.cached(("separations", step_s, viewer, key), make)
        runs.append([flight for flight in flights if target in (None, flight.name)])
        if alone and runs[-1]:
            steered.append(number)
    told = [
        (number, place, flight, there)
        for number in steered
        for place, flight in _aircraft_of(runs[run_of[number]]).items()
        if len((there := _limit_to_presence(place, flight, steering[number].of(place))).came_s)
    ]
    flown = flown_as_steered([one[2] for one in told], [one[3] for one in told])
    by_run: dict[int, dict[int, SteeredFlight]] = {}
    for (number, place, *_), new in zip(told, flown, strict=True):
        by_run.setdefault(number, {})[place] = new
    for number, new_flights in by_run.items():
        runs[run_of[number]] = [
            flight.replace_flights(new_flights) for flight in runs[run_of[number]]
        ]
    return runs, run_of if some is None else run_of[some]


def _names(runs: Sequence[list[RelativeFlight]]) -> list[str]:
    """Return the names of all targets, in their order."""
    return sorted({flight.name for run in runs for flight in run})


def _aircraft_of(run: Sequence[RelativeFlight]) -> dict[int, Any]:
    """Return the flights of a run's aircraft, by their index."""
    return {
        place: flight
        for one in run
        for place, flight in zip(one.places, (one.own, one.target), strict=True)
    }


def _limit_to_presence(place: int, flight: Any, told: ManoeuvresTold) -> ManoeuvresTold:
    """Return what an aircraft is told while it is there; the ownship always is."""
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
        """Return those of some blocks that are on the platform."""
        return [*blocks] if self._flown is None else self._flown.select_on_platform(blocks)

    def flights(self, group: Group, number: int) -> list[Any]:
        """Return the flights of the platform in a replica, and of all that it may see."""
        if self._flown is None:
            flights: list[Any] = traffic_of(group.scenes[number])[0].seen_from()
            return flights
        return self._flown.flights_seen(group, number)

    def coverage(self, scene: Scene, flights: Sequence[Any]) -> Coverage:
        """Return what of these flights the platform's sensors cover."""
        return Coverage(scene, flights, self.blocks_on_board([*scene.blocks]))
