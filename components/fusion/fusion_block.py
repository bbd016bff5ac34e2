"""The base class of fusion blocks: the ranking, the memory, and how rows are built."""

from typing import Any

import numpy as np

from components.messages.detections import Detections, FusedDetections, SensorOffer, mask_type
from components.sensor.marks import FUSION
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.message import offsets_of
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Arrivals

#: What the sensor that gives the angles also says, and all numbers of a fused row.
_ANGLES = (
    "azimuth_rad", "elevation_rad", "true_azimuth_rad", "true_elevation_rad", "true_range_m",
)  # fmt: skip
_VALUES = (*_ANGLES, "range_m")


class Fusion(Component):
    """Puts detections together; subclasses say which belong together.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is.
    """

    mark = FUSION
    inputs = {"detections": Input(Detections, "trigger", "What the sensors detected.", many=True)}
    outputs = {"fused": Output(FusedDetections, "One line of sight per target and instant.")}
    windowed = True
    rewindable = True

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
        self.by_angles = [self.sensors.index(name) for name in reversed(best_angles)]
        self.by_range = [
            self.sensors.index(name)
            for name in reversed(best_angles)
            if offers[name].measures_range
        ]
        self.gate_ticks = int(self.window_s() * self.context.ticks_per_s)
        self._recent: dict[str, Arrivals] = {}

    def serves_replicas(self) -> bool:
        """Say no to a gate that would reach from one replica into the one before."""
        return super().serves_replicas() and self.window_s() <= self.context.duration_s

    def window_s(self) -> Any:
        """Return how old a detection may be and still be put together with a new one, s."""
        raise TypeError(f"{type(self).__name__} states no window")

    def with_recent(self, arrivals: dict[str, Arrivals]) -> dict[str, Arrivals]:
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
            keep = slice(int(np.searchsorted(seen.tick, latest - self.gate_ticks)), len(seen.tick))
            self._recent[name] = Arrivals(name, seen.tick[keep], seen.message.take(keep))
        return dict(sorted(together.items()))

    def combine(
        self,
        ticks: IntArray,
        row: IntArray,
        target: IntArray,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> FusedDetections:
        """Build the fused rows from the best of what belongs together.

        Parameters
        ----------
        ticks : (rows,)
        row, target : (entries,)
            Row and target of each fused detection, ascending in row.
        arrivals : dict of Arrivals
        entries : dict of (entries,)
            By sensor: which of its detections belongs to each, -1 for none.
        """
        count = len(row)
        contributors: Any = np.zeros(count, dtype=mask_type(len(self.sensors)))
        angle_source = np.full(count, -1, dtype=np.int64)
        range_source = np.full(count, -1, dtype=np.int64)
        values = dict(zip(_VALUES, np.full((len(_VALUES), count), np.nan), strict=True))
        found = {name: (entry >= 0).nonzero()[0] for name, entry in entries.items()}
        for index in self.by_angles:
            name = self.sensors[index]
            if name in found and len(found[name]):
                contributors[found[name]] |= 1 << index
                angle_source[found[name]] = index
                _copy(values, _ANGLES, found[name], arrivals[name], entries[name])
        for index in self.by_range:
            name = self.sensors[index]
            if name in found and len(found[name]):
                range_source[found[name]] = index
                _copy(values, ("range_m",), found[name], arrivals[name], entries[name])
        return FusedDetections(
            tick=ticks,
            offsets=offsets_of(row, len(ticks)),
            target=target,
            contributors=contributors,
            angle_source=angle_source,
            range_source=range_source,
            roster=next(iter(arrivals.values())).message.roster,
            sensors=self.sensors,
            **values,
        )


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
