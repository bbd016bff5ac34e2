"""Alert levels in a scene, of tracks, fused lines of sight or the truth (``alerting.daidalus``)."""

from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import Configuration
from components.alerting.alert_table import without_memory
from components.alerting.lasting_memory import LastingMemory
from components.alerting.levels import due_levels, memory_rule, violation_times_s
from components.alerting.separation import separation
from components.alerting.straight_fit import StraightFit
from components.geometry.attitude import body_to_ned
from components.geometry.daidalus_sphere import east_north_m
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
# Poses of the ownship that are remembered beyond the last scan: for sights that come late.
_KEPT_POSES = 10_000
_POSES = ("_own_came", "_own_tick", "_own_place", "_attitude")


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
    lockstep = True
    side_by_side = True

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
        #: Poses of replicas side by side that have been set aside, as the columns of `_kept`.
        self._old_poses: list[list[Any]] = []

    def run(self, wake: Wake) -> AlertLevels | None:
        """Take in what came, and give the levels at each scan."""
        for arrived in wake.arrivals("states"):
            self._take_states(arrived, wake)
        if self._roster is None:
            return None
        if self._source:
            for arrived in wake.arrivals(self._source):
                self._take_sights(arrived, wake)
        ticks = wake.ticks[wake.scans >= 0]
        begins = self._begins(ticks, wake)
        place = np.searchsorted(self._own_came, begins)
        # Before the first state of a run has come, it has no levels.
        come = self._own_came[np.minimum(place, len(self._own_came) - 1)]
        known = (come >= begins) & (come <= ticks)
        if not known.all():
            ticks, begins, place = ticks[known], begins[known], place[known]
        return self._levels(ticks, begins, place, wake) if len(ticks) else None

    def _begins(self, ticks: IntArray, wake: Wake) -> IntArray:
        """Return where the runs of some instants begin."""
        return ticks - wake.own_ticks(ticks) if wake.span_ticks else np.zeros_like(ticks)

    def _take_states(self, arrived: Arrivals, wake: Wake) -> None:
        """Remember the ownship's attitude, and where the targets are if that is believed."""
        states: TrafficStates = arrived.message
        if self._roster is None:
            self._roster = states.roster
            self._fit = StraightFit(self.p.fit_s, len(states.roster))
            self._memory = LastingMemory(memory_rule(self._configuration), len(states.roster))
        place = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        self._own_came = np.concatenate([self._own_came, arrived.tick])
        ticks = np.concatenate([self._own_tick, states.tick])
        self._own_place = np.concatenate([self._own_place, np.stack(place, axis=1)])
        if self._source:
            angles = (states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad)
            self._attitude = np.concatenate([self._attitude, np.stack(angles, axis=1)])
        if wake.side_by_side:  # those of each replica together
            order = np.argsort(self._own_came, kind="stable")
            ticks, self._own_came = ticks[order], self._own_came[order]
            self._own_place = self._own_place[order]
            self._attitude = self._attitude[order] if self._source else self._attitude
        # Of those that overtook each other on the way, the newest counts.
        self._own_tick = np.maximum.accumulate(ticks)
        if self._source:
            return
        own = [np.radians(x)[:, np.newaxis] for x in (states.own_lat_deg, states.own_lon_deg)]
        east, north = east_north_m(np.radians(states.lat_deg), np.radians(states.lon_deg), *own)
        up = states.alt_m - states.own_alt_m[:, np.newaxis]
        position = np.full((len(states), len(self._roster), 3), np.nan)
        there = np.where(states.present[:, :, np.newaxis], np.stack([east, north, up], -1), np.nan)
        position[:, states.columns] = there
        self._fit.add(arrived.tick, wake.own_ticks(states.tick) / wake.ticks_per_s, position)

    def _take_sights(self, arrived: Arrivals, wake: Wake) -> None:
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
        first = np.searchsorted(self._own_came, self._begins(arrived.tick, wake))[row]
        if self._old_poses and bool((new & (place <= first)).any()):
            self._fetch_old_poses()
            return self._take_sights(arrived, wake)
        new &= place > first
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
        self._fit.add(came, wake.own_ticks(made) / wake.ticks_per_s, position)

    def _levels(
        self, ticks: IntArray, begins: IntArray, place: IntArray, wake: Wake
    ) -> AlertLevels:
        """Return the levels at some scans.

        Parameters
        ----------
        ticks, begins : (n,)
            The scans, and when their runs begin.
        place : (n,)
            The first state of each run.
        wake : Wake
        """
        times = wake.own_ticks(ticks) / wake.ticks_per_s
        known, state = self._fit.states(begins, ticks, times)
        own = self._own_states(ticks, place)
        self._forget(ticks, times, wake)
        # Positions count from the ownship: its own less theirs is the other way round.
        relative = [-values.ravel() for values in state]
        levels = self._configuration.alerters[self.p.alerter - 1].levels
        lookahead_s = self._configuration["lookahead_time"]
        times_s = violation_times_s(levels, relative, lookahead_s, None)
        due, early = (
            part.reshape(*known.shape, len(levels)) for part in due_levels(levels, times_s)
        )
        level = self._memory.levels(wake.replica_of(ticks), times, known, due, early)
        row, target = np.nonzero(known)
        cells = np.flatnonzero(known.ravel())
        found = separation(relative, lookahead_s, np.full(known.size, np.nan))
        times_s = np.where(np.isfinite(times_s), times_s, np.nan)[cells]
        return AlertLevels(
            ticks,
            offsets_of(row, len(ticks)),
            target,
            level[cells],
            {f"time_to_level_{k}_s": times_s[:, k - 1].copy() for k in range(1, len(levels) + 1)},
            found.time_to_closest_s[cells],
            found.miss_horizontal_m[cells],
            found.miss_vertical_m[cells],
            {name: part[cells] for name, part in zip(_RELATIVE, relative, strict=True)},
            own,
            self._roster,
        )

    def _forget(self, ticks: IntArray, times: FloatArray, wake: Wake) -> None:
        """Drop what no later scan asks for."""
        if not wake.side_by_side:
            # Of replicas end to end, all before the last one have passed.
            begin = int(ticks[-1]) - int(wake.own_ticks(ticks[-1:])[0]) if wake.span_ticks else 0
            self._fit.forget_ticks_before(begin)
            self._memory.forget_before(int(wake.replica_of(ticks[-1:])[0]))
            self._forget_poses(int(ticks[-1]), begin)
            self._fit.forget_before(float(times[-1]))
            return
        # Windows are stretches of time: the scans of the next one come after those of this one.
        self._fit.forget_before(float(times.min()))
        self._set_poses_aside(int(wake.own_ticks(ticks).min()), wake)

    def _set_poses_aside(self, own_tick: int, wake: Wake) -> None:
        """Keep older poses of replicas side by side where only what comes late asks for them."""
        span = round(self.p.fit_s * self.context.ticks_per_s)
        run = wake.replica_of(self._own_came)
        recent = wake.own_ticks(self._own_tick) >= own_tick - 2 * span
        recent |= np.append(run[1:] != run[:-1], True)  # the last one of each
        old = np.flatnonzero(~recent)
        if 2 * len(old) > len(recent):
            self._old_poses.append([getattr(self, name)[old] for name in self._kept()])
            self._keep_poses(np.flatnonzero(recent))

    def _kept(self) -> tuple[str, ...]:
        """Return what is remembered of the ownship's poses."""
        return _POSES if self._source else _POSES[:-1]

    def _keep_poses(self, which: Any) -> None:
        for name in self._kept():
            setattr(self, name, getattr(self, name)[which])

    def _fetch_old_poses(self) -> None:
        """Remember all poses again, those of each replica together."""
        for place, name in enumerate(self._kept()):
            parts = [*(old[place] for old in self._old_poses), getattr(self, name)]
            setattr(self, name, np.concatenate(parts))
        self._old_poses = []
        self._keep_poses(np.argsort(self._own_came, kind="stable"))

    def _forget_poses(self, tick: int, begin: int) -> None:
        """Drop poses of the ownship that neither its velocity nor a late sight asks for."""
        span = round(self.p.fit_s * self.context.ticks_per_s)
        old = int(np.searchsorted(self._own_tick, tick - span, side="left"))
        keep = max(min(old, len(self._own_tick) - _KEPT_POSES), 0)
        keep = max(keep, int(np.searchsorted(self._own_came, begin)))
        self._keep_poses(slice(keep, None))

    def _own_states(self, ticks: IntArray, place: IntArray) -> dict[str, FloatArray]:
        """Return the ownship's altitude and its mean velocity over the last seconds."""
        per_s = self.context.ticks_per_s
        span = round(self.p.fit_s * per_s)
        last = np.maximum(np.searchsorted(self._own_came, ticks, side="right") - 1, place)
        first = np.maximum(np.searchsorted(self._own_tick, ticks - span, side="left"), place)
        first = np.minimum(first, last)
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
