"""Cues of tracks to sensors: cones in which to look more closely (``tracking.cues``)."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from components.estimation.frame import SensorPose
from components.estimation.measurement import cone_half_angle_rad
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.cues import CueCones
from components.messages.state_tracks import DELETED, TENTATIVE, StateTracks, covariance_matrices
from components.sensor.palette import TRACKER
from dsa_des.arrays.keyed_table import indices_by_occurrence
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, NonNegativeRational, Output, Parameters
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added


class CueParameters(Parameters):
    """Parameters of cues."""

    tentative: bool = Field(
        default=True, description="Whether tentative tracks cue too; else only confirmed ones."
    )
    sigmas: float = Field(
        default=3.0, gt=0, le=10,
        description="Half angle of a cone in standard deviations of the track across the line of "
        "sight, at the end of the time for which it counts.",
    )  # fmt: skip
    least_half_angle_deg: float = Field(
        default=1.0, gt=0, le=90, description="No cone is narrower, deg."
    )
    most_half_angle_deg: float = Field(
        default=15.0,
        gt=0,
        le=180,
        description="A track that would take a wider cone cues none, deg.",
    )
    lasts_s: float = Field(
        default=2.0, gt=0,
        description="How long after the instant of its track a cone counts, s.",
    )  # fmt: skip
    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration by which a cone widens over that time, "
        "m²/s³.",
    )  # fmt: skip
    every_s: NonNegativeRational = Field(
        default=Fraction(1, 2), description="Least time from one message of cues to the next, s."
    )

    @model_validator(mode="after")
    def _check_cone_angles(self) -> Any:
        if self.least_half_angle_deg > self.most_half_angle_deg:
            raise ValueError(
                f"least_half_angle_deg is {self.least_half_angle_deg:g}: it must be at most "
                f"most_half_angle_deg, {self.most_half_angle_deg:g}"
            )
        return self


class Cues(Component):
    """Sends sensors the cones in which tracked targets are expected.

    Each cone comes with the state of its track, so that a sensor carries it on to its own scan.
    While there is no cone, and the last message had none, no message is sent.
    """

    mark = TRACKER
    inputs = {"tracks": Input(StateTracks, "trigger", "What a tracker holds.")}
    outputs = {"cues": Output(CueCones, "Where to look more closely.")}
    Parameters = CueParameters
    remembers = ("_last_tick", "_silent", "_wide")
    windowed = True
    lockstep = True
    rewindable = True

    def setup(self) -> None:
        """Start with no cones sent."""
        self._every_ticks = math.ceil(self.p.every_s * self.context.ticks_per_s)
        #: Of each run, when cues were sent last, and whether there were none.
        self._last_tick: IntArray = np.empty(0, dtype=np.int64)
        self._silent: BoolArray = np.empty(0, dtype=bool)
        #: Tracks whose cone would be too wide, of how many.
        self._wide = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return the number of tracks per run that were too uncertain to send a cone for."""
        what = f"a track's cone is wider than most_half_angle_deg ({self.p.most_half_angle_deg:g})"
        return {f"{what} and cues none": self._wide}

    def run(self, wake: Wake) -> CueCones | None:
        """Send the cones of the tracks at every instant at which they are due."""
        tracks = wake["tracks"]
        if tracks is None:
            return None
        row, entry, half_rad = self._cueing_tracks(tracks)
        rows = self._due_rows(wake, np.bincount(row, minlength=len(tracks)) > 0)
        if not len(rows):
            return None
        due = np.isin(row, rows)
        return self._message(wake, tracks, rows, row[due], entry[due], half_rad[due])

    def _due_rows(self, wake: Wake, some: BoolArray) -> IntArray:
        """Return the wake rows at which cues are sent; `some` is True at rows with a cone."""
        run, tick = wake.run, wake.ticks
        more = max(int(run[-1]) + 1 - len(self._silent), 0)
        if more:
            self._last_tick = np.append(self._last_tick, np.full(more, -self._every_ticks))
            self._silent = np.append(self._silent, np.ones(more, dtype=bool))
        due = np.zeros(len(tick), dtype=bool)
        for rows in indices_by_occurrence(run):
            of = run[rows]
            now = (tick[rows] - self._last_tick[of] >= self._every_ticks) & (
                some[rows] | ~self._silent[of]
            )
            due[rows] = now
            self._last_tick[of[now]] = tick[rows[now]]
            self._silent[of[now]] = ~some[rows[now]]
        return np.flatnonzero(due)

    def _cueing_tracks(self, tracks: StateTracks) -> tuple[IntArray, IntArray, FloatArray]:
        """Return message row, entry and cone half angle (rad) of tracks certain enough for cues."""
        wanted = tracks.track_status != DELETED
        if not self.p.tentative:
            wanted &= tracks.track_status != TENTATIVE
        entry = np.flatnonzero(wanted)
        lasts_s = self.p.lasts_s
        state = np.stack([getattr(tracks, name)[entry] for name in STATE])
        covariance = covariance_matrices(tracks.covariance, entry)
        across = lasts_s * (covariance[:3, 3:] + covariance[3:, :3])
        spread = covariance[:3, :3] + across + lasts_s**2 * covariance[3:, 3:]
        for i in range(3):
            spread[i, i] += self.p.acceleration_intensity_m2_s3 * lasts_s**3 / 3.0
        own = np.stack([getattr(tracks, name)[entry] for name in OWN_POSITION])
        axes = np.repeat(np.eye(3)[:, :, np.newaxis], len(entry), axis=2)
        half = cone_half_angle_rad(state[:3], spread, SensorPose(own, axes), self.p.sigmas)
        level = np.cos(tracks.elevation_rad[entry])
        angular = np.maximum(
            tracks.azimuth_variance_rad2[entry] * level * level,
            tracks.elevation_variance_rad2[entry],
        )
        half = np.where(tracks.has_range[entry], half, self.p.sigmas * np.sqrt(angular))
        half = np.maximum(half, math.radians(self.p.least_half_angle_deg))
        kept = half <= math.radians(self.p.most_half_angle_deg)
        row = tracks.row_of_entries[entry]
        run = tracks.run[row]
        self._wide = counts_with_cases_added(self._wide, run[~kept], run)
        return row[kept], entry[kept], half[kept]

    def _message(
        self,
        wake: Wake,
        tracks: StateTracks,
        rows: IntArray,
        row: IntArray,
        entry: IntArray,
        half_rad: FloatArray,
    ) -> CueCones:
        names = ("track", "azimuth_rad", "elevation_rad", "has_range", "state_s", *STATE, *ORIGIN)
        return CueCones(
            tick=wake.ticks[rows],
            run=wake.run[rows],
            offsets=offsets_from_entry_rows(np.searchsorted(rows, row), len(rows)),
            half_angle_rad=half_rad,
            until_s=tracks.state_s[entry] + self.p.lasts_s,
            **{name: getattr(tracks, name)[entry] for name in names},
        )
