"""Pick-best fusion: radar gives range, optics give the angles (``fusion.pick_best``, §3.6)."""

from fractions import Fraction

import numpy as np
from pydantic import Field

from components.fusion.coincidence import latest_in_gate, same_instant
from components.fusion.false_alarms import pass_false_alarms
from components.messages import Detections, FusedDetections, SensorOffer
from components.true_entries import true_entries
from dsa_des.component import Component, NonNegativeRational, Parameters
from dsa_des.ports import Input, Output
from dsa_des.sorted_union import sorted_union
from dsa_des.types import FloatArray, IntArray
from dsa_des.wake import Arrivals, Wake

#: What the sensor that gives the angles also says, and all numbers of a fused row.
_ANGLES = (
    "azimuth_rad", "elevation_rad", "true_azimuth_rad", "true_elevation_rad", "true_range_m",
)  # fmt: skip
_VALUES = (*_ANGLES, "range_m")


class PickBestParameters(Parameters):
    """Parameters of pick-best fusion."""

    coincidence_s: NonNegativeRational = Field(
        default=Fraction(0),
        description="How old another sensor's detection may be and still count as the same "
        "look, s; 0 fuses detections of the same instant only (Fig. 4.22).",
    )


class PickBest(Component):
    """Puts together, per target, the best of what the sensors report.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is. Output comes at every instant a sensor reports, for the
    targets detected then. False alarms pass through alone: only a target ties detections together.
    """

    inputs = {"detections": Input(Detections, "trigger", "What the sensors detected.", many=True)}
    outputs = {"fused": Output(FusedDetections, "One line of sight per target and instant.")}
    Parameters = PickBestParameters
    windowed = True
    lockstep = True

    def setup(self) -> None:
        """Rank the sensors."""
        offers = {
            producer.block: producer.offer
            if isinstance(producer.offer, SensorOffer)
            else SensorOffer(False, 0.0)
            for producer in self.context.producers
        }
        self.sensors = tuple(sorted(offers, key=lambda n: (not offers[n].measures_range, n)))
        best_angles = sorted(
            offers, key=lambda n: (offers[n].measures_range, offers[n].resolution_rad, n)
        )
        #: Least preferred first, so that better ones overwrite.
        self._by_angles = [self.sensors.index(name) for name in reversed(best_angles)]
        self._by_range = [
            self.sensors.index(name)
            for name in reversed(best_angles)
            if offers[name].measures_range
        ]
        self._gate_ticks = int(self.p.coincidence_s * self.context.ticks_per_s)
        self._recent: dict[str, Arrivals] = {}

    def serves_replicas(self) -> bool:
        """Say no to a gate that would reach from one replica into the one before."""
        return super().serves_replicas() and self.p.coincidence_s <= self.context.duration_s

    def run(self, wake: Wake) -> FusedDetections | None:
        """Fuse the detections of every instant."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        arrivals = reported
        true = {name: true_entries(new.message) for name, new in reported.items()}
        all_true = all(true[name] is new.message for name, new in reported.items())
        if not all_true:
            arrivals = {n: Arrivals(n, new.tick, true[n]) for n, new in reported.items()}
        roster = next(iter(arrivals.values())).message.roster
        width = max(1, len(roster))
        keys = [_keys(new, wake.ticks, width) for new in arrivals.values()]
        union = _union(keys, width) if len(wake) == 1 else sorted_union(keys)
        row, target = np.divmod(union, width)
        if self._gate_ticks:
            arrivals = self._with_recent(arrivals)
            entries = {
                name: latest_in_gate(new, wake.ticks[row], target, self._gate_ticks)
                for name, new in arrivals.items()
            }
        else:
            entries = {
                name: same_instant(key, union) for name, key in zip(arrivals, keys, strict=True)
            }
        fused = self._combine(wake.ticks, row, target, arrivals, entries)
        if all_true:
            return fused
        return pass_false_alarms(fused, reported, [self.sensors[i] for i in self._by_range])

    def _with_recent(self, arrivals: dict[str, Arrivals]) -> dict[str, Arrivals]:
        """Return new and recent rows of every sensor, and keep what the next run may need."""
        for name, new in arrivals.items():
            old = self._recent.get(name)
            if old is not None:
                message = Detections.concatenate([old.message, new.message])
                new = Arrivals(name, np.concatenate([old.tick, new.tick]), message)
            self._recent[name] = new
        latest = max(int(new.tick[-1]) for new in arrivals.values())
        together = dict(self._recent)
        for name, seen in together.items():
            keep = slice(int(np.searchsorted(seen.tick, latest - self._gate_ticks)), len(seen.tick))
            self._recent[name] = Arrivals(name, seen.tick[keep], seen.message.take(keep))
        return dict(sorted(together.items()))

    def _combine(
        self,
        ticks: IntArray,
        row: IntArray,
        target: IntArray,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> FusedDetections:
        count = len(row)
        contributors = np.zeros(count, dtype=np.int64)
        angle_source = np.full(count, -1, dtype=np.int64)
        range_source = np.full(count, -1, dtype=np.int64)
        values = dict(zip(_VALUES, np.full((len(_VALUES), count), np.nan), strict=True))
        found = {name: (entry >= 0).nonzero()[0] for name, entry in entries.items()}
        for index in self._by_angles:
            name = self.sensors[index]
            if name in found and len(found[name]):
                contributors[found[name]] |= 1 << index
                angle_source[found[name]] = index
                _copy(values, _ANGLES, found[name], arrivals[name], entries[name])
        for index in self._by_range:
            name = self.sensors[index]
            if name in found and len(found[name]):
                range_source[found[name]] = index
                _copy(values, ("range_m",), found[name], arrivals[name], entries[name])
        return FusedDetections(
            tick=ticks,
            offsets=np.searchsorted(row, np.arange(len(ticks) + 1)),
            target=target,
            contributors=contributors,
            angle_source=angle_source,
            range_source=range_source,
            roster=next(iter(arrivals.values())).message.roster,
            sensors=self.sensors,
            **values,
        )


def _union(keys: list[IntArray], width: int) -> IntArray:
    """Return every target of one row once, ascending."""
    there = np.zeros(width, dtype=bool)
    for key in keys:
        there[key] = True
    return there.nonzero()[0]


def _keys(new: Arrivals, ticks: IntArray, width: int) -> IntArray:
    """Return instant · width + target of every detection, ascending."""
    if len(ticks) == 1:
        return new.message.target
    row = np.searchsorted(ticks, new.tick)
    offsets = new.message.offsets
    return np.repeat(row, np.diff(offsets)) * width + new.message.target


def _copy(
    values: dict[str, FloatArray],
    columns: tuple[str, ...],
    at: IntArray,
    new: Arrivals,
    entry: IntArray,
) -> None:
    chosen = entry[at]
    for column in columns:
        values[column][at] = getattr(new.message, column)[chosen]
