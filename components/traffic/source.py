"""The base class of traffic sources: states at the instants that sensors ask for."""

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from components.aircraft.aircraft import Aircraft, Roster, joint_roster
from components.aircraft.known_targets import KnownTraffic
from components.flights.attitude import Wind, scene_wind
from components.flights.bounds import (
    FlightAt,
    TrafficEnvelope,
    check_above_terrain,
    check_on_raster,
    traffic_envelope,
    true_reaches_m,
)
from components.flights.closest_approach import (
    STEP_S,
    Approaches,
    RegularTimes,
    SampleTimes,
    censored_approaches,
    closest_approaches,
    look_between,
    present_together_s,
)
from components.flights.culling import SteeredCulling, near_intervals
from components.flights.fleet import Fleet, Trajectory
from components.flights.many_flights import SteeredFleet, SteeredFlight, fleet_of
from components.geometry import TrajectoryState
from components.messages.known_flights import KnownFlights
from components.messages.reach import farthest_look
from components.messages.steering import Manoeuvres
from components.messages.targets import TrafficStates, TrueStates
from components.traffic.flown_flights import (
    Coming,
    FlightsOfRuns,
    FlownFlights,
    arrived_manoeuvres,
    due_manoeuvres,
    steered,
)
from components.traffic.wind_effect import ATTITUDE
from dsa_des.arrays.run_ticks import no_runs
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Context, Input, Output, Parameters, PositiveRational
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.time.clock import ClockSpec


class SourceParameters(Parameters):
    """Parameters of every traffic source."""

    update_rate_hz: PositiveRational | None = Field(
        default=None,
        description="Rate at which positions are published; sensors then see the last one. By "
        "default they are known at every scan instant.",
    )


#: The truth is recorded without being asked for where aircraft times seconds, of all runs that are
#: recorded together, are at most this: some ten thousand rows with the usual sensors.
SMALL_S = 600.0
_TABLE = "truth"


def truth_is_recorded(context: Context, targets: int) -> bool:
    """Return whether a scene records where all aircraft are.

    Where tables are chosen, as a study chooses those that its metrics read, that one is among them
    or it is not made.

    How often sensors look does not count: replicas whose clocks differ record the same tables.
    """
    record = context.sections.get("record")
    asked = "auto" if record is None else record.truth
    if context.recorded_tables is not None:
        return asked is not False and _TABLE in context.recorded_tables
    if asked == "auto":
        seconds = context.recorded_runs * float(context.duration_s)
        return (1 + targets) * seconds <= SMALL_S
    return bool(asked)


