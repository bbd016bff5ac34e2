"""False alarms of noise alone, and of clutter over a threshold that is set for noise."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from components.geometry import Vector, body_to_ned, unit_vector
from components.messages.detections import REPORT, Detections, ReportTransform
from components.messages.false_detections import sort_by_measurement
from components.messages.targets import RelativeTargets
from components.radar.detection.clutter import clutter_detection_probability
from components.radar.detection.detector_output import false_alarm_count, false_alarm_snr
from components.radar.detection.threshold import Crossing
from components.radar.ground_clutter import BEAM_REACH_BEAMWIDTHS, Clutter, terrain_of
from components.radar.measurement import FAINTEST
from components.radar.rain import RainClutter
from components.radar.resolution import cell_azimuth_elevation_range, cells_of_radar
from components.sensor.cued_looks import CUE
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict
from dsa_des.time.clock import ticks_to_nanoseconds

MOST_PER_SCAN = 1e5

_NO_TARGET = np.uint64(0)
#: Keys of false alarms within cue cones, beyond any number of those of a scan.
_OF_CUED = 2**40


class NoiseReports:
    """Adds random false alarms by noise to a radar's reports, scan by scan.

    Within cue cones, where a radar looks otherwise, noise crosses the threshold of there.
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._cells = cells_of_radar(block)
        self._counts = block.stream("false alarms")
        self._places = block.stream("false alarm places")

    @cached_property
    def _crossings_outside_and_in_cues(self) -> list[Crossing]:
        """Thresholds outside and, if they differ, inside cue cones; available after setup."""
        block = self._block
        cued = block.cued_crossing() if block.built(CUE) else None
        return [block.crossing] + ([] if cued is None else [cued])

    def refuse_too_many(self) -> None:
        """Raise ValueError if noise crosses the threshold too often per scan."""
        block = self._block
        for crossing in self._crossings_outside_and_in_cues:
            expected = self._cells.count * crossing.false_alarm_probability
            if expected > MOST_PER_SCAN:
                raise ValueError(
                    f"{block.describe_threshold_key()}: with {self._cells.count:,} "
                    f"resolution cells that makes {expected:,.0f} false alarms by scan, and at "
                    f"most {MOST_PER_SCAN:,.0f} are allowed; noise may cross the threshold with a "
                    f"probability of at most {MOST_PER_SCAN / self._cells.count:.3g}"
                )

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Return the report with the false alarms of its scans."""
        for which, crossing in enumerate(self._crossings_outside_and_in_cues):
            detections = self._add_false_alarms(detections, targets, rows, crossing, which)
        return sort_by_measurement(detections)

    def _add_false_alarms(
        self,
        detections: Detections,
        targets: RelativeTargets,
        rows: IntArray,
        crossing: Crossing,
        which: int,
    ) -> Detections:
        now_ns = ticks_to_nanoseconds(detections.tick, self._block.context.ticks_per_s)
        counts = self._counts.of_runs(detections.run, now_ns)
        count = false_alarm_count(
            counts.uniform(_NO_TARGET, detections.scan, which),
            cells=self._cells.count,
            false_alarm_probability=crossing.false_alarm_probability,
        )
        row = np.repeat(np.arange(len(count)), count)
        if len(row) == 0:
            return detections
        # Keyed by its number within the scan, where detections are keyed by target.
        number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        key = (number + which * _OF_CUED).astype(np.uint64)
        scan, places = detections.scan[row], self._places.of_runs(detections.run[row], now_ns[row])
        across, upwards, outwards, power = (places.uniform(key, scan, draw) for draw in range(4))
        where = {
            "azimuth": _scale_to_field(across, self._cells.azimuth_rad),
            "elevation": _scale_to_field(upwards, self._cells.elevation_rad),
            "range": _scale_to_field(outwards, self._cells.range_m),
        }
        snr = false_alarm_snr(
            power,
            false_alarm_probability=crossing.false_alarm_probability,
            pulses=crossing.pulses,
            threshold=crossing.threshold,
        )
        rate = places.uniform(key, scan, 4)
        snr = np.maximum(snr, FAINTEST)
        cued = bool(which) if len(self._crossings_outside_and_in_cues) > 1 else None
        return self._block.add_noise_reports(
            detections, targets, rows, row, where, key=key, snr=snr, rate=rate, cued=cued
        )


class FalseAlarms(Effect[ReportTransform]):
    """False alarms by scan: Binomial(resolution cells, Pfa), anywhere in the field of view.

    Pfa is how often noise crosses the threshold that targets cross, where a look is cued that of
    there. Every resolution cell from the minimum range to ``range_km`` may bring one. They are
    reported as targets are, with no target and nothing true; detections of a scan stand by what
    was measured of them. Where there are some, ``snr_db`` and ``confidence`` are of the output
    that crossed the threshold, for targets too (`MeasuredStrength`), and
    ``detection_probability`` is null for all (``looks`` has it).
    """

    name = "false alarms"
    acts_on = REPORT
    builds = NoiseReports
    outside_the_proof = "a report without false alarms is what there is without it"

    def verdict(self, block: Any) -> Verdict:
        """Return whether false alarms are simulated: needs ``false_alarms``, a radar that is on."""
        if block.p.false_alarms and not block.p.enabled:
            return Verdict(False, "enabled is false")
        return Verdict.of_flag(block.p, "false_alarms")


def _scale_to_field(uniform: Any, field: tuple[float, float]) -> Any:
    start, width = field
    return start + width * uniform


#: Keys of the ground's errors, beyond those of noise.
_OF_GROUND = np.uint64(2**41)


class _CellsWithoutTarget:
    """Stand-in for cells without a target, passed to effects on the SNR."""

    def __init__(
        self, range_m: FloatArray, own_alt_m: float, elevation_rad: FloatArray, alt_m: FloatArray
    ) -> None:
        self.range_m, self.elevation_rad, self.alt_m = range_m, elevation_rad, alt_m
        self._own_alt_m = own_alt_m

    def __len__(self) -> int:
        return len(self.range_m)

    def field_at_rows(self, name: str) -> AnyArray:
        """Return the ownship's altitude for each cell, m; no other name is known."""
        assert name == "own_alt_m"
        return np.full(len(self), self._own_alt_m)


