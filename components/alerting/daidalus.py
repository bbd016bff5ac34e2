"""Alert levels in a scene, of tracks, fused lines of sight or the truth (``alerting.daidalus``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import Configuration
from components.alerting.alert_table import without_memory
from components.alerting.levels import AlertPairs, levels_without_memory, memory_rule
from components.alerting.memory import AlertMemory
from components.alerting.separation import separation
from components.alerting.straight_fit import StraightFit
from components.geometry.attitude import body_to_ned
from components.geometry.daidalus_sphere import east_north_m
from components.guidance.situation import State
from components.messages.alerts import MOST_LEVELS, AlertLevels
from components.messages.fused import WITHOUT_POSE, FusedDetections
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import ClockedParameters, Component, ScenePath
from dsa_des.block.message import offsets_of
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Arrivals, Wake

_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
_OWN_MOTION = ("alt_m", "east_mps", "north_mps", "climb_mps")
# Poses of the ownship that are remembered beyond the last scan: for sights that come late.
_KEPT_POSES = 10_000


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
    aircraft are. A target's flight is a straight line through its positions of the last seconds,
    in the ownship's east, north and up; positions at two instants are needed. What has no range is
    left out.
    """

    inputs = {
        "states": Input(TrafficStates, "queued", "Where all aircraft are: the ownship at least."),
        "tracks": Input(Tracks, "queued", "What is held of every target.", required=False),
        "fused": Input(FusedDetections, "queued", "Fused lines of sight.", required=False),
    }
    outputs = {"alerts": Output(AlertLevels, "The alert level of each target.")}
    Parameters = DaidalusParameters
    windowed = True

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
        if {"tracks", "fused"} <= ports:
            raise ValueError("both tracks and fused are wired: alerting believes one of them")
        self._source = next((port for port in ("tracks", "fused") if port in ports), "")
        self._configuration: Configuration = configuration
        self._roster: Any = None
        self._own_came: IntArray = np.empty(0, dtype=np.int64)
        self._own_tick: IntArray = np.empty(0, dtype=np.int64)
        self._own_place: FloatArray = np.empty((0, 3))
        self._attitude: FloatArray = np.empty((0, 3))

    def run(self, wake: Wake) -> AlertLevels | None:
        """Take in what came, and give the levels at each scan."""
        for arrived in wake.arrivals("states"):
            self._take_states(arrived)
        if self._roster is None:
            return None
        if self._source:
            for arrived in wake.arrivals(self._source):
                self._take_sights(arrived)
        ticks = wake.ticks[wake.scans >= 0]
        return self._levels(ticks) if len(ticks) else None

    def _take_states(self, arrived: Arrivals) -> None:
        """Remember the ownship's attitude, and where the targets are if that is believed."""
        states: TrafficStates = arrived.message
        if self._roster is None:
            self._roster = states.roster
            self._fit = StraightFit(self.p.fit_s, len(states.roster))
            self._memory = AlertMemory(memory_rule(self._configuration), len(states.roster))
        place = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        self._own_came = np.concatenate([self._own_came, arrived.tick])
        # Of those that overtook each other on the way, the newest counts.
        ticks = np.concatenate([self._own_tick, states.tick])
        self._own_tick = np.maximum.accumulate(ticks)
        self._own_place = np.concatenate([self._own_place, np.stack(place, axis=1)])
        if self._source:
            angles = (states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad)
            self._attitude = np.concatenate([self._attitude, np.stack(angles, axis=1)])
            return
        own = [np.radians(x)[:, np.newaxis] for x in (states.own_lat_deg, states.own_lon_deg)]
        east, north = east_north_m(np.radians(states.lat_deg), np.radians(states.lon_deg), *own)
        up = states.alt_m - states.own_alt_m[:, np.newaxis]
        position = np.full((len(states), len(self._roster), 3), np.nan)
        there = np.where(states.present[:, :, np.newaxis], np.stack([east, north, up], -1), np.nan)
        position[:, states.columns] = there
        self._fit.add(arrived.tick, states.tick / self.context.ticks_per_s, position)

    def _take_sights(self, arrived: Arrivals) -> None:
        """Turn what was measured in body axes into positions east, north and up."""
        sights = arrived.message
        row = np.repeat(np.arange(len(sights)), np.diff(sights.offsets))
        new = np.isfinite(sights.range_m) & (sights.target >= 0)
        if self._source == "tracks":
            new &= sights.updated  # others came with an earlier row
        # The attitude of when it was measured, of those that have arrived.
        place = np.minimum(
            np.searchsorted(self._own_tick, sights.measured_tick, side="right"),
            np.searchsorted(self._own_came, arrived.tick[row], side="right"),
        )
        new &= place > 0
        row, place = row[new], place[new] - 1
        yaw, pitch, roll = self._attitude[place].T
        azimuth, elevation = sights.azimuth_rad[new], sights.elevation_rad[new]
        range_m = sights.range_m[new]
        level = range_m * np.cos(elevation)
        body = level * np.cos(azimuth), level * np.sin(azimuth), -range_m * np.sin(elevation)
        north, east, down = body_to_ned(*body, yaw, pitch, roll)
        # A row of its own for every instant of measurement.
        line, came, made = _by_instant(sights.tick, arrived.tick, row, sights.measured_tick[new])
        position = np.full((len(made), len(self._roster), 3), np.nan)
        position[line, sights.target[new]] = np.stack([east, north, -down], axis=-1)
        self._fit.add(came, made / self.context.ticks_per_s, position)

    def _levels(self, ticks: IntArray) -> AlertLevels:
        """Return the levels at some scans."""
        times = (ticks / self.context.ticks_per_s).tolist()
        fitted = [
            self._fit.states(int(tick), now_s)
            for tick, now_s in zip(ticks.tolist(), times, strict=True)
        ]
        self._fit.forget_before(times[-1])
        own = self._own_states(ticks)
        self._forget_poses(int(ticks[-1]))
        known = np.stack([one for one, _ in fitted])
        # Positions count from the ownship: its own less theirs is the other way round.
        relative = [-np.ravel([state[i] for _, state in fitted]) for i in range(6)]
        lookahead_s = self._configuration["lookahead_time"]
        pairs = AlertPairs(tuple(relative), self._own_flights(own, known.shape))
        alerter = self._configuration.alerters[self.p.alerter - 1]
        times_s, *both = levels_without_memory(self._configuration, alerter, pairs)
        due, early = (part.reshape(*known.shape, len(alerter.levels)) for part in both)
        level = [
            self._memory.step(now_s, known[i], due[i], early[i]) for i, now_s in enumerate(times)
        ]
        row, target = np.nonzero(known)
        place = np.flatnonzero(known.ravel())
        found = separation(relative, lookahead_s, np.full(known.size, np.nan))
        times_s = np.where(np.isfinite(times_s), times_s, np.nan)[place]
        return AlertLevels(
            ticks,
            offsets_of(row, len(ticks)),
            target,
            np.concatenate(level)[place],
            {
                f"time_to_level_{k}_s": times_s[:, k - 1].copy()
                for k in range(1, len(alerter.levels) + 1)
            },
            found.time_to_closest_s[place],
            found.miss_horizontal_m[place],
            found.miss_vertical_m[place],
            {name: part[place] for name, part in zip(_RELATIVE, relative, strict=True)},
            own,
            self._roster,
        )

    def _own_flights(self, own: Mapping[str, FloatArray], shape: tuple[int, ...]) -> State:
        """Return the ownship's flight beside every target, in its own plane."""
        zero = np.zeros(shape)
        motion = (np.nan_to_num(own[name]) for name in _OWN_MOTION)
        alt_m, *velocity = (np.repeat(part, shape[1]) for part in motion)
        return State(zero.ravel(), zero.ravel(), alt_m, *velocity)

    def _forget_poses(self, tick: int) -> None:
        """Drop poses of the ownship that neither its velocity nor a late sight asks for."""
        span = round(self.p.fit_s * self.context.ticks_per_s)
        old = int(np.searchsorted(self._own_tick, tick - span, side="left"))
        keep = max(min(old, len(self._own_tick) - _KEPT_POSES), 0)
        for name in ("_own_came", "_own_tick", "_own_place", "_attitude"):
            setattr(self, name, getattr(self, name)[keep:])

    def _own_states(self, ticks: IntArray) -> dict[str, FloatArray]:
        """Return the ownship's altitude and its mean velocity over the last seconds."""
        per_s = self.context.ticks_per_s
        span = round(self.p.fit_s * per_s)
        last = np.maximum(np.searchsorted(self._own_came, ticks, side="right") - 1, 0)
        first = np.minimum(np.searchsorted(self._own_tick, ticks - span, side="left"), last)
        now, then = self._own_place[last], self._own_place[first]
        time_s = (self._own_tick[last] - self._own_tick[first]) / per_s
        time_s = np.where(time_s > 0.0, time_s, np.nan)
        east, north = east_north_m(then[:, 0], then[:, 1], now[:, 0], now[:, 1])
        return {
            "alt_m": now[:, 2],
            "east_mps": -east / time_s,
            "north_mps": -north / time_s,
            "climb_mps": (now[:, 2] - then[:, 2]) / time_s,
        }


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
