"""A stand-in for a tracker: it holds the last fused measurement (``tracking.stub``)."""

from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from components.messages.columns import POSE
from components.messages.detections import SensorOffer, offers_of_fused_sensors
from components.messages.false_detections import without_false_alarms
from components.messages.fused import WITHOUT_POSE, FusedDetections, FusedWithPose
from components.messages.tracks import Tracks, TracksWithPose
from components.navigation.errors import has_navigation_errors
from components.sensor.palette import TRACKER
from components.tracking.reported_errors import folded_range_warnings, latency_warnings
from dsa_des.arrays.entries import rows_and_columns_of_true
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import take_runs
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.message import Message, offsets_from_entry_rows
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import Tries

#: How often what has grown too old is looked for, s.
_ACTS_EVERY_S = Fraction(1, 2)
_HELD = ("azimuth_rad", "elevation_rad", "range_m", "contributors", "measured_tick")


class StubParameters(Parameters):
    """Parameters of the tracker stub."""

    drop_after_s: float | None = Field(
        default=None,
        gt=0,
        description="Age at which a held measurement is dropped, from when it was made, s.",
    )


class TrackerStub(Component):
    """Keeps each target's last fused measurement, age and sensors; associates by true identity.

    Tracks are sent at every instant at which at least one target was updated, that is when the
    measurement has come, and within half a second of one being dropped, though nothing comes. Ages
    count from when it was made, however long it was on its way. Of a target's measurements the last
    one to come is held. A false alarm belongs to no target and is left out: a stub does not start
    tracks.
    """

    mark = TRACKER
    inputs = {"fused": Input(FusedDetections, "trigger", "Fused lines of sight.")}
    outputs = {"tracks": Output(Tracks, "What is held of every target.")}
    also_records = (TracksWithPose,)
    Parameters = StubParameters
    remembers = ("_held", "_tries", "_nothing")
    windowed = True
    lockstep = True
    rewindable = True

    def request(self, port: str) -> str:
        """Return a request for the held measurements, without the pose."""
        return WITHOUT_POSE

    def records(self) -> list[type[Message]]:
        """Return the message types to record; with the believed pose if navigation has errors."""
        return [TracksWithPose] if has_navigation_errors(self.context) else [*super().records()]

    def setup(self) -> None:
        """Start with no tracks."""
        types: dict[str, type] = {"replica": int, "target": int, **dict.fromkeys(_HELD, float)}
        #: A message without rows: who the targets and the sensors are.
        self._nothing: FusedDetections | None = None
        #: What each run holds of each target.
        self._held = KeyedTable.empty(types)
        self._tries = Tries()

    def offer(self, port: str) -> Any:
        """Return, by sensor name, a reduced offer: only whether the sensor measures range."""
        return {
            name: SensorOffer(one.measures_range, 0.0) if isinstance(one, SensorOffer) else None
            for name, one in offers_of_fused_sensors(self.context.producers).items()
        }

    def failure_counts(self) -> dict[str, IntArray]:
        """Return the runs in which only false alarms were received, keyed by message."""
        return self._tries.failure_counts("all that it gets are false alarms, and it holds nothing")

    def acts_every_s(self) -> Fraction | None:
        """Return the interval, s, of dropping too old measurements; None if never dropped."""
        return None if self.p.drop_after_s is None else _ACTS_EVERY_S

    def warnings(self) -> list[str]:
        """Return warnings for unknown latency or ambiguous ranges, which are taken as true."""
        offers = offers_of_fused_sensors(self.context.producers)
        return super().warnings() + latency_warnings(offers) + folded_range_warnings(offers)

    def run(self, wake: Wake) -> Tracks | None:
        """Process new measurements, and return the held tracks."""
        fused, counts = self._target_measurements(wake)
        if fused is None:
            return None
        updated = (counts if self.p.drop_after_s is None else counts + wake.idle).nonzero()[0]
        if len(updated) == 0:
            return None
        counts = counts.take(updated)
        rows = np.repeat(np.arange(len(updated)), counts)
        replica = wake.run.take(updated)
        begins = np.concatenate(([True], replica[1:] != replica[:-1]))
        before = self._held.rows_of_runs(replica[begins])
        targets, column = _present_targets_and_columns(
            before.target, fused.target, len(fused.roster)
        )
        pool, held, new = _pool_kept_and_new(before, fused, replica.take(rows))
        last = np.full((len(updated), len(targets)), -1, dtype=np.int64)
        if len(held):
            first_row = begins.nonzero()[0][np.searchsorted(replica[begins], before.replica)]
            last[first_row, column.take(before.target)] = held
        last[rows, column.take(fused.target)] = new
        last = np.maximum.accumulate(last, axis=0)
        first = np.append(new, len(pool["range_m"])).take(np.cumsum(counts) - counts)
        if replica[0] != replica[-1]:
            # What each row holds of replicas before its own is not its own's.
            own_from = first.copy()
            np.minimum.at(own_from, np.searchsorted(replica, before.replica), held)
            own_from = np.maximum.accumulate(np.where(begins, own_from, 0))
            last[last < own_from[:, np.newaxis]] = -1
        ends = np.append(replica[1:] != replica[:-1], True).nonzero()[0]
        row, at = rows_and_columns_of_true(last[ends] >= 0)
        entry = last[ends][row, at]
        now = {name: values[entry] for name, values in pool.items()}
        table = KeyedTable(replica=replica[ends][row], target=targets[at], **now)
        self._held = self._held.replace_and_drop_earlier_runs(
            replica[begins], table, wake.first_run
        )
        return self._tracks(fused, wake, updated, targets, last, pool, first)

    def _target_measurements(self, wake: Wake) -> tuple[FusedDetections | None, IntArray]:
        """Return received target measurements (or None), and numbers of fused entries per row."""
        busy = wake.without_idle()
        fused = self._nothing if busy is None else busy["fused"]
        counts = np.zeros(len(wake), dtype=np.int64)
        if fused is None:
            return None, counts
        if busy is not None and len(fused.target):
            run = take_runs(busy.run, fused.row_of_entries)
            self._tries = self._tries.add_tries(run, np.ones_like(run), fused.target >= 0)
        fused = without_false_alarms(fused)
        if self.p.drop_after_s is not None:
            self._nothing = fused.take(slice(0, 0))
        if busy is not None:
            counts[~wake.idle] = np.diff(fused.offsets)
        return fused, counts

    def _tracks(
        self,
        fused: FusedDetections,
        wake: Wake,
        rows: IntArray,
        targets: IntArray,
        last: IntArray,
        pool: dict[str, Any],
        first: IntArray,
    ) -> Tracks | None:
        """Return the tracks at rows of the wake, or None; `first` is each row's first new entry.

        At an idle row there are some where something has just grown too old.
        """
        instants = wake.instants.take_with_known_positions(rows)
        row, column = rows_and_columns_of_true(last >= 0)
        entry = last.ravel().take(row * len(targets) + column)
        measured = pool["measured_tick"].take(entry)
        # A sweeping beam measures after its scan has begun, which is when its report is sent.
        age_s: FloatArray = (
            np.maximum(instants.tick.take(row) - measured, 0) / self.context.ticks_per_s
        )
        if self.p.drop_after_s is not None:
            kept = age_s < self.p.drop_after_s
            shown = ~wake.idle[rows]
            shown[row[~kept & (age_s < self.p.drop_after_s + float(_ACTS_EVERY_S))]] = True
            if not shown.any():
                return None
            kept &= shown[row]
            instants, first = wake.instants.take_with_known_positions(rows[shown]), first[shown]
            row = (np.cumsum(shown) - 1)[row]
            row, column, entry, measured, age_s = (
                values[kept] for values in (row, column, entry, measured, age_s)
            )
        pose: dict[str, Any] = {}
        message: type[Tracks] = Tracks
        if isinstance(fused, FusedWithPose):
            message, pose = TracksWithPose, {n: pool[n][entry] for n in POSE}
        tracks = message(
            tick=instants.tick,
            run=instants.run,
            offsets=offsets_from_entry_rows(row, len(instants)),
            target=targets.take(column),
            azimuth_rad=pool["azimuth_rad"].take(entry),
            elevation_rad=pool["elevation_rad"].take(entry),
            range_m=pool["range_m"].take(entry),
            age_s=age_s,
            contributors=pool["contributors"].take(entry),
            roster=fused.roster,
            sensors=fused.sensors,
            measured_tick=measured,
            ticks_per_s=self.context.ticks_per_s,
            updated=entry >= first.take(row),
            **({"own_of_entries": pose} if pose else {}),
        )
        tracks.instants, tracks.row_of_entries = instants, row
        return tracks


