"""False alarms as an effect: what noise alone adds to a radar's report."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from components.messages.detections import Detections
from components.messages.false_detections import in_measured_order
from components.messages.targets import RelativeTargets
from components.radar.false_alarms import false_alarm_count, false_alarm_snr
from components.radar.field_of_view import cells_of_radar
from components.radar.measured_strength import FAINTEST
from components.radar.threshold import Crossing
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

MOST_PER_SCAN = 1e5

_NO_TARGET = np.uint64(0)
#: Keys of false alarms within cue cones, beyond any number of those of a scan.
_OF_CUED = 2**40


@dataclass(frozen=True, eq=False)
class Alarms:
    """Hold what crossed a threshold without a target.

    Parameters
    ----------
    row : (n,) of int
        Of the report that each belongs to, ascending.
    key : (n,) of uint64
        Of its draws.
    where : mapping of (n,)
        Place by quantity, in the sensor's axes.
    snr : (n,)
        How strong it came out, linear, above 0.
    rate : (n,)
        Uniform in [0, 1), that says its range rate.
    """

    row: IntArray
    key: AnyArray
    where: Mapping[str, FloatArray]
    snr: FloatArray
    rate: FloatArray


def alarms_are_asked_for(parameters: Any) -> Verdict:
    """Return whether a radar that is switched on has false alarms."""
    if parameters.false_alarms and not parameters.enabled:
        return Verdict(False, "enabled is false")
    return Verdict.of_flag(parameters, "false_alarms")


class FalseAlarms(Effect):
    """False alarms by scan: Binomial(resolution cells, Pfa), anywhere in the field of view.

    Pfa is how often noise crosses the threshold that targets cross, where a look is cued that of
    there. Every resolution cell from the minimum range to ``range_km`` may bring one. They are
    reported as targets are, with no target and nothing true; detections of a scan stand by what
    was measured of them. Where there are some, ``snr_db`` and ``confidence`` are of the output
    that crossed the threshold, for targets too (`MeasuredStrength`), and
    ``detection_probability`` is null for all (``looks`` has it).
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

    Within cue cones, where a radar looks otherwise, noise crosses the threshold of there.

    Parameters
    ----------
    block : LinkBudgetRadar

    Raises
    ------
    ValueError
        If the resolution cells are not known, or, by `refuse_too_many`, more than 1e5 false alarms
        are expected by scan.
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._cells = cells_of_radar(block)
        self._counts = block.stream("false alarms")
        self._places = block.stream("false alarm places")

    @cached_property
    def _crossings(self) -> list[Crossing]:
        """Thresholds elsewhere and, where it is another, within cue cones; known after setup."""
        block = self._block
        cued = block.cued_crossing() if block.built("cue") else None
        return [block.crossing] + ([] if cued is None else [cued])

    def refuse_too_many(self) -> None:
        """Refuse a threshold that noise crosses too often, once it is known."""
        block = self._block
        for crossing in self._crossings:
            expected = self._cells.count * crossing.false_alarm_probability
            if expected > MOST_PER_SCAN:
                raise ValueError(
                    f"{block.noise_key()}: with {self._cells.count:,} "
                    f"resolution cells that makes {expected:,.0f} false alarms by scan, and at "
                    f"most {MOST_PER_SCAN:,.0f} are allowed; noise may cross the threshold with a "
                    f"probability of at most {MOST_PER_SCAN / self._cells.count:.3g}"
                )

    def __call__(
        self, detections: Detections, targets: RelativeTargets, rows: IntArray
    ) -> Detections:
        """Return the report with the false alarms of its scans."""
        for which, crossing in enumerate(self._crossings):
            detections = self._with_alarms(detections, targets, rows, crossing, which)
        return in_measured_order(detections)

    def _with_alarms(
        self,
        detections: Detections,
        targets: RelativeTargets,
        rows: IntArray,
        crossing: Crossing,
        which: int,
    ) -> Detections:
        count = false_alarm_count(
            self._counts.uniform(_NO_TARGET, detections.scan, which),
            cells=self._cells.count,
            false_alarm_probability=crossing.false_alarm_probability,
        )
        row = np.repeat(np.arange(len(count)), count)
        if len(row) == 0:
            return detections
        # Keyed by its number within the scan, where detections are keyed by target.
        number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        key = (number + which * _OF_CUED).astype(np.uint64)
        scan = detections.scan[row]
        across, upwards, outwards, power = (
            self._places.uniform(key, scan, draw) for draw in range(4)
        )
        where = {
            "azimuth": _between(across, self._cells.azimuth_rad),
            "elevation": _between(upwards, self._cells.elevation_rad),
            "range": _between(outwards, self._cells.range_m),
        }
        snr = false_alarm_snr(
            power,
            false_alarm_probability=crossing.false_alarm_probability,
            pulses=crossing.pulses,
            threshold=crossing.threshold,
        )
        rate = self._places.uniform(key, scan, 4)
        alarms = Alarms(row, key, where, np.maximum(snr, FAINTEST), rate)
        cued = bool(which) if len(self._crossings) > 1 else None
        return self._block.with_noise_reports(detections, targets, rows, alarms, cued=cued)


def _between(uniform: Any, field: tuple[float, float]) -> Any:
    start, width = field
    return start + width * uniform
