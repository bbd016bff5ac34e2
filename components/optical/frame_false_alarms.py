"""The false alarms of a camera, frame by frame, and what they look like."""

from typing import Any

import numpy as np

from components.geometry.field_of_view import sector_width_rad
from components.messages.detections import Detections
from components.messages.false_detections import add_false_detections, in_measured_order
from components.optical.detection import false_alarm_direction, false_alarm_signature
from components.radar.detection.output import false_alarm_count
from dsa_des.block.effect import Effect, Verdict

MOST_PER_FRAME = 1e5
# Draw 0 of a frame says how many; of each, by its number, where, how strong and which contrast.
_HOW_MANY, _AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST = range(5)
# Draws that belong to the frame and to no target.
_NO_TARGET = np.uint64(0)


class FrameFalseAlarms(Effect):
    """Noise that reaches the threshold, anywhere in the picture: Binomial(places, Pfa) a frame."""

    lockstep = True
    name = "false alarms"
    acts_on = "report"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``false_alarms`` and ``false_alarms_per_frame``."""
        p = block.p
        if not p.enabled:
            return Verdict(False, "enabled is false")
        if p.false_alarms is not None:
            return Verdict.of_flag(p, "false_alarms")
        if p.false_alarms_per_frame is None:
            return Verdict(False, "neither false_alarms nor false_alarms_per_frame is given")
        rate = p.false_alarms_per_frame
        return Verdict(rate > 0, f"false_alarms_per_frame is {rate:g}")

    def build(self, block: Any) -> "AddedFalseAlarms":
        """Return what adds the false alarms to the report."""
        return AddedFalseAlarms(block)


class AddedFalseAlarms:
    """Draws the false alarms of a camera, keyed by its scans.

    A false alarm is reported as a target would be: on the pixel grid, with the confidence of noise
    that reaches the threshold (`false_alarm_signature`), and with the pixels that follow from its
    signature as a target's do; where targets are seen without noise, it has the contrast of one of
    them. Detections of a frame stand by what was measured of them. With ``marked_false_alarms`` a
    false alarm comes last, with a confidence of 0 and no pixels.

    Parameters
    ----------
    block : Camera

    Raises
    ------
    ValueError
        If more than 1e5 are expected in a frame.
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._reports = block.p.reports_noise and block.p.enabled
        rate = block.detector.false_alarms
        if self._reports and rate > MOST_PER_FRAME:
            found = block.detector
            raise ValueError(
                f"{rate:,.0f} false alarms per frame: the threshold, {found.threshold:.4g}, is "
                f"{found.threshold / found.noise:.3g} standard deviations of noise, and at most "
                f"{MOST_PER_FRAME:,.0f} are allowed; give a higher threshold, a smaller "
                "noise_equivalent_contrast, or false_alarms = false"
            )
        self._draws = block.stream("false alarms")

    def __call__(self, detections: Detections, targets: Any, rows: Any) -> Detections:
        """Return the report with its false alarms."""
        if not self._reports:  # built all the same, it changes nothing
            return detections
        marked = self._block.p.marked_false_alarms
        joined = self._with_alarms(detections, marked)
        return joined if marked else in_measured_order(joined)

    def _with_alarms(self, detections: Detections, marked: bool) -> Detections:
        block, reach = self._block, self._block.reach
        found = block.detector
        count = false_alarm_count(
            self._draws.uniform(_NO_TARGET, detections.scan, _HOW_MANY),
            cells=found.places,
            false_alarm_probability=found.false_alarms / found.places,
        )
        row = np.repeat(np.arange(len(count)), count)
        if len(row) == 0:
            return detections
        first = np.repeat(np.cumsum(count) - count, count)
        number = (np.arange(len(row)) - first).astype(np.uint64)
        scan = detections.scan[row]
        azimuth_draw, elevation_draw, strength, contrast = (
            self._draws.uniform(number, scan, draw)
            for draw in (_AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST)
        )
        across, upward = false_alarm_direction(
            azimuth_draw,
            elevation_draw,
            azimuth_start_rad=reach.azimuth_rad[0],
            azimuth_width_rad=sector_width_rad(*reach.azimuth_rad),
            lowest_elevation_rad=reach.elevation_rad[0],
            highest_elevation_rad=reach.elevation_rad[1],
        )
        where = {"azimuth": across, "elevation": upward, "range": np.full(len(row), np.nan)}
        signature = false_alarm_signature(
            strength, threshold=found.threshold, noise=found.alarm_noise
        )
        contrasts = block.contrasts_of(detections.roster)
        which = contrast * len(contrasts)
        signal = block.signal_of(signature, contrasts[which.astype(np.int64)])
        azimuth, elevation, _, measured = block.report_noise(where, signal)
        return add_false_detections(
            detections,
            row,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            confidence=0.0 if marked else signature - found.threshold,
            extras={} if marked else {"pixels": signal["pixels"]},
            measured=measured,
        )