def _pool_kept_and_new(
    before: KeyedTable, fused: FusedDetections, replica: IntArray
) -> tuple[dict[str, Any], IntArray, IntArray]:
    """Return kept and new measurements' columns together, and the positions in them of each.

    What was held comes before what is new of the same replica.
    """
    new: dict[str, Any] = {name: getattr(fused, name) for name in _HELD}
    if isinstance(fused, FusedWithPose):
        new |= fused.pose_columns()
    start, count = len(before), len(replica)
    if start == 0:
        return new, before.replica, np.arange(count)
    pool = {name: np.concatenate([before.columns[name], new[name]]) for name in new}
    alike = count == 0 or bool(before.replica[0] == before.replica[-1] == replica[0] == replica[-1])
    if alike:
        return pool, np.arange(start), np.arange(start, start + count)
    order = np.argsort(np.concatenate([before.replica, replica]), kind="stable")
    index = np.empty(start + count, dtype=np.int64)
    index[order] = np.arange(start + count)
    return {name: v[order] for name, v in pool.items()}, index[:start], index[start:]


def _present_targets_and_columns(
    held: IntArray, new: IntArray, targets: int
) -> tuple[IntArray, IntArray]:
    """Return targets with a kept or new measurement, ascending, and each target's column there."""
    there = np.zeros(targets, dtype=bool)
    there[held] = True
    there[new] = True
    return there.nonzero()[0], np.cumsum(there) - 1
