"""Alert levels in a scene, of tracks, fused lines of sight or the truth (``alerting.daidalus``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import (
    Configuration,
    Deviations,
    uncertainty_bounds,
)
from components.alerting.alert_tables import remove_hysteresis
from components.alerting.believed_positions import (
    BelievedFlights,
    BelievedPositions,
    true_relative_positions_m,
)
from components.alerting.believed_tracks import BelievedTracks
from components.alerting.levels import AlertPairs, memory_rule, times_and_due_without_memory
from components.alerting.memory import LevelMemory
from components.alerting.others_tracks import OthersTracks
from components.alerting.received import OwnPoses
from components.guidance.daidalus import ConfParameters
from components.guidance.situation import State
from components.messages.alerts import MOST_LEVELS, AlertLevels, AlertsOffered
from components.messages.detections import joined_names_if_all_rangeless
from components.messages.fused import WITHOUT_POSE, FusedDetections
from components.messages.state_tracks import StateTracks
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from components.well_clear.separation import present_and_projected_separation
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import ClockedParameters, Component, Input, Output, ScenePath
from dsa_des.block.ladder import Verified
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Arrivals, Wake

_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
_OWN_MOTION = ("alt_m", "east_mps", "north_mps", "climb_mps")
_SOURCES = ("tracks", "fused", "estimates")


class DaidalusParameters(ConfParameters, ClockedParameters):
    """Parameters of alerting."""

    conf: ScenePath = Field(description="Alerters, times and memory: a .conf file of DAIDALUS.")
    hysteresis: bool = Field(default=True, description="Whether levels are remembered at all.")
    fit_s: float = Field(
        default=3.0, gt=0, le=60,
        description="Positions of so long give a target's flight, at least the last two, s.",
    )  # fmt: skip
    own_gate_probability: float = Field(
        default=0.9999, ge=0, lt=1,
        description="Probability that the track which another platform has of this one is known "
        "for it, by place and velocity, and not judged; 0 for never.",
    )  # fmt: skip
    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration with which a track that only other "
        "platforms' sensors gave is carried on to the scan, m²/s³.",
    )  # fmt: skip

    @field_validator("conf", mode="after")
    @classmethod
    def _check_conf_readable(cls, value: Any) -> Any:
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
    estimate; their covariances count for levels that heed uncertainty. Those that only sensors on
    other platforms gave grow by the time on the way and by the own position's noise, and one that
    is at the own place with the own velocity is no intruder. Otherwise a target's flight
    is a straight line through its positions of the last seconds (at least the last two, however
    slowly they come), in the ownship's east, north and up. What has no range is left out.
    """

    inputs = {
        "states": Input(TrafficStates, "queued", "Where all aircraft are: the ownship at least."),
        "tracks": Input(Tracks, "queued", "What is held of every target.", required=False),
        "fused": Input(FusedDetections, "queued", "Fused lines of sight.", required=False),
        "estimates": Input(
            StateTracks, "queued", "Tracks with states.", required=False, between_platforms=True
        ),
    }
    outputs = {"alerts": Output(AlertLevels, "The alert level of each target.")}
    Parameters = DaidalusParameters
    remembers = ("_roster", "_belief", "_own", "_memory")
    windowed = True
    lockstep = True
    verified = (
        Verified("alert levels and times to violation", "recorded output of DAIDALUS 2.0.4",
                 "levels equal, times 1e-8 s", "tests/alerting/test_against_reference.py"),
    )  # fmt: skip

    def request(self, port: str) -> Any:
        """Request no poses on ``fused``, as they come with the states; nothing elsewhere."""
        return WITHOUT_POSE if port == "fused" else None

    def setup(self) -> None:
        """Read the configuration and find out what is believed."""
        configuration, self._alerter = self.p.read_configuration()
        if not self.p.hysteresis:
            configuration = remove_hysteresis(configuration)
        ports = {producer.port for producer in self.context.producers}
        wired = [port for port in _SOURCES if port in ports]
        if len(wired) > 1:
            raise ValueError(
                f"both {wired[0]} and {wired[1]} are wired: alerting believes one of them"
            )
        self._source = wired[0] if wired else ""
        self._configuration: Configuration = configuration
        self._roster: Any = None
        self._own = OwnPoses(self.context.ticks_per_s)
        self._others = OthersTracks.from_context(
            self.context, self.p.own_gate_probability, self.p.acceleration_intensity_m2_s3
        )
        # Over which time the ownship's velocity is taken; at least its last two poses count.
        self._over_s = 0.0 if self._source == "estimates" else self.p.fit_s
        self._memory = LevelMemory(memory_rule(configuration))

    def offer(self, port: str) -> AlertsOffered:
        """Return the number of alert levels and the interval between scans, for consumers."""
        return AlertsOffered(
            len(self.p.read_configuration()[1].levels), float(1 / self.p.scan_rate_hz)
        )

    def warnings(self) -> list[str]:
        """Return warnings on ignored configuration keys, and on input that cannot cause alerts."""
        said, period_s = self._configuration.notes(), float(1 / self.p.scan_rate_hz)
        if 0.0 < self._configuration["hysteresis_time"] < period_s:
            said.append(
                f"hysteresis_time is {self._configuration['hysteresis_time']:g} s and scans are "
                f"{period_s:g} s apart: no level is remembered"
            )
        if self.p.offset_s + 1 / self.p.scan_rate_hz >= self.context.duration_s:
            said.append(
                f"scan_rate_hz is {float(self.p.scan_rate_hz):g}: in "
                f"{float(self.context.duration_s):g} s it scans once, which tells no velocity"
            )
        heard = [one for one in self.context.producers if one.port == self._source]
        if blind := joined_names_if_all_rangeless(heard):
            said.append(f"{blind} measures no range: nothing of what it hears of is judged")
        return said

    def failure_counts(self) -> dict[str, IntArray]:
        """Return cause → (2, runs) counts: flights that could not be judged for it, and cases."""
        return {} if self._roster is None else self._belief.failure_counts()

    def run(self, wake: Wake) -> AlertLevels | None:
        """Store the messages of this wake-up, and return the alert levels of each scan due."""
        for arrived in wake.arrivals("states"):
            self._store_states(arrived, wake)
        if self._roster is None:
            return None
        if self._source:
            for arrived in wake.arrivals(self._source):
                self._belief.add(arrived, self._own, wake)
        asked = wake.instants.take(wake.scans >= 0)
        # Before the first state of a run has come, it has no levels.
        asked = asked.take(self._own.has_pose_by(asked))
        return self._compute_alert_levels(asked, wake) if len(asked) else None

    def _store_states(self, arrived: Arrivals, wake: Wake) -> None:
        """Store own poses, and true target positions unless alerts are based on measurements."""
        states: TrafficStates = arrived.message
        if self._roster is None:
            self._roster = states.roster
            targets = len(states.roster)
            self._belief: BelievedTracks | BelievedPositions = (
                BelievedTracks(targets, self._others)
                if self._source == "estimates"
                else BelievedPositions(self.p.fit_s, targets)
            )
        self._own.add(arrived.instants, states)
        if self._source not in ("tracks", "fused"):
            time_s = states.tick / wake.ticks_per_s
            self._belief.add_truth(arrived.instants, time_s, true_relative_positions_m(states))

    def _compute_alert_levels(self, asked: RunTicks, wake: Wake) -> AlertLevels:
        """Return alert levels of known flights at these scans as a message; update the memory."""
        times = asked.tick / wake.ticks_per_s
        own = self._own.altitude_and_mean_velocity(asked, self._over_s)
        flights = self._belief.flights(asked, times, own, self._own)
        known = flights.known
        row, column = known.nonzero()
        relative = tuple(part[row, column] for part in flights.relative)
        wrong = flights.deviations and Deviations(*(part[row] for part in flights.deviations))
        bounds = wrong and uncertainty_bounds(self._configuration, wrong, np.hypot(*relative[:2]))
        scan = np.arange(len(asked)) if flights.scan is None else flights.scan
        pairs = AlertPairs(relative, _ownship_states(own, scan[row]), bounds)
        times_s, *now_due = times_and_due_without_memory(self._configuration, self._alerter, pairs)
        # Memory is asked of all, also of those that are not known now.
        columns = known.shape[1]
        entry = row * columns + column
        due, early = np.zeros((2, known.size, times_s.shape[1]), dtype=bool)
        due[entry], early[entry] = now_due
        each = scan.repeat(columns)
        level = self._memory.update_levels(
            asked.run[each],
            np.tile(np.arange(columns), len(known)) if flights.number is None else flights.number,
            times[each],
            due,
            early,
            known.ravel(),
        )
        self._forget(asked, times, wake)
        lookahead_s = self._configuration["lookahead_time"]
        result = present_and_projected_separation(relative, lookahead_s, np.full(len(row), np.nan))
        times_s = np.where(np.isfinite(times_s), times_s, np.nan)
        numbered = range(1, len(self._alerter.levels) + 1)
        return AlertLevels(
            asked.tick,
            offsets_from_entry_rows(scan[row], len(asked)),
            column if flights.target is None else flights.target,
            level[entry],
            {f"time_to_level_{k}_s": times_s[:, k - 1].copy() for k in numbered},
            result.time_to_closest_s,
            result.miss_horizontal_m,
            result.miss_vertical_m,
            _track_columns(flights),
            {} if wrong is None else wrong._asdict(),
            dict(zip(_RELATIVE, relative, strict=True)),
            own,
            self._roster,
            in_plane=True,
            run=asked.run,
        )

    def _forget(self, asked: RunTicks, times: FloatArray, wake: Wake) -> None:
        """Drop positions, tracks, memories and poses that no later scan needs."""
        self._belief.forget(asked, times, wake)
        ends = asked.last_position_of_runs
        self._memory.forget_absent(asked.run[ends], times[ends])
        self._memory.forget_runs_before(wake.first_run)
        # The next scans come after all of these.
        since = int(asked.tick.max()) - round(self._over_s * self.context.ticks_per_s)
        self._own.set_aside_old_poses(since, wake, late_sights=self._source != "estimates")


def _track_columns(flights: BelievedFlights) -> dict[str, AnyArray]:
    """Return track number and age columns to record; empty unless alerts are based on tracks."""
    if flights.number is None or flights.age_s is None:
        return {}
    return {"track": flights.number, "track_age_s": flights.age_s}


def _ownship_states(own: Mapping[str, FloatArray], scan: IntArray) -> State:
    """Return own states at rows' scans, with position 0; unknown altitude or velocity is 0."""
    motion = np.array([own[name][scan] for name in _OWN_MOTION])
    motion[np.isnan(motion)] = 0.0
    zero = np.zeros(len(scan))
    return State(zero, zero, *motion)