class GroundReports:
    """Adds random reports of ground clutter to a radar's reports, drawn by cell and scan."""

    def __init__(self, block: Any) -> None:
        self._block, self._terrain = block, terrain_of(block)
        self._cells = cells = cells_of_radar(block)
        _, self._elevation_beamwidth_rad, _ = cell_azimuth_elevation_range(block.p)
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
        """Threshold of the radar, with its false alarm probability; known after setup."""
        crossing: Crossing = self._block.crossing
        return crossing

    @cached_property
    def _beam_vectors_in_body_axes(self) -> Vector:
        """Unit vectors along the true directions of all beams in body axes."""
        x, y, z = unit_vector(*self._block.axes.true_direction_in_body(*self._beams))
        return x, y, z

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Return the report with the ground's false alarms of its scans."""
        numbers = zip(rows.tolist(), detections.run.tolist(), detections.scan.tolist(), strict=True)
        crossed = [self._find_ground_crossings(targets, *number) for number in numbers]
        counts = [len(cell) for cell, _ in crossed]
        row = np.repeat(np.arange(len(crossed)), counts)
        if len(row) == 0:
            return detections
        cell, cnr = (np.concatenate(parts) for parts in zip(*crossed, strict=True))
        scan, key = detections.scan[row], cell.astype(np.uint64)
        draws = self._draws.of_runs(detections.run[row])
        beam, depth = np.divmod(cell, self._cells.range)
        across, upwards = np.divmod(beam, self._cells.elevation)
        where = {
            name: start + (number + draws.uniform(key, scan, draw)) * size
            for draw, (name, number, start, size) in enumerate(
                zip(("azimuth", "elevation", "range"), (across, upwards, depth), self._start,
                    self._size, strict=True), start=1,
            )
        }  # fmt: skip
        # What lies beyond the threshold of an exponential power is exponential again.
        beyond = -np.log1p(-draws.uniform(key, scan, 4)) * (1.0 + cnr)
        snr = np.maximum(beyond + self._crossing.threshold - 1.0, FAINTEST)
        rate = draws.uniform(key, scan, 5)
        joined = self._block.add_noise_reports(
            detections, targets, rows, row, where, key=key + _OF_GROUND, snr=snr, rate=rate
        )
        # Without any here, the report is in that order already.
        return sort_by_measurement(joined)

    def _find_ground_crossings(
        self, targets: RelativeTargets, row: int, run: int, scan: int
    ) -> tuple[IntArray, FloatArray]:
        """Return the indices of the cells in which ground clutter crosses the threshold in a scan,
        and their clutter-to-noise ratios.
        """
        if targets.own_attitude is None:
            raise ValueError("clutter's false alarms need to know how the ownship is turned")
        own_alt_m = float(targets.own_alt_m[row])
        turned = [
            float(targets.own_attitude[f"{name}_rad"][row]) for name in ("yaw", "pitch", "roll")
        ]
        elevation_rad = -np.arcsin(
            np.clip(body_to_ned(*self._beam_vectors_in_body_axes, *turned)[2], -1.0, 1.0)
        )
        parts = [
            (depth + beam * self._cells.range, *self._clutter_pfa_and_cnr(own_alt_m, depth, away))
            for depth, beam, away in self._range_cells_with_beams(own_alt_m, elevation_rad)
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
        draws = self._draws.of_runs(np.full(len(cell), run))
        draw = draws.uniform(cell.astype(np.uint64), np.full(len(cell), scan), 0)
        crossing = np.flatnonzero(draw < extra)
        return cell[crossing], cnr[crossing]

    def _range_cells_with_beams(
        self, own_alt_m: float, elevation_rad: FloatArray
    ) -> Iterator[tuple[int, IntArray, FloatArray]]:
        """Yield each clutter range cell's index, its beams' indices and elevations (rad)."""
        if any(echo.diffuse for echo in self._block.echoes):
            everywhere = np.arange(len(elevation_rad))
            for depth in range(len(self._range_m)):
                yield depth, everywhere, elevation_rad
            return
        height_m = own_alt_m - self._terrain.height_m
        reach_rad = BEAM_REACH_BEAMWIDTHS * self._elevation_beamwidth_rad
        for depth, range_m in enumerate(self._range_m.tolist()):
            if range_m >= height_m:
                off = elevation_rad + math.asin(height_m / range_m)
                beam = np.flatnonzero(np.abs(off) <= reach_rad)
                if len(beam):
                    yield depth, beam, elevation_rad[beam]

    def _clutter_pfa_and_cnr(
        self, own_alt_m: float, depth: int, elevation_rad: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the chance that clutter in a cell's beams is detected, and its ratio to noise."""
        range_m = np.full(len(elevation_rad), self._range_m[depth])
        echoes, powers = self._block.echoes, []
        for echo in echoes:
            alt_m = own_alt_m + range_m * np.sin(elevation_rad)
            if not echo.diffuse:
                alt_m = np.full(len(range_m), self._terrain.height_m)
            cells: Any = _CellsWithoutTarget(range_m, own_alt_m, elevation_rad, alt_m)
            powers.append(self._block.echo_snr(cells, echo(cells)))
        clutter = Clutter.sum_echoes(echoes, powers, len(range_m))
        pfa = clutter_detection_probability(
            0.0,
            clutter.mean,
            false_alarm_probability=0.5,  # the threshold says more
            diffuse_cnr=clutter.diffuse,
            clutter=self._block.context.sections["terrain"].clutter_mean,
            noise_threshold=self._crossing.threshold,
        )
        return pfa, clutter.total


class ClutterAlarms(Effect[ReportTransform]):
    """Reports of cells in which the ground crosses the threshold that noise does not.

    With an adaptive threshold there are none beyond those of noise, whose number it keeps. With
    ``clutter_threshold = "noise"`` every resolution cell that the beam shares with the ground may
    be reported, by its clutter-to-noise ratio, beside the false alarms of noise. The ground is
    where the radar truly looks; behind a moving-target filter none is reported. Rain and what
    sidelobes meet cross it in every cell.
    """

    name = "clutter false alarms"
    acts_on = REPORT
    builds = GroundReports
    outside_the_proof = "a report without the ground is what there is without it"

    def verdict(self, block: Any) -> Verdict:
        """Return whether clutter causes alarms: needs ``false_alarms``, ground and a threshold."""
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


#: Noise above the threshold in one look of a hundred is more than any radar's operator bears.
HIGH_FALSE_ALARM_PROBABILITY = 0.01


#: A false alarm in a million scans is none in any run.
NO_FALSE_ALARMS_PER_SCAN = 1e-6


def high_pfa_warnings(parameters: Any, snr_db: float) -> list[str]:
    """Return a warning in a list if Pfa lets echoes below the noise be detected; else none."""
    pfa = parameters.false_alarm_probability
    if pfa < HIGH_FALSE_ALARM_PROBABILITY or not math.isfinite(snr_db):
        return []
    by_default = "false_alarm_probability" not in parameters.model_fields_set
    whose = "the thesis's, as the scene gives none" if by_default else "as the scene says"
    return [
        f"false_alarm_probability is {pfa:g} per look ({whose}): half of the looks at a target "
        f"detect at an SNR of {snr_db:.1f} dB; with 1e-6, as radars have, it takes far more"
    ]


def false_alarm_count_warnings(block: Any) -> list[str]:
    """Return a sentence on the number of false alarms, if that is large or practically 0."""
    if not (block.p.false_alarms and block.p.enabled):
        return []
    pfa, cells = block.crossing.false_alarm_probability, cells_of_radar(block).count
    noise_key, own = block.describe_threshold_key(), "false_alarm_probability"
    by_default = noise_key.startswith(own) and own not in block.p.model_fields_set
    comes_to = (
        f"with {cells:,} resolution cells that makes {cells * pfa:,.3g} false alarms per scan"
    )
    if pfa >= HIGH_FALSE_ALARM_PROBABILITY:
        whose = " (the thesis's, as the scene gives none)" if by_default else ""
        return [
            f"false_alarms is true and {noise_key}{whose}: {comes_to}, {pfa:.3g} in every cell; "
            "radars have 1e-6 per cell or less"
        ]
    if cells * pfa < NO_FALSE_ALARMS_PER_SCAN:
        return [
            f"false_alarms is true and {noise_key}: {comes_to}, practically none; targets and "
            "noise cross one threshold, and a lower one has both come more often"
        ]
    return []
