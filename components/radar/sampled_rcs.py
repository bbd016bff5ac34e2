"""The RCS that a fluctuating target shows in one scan."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from components.arguments.checks import FloatArray, checked_model
from components.radar.rcs import fluctuating_rcs


def scan_rcs(
    mean_rcs_m2: FloatArray,
    draw: Callable[[int], FloatArray],
    *,
    pulses: int,
    model: str,
) -> FloatArray:
    """Return the RCS that a scan's pulses show on average, sampled.

    One draw per scan for ``swerling1`` and ``swerling3``; one per pulse for ``swerling2`` and
    ``swerling4``, whose RCS are averaged. That average is all a square-law detector needs: with a
    steady echo in each pulse the sum of n pulses depends only on the sum of their SNR. So a steady
    target's Pd at the scan's RCS, averaged over scans, is the model's own Pd, whatever the pulses.

    Parameters
    ----------
    mean_rcs_m2 : (m,) array, m²
    draw : function
        Uniform draws in [0, 1), shape (m,), of a given number: 0 for the scan, 0 ... pulses - 1.
    pulses : int
    model : str
        As for `components.radar.rcs.fluctuating_rcs`.

    Returns
    -------
    (m,) array, m²

    Raises
    ------
    ValueError
        If the model is unknown, or an RCS or a draw is out of range.

    Notes
    -----
    Thesis §4.1.2: RCS constant within a scan (I, III) or from pulse to pulse (II, IV).
    """
    name = checked_model(model)
    if name == "swerling0":
        return np.array(mean_rcs_m2)
    if name in ("swerling1", "swerling3"):
        return np.asarray(fluctuating_rcs(mean_rcs_m2, draw(0), name))
    # Pulse after pulse, so that an element's sum has one order in any array.
    total = np.zeros_like(mean_rcs_m2)
    for pulse in range(pulses):
        total += fluctuating_rcs(mean_rcs_m2, draw(pulse)[:, np.newaxis], name)[:, 0]
    return total / pulses
