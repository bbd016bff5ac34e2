"""A stand-in for a tracker: it holds the last fused measurement (``tracking.stub``)."""

from typing import Any

import numpy as np
from pydantic import Field

from components.messages.columns import POSE
from components.messages.detections import sensor_offers
from components.messages.false_detections import true_entries
from components.messages.fused import WITHOUT_POSE, FusedDetections, FusedWithPose
from components.messages.tracks import Tracks, TracksWithPose
from components.navigation.errors import navigation_errs
from components.sensor.marks import TRACKER
from components.tracking.reported_errors import unknown_latency
from dsa_des.arrays.entries import cells_of
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.message import Message, offsets_of
from dsa_des.block.wake import Wake

_HELD = ("azimuth_rad", "elevation_rad", "range_m", "contributors", "measured_tick")


class StubParameters(Parameters):
    """Parameters of the tracker stub."""

    drop_after_s: float | None = Field(
        default=None,
        gt=0,
        description="Age at which a held measurement is dropped, from when it was made, s.",
    )


class TrackerStub(Component):
    """Holds the last fused measurement of each target, its age, and which sensors gave it.

    Tracks are sent at every instant at which at least one target was updated: that is when the
    measurement has come. Ages count from when it was made, however long it was on its way. Of a
    target's measurements the last one to come is held. A false alarm belongs to no target and is
    left out: a stub does not start tracks.
    """

    mark = TRACKER
    inputs = {"fused": Input(FusedDetections, "trigger", "Fused lines of sight.")}
    outputs = {"tracks": Output(Tracks, "What is held of every target.")}
    also_records = (TracksWithPose,)
    Parameters = StubParameters
    windowed = True
    lockstep = True
    rewindable = True

    def request(self, port: str) -> str:
        """Ask for what is held: the pose is not."""
        return WITHOUT_POSE

    def records(self) -> list[type[Message]]:
        """Return what is recorded: where navigation errs, with the pose believed then."""
        return [TracksWithPose] if navigation_errs(self.context) else [*super().records()]

    def setup(self) -> None:
        """Start with no tracks."""
        types: dict[str, type] = {"replica": int, "target": int, **dict.fromkeys(_HELD, float)}
        #: What each run holds of each target.
        self._held = KeyedTable.empty(types)

    def warnings(self) -> list[str]:
        """Say whose measurements lie behind their targets."""
        return super().warnings() + unknown_latency(sensor_offers(self.context.producers))

    def run(self, wake: Wake) -> Tracks | None:
        """Take in new measurements and report what is held."""
        fused = wake["fused"]
        if fused is None:
            return None
        fused = true_entries(fused)
        counts = fused.offsets[1:] - fused.offsets[:-1]
        updated = counts.nonzero()[0]
        if len(updated) == 0:
            return None
        counts = counts.take(updated)
        rows = np.repeat(np.arange(len(updated)), counts)
        replica = wake.run.take(updated)
        begins = np.concatenate(([True], replica[1:] != replica[:-1]))
        before = self._held.of(replica[begins])
        targets, column = _present(before.target, fused.target, len(fused.roster))
        pool, held, new = _pool(before, fused, replica.take(rows))
        last = np.full((len(updated), len(targets)), -1, dtype=np.int64)
        if len(held):
            first_row = begins.nonzero()[0][np.searchsorted(replica[begins], before.replica)]
            last[first_row, column.take(before.target)] = held
        last[rows, column.take(fused.target)] = new
        last = np.maximum.accumulate(last, axis=0)
        first = new.take(np.cumsum(counts) - counts)
        if replica[0] != replica[-1]:
            # What each row holds of replicas before its own is not its own's.
            own_from = first.copy()
            np.minimum.at(own_from, np.searchsorted(replica, before.replica), held)
            own_from = np.maximum.accumulate(np.where(begins, own_from, 0))
            last[last < own_from[:, np.newaxis]] = -1
        ends = np.append(replica[1:] != replica[:-1], True).nonzero()[0]
        row, at = cells_of(last[ends] >= 0)
        entry = last[ends][row, at]
        now = {name: values[entry] for name, values in pool.items()}
        table = KeyedTable(replica=replica[ends][row], target=targets[at], **now)
        self._held = self._held.after(replica[begins], table, wake.first_run)
        return self._tracks(fused, wake.instants.part(updated), targets, last, pool, first)

    def _tracks(
        self,
        fused: FusedDetections,
        instants: RunTicks,
        targets: IntArray,
        last: IntArray,
        pool: dict[str, Any],
        first: IntArray,
    ) -> Tracks:
        """Return the tracks of each row; `first` is the first of its own entries in the pool."""
        row, column = cells_of(last >= 0)
        entry = last.ravel().take(row * len(targets) + column)
        measured = pool["measured_tick"].take(entry)
        # A sweeping beam measures after its scan has begun, which is when its report is sent.
        age_s: FloatArray = (
            np.maximum(instants.tick.take(row) - measured, 0) / self.context.ticks_per_s
        )
        if self.p.drop_after_s is not None:
            kept = age_s < self.p.drop_after_s
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
            offsets=offsets_of(row, len(instants)),
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


def _pool(
    before: KeyedTable, fused: FusedDetections, replica: IntArray
) -> tuple[dict[str, Any], IntArray, IntArray]:
    """Return everything that may be held, and the places in it of what was and what is new.

    What was held comes before what is new of the same replica.
    """
    new: dict[str, Any] = {name: getattr(fused, name) for name in _HELD}
    if isinstance(fused, FusedWithPose):
        new |= fused.pose_columns()
    start, count = len(before), len(replica)
    if start == 0:
        return new, before.replica, np.arange(count)
    pool = {name: np.concatenate([before.columns[name], new[name]]) for name in new}
    if replica[0] == replica[-1]:
        return pool, np.arange(start), np.arange(start, start + count)
    order = np.argsort(np.concatenate([before.replica, replica]), kind="stable")
    index = np.empty(start + count, dtype=np.int64)
    index[order] = np.arange(start + count)
    return {name: v[order] for name, v in pool.items()}, index[:start], index[start:]


def _present(held: IntArray, new: IntArray, targets: int) -> tuple[IntArray, IntArray]:
    """Return the targets that are held or newly measured, ascending, and each one's column."""
    there = np.zeros(targets, dtype=bool)
    there[held] = True
    there[new] = True
    return there.nonzero()[0], np.cumsum(there) - 1
