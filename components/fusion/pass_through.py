"""Every sensor's detections as they are, for a tracker of its own (``fusion.pass_through``)."""

from typing import Any

import numpy as np

from components.fusion.fusion_block import Fusion, single_entry_rows
from components.messages.columns import POSE
from components.messages.fused import FusedDetections
from components.messages.looks import Looks
from dsa_des.arrays.run_ticks import RunTicks, last_position_at_or_before
from dsa_des.block.component import Parameters
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Arrivals, Wake


class PassThrough(Fusion):
    """Passes detections on singly, and reports which sensor looked when, also if it saw nothing.

    Nothing is put together: that is the tracker's work. Entries of an instant stand by sensor, in
    the sensor's own order. A sweeping radar's scan is not reported as a look, as it has no one
    instant.
    """

    Parameters = Parameters
    puts_together = False

    def window_s(self) -> Any:
        """Return 0 (s): no detection is kept to be fused with a later one."""
        return 0

    def run(self, wake: Wake) -> FusedDetections | None:
        """Pass on what came at every instant."""
        arrivals = {new.source: new for new in wake.arrivals("detections")}
        if not arrivals:
            return None
        alone = {}
        for name, new in arrivals.items():
            row = last_position_at_or_before(wake.instants, new.instants)
            row = np.repeat(row, np.diff(new.message.offsets))
            alone[name] = row, np.arange(len(row))
        row, entries = single_entry_rows(alone, arrivals)
        order = np.argsort(row, kind="stable")
        target = np.concatenate([new.message.target for new in arrivals.values()])[order]
        entries = {name: entry[order] for name, entry in entries.items()}
        fused = self.combine(wake.instants, row[order], target, arrivals, entries)
        fused.looks = self._sensor_looks(wake.instants, arrivals)
        return fused

    def _sensor_looks(self, instants: RunTicks, arrivals: dict[str, Arrivals]) -> Looks:
        row, sensor, age, pose = [], [], [], []
        for name, new in arrivals.items():
            message = new.message
            if message.ticks_after is not None:
                continue
            row.append(last_position_at_or_before(instants, new.instants))
            sensor.append(np.full(len(message), self.sensors.index(name)))
            age.append(new.tick - message.tick)
            own = [getattr(message, column) for column in POSE]
            if any(values is None for values in own):
                own = [np.full(len(message), np.nan)] * len(POSE)
            pose.append(np.stack(own))
        if not row:
            none = np.empty(0, dtype=np.int64)
            return Looks(np.zeros(len(instants) + 1, np.int64), none, none, np.empty((6, 0)))
        order = np.argsort(np.concatenate(row), kind="stable")
        return Looks(
            offsets_from_entry_rows(np.concatenate(row)[order], len(instants)),
            np.concatenate(sensor)[order],
            np.concatenate(age)[order],
            np.concatenate(pose, axis=1)[:, order],
        )
