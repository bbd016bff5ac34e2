"""The tracks of several trackers made one (``fusion.covariance_intersection``)."""

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from components.estimation.motion import ConstantVelocity
from components.messages.columns import ORIGIN, POSITION
from components.messages.detections import SensorOffer, offers_of_fused_sensors
from components.messages.state_tracks import DELETED, StateTracks
from components.sensor.palette import FUSION
from components.track_fusion.fused_tracks import (
    empty_fused_tracks,
    fuse_states,
    fused_tracks_to_report,
    state_tracks_message,
)
from components.track_fusion.local_tracks import (
    LocalTracks,
    initial_records,
    local_tracks_and_rows,
    records_with_newest_instants,
)
from components.track_fusion.track_association import (
    MatchRules,
    assign_fused_numbers,
    leader_indices,
    reset_numbers_of_strays,
)
from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence
from dsa_des.arrays.run_ticks import last_position_at_or_before
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.failure_counts import Tries, has_two_bits

# Fused tracks by number: as many as are compared.
_TRACKS = 64


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return fused tracks' positions (rows, tracks, 3), standard deviations (rows, tracks), m."""
    position = np.full((len(wake), _TRACKS, 3), np.nan)
    spread = np.full((len(wake), _TRACKS), np.nan)
    reported: Any = block.run(wake)
    if reported is not None:
        row = np.repeat(np.searchsorted(wake.ticks, reported.tick), np.diff(reported.offsets))
        mine = np.flatnonzero(reported.has_range & (reported.track <= _TRACKS))
        index = row[mine], reported.track[mine] - 1
        position[index] = np.stack([getattr(reported, name)[mine] for name in POSITION], axis=-1)
        variance = sum(reported.covariance[f"covariance_{i}{i}_m2"][mine] for i in range(3))
        spread[index] = np.sqrt(np.asarray(variance))
    return {"position": position, "spread": spread}


def _distance(values: AnyArray, reference: AnyArray) -> FloatArray:
    return np.asarray(np.sqrt(((values - reference) ** 2).sum(axis=-1)))


RULE = Ladder(
    "rule",
    (
        Rung("independent", "information added, as if errors had nothing in common",
             parameters={"rule": "independent"}),
        Rung("trace", "covariance intersection, least trace of the position",
             parameters={"rule": "trace"}),
        Rung("determinant", "covariance intersection, least determinant",
             parameters={"rule": "determinant"}),
    ),
    "determinant",
    (Quantity("position", "m", _distance), Quantity("spread", "m")),
    measure,
)  # fmt: skip


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


