"""The crudest radar: all inside its range is detected (``radar.range_boundary``, §2.2.2)."""

import numpy as np
from pydantic import Field

from components.radar.beam_effects import BeamSweep
from components.radar.ladder import DETECTION
from components.radar.parameters import RadarParameters
from components.radar.radar_block import Radar
from components.radar.range_effects import BlindRange
from components.radar.range_rate import RangeRate
from components.radar.resolution_effects import OneReportByCell
from components.sensor.look import Cells, Look


class RangeBoundaryParameters(RadarParameters):
    """Parameters of a range boundary radar."""

    range_km: float = Field(gt=0, description="Range inside which every target is detected, km.")
    minimum_range_m: float | None = Field(
        default=None, gt=0, description="Closer than this nothing is detected, m; none by default."
    )


class RangeBoundary(Radar):
    """Detects every target inside its range, as the DUT/NLDA simulator's radar did.

    Confidence is 40·log10(range limit / range), the SNR margin in dB that a radar would have
    whose threshold lies at the limit.
    """

    Parameters = RangeBoundaryParameters
    lockstep = True
    effects = (RangeRate(), BlindRange(), OneReportByCell(), BeamSweep())
    ladders = (DETECTION,)

    def look(self, cells: Cells) -> Look:
        """Detect every cell: the gate has kept those out of range away."""
        # A metre is closer than any radar sees; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        detected = np.ones(len(cells), dtype=bool)
        for factor in self.snr_factors:
            detected &= factor(cells) > 0.0
        # Of equal targets the nearer one has the stronger echo.
        detected &= self.resolved(cells, np.where(detected, ratio**4, 0.0)) > 0.0
        return Look(detected, 40.0 * np.log10(ratio))
