"""True flights of a group of replicas, as planned and as the ownship was steered."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from components.flights.many_flights import SteeredFleet, SteeredFlight, fleet_of
from components.messages.steering import Manoeuvre
from components.metrics.rows import TargetMetric
from components.metrics.separation import (
    RelativeFlight,
    separations,
    traffic_block,
)
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import Group

_COLUMNS = Manoeuvre._fields

#: Manoeuvres and when they came, s, in order.
Steering = Sequence[tuple[float, Manoeuvre]]


def flown_as_steered(own: Sequence[Any], steering: Sequence[Steering]) -> list[SteeredFlight]:
    """Return what ownships fly, each steered by at least one manoeuvre."""
    flights = SteeredFleet(fleet_of(own))
    for turn in range(max(map(len, steering), default=0)):
        now = [number for number, one in enumerate(steering) if len(one) > turn]
        times_s = np.array([steering[number][turn][0] for number in now])
        flights = flights.steered(
            np.array(now), times_s, [steering[number][turn][1] for number in now]
        )
    return list(flights)


class FlownMetric(TargetMetric):
    """A metric of true flights: as planned, or as recorded manoeuvres steered the ownship.

    Refused where manoeuvres reach the traffic block by wires of any but a fixed delay.
    """

    def __init__(self, parameters: Any, scene: Scene, *, steered: bool = True) -> None:
        super().__init__(parameters, scene)
        traffic = traffic_block(scene).name
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

    def manoeuvres(self, group: Group) -> Mapping[int, Steering]:
        """Return the manoeuvres of every replica of a group that has any."""
        result: dict[int, list[tuple[float, Manoeuvre]]] = {}
        if not self.delays_s:
            return result
        table: Any = group.tables["manoeuvres"]
        names = table["block"].names
        rows = zip(
            table["replica"].tolist(), table["block"].codes.tolist(), table["time_s"].tolist(),
            *(table[name].tolist() for name in _COLUMNS), strict=True,
        )  # fmt: skip
        for replica, block, time_s, *values in rows:
            if names[block] not in self.delays_s:
                continue
            came_s = time_s + self.delays_s[names[block]]
            if came_s < group.duration_s[replica]:
                result.setdefault(replica, []).append((came_s, Manoeuvre(*values)))
        return {replica: sorted(mine, key=lambda one: one[0]) for replica, mine in result.items()}

    def of_flights(
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

    def of_each_flight(
        self, group: Group, read: "Read", *, to_the_end: bool = False
    ) -> tuple[list[str], FloatArray]:
        """Return names of targets, and what `read` makes of each by itself.

        Values are (values, replicas, targets), NaN where a replica has no such target.
        """
        runs, run_of = self._flights(group, True, to_the_end)
        alone = [[flight] for run in runs for flight in run]
        names = sorted({flight.name for (flight,) in alone})
        index = {name: number for number, name in enumerate(names)}
        values = read(alone or [[]])
        result = np.full((len(values), len(runs), len(names)), np.nan)
        run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
        result[:, run, [index[flight.name] for (flight,) in alone]] = values[:, : len(alone)]
        return names, result[:, run_of]

    def _flights(
        self, group: Group, steered: bool, to_the_end: bool, some: IntArray | None = None
    ) -> tuple[list[list[RelativeFlight]], IntArray]:
        steering = self.manoeuvres(group) if steered else None
        target = getattr(self.p, "target", None)
        return flights_of(group, self.p.step_s, target, steering, to_the_end=to_the_end, some=some)


#: What is read of runs, each a list of its flights: (values, runs).
Read = Callable[[Sequence[list[RelativeFlight]]], FloatArray]


def each_alone(read: Callable[[list[RelativeFlight]], tuple[float, ...]]) -> Read:
    """Return what reads the flights of one run after the other."""
    return lambda runs: np.array([read(flights) for flights in runs]).T


def flights_of(
    group: Group,
    step_s: float | None,
    target: str | None,
    steering: Mapping[int, Steering] | None = None,
    *,
    to_the_end: bool = False,
    some: IntArray | None = None,
) -> tuple[list[list[RelativeFlight]], IntArray]:
    """Return the flights of runs that differ, and which of these each of `some` replicas is.

    All are by default. Flights are computed once for all replicas that share them. Distances are
    taken every `step_s`; None looks between them for losses. A target of None is all of them. The
    ownship of a replica flies as `steering` says, if anything. A run that ended early is looked at
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
        make = partial(separations, scene, step_s, until_s)
        flights = group.once(("separations", step_s, key), make)
        runs.append([flight for flight in flights if target in (None, flight.name)])
        if alone and runs[-1]:
            steered.append(number)
    flown = flown_as_steered(
        [runs[run_of[number]][0].own for number in steered],
        [steering[number] for number in steered],
    )
    for number, own in zip(steered, flown, strict=True):
        runs[run_of[number]] = [flight.flown_by(own) for flight in runs[run_of[number]]]
    return runs, run_of if some is None else run_of[some]
