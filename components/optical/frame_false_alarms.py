"""The false alarms of a camera, frame by frame."""

from typing import Any

import numpy as np

from components.geometry.field_of_view import sector_width_rad
from components.messages.detections import Detections
from components.messages.false_detections import add_false_detections
from components.optical.false_alarms import false_alarm_direction, false_alarm_in_frame
from dsa_des.block.effect import Effect, Verdict

# Draws 1 and 2 of a frame say where, draw 0 whether.
_WHETHER, _AZIMUTH, _ELEVATION = range(3)
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

    A false alarm is reported on the pixel grid, like a target; its confidence is 0, just at the
    threshold: what is published is how often they come, not how strong they are.

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
        azimuth, elevation, _, measured = block.report_noise(
            where, block.signal_at_threshold(len(row))
        )
        return add_false_detections(
            detections,
            row,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            confidence=0.0,
            measured=measured,
        )
