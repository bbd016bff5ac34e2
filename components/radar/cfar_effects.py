"""The threshold from the average of reference cells (CFAR) as an effect."""

from typing import Any

from components.radar.cfar import cfar_detection_probability, cfar_loss_db, cfar_required_snr
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class CellAveraging(Effect):
    """Cell-averaging CFAR: the threshold is known from ``cfar_reference_cells`` cells only.

    The cells hold what the cell under test holds but the target: noise, and ground clutter of the
    same power that fluctuates like noise. So the probability of false alarm stays what it is, and
    a target needs the CFAR loss more SNR. A calibrated range is that of a threshold known exactly.
    """

    lockstep = True
    name = "CFAR"
    acts_on = "threshold from reference cells"
    neutral = False
    outside_the_proof = "no number of cells is as good as a threshold that is known"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``cfar_reference_cells``."""
        cells = block.p.cfar_reference_cells
        if cells is None:
            return Verdict(False, "cfar_reference_cells is not given")
        return Verdict(True, f"cfar_reference_cells is {cells}")

    def build(self, block: Any) -> "Averaging":
        """Return the detector of this radar."""
        return Averaging(block.p)


class Averaging:
    """A cell-averaging detector with one radar's pulses and probability of false alarm.

    Parameters
    ----------
    parameters : LinkBudgetParameters
    """

    def __init__(self, parameters: Any) -> None:
        self._settings = {
            "reference_cells": parameters.cfar_reference_cells,
            "false_alarm_probability": parameters.false_alarm_probability,
            "pulses": parameters.pulses_summed,
        }

    def probability(self, snr: FloatArray, model: str) -> FloatArray:
        """Return Pd for powers over noise and clutter (flat array)."""
        found: FloatArray = cfar_detection_probability(snr, model=model, **self._settings)
        return found

    def required_snr(self, pd: float, model: str) -> float:
        """Return the SNR at which Pd is `pd`, linear."""
        return cfar_required_snr(pd, model=model, **self._settings)

    def loss_db(self, pd: float, model: str) -> float:
        """Return what the SNR must be more for Pd `pd` than with a known threshold, dB."""
        return cfar_loss_db(pd, model=model, **self._settings)
