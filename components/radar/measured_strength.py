"""The strength that a radar measures of what it reports, as an effect of false alarms."""

from dataclasses import replace
from typing import Any

import numpy as np

from components.radar.false_alarm_effects import alarms_are_asked_for
from components.radar.false_alarms import measured_snr
from components.sensor.look import Cells, Look
from dsa_des.arrays.types import IntArray
from dsa_des.block.effect import Effect, Verdict


class MeasuredStrength(Effect):
    """What a radar knows of a target's echo is what it knows of noise: how strong it came out.

    SNR and confidence of a detection are those of the output that crossed the threshold, its
    errors by signal follow from that output too, and the probability of detection, which only the
    truth gives, is left out. ``looks`` has what decided.
    """

    lockstep = True
    name = "measured strength"
    acts_on = "strength"
    neutral = False
    outside_the_proof = "without false alarms a report says what decided it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``false_alarms``, and whether the radar is switched on."""
        return alarms_are_asked_for(block.p)

    def build(self, block: Any) -> "Strength":
        """Return what measures the strength of detections."""
        return Strength(block)


class Strength:
    """Draws the output that crossed the threshold, keyed by target and scan.

    Parameters
    ----------
    block : LinkBudgetRadar
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._draws = block.stream("measured strength")

    def __call__(self, cells: Cells, found: IntArray, look: Look) -> Look:
        """Return the look with the measured strength of the cells that are detected.

        Parameters
        ----------
        cells : Cells
        found : (n,) of int
            Those that are detected; of others nothing is measured.
        look : Look
        """
        extras = {name: v for name, v in look.extras.items() if name != "detection_probability"}
        keys = cells.roster.keys_of(cells.target[found])
        mean = 10.0 ** (0.1 * extras["snr_db"][found])
        snr = measured_snr(
            self._draws.uniform(keys, cells.scan[found]),
            mean,
            false_alarm_probability=self._block.p.cell_pfa,
            pulses=self._block.p.pulses_summed,
        )
        snr_db, confidence = extras["snr_db"].copy(), look.confidence.copy()
        snr_db[found] = 10.0 * np.log10(np.maximum(snr, 1e-6))
        confidence[found] = snr_db[found] - self._block.false_alarm_zero_db()
        # Clutter is more noise to the output, as it is to the mean.
        signal = look.signal["snr"].copy()
        signal[found] *= snr / mean
        return replace(
            look, extras={**extras, "snr_db": snr_db}, confidence=confidence, signal={"snr": signal}
        )
