"""Fluctuation that lasts: a radar that looks again soon sees the same fade again."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.geometry.attitude import aspect_angles, unit_vector
from components.radar.rcs_effects import RcsFluctuation
from components.radar.scatterers import CHANGING, FIXED, Scatterers
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict
from dsa_des.time.gauss_markov import GaussMarkov

#: (cells, chosen of them, Swerling model) → power of each echo over its mean.
Fading = Callable[[Cells, Any, int], FloatArray]


def fading_power(amplitudes: list[FloatArray]) -> FloatArray:
    """Return the power of an echo over its mean, from the real and imaginary parts of amplitudes.

    Parameters
    ----------
    amplitudes : list of arrays
        Independent standard normal processes: two for exponential power (one complex amplitude of
        many scatterers, Swerling I and II), four for chi-square of 4 degrees of freedom (two such
        amplitudes, III and IV).

    Returns
    -------
    array
        Of mean 1. Where the amplitudes are correlated with ρ, it is with ρ².

    Notes
    -----
    The complex Gaussian amplitude behind the Swerling cases: P. Swerling, "Probability of detection
    for fluctuating targets", IRE Trans. IT-6(2), 1960.
    """
    total = np.zeros_like(amplitudes[0])
    for part in amplitudes:
        total += part * part
    return total / len(amplitudes)


class LastingFluctuation(Effect):
    """Echoes whose complex amplitude lasts: in time, and in the aspect that the radar has.

    With ``fluctuation_correlation_s`` the amplitude of each target is a Gauss-Markov process: its
    correlation falls as exp(-|dt|/τ), that of the power as exp(-2 |dt|/τ), whenever the radar
    looks. With ``scintillation_extent_m`` it is that of scatterers on the target's body
    (`components.radar.scatterers`), which changes as the target turns or passes; with both, the
    correlations multiply. A look is detected with a steady target's Pd at the power it meets; over
    many looks far apart that is the Swerling model's own Pd. Where pulses are summed, Swerling II
    and IV change from pulse to pulse and do not last.

    An aspect table's mean is multiplied by it.
    """

    lockstep = True
    name = "lasting fluctuation"
    acts_on = "fading"
    neutral = False
    outside_the_proof = "without it every scan draws a fade of its own"

    def verdict(self, block: Any) -> Verdict:
        """Ask for the two keys, and whether anything fluctuates."""
        lasts_s, extent_m = block.p.fluctuation_correlation_s, block.p.scintillation_extent_m
        if lasts_s is None and extent_m is None:
            return Verdict(
                False, "fluctuation_correlation_s and scintillation_extent_m are not given"
            )
        fluctuates = RcsFluctuation().verdict(block)
        if not fluctuates.simulated:
            return Verdict(False, fluctuates.because)
        said = []
        if lasts_s is not None:
            said.append(
                f"fluctuation_correlation_s is {lasts_s:g}: the power of looks {lasts_s / 2:g} s "
                "apart is correlated with 0.368"
            )
        if extent_m is not None:
            apart_deg = np.degrees(0.5 * block.budget.wavelength / extent_m)
            said.append(
                f"scintillation_extent_m is {extent_m:g}: aspects {apart_deg:.2g} deg apart fade "
                "each by itself"
            )
        return Verdict(True, "; ".join(said))

    def build(self, block: Any) -> Fading:
        """Return each echo's power over its mean, at the instant of its look."""
        lasts_s, extent_m = block.p.fluctuation_correlation_s, block.p.scintillation_extent_m
        process = None if lasts_s is None else GaussMarkov(block.stream("fading"), lasts_s)
        scatterers = None
        if extent_m is not None:
            scatterers = Scatterers(
                block.stream("scatterers"),
                extent_m,
                block.budget.wavelength,
                FIXED if process is None else CHANGING,
            )

        def fading(cells: Cells, chosen: Any, model: int) -> FloatArray:
            keys = cells.roster.keys_of(cells.target)[chosen]
            instant_ns, replica = cells.instant_ns[chosen], cells.replica[chosen]

            def pair(number: int) -> tuple[FloatArray, FloatArray]:
                assert process is not None
                real, imaginary = (
                    process(keys, instant_ns, 2 * number + part, replica) for part in (0, 1)
                )
                return real, imaginary

            amplitudes: list[FloatArray] = []
            for which in range(2 if model in (3, 4) else 1):
                if scatterers is None:
                    amplitudes += pair(which)
                    continue
                aspect = _aspect(cells, chosen)
                strengths = None if process is None else pair
                amplitudes += scatterers.echo(keys, aspect, which, strengths, replica)
            return fading_power(amplitudes)

        return fading


def _aspect(cells: Cells, chosen: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the unit vector from each target to the radar in the target's body axes."""
    azimuth, elevation = aspect_angles(
        np.zeros(len(cells)),
        cells.elevation_rad,
        cells.relative_heading_rad,
        cells.target_pitch_rad,
        cells.target_roll_rad,
    )
    x, y, z = unit_vector(azimuth[chosen], elevation[chosen])
    return x, y, z
