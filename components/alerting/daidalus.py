"""Alert levels in a scene, of tracks, fused lines of sight or the truth (``alerting.daidalus``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import Configuration
from components.alert_configuration.margins import Deviations, margins
from components.alerting.alert_table import without_memory
from components.alerting.believed_flights import BelievedFlights
from components.alerting.followed_tracks import FollowedTracks
from components.alerting.lasting_memory import LastingMemory
from components.alerting.levels import AlertPairs, levels_without_memory, memory_rule
from components.alerting.own_poses import OwnPoses
from components.alerting.separation import separation
from components.alerting.straight_fit import StraightFit
from components.alerting.track_memory import TrackMemory
from components.geometry.attitude import body_to_ned
from components.geometry.daidalus_sphere import east_north_m
from components.guidance.situation import State
from components.messages.alerts import MOST_LEVELS, AlertLevels
from components.messages.fused import WITHOUT_POSE, FusedDetections
from components.messages.state_tracks import StateTracks
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import ClockedParameters, Component, ScenePath
from dsa_des.block.message import offsets_of
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Arrivals, Wake

_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
_OWN_MOTION = ("alt_m", "east_mps", "north_mps", "climb_mps")
_SOURCES = ("tracks", "fused", "estimates")


class DaidalusParameters(ClockedParameters):
    """Parameters of alerting."""

    conf: ScenePath = Field(description="Alerters, times and memory: a .conf file of DAIDALUS.")
    alerter: int = Field(
        default=1, ge=1, description="Which alerter of the file all targets belong to, from 1."
    )
    hysteresis: bool = Field(default=True, description="Whether levels are remembered at all.")
    fit_s: float = Field(
        default=3.0, gt=0, le=60, description="Positions of so long give a target's flight, s."
    )

    @field_validator("conf", mode="after")
    @classmethod
    def _readable(cls, value: Any) -> Any:
        configuration = read_conf(value)
        if configuration.most_levels > MOST_LEVELS:
            raise ValueError(
                f"{value}: an alerter has {configuration.most_levels} levels: at most "
                f"{MOST_LEVELS} are recorded"
            )
        return value


class DaidalusAlerting(Component):
    """Alert levels of all targets by the rules of DAIDALUS (RTCA DO-365), at scans of its own.

    It believes tracks if it gets them, else fused lines of sight, else the truth: where the
    aircraft are. Tracks with states (`StateTracks`) are carried on straight from their last
    estimate; their covariances count for levels that heed uncertainty. Otherwise a target's flight
    is a straight line through its positions of the last seconds, in the ownship's east, north and
    up; positions at two instants are needed. What has no range is left out.
    """

    inputs = {
        "states": Input(TrafficStates, "queued", "Where all aircraft are: the ownship at least."),
        "tracks": Input(Tracks, "queued", "What is held of every target.", required=False),
        "fused": Input(FusedDetections, "queued", "Fused lines of sight.", required=False),
        "estimates": Input(StateTracks, "queued", "Tracks with states.", required=False),
    }
    outputs = {"alerts": Output(AlertLevels, "The alert level of each target.")}
    Parameters = DaidalusParameters
    windowed = True
    lockstep = True

    def request(self, port: str) -> Any:
        """Ask for no poses beside what is fused: the ownship's own come with the states."""
        return WITHOUT_POSE if port == "fused" else None

    def setup(self) -> None:
        """Read the configuration and find out what is believed."""
        configuration = read_conf(self.p.conf)
        if not self.p.hysteresis:
            configuration = without_memory(configuration)
        if self.p.alerter > len(configuration.alerters):
            raise ValueError(
                f"alerter is {self.p.alerter}: it must be at most {len(configuration.alerters)}, "
                f"the number of alerters of {self.p.conf}"
            )
        ports = {producer.port for producer in self.context.producers}
        wired = [port for port in _SOURCES if port in ports]
        if len(wired) > 1:
            raise ValueError(
                f"both {wired[0]} and {wired[1]} are wired: alerting believes one of them"
            )
        self._source = wired[0] if wired else ""
        self._configuration: Configuration = configuration
        self._alerter = configuration.alerters[self.p.alerter - 1]
        self._roster: Any = None
        self._own = OwnPoses(self.context.ticks_per_s)
        self._followed = FollowedTracks()
        self._of_tracks = TrackMemory(memory_rule(configuration))

    def warnings(self) -> list[str]:
        """Say what of its configuration is not used."""
        return self._configuration.notes()

    def run(self, wake: Wake) -> AlertLevels | None:
        """Take in what came, and give the levels at each scan."""
        for arrived in wake.arrivals("states"):
            self._take_states(arrived, wake)
        if self._roster is None:
            return None
        if self._source:
            for arrived in wake.arrivals(self._source):
                if self._source == "estimates":
                    self._followed.add(arrived.tick, arrived.message)
                else:
                    self._take_sights(arrived, wake)
        ticks = wake.ticks[wake.scans >= 0]
        # Before the first state of a run has come, it has no levels.
        ticks = ticks[self._own.have_come(ticks, _begins(ticks, wake))]
        return self._levels(ticks, wake) if len(ticks) else None

    def _take_states(self, arrived: Arrivals, wake: Wake) -> None:
        """Remember the ownship's pose, and where the targets are if that is asked for."""
        states: TrafficStates = arrived.message
        if self._roster is None:
            self._roster = states.roster
            count = len(states.roster)
            self._fit = StraightFit(self.p.fit_s, count)
            self._memory = LastingMemory(memory_rule(self._configuration), count)
        self._own.add(arrived.tick, states, wake)
        if self._source in ("tracks", "fused"):
            return
        own = [np.radians(x)[:, np.newaxis] for x in (states.own_lat_deg, states.own_lon_deg)]
        east, north = east_north_m(np.radians(states.lat_deg), np.radians(states.lon_deg), *own)
        up = states.alt_m - states.own_alt_m[:, np.newaxis]
        position = np.full((len(states), len(self._roster), 3), np.nan)
        there = np.where(states.present[:, :, np.newaxis], np.stack([east, north, up], -1), np.nan)
        position[:, states.columns] = there
        if self._source:
            self._followed.add_truth(arrived.tick, position)
        else:
            self._fit.add(arrived.tick, wake.own_ticks(states.tick) / wake.ticks_per_s, position)

    def _take_sights(self, arrived: Arrivals, wake: Wake) -> None:
        """Turn what was measured in body axes into positions east, north and up."""
        sights = arrived.message
        row = np.repeat(np.arange(len(sights)), np.diff(sights.offsets))
        new = np.isfinite(sights.range_m) & (sights.target >= 0)
        if self._source == "tracks":
            new &= sights.updated  # others came with an earlier row
        # The attitude of when it was measured, of those that have arrived.
        came = arrived.tick[row]
        place = self._own.pose_of(sights.measured_tick, came, _begins(came, wake), new)
        new &= place >= 0
        row = row[new]
        yaw, pitch, roll = self._own.attitude_rad(place[new])
        azimuth, elevation = sights.azimuth_rad[new], sights.elevation_rad[new]
        range_m = sights.range_m[new]
        level = range_m * np.cos(elevation)
        body = level * np.cos(azimuth), level * np.sin(azimuth), -range_m * np.sin(elevation)
        north, east, down = body_to_ned(*body, yaw, pitch, roll)
        # A row of its own for every instant of measurement.
        line, came, made = _by_instant(sights.tick, arrived.tick, row, sights.measured_tick[new])
        position = np.full((len(made), len(self._roster), 3), np.nan)
        position[line, sights.target[new]] = np.stack([east, north, -down], axis=-1)
        self._fit.add(came, wake.own_ticks(made) / wake.ticks_per_s, position)

    def _levels(self, ticks: IntArray, wake: Wake) -> AlertLevels:
        """Return the levels at some scans."""
        times = wake.own_ticks(ticks) / wake.ticks_per_s
        begins = _begins(ticks, wake)
        estimated = self._source == "estimates"
        own = self._own.states(ticks, begins, 0.0 if estimated else self.p.fit_s)
        if estimated:
            places = self._own.place(ticks)
            flights = self._followed.flights(ticks, times, begins, own, places)
        else:
            known, state = self._fit.states(begins, ticks, times)
            # Positions count from the ownship: its own less theirs is the other way round.
            flights = BelievedFlights(known, tuple(-state))
        known, relative = flights.known, [np.ravel(part) for part in flights.relative]
        bounds = None
        if flights.deviations is not None:
            deviations = Deviations(*(np.ravel(part) for part in flights.deviations))
            bounds = margins(self._configuration, deviations, np.hypot(*relative[:2]))
        scan = np.arange(len(ticks)) if flights.scan is None else flights.scan
        pairs = AlertPairs(tuple(relative), self._own_flights(own, scan, known.shape), bounds)
        times_s, *both = levels_without_memory(self._configuration, self._alerter, pairs)
        due, early = (part.reshape(*known.shape, len(self._alerter.levels)) for part in both)
        runs = wake.replica_of(ticks)
        if flights.number is None:
            level = self._memory.levels(runs, times, known, due, early)
        else:
            level = self._of_tracks.levels(
                runs[scan], flights.number, times[scan], due[:, 0], early[:, 0]
            )
        self._forget(ticks, times, wake)
        row, column = np.nonzero(known)
        place = row * known.shape[1] + column
        lookahead_s = self._configuration["lookahead_time"]
        found = separation(relative, lookahead_s, np.full(known.size, np.nan))
        times_s = np.where(np.isfinite(times_s), times_s, np.nan)[place]
        numbered = range(1, len(self._alerter.levels) + 1)
        told = {} if flights.deviations is None else flights.deviations._asdict()
        return AlertLevels(
            ticks,
            offsets_of(scan[row], len(ticks)),
            column if flights.target is None else flights.target,
            level[place],
            {f"time_to_level_{k}_s": times_s[:, k - 1].copy() for k in numbered},
            found.time_to_closest_s[place],
            found.miss_horizontal_m[place],
            found.miss_vertical_m[place],
            {} if flights.number is None else {"track": flights.number},
            {name: np.ravel(part)[place] for name, part in told.items()},
            {name: part[place] for name, part in zip(_RELATIVE, relative, strict=True)},
            own,
            self._roster,
        )

    def _forget(self, ticks: IntArray, times: FloatArray, wake: Wake) -> None:
        """Drop what no later scan asks for."""
        estimated = self._source == "estimates"
        span = 0 if estimated else round(self.p.fit_s * self.context.ticks_per_s)
        runs = wake.replica_of(ticks)
        if estimated:
            self._followed.forget_before(ticks, wake)
            ends = np.flatnonzero(np.append(runs[1:] != runs[:-1], True))
            self._of_tracks.forget(runs[ends], times[ends])
        if wake.side_by_side:
            # The scans of the next stretch of time come after all of these.
            self._fit.forget_before(float(times.min()))
            earliest = int(wake.own_ticks(ticks).min()) - span
            self._own.set_aside(earliest, wake, late_sights=not estimated)
            return
        last = ticks[-1:]
        begin = int(_begins(last, wake)[0])  # what was before is of runs that have passed
        self._fit.forget_ticks_before(begin)
        self._fit.forget_before(float(times[-1]))
        for memory in (self._memory, self._of_tracks):
            memory.forget_before(int(runs[-1]))
        self._own.forget_before(int(last[0]) - span, begin)

    def _own_flights(
        self, own: Mapping[str, FloatArray], scan: IntArray, shape: tuple[int, ...]
    ) -> State:
        """Return the ownship's flight beside every target, in its own plane."""
        zero = np.zeros(shape)
        motion = (np.nan_to_num(own[name])[scan] for name in _OWN_MOTION)
        alt_m, *velocity = (np.repeat(part, shape[1]) for part in motion)
        return State(zero.ravel(), zero.ravel(), alt_m, *velocity)


def _begins(ticks: IntArray, wake: Wake) -> IntArray:
    """Return when the runs of some instants begin."""
    return ticks - wake.own_ticks(ticks) if wake.span_ticks else np.zeros_like(ticks)


def _by_instant(
    tick: IntArray, came: IntArray, row: IntArray, measured: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the line of each entry, and when each line came and was measured.

    Parameters
    ----------
    tick, came : (rows,)
        Instants of a message's rows, and when they came.
    row, measured : (entries,)
        Row of each entry, and when it was measured.
    """
    if np.array_equal(measured, tick[row]):
        return row, came, tick
    # A row without entries has its line all the same, whatever other rows the wake brings.
    silent = np.flatnonzero(np.bincount(row, minlength=len(tick)) == 0)
    every = np.stack([np.concatenate([row, silent]), np.concatenate([measured, tick[silent]])])
    pairs, line = np.unique(every, axis=1, return_inverse=True)
    return line.reshape(-1)[: len(row)], came[pairs[0]], pairs[1]
