"""The base class of traffic sources: states at the instants that sensors ask for."""

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from components.aircraft.aircraft import Aircraft, Roster
from components.aircraft.known_targets import KnownTraffic
from components.flights.attitude import Wind, scene_wind
from components.flights.bounds import (
    FlightAt,
    TrafficEnvelope,
    check_above_terrain,
    check_on_raster,
    traffic_envelope,
)
from components.flights.closest_approach import (
    Approaches,
    SampleTimes,
    censored_approaches,
    closest_approaches,
    present_together_s,
)
from components.flights.culling import Culling, SteeredCulling, range_between
from components.flights.fleet import Fleet
from components.flights.steered_flight import SteeredFlight
from components.geometry import TrajectoryState
from components.messages.reach import FarthestLook, farthest_look
from components.messages.targets import TrafficStates, TrueStates
from components.traffic.flown_together import FlownTogether, flown_by
from components.traffic.steered_ownship import SteeredOwnship, truth_is_recorded
from components.traffic.wind_effect import ATTITUDE
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Output, Parameters, PositiveRational
from dsa_des.block.message import Message
from dsa_des.block.wake import ReplicaRuns, Wake
from dsa_des.errors import did_you_mean
from dsa_des.time.clock import ClockSpec


class SourceParameters(Parameters):
    """Parameters of every traffic source."""

    update_rate_hz: PositiveRational | None = Field(
        default=None,
        description="Rate at which positions are published; sensors then see the last one. By "
        "default they are known at every scan instant.",
    )


