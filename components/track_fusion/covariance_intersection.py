"""The tracks of several trackers made one (``fusion.covariance_intersection``)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from components.estimation.motion import ConstantVelocity
from components.messages.detections import SensorOffer
from components.messages.state_tracks import DELETED, StateTracks
from components.sensor.marks import FUSION
from components.track_fusion.fused_states import fused_states
from components.track_fusion.heads import FusionHeads, later_heads
from components.track_fusion.ladder import RULE
from components.track_fusion.local_tracks import LocalTracks, local_tracks
from components.track_fusion.matching import MatchRules, matched, without_strays
from components.track_fusion.told_tracks import (
    Told,
    joined,
    nothing_told,
    state_tracks,
    taken,
    told_after,
)
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Arrivals, Wake

_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")


class IntersectionParameters(Parameters):
    """Parameters of the fusion of tracks."""

    rule: Literal["determinant", "trace", "independent"] = Field(
        default="determinant",
        description="What the weight of two estimates makes least: the determinant of the combined "
        "covariance, or the trace of its position. `independent` adds their information as if "
        "their errors had nothing in common (convex combination): too sure where they have.",
    )
    gate_probability: float = Field(
        default=0.997, gt=0, lt=1,
        description="Probability that tracks of one target from two trackers lie in one gate.",
    )  # fmt: skip
    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration with which a track is carried on to the "
        "instant of the newest, m²/s³.",
    )  # fmt: skip
    bearing_rate_deg_s: float = Field(
        default=1.0, ge=0,
        description="Standard deviation of the rate at which a line of sight without a range "
        "turns, deg/s; by it directions of two instants are compared.",
    )  # fmt: skip
    stay_factor: float = Field(
        default=2.0, ge=1,
        description="How many times as far as the gate a track may drift from the one that leads "
        "its fused track before it leaves.",
    )  # fmt: skip
    tentative: bool = Field(
        default=False, description="Whether tentative tracks take part; else only confirmed ones."
    )
    drop_after_s: float = Field(
        default=6.0, gt=0,
        description="Time without a measurement after which a tracker's track takes part no "
        "more, s.",
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Reports:
    """What came from the trackers in a wake, in the frames of the replicas.

    Parameters
    ----------
    tracks : LocalTracks
    row : (tracks,)
        Of the wake.
    told_at : list of (reports,)
        By tracker: the rows at which it told.
    """

    tracks: LocalTracks
    row: IntArray
    told_at: list[IntArray]


class CovarianceIntersection(Component):
    """Makes one track of those that several trackers have of a target.

    Whose tracks are of one target is told by what they say of it. Fused tracks bear numbers of
    their own, in a frame of their own: that of the first track to come. What is known of a target
    is brought to the instant of the newest report, and combined without knowing how the trackers'
    errors hang together (`components.estimation.covariance_intersection`). A track without a range
    adds its direction to one that has it.
    """

    mark = FUSION
    inputs = {"tracks": Input(StateTracks, "trigger", "What the trackers hold.", many=True)}
    outputs = {"tracks": Output(StateTracks, "One track of each target.")}
    Parameters = IntersectionParameters
    windowed = True
    lockstep = True
    rewindable = True
    ladders = (RULE,)

    def setup(self) -> None:
        """Start with no tracks, and learn who sends them."""
        self.trackers = tuple(sorted(producer.block for producer in self.context.producers))
        offers = self._offers()
        ranged = {n for n, o in offers.items() if isinstance(o, SensorOffer) and o.measures_range}
        self.sensors = tuple(sorted(offers, key=lambda name: (name not in ranged, name)))
        self._rules = MatchRules(
            self.p.gate_probability,
            ConstantVelocity(self.p.acceleration_intensity_m2_s3),
            math.radians(self.p.bearing_rate_deg_s),
            self.p.stay_factor,
        )
        none = np.empty(0, dtype=np.int64)
        self._heads = FusionHeads(none, np.empty((3, 0)), none, np.empty(0), np.empty((3, 0)))
        #: By tracker: of each replica, the newest instant that it told of.
        self._newest: dict[str, IntArray] = {}
        self._local = LocalTracks.none()
        self._told = nothing_told()

    def _offers(self) -> dict[str, Any]:
        offers: dict[str, Any] = {}
        for producer in self.context.producers:
            if isinstance(producer.offer, dict):
                offers |= producer.offer
        return offers

    def offer(self, port: str) -> Any:
        """Hand on what the sensors say of themselves, by name."""
        return self._offers()

    def run(self, wake: Wake) -> StateTracks | None:
        """Take in what the trackers told, instant by instant, and tell the fused tracks."""
        came = {new.source: self._fresh(new, wake) for new in wake.arrivals("tracks")}
        row_of = {name: np.searchsorted(wake.ticks, new.tick) for name, new in came.items()}
        rows = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *row_of.values()]))
        if len(rows) == 0:
            return None
        replica = wake.replica[rows]
        heads = self._heads_of(np.unique(replica), came, row_of, wake)
        reports = self._reports(wake, came, row_of, heads)
        local = self._local.take(np.isin(self._local.replica, heads.replica))
        told = taken(self._told, np.isin(self._told["replica"], heads.replica))
        parts = []
        turn_of = np.arange(len(rows)) - np.searchsorted(replica, replica)
        for turn in range(int(turn_of.max()) + 1):
            at = np.flatnonzero(turn_of == turn)
            local, heads = self._taken_in(local, heads, reports, rows[at], replica[at])
            new = self._tell(local, heads, told, rows[at], replica[at])
            parts.append(new)
            kept = taken(new, new["track_status"] != DELETED)
            told = joined([taken(told, ~np.isin(told["replica"], replica[at])), kept])
        self._remember(heads, local, told, wake)
        return state_tracks(joined(parts), rows, wake.ticks[rows], self.sensors)

    def _remember(self, heads: FusionHeads, local: LocalTracks, told: Told, wake: Wake) -> None:
        """Keep what is held of the replicas that may come again."""
        if wake.side_by_side:
            others = ~np.isin(self._local.replica, heads.replica)
            self._local = LocalTracks.joined([self._local.take(others), local])
            others = ~np.isin(self._told["replica"], heads.replica)
            self._told = joined([taken(self._told, others), told])
            self._heads = self._heads.kept_with(heads)
            return
        last = heads.replica[-1]
        self._heads = heads.take(heads.replica == last)
        self._local = local.take(local.replica == last)
        self._told = taken(told, told["replica"] == last)

    def _fresh(self, new: Arrivals, wake: Wake) -> Arrivals:
        """Return the reports that count: none that another one overtook, one at an instant."""
        made, replica = new.message.tick, wake.replica_of(new.tick)
        newest = self._newest.get(new.source, np.empty(0, dtype=np.int64))
        more = max(int(replica[-1]) + 1 - len(newest), 0)
        newest = np.append(newest, np.full(more, np.iinfo(np.int64).min))
        # Along the common line, nothing of one replica is newer than what is of the next.
        so_far = np.maximum(np.maximum.accumulate(made), newest[replica])
        kept = made >= so_far
        kept[:-1] &= ~((new.tick[1:] == new.tick[:-1]) & kept[1:])
        ends = np.append(replica[1:] != replica[:-1], True)
        newest[replica[ends]] = so_far[ends]
        self._newest = {**self._newest, new.source: newest}
        which = np.flatnonzero(kept)
        return Arrivals(new.source, new.tick[which], new.message.take(which))

    def _heads_of(
        self, replicas: IntArray, came: dict[str, Arrivals], row_of: dict[str, IntArray], wake: Wake
    ) -> FusionHeads:
        """Return what is kept of replicas; the frame of a new one is that of its first track."""
        count = len(replicas)
        heads = FusionHeads(
            replicas, np.full((3, count), np.nan), np.ones(count, dtype=np.int64),
            np.full(count, -np.inf), np.full((3, count), np.nan),
        )  # fmt: skip
        first = np.full(count, np.iinfo(np.int64).max)
        for name in sorted(came):
            message = came[name].message
            row = np.repeat(row_of[name], np.diff(message.offsets))
            of, entries = np.unique(np.searchsorted(replicas, wake.replica[row]), return_index=True)
            sooner = row[entries] < first[of]
            of, entries = of[sooner], entries[sooner]
            first[of] = row[entries]
            heads.origin[:, of] = [getattr(message, column)[entries] for column in _ORIGIN]
        old = self._heads.take(np.isin(self._heads.replica, replicas))
        here = np.searchsorted(replicas, old.replica)
        heads.next_number[here], heads.time_s[here] = old.next_number, old.time_s
        heads.own_m[:, here] = old.own_m
        begun = ~np.isnan(old.origin[0])
        heads.origin[:, here[begun]] = old.origin[:, begun]
        return heads

    def _reports(
        self, wake: Wake, came: dict[str, Arrivals], row_of: dict[str, IntArray], heads: FusionHeads
    ) -> _Reports:
        parts, rows = [], []
        told_at = [np.empty(0, dtype=np.int64) for _ in self.trackers]
        for name, row in row_of.items():
            message, replica = came[name].message, wake.replica[row]
            index = self.trackers.index(name)
            origin = heads.origin[:, np.searchsorted(heads.replica, replica)]
            masks = self._masks(message.sensors)
            found, of = local_tracks(message, replica, index, origin, masks, self.p.tentative)
            parts.append(found)
            rows.append(row[of])
            told_at[index] = row
        return _Reports(LocalTracks.joined(parts), np.concatenate(rows), told_at)

    def _masks(self, sensors: Sequence[str]) -> list[int]:
        """Return the bit of each of a tracker's sensors among all."""
        unknown = [name for name in sensors if name not in self.sensors]
        self.sensors = (*self.sensors, *unknown)
        return [1 << self.sensors.index(name) for name in sensors]

    def _taken_in(
        self,
        local: LocalTracks,
        heads: FusionHeads,
        reports: _Reports,
        at: IntArray,
        replica: IntArray,
    ) -> tuple[LocalTracks, FusionHeads]:
        """Return what trackers hold after the reports of some rows, one of each replica."""
        new = reports.tracks.take(np.isin(reports.row, at)).with_systems_of(local)
        gone = np.zeros(len(local), dtype=bool)
        for index, rows in enumerate(reports.told_at):
            gone |= (local.tracker == index) & np.isin(local.replica, replica[np.isin(at, rows)])
        local = LocalTracks.joined([local.take(~gone), new])
        heads = later_heads(heads, new)
        when = heads.time_s[np.searchsorted(heads.replica, local.replica)]
        now = np.isin(local.replica, replica)
        silent = now & (when - local.updated_s > self.p.drop_after_s)
        idle, busy, when = local.take(~now), local.take(now & ~silent), when[now & ~silent]
        if len(busy):
            busy = without_strays(self._rules, busy, when)
            busy, next_number = matched(
                self._rules, busy, when, len(self.trackers), heads.next_number, heads.replica
            )
            heads = replace(heads, next_number=next_number)
        return LocalTracks.joined([idle, busy]), heads

    def _tell(
        self, local: LocalTracks, heads: FusionHeads, told: Told, at: IntArray, replica: IntArray
    ) -> Told:
        """Return what is told of the replicas of some rows."""
        mine = local.take(np.isin(local.replica, replica))
        before = taken(told, np.isin(told["replica"], replica))
        when = heads.time_s[np.searchsorted(heads.replica, mine.replica)]
        found = fused_states(mine, when, self._rules.motion, self.p.rule)
        of = np.searchsorted(heads.replica, found.replica)
        return told_after(before, found, mine, heads.origin[:, of], heads.own_m[:, of], replica, at)
