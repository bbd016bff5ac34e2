"""The beam: when it passes each target, and the beam-shape loss off its axis.

The beam sweeps clockwise over the field of view once per scan, at an even rate, and flies back in
what is left of the period: it looks one way only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import check_finite, check_positive
from components.geometry import TWO_PI, wrap_pi
from components.messages.detections import REPORT, Detections, OwnOfEntries, ReportTransform
from components.messages.reach import (
    EVALUATE,
    FIELD_OF_VIEW,
    RANGE,
    Decision,
    combined_farthest_look,
)
from components.messages.targets import GatedTargets, RelativeTargets
from components.sensor.look import Cells, CellValues
from components.sensor.sensor import Sensor
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook
from dsa_des.block.message import Message, per_row

# Where the beam counts as meeting the target: far below any beam's width, and above the rounding
# of times in a run of days.
_MET_RAD = 1e-9
_MOST_STEPS = 60
#: Mean gain both ways of a Gaussian beam within its half-power width, -1.67 dB: what is left of the
#: pulses of a beam that sweeps over a target (L. V. Blake, Proc. IRE 41, 1953, has 1.6 dB).
SWEEP_SHARE = (
    0.5 * math.sqrt(math.pi) * math.erf(math.sqrt(2.0 * math.log(2.0)))
    / math.sqrt(2.0 * math.log(2.0))
)  # fmt: skip


def illumination_offset_s(
    azimuth_rad: ArrayLike,
    *,
    start_rad: float,
    width_rad: float,
    scan_period_s: float,
) -> Any:
    """Return how long after the start of its scan the beam points to an azimuth, s.

    The beam starts at `start_rad` and sweeps clockwise over `width_rad`, in (0, 2π], within the
    period; an azimuth outside counts as the nearer edge.
    """
    check_positive("width_rad", width_rad)
    if not width_rad <= TWO_PI * (1.0 + 1e-12):
        raise ValueError(f"width_rad is {width_rad:g}: it must be at most 2π")
    check_positive("scan_period_s", scan_period_s)
    start = float(check_finite("start_rad", start_rad))
    azimuth = np.asarray(check_finite("azimuth_rad", azimuth_rad))
    swept = _clip_to_sweep(azimuth - start, width_rad)
    return np.minimum(swept / (width_rad / scan_period_s), scan_period_s)[()]


def first_lit_time_and_mask(
    azimuth_at: Callable[[FloatArray], FloatArray],
    azimuth_rad: FloatArray,
    *,
    start_rad: float,
    width_rad: float,
    scan_period_s: float,
) -> tuple[FloatArray, BoolArray]:
    """Return when in its scan (s) the beam first meets each target as it flies, and if it does.

    `azimuth_at` gives the targets' azimuths (rad, clockwise) at times of their own after the start
    of the scan. One that lies outside the field of view, came in behind the beam or kept ahead of
    it is not lit; its time is that of the nearer end. One that crosses the seam of a full circle
    against the sweep is lit twice, and the first counts.

    Each element is solved by itself, by the secant method inside a shrinking bracket, until beam
    and target are within 1e-9 rad: three or four evaluations for 0.1 rad/s under a beam of 3.8
    rad/s. Against a brute force search over exact trajectories it errs by less than 1 ns and 1 µm,
    where the position at the start of the scan is off by up to speed times period.
    """
    beam_rate = width_rad / scan_period_s
    # The bare remainder: what lies a rounding before the start is lit last, not first.
    swept = np.mod(azimuth_rad - start_rad, TWO_PI)
    # Outside the field of view it is ahead of the nearer edge, or behind it.
    swept = np.where(swept > 0.5 * (width_rad + TWO_PI), swept - TWO_PI, swept)

    def lead(offset: FloatArray) -> FloatArray:
        """Return by what azimuth (rad) a target leads the beam at a time after the scan start."""
        ahead: FloatArray = swept + wrap_pi(azimuth_at(offset) - azimuth_rad) - beam_rate * offset
        return ahead

    low, high = np.zeros_like(swept), np.full_like(swept, scan_period_s)
    at_low, at_high = swept, lead(high)
    lit = (at_low >= -_MET_RAD) & (at_high <= _MET_RAD)
    offset = np.where(at_low > 0.0, high, low)
    # Not to be searched: unlit ones, and those that are met at one of the ends.
    met = ~lit | (np.abs(at_low) <= _MET_RAD) | (np.abs(at_high) <= _MET_RAD)
    offset = np.where(lit & (np.abs(at_low) <= _MET_RAD), 0.0, offset)
    before, at_before = high, at_high
    at_offset = at_low
    point = low
    for _ in range(_MOST_STEPS):
        if met.all():
            break
        change = at_offset - at_before
        flat = change == 0.0
        step = at_offset * (point - before) / np.where(flat, 1.0, change)
        guess = point - step
        guess = np.where(flat | ~((guess > low) & (guess < high)), 0.5 * (low + high), guess)
        guess = np.where(met, offset, guess)
        ahead = lead(guess)
        before, at_before, point, at_offset = point, at_offset, guess, ahead
        low, high = np.where(ahead > 0.0, guess, low), np.where(ahead > 0.0, high, guess)
        offset = np.where(met, offset, guess)
        met = met | (np.abs(ahead) <= _MET_RAD)
    return offset, lit


def two_way_gain(off_axis_rad: FloatArray, beamwidth_rad: float) -> FloatArray:
    """Return a Gaussian beam's two-way gain relative to its axis: 1/4 at half its beamwidth."""
    share: FloatArray = np.exp(-8.0 * math.log(2.0) * (off_axis_rad / beamwidth_rad) ** 2)
    return share


