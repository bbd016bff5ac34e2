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

from components.aircraft.aircraft import Aircraft, Roster, merge_replica_rosters
from components.aircraft.known_targets import KnownTraffic
from components.atmosphere.pressure_altitude import Air, scene_air
from components.flights.attitude import Wind, scene_wind
from components.flights.bounds import (
    FlightAt,
    TrafficEnvelope,
    check_above_terrain,
    check_over_raster_above_ground,
    traffic_envelope,
)
from components.flights.closest_approach import (
    STEP_S,
    RegularTimes,
    SampleTimes,
    approaches_of_run,
    describe_censoring_ends,
)
from components.flights.fleet import Fleet, Trajectory
from components.flights.many_flights import SteeredFlight, fleet_of
from components.geometry import TrajectoryState
from components.messages.known_flights import KnownFlights
from components.messages.reach import combined_farthest_look
from components.messages.steering import Manoeuvres
from components.messages.targets import TrafficStates, TrueStates
from components.traffic.flown_flights import FlightsOfRuns, FlownFlights, WithOthers
from components.traffic.recorded_truth import is_truth_recorded
from components.traffic.steering import (
    Coming,
    add_due_manoeuvres,
    arrived_manoeuvres,
    platform_index_by_steerer,
    split_due_manoeuvres,
)
from components.traffic.views import Seen, views_of_platforms
from components.traffic.wind_effect import ATTITUDE
from dsa_des.arrays.run_ticks import shared_zero_run_numbers
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters, PositiveRational
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.time.clock import NANOSECONDS, ClockSpec


class SourceParameters(Parameters):
    """Parameters of every traffic source."""

    update_rate_hz: PositiveRational | None = Field(
        default=None,
        description="Rate at which positions are published; sensors then see the last one. By "
        "default they are known at every scan instant.",
    )


