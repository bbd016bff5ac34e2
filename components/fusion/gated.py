"""Gated fusion: detections that lie close in time and place belong together (``fusion.gated``)."""

from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from components.fusion.fusion_block import Fusion
from components.fusion.gate_match import nearest_in_gate
from components.fusion.ladder import FUSION
from components.messages.detections import FusedDetections
from components.messages.false_detections import FALSE_TARGET
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.block.wake import Arrivals, Wake


class GatedParameters(Parameters):
    """Parameters of gated fusion."""

    time_gate_s: NonNegativeRational = Field(
        default=Fraction(1, 10),
        description="How old another sensor's detection may be and still belong to a new one, s.",
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
    gathered by two others. The row bears the target of the best sensor whose detection has one.
    """

    Parameters = GatedParameters
    lockstep = True
    ladders = (FUSION,)

    def window_s(self) -> Any:
        """Return ``time_gate_s``."""
        return self.p.time_gate_s

    def run(self, wake: Wake) -> FusedDetections | None:
        """Fuse the detections of every instant."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        new_ticks = {name: new.tick for name, new in reported.items()}
        arrivals = self.with_recent(reported)
        best_first = [self.sensors[index] for index in reversed(self.by_angles)]
        order = [name for name in best_first if name in arrivals]
        ticks = {name: _entry_ticks(arrivals[name]) for name in order}
        # What came before this wake was reported then; it can only be gathered now.
        free = {
            name: ticks[name] >= new_ticks[name][0]
            if name in new_ticks
            else np.zeros(len(ticks[name]), dtype=bool)
            for name in order
        }
        rows: list[IntArray] = []
        gathered: dict[str, list[IntArray]] = {name: [] for name in order}
        for anchor in order:
            mine = np.flatnonzero(free[anchor])
            rows.append(np.searchsorted(wake.ticks, ticks[anchor][mine]))
            for other in order:
                if other == anchor:
                    gathered[other].append(mine)
                    continue
                entry = nearest_in_gate(
                    arrivals[anchor].message,
                    mine,
                    ticks[anchor][mine],
                    arrivals[other].message,
                    ticks[other],
                    gate_ticks=self.gate_ticks,
                    angle_gate_rad=np.radians(self.p.angle_gate_deg),
                    range_gate_m=self.p.range_gate_m,
                )
                together = np.flatnonzero(entry >= 0)
                same = ticks[other][entry[together]] == ticks[anchor][mine[together]]
                free[other][entry[together][same]] = False
                gathered[other].append(entry)
        return self._rows(wake, rows, gathered, arrivals, order)

    def _rows(
        self,
        wake: Wake,
        rows: list[IntArray],
        gathered: dict[str, list[IntArray]],
        arrivals: dict[str, Arrivals],
        order: list[str],
    ) -> FusedDetections:
        row = np.concatenate(rows)
        entries = {name: np.concatenate(parts) for name, parts in gathered.items()}
        target = np.full(len(row), FALSE_TARGET, dtype=np.int64)
        for name in reversed(order):
            entry = entries[name]
            found = np.flatnonzero(entry >= 0)
            seen = arrivals[name].message.target[entry[found]]
            target[found[seen >= 0]] = seen[seen >= 0]
        # By instant, then target; of equal ones the anchor with the better angles comes first.
        sorted_rows = np.lexsort((np.where(target < 0, 2**31, target), row))
        return self.combine(
            wake.ticks,
            row[sorted_rows],
            target[sorted_rows],
            arrivals,
            {name: entry[sorted_rows] for name, entry in entries.items()},
        )


def _entry_ticks(arrivals: Arrivals) -> IntArray:
    """Return when each detection arrived."""
    return np.repeat(arrivals.tick, np.diff(arrivals.message.offsets))
