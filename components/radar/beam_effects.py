"""The beam sweep as an effect: when the beam passes each target, and where that is then."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from components.geometry.angles import TWO_PI
from components.messages.detections import Detections
from components.messages.reach import EVALUATE, FIELD_OF_VIEW, RANGE, Decision
from components.messages.targets import GatedTargets, RelativeTargets
from components.radar.beam_sweep import (
    SWEEP_SHARE,
    first_illumination,
    illumination_offset_s,
    off_nearest,
    two_way_gain,
)
from components.radar.field_of_view import azimuth_width_rad
from components.sensor.look import Cells
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict
from dsa_des.block.message import per_row


class BeamSweep(Effect):
    """A beam that sweeps once per scan lights each target at an instant of its own.

    Everything about a target is then that of this instant: whether it is in reach, its SNR, its
    measured and true position. A target that the beam does not meet counts as outside the field of
    view. ``illuminated_s`` is what the radar knows of the instant: when its beam pointed to the
    azimuth that was measured. The ownship's pose is of that instant too; the error of its
    navigation is that of the scan's start.
    """

    name = "beam sweep"
    acts_on = "report"
    lockstep = True
    neutral = False
    outside_the_proof = "it fills a column that is null without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``beam_sweep``."""
        return Verdict.of_flag(block.p, "beam_sweep")

    def build(self, block: Any) -> "Sweep":
        """Return the sweep of this radar's beam."""
        return Sweep(block)


class BeamShape(Effect):
    """What a target off the beam's axis loses: between beam positions, or on average in a sweep.

    The scan's beams stand side by side and in bars, ``beam_spacing`` beamwidths apart at most; a
    target is looked at by the nearest. A beam that sweeps passes over it in azimuth: its pulses
    then have the mean gain within the half-power width. Both ways, of a Gaussian beam. A cue's
    beam points at its target.
    """

    name = "beam shape"
    acts_on = "beam shape"
    lockstep = True
    neutral = False
    outside_the_proof = "no target is amid every beam"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``beam_shape_loss``."""
        return Verdict.of_flag(block.p, "beam_shape_loss")

    def build(self, block: Any) -> "OffAxis":
        """Return what gives the share of a target's echo that is left."""
        return OffAxis(block)


class OffAxis:
    """The share of the echoes of targets off the axes of one radar's beams."""

    def __init__(self, block: Any) -> None:
        self._block = block
        positions, reach = block.p.beams, block.p.reach()
        low_rad, high_rad = reach.elevation_rad
        self._columns = reach.azimuth_rad[0], azimuth_width_rad(reach), positions.azimuth
        self._bars = low_rad, high_rad - low_rad, positions.elevation
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
        left = two_way_gain(off_nearest(elevation_rad - self._bars[0], *self._bars[1:]),
                            self._beam_rad[1])  # fmt: skip
        if self._block.p.beam_sweep:
            left = left * SWEEP_SHARE
        else:
            left = left * two_way_gain(off_nearest(swept, *self._columns[1:]), self._beam_rad[0])
        return np.where(cells.is_cued(), 1.0, left)


@dataclass(eq=False)
class LitTargets(GatedTargets):
    """Targets at the instants at which a beam lights them.

    Parameters
    ----------
    offset_s : (rows, targets)
        Time since the start of the scan.
    """

    offset_s: FloatArray = per_row(kw_only=True)


class Sweep:
    """The sweep of one radar's beam; called with a report, it adds when everything was lit."""

    def __init__(self, block: Any) -> None:
        self.period_s = float(1 / block.p.scan_rate_hz)
        self._block = block
        self._turn = {
            "start_rad": block.reach.azimuth_rad[0],
            "width_rad": azimuth_width_rad(block.reach),
            "scan_period_s": self.period_s,
        }
        self._ticks_per_s = block.context.ticks_per_s

    def lit(
        self, targets: RelativeTargets, rows: IntArray, cued: BoolArray | None = None
    ) -> LitTargets:
        """Return the targets as the beam meets them, one row per scan.

        Those that lie in a cue cone it meets as the scan begins, if the radar's beam visits such
        cones first.

        Raises
        ------
        ValueError
            If the targets can be known only at the instants of the rows.
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
        start_s = self._start_s(at_start)[:, np.newaxis]
        found: dict[str, Any] = {}

        def azimuth_at(offset_s: FloatArray) -> FloatArray:
            found.update(revisit(columns, start_s + offset_s))
            found.pop("own")
            azimuth, _ = block.axes(found["body_azimuth_rad"], found["body_elevation_rad"])
            return azimuth

        before, _ = block.axes(at_start.body_azimuth_rad, at_start.body_elevation_rad)
        offset_s, met = first_illumination(azimuth_at, before, **self._turn)
        if cued is not None and block.p.cued_beam_first:
            offset_s, met = np.where(cued, 0.0, offset_s), met | cued
        azimuth_at(offset_s)
        lit = replace(at_start, **found)
        reason = block.axes.reach(block.reach).decide(
            lit.body_azimuth_rad, lit.body_elevation_rad, lit.range_m, lit.present, lit.hidden
        )
        reason[~met & ((reason == EVALUATE) | (reason == RANGE))] = FIELD_OF_VIEW
        fields = {**vars(lit), "decisions": {block.name: Decision(np.arange(len(rows)), reason)}}
        return LitTargets(**fields, offset_s=offset_s)

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Add ``illuminated_s``, and the ownship's pose then, to what `lit` targets gave."""
        counts = np.diff(detections.offsets)
        # The radar knows when its beam pointed where it measured, whatever was there.
        azimuth, _ = self._block.axes.from_body(detections.azimuth_rad, detections.elevation_rad)
        offset_s = illumination_offset_s(azimuth, **self._turn)
        first = getattr(self._block.p, "cued_beam_first", False)
        if first and "cued" in detections.extras:
            offset_s = np.where(detections.extras["cued"], 0.0, offset_s)
        assert isinstance(targets, LitTargets)
        scan_s = np.repeat(self._run_time_s(detections.tick), counts)
        extras = {**detections.extras, "illuminated_s": scan_s + offset_s}
        own = self._own_when_lit(detections, targets, np.repeat(rows, counts), offset_s)
        after = np.rint(offset_s * self._ticks_per_s).astype(np.int64)
        return replace(detections, extras=extras, own_of_entries=own, ticks_after=after)

    def _start_s(self, targets: RelativeTargets) -> FloatArray:
        """Return when the picture of each row was; one that came late goes on from there."""
        start = targets.tick if targets.state_tick is None else targets.state_tick
        return self._run_time_s(start)

    def _run_time_s(self, ticks: IntArray) -> FloatArray:
        """Return the time since the start of the run, of its own replica where many run."""
        span = self._block.span_ticks
        time_s: FloatArray = (ticks % span if span else ticks) / self._ticks_per_s
        return time_s

    def _own_when_lit(
        self, detections: Detections, targets: LitTargets, row: IntArray, offset_s: FloatArray
    ) -> dict[str, FloatArray] | None:
        """Return the believed pose at each entry's own instant, with the error of its scan."""
        believed = detections.pose_columns()
        if not believed or targets.revisit is None or not len(targets.roster):
            return None
        if len(row) == 0:  # flights need not answer for no instant, but messages must join
            return believed
        # Where the ownship is does not depend on the target that is asked for with it.
        flights, anyone = targets.revisit.take_rows(row), np.zeros(1, dtype=np.int64)
        start_s = self._start_s(targets)[row]
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
