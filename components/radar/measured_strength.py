"""The strength that a radar measures of what it reports, as an effect."""

from dataclasses import replace
from typing import Any

import numpy as np

from components.radar.measured_snr import measured_snr
from components.sensor.look import Cells, Look
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

#: Noise may barely cross a low threshold; -60 dB stands for nothing.
FAINTEST = 1e-6


class MeasuredStrength(Effect):
    """What a radar knows of a target's echo is what it knows of noise: how strong it came out.

    SNR and confidence of a detection are those of the output that crossed the threshold, by the
    target's own fluctuation and the noise of that look; errors by signal follow from that output
    too. The probability of detection, which only the truth gives, is left out; ``looks`` has what
    decided. Where the draw of a look decides, the same draw says how strong it came out.
    """

    lockstep = True
    name = "measured strength"
    acts_on = "strength"
    neutral = False
    outside_the_proof = "a radar always measures strength"

    def verdict(self, block: Any) -> Verdict:
        """Ask whether the radar is switched on."""
        if not block.p.enabled:
            return Verdict(False, "enabled is false")
        return Verdict(True, "a radar measures strength as it measures places")

    def build(self, block: Any) -> "Strength":
        """Return what measures the strength of detections."""
        return Strength(block)


class Strength:
    """Gives the output that crossed the threshold.

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
        if "snr" not in look.signal:  # a radar of one's own that says no strength
            return look
        block = self._block
        extras = {name: v for name, v in look.extras.items() if name != "detection_probability"}
        if look.tail is None:
            keys = cells.roster.keys_of(cells.target[found])
            tail = 1.0 - self._draws.uniform(keys, cells.scan[found])
        else:
            tail = look.tail[found]
        # Clutter is more noise to the output, as it is to the mean; a threshold that stays at the
        # noise hears it as signal.
        mean = look.signal["snr"][found]
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = np.where(mean > 0.0, 10.0 ** (0.1 * extras["snr_db"][found]) / mean, 1.0)
        heard = floor if block.p.clutter_threshold == "noise" else np.ones(len(found))
        snr = np.empty(len(found))
        for crossing, part in block.crossings_of(cells, found):
            for model, chosen in block.models_in_use(cells):
                some = part[_within(found[part], chosen, len(cells))]
                output = 1.0 + measured_snr(
                    tail[some],
                    mean[some],
                    threshold=crossing.threshold / heard[some],
                    pulses=crossing.pulses,
                    model=f"swerling{model}",
                )
                snr[some] = np.maximum(output * heard[some] - 1.0, 0.0)
        snr_db, confidence = extras["snr_db"].copy(), look.confidence.copy()
        snr_db[found] = 10.0 * np.log10(np.maximum(snr, FAINTEST))
        confidence[found] = snr_db[found] - block.false_alarm_zero_db()
        signal: FloatArray = look.signal["snr"].copy()
        signal[found] = snr
        return replace(
            look, extras={**extras, "snr_db": snr_db}, confidence=confidence, signal={"snr": signal}
        )


def _within(cells: IntArray, chosen: Any, count: int) -> IntArray:
    """Return which of some cells are among the chosen ones."""
    inside = np.zeros(count, dtype=bool)
    inside[chosen] = True
    return np.flatnonzero(inside[cells])