def angle_off_nearest_beam(angle_rad: FloatArray, width_rad: float, beams: int) -> FloatArray:
    """Return the signed angle (rad) off the nearest of `beams` axes that share a width evenly."""
    step = width_rad / beams
    number = np.clip(np.floor(angle_rad / step), 0, beams - 1)
    return np.asarray(angle_rad - (number + 0.5) * step)


def _clip_to_sweep(angle: FloatArray, width: float) -> FloatArray:
    """Return the angle clockwise from the start, [0, width]; outside, the nearer edge."""
    angle = np.mod(angle, TWO_PI)
    past_the_end = angle > width
    nearer_to_start = TWO_PI - angle < angle - width
    return np.where(past_the_end, np.where(nearer_to_start, 0.0, width), angle)


BEAM_SHAPE = Hook(
    "beam shape", CellValues, "share of a target's echo that is left off the beam's axis"
)


class OffAxis:
    """The factor on echoes of targets off the axes of a radar's beams; called with cells."""

    def __init__(self, block: Any) -> None:
        self._block = block
        positions, reach = block.p.beams, block.p.reach()
        across_rad, upward_rad = reach.width_rad
        self._columns = reach.azimuth_rad[0], across_rad, positions.azimuth
        self._bars = reach.elevation_rad[0], upward_rad, positions.elevation
        self._beam_rad = [
            math.radians(width)
            for width in (block.p.azimuth_beamwidth_deg, block.p.elevation_beamwidth_deg)
        ]

    def __call__(self, cells: Cells) -> FloatArray:
        """Return the share of each cell's echo, at most 1."""
        azimuth_rad, elevation_rad = self._block.axes(
            cells.body_azimuth_rad, cells.body_elevation_rad
        )
        swept = np.mod(azimuth_rad - self._columns[0], TWO_PI)
        left = two_way_gain(angle_off_nearest_beam(elevation_rad - self._bars[0], *self._bars[1:]),
                            self._beam_rad[1])  # fmt: skip
        if self._block.p.beam_sweep:
            left = left * SWEEP_SHARE
        else:
            left = left * two_way_gain(
                angle_off_nearest_beam(swept, *self._columns[1:]), self._beam_rad[0]
            )
        return np.where(cells.is_cued(), 1.0, left)


class BeamShape(Effect[CellValues]):
    """Beam-shape loss of targets off the axis: between beam positions, or averaged in a sweep.

    The scan's beams stand side by side and in bars, ``beam_spacing`` beamwidths apart at most; a
    target is looked at by the nearest. A beam that sweeps passes over it in azimuth: its pulses
    then have the mean gain within the half-power width. Both ways, of a Gaussian beam. A cue's
    beam points at its target.
    """

    name = "beam shape"
    acts_on = BEAM_SHAPE
    flag = "beam_shape_loss"
    builds = OffAxis
    outside_the_proof = "no target is amid every beam"


@dataclass(eq=False)
class LitTargets(GatedTargets):
    """Targets at the instants at which a beam lights them, and the time since the scan began."""

    offset_s: FloatArray = per_row(kw_only=True)


