"""The base class of fusion blocks: the ranking, the memory, and how rows are built."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from operator import attrgetter
from typing import Any

import numpy as np

from components.fusion.recent_detections import Recent, whole_rows_and_new_detections
from components.messages.columns import OWN_VELOCITY, POSE, TOLD
from components.messages.contributors import mask_dtype_for_sensors
from components.messages.detections import Detections, SensorOffer
from components.messages.fused import WITHOUT_POSE, FusedDetections, FusedWithPose
from components.navigation.errors import has_navigation_errors
from components.sensor.palette import FUSION
from dsa_des.arrays.run_ticks import RunTicks, rank_instants, take_runs
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Producer
from dsa_des.block.ladder import Verified
from dsa_des.block.message import Message, offsets_from_entry_rows
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.failure_counts import Tries, has_two_bits

#: What the sensor that gives the angles also says, and all numbers of a fused row.
_ANGLES = (
    "azimuth_rad", "elevation_rad", "true_azimuth_rad", "true_elevation_rad", "true_range_m",
    "azimuth_variance_rad2", "elevation_variance_rad2",
)  # fmt: skip
_RANGES = ("range_m", "range_variance_m2")
_RATES = ("range_rate_m_s", "range_rate_variance_m2_s2")


class Fusion(Component):
    """Combines several sensors' detections; subclasses decide which belong together.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is.
    """

    mark = FUSION
    inputs = {"detections": Input(Detections, "trigger", "What the sensors detected.", many=True)}
    outputs = {"fused": Output(FusedDetections, "One line of sight per target and instant.")}
    also_records = (FusedWithPose,)
    remembers = ("_recent", "_tries")
    windowed = True
    lockstep = True
    rewindable = True
    #: Whether detections of several sensors may become one.
    puts_together = True
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
        self._recent = Recent()
        self._tries = Tries()
        self._navigation_errs = has_navigation_errors(self.context)
        tracked = any(consumer.request != WITHOUT_POSE for consumer in self.context.consumers)
        self._with_pose = self._navigation_errs or tracked
        self._says_what_is_new = tracked and self.puts_together and len(offers) > 1

    def records(self) -> list[type[Message]]:
        """Return the recorded message types, with the believed pose if navigation has errors."""
        return [FusedWithPose] if has_navigation_errors(self.context) else [*super().records()]

    def offer(self, port: str) -> Any:
        """Return the sensors' declarations by name, with the latency of each."""
        waits_s = Fraction(self.window_s())
        return {
            one.block: replace(
                one.offer,
                latest_s=largest_delay_s(one) + waits_s,
                jitter_s=one.jitter_s + one.offer.jitter_s + waits_s,
                unforeseen=one.unforeseen or one.offer.unforeseen,
                platform=one.platform,
            )
            if isinstance(one.offer, SensorOffer)
            else one.offer
            for one in self.context.producers
        }

    def failure_counts(self) -> dict[str, IntArray]:
        """Return in which runs several sensors detected but no detections were ever combined."""
        if not self.puts_together:
            return {}
        return self._tries.failure_counts(
            "two sensors or more detect, and it never puts two of them together", of_two=True
        )

    def window_s(self) -> Any:
        """Return how old a detection may be to be fused with a new one, s."""
        raise TypeError(f"{type(self).__name__} states no window")

    def merge_recent(self, arrivals: dict[str, Arrivals], wake: Wake) -> dict[str, Arrivals]:
        """Return every sensor's new and recent rows; store those later rows may combine with."""
        together, self._recent = self._recent.joined_and_kept_arrivals(
            arrivals, wake.first_run, self.keep_ticks
        )
        return together

    def combine(
        self,
        instants: RunTicks,
        row: IntArray,
        target: IntArray,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> FusedDetections:
        """Build the instants' fused rows, each from the best values that belong together.

        Parameters
        ----------
        instants : RunTicks
            Of the rows that are sent, such as ``wake.instants``.
        row : (fused,) of int
            Which of these each fused detection is of, ascending.
        target : (fused,) of int
            Of whom each is, an index in the roster; -1 for a false alarm.
        arrivals : dict of Arrivals
            What came, by sensor; with what came before, as `merge_recent` gives it.
        entries : dict of (fused,) of int
            By sensor, which entry of its message belongs to each fused detection; -1 for none.
        """
        fused, parts = self._fused_message(instants, row, target, arrivals, entries)
        if len(self.sensors) > 1:
            run, of_two = take_runs(instants.run, row), has_two_bits(fused.contributors)
            self._tries = self._tries.add_tries(run, fused.contributors, of_two)
        if self._says_what_is_new:
            fused.measurements = self._new_measurements(fused, parts, instants, arrivals, entries)
        return fused

    def _new_measurements(
        self,
        fused: FusedDetections,
        parts: IntArray,
        instants: RunTicks,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> FusedDetections:
        """Return fused detections for a tracker: of unused detections only, of one instant each."""
        made = np.concatenate([one.message.measured_ticks() for one in arrivals.values()])
        targets = np.concatenate([one.message.target for one in arrivals.values()])
        used = self._recent.used_mask(arrivals)
        row = fused.row_of_entries
        whole, at, alone = whole_rows_and_new_detections(row, parts, made, used)
        used[parts[parts >= 0]] = True
        self._recent = self._recent.mark_used(arrivals, used)
        row = np.concatenate([row[whole], at])
        order = np.argsort(row, kind="stable")
        target = np.concatenate([fused.target[whole], targets[alone]])[order]
        mine, start = {}, 0
        for name, one in arrivals.items():
            count = len(one.message.target)
            by_itself = np.where((alone >= start) & (alone < start + count), alone - start, -1)
            mine[name] = np.concatenate([entries[name][whole], by_itself])[order]
            start += count
        return self._fused_message(instants, row[order], target, arrivals, mine)[0]

    def _fused_message(
        self,
        instants: RunTicks,
        row: IntArray,
        target: IntArray,
        arrivals: dict[str, Arrivals],
        entries: dict[str, IntArray],
    ) -> tuple[FusedDetections, IntArray]:
        """Return fused rows, and detections' indices (quantities, fused) that give their values.

        These are numbered over the arrivals, one after the other; -1 is none.
        """
        every = _Entries(self.sensors, arrivals, entries)
        contributors: Any = np.zeros(len(row), dtype=mask_dtype_for_sensors(len(self.sensors)))
        for index, (rows, _) in every.found.items():
            contributors[rows] |= 1 << index
        angle_source, of_angles = every.best_sensor_and_entry(self.by_angles)
        range_source, of_range = every.best_sensor_and_entry(self.by_range)
        parts = [of_angles, of_range]
        values = {name: every.values_at(attrgetter(name), of_angles) for name in _ANGLES}
        values |= {name: every.values_at(attrgetter(name), of_range) for name in _RANGES}
        pose = every.values_at(ownship_poses_of_entries, of_angles) if self._with_pose else None
        told = every.values_at(reported_error_columns, of_range) if self._told else None
        moves = None
        if self.by_range_rate:
            _, of_rate = every.best_sensor_and_entry(self.by_range_rate)
            parts.append(of_rate)
            values |= {name: every.values_at(attrgetter(name), of_rate) for name in _RATES}
            moves = (
                every.values_at(ownship_velocities_of_entries, of_rate) if self._with_pose else None
            )
        message = FusedWithPose if self._navigation_errs else FusedDetections
        fused = message(
            tick=instants.tick,
            run=instants.run,
            offsets=offsets_from_entry_rows(row, len(instants)),
            target=target,
            contributors=contributors,
            angle_source=angle_source,
            range_source=range_source,
            roster=next(iter(arrivals.values())).message.roster,
            sensors=self.sensors,
            measured_tick=every.values_at(Detections.measured_ticks, of_angles),
            ticks_per_s=self.context.ticks_per_s,
            own_of_entries=None if pose is None else dict(zip(POSE, pose, strict=True)),
            own_velocity=None if moves is None else dict(zip(OWN_VELOCITY, moves, strict=True)),
            told_by_target=None if told is None else dict(zip(TOLD, told, strict=True)),
            **values,
        )
        fused.row_of_entries = row
        every_row = np.arange(len(row))
        return fused, np.stack([every_row if of is None else of for of in parts])


def largest_delay_s(sensor: Producer) -> Fraction:
    """Return a sensor's largest delay (s): its own latency, and that on the way to here."""
    own_s = sensor.offer.latest_s if isinstance(sensor.offer, SensorOffer) else None
    return sensor.latest_s + (own_s or Fraction(0))


def ownship_poses_of_entries(message: Detections) -> FloatArray:
    """Return the ownship's pose as it believed it at each entry, (6, entries); NaN where none."""
    columns = message.pose_columns()
    if columns:
        return np.stack(list(columns.values()))
    return np.full((len(POSE), len(message.target)), np.nan)


def ownship_velocities_of_entries(message: Detections) -> FloatArray:
    """Return the ownship's velocity at each entry, (3, entries); NaN where none is stated."""
    velocity = message.own_velocity_columns()
    if velocity is None:
        return np.full((len(OWN_VELOCITY), len(message.target)), np.nan)
    return np.stack(list(velocity.values()))


def reported_error_columns(message: Detections) -> FloatArray:
    """Return each entry's errors as its target reports them, a row per name of `TOLD`, or NaN."""
    if message.told_by_target is None:
        return np.full((len(TOLD), len(message.target)), np.nan)
    return np.stack([message.told_by_target[name] for name in TOLD])


class _Entries:
    """All sensors' entries, joined, and those each fused row may take its values from."""

    def __init__(
        self, sensors: Sequence[str], arrivals: dict[str, Arrivals], entries: dict[str, IntArray]
    ) -> None:
        self._messages = [new.message for new in arrivals.values()]
        self._rows = len(next(iter(entries.values())))
        #: By sensor, the rows to which it gives an entry, and that entry's number among all.
        self.found: dict[int, tuple[IntArray, IntArray]] = {}
        start = 0
        for name, new in arrivals.items():
            rows = (entries[name] >= 0).nonzero()[0]
            if len(rows):
                self.found[sensors.index(name)] = rows, entries[name].take(rows) + start
            start += len(new.message.target)
        self._entries = start

    def best_sensor_and_entry(self, ranked: Sequence[int]) -> tuple[IntArray, IntArray | None]:
        """Return by row the sensor and entry it takes values from, or -1; later in ``ranked`` wins.

        The entries are None where they are those of the only message, one after the other.
        """
        taking = [index for index in ranked if index in self.found]
        if len(self._messages) == 1 and taking:
            (mine,) = taking
            entry = self.found[mine][1]
            if len(entry) == self._rows == self._entries and bool((entry[1:] > entry[:-1]).all()):
                return np.full(self._rows, mine, dtype=np.int64), None
        sensor, entry = np.full((2, self._rows), -1, dtype=np.int64)
        for index in taking:
            rows, those = self.found[index]
            sensor[rows], entry[rows] = index, those
        return sensor, entry

    def values_at(self, of: Callable[[Detections], AnyArray], entry: IntArray | None) -> Any:
        """Return a column at each row's entry, shape (..., rows); NaN or 0 where it has none."""
        if entry is None:
            return of(self._messages[0])
        parts = [of(message) for message in self._messages]
        none = np.nan if parts[0].dtype.kind == "f" else 0
        parts.append(np.full((*parts[0].shape[:-1], 1), none, dtype=parts[0].dtype))
        return np.concatenate(parts, axis=-1).take(entry, axis=-1)


def latest_in_gate(
    arrivals: Arrivals, asked: RunTicks, targets: IntArray, gate_ticks: int
) -> IntArray:
    """Return each target's latest entry up to ``gate_ticks`` before each instant; -1 if none.

    `asked` (fused,) are instants and `targets` (fused,) whose entries are wanted; -1 where a sensor
    has none.
    """
    counts = np.diff(arrivals.message.offsets)
    if not counts.any():
        return np.full(len(asked), -1, dtype=np.int64)
    # Ranks of instants stay small where ticks times targets would overflow.
    (came, now), span = rank_instants(arrivals.instants, asked)
    row = np.repeat(np.arange(len(counts)), counts)
    entry_key = arrivals.message.target * span + came[row]
    order = np.argsort(entry_key, kind="stable")
    index = np.searchsorted(entry_key[order], targets * span + now, side="right") - 1
    entry = order[np.maximum(index, 0)]
    of = row[entry]
    fits = (
        (index >= 0)
        & (arrivals.message.target[entry] == targets)
        & (arrivals.message.run[of] == asked.run)
        & (asked.tick - arrivals.tick[of] <= gate_ticks)
    )
    return np.where(fits, entry, -1)


def single_entry_rows(
    taken: Mapping[str, tuple[IntArray, IntArray]], sensors: Iterable[str]
) -> tuple[IntArray, dict[str, IntArray]]:
    """Return fused detections of one entry each: their rows, and by sensor the entry or -1.

    `taken` has by sensor the rows and the entries; they follow each other sensor by sensor.
    """
    row = np.concatenate([rows for rows, _ in taken.values()])
    entries = {name: np.full(len(row), -1, dtype=np.int64) for name in sensors}
    start = 0
    for name, (_, mine) in taken.items():
        entries[name][start : start + len(mine)] = mine
        start += len(mine)
    return row, entries
