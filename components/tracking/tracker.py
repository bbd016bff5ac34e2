"""The base class of trackers that estimate states: parameters, memory, and the order of looks."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from components.estimation.batched import select_tracks
from components.estimation.estimator import Estimator, ExtendedKalmanFilter
from components.estimation.frame import pose_in_frame
from components.estimation.motion import ConstantVelocity
from components.messages.detections import SensorOffer, offers_of_fused_sensors
from components.messages.fused import FusedDetections
from components.messages.state_tracks import CONFIRMED, DELETED, StateTracks
from components.sensor.palette import TRACKER
from components.tracking.association import ASSOCIATIONS, Association
from components.tracking.due_detections import ACTS_EVERY_S, Silence
from components.tracking.ladder import LADDERS
from components.tracking.out_of_sequence import (
    LookCount,
    Past,
    Plan,
    Snapshot,
    late_look_shares,
    late_looks_warning,
    max_lateness_s,
    may_come_late,
    plan_with_late_looks,
    plan_without_late_looks,
    tracks_before,
)
from components.tracking.reported_errors import (
    coarse_bearing_warnings,
    folded_range_warnings,
    latency_warnings,
    sensors_by_told_error,
)
from components.tracking.rules import TrackerParameters, TrackerRules, why_range_rates_unused
from components.tracking.scans import LookBatch, Scans, looks_of_message, split_due_looks
from components.tracking.step import tracks_after_late_looks, tracks_after_looks
from components.tracking.track_store import (
    TrackStore,
    initial_records,
    state_tracks_message,
    tracks_to_report,
)
from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.ladder import Verified
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import Tries

_NO_ROWS = np.empty(0, dtype=np.int64)
#: Bits of a mask of sensors.
MOST_SENSORS = 62
# What makes a measured quantity exact, by the variance that then is 0.
_EXACT = {
    "azimuth_variance_rad2": "azimuth_resolution_deg",
    "elevation_variance_rad2": "elevation_resolution_deg",
    "range_variance_m2": "range_resolution_m",
}


class Tracker(Component):
    """Estimates where targets are and how they move, from measured values alone.

    Tracks bear numbers of their own. Every look of every sensor is processed at its own instant;
    tracks are reported at every instant at which something came, and when one ends because nothing
    does. States are in a fixed frame: north, east, down where the ownship believed to be at the
    first look (`StateTracks`).
    """

    mark = TRACKER
    inputs = {"fused": Input(FusedDetections, "trigger", "What was measured.")}
    outputs = {"tracks": Output(StateTracks, "Estimated tracks.")}
    Parameters = TrackerParameters
    remembers = ("_store", "_records", "_past", "_ahead", "_count", "_early", "_tries", "_sensors")
    windowed = True
    lockstep = True
    rewindable = True
    least_width = 32  # a track's look takes some kB until its window ends
    ladders = LADDERS
    verified = (
        Verified("estimates and covariances, update by update", "Stone Soup 1.9.1, frozen results",
                 "1e-10 of the value", "tests/estimation/test_filters_agree.py"),
        Verified("normalised error squared of its tracks", "chi-square, 6 degrees of freedom",
                 "bounds of the mean, 99.9 %", "tests/tracking/test_covariances_are_honest.py"),
    )  # fmt: skip

    def estimator(self) -> Estimator:
        """Return the filter; a subclass may give another."""
        return ExtendedKalmanFilter(ConstantVelocity(self.p.acceleration_intensity_m2_s3))

    def association(self) -> Association:
        """Return the method that assigns detections to tracks; a subclass may return another."""
        return ASSOCIATIONS[self.p.association]

    def setup(self) -> None:
        """Start with no tracks."""
        offers = offers_of_fused_sensors(self.context.producers)
        if len(offers) > MOST_SENSORS:
            raise ValueError(
                f"a tracker takes at most {MOST_SENSORS} sensors, and {len(offers)} lead to it: "
                "let several trackers share them"
            )
        for name, offer in sorted(offers.items()):
            for column, key in _EXACT.items():
                if isinstance(offer, SensorOffer) and getattr(offer, column) == 0.0:
                    quantity = key.rpartition("_")[0].replace("_resolution", "")
                    raise ValueError(
                        f"{name} measures its {quantity} exactly (the {column} of its detections "
                        "is 0), and a tracker weighs measurements by their variances: they must "
                        f"be above 0, by a grid (blocks.{name}.{key}) or by errors = 'stated'"
                    )
        self.rules: TrackerRules | None = None
        self._association = self.association()
        self._estimator = self.estimator()
        if errors := sensors_by_told_error(offers):
            self._estimator = self._estimator.carrying(tuple(one.lasts_s for one, _ in errors))
        self._sensors: tuple[str, ...] = ()
        self._store = self._empty_store(0)
        self._records = initial_records(np.empty(0, dtype=np.int64), np.empty((3, 0)))
        self._past: Past | None = None
        self._ahead: Scans | None = None
        self._lag_ticks = int(self._lag_s() * self.context.ticks_per_s)
        producers = self.context.producers
        self._late_ticks = int(max_lateness_s(offers, producers) * self.context.ticks_per_s)
        # Where nothing can come late there is nothing to remember, whatever `late` says.
        self._remembers = may_come_late(offers, self.context.producers)
        self._count, self._early = LookCount(), 0
        self._tries = Tries()

    def adopt_state(self, before: Any) -> None:
        """Go on with another instance's tracks; ValueError if its states have another size."""
        super().adopt_state(before)
        kept, now = ([m.size for m in one._estimator.models] for one in (before, self))
        if kept != now:
            raise ValueError(
                "its sensors' errors last otherwise from now on, which its tracks have no states "
                "for: change what is new at every look"
            )
        if before.rules is not None:
            self.rules = self._rules_for(self._sensors)
        self._remembers = self._remembers or before._remembers

    def _rules_for(self, sensors: tuple[str, ...]) -> TrackerRules:
        offers, per_s = offers_of_fused_sensors(self.context.producers), self.context.ticks_per_s
        return TrackerRules.of(self.p, self._estimator, offers, sensors, per_s)

    def acts_every_s(self) -> Fraction | None:
        """Return the interval, s, of checking for tracks to end for lack of detections."""
        return ACTS_EVERY_S

    def _lag_s(self) -> Fraction:
        if self.p.lag_s is not None:
            return Fraction(self.p.lag_s)
        producers = self.context.producers
        return max(Fraction(1), max_lateness_s(offers_of_fused_sensors(producers), producers))

    def warnings(self) -> list[str]:
        """Return warnings on looks that may be too late and on unmodelled sensor errors."""
        lag_s, why = self._lag_s(), f"lag_s is {float(self._lag_s()):g}"
        if self.p.late == "drop":
            lag_s, why = Fraction(0), "late is 'drop'"
        offers = offers_of_fused_sensors(self.context.producers)
        shares = late_look_shares(offers, lag_s, self.context.duration_s)
        result = [late_looks_warning(n, share, why) for n, share in shares.items()]
        for name, offer in sorted(offers.items()):
            if not isinstance(offer, SensorOffer) or offer.lasting is None:
                result.append(
                    f"{name} does not say what of its errors lasts from look to look "
                    "(SensorOffer.lasting): all are taken for new, and tracks are too sure where "
                    "they are not"
                )
        if not self._estimator.error_count:
            result += latency_warnings(offers)
        return (
            super().warnings()
            + result
            + coarse_bearing_warnings(offers)
            + folded_range_warnings(offers)
        )

    def offer(self, port: str) -> Any:
        """Return the sensors' offers by name, as measuring range if passive ranging gives it."""
        offers = offers_of_fused_sensors(self.context.producers)
        if self.p.passive_range_share is None:
            return offers
        return {
            name: replace(one, measures_range=True) if isinstance(one, SensorOffer) else one
            for name, one in offers.items()
        }

    def failure_counts(self) -> dict[str, IntArray]:
        """Return late looks by sensor, and runs with detections but no confirmed track."""
        return self._count.failure_counts() | self._tries.failure_counts(
            "detections came, and no track was ever confirmed"
        )

    def skipped_work_notes(self) -> list[str]:
        """Return a sentence for each sensor whose range rates are not used, with the reason."""
        offers = offers_of_fused_sensors(self.context.producers)
        return [
            f"range rates of {name}: {why}"
            for name, offer in sorted(offers.items())
            if isinstance(offer, SensorOffer)
            and offer.measures_range_rate
            and (why := why_range_rates_unused(self.p, offer))
        ]

    def _empty_store(self, sensors: int) -> TrackStore:
        return TrackStore.empty_of_models([model.size for model in self._estimator.models], sensors)

    def run(self, wake: Wake) -> StateTracks | None:
        """Process looks by time, delete tracks without detections, and return all tracks."""
        busy = wake.without_idle()
        reported, worked = list[TrackStore](), _NO_ROWS
        if busy is not None:
            reported, worked = self._process_looks(busy, wake)
        silence = self._silence(wake, worked)
        if len(self._store) and len(silence):
            spans = silence.silent_rows_after_work(self._records.replica, self._records.worked_tick)
            self._store, more = silence.end_silent_tracks(self._store, self._records, *spans)
            reported += more
        rows = np.unique(np.concatenate([worked, *(part.row[:1] for part in reported)]))
        if len(rows) == 0:
            return None
        share, errors = self.p.passive_range_share, self._estimator.error_count
        return state_tracks_message(reported, rows, wake, self._sensors, share, errors)

    def _silence(self, wake: Wake, worked: IntArray) -> Silence:
        """Return the rows of the wake at which nothing is processed."""
        rows = np.delete(np.arange(len(wake)), worked)
        return Silence(wake.instants, rows, self._late_ticks, self.context.ticks_per_s)

    def _process_looks(self, busy: Wake, wake: Wake) -> tuple[list[TrackStore], IntArray]:
        """Process the looks; return tracks to report, and wake rows with processed looks.

        `busy` are the rows of the wake at which something came.
        """
        fused = busy["fused"]
        if fused is None:
            return [], _NO_ROWS
        if self.rules is None or fused.sensors != self._sensors:
            self._sensors = fused.sensors
            self.rules = self._rules_for(fused.sensors)
            self._store = self._empty_store(len(fused.sensors))
        came = looks_of_message(fused)
        self._early += int((came.tick > busy.ticks[came.row]).sum())
        scans, self._ahead = split_due_looks(came, self._ahead, busy)
        if len(scans) == 0:
            return [], _NO_ROWS
        records = self._records.kept_rows_or_new(initial_records(scans.run, scans.pose[:3]))
        store = self._store.take(self._store.replica >= wake.first_run)
        begin, before, waiting = 0, dict[int, Snapshot](), None
        if self._past is not None:
            past, waiting = self._past.split_runs(records.replica, wake.first_run)
            begin, before = len(past), dict(enumerate(past.before))
            scans = Scans.concatenate([past.scans, scans])
        of = np.searchsorted(records.replica, scans.run)
        kept: list[int] = []
        if not self._remembers:
            plan, left_out = plan_without_late_looks(scans, of, records.tick)
        else:
            plan, left_out, kept = plan_with_late_looks(
                scans, of, begin, self._lag_ticks, rerun=self.p.late == "rerun"
            )
        self._count = self._count.add_looks(fused.sensors, scans, slice(begin, None), left_out)
        moves = scans.velocity if self.rules.rates_of else None
        origin = select_tracks(records.origin, of)
        poses = pose_in_frame(origin, scans.pose[:3], scans.pose[3:], moves)
        codes = scans.detection_kind_codes(self.rules.rates_of, self.rules.carried is not None)
        turned = scans.rotate_velocities_to_frames(origin)
        reported: list[TrackStore] = []
        reports = plan.is_reported_after
        # The row of the wake that each work is of.
        row = plan.row if busy is wake else np.flatnonzero(~wake.idle)[plan.row]
        rows = np.unique(row)
        silence, first, last = self._silence(wake, rows), row, row - 1
        if len(silence):
            first, last = silence.silent_rows_before_work(row, records.worked_tick[plan.of])
        records.worked_tick[plan.of] = wake.ticks[row]
        # Tracks as last shown, of runs in a row that brings several works: one may end in between.
        shown_last, begins = store.take(_NO_ROWS), plan.begins_several
        for works in indices_by_occurrence(plan.of):
            if len(store) and bool((first[works] <= last[works]).any()):
                asked = records.take(plan.of[works])
                store, more = silence.end_silent_tracks(store, asked, first[works], last[works])
                reported += more
            if len(store) and len(some := works[begins[works]]):
                alive = store.status != DELETED
                alive &= np.isin(store.replica, records.replica[plan.of[some]])
                shown_last = TrackStore.concatenate([shown_last, store.take(alive)])
            late, works_now = works[plan.since[works] >= 0], works[plan.since[works] < 0]
            if len(late):
                of_late = plan.of[late]
                replicas = records.replica[of_late]
                old = tracks_before(before, plan.since[late].tolist(), replicas.tolist())
                store, records.next_number[of_late], gone = tracks_after_late_looks(
                    self.rules, self._association, store, old,
                    LookBatch.from_looks(turned, plan.look[late], replicas, codes, poses),
                    records.next_number[of_late], unless_updated=self.p.late == "drop",
                )  # fmt: skip
                too_late = plan.look[late[gone]]
                self._count = self._count.add_looks(fused.sensors, scans, slice(0), too_late)
            looks, mine = plan.look[works_now], plan.of[works_now]
            if self._remembers:
                store = self._restore_and_snapshot(store, records, plan, works_now, before)
            if len(looks):
                store, records.next_number[mine] = tracks_after_looks(
                    self.rules, self._association, store,
                    LookBatch.from_looks(turned, looks, records.replica[mine], codes, poses),
                    records.next_number[mine],
                )  # fmt: skip
                records.tick[mine] = scans.tick[looks]
            shown = works[reports[works]]
            if len(shown):
                records.own[:, plan.of[shown]] = poses.position_m[:, plan.seen_from[shown]]
            told = store
            if len(shown_last) and len(shown):
                of_shown = np.isin(shown_last.replica, records.replica[plan.of[shown]])
                told = store.append_deleted(shown_last.take(of_shown))
                shown_last = shown_last.take(~of_shown)
            if len(told) and len(shown):
                reported.append(tracks_to_report(told, records.take(plan.of[shown]), row[shown]))
        self._records = self._records.replace_and_drop_earlier_runs(
            records.replica, records, wake.first_run
        )
        self._store = store
        if self._remembers:
            self._past = Past.from_looks(scans, kept, before, waiting)
        self._count_detected_and_confirmed(came, reported)
        return reported, rows

    def _count_detected_and_confirmed(self, came: Scans, reported: list[TrackStore]) -> None:
        """Count runs in which a detection was received, and those with a confirmed track."""
        detected = came.run[np.diff(came.offsets) > 0]
        self._tries = self._tries.add_tries(
            detected, np.ones_like(detected), np.zeros(len(detected), dtype=bool)
        )
        for part in reported:
            sure = part.replica[part.status == CONFIRMED]
            self._tries = self._tries.add_tries(
                sure, np.ones_like(sure), np.ones(len(sure), dtype=bool)
            )

    def _restore_and_snapshot(
        self,
        store: TrackStore,
        records: KeyedTable,
        plan: Plan,
        works: IntArray,
        before: dict[int, Snapshot],
    ) -> TrackStore:
        """Return tracks, set back before late looks where planned; save a snapshot before each."""
        late = works[plan.back_to[works] >= 0]
        if len(late):
            of, back = plan.of[late], plan.back_to[late].tolist()
            replicas = records.replica[of]
            others = store.take(~np.isin(store.replica, replicas))
            old = tracks_before(before, back, replicas.tolist())
            store = TrackStore.concatenate([others, old]).sort()
            records.next_number[of] = [before[look].next_number for look in back]
        for work in works.tolist():
            number = int(records.next_number[plan.of[work]])
            before[int(plan.look[work])] = Snapshot(store, number)
            for look in plan.forgotten[work]:
                before.pop(look, None)
        return store

    def report(self) -> dict[str, Any]:
        """Return late looks by sensor, and how many looks arrived before they were made."""
        late = {self.name: self._count.late_look_statistics()}
        return {"late_looks": late, "early_looks": {self.name: self._early}}
