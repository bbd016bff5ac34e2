"""A radar that detects with the probability its SNR gives (``radar.swerling``, thesis §4.1.2)."""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from components.radar.detection import detection_probability
from components.radar.parameters import LinkBudgetParameters
from components.radar.threshold_radar import LinkBudgetRadar
from components.sensor import Cells, Look


class SwerlingParameters(LinkBudgetParameters):
    """Parameters of a radar with probabilistic detection."""

    swerling: Literal[0, 1, 2, 3, 4, 5] | None = Field(
        default=None, description="Fluctuation model for all targets; by default each its own."
    )
    detection: Literal["exact", "table"] = Field(
        default="exact", description="How Pd is computed: exactly, or by table (error < 1e-6)."
    )
    reference_pd: float = Field(
        default=0.9, gt=0, lt=1, description="Pd whose SNR is the zero of the confidence."
    )


class SwerlingRadar(LinkBudgetRadar):
    """Detects each target with its probability of detection for a fluctuating cross-section.

    One keyed uniform draw per target and scan decides. Confidence is the mean SNR above the SNR
    at which Pd is `reference_pd`, in dB.
    """

    Parameters = SwerlingParameters

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self._draws = self.stream("detection")
        self._reference_db: dict[int, float] = {}

    def look(self, cells: Cells) -> Look:
        """Draw every cell against its probability of detection."""
        snr = self.snr(cells)
        echo = snr > 0.0
        snr_db = 10.0 * np.log10(np.where(echo, snr, 1.0))
        pd = np.empty(len(cells))
        confidence = np.empty(len(cells))
        for model, chosen in self._models(cells):
            pd[chosen] = detection_probability(
                snr[chosen],
                pulses=self.p.pulses,
                false_alarm_probability=self.p.false_alarm_probability,
                model=f"swerling{model}",
                method=self.p.detection,
            )
            confidence[chosen] = snr_db[chosen] - self._reference(model)
        detected = echo & (cells.draws(self._draws) < pd)
        return Look(detected, confidence, {"snr_db": snr_db, "detection_probability": pd})

    def _models(self, cells: Cells) -> list[tuple[int, Any]]:
        """Return each fluctuation model with the cells it holds for."""
        if self.p.swerling is not None:
            return [(self.p.swerling % 5, slice(None))]
        models = cells.of_target(cells.roster.swerling)
        found = np.unique(models).tolist()
        if len(found) == 1:
            return [(found[0], slice(None))]
        return [(model, np.flatnonzero(models == model)) for model in found]

    def _reference(self, model: int) -> float:
        if model not in self._reference_db:
            self._reference_db[model] = self.required_snr_db(
                self.p.reference_pd, f"swerling{model}"
            )
        return self._reference_db[model]
