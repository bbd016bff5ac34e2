"""False alarms of the ground as an effect: clutter that crosses a threshold set for noise."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from components.geometry.angles import Vector
from components.geometry.attitude import body_to_ned, unit_vector
from components.messages.detections import Detections
from components.messages.false_detections import in_measured_order
from components.messages.targets import RelativeTargets
from components.radar.clutter import clutter_detection_probability
from components.radar.clutter_effects import RainClutter, beamwidths_rad, terrain_of
from components.radar.false_alarm_effects import MOST_PER_SCAN, Alarms
from components.radar.field_of_view import cells_of_radar
from components.radar.ground_clutter import BEAM_REACH_BEAMWIDTHS
from components.radar.measured_strength import FAINTEST
from components.radar.threshold import Crossing
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

#: Keys of the ground's errors, beyond those of noise.
_OF_GROUND = np.uint64(2**41)


class ClutterAlarms(Effect):
    """Reports of cells in which the ground crosses the threshold that noise does not.

    With an adaptive threshold there are none beyond those of noise, whose number it keeps. With
    ``clutter_threshold = "noise"`` every resolution cell that the beam shares with the ground may
    be reported, by its clutter-to-noise ratio, beside the false alarms of noise. The ground is
    where the radar truly looks; behind a moving-target filter none is reported. Rain and what
    sidelobes meet cross it in every cell.
    """

    lockstep = True
    name = "clutter false alarms"
    acts_on = "report"
    neutral = False
    outside_the_proof = "a report without the ground is what there is without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``false_alarms``, ground, and a threshold that it crosses."""
        p = block.p
        if not (p.false_alarms and p.enabled):
            return Verdict(False, "false_alarms is false" if p.enabled else "enabled is false")
        if terrain_of(block) is None and not RainClutter().verdict(block).simulated:
            return Verdict(False, "[terrain] height_m is not given, and rain has no echo")
        if p.clutter_threshold != "noise":
            return Verdict(False, "clutter_threshold is 'adaptive': they are as many as of noise")
        if p.moving_target_filter != "none":
            return Verdict(False, f"moving_target_filter is {p.moving_target_filter!r}")
        return Verdict(True, "clutter_threshold is 'noise'")

    def build(self, block: Any) -> "GroundReports":
        """Return what adds the ground's false alarms to a report."""
        return GroundReports(block)


class _CellsOf:
    """Cells without a target as effects on the SNR ask for them."""

    def __init__(
        self, range_m: FloatArray, own_alt_m: float, elevation_rad: FloatArray, alt_m: FloatArray
    ) -> None:
        self.range_m, self.elevation_rad, self.alt_m = range_m, elevation_rad, alt_m
        self._own_alt_m = own_alt_m

    def __len__(self) -> int:
        return len(self.range_m)

    def of_row(self, name: str) -> AnyArray:
        """Return the ownship's altitude for each cell."""
        assert name == "own_alt_m"
        return np.full(len(self), self._own_alt_m)


