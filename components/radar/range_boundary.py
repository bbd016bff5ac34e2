"""The crudest radar: all inside its range is detected (``radar.range_boundary``, §2.2.2)."""

import numpy as np
from pydantic import Field

from components.radar.parameters import RadarParameters
from components.sensor import Cells, Look, Sensor


class RangeBoundaryParameters(RadarParameters):
    """Parameters of a range boundary radar."""

    range_km: float = Field(gt=0, description="Range inside which every target is detected, km.")


class RangeBoundary(Sensor):
    """Detects every target inside its range, as the DUT/NLDA simulator's radar did.

    Confidence is 40·log10(range limit / range), the SNR margin in dB that a radar would have
    whose threshold lies at the limit.
    """

    Parameters = RangeBoundaryParameters
    measures_range = True

    def look(self, cells: Cells) -> Look:
        """Detect every cell: the gate has kept those out of range away."""
        # A metre is closer than any radar sees; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        return Look(np.ones(len(cells), dtype=bool), 40.0 * np.log10(ratio))
