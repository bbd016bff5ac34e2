"""The simulation decision: which sensor needs to look at which target (thesis §3.4, errata 4b)."""

from dataclasses import fields
from typing import Any

import numpy as np

from components.messages.reach import Decision, FarthestLook, Reach, combined_farthest_look
from components.messages.targets import GatedTargets, RelativeTargets
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.ladder import Verified
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake


class Gate(Component):
    """Decides which targets' detection each sensor must compute, with the reason where not.

    A target is skipped when the sensor is switched off, when it is not the sensor's scan time,
    when the target is not there, when it is outside the field of view or
    the range, or when the Earth stands before it.
    """

    inputs = {"targets": Input(RelativeTargets, "trigger", "Targets as seen from the ownship.")}
    outputs = {"targets": Output(GatedTargets, "The same, with a decision for each sensor.")}
    windowed = True
    lockstep = True
    rewindable = True
    verified = (
        Verified("who is looked at, and why another is not", "pymap3d, and rotations by matrices: "
                 "a banked ownship in the south", "1 m of the range, 0.1 deg of a field of view",
                 "tests/sensor/test_reach.py"),
    )  # fmt: skip

    def request(self, port: str) -> FarthestLook:
        """Return the union of all connected sensors' requests: farthest range, widest angles."""
        return combined_farthest_look(consumer.request for consumer in self.context.consumers)

    def offer(self, port: str) -> Any:
        """Return the offer of the block upstream unchanged, or None without one."""
        return self.context.producers[0].offer if self.context.producers else None

    def setup(self) -> None:
        """Learn the reach of every sensor downstream; one whose reach changes decides by itself."""
        reaches: dict[str, list[Reach]] = {}
        for consumer in self.context.consumers:
            if isinstance(consumer.request, Reach):
                reaches.setdefault(consumer.block, []).append(consumer.request)
        self._reach = {sensor: of[0] for sensor, of in reaches.items() if len(of) == 1}

    def run(self, wake: Wake) -> Message | None:
        """Decide at every instant, for the sensors that scan then."""
        targets = wake["targets"]
        if targets is None:
            return None
        decisions = {}
        width = targets.range_m.shape[1]
        where = [
            targets.body_azimuth_rad,
            targets.body_elevation_rad,
            targets.range_m,
            targets.present,
        ]
        if targets.hidden is not None:
            where.append(targets.hidden)
        for sensor, reach in self._reach.items():
            rows = wake.demand.get(sensor)
            if rows is None or len(rows) == len(targets):
                rows, reason = np.arange(len(targets)), reach.skip_reasons(*where)
            elif len(rows):
                reason = reach.skip_reasons(*(values.take(rows, axis=0) for values in where))
            else:
                reason = np.empty((0, width), dtype=np.uint8)
            decisions[sensor] = Decision(rows, reason, len(targets))
        # Behind another gate, that one's decisions were for the sensors there.
        values = {one.name: getattr(targets, one.name) for one in fields(targets)}
        return GatedTargets(**{**values, "tick": wake.ticks, "decisions": decisions})