class TrafficSource(Component):
    """Publishes where the ownship and its targets are.

    When manoeuvres are wired to it, its ownship flies them from the time they come.

    Subclasses set `own`, `targets` and `roster` when they are made, and say at which times their
    data hold samples.
    """

    inputs = {
        "manoeuvres": Input(
            Manoeuvres,
            "queued",
            "Turns and climbs that the ownship has to fly.",
            required=False,
        )
    }
    outputs = {"states": Output(TrafficStates, "Positions and attitudes of all aircraft.")}
    Parameters: ClassVar[Any] = SourceParameters
    windowed = True
    rewindable = True
    clocked = "demand"
    hooks = (ATTITUDE,)

    own: Trajectory
    targets: Fleet
    roster: Roster
    also_records = (TrueStates,)
    _offered: KnownTraffic | None = None

    def serves_replicas(self) -> bool:
        """Return whether replicas share it: an ownship that is steered flies otherwise in each."""
        return super().serves_replicas() and not self.context.producers

    @property
    def wind(self) -> Wind | None:
        """The scene's wind, or None."""
        return scene_wind(self.context.sections.get("weather"))

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the publishing clock, if the scene gives one."""
        rate = parameters.update_rate_hz
        return None if rate is None else ClockSpec(rate, Fraction(0))

    def offer(self, port: str) -> KnownTraffic:
        """Say what the targets are, and where they can be; to all blocks the same.

        Who went by where targets can be must show as replicas compare it.
        """
        if self._offered is None:
            envelope = None if self.context.producers else self._envelope
            self._offered = KnownTraffic(self.roster, envelope)
        return self._offered

    def _envelope(self, reach_m: float, lasts_s: float) -> TrafficEnvelope:
        duration_s = float(self.context.duration_s) + lasts_s
        envelope = traffic_envelope(self.own, self.targets, duration_s, reach_m)
        weather = self.context.sections.get("weather")
        if weather is not None and weather.wind_mps > 0.0:
            # In wind a nose may point anywhere.
            return replace(envelope, pitch_rad=0.5 * math.pi, roll_rad=math.pi)
        return envelope

    def setup(self) -> None:
        """Learn how far sensors look; what stays beyond it is not moved."""
        self._check_terrain(self.own.at)
        self._look = farthest_look(c.request for c in self.context.consumers)
        #: Whether the truth is recorded.
        self.says_truth = truth_is_recorded(self.context, len(self.roster))
        flights = FlightsOfRuns(fleet_of([self.own]), self.targets, self.roster)
        self._fly(flights, [self.p.update_rate_hz])
        if self.context.producers:
            self.own = SteeredFlight(self.own, self._flown.own)

    def _fly(self, flights: FlightsOfRuns, rates_hz: Sequence[Any]) -> None:
        """Take the flights of all runs, of which this one is the first, and how they publish."""
        self.roster = flights.roster
        self._flown = FlownFlights(
            SteeredFleet(flights.own),
            flights.targets,
            self.built(ATTITUDE),
            rates_hz=None if None in rates_hz else np.array(rates_hz, dtype=np.float64),
        )
        #: Manoeuvres that have come, and are not flown by any row yet.
        self._pending: list[Coming] = []
        self._all_columns = np.arange(len(self.roster))
        #: The targets that were moved last, and their fleet.
        self._moved: tuple[IntArray, Fleet] = self._all_columns, self.targets
        self._epochs: SteeredCulling | None = None
        look, own, targets = self._look, flights.own, flights.targets
        culls = not self.context.simulate_everything and self.clock_of(self.p) is None
        if not culls or math.isinf(look.range_m):
            return
        end_s = float(self.context.duration_s) + look.lasts_s
        if not self.context.producers:
            self._reach_m = true_reaches_m(own, len(self.roster), end_s, look)
            if not np.isinf(self._reach_m).all():
                near = near_intervals(own, targets, self._reach_m, end_s)
                self._flown = replace(self._flown, intervals=near)
        elif look.lasts_s == 0.0 and not look.seeming:  # a steered ownship may come anywhere
            self._reach_m = np.array([look.range_m])
            self._epochs = SteeredCulling(own, targets, look.range_m, end_s)

    def _check_terrain(self, own_at: FlightAt) -> None:
        """Refuse terrain that an ownship does not fly above."""
        terrain, end_s = self.context.sections.get("terrain"), float(self.context.duration_s)
        if terrain is not None and terrain.height_m is not None:
            check_above_terrain(own_at, terrain.height_m, end_s)
        if terrain is not None and terrain.raster is not None:
            check_on_raster(own_at, terrain.raster.raster, terrain.raster_offset_m, end_s)

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Do what can be done at once for blocks with these parameters, which will be made."""

    def together(
        self, parameters: Sequence[Any], make: Callable[[int], Component]
    ) -> "TrafficSource | None":
        """Return what flies the flights of all runs."""
        # Where the line of sight was chosen by where the traffic is, each replica chooses.
        if self._offered is not None and self._offered.asked:
            return None
        self.prepare(parameters)
        flights = self.flights_of_runs(parameters, make)
        # What [accuracy] leaves out may rest on what the targets are.
        accuracy = self.context.sections.get("accuracy")
        allows = accuracy is not None and accuracy.model_dump(exclude_none=True)
        if flights is None or (allows and flights.roster is not self.roster):
            return None
        # A flight into the ground is said of its own replica, by itself.
        for number in range(len(parameters)):
            self._check_terrain(partial(_one_of, flights.own, number))
        of_all = copy(self)
        of_all._fly(flights, [p.update_rate_hz for p in parameters])
        return of_all

    def flights_of_runs(
        self, parameters: Sequence[Any], make: Callable[[int], Any]
    ) -> FlightsOfRuns | None:
        """Return the flights of runs with these parameters; None where their rosters do not fit."""
        own, targets = [], []
        aircraft: list[tuple[str, Aircraft]] = []
        for source in map(make, range(len(parameters))):
            own.append(source.own)
            targets += list(source.targets)
            aircraft += zip(source.roster.names, source.roster.aircraft, strict=True)
        roster = joint_roster(self.roster, aircraft)
        return None if roster is None else FlightsOfRuns(fleet_of(own), fleet_of(targets), roster)

    @property
    def width(self) -> int:
        """Most targets that are moved at one time."""
        intervals = self._flown.intervals
        return len(self.roster) if intervals is None else intervals.most_at_once()

    def left_out(self) -> list[str]:
        """Say how far targets matter."""
        if self._flown.intervals is None and self._epochs is None:
            return []
        reach_km = self._reach_m[0] / 1000.0
        return [f"targets beyond {reach_km:.2f} km: not moved, no sensor looks farther"]

    def run(self, wake: Wake) -> Message:
        """Return the state of all aircraft that may matter, at every instant."""
        # Flights that all runs share are those of one.
        run = wake.run if len(self._flown.own) > 1 else no_runs(len(wake))
        time_s = wake.time_s
        known = self._steer(wake, run)
        own, columns, near = self._near(run, time_s)
        states, culled = self._targets_at(run, columns, time_s), None
        present = states.present & own.present[:, np.newaxis]
        if near is not None:
            present &= near
            culled = len(self._all_columns) - near.sum(axis=1)
        asked = self._look.lasts_s > 0.0
        truth = replace(self._flown, intervals=None, rates_hz=None) if self.says_truth else None
        return TrafficStates.of(
            wake.ticks,
            own,
            states,
            present=present,
            roster=self.roster,
            columns=columns,
            culled=culled,
            flights=KnownFlights(self._flown, run, known) if asked else None,
            true_flights=None if truth is None else KnownFlights(truth, run, known),
            run_time_s=None if truth is None else time_s,
        )

    def _steer(self, wake: Wake, run: IntArray) -> IntArray:
        """Let ownships fly what has come; return how many manoeuvres of its own each row knows."""
        self._pending += arrived_manoeuvres(wake)
        if not self._pending:
            return self._flown.own.manoeuvre_count[run]
        due, self._pending = due_manoeuvres(wake, self._pending)
        own, known = steered(self._flown.own, due, wake, run)
        self._flown = replace(self._flown, own=own)
        if self._epochs is not None:
            for one in due:
                self._epochs.forget(one.run, one.tick / wake.ticks_per_s)
        assert isinstance(self.own, SteeredFlight)
        self.own = SteeredFlight(self.own.flight, own)
        return known

    def _near(
        self, run: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, IntArray, BoolArray | None]:
        """Return the ownship's state, which targets may come in reach, and when (rows, targets);
        None for always.
        """
        flown, lasts_s, columns = self._flown, self._look.lasts_s, self._all_columns
        if self._epochs is not None:
            own, near = self._epochs.near(flown.own, run, time_s)
            if len(flown.own) == 1:
                columns = np.flatnonzero(near.any(axis=0))
            return flown.own_at(run, time_s, state=own), columns, near[:, columns]
        own = flown.own_at(run, time_s)
        if flown.intervals is None:
            return own, columns, None
        if len(flown.own) == 1:
            columns = flown.intervals.during(float(time_s.min()), float(time_s.max()) + lasts_s)
            return own, columns, flown.intervals.near(columns, time_s, lasts_s)
        each = (run[:, np.newaxis] * flown.width + columns).reshape(-1)
        times = np.repeat(time_s, len(columns))
        near = flown.intervals.holds(each, times, times + lasts_s)
        return own, columns, near.reshape(len(time_s), len(columns))

    def _targets_at(self, run: IntArray, columns: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (rows, columns) of targets of each row's run."""
        flown, shape = self._flown, (len(time_s), len(columns))
        state: TrajectoryState | None = None
        if len(flown.own) == 1:
            if not np.array_equal(columns, self._moved[0]):
                self._moved = columns, flown.targets.subset(columns)
            state = self._moved[1].at(time_s)
            if not flown.crabbing:
                return state
            state = state.reshaped((-1,))
        each = (run[:, np.newaxis] * flown.width + columns).reshape(-1)
        return flown.targets_at(each, np.repeat(time_s, len(columns)), state).reshaped(shape)

    def own_at(self, time_s: FloatArray) -> TrajectoryState:
        """Return the ownship's state, as it is known now, at times (n,), in wind."""
        return self._flown.own_at(np.zeros(len(time_s), dtype=np.int64), time_s)

    def records(self) -> list[type[Message]]:
        """Return what is recorded: the truth where a scene is small, or asks for it."""
        return [TrafficStates, TrueStates] if self.says_truth else [TrafficStates]

    def sample_times(self) -> list[SampleTimes]:
        """Return the times at which the source itself knows ownship and targets.

        A target's times are those of all the items together.
        """
        raise TypeError(f"{type(self).__name__} does not say when its samples are")

    def report(self) -> dict[str, Any]:
        """Return the closest approach of every target over the run.

        ``at`` says where it is the first or the last instant that was looked at: the aircraft
        may have been nearer before, or come nearer after.
        """
        end_s = float(self.context.duration_s)
        names = self.roster.names
        best = self._closest_approaches(end_s)
        where = censored_approaches(self, self._compared_at(end_s), best.time_s, end_s)
        closest = zip(names, best.time_s.tolist(), best.range_m.tolist(), where, strict=True)
        approaches = {
            name: {"time_s": time_s, "range_m": range_m, **({"at": at} if at else {})}
            for name, time_s, range_m, at in closest
        }
        return {
            "targets": {
                name: {"closest_approach": one if math.isfinite(one["range_m"]) else None}
                for name, one in approaches.items()
            }
        }

    def _closest_approaches(self, end_s: float) -> Approaches:
        best = Approaches.none(len(self.targets))
        speeds = self.targets.max_speeds_mps
        present_s = present_together_s(self.own, self.targets.intervals_present_s, end_s)
        flights = (lambda _, time_s: self.own.at(time_s)), self.targets.each
        for times in self._compared_at(end_s):
            closest_approaches(
                *flights, times,
                closing_speed_mps=speeds + self.own.max_speed_mps, present_s=present_s, best=best,
            )  # fmt: skip
        if not self._seeks_at_samples:
            look_between(*flights, np.full(len(speeds), STEP_S), present_s, best)
        return best

    @property
    def _seeks_at_samples(self) -> bool:
        """Whether a scene says at which spacing closest approaches are sought."""
        return hasattr(self.p, "sample_interval_s")

    def _compared_at(self, end_s: float) -> list[SampleTimes]:
        """Return the times at which distances are compared; a file's may be minutes apart."""
        grid = [] if self._seeks_at_samples else [RegularTimes(STEP_S, end_s)]
        return [*self.sample_times(), *grid]


def _one_of(fleet: Fleet, aircraft: int, time_s: FloatArray) -> TrajectoryState:
    """Return the states of one flight of many at times (n,)."""
    return fleet.each(np.full(len(time_s), aircraft), time_s)
