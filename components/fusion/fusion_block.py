"""The base class of fusion blocks: the ranking, the memory, and how rows are built."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from components.geometry import unit_vectors
from components.messages.columns import OWN_VELOCITY, POSE, TOLD
from components.messages.contributors import mask_type
from components.messages.detections import Detections, SensorOffer
from components.messages.false_detections import true_entries
from components.messages.fused import WITHOUT_POSE, FusedDetections, FusedWithPose
from components.navigation.errors import navigation_errs
from components.sensor.ladder_values import angle_apart_mrad
from components.sensor.marks import FUSION
from dsa_des.arrays.run_ticks import RunTicks, ranks
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Producer
from dsa_des.block.ladder import Ladder, Quantity, Rung, Verified
from dsa_des.block.message import Message, offsets_of
from dsa_des.block.wake import Arrivals, Wake

#: What the sensor that gives the angles also says, and all numbers of a fused row.
_ANGLES = (
    "azimuth_rad", "elevation_rad", "true_azimuth_rad", "true_elevation_rad", "true_range_m",
    "azimuth_variance_rad2", "elevation_variance_rad2",
)  # fmt: skip
_RANGES = ("range_m", "range_variance_m2")
_RATES = ("range_rate_m_s", "range_rate_variance_m2_s2")
_VALUES = (*_ANGLES, *_RANGES)


class Fusion(Component):
    """Puts detections together; subclasses say which belong together.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is.
    """

    mark = FUSION
    inputs = {"detections": Input(Detections, "trigger", "What the sensors detected.", many=True)}
    outputs = {"fused": Output(FusedDetections, "One line of sight per target and instant.")}
    also_records = (FusedWithPose,)
    windowed = True
    rewindable = True
    verified = (
        Verified("where a fused row puts its target", "pymap3d, and rotations by matrices: a banked"
                 " ownship in the south", "0.05 m",
                 "tests/fusion/test_fused_and_tracked_positions.py"),
    )  # fmt: skip

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
        self.by_range_rate = [
            self.sensors.index(name)
            for name in reversed(best_angles)
            if offers[name].measures_range_rate
        ]
        self._told = any(offer.tells for offer in offers.values())
        self.gate_ticks = int(self.window_s() * self.context.ticks_per_s)
        #: How long before a detection another one may have come to be put together with it.
        self.keep_ticks = self.gate_ticks
        self._recent: dict[str, Arrivals] = {}
        self._navigation_errs = navigation_errs(self.context)
        self._with_pose = self._navigation_errs or any(
            consumer.request != WITHOUT_POSE for consumer in self.context.consumers
        )

    def records(self) -> list[type[Message]]:
        """Return what is recorded: where navigation errs, with the believed pose."""
        return [FusedWithPose] if navigation_errs(self.context) else [*super().records()]

    def offer(self, port: str) -> Any:
        """Hand on what the sensors say of themselves, by name, and how late they come."""
        waits_s = Fraction(self.window_s())
        return {
            one.block: replace(
                one.offer,
                latest_s=how_late_s(one) + waits_s,
                jitter_s=one.jitter_s + one.offer.jitter_s + waits_s,
                unforeseen=one.unforeseen or one.offer.unforeseen,
            )
            if isinstance(one.offer, SensorOffer)
            else one.offer
            for one in self.context.producers
        }

    def window_s(self) -> Any:
        """Return how old a detection may be and still be put together with a new one, s."""
        raise TypeError(f"{type(self).__name__} states no window")

    def with_recent(self, arrivals: dict[str, Arrivals], wake: Wake) -> dict[str, Arrivals]:
        """Return new and recent rows of every sensor, and keep what the next run may need."""
        for name, seen in self._recent.items():
            if ended := int(np.searchsorted(seen.message.run, wake.first_run)):
                rows = slice(ended, None)
                self._recent[name] = Arrivals(
                    name, seen.instants.take(rows), seen.message.take(rows)
                )
        for name, new in arrivals.items():
            old = self._recent.get(name)
            if old is not None:
                message = Detections.concatenate([old.message, new.message])
                instants = RunTicks.joined([old.instants, new.instants])
                order = instants.order()
                if order is not None:  # those of each run together
                    instants, message = instants.take(order), message.take(order)
                new = Arrivals(name, instants, message)
            self._recent[name] = new
        latest = max(int(new.tick.max()) for new in arrivals.values())
        together = dict(self._recent)
        for name, seen in together.items():
            young = np.flatnonzero(seen.tick >= latest - self.keep_ticks)
            self._recent[name] = Arrivals(name, seen.instants.take(young), seen.message.take(young))
        return dict(sorted(together.items()))

    def combine(
        self,
        instants: RunTicks,
        row: IntArray,
        target: IntArray,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> FusedDetections:
        """Build the fused rows of some instants from the best of what belongs together.

        Parameters
        ----------
        instants : RunTicks
            Of the rows that are sent, such as ``wake.instants``.
        row : (fused,) of int
            Which of these each fused detection is of, ascending.
        target : (fused,) of int
            Of whom each is, an index in the roster; -1 for a false alarm.
        arrivals : dict of Arrivals
            What came, by sensor; with what came before, as `with_recent` gives it.
        entries : dict of (fused,) of int
            By sensor, which entry of its message belongs to each fused detection; -1 for none.
        """
        count = len(row)
        contributors: Any = np.zeros(count, dtype=mask_type(len(self.sensors)))
        angle_source = np.full(count, -1, dtype=np.int64)
        range_source = np.full(count, -1, dtype=np.int64)
        names = (*_VALUES, *_RATES) if self.by_range_rate else _VALUES
        values: dict[str, Any] = dict(zip(names, np.full((len(names), count), np.nan), strict=True))
        measured_tick = np.zeros(count, dtype=np.int64)
        pose = np.full((len(POSE), count), np.nan) if self._with_pose else None
        moves = np.full((3, count), np.nan) if self._with_pose and self.by_range_rate else None
        told = np.full((len(TOLD), count), np.nan) if self._told else None
        found = {name: (entry >= 0).nonzero()[0] for name, entry in entries.items()}
        for index in self.by_angles:
            name = self.sensors[index]
            if name in found and len(found[name]):
                contributors[found[name]] |= 1 << index
                angle_source[found[name]] = index
                _copy(values, _ANGLES, found[name], arrivals[name], entries[name])
                chosen, message = entries[name][found[name]], arrivals[name].message
                measured_tick[found[name]] = message.measured_ticks()[chosen]
                if pose is not None:
                    pose[:, found[name]] = poses(message)[:, chosen]
        for index in self.by_range:
            name = self.sensors[index]
            if name in found and len(found[name]):
                range_source[found[name]] = index
                _copy(values, _RANGES, found[name], arrivals[name], entries[name])
                if told is not None:
                    chosen = entries[name][found[name]]
                    told[:, found[name]] = told_columns(arrivals[name].message)[:, chosen]
        for index in self.by_range_rate:
            name = self.sensors[index]
            if name in found and len(found[name]):
                _copy(values, _RATES, found[name], arrivals[name], entries[name])
                if moves is not None:
                    chosen = entries[name][found[name]]
                    moves[:, found[name]] = velocities(arrivals[name].message)[:, chosen]
        message = FusedWithPose if self._navigation_errs else FusedDetections
        return message(
            tick=instants.tick,
            run=instants.run,
            offsets=offsets_of(row, len(instants)),
            target=target,
            contributors=contributors,
            angle_source=angle_source,
            range_source=range_source,
            roster=next(iter(arrivals.values())).message.roster,
            sensors=self.sensors,
            measured_tick=measured_tick,
            ticks_per_s=self.context.ticks_per_s,
            own_of_entries=None if pose is None else dict(zip(POSE, pose, strict=True)),
            own_velocity=None if moves is None else dict(zip(OWN_VELOCITY, moves, strict=True)),
            told_by_target=None if told is None else dict(zip(TOLD, told, strict=True)),
            **values,
        )


def how_late_s(sensor: Producer) -> Fraction:
    """Return how late a sensor's looks come at most: by its own saying, and on the wire."""
    own_s = sensor.offer.latest_s if isinstance(sensor.offer, SensorOffer) else None
    return sensor.latest_s + (own_s or Fraction(0))


