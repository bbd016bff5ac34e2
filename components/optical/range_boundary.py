"""The crudest camera: it sees everything inside its range (``optical.range_boundary``, §2.3.1)."""

import numpy as np
from pydantic import Field

from components.optical.ladder import VISIBLE
from components.sensor.cued_looks import CUED_INPUTS, refuse_cues
from components.sensor.look import Cells, Look
from components.sensor.marks import EO
from components.sensor.parameters import SensorParameters
from components.sensor.sensor import Sensor


class CameraBoundaryParameters(SensorParameters):
    """Parameters of a range boundary camera; the defaults are TECVOL's."""

    range_km: float = Field(
        default=3.0, gt=0, description="Range inside which every target is detected, km."
    )
    azimuth_resolution_deg: float = Field(
        default=0.1, ge=0, description="Grid step of measured azimuth, deg; 0 measures exactly."
    )
    elevation_resolution_deg: float = Field(
        default=0.1, ge=0, description="Grid step of measured elevation, deg; 0 measures exactly."
    )


class OpticalRangeBoundary(Sensor):
    """Detects every target inside its range, as TECVOL's simulated EO system did.

    Confidence is (range limit / range)² - 1, the margin over a threshold of 1 that a camera would
    have whose target is just detected at the limit.
    """

    mark = EO
    Parameters = CameraBoundaryParameters
    inputs = CUED_INPUTS
    lockstep = True
    ladders = (VISIBLE,)

    def setup(self) -> None:
        """Refuse cues: everything inside the range is seen anyway."""
        refuse_cues(self)

    def look(self, cells: Cells) -> Look:
        """Detect every cell: the gate has kept those out of range away."""
        # A metre is closer than any camera looks; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        return Look(np.ones(len(cells), dtype=bool), np.square(ratio) - 1.0)
