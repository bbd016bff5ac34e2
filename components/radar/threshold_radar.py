"""A radar that detects above a fixed SNR (``radar.threshold``, thesis §3.5.1)."""

from typing import Any

import numpy as np
from pydantic import Field

from components.radar.aspect_rcs import mean_rcs_m2
from components.radar.parameters import LinkBudgetParameters, budget_report
from components.radar.required_snr import required_snr
from components.radar.weather_effects import WEATHER_EFFECTS, CellFactor
from components.sensor import Cells, Look, Sensor
from dsa_des.types import FloatArray


class ThresholdParameters(LinkBudgetParameters):
    """Parameters of a threshold radar."""

    threshold_db: float | None = Field(
        default=None,
        description="SNR that is detected, dB; by default that of the calibration, or of Pd 0.9.",
    )


class LinkBudgetRadar(Sensor):
    """A radar whose decision rests on the SNR of its link budget."""

    Parameters = LinkBudgetParameters
    measures_range = True
    effects = WEATHER_EFFECTS

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.budget = parameters.link_budget()
        self._snr_factors: list[CellFactor] = []

    def setup(self) -> None:
        """Take what the scene's effects do to the SNR."""
        self._snr_factors = self.built("SNR")

    def snr(self, cells: Cells) -> FloatArray:
        """Return each cell's mean SNR (linear), 0 closer than the minimum range (eq. 7-8)."""
        return self.echo_snr(cells, mean_rcs_m2(cells))

    def echo_snr(self, cells: Cells, rcs_m2: FloatArray) -> FloatArray:
        """Return each cell's SNR for the given cross-sections, with all losses on the way."""
        snr = self.budget.snr(cells.range_m, rcs_m2)
        for factor in self._snr_factors:
            snr = snr * factor(cells)
        return snr

    def steepest_pd(self) -> float | None:
        """Return the largest |dPd / d ln SNR| of any target, or None where Pd jumps."""
        return None

    def required_snr_db(self, pd: float, model: str) -> float:
        """Return the mean SNR in dB at which the probability of detection is `pd`."""
        snr = required_snr(
            pd,
            pulses=self.p.pulses,
            false_alarm_probability=self.p.false_alarm_probability,
            model=model,
        )
        return float(10.0 * np.log10(snr))

    def report(self) -> dict[str, Any]:
        """Return the bandwidth in use."""
        return budget_report(self.name, self.budget)


class ThresholdRadar(LinkBudgetRadar):
    """Detects a target when its mean SNR reaches a threshold.

    Confidence is the SNR above the threshold in dB.
    """

    Parameters = ThresholdParameters

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        if parameters.threshold_db is not None:
            self.threshold_db = float(parameters.threshold_db)
        else:
            known = parameters.calibrate
            pd = 0.9 if known is None else known.pd
            model = "swerling1" if known is None else f"swerling{known.swerling}"
            self.threshold_db = self.required_snr_db(pd, model)

    def look(self, cells: Cells) -> Look:
        """Compare every cell's SNR with the threshold."""
        snr = self.snr(cells)
        echo = snr > 0.0
        snr_db = 10.0 * np.log10(np.where(echo, snr, 1.0))
        margin = snr_db - self.threshold_db
        return Look(echo & (margin >= 0.0), margin, {"snr_db": snr_db})
