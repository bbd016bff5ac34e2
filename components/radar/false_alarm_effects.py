"""False alarms as an effect: what noise alone adds to a radar's report."""

from typing import Any

import numpy as np

from components.messages.detections import Detections
from components.messages.false_detections import add_false_detections, in_measured_order
from components.messages.targets import RelativeTargets
from components.radar.false_alarms import false_alarm_count, false_alarm_snr
from components.radar.field_of_view import cells_of_radar
from dsa_des.arrays.types import IntArray
from dsa_des.block.effect import Effect, Verdict

MOST_PER_SCAN = 1e5

_NO_TARGET = np.uint64(0)


def alarms_are_asked_for(parameters: Any) -> Verdict:
    """Return whether a radar that is switched on has false alarms."""
    if parameters.false_alarms and not parameters.enabled:
        return Verdict(False, "enabled is false")
    return Verdict.of_flag(parameters, "false_alarms")


class FalseAlarms(Effect):
    """False alarms by scan: Binomial(resolution cells, Pfa), anywhere in the field of view.

    Every resolution cell from the minimum range to ``range_km`` may bring one. They are reported
    as targets are, with no target and nothing true; detections of a scan stand by what was
    measured of them. Where there are some, ``snr_db`` and ``confidence`` are of the output that
    crossed the threshold, for targets too (`MeasuredStrength`), and ``detection_probability`` is
    null for all (``looks`` has it).
    """

    lockstep = True
    name = "false alarms"
    acts_on = "report"
    neutral = False
    outside_the_proof = "a report without false alarms is what there is without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``false_alarms``, and whether the radar is switched on."""
        return alarms_are_asked_for(block.p)

    def build(self, block: Any) -> "NoiseReports":
        """Return what adds false alarms to a report."""
        return NoiseReports(block)


class NoiseReports:
    """Draws each scan's false alarms with keys of their own.

    Parameters
    ----------
    block : Sensor
        A radar with a link budget.

    Raises
    ------
    ValueError
        If the resolution cells are not known, or more than 1e5 false alarms are expected by scan.
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._cells = cells_of_radar(block)
        self._pfa = block.p.cell_pfa
        expected = self._cells.count * self._pfa
        if expected > MOST_PER_SCAN:
            key = "cell_false_alarm_probability"
            if getattr(block.p, key) is None:
                key += " (not given: false_alarm_probability)"
            raise ValueError(
                f"{key} is {self._pfa:g}: with {self._cells.count:,} "
                f"resolution cells that makes {expected:,.0f} false alarms by scan, and at most "
                f"{MOST_PER_SCAN:,.0f} are allowed; it must be at most "
                f"{MOST_PER_SCAN / self._cells.count:.3g}"
            )
        self._counts = block.stream("false alarms")
        self._places = block.stream("false alarm places")

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Return the report with the false alarms of its scans."""
        return in_measured_order(self._with_alarms(detections))

    def _with_alarms(self, detections: Detections) -> Detections:
        count = false_alarm_count(
            self._counts.uniform(_NO_TARGET, detections.scan),
            cells=self._cells.count,
            false_alarm_probability=self._pfa,
        )
        row = np.repeat(np.arange(len(count)), count)
        if len(row) == 0:
            return detections
        # Keyed by its number within the scan, where detections are keyed by target.
        number = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)).astype(
            np.uint64
        )
        scan = detections.scan[row]
        across, upwards, outwards, power = (
            self._places.uniform(number, scan, draw) for draw in range(4)
        )
        summed = self._block.p.pulses_summed
        snr = false_alarm_snr(power, false_alarm_probability=self._pfa, pulses=summed)
        # Noise may barely cross a low threshold; -60 dB stands for nothing.
        snr_db = 10.0 * np.log10(np.maximum(snr, 1e-6))
        where = {
            "azimuth": _between(across, self._cells.azimuth_rad),
            "elevation": _between(upwards, self._cells.elevation_rad),
            "range": _between(outwards, self._cells.range_m),
        }
        if self._block.p.measures_range_rate:
            rate = self._block.noise_range_rate(self._places.uniform(number, scan, 4))
            where["range_rate"] = rate
        azimuth, elevation, range_m, measured = self._block.report_noise(where, {"snr": snr})
        return add_false_detections(
            detections,
            row,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            range_m=range_m,
            confidence=snr_db - self._block.false_alarm_zero_db(),
            extras={"snr_db": snr_db},
            measured=measured,
        )


def _between(uniform: Any, field: tuple[float, float]) -> Any:
    start, width = field
    return start + width * uniform
