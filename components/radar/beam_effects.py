"""When within a scan does a radar's beam pass each of its detections?"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from components.messages import Detections
from components.radar.beam_sweep import illumination_offset_s
from components.radar.field_of_view import azimuth_width_rad
from components.target_messages import RelativeTargets
from dsa_des.effects import Effect, Verdict
from dsa_des.types import IntArray


class BeamSweep(Effect):
    """A beam that sweeps once per scan lights each target at an instant of its own.

    The instant is recorded as ``illuminated_s``. Everything else in the report is still that of
    the scan's start: a position is old by up to one period, so it is off by at most the target's
    relative speed times the period (110 m at 110 m/s and 1 Hz).
    """

    name = "beam sweep"
    acts_on = "report"
    # It fills a column that is null without it.
    neutral = False

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``beam_sweep``."""
        return Verdict(block.p.beam_sweep, f"beam_sweep is {str(block.p.beam_sweep).lower()}")

    def build(self, block: Any) -> Callable[..., Detections]:
        """Return what adds the instants to a report."""
        start_rad = block.reach.azimuth_rad[0]
        width_rad = azimuth_width_rad(block.reach)
        period_s = float(1 / block.p.scan_rate_hz)
        ticks_per_s = block.context.ticks_per_s

        def add(detections: Detections, targets: RelativeTargets, rows: IntArray) -> Detections:
            # A false alarm has no true direction: the beam was where it is reported.
            false = detections.target < 0
            azimuth, _ = block.axes(
                np.where(false, detections.azimuth_rad, detections.true_azimuth_rad),
                np.where(false, detections.elevation_rad, detections.true_elevation_rad),
            )
            offset_s = illumination_offset_s(
                azimuth,
                start_rad=start_rad,
                width_rad=width_rad,
                scan_period_s=period_s,
            )
            scan_s = np.repeat(detections.tick / ticks_per_s, np.diff(detections.offsets))
            extras = {**detections.extras, "illuminated_s": scan_s + offset_s}
            return replace(detections, extras=extras)

        return add