class Sweep:
    """The sweep of one radar's beam; called with a report, it adds each illumination's time."""

    def __init__(self, block: Any) -> None:
        self.period_s = float(1 / block.p.scan_rate_hz)
        self._block = block
        self._turn = {
            "start_rad": block.reach.azimuth_rad[0],
            "width_rad": block.reach.width_rad[0],
            "scan_period_s": self.period_s,
        }
        self._ticks_per_s = block.context.ticks_per_s

    def targets_when_lit(
        self, targets: RelativeTargets, rows: IntArray, cued: BoolArray | None = None
    ) -> LitTargets:
        """Return the targets at the instants at which the beam meets them, one row per scan.

        Those in a cue cone it meets as the scan begins, if the radar's beam visits such cones
        first.
        """
        if targets.revisit is None:
            raise ValueError(
                "beam_sweep needs to know the targets at instants of its own; the traffic, or a "
                "block on the way, passes no flights on: set beam_sweep to false"
            )
        block, columns = self._block, targets.columns
        at_start = targets.take(rows)
        revisit = at_start.revisit
        assert revisit is not None
        start_s = (at_start.position_ticks / self._ticks_per_s)[:, np.newaxis]
        seen: dict[str, Any] = {}

        def azimuth_at(offset_s: FloatArray) -> FloatArray:
            seen.update(revisit(columns, start_s + offset_s))
            seen.pop("own")
            seen.pop("target")
            azimuth, _ = block.axes(seen["body_azimuth_rad"], seen["body_elevation_rad"])
            return azimuth

        before, _ = block.axes(at_start.body_azimuth_rad, at_start.body_elevation_rad)
        offset_s, met = first_lit_time_and_mask(azimuth_at, before, **self._turn)
        if cued is not None and block.p.cued_beam_first:
            offset_s, met = np.where(cued, 0.0, offset_s), met | cued
        azimuth_at(offset_s)
        lit = replace(at_start, **seen)
        reason = block.axes.reach_in_body_axes(block.reach).skip_reasons(
            lit.body_azimuth_rad, lit.body_elevation_rad, lit.range_m, lit.present, lit.hidden
        )
        reason[~met & ((reason == EVALUATE) | (reason == RANGE))] = FIELD_OF_VIEW
        fields = {
            **vars(lit),
            "decisions": {block.name: Decision(np.arange(len(rows)), reason, len(rows))},
        }
        return LitTargets(**fields, offset_s=offset_s)

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Add ``illuminated_s``, and the ownship's pose then, to what `lit` targets gave."""
        counts = np.diff(detections.offsets)
        # The radar knows when its beam pointed where it measured, whatever was there.
        azimuth, _ = self._block.axes.believed_direction_in_sensor(
            detections.azimuth_rad, detections.elevation_rad
        )
        offset_s = illumination_offset_s(azimuth, **self._turn)
        first = getattr(self._block.p, "cued_beam_first", False)
        if first and "cued" in detections.extras:
            offset_s = np.where(detections.extras["cued"], 0.0, offset_s)
        assert isinstance(targets, LitTargets)
        scan_s = np.repeat(detections.tick / self._ticks_per_s, counts)
        extras = {**detections.extras, "illuminated_s": scan_s + offset_s}
        own = self._believed_pose_when_lit(detections, targets, np.repeat(rows, counts), offset_s)
        after = np.rint(offset_s * self._ticks_per_s).astype(np.int64)
        return replace(detections, extras=extras, own_of_entries=own, ticks_after=after)

    def _believed_pose_when_lit(
        self, detections: Detections, targets: LitTargets, row: IntArray, offset_s: FloatArray
    ) -> dict[str, FloatArray] | None:
        """Return by column poses at detections with scans' navigation error; None without one."""
        believed = detections.pose_columns()
        if not believed or targets.revisit is None or not len(targets.roster):
            return None
        if len(row) == 0:  # flights need not answer for no instant, but messages must join
            return believed
        # Where the ownship is does not depend on the target that is asked for with it.
        flights, anyone = targets.revisit.take_rows(row), np.zeros(1, dtype=np.int64)
        start_s = targets.position_ticks[row] / self._ticks_per_s
        before, then = (
            flights(anyone, time_s[:, np.newaxis])["own"]
            for time_s in (start_s, start_s + offset_s)
        )
        moved = {}
        names = [name for name in before if name != "present"]
        for (column, belief), name in zip(believed.items(), names, strict=True):
            known, now = before[name][:, 0], then[name][:, 0]
            moved[column] = np.where(belief == known, now, belief + (now - known))
        return moved


class BeamSweep(Effect[ReportTransform]):
    """Each target is illuminated at its own instant by a beam that sweeps once per scan.

    Everything about a target is then that of this instant: whether it is in reach, its SNR, its
    measured and true position. A target that the beam does not meet counts as outside the field of
    view. ``illuminated_s`` is what the radar knows of the instant: when its beam pointed to the
    azimuth that was measured. The ownship's pose is of that instant too; the error of its
    navigation is that of the scan's start.
    """

    name = "beam sweep"
    acts_on = REPORT
    flag = "beam_sweep"
    builds = Sweep
    outside_the_proof = "it fills a column that is null without it"


class SweepingSensor(Sensor):
    """A sensor whose beam may sweep: then it sees each target when the beam lights it."""

    also_records: ClassVar[tuple[type[Message], ...]] = (*Sensor.also_records, OwnOfEntries)

    @property
    def _sweep(self) -> Sweep | None:
        return self.context.effects.get(BeamSweep.name)

    def records(self) -> list[type[Message]]:
        """Return the recorded message types; if sweeping, also the ownship's at detections."""
        return [*super().records(), *([] if self._sweep is None else [OwnOfEntries])]

    def request(self, port: str) -> Any:
        """Return a request for the targets in reach, over the duration of a sweep."""
        reach = super().request(port)
        if self._sweep is None or not self.p.enabled:
            return reach
        return replace(combined_farthest_look([reach]), lasts_s=self._sweep.period_s)

    def observed_targets_and_rows(
        self, targets: RelativeTargets, rows: IntArray, cued: BoolArray | None = None
    ) -> tuple[RelativeTargets, IntArray]:
        """Return targets when illuminated, and the scans' rows in them; unchanged without sweep."""
        if self._sweep is None:
            return targets, rows
        return self._sweep.targets_when_lit(targets, rows, cued), np.arange(len(rows))