class TrafficSource(Component):
    """Publishes the states of all aircraft; base class of all traffic blocks.

    Manoeuvres that are wired to it steer what carries the block that sends them, from the time they
    come. The ownship is the first of the platforms; what looks from another one sees that one in
    the ownship's place and the ownship in its place.

    Subclasses set `own`, `targets` and `roster` when they are made, and say at which times their
    data hold samples.
    """

    inputs = {
        "manoeuvres": Input(
            Manoeuvres,
            "queued",
            "Turns and climbs that what carries their sender has to fly.",
            required=False,
            many=True,
        )
    }
    outputs = {"states": Output(TrafficStates, "Positions and attitudes of all aircraft.")}
    Parameters: ClassVar[Any] = SourceParameters
    windowed = True
    rewindable = True
    clocked = "demand"
    heeds_changes = True
    hooks = (ATTITUDE,)

    own: Trajectory
    targets: Fleet
    roster: Roster
    #: Targets that nobody sees: places on the ground.
    unseen: tuple[int, ...] = ()
    also_records = (TrueStates,)
    _offered: KnownTraffic | None = None

    def serves_replicas(self) -> bool:
        """Return whether all replicas can share this block: so unless a block steers aircraft."""
        return super().serves_replicas() and not self.context.producers

    @property
    def wind(self) -> Wind | None:
        """The scene's wind, or None."""
        return scene_wind(self.context.sections.get("weather"))

    @property
    def air(self) -> Air | None:
        """The scene's atmosphere, or None for the standard one."""
        return scene_air(self.context.sections)

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the publishing clock, if the scene gives one."""
        rate = parameters.update_rate_hz
        return None if rate is None else ClockSpec(rate, Fraction(0))

    def platforms(self) -> Sequence[str]:
        """Return the names of all aircraft, the ownship's first."""
        return self.roster.own_name, *self.roster.names

    def seen_from(self, platform: str = "") -> list[Any]:
        """Return the flight of a platform (by default the ownship), followed by the flights of all
        aircraft that it may see, with manoeuvres so far.
        """
        viewer = self._target_index(platform)
        others = {
            place: flight
            for place, flight in enumerate(self.targets)
            if place != viewer and place not in self.unseen
        }
        if viewer < 0:
            return [self.own, *others.values()]
        own = copy(self.own)
        own.name = self.roster.own_name
        return [self.targets[viewer], *(of for _, of in sorted({**others, viewer: own}.items()))]

    def offer(self, port: str) -> KnownTraffic:
        """Return the target roster and a bound of positions, the same object for all consumers.

        Who went by where targets can be must show as replicas compare it.
        """
        if self._offered is None:
            envelope = None if self.context.producers else self._envelope
            self._offered = KnownTraffic(self.roster, envelope)
        return self._offered

    def _envelope(self, reach_m: float, lasts_s: float, viewer: int) -> TrafficEnvelope:
        duration_s = float(self.context.duration_s) + lasts_s
        flights = self._flights_of_this_run([viewer]).viewer_and_target_fleets(viewer)
        envelope = traffic_envelope(flights[0][0], flights[1], duration_s, reach_m)
        weather = self.context.sections.get("weather")
        if weather is not None and weather.wind_mps > 0.0:
            # In wind a nose may point anywhere.
            return replace(envelope, pitch_rad=0.5 * math.pi, roll_rad=math.pi)
        return envelope

    def apply_change(self, from_s: Fraction, other: Any) -> None:
        """Use another instance's roster properties from an instant on; flights stay as they are."""
        later = (*self.roster.later, (round(from_s * NANOSECONDS), other.roster))
        self.roster = replace(self.roster, later=later)

    def setup(self) -> None:
        """Learn who looks and is steered, and how far sensors look; what is beyond is not moved."""
        self._check_terrain(self.own.at)
        #: Which platform each block steers.
        self._steers = platform_index_by_steerer(
            self.context.producers, self._target_index, self.unseen
        )
        asked: dict[int, list[Any]] = {-1: []}
        for consumer in self.context.consumers:
            asked.setdefault(self._target_index(consumer.platform), []).append(consumer.request)
        self._looks = {
            viewer: combined_farthest_look(requests) for viewer, requests in asked.items()
        }
        #: Whether the truth is recorded.
        self.says_truth = is_truth_recorded(self.context, len(self.roster))
        self._set_flights_of_runs(
            self._flights_of_this_run([*asked, *self._steers.values()]), self.roster, [self.p]
        )
        if self.context.producers:
            self.own = SteeredFlight(self.own, self._flown.fleet)

    def _target_index(self, platform: str) -> int:
        """Return the index of a platform among the targets; -1 for the ownship."""
        names = self.roster.names
        if platform in ("", self.roster.own_name):
            return -1
        if self.roster.own_name in names:
            raise ValueError(
                f"a target has the ownship's name, {self.roster.own_name!r}: what is on "
                f"{platform!r} could not tell them apart; give one another name"
            )
        return names.index(platform)

    def _flights_of_this_run(self, platforms: Sequence[int]) -> FlownFlights:
        """Return this run's flights of given platforms (indices of targets, -1 for the ownship)."""
        return FlownFlights.of(fleet_of([self.own]), self.targets, platforms)

    def _set_flights_of_runs(
        self, flights: FlownFlights, roster: Roster, parameters: Sequence[Any]
    ) -> None:
        """Set all served runs' flights and roster; reset views and pending manoeuvres."""
        self.roster = roster
        rates = [p.update_rate_hz for p in parameters]
        rates_hz = None if None in rates else np.array(rates, dtype=np.float64)
        #: Manoeuvres that have come, and are not flown by any row yet.
        self._pending = Coming.empty_table()
        #: The targets that were moved last, and their fleet.
        self._moved: tuple[IntArray, Fleet] = np.arange(len(roster)), flights.targets
        culls = not self.context.simulate_everything and self.clock_of(self.p) is None
        steer = sorted(self._steers.values()) if self.context.producers else None
        duration_s = float(self.context.duration_s)
        #: What each platform may look at, the ownship's first.
        self._views = views_of_platforms(flights, self._looks, culls, duration_s, steer)
        self._flown = replace(
            flights,
            crabbing=self.built(ATTITUDE),
            rates_hz=rates_hz,
            unseen=self.unseen,
            intervals={v.viewer: v.intervals for v in self._views if v.intervals is not None},
        )

    def _check_terrain(self, own_at: FlightAt) -> None:
        """Raise an error if the ownship flies below the terrain or over unknown heights."""
        terrain, end_s = self.context.sections.get("terrain"), float(self.context.duration_s)
        if terrain is not None and terrain.height_m is not None:
            check_above_terrain(own_at, terrain.height_m, end_s)
        if terrain is not None and terrain.raster is not None:
            check_over_raster_above_ground(
                own_at, terrain.raster.raster, terrain.raster_zero_m, end_s
            )

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Do work in advance, once for all blocks made with these parameters; here none."""

    def make_for_all_runs(
        self, parameters: Sequence[Any], make: Callable[[int], Component]
    ) -> "TrafficSource | None":
        """Return one block that flies all runs' flights; None if each run needs its own block."""
        # Where the line of sight was chosen by where the traffic is, each replica chooses.
        if self._offered is not None and self._offered.is_envelope_used:
            return None
        self.prepare(parameters)
        flights = self.flights_of_runs(parameters, make)
        # What [accuracy] leaves out may rest on what the targets are.
        accuracy = self.context.sections.get("accuracy")
        allows = accuracy is not None and accuracy.model_dump(exclude_none=True)
        fixed = allows or self.roster.later
        if flights is None or (fixed and flights.roster is not self.roster):
            return None
        # A flight into the ground is said of its own replica, by itself.
        for number in range(len(parameters)):
            self._check_terrain(partial(_states_of_one, flights.own, number))
        of_all = copy(self)
        flown = FlownFlights.of(flights.own, flights.targets, self._flown.platforms)
        of_all._set_flights_of_runs(flown, flights.roster, parameters)
        return of_all

    def flights_of_runs(
        self, parameters: Sequence[Any], make: Callable[[int], Any]
    ) -> FlightsOfRuns | None:
        """Return the flights of the runs with these parameters, or None if their rosters differ."""
        own, targets = [], []
        aircraft: list[tuple[str, Aircraft]] = []
        looking: list[tuple[str, Aircraft]] = []
        for source in map(make, range(len(parameters))):
            own.append(source.own)
            targets += list(source.targets)
            aircraft += zip(source.roster.names, source.roster.aircraft, strict=True)
            looking.append((source.roster.own_name, source.roster.own_aircraft[0]))
        roster = merge_replica_rosters(self.roster, aircraft, looking)
        return None if roster is None else FlightsOfRuns(fleet_of(own), fleet_of(targets), roster)

    @property
    def width(self) -> int:
        """Largest number of targets that are moved at one time."""
        most = sum(view.max_near_targets_at_once for view in self._views) + len(self._views) - 1
        return min(most, len(self.roster))

    def skipped_work_notes(self) -> list[str]:
        """Return a sentence per platform that omits far targets, with the range of omission."""
        return [
            view.culling_note(self.roster.names)
            for view in self._views
            if view.is_leaving_out_far_targets
        ]

    def run(self, wake: Wake) -> Message | None:
        """Return the state of all aircraft that may matter, at every instant."""
        # Flights that all runs share are those of one.
        run = wake.run if self._flown.runs > 1 else shared_zero_run_numbers(len(wake))
        time_s = wake.time_s
        known = self._apply_manoeuvres(wake, run)
        flown = self._flown
        seen = Seen(self._views, flown, run, time_s)
        states = self._target_states_at(run, seen.columns, time_s)
        present, culled = seen.visible_to_ownship(states.present)
        others = seen.visible_to_other_platforms(states.present, self.roster.names)
        truth = replace(flown, intervals={}, rates_hz=None, unseen=()) if self.says_truth else None
        asked = any(look.lasts_s > 0.0 for look in self._looks.values())
        return TrafficStates.of(
            wake.ticks,
            seen.own,
            states,
            present=present,
            roster=self.roster,
            columns=seen.columns,
            culled=culled,
            present_to={name: there for name, (there, _) in others.items()} or None,
            culled_to={name: count for name, (_, count) in others.items()} or None,
            flights=KnownFlights(flown, run, known) if asked else None,
            true_flights=None if truth is None else KnownFlights(truth, run, known),
            run_time_s=None if truth is None else time_s,
        )

    def _apply_manoeuvres(self, wake: Wake, run: IntArray) -> IntArray:
        """Add received manoeuvres to platforms' flights; return counts flown (rows, platforms)."""
        self._pending = Coming.concatenate([self._pending, *arrived_manoeuvres(wake, self._steers)])
        flown = self._flown
        fleet, runs = flown.fleet, flown.runs
        each = run[:, np.newaxis] + runs * np.arange(len(flown.platforms))
        if not len(self._pending):
            return fleet.manoeuvre_count[each]
        due, self._pending = split_due_manoeuvres(wake, self._pending)
        flights = np.searchsorted(flown.platforms, due.platform) * runs + due.replica
        time_s = due.tick / wake.ticks_per_s
        there = due.platform < 0
        if not there.all():  # who is not there is not steered; the ownship always is
            from_s, until_s = fleet.nominal.intervals_present_s[flights].T
            there |= (from_s <= time_s) & (time_s <= until_s)
            due, flights = due.take(there), flights[there]
        fleet, known = add_due_manoeuvres(fleet, flights, due, wake, each)
        for view in self._views:
            if view.epochs is not None:
                mine = due.take(due.platform == view.viewer)
                for run_of, tick in zip(mine.replica.tolist(), mine.tick.tolist(), strict=True):
                    view.epochs.forget_ranges_from(run_of, tick / wake.ticks_per_s)
        self._flown = replace(flown, fleet=fleet)
        assert isinstance(self.own, SteeredFlight)
        self.own = SteeredFlight(self.own.flight, fleet)
        self.targets = self._flown.flown_target_flights()
        return known

    def _target_states_at(
        self, run: IntArray, columns: IntArray, time_s: FloatArray
    ) -> TrajectoryState:
        """Return states (rows, columns) of the targets `columns`, for each row's run and time."""
        flown, shape = self._flown, (len(time_s), len(columns))
        state: TrajectoryState | None = None
        if flown.runs == 1:
            if not np.array_equal(columns, self._moved[0]):
                self._moved = columns, flown.targets.subset(columns)
            state = self._moved[1].at(time_s)
            if not flown.crabbing and not flown.steered_targets:
                return state
            state = state.reshape((-1,))
        each = (run[:, np.newaxis] * flown.targets_per_run + columns).reshape(-1)
        return flown.target_states_at(each, np.repeat(time_s, len(columns)), state).reshape(shape)

    def own_states_at(self, time_s: FloatArray) -> TrajectoryState:
        """Return the ownship's states in run 0 at times (n,), with manoeuvres so far and wind."""
        return self._flown.platform_states_at(-1, np.zeros(len(time_s), dtype=np.int64), time_s)

    def records(self) -> list[type[Message]]:
        """Return the types to record: traffic states; true ones if asked or the scene is small."""
        return [TrafficStates, TrueStates] if self.says_truth else [TrafficStates]

    def sample_times(self) -> list[SampleTimes]:
        """Return the times at which the flights are given by samples, for ownship and targets.

        A target's times are those of all the items together.
        """
        raise TypeError(f"{type(self).__name__} does not say when its samples are")

    def report(self) -> dict[str, Any]:
        """Return the closest approach of every target to the ownship over the run."""
        return {"targets": self.closest_approaches()}

    def closest_approaches(self, platform: str = "") -> dict[str, Any]:
        """Return, by name, time and range of closest approach of aircraft that a platform may see.

        By default that is the ownship. ``at`` says where it is the first or the last instant that
        was looked at: the aircraft may have been nearer before, or come nearer after.
        """
        end_s, viewer = float(self.context.duration_s), self._target_index(platform)
        own, targets, names = self.own, self.targets, [*self.roster.names]
        if viewer >= 0:  # it and the ownship change places
            own, names[viewer] = targets[viewer], self.roster.own_name
            targets = WithOthers(
                targets, len(targets), {viewer: self._flown.flights_of_platform(-1)}
            )
        times = self._approach_search_times(end_s)
        between = not self._has_approach_search_interval
        best = approaches_of_run(own, targets, times, end_s, between=between)
        where = describe_censoring_ends(own, targets, times, best.time_s, end_s)
        closest = zip(names, best.time_s.tolist(), best.range_m.tolist(), where, strict=True)
        approaches = [
            (name, {"time_s": time_s, "range_m": range_m, **({"at": at} if at else {})})
            for name, time_s, range_m, at in closest
        ]
        return {
            name: {"closest_approach": one if math.isfinite(one["range_m"]) else None}
            for place, (name, one) in enumerate(approaches)
            if place == viewer or place not in self.unseen
        }

    @property
    def _has_approach_search_interval(self) -> bool:
        """Return whether the scene sets the interval at which closest approaches are searched."""
        return hasattr(self.p, "sample_interval_s")

    def _approach_search_times(self, end_s: float) -> list[SampleTimes]:
        """Return the sets of times at which the closest-approach search compares distances."""
        grid = [] if self._has_approach_search_interval else [RegularTimes(STEP_S, end_s)]
        return [*self.sample_times(), *grid]


def _states_of_one(fleet: Fleet, aircraft: int, time_s: FloatArray) -> TrajectoryState:
    """Return the states of one flight of a fleet at times (n,)."""
    return fleet.each(np.full(len(time_s), aircraft), time_s)
