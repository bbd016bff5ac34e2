"""Gated fusion: detections that lie close in time and place belong together (``fusion.gated``)."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from components.fusion.carried import Carrier
from components.fusion.fusion_block import Fusion, poses
from components.fusion.gate_match import nearest_in_gate
from components.fusion.ladder import FUSION
from components.messages.false_detections import FALSE_TARGET
from components.messages.fused import FusedDetections
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.block.wake import Arrivals, Wake


class GatedParameters(Parameters):
    """Parameters of gated fusion."""

    time_gate_s: NonNegativeRational = Field(
        default=Fraction(1, 10),
        description="Farthest apart in time of measurements that belong together, s.",
    )
    angle_gate_deg: float = Field(
        default=2.0, gt=0, le=180, description="Largest angle between lines of sight, deg."
    )
    range_gate_m: float = Field(
        default=300.0, gt=0, description="Largest difference where both measure range, m."
    )


class Gated(Fusion):
    """Puts detections of different sensors together that lie within gates of time and place.

    Nothing is known of who was detected: two aircraft in one gate may be mixed, and a false alarm
    may join a detection, as in a real system. At every instant the sensors that report are taken
    best angles first; each of their detections gathers the nearest detection of every other sensor
    in its gates. One gathered at the same instant makes no row of its own; one detection may be
    gathered by two others. What was measured at another instant is first carried to that of the
    detection that gathers it (`components.fusion.carried`); what a row records is as it was
    measured, of the instants at which it was. The row bears the target of the best sensor whose
    detection has one; that is for the record, neither what is fused nor its order rests on it.
    """

    Parameters = GatedParameters
    lockstep = True
    ladders = (FUSION,)

    def window_s(self) -> Any:
        """Return ``time_gate_s``."""
        return self.p.time_gate_s

    def setup(self) -> None:
        """Rank the sensors, and learn how late their detections may come."""
        super().setup()
        latest_s = max((producer.latest_s for producer in self.context.producers), default=0)
        self.keep_ticks = self.gate_ticks + math.ceil(latest_s * self.context.ticks_per_s)

    def run(self, wake: Wake) -> FusedDetections | None:
        """Put together what was measured within the gates of what has come."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        since = {name: int(wake.own_ticks(new.tick).min()) for name, new in reported.items()}
        if not wake.side_by_side:
            since = {name: int(new.tick[0]) for name, new in reported.items()}
        arrivals = self.with_recent(reported, wake)
        best_first = [self.sensors[index] for index in reversed(self.by_angles)]
        order = [name for name in best_first if name in arrivals]
        came = {name: _entry_ticks(arrivals[name]) for name in order}
        made = {name: arrivals[name].message.measured_ticks() for name in order}
        pose = {name: poses(arrivals[name].message) for name in order}
        # What came before this wake was reported then; it can only be gathered now.
        free = {
            name: (wake.own_ticks(came[name]) if wake.side_by_side else came[name]) >= since[name]
            if name in since
            else np.zeros(len(came[name]), dtype=bool)
            for name in order
        }
        rows: list[IntArray] = []
        anchors: list[tuple[str, IntArray]] = []
        gathered: dict[str, list[IntArray]] = {name: [] for name in order}
        for anchor in order:
            mine = np.flatnonzero(free[anchor])
            rows.append(np.searchsorted(wake.ticks, came[anchor][mine]))
            anchors.append((anchor, mine))
            for other in order:
                if other == anchor:
                    gathered[other].append(mine)
                    continue
                one, two = arrivals[anchor].message, arrivals[other].message
                entry = nearest_in_gate(
                    one,
                    mine,
                    made[anchor][mine],
                    two,
                    made[other],
                    gate_ticks=self.gate_ticks,
                    angle_gate_rad=np.radians(self.p.angle_gate_deg),
                    range_gate_m=self.p.range_gate_m,
                    anchor_came=came[anchor][mine],
                    other_came=came[other],
                    keep_ticks=self.keep_ticks,
                    carried=Carrier(
                        one, made[anchor], pose[anchor], two, made[other], pose[other],
                        self.context.ticks_per_s,
                    ),
                )  # fmt: skip
                together = np.flatnonzero(entry >= 0)
                same = came[other][entry[together]] == came[anchor][mine[together]]
                free[other][entry[together][same]] = False
                gathered[other].append(entry)
        in_order = self._in_order(rows, anchors, arrivals)
        row = np.concatenate(rows)[in_order]
        entries = {name: np.concatenate(parts)[in_order] for name, parts in gathered.items()}
        target = self._who(entries, arrivals, order)
        return self.combine(wake.ticks, row, target, arrivals, entries)

    def _in_order(
        self,
        rows: list[IntArray],
        anchors: list[tuple[str, IntArray]],
        arrivals: dict[str, Arrivals],
    ) -> IntArray:
        """Return the order of fused detections: by instant, sensor and what was measured."""
        taken = [(arrivals[name].message, mine) for name, mine in anchors]
        measured = [
            np.concatenate([getattr(message, column)[mine] for message, mine in taken])
            for column in ("range_m", "elevation_rad", "azimuth_rad")
        ]
        rank = np.repeat(np.arange(len(anchors)), [len(mine) for _, mine in anchors])
        return np.lexsort((*measured, rank, np.concatenate(rows)))

    def _who(
        self, entries: dict[str, IntArray], arrivals: dict[str, Arrivals], order: list[str]
    ) -> IntArray:
        """Return whom each fused detection is of, for the record: nothing here rests on it."""
        target = np.full(len(next(iter(entries.values()))), FALSE_TARGET, dtype=np.int64)
        for name in reversed(order):
            entry = entries[name]
            found = np.flatnonzero(entry >= 0)
            seen = arrivals[name].message.target[entry[found]]
            target[found[seen >= 0]] = seen[seen >= 0]
        return target


def _entry_ticks(arrivals: Arrivals) -> IntArray:
    """Return when each detection arrived."""
    return np.repeat(arrivals.tick, np.diff(arrivals.message.offsets))