class GroundReports:
    """Draws for every cell that holds ground, keyed by cell and scan.

    Parameters
    ----------
    block : LinkBudgetRadar
    """

    def __init__(self, block: Any) -> None:
        self._block, self._terrain = block, terrain_of(block)
        self._cells = cells = cells_of_radar(block)
        self._beam_rad = beamwidths_rad(block)
        self._draws = block.stream("clutter false alarms")
        axes = (
            (cells.azimuth_rad, cells.azimuth),
            (cells.elevation_rad, cells.elevation),
            (cells.range_m, cells.range),
        )
        #: Size of the cells, and their first edges.
        self._size = [width / count for (_, width), count in axes]
        self._start = [start for (start, _), _ in axes]
        centres = [
            start + (np.arange(count) + 0.5) * size
            for ((start, _), count), size in zip(axes, self._size, strict=True)
        ]
        self._range_m = centres[2]
        azimuth, elevation = (grid.ravel() for grid in np.meshgrid(*centres[:2], indexing="ij"))
        self._beams = azimuth, elevation

    @cached_property
    def _crossing(self) -> Crossing:
        """The threshold; known after setup."""
        crossing: Crossing = self._block.crossing
        return crossing

    @cached_property
    def _body(self) -> Vector:
        """Where the beams truly point in body axes; the sensor's are known once all is built."""
        x, y, z = unit_vector(*self._block.axes.pointing(*self._beams))
        return x, y, z

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Return the report with the ground's false alarms of its scans."""
        numbers = zip(rows.tolist(), detections.scan.tolist(), strict=True)
        found = [self._of_scan(targets, row, scan) for row, scan in numbers]
        counts = [len(cell) for cell, _ in found]
        row = np.repeat(np.arange(len(found)), counts)
        if len(row) == 0:
            return detections
        cell, cnr = (np.concatenate(parts) for parts in zip(*found, strict=True))
        scan, key = detections.scan[row], cell.astype(np.uint64)
        beam, depth = np.divmod(cell, self._cells.range)
        across, upwards = np.divmod(beam, self._cells.elevation)
        where = {
            name: start + (number + self._draws.uniform(key, scan, draw)) * size
            for draw, (name, number, start, size) in enumerate(
                zip(("azimuth", "elevation", "range"), (across, upwards, depth), self._start,
                    self._size, strict=True), start=1,
            )
        }  # fmt: skip
        # What lies beyond the threshold of an exponential power is exponential again.
        beyond = -np.log1p(-self._draws.uniform(key, scan, 4)) * (1.0 + cnr)
        snr = np.maximum(beyond + self._crossing.threshold - 1.0, FAINTEST)
        rate = self._draws.uniform(key, scan, 5)
        alarms = Alarms(row, key + _OF_GROUND, where, snr, rate)
        joined = self._block.with_noise_reports(detections, targets, rows, alarms)
        # Without any here, the report is in that order already.
        return in_measured_order(joined)

    def _of_scan(
        self, targets: RelativeTargets, row: int, scan: int
    ) -> tuple[IntArray, FloatArray]:
        """Return the cells that the ground crosses the threshold in, and their CNR."""
        if targets.own_attitude is None:
            raise ValueError("clutter's false alarms need to know how the ownship is turned")
        own_alt_m = float(targets.own_alt_m[row])
        turned = [
            float(targets.own_attitude[f"{name}_rad"][row]) for name in ("yaw", "pitch", "roll")
        ]
        elevation_rad = -np.arcsin(np.clip(body_to_ned(*self._body, *turned)[2], -1.0, 1.0))
        parts = [
            (depth + beam * self._cells.range, *self._clutter(own_alt_m, depth, away))
            for depth, beam, away in self._lit(own_alt_m, elevation_rad)
        ]
        if not parts:
            return np.empty(0, dtype=np.int64), np.empty(0)
        cell, pfa, cnr = (np.concatenate(each) for each in zip(*parts, strict=True))
        # Beyond noise, whose false alarms are reported anyway.
        of_noise = self._crossing.false_alarm_probability
        extra = (pfa - of_noise) / (1.0 - of_noise)
        if (most := float(extra.sum())) > MOST_PER_SCAN:
            raise ValueError(
                f"clutter_threshold is 'noise': the ground makes {most:,.0f} false alarms in a "
                f"scan, and at most {MOST_PER_SCAN:,.0f} are allowed; 'adaptive' keeps their number"
            )
        draw = self._draws.uniform(cell.astype(np.uint64), np.full(len(cell), scan), 0)
        crossing = np.flatnonzero(draw < extra)
        return cell[crossing], cnr[crossing]

    def _lit(
        self, own_alt_m: float, elevation_rad: FloatArray
    ) -> Iterator[tuple[int, IntArray, FloatArray]]:
        """Give each range cell with clutter, the beams that meet it, and where they point."""
        if any(echo.diffuse for echo in self._block.echoes):
            everywhere = np.arange(len(elevation_rad))
            for depth in range(len(self._range_m)):
                yield depth, everywhere, elevation_rad
            return
        height_m = own_alt_m - self._terrain.height_m
        reach_rad = BEAM_REACH_BEAMWIDTHS * self._beam_rad[1]
        for depth, range_m in enumerate(self._range_m.tolist()):
            if range_m >= height_m:
                off = elevation_rad + math.asin(height_m / range_m)
                beam = np.flatnonzero(np.abs(off) <= reach_rad)
                if len(beam):
                    yield depth, beam, elevation_rad[beam]

    def _clutter(
        self, own_alt_m: float, depth: int, elevation_rad: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return how often the clutter in some cells crosses the threshold, and its CNR."""
        range_m = np.full(len(elevation_rad), self._range_m[depth])
        mean, diffuse = np.zeros(len(range_m)), np.zeros(len(range_m))
        for echo in self._block.echoes:
            alt_m = own_alt_m + range_m * np.sin(elevation_rad)
            if not echo.diffuse:
                alt_m = np.full(len(range_m), self._terrain.height_m)
            cells: Any = _CellsOf(range_m, own_alt_m, elevation_rad, alt_m)
            cnr = self._block.echo_snr(cells, echo(cells))
            if echo.diffuse:
                diffuse = diffuse + cnr
            else:
                mean = mean + cnr
        pfa = clutter_detection_probability(
            0.0,
            mean,
            false_alarm_probability=0.5,  # the threshold says more
            diffuse_cnr=diffuse,
            clutter=self._block.context.sections["terrain"].clutter_mean,
            noise_threshold=self._crossing.threshold,
        )
        return pfa, mean + diffuse