class TrafficSource(SteeredOwnship):
    """Publishes where the ownship and its targets are.

    When manoeuvres are wired to it, its ownship flies them from the time they come.

    Subclasses set `own`, `targets` and `roster` in `setup`, and say at which times their data hold
    samples.
    """

    outputs = {"states": Output(TrafficStates, "Positions and attitudes of all aircraft.")}
    Parameters: ClassVar[Any] = SourceParameters
    windowed = True
    rewindable = True
    clocked = "demand"
    hooks = (ATTITUDE,)

    roster: Roster
    also_records = (TrueStates,)
    _offered: KnownTraffic | None = None

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
        """Say what the targets are, and where they can be.

        It is the same word for all who ask: whether a block went by where the targets can be
        must show when replicas compare what their traffic says.
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
        self._all_columns = np.arange(len(self.roster))
        self._crabbing = self.built(ATTITUDE)
        #: The targets that were moved last, and their fleet.
        self._moved: tuple[IntArray, Fleet] = self._all_columns, self.targets
        self._steered_culling: SteeredCulling | None = None
        self._culled_around: Any = None
        look = farthest_look(c.request for c in self.context.consumers)
        self.flights_asked_for = look.lasts_s > 0.0
        if not self.context.simulate_everything and self.clock_of(self.p) is None:
            self._cull(look)
        self.says_truth = truth_is_recorded(self.context, len(self.roster))
        self._be_steered()

    def _check_terrain(self, own_at: FlightAt) -> None:
        """Refuse terrain that an ownship does not fly above."""
        terrain, end_s = self.context.sections.get("terrain"), float(self.context.duration_s)
        if terrain is not None and terrain.height_m is not None:
            check_above_terrain(own_at, terrain.height_m, end_s)
        if terrain is not None and terrain.raster is not None:
            check_on_raster(own_at, terrain.raster.raster, terrain.raster_offset_m, end_s)

    def _cull(self, look: FarthestLook) -> None:
        """Learn which targets matter, where it is known how far sensors look."""
        if not math.isfinite(look.range_m):
            return
        if not self.context.producers:
            end_s = float(self.context.duration_s)
            self._culling = Culling(self.own, self.targets, look.range_m, end_s, look.lasts_s)
        elif not self.flights_asked_for:
            own_mps = np.array([self.own.max_speed_mps])
            targets_mps = self.targets.max_speeds_mps[np.newaxis]
            self._steered_culling = SteeredCulling(own_mps, targets_mps, look.range_m)

    @classmethod
    def prepare(cls, parameters: Sequence[Any]) -> None:
        """Do what can be done at once for blocks with these parameters, which will be made."""

    def together(self, replicas: ReplicaRuns) -> FlownTogether | None:
        """Return what flies the flights of all replicas."""
        # Where the line of sight was chosen by where the traffic is, each replica chooses.
        asked = self._offered is not None and self._offered.asked
        if asked or self._crabbing:
            return None
        flown = flown_by(self, replicas)
        # What [accuracy] leaves out may rest on what the targets are.
        accuracy = self.context.sections.get("accuracy")
        allows = accuracy is not None and accuracy.model_dump(exclude_none=True)
        if flown is None or (allows and flown.roster is not self.roster):
            return None
        # A flight into the ground is said of its own replica, by itself.
        for number in range(len(replicas)):
            self._check_terrain(partial(_one_of, flown.own, number))
        rates = [p.update_rate_hz for p in replicas.parameters]
        published = None not in rates
        return FlownTogether(self, flown, np.array(rates, dtype=np.float64) if published else None)

    @property
    def width(self) -> int:
        """Most targets that are moved at one time."""
        if self._culling is None:
            return len(self.roster)
        return self._culling.intervals.most_at_once()

    def left_out(self) -> list[str]:
        """Say how far targets matter."""
        culling = self._culling or self._steered_culling
        if culling is None:
            return []
        reach_km = culling.reach_m / 1000.0
        return [f"targets beyond {reach_km:.2f} km: not moved, no sensor looks farther"]

    def run(self, wake: Wake) -> Message:
        """Return the state of all aircraft that may matter, at every instant."""
        flights, truth = self._steer(wake)
        time_s = wake.time_s
        columns, near = self._near(time_s)
        if not np.array_equal(columns, self._moved[0]):
            self._moved = columns, self.targets.subset(columns)
        states = self._moved[1].at(time_s)
        own = self.own_at(time_s)
        for crabbing in self._crabbing:
            times = np.broadcast_to(time_s[:, np.newaxis], states.lat_deg.shape)
            states = crabbing.of_targets(columns, states, times)
        present = states.present & own.present[:, np.newaxis]
        culled = None
        if near is not None:
            present &= near
            culled = len(self._all_columns) - near.sum(axis=1)
        return TrafficStates.of(
            wake.ticks,
            own,
            states,
            present=present,
            roster=self.roster,
            columns=columns,
            culled=culled,
            flights=flights,
            true_flights=truth,
            run_time_s=None if truth is None else time_s,
        )

    def _near(self, time_s: FloatArray) -> tuple[IntArray, BoolArray | None]:
        """Return which targets may come in reach, and when (rows, targets); None for always."""
        if self._steered_culling is not None:
            assert isinstance(self.own, SteeredFlight)
            if self.own is not self._culled_around:
                self._culled_around = self.own
                self._steered_culling.forget(np.zeros(1, dtype=np.int64))
            run, told_mps = np.zeros(len(time_s), dtype=np.int64), self.own.fastest_by(time_s)
            near = self._steered_culling.near(run, time_s, told_mps, self._range_m)
            columns = np.flatnonzero(near.any(axis=0))
            return columns, near[:, columns]
        if self._culling is None:
            return self._all_columns, None
        columns = self._culling.active(float(time_s.min()), float(time_s.max()))
        return columns, self._culling.near(columns, time_s)

    def _range_m(self, _: IntArray, target: IntArray, time_s: FloatArray) -> FloatArray:
        return range_between(self.own.at, self.targets.each, target, time_s)

    def records(self) -> list[type[Message]]:
        """Return what is recorded: the truth where a scene is small, or asks for it."""
        return [TrafficStates, TrueStates] if self._truth_now is not None else [TrafficStates]

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
        where = censored_approaches(self, best.time_s, end_s)
        found = zip(names, best.time_s.tolist(), best.range_m.tolist(), where, strict=True)
        return {
            "targets": {
                name: {
                    "closest_approach": {
                        "time_s": time_s,
                        "range_m": range_m,
                        **({"at": at} if at else {}),
                    }
                    if math.isfinite(range_m)
                    else None
                }
                for name, time_s, range_m, at in found
            }
        }

    def _closest_approaches(self, end_s: float) -> Approaches:
        best = Approaches.none(len(self.targets))
        speeds = self.targets.max_speeds_mps
        present_s = present_together_s(self.own, self.targets.intervals_present_s, end_s)
        for times in self.sample_times():
            closest_approaches(
                lambda _, time_s: self.own.at(time_s), self.targets.each, times,
                closing_speed_mps=speeds + self.own.max_speed_mps, present_s=present_s, best=best,
            )  # fmt: skip
        return best


def _one_of(fleet: Fleet, aircraft: int, time_s: FloatArray) -> TrajectoryState:
    """Return the states of one flight of many at times (n,)."""
    return fleet.each(np.full(len(time_s), aircraft), time_s)


def roster_of(
    names: Sequence[str], default: Aircraft, others: dict[str, Aircraft], what: str
) -> Roster:
    """Return the roster of named targets: `others` by name, `default` for the rest."""
    for name in others:
        if name not in names:
            raise ValueError(f"aircraft.{name}: {what} has no such intruder"
                             f"{did_you_mean(name, names)}")  # fmt: skip
    return Roster.of([(name, others.get(name, default)) for name in names])
