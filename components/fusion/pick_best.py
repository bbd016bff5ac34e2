"""Pick-best fusion: radar gives range, optics give the angles (``fusion.pick_best``, §3.6)."""

from collections.abc import Mapping
from fractions import Fraction
from itertools import combinations
from math import gcd
from typing import Any

import numpy as np
from pydantic import Field

from components.fusion.fusion_block import Fusion, latest_in_gate, single_entry_rows
from components.fusion.ladder import FUSION_LADDER
from components.messages.detections import SensorOffer
from components.messages.false_detections import FALSE_TARGET
from components.messages.fused import FusedDetections
from dsa_des.arrays.run_ticks import last_position_at_or_before, positions_with_found_mask
from dsa_des.arrays.sorted_union import sorted_union_and_positions
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import NonNegativeRational, Parameters, Producer
from dsa_des.block.wake import Arrivals, Wake


class PickBestParameters(Parameters):
    """Parameters of pick-best fusion."""

    coincidence_s: NonNegativeRational = Field(
        default=Fraction(0),
        description="How old another sensor's detection may be and still count as the same "
        "look, s; 0 fuses detections of the same instant only (Fig. 4.22).",
    )


class PickBest(Fusion):
    """Combines, for each true target, the best values that the sensors report.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is. Output comes at every instant a sensor reports, for the
    targets detected then. False alarms pass through alone: only a target ties detections together.
    """

    Parameters = PickBestParameters
    ladders = (FUSION_LADDER,)

    def skipped_work_notes(self) -> list[str]:
        """Return a note that detections are combined by their true targets."""
        return [
            "association by truth: detections of the same target are put together, whatever was "
            "measured, and a false alarm with none (fusion.gated goes by measured values alone)"
        ]

    def window_s(self) -> Any:
        """Return ``coincidence_s``, the age (s) up to which detections fuse with new ones."""
        return self.p.coincidence_s

    def warnings(self) -> list[str]:
        """Return a warning if no two sensors ever report within ``coincidence_s`` of each other."""
        clocks = [
            clock
            for one in self.context.producers
            if (clock := _first_report_and_period_s(one)) is not None
        ]
        if len(clocks) < 2 or len(clocks) < len(self.context.producers):
            return super().warnings()
        apart_s = min(least_tick_distance_s(*pair) for pair in combinations(clocks, 2))
        if apart_s <= self.p.coincidence_s:
            return super().warnings()
        return [
            *super().warnings(),
            f"coincidence_s is {float(self.p.coincidence_s):g} and no two sensors report less than "
            f"{float(apart_s):g} s apart: it never puts two of them together",
        ]

    def run(self, wake: Wake) -> FusedDetections | None:
        """Fuse the detections of every instant."""
        arrivals = {new.source: new for new in wake.arrivals("detections")}
        if not arrivals:
            return None
        width = max(1, len(next(iter(arrivals.values())).message.roster))
        true = [_entries_of_targets(new) for new in arrivals.values()]
        keys = [
            _instant_target_keys(new, wake, width, of)
            for new, of in zip(arrivals.values(), true, strict=True)
        ]
        union, positions = sorted_union_and_positions(keys)
        row = union // width
        target = union - row * width
        if self.gate_ticks:
            arrivals = self.merge_recent(arrivals, wake)
            entries = {
                name: latest_in_gate(new, wake.instants.take(row), target, self.gate_ticks)
                for name, new in arrivals.items()
            }
        else:
            entries = {name: np.full(len(union), -1, dtype=np.int64) for name in arrivals}
            for entry, at, of in zip(entries.values(), positions, true, strict=True):
                entry[at] = np.arange(len(at)) if of is None else of
        if any(of is not None for of in true):
            rows, alone = single_entry_rows(
                self._false_alarm_rows_and_entries(arrivals, wake), arrivals
            )
            order = np.argsort(np.concatenate([row, rows]), kind="stable")
            row = np.concatenate([row, rows])[order]
            target = np.append(target, np.full(len(rows), FALSE_TARGET))[order]
            entries = {n: np.append(entry, alone[n])[order] for n, entry in entries.items()}
        return self.combine(wake.instants, row, target, arrivals, entries)

    def _false_alarm_rows_and_entries(
        self, arrivals: Mapping[str, Arrivals], wake: Wake
    ) -> dict[str, tuple[IntArray, IntArray]]:
        """Return by sensor, in order of rank, rows and entries of false alarms arrived now."""
        result = {}
        for name in (name for name in self.sensors if name in arrivals):
            new = arrivals[name]
            at, now = positions_with_found_mask(wake.instants, new.instants)
            row = new.message.row_of_entries
            false = new.message.target == FALSE_TARGET
            entry = np.flatnonzero(false if now is None else false & now[row])
            result[name] = at[row[entry]], entry
        return result


def _first_report_and_period_s(sensor: Producer) -> tuple[Fraction, Fraction] | None:
    """Return a sensor's first report time (s) and its period, or None if it is irregular."""
    offer = sensor.offer
    if not isinstance(offer, SensorOffer) or offer.clock is None:
        return None
    clock = offer.clock()
    if clock.rate_error_ppm or clock.jitter_s or sensor.jitter_s or sensor.unforeseen:
        return None
    return clock.offset_s + sensor.latest_s, clock.period_s


def least_tick_distance_s(
    one: tuple[Fraction, Fraction], other: tuple[Fraction, Fraction]
) -> Fraction:
    """Return the least time between ticks of two clocks, each (first instant, period), s."""
    (first_s, period_s), (second_s, other_s) = one, other
    # Differences of their instants are all those of the offsets and multiples of this.
    step_s = Fraction(
        gcd(period_s.numerator * other_s.denominator, other_s.numerator * period_s.denominator),
        period_s.denominator * other_s.denominator,
    )
    apart_s = (second_s - first_s) % step_s
    return min(apart_s, step_s - apart_s)


def _entries_of_targets(new: Arrivals) -> IntArray | None:
    """Return the indices of the entries that belong to a target, or None if all of them do."""
    true = new.message.target != FALSE_TARGET
    return None if true.all() else np.flatnonzero(true)


def _instant_target_keys(new: Arrivals, wake: Wake, width: int, of: IntArray | None) -> IntArray:
    """Return for each entry a key made of the index of its instant and of its target."""
    row = last_position_at_or_before(wake.instants, new.instants)  # they are among them
    keys = row.take(new.message.row_of_entries) * width + new.message.target
    return keys if of is None else keys[of]