class CovarianceIntersection(Component):
    """Fuses the tracks that several trackers have of one target into one track.

    Which tracks are of one target is decided by what they say of it. Fused tracks bear numbers of
    their own, in a frame of their own: that of the first track to come. What is known of a target
    is brought to the instant of the newest report, and combined without knowing how the trackers'
    errors hang together (`components.estimation.covariance_intersection`). A track without a range
    adds its direction to one that has it, unless that may be of the platform itself, which another
    one sees. Fused tracks are seen from where the trackers on board are, if there are any.
    """

    mark = FUSION
    inputs = {
        "tracks": Input(
            StateTracks, "trigger", "What the trackers hold.", many=True, between_platforms=True
        )
    }
    outputs = {"tracks": Output(StateTracks, "One track of each target.")}
    Parameters = IntersectionParameters
    remembers = ("_records", "_newest", "_local", "_reported", "_tries")
    windowed = True
    lockstep = True
    rewindable = True
    ladders = (RULE,)

    def setup(self) -> None:
        """Start with no tracks, and learn which trackers send them."""
        on = {producer.block: producer.platform for producer in self.context.producers}
        self.trackers = tuple(sorted(on))
        here = np.array([on[name] == self.context.platform for name in self.trackers])
        self._on_board = here if here.any() else ~here
        offers = offers_of_fused_sensors(self.context.producers)
        ranged = {n for n, o in offers.items() if isinstance(o, SensorOffer) and o.measures_range}
        self.sensors = tuple(sorted(offers, key=lambda name: (name not in ranged, name)))
        self._rules = MatchRules(
            self.p.gate_probability,
            ConstantVelocity(self.p.acceleration_intensity_m2_s3),
            math.radians(self.p.bearing_rate_deg_s),
            self.p.stay_factor,
            None if self._on_board.all() else tuple(on[name] for name in self.trackers),
        )
        self._records = initial_records(np.empty(0, dtype=np.int64))
        #: By tracker: of each replica, the newest instant that it reported of.
        self._newest: dict[str, IntArray] = {}
        self._local = LocalTracks.empty_table()
        self._reported = empty_fused_tracks()
        self._tries = Tries()

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message, the runs in which two trackers had tracks but none were fused."""
        return self._tries.failure_counts(
            "two trackers or more have tracks, and it never puts two of them together", of_two=True
        )

    def offer(self, port: str) -> Any:
        """Return the offers of all sensors behind the trackers, by sensor name."""
        return offers_of_fused_sensors(self.context.producers)

    def run(self, wake: Wake) -> StateTracks | None:
        """Process the trackers' reports in order of time, and return the fused tracks."""
        came = {
            new.source: self._select_newest_reports(new, wake) for new in wake.arrivals("tracks")
        }
        row_of = {
            name: last_position_at_or_before(wake.instants, new.instants)
            for name, new in came.items()
        }
        rows = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *row_of.values()]))
        if len(rows) == 0:
            return None
        replica = wake.run[rows]
        records = self._records_of_replicas(np.unique(replica), came, row_of, wake)
        new, reported_at = self._reported_tracks_and_rows(wake, came, row_of, records)
        local, reported = (
            self._local.rows_of_runs(records.replica),
            self._reported.rows_of_runs(records.replica),
        )
        parts = []
        for at in indices_by_occurrence(replica):
            local, records = self._update_local_tracks(
                local, records, new.take(np.isin(new.row, rows[at])), reported_at, rows[at],
                replica[at],
            )  # fmt: skip
            fused = self._fuse_tracks(local, records, reported, rows[at], replica[at])
            parts.append(fused)
            kept = fused.take(fused.track_status != DELETED)
            reported = reported.replace_and_drop_earlier_runs(replica[at], kept, wake.first_run)
        runs, first = records.replica, wake.first_run
        self._records = self._records.replace_and_drop_earlier_runs(runs, records, first)
        self._local = self._local.replace_and_drop_earlier_runs(runs, local, first)
        self._reported = self._reported.replace_and_drop_earlier_runs(runs, reported, first)
        return state_tracks_message(
            KeyedTable.concatenate(parts), rows, wake.instants.take(rows), self.sensors
        )

    def _select_newest_reports(self, new: Arrivals, wake: Wake) -> Arrivals:
        """Return the reports to use: each tracker's last per instant, and none out of order."""
        made, replica = new.message.tick, new.message.run
        newest = self._newest.get(new.source, np.empty(0, dtype=np.int64))
        more = max(int(replica[-1]) + 1 - len(newest), 0)
        newest = np.append(newest, np.full(more, np.iinfo(np.int64).min))
        so_far = np.maximum(new.message.instants.running_largest_tick().tick, newest[replica])
        kept = made >= so_far
        next_ = (new.tick[1:] == new.tick[:-1]) & (replica[1:] == replica[:-1])
        kept[:-1] &= ~(next_ & kept[1:])
        ends = new.instants.last_position_of_runs
        newest[replica[ends]] = so_far[ends]
        self._newest = {**self._newest, new.source: newest}
        which = np.flatnonzero(kept)
        return Arrivals(new.source, new.instants.take(which), new.message.take(which))

    def _records_of_replicas(
        self, replicas: IntArray, came: dict[str, Arrivals], row_of: dict[str, IntArray], wake: Wake
    ) -> KeyedTable:
        """Return the replicas' records; a new one's frame has its first track's origin."""
        records = initial_records(replicas)
        first = np.full(len(replicas), np.iinfo(np.int64).max)
        for name in sorted(came):
            message = came[name].message
            row = np.repeat(row_of[name], np.diff(message.offsets))
            of, entries = np.unique(np.searchsorted(replicas, wake.run[row]), return_index=True)
            sooner = row[entries] < first[of]
            of, entries = of[sooner], entries[sooner]
            first[of] = row[entries]
            records.origin[:, of] = [getattr(message, column)[entries] for column in ORIGIN]
        kept = self._records.kept_rows_or_new(records)
        return kept.with_columns(
            origin=np.where(np.isnan(kept.origin[0]), records.origin, kept.origin)
        )

    def _reported_tracks_and_rows(
        self,
        wake: Wake,
        came: dict[str, Arrivals],
        row_of: dict[str, IntArray],
        records: KeyedTable,
    ) -> tuple[LocalTracks, list[IntArray]]:
        """Return all tracks reported in this wake, their rows, and each tracker's report rows."""
        parts = []
        reported_at = [np.empty(0, dtype=np.int64) for _ in self.trackers]
        for name, row in row_of.items():
            message, replica = came[name].message, wake.run[row]
            index = self.trackers.index(name)
            origin = records.origin[:, np.searchsorted(records.replica, replica)]
            masks = self._sensor_bits(message.sensors)
            came_now, of = local_tracks_and_rows(
                message, replica, index, origin, masks, self.p.tentative
            )
            parts.append(came_now.with_columns(row=row[of]))
            reported_at[index] = row
        return LocalTracks.concatenate(parts), reported_at

    def _sensor_bits(self, sensors: Sequence[str]) -> list[int]:
        """Return sensors' bits, as integers, in masks over all sensors; unknown ones are added."""
        unknown = [name for name in sensors if name not in self.sensors]
        self.sensors = (*self.sensors, *unknown)
        return [1 << self.sensors.index(name) for name in sensors]

    def _update_local_tracks(
        self,
        local: LocalTracks,
        records: KeyedTable,
        new: LocalTracks,
        reported_at: list[IntArray],
        at: IntArray,
        replica: IntArray,
    ) -> tuple[LocalTracks, KeyedTable]:
        """Return the trackers' tracks and the records after reports at one row per replica: old
        reports replaced, tracks matched anew.
        """
        new = new.with_fused_numbers_from(local)
        gone = np.zeros(len(local), dtype=bool)
        for index, rows in enumerate(reported_at):
            gone |= (local.tracker == index) & np.isin(local.replica, replica[np.isin(at, rows)])
        local = LocalTracks.concatenate([local.take(~gone), new])
        records = records_with_newest_instants(records, new, self._on_board)
        when = records.time_s[np.searchsorted(records.replica, local.replica)]
        now = np.isin(local.replica, replica)
        silent = now & (when - local.updated_s > self.p.drop_after_s)
        idle, busy, when = local.take(~now), local.take(now & ~silent), when[now & ~silent]
        if len(busy):
            busy = reset_numbers_of_strays(self._rules, busy, when)
            busy, next_number = assign_fused_numbers(
                self._rules, busy, when, len(self.trackers), records.next_number, records.replica
            )
            records = records.with_columns(next_number=next_number)
        return LocalTracks.concatenate([idle, busy]), records

    def _fuse_tracks(
        self,
        local: LocalTracks,
        records: KeyedTable,
        reported: KeyedTable,
        at: IntArray,
        replica: IntArray,
    ) -> KeyedTable:
        """Return the fused tracks to report for some replicas, those that ended as deleted."""
        mine = local.take(np.isin(local.replica, replica))
        if len(self.trackers) > 1:
            leader, of = leader_indices(mine)
            trackers = np.zeros(len(leader), dtype=np.int64)
            np.bitwise_or.at(trackers, of, np.int64(1) << mine.tracker)
            self._tries = self._tries.add_tries(
                mine.replica[leader], trackers, has_two_bits(trackers)
            )
        before = reported.rows_of_runs(replica)
        when = records.time_s[np.searchsorted(records.replica, mine.replica)]
        fused = fuse_states(mine, when, self._rules.motion, self.p.rule)
        of = np.searchsorted(records.replica, fused.replica)
        return fused_tracks_to_report(
            before, fused, mine, records.origin[:, of], records.own_m[:, of], replica, at
        )
