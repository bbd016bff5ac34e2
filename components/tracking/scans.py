"""Looks of sensors in the order in which they came, with their detections."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np

from components.estimation.batched import select_tracks
from components.estimation.frame import SensorPose, vectors_in_frame
from components.estimation.measurement import Kind
from components.messages.columns import POSE, TOLD
from components.messages.fused import FusedDetections
from dsa_des.arrays.entries import rows_of_entries
from dsa_des.arrays.run_ticks import RunTicks, first_position_at_or_after
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake

_MEASURED = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
_VARIANCES = (
    "azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2",
    "range_rate_variance_m2_s2",
)  # fmt: skip

#: In the kind of a detection: whether it tells of errors that the filter carries.
TELLS = 8


@dataclass(frozen=True, eq=False)
class Scans:
    """Looks of sensors in order of arrival, with the detections of each."""

    row: IntArray  # (looks,), at which row of the wake each arrived, ascending
    run: IntArray  # (looks,), of the scene
    tick: IntArray  # (looks,), when it was made
    sensors: IntArray  # (looks,), mask of the sensors that looked
    tells_misses: BoolArray  # (looks,) of bool, whether what is not among its detections was missed
    # (6, looks), of the ownship: latitude, longitude (deg), height (m), heading, pitch, roll
    # (rad)
    pose: FloatArray
    # (3, looks), of the ownship over ground (north, east, down of its own place, m/s); NaN
    # where a look measured no range rate
    velocity: FloatArray
    offsets: IntArray  # (looks + 1,), detections ``offsets[i]:offsets[i + 1]`` belong to look i
    # (7, detections), azimuth, elevation, range, range rate, and the target's velocity (north,
    # east, down of the ownship's place); NaN where not measured
    measured: FloatArray
    variance: FloatArray  # (7, detections), the same
    contributors: IntArray
    source: IntArray  # (7, detections), index of the sensor that gave each quantity; -1 for none
    reported: FloatArray | None  # (`TOLD`, detections), what each reports; None where none does

    def __len__(self) -> int:
        return len(self.row)

    def detection_kind_codes(self, rates_of: int, carries: bool) -> IntArray:
        """Return the kind of each detection as an integer code.

        It is 1 with a range, 2 more with a range rate, 4 with a velocity, and `TELLS` with errors
        that the filter carries. One that carries none does without a velocity whose errors last:
        they add up in the position, and it would not know.
        """
        code = (~np.isnan(self.measured[2])).astype(np.int64)
        if rates_of and not np.isnan(self.velocity).all():
            moves = np.repeat(~np.isnan(self.velocity).any(axis=0), np.diff(self.offsets))
            used = moves & (self.variance[3] > 0.0) & ~np.isnan(self.measured[3])
            code += 2 * (used & (self.contributors & ~rates_of == 0))
        if self.reported is None:
            return code
        errs = ~np.isnan(self.reported[-1])
        moves = ~np.isnan(self.measured[4:]).any(axis=0) & (code & 1 > 0)
        moves &= (self.variance[4:] > 0.0).all(axis=0) & (
            rates_of >> np.maximum(self.source[2], 0) & 1 > 0
        )
        tells = errs & (self.source[0] == self.source[2]) & carries
        code = np.where(errs | moves, code & 1, code)
        return code + 4 * (moves & (tells | ~errs)) + TELLS * tells

    def rotate_velocities_to_frames(self, origin_deg_m: FloatArray) -> Self:
        """Return looks with target velocities turned to the axes of frames at given origins."""
        if np.isnan(self.measured[4:]).all():
            return self
        look = rows_of_entries(self.offsets)
        measured = self.measured.copy()
        places = select_tracks(self.pose[:3], look)
        measured[4:] = vectors_in_frame(select_tracks(origin_deg_m, look), places, measured[4:])
        return replace(self, measured=measured)

    def take(self, looks: IntArray) -> Self:
        """Return the looks with these indices, with their detections."""
        counts = np.diff(self.offsets)[looks]
        offsets = np.concatenate(([0], np.cumsum(counts)))
        which = np.repeat(self.offsets[looks] - offsets[:-1], counts) + np.arange(offsets[-1])
        return type(self)(
            self.row[looks], self.run[looks], self.tick[looks], self.sensors[looks],
            self.tells_misses[looks],
            select_tracks(self.pose, looks), select_tracks(self.velocity, looks), offsets,
            select_tracks(self.measured, which), select_tracks(self.variance, which),
            self.contributors[which], self.source.take(which, axis=-1),
            None if self.reported is None else select_tracks(self.reported, which),
        )  # fmt: skip

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the looks of all parts joined, one part after the other."""
        if len(parts) == 1:
            return parts[0]
        counts = np.concatenate([np.diff(part.offsets) for part in parts])
        names = ("row", "run", "tick", "sensors", "tells_misses", "pose", "velocity", "measured",
                 "variance", "contributors", "source")  # fmt: skip
        columns = {n: np.concatenate([getattr(p, n) for p in parts], axis=-1) for n in names}
        reported = [part.reported for part in parts if part.reported is not None]
        return cls(
            offsets=np.concatenate(([0], np.cumsum(counts))),
            reported=np.concatenate(reported, axis=-1) if reported else None, **columns,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class LookBatch:
    """At most one look per replica, to be processed together, with their detections."""

    scans: Scans
    look: IntArray  # (looks,), index into `scans`
    replica: IntArray  # (looks,), ascending
    detection: IntArray  # (detections,), index into `scans`
    of: IntArray  # (detections,), the look of each, index into `look`
    code: IntArray  # (detections,), its kind by `Scans.kinds`
    poses: SensorPose  # of every look of `scans`

    @classmethod
    def from_looks(
        cls, scans: Scans, look: IntArray, replica: IntArray, codes: IntArray, poses: SensorPose
    ) -> Self:
        """Return a batch of the looks, at most one per replica, with their detections."""
        first = scans.offsets[look]
        counts = scans.offsets[look + 1] - first
        of = np.arange(len(look)).repeat(counts)
        detection = np.arange(len(of)) + (first - (counts.cumsum() - counts))[of]
        return cls(scans, look, replica, detection, of, codes[detection], poses)

    @property
    def tick(self) -> IntArray:
        """Tick at which each look was made."""
        return self.scans.tick[self.look]

    @property
    def contributors(self) -> IntArray:
        """Bit mask, per detection, of the sensors that contributed to it."""
        return self.scans.contributors[self.detection]

    def poses_of_looks(self, of: IntArray) -> SensorPose:
        """Return the sensor poses of the looks with these indices in the batch."""
        return self.poses.take(self.look[of])


@cache
def kind_and_measured_rows(code: int) -> tuple[Kind, list[int]]:
    """Return the kind of an integer code, and which rows of `Scans.measured` it uses."""
    kind = Kind(bool(code & 1), bool(code & 2), bool(code & 4))
    rows = [*([2] if kind.has_range else []), *([3] if kind.has_range_rate else [])]
    return kind, [0, 1, *rows, *([4, 5, 6] if kind.has_velocity else [])]


def looks_of_message(fused: FusedDetections) -> Scans:
    """Return the looks in a fused message, with detections, ordered by arrival, then instant.

    A fusion that passes reports on states every look, also those in vain. Of other fusions a look
    is what was measured at one instant with the angles of one sensor, among the measurements of a
    row. Where there are several of an instant none tells of misses: what one sensor detected may
    have been left to another one.
    """
    if fused.measurements is not None:
        fused = fused.measurements
    row = fused.row_of_entries
    mask = np.asarray(fused.contributors, dtype=np.int64)
    tick = fused.measured_tick
    pose = fused.pose_columns()
    own = (
        np.array([pose[name] for name in POSE]) if pose else np.full((len(POSE), len(row)), np.nan)
    )
    looks = fused.looks
    looked = 0
    key = [row, tick, fused.angle_source]
    sensors, poses = mask, own
    if looks is not None:
        look_row = np.repeat(np.arange(len(fused)), np.diff(looks.offsets))
        looked = len(look_row)
        key = [
            np.concatenate([look_row, row]),
            np.concatenate([fused.tick[look_row] - looks.age_ticks, tick]),
            np.concatenate([looks.sensor, fused.angle_source]),
        ]
        sensors = np.concatenate([np.int64(1) << looks.sensor, mask])
        poses = np.concatenate([looks.pose, own], axis=1)
    order = np.lexsort(key[::-1])
    fresh = np.ones(len(order), dtype=bool)
    same = [values[order][1:] == values[order][:-1] for values in key]
    fresh[1:] = ~np.logical_and.reduce(same)
    number = np.cumsum(fresh) - 1
    count = int(fresh.sum())
    begins = order[fresh]
    whole = np.zeros(count, dtype=bool)
    whole[number[order < looked]] = True
    if looks is None:
        first, second = (values[begins] for values in key[:2])
        beside = (first[1:] == first[:-1]) & (second[1:] == second[:-1])
        whole = ~(np.append(beside, False) | np.append(False, beside))[:count]
    of_entry = np.empty(len(order), dtype=np.int64)
    of_entry[order] = number
    of_entry = of_entry[looked:]
    union = np.zeros(count, dtype=np.int64)
    np.bitwise_or.at(union, number, sensors[order])
    # Stable: the sorted order keeps a look's detections in the order of the message.
    entries = np.argsort(of_entry, kind="stable")
    reported = np.full((len(TOLD), len(mask)), np.nan)
    if fused.told_by_target is not None:
        reported = np.array([fused.told_by_target[name] for name in TOLD])
    measured = np.array([*(getattr(fused, name) for name in _MEASURED), *reported[:3]])
    variance = np.array([*(getattr(fused, name) for name in _VARIANCES), *reported[3:6]])
    seen_from = select_tracks(poses, begins)
    _check_poses_and_variances(fused, measured, variance, seen_from)
    return Scans(
        row=key[0][begins],
        run=fused.run[key[0][begins]],
        tick=key[1][begins],
        sensors=union,
        tells_misses=whole,
        pose=seen_from,
        velocity=_ownship_velocities(fused, of_entry, count),
        offsets=np.concatenate(([0], np.cumsum(np.bincount(of_entry, minlength=count)))),
        measured=select_tracks(measured, entries),
        variance=select_tracks(variance, entries),
        reported=None if fused.told_by_target is None else select_tracks(reported, entries),
        contributors=mask[entries],
        source=np.array([fused.angle_source] * 2 + [fused.range_source] * 5)[:, entries],
    )


def _ownship_velocities(fused: FusedDetections, look: IntArray, count: int) -> FloatArray:
    """Return the ownship's velocity (3, looks), from a look's first detection with one, or NaN."""
    velocity = np.full((3, count), np.nan)
    if fused.own_velocity is not None:
        velocities = np.array(list(fused.own_velocity.values()))
        known = np.flatnonzero(~np.isnan(velocities).any(axis=0))[::-1]
        velocity[:, look[known]] = velocities[:, known]
    return velocity


def split_due_looks(
    scans: Scans, ahead: Scans | None, wake: Wake, wait_ticks: int = 0
) -> tuple[Scans, Scans | None]:
    """Return the looks to process by the wake's rows, in order, and those to keep (or None).

    A sweeping radar reports a scan as it begins, with instants at which its beam meets the targets
    later: such a look waits for the first row at or after its own instant.
    """
    if ahead is None and not bool((scans.tick + wait_ticks > wake.ticks[scans.row]).any()):
        return scans, None
    if ahead is not None:
        scans = Scans.concatenate([replace(ahead, row=np.full(len(ahead), -1)), scans])
    due = RunTicks(scans.run, scans.tick + wait_ticks)
    row = np.maximum(scans.row, first_position_at_or_after(wake.instants, due))
    there = np.minimum(row, len(wake) - 1)
    ready = (row < len(wake)) & (wake.run[there] == scans.run)
    waiting = ~ready & (scans.run >= wake.first_run)
    order = np.lexsort((scans.sensors, scans.tick, row))
    done = replace(scans, row=row).take(order[ready[order]])
    return done, scans.take(np.flatnonzero(waiting)) if waiting.any() else None


def _check_poses_and_variances(
    fused: FusedDetections, measured: FloatArray, variance: FloatArray, pose: FloatArray
) -> None:
    if np.isnan(pose).any():
        raise ValueError(
            "a report does not say where the ownship believed to be (own_lat_deg, own_lon_deg, "
            "own_alt_m, own_heading_rad, own_pitch_rad, own_roll_rad): a tracker needs its pose"
        )
    # A range rate that is exact is not used.
    bad = (~np.isnan(measured) & ~(variance > 0.0))[:3]
    if bad.any():
        what, entry = (int(values[0]) for values in bad.nonzero())
        sensors = "+".join(
            name for i, name in enumerate(fused.sensors) if int(fused.contributors[entry]) >> i & 1
        )
        raise ValueError(
            f"{sensors} states the variance {variance[what, entry]:g} of its {_MEASURED[what]}: "
            "a tracker needs one above 0 (a grid's step, or stated errors)"
        )