def poses(message: Detections) -> FloatArray:
    """Return the ownship's believed pose at each entry, (6, entries); NaN where none is stated."""
    columns = message.pose_columns()
    if columns:
        return np.stack(list(columns.values()))
    return np.full((len(POSE), len(message.target)), np.nan)


def velocities(message: Detections) -> FloatArray:
    """Return the ownship's velocity at each entry, (3, entries); NaN where none is stated."""
    velocity = message.velocity_columns()
    if velocity is None:
        return np.full((len(OWN_VELOCITY), len(message.target)), np.nan)
    return np.stack(list(velocity.values()))


def told_columns(message: Detections) -> FloatArray:
    """Return what each entry is told, (`TOLD`, entries); NaN for nothing."""
    if message.told_by_target is None:
        return np.full((len(TOLD), len(message.target)), np.nan)
    return np.stack([message.told_by_target[name] for name in TOLD])


def _copy(
    values: dict[str, FloatArray],
    columns: tuple[str, ...],
    at: IntArray,
    new: Arrivals,
    entry: IntArray,
) -> None:
    chosen, message = entry[at], new.message
    if len(at) == len(entry):
        for column in columns:
            values[column] = getattr(message, column)[chosen]
        return
    for column in columns:
        values[column][at] = getattr(message, column)[chosen]


