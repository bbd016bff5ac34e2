"""The false alarms of a camera, frame by frame, and what they look like."""

from typing import Any

import numpy as np

from components.geometry.field_of_view import sector_width_rad
from components.messages.detections import Detections
from components.messages.false_detections import add_false_detections, in_measured_order
from components.optical.false_alarms import (
    false_alarm_direction,
    false_alarm_in_frame,
    false_alarm_signature,
)
from dsa_des.block.effect import Effect, Verdict

# Draw 0 of a frame says whether, the others where, how strong and of which contrast.
_WHETHER, _AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST = range(5)
# Draws that belong to the frame and to no target.
_NO_TARGET = np.uint64(0)


class FrameFalseAlarms(Effect):
    """At most one false alarm per frame, anywhere in the picture."""

    lockstep = True
    name = "false alarms"
    acts_on = "report"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``false_alarms_per_frame``."""
        if not block.p.enabled:
            return Verdict(False, "enabled is false")
        share = block.p.false_alarms_per_frame
        return Verdict(share > 0, f"false_alarms_per_frame is {share:g}")

    def build(self, block: Any) -> "AddedFalseAlarms":
        """Return what adds the false alarms to the report."""
        return AddedFalseAlarms(block, block.p.false_alarms_per_frame if block.p.enabled else 0.0)


class AddedFalseAlarms:
    """Draws the false alarms of a camera, keyed by its scans.

    A false alarm is reported as a target would be: on the pixel grid, with the confidence of noise
    that crosses the threshold (`false_alarm_signature`), and with the pixels that a target of that
    signature covers whose contrast is one of those of the scene's targets. Detections of a frame
    stand by what was measured of them. With ``marked_false_alarms`` a false alarm comes last, with
    a confidence of 0 and no pixels.

    Parameters
    ----------
    block : Camera
    probability : float
        Per frame.
    """

    def __init__(self, block: Any, probability: float) -> None:
        self._block = block
        self._probability = probability
        self._draws = block.stream("false alarms")

    def __call__(self, detections: Detections, targets: Any, rows: Any) -> Detections:
        """Return the report with its false alarms."""
        if not self._probability:  # built all the same, it changes nothing
            return detections
        marked = self._block.p.marked_false_alarms
        joined = self._with_alarms(detections, marked)
        return joined if marked else in_measured_order(joined)

    def _with_alarms(self, detections: Detections, marked: bool) -> Detections:
        whether = self._draws.uniform(_NO_TARGET, detections.scan, _WHETHER)
        row = np.flatnonzero(false_alarm_in_frame(whether, self._probability))
        if len(row) == 0:
            return detections
        scan = detections.scan[row]
        block, reach = self._block, self._block.reach
        across, upward = false_alarm_direction(
            self._draws.uniform(_NO_TARGET, scan, _AZIMUTH),
            self._draws.uniform(_NO_TARGET, scan, _ELEVATION),
            azimuth_start_rad=reach.azimuth_rad[0],
            azimuth_width_rad=sector_width_rad(*reach.azimuth_rad),
            lowest_elevation_rad=reach.elevation_rad[0],
            highest_elevation_rad=reach.elevation_rad[1],
        )
        where = {"azimuth": across, "elevation": upward, "range": np.full(len(row), np.nan)}
        signature = false_alarm_signature(
            self._draws.uniform(_NO_TARGET, scan, _STRENGTH),
            threshold=block.p.threshold,
            false_alarm_probability=self._probability,
        )
        contrasts = block.contrasts_of(detections.roster)
        which = self._draws.uniform(_NO_TARGET, scan, _CONTRAST) * len(contrasts)
        signal = block.signal_of(signature, contrasts[which.astype(np.int64)])
        azimuth, elevation, _, measured = block.report_noise(where, signal)
        return add_false_detections(
            detections,
            row,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            confidence=0.0 if marked else signature - block.p.threshold,
            extras={} if marked else {"pixels": signal["pixels"]},
            measured=measured,
        )
