"""A stand-in for a tracker: it holds the last fused measurement (``tracking.stub``)."""

from typing import Any

import numpy as np
from pydantic import Field

from components.messages.detections import POSE
from components.messages.fused import WITHOUT_POSE, FusedDetections, FusedWithPose
from components.messages.tracks import Tracks, TracksWithPose
from components.messages.true_entries import true_entries
from components.navigation.effects import navigation_errs
from components.sensor.marks import TRACKER
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.message import Message, offsets_of
from dsa_des.block.ports import Input, Output
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
        return [TracksWithPose if navigation_errs(self.context) else Tracks]

    def setup(self) -> None:
        """Start with no tracks."""
        self._targets: IntArray = np.empty(0, dtype=np.int64)
        self._held: dict[str, Any] = {name: np.empty(0) for name in _HELD}
        self._replica = 0

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
        replica = wake.replica[updated]
        if replica[0] != self._replica:  # another run: nothing is held yet
            self._targets = self._targets[:0]
        self._replica = int(replica[-1])
        targets = _present(self._targets, fused.target, len(fused.roster))
        pool, start = self._pool(fused)
        last = np.full((len(updated) + 1, len(targets)), -1, dtype=np.int64)
        last[0, targets.searchsorted(self._targets)] = np.arange(start)
        rows: Any = 1
        if len(updated) > 1:
            rows = np.repeat(np.arange(1, len(updated) + 1), counts[updated])
        last[rows, targets.searchsorted(fused.target)] = np.arange(start, start + len(fused.target))
        last = np.maximum.accumulate(last, axis=0)
        if replica[0] != replica[-1]:
            _forget_other_replicas(last, replica, start, counts[updated])
        at_end = last[-1] >= 0
        self._targets = targets[at_end]
        held_at_end = last[-1][at_end]
        self._held = {name: values[held_at_end] for name, values in pool.items()}
        first = np.concatenate(([start], start + np.cumsum(counts[updated])[:-1]))
        return self._tracks(fused, wake.ticks[updated], targets, last[1:], pool, first)

    def _pool(self, fused: FusedDetections) -> tuple[dict[str, Any], int]:
        """Return everything that may be held: what was, then the new entries."""
        start = len(self._targets)
        new: dict[str, Any] = {name: getattr(fused, name) for name in _HELD}
        if isinstance(fused, FusedWithPose):
            new |= fused.pose_columns()
        if start == 0:
            return new, 0
        return {name: np.concatenate([self._held[name], new[name]]) for name in new}, start

    def _tracks(
        self,
        fused: FusedDetections,
        ticks: IntArray,
        targets: IntArray,
        last: IntArray,
        pool: dict[str, Any],
        first: IntArray,
    ) -> Tracks:
        """Return the tracks of each row; `first` is the first of its own entries in the pool."""
        # A sweeping beam measures after its scan has begun, which is when its report is sent.
        age_s: FloatArray = (
            np.maximum(ticks[:, np.newaxis] - pool["measured_tick"][np.maximum(last, 0)], 0)
        ) / self.context.ticks_per_s
        held = last >= 0
        if self.p.drop_after_s is not None:
            held &= age_s < self.p.drop_after_s
        row, column = held.nonzero()
        entry = last[row, column]
        pose: dict[str, Any] = {}
        message: type[Tracks] = Tracks
        if isinstance(fused, FusedWithPose):
            message, pose = TracksWithPose, {n: pool[n][entry] for n in POSE}
        return message(
            tick=ticks,
            offsets=offsets_of(row, len(ticks)),
            target=targets[column],
            azimuth_rad=pool["azimuth_rad"][entry],
            elevation_rad=pool["elevation_rad"][entry],
            range_m=pool["range_m"][entry],
            age_s=age_s[row, column],
            contributors=pool["contributors"][entry],
            roster=fused.roster,
            sensors=fused.sensors,
            measured_tick=pool["measured_tick"][entry],
            ticks_per_s=self.context.ticks_per_s,
            updated=entry >= first[row],
            **({"own_of_entries": pose} if pose else {}),
        )


def _present(held: IntArray, new: IntArray, targets: int) -> IntArray:
    """Return the targets that are held or newly measured, ascending."""
    there = np.zeros(targets, dtype=bool)
    there[held] = True
    there[new] = True
    return there.nonzero()[0]


def _forget_other_replicas(last: IntArray, replica: IntArray, start: int, counts: IntArray) -> None:
    """Drop what each row holds from replicas before its own; entries are in order of rows."""
    first_entry = start + np.cumsum(counts) - counts
    begins = np.concatenate(([True], replica[1:] != replica[:-1]))
    own_from = np.maximum.accumulate(np.where(begins, first_entry, 0))
    own_from[replica == replica[0]] = 0  # what was held before belongs to the first
    later = last[1:]
    later[later < own_from[:, np.newaxis]] = -1