def same_instant(keys: IntArray, asked: IntArray) -> IntArray:
    """Return the entry detected at exactly the same instant."""
    entry = np.full(len(asked), -1, dtype=np.int64)
    if len(keys):
        entry[asked.searchsorted(keys)] = np.arange(len(keys))
    return entry


def latest_in_gate(
    arrivals: Arrivals, asked: RunTicks, targets: IntArray, gate_ticks: int
) -> IntArray:
    """Return the latest entry that arrived at the instant or at most `gate_ticks` before it.

    `asked` (fused,) are instants and `targets` (fused,) whose entries are wanted; -1 where a sensor
    has none.
    """
    counts = np.diff(arrivals.message.offsets)
    if not counts.any():
        return np.full(len(asked), -1, dtype=np.int64)
    # Ranks of instants stay small where ticks times targets would overflow.
    (came, now), span = ranks(arrivals.instants, asked)
    row = np.repeat(np.arange(len(counts)), counts)
    entry_key = arrivals.message.target * span + came[row]
    order = np.argsort(entry_key, kind="stable")
    place = np.searchsorted(entry_key[order], targets * span + now, side="right") - 1
    entry = order[np.maximum(place, 0)]
    of = row[entry]
    fits = (
        (place >= 0)
        & (arrivals.message.target[entry] == targets)
        & (arrivals.message.run[of] == asked.run)
        & (asked.tick - arrivals.tick[of] <= gate_ticks)
    )
    return np.where(fits, entry, -1)


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return how far each fused line of sight is from the true one at its instant.

    Rungs fuse other rows, so they are compared with the truth and not row by row with each other.
    """
    fused: Any = block.run(wake)
    if fused is None:
        return {"direction": np.empty((0, 0)), "range": np.empty((0, 0))}
    fused = true_entries(fused)
    shape = (len(wake), len(fused.roster))
    row = np.searchsorted(wake.ticks, np.repeat(fused.tick, np.diff(fused.offsets)))
    line: FloatArray = np.full(shape, np.nan)
    distance: FloatArray = np.full(shape, np.nan)
    line[row, fused.target] = angle_apart_mrad(
        unit_vectors(fused.azimuth_rad, fused.elevation_rad),
        unit_vectors(fused.true_azimuth_rad, fused.true_elevation_rad),
    )
    distance[row, fused.target] = np.abs(fused.range_m - fused.true_range_m)
    return {"direction": line, "range": distance}


def truth(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return the same for the reference: sensors' grids are part of it."""
    row, target = cells.T
    return {name: values[row, target] for name, values in measure(block, wake, block).items()}


def _to_the_truth(values: AnyArray, reference: AnyArray) -> FloatArray:
    return values


FUSION_LADDER = Ladder(
    "association",
    (
        Rung("exact_instant", "same target, same instant (Fig. 4.22)", "fusion.pick_best",
             {"coincidence_s": 0}),
        Rung("window", "same target, at most 0.1 s apart", "fusion.pick_best",
             {"coincidence_s": 0.1}),
        Rung("gated", "within 0.1 s, 2 deg and 300 m, whatever the target", "fusion.gated",
             {"time_gate_s": 0.1, "angle_gate_deg": 2.0, "range_gate_m": 300.0}),
    ),
    "exact_instant",
    (
        Quantity("range", "m", _to_the_truth),
        Quantity("direction", "mrad", _to_the_truth),
    ),
    measure,
    truth,
    clears=("model",),
)  # fmt: skip
