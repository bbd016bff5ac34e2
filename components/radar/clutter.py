"""Detection and false alarms with clutter in the target's cell.

The model. In one look (the pulses of a coherent interval already added up) the receiver sees the
complex amplitude ``target + mean clutter + Gaussian``, against the threshold that was set for noise
alone, or against one that rises with the power of the clutter. The thesis has only the Gaussian
part, of zero mean: noise. Clutter adds to it

- a *mean*: the echo of this patch of ground. It is *constant* (a building, a rock face) or
  *fluctuating* (exponential power from look to look: many scatterers), with a phase that is random
  against the target's;
- a *diffuse* part of zero mean, which is more noise: `diffuse_cnr`.

This follows D. A. Shnidman, "Generalized radar clutter model", IEEE Trans. AES 35(3), 1999, and
"Radar detection in clutter", IEEE Trans. AES 41(3), 2005 (thesis section 5.3.2), whose mean may
fluctuate with a gamma distribution of any shape; here the shape is 1 (exponential) or infinite.
The closed forms are our own derivation for one look; `tests/radar` draws the amplitudes and counts.

With S, C, D the mean power of target, mean clutter and diffuse clutter over the noise, V the
threshold and Q(a, v) Marcum's Q_1(sqrt(2a), sqrt(2v)):

========== ========================= ====================================
target     fluctuating mean          constant mean
========== ========================= ====================================
none       exp(-V/N), N = 1 + C + D  Q(C/N, V/N), N = 1 + D
steady     Q(S/N, V/N)               mean of Q(\\|s + c\\|²/N, V/N) over the phase
exponential exp(-V/(N + S))          Q(C/M, V/M), M = N + S
chi-square 4 exp(-V/M) (1 + V a/M²),  d/da of a Q(C/M, V/M), M = N + a, a = S/2
           M = N + a, a = S/2
========== ========================= ====================================
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    checked_model,
    checked_probability,
    not_negative,
    one_of,
    refuse,
    unflatten,
)
from components.radar.detection import detection_probability
from components.radar.marcum import marcum_q1

KINDS = ("constant", "fluctuating")

# Half circle of phases between a steady target and constant clutter.
_PHASES = 64
# For a threshold that has no largest value.
_ANY_THRESHOLD = math.inf
_SMALLEST_FALSE_ALARM_PROBABILITY = 1e-100
# Of a threshold that noise never crosses.
_LEAST = 1e-300


def clutter_detection_probability(
    snr: ArrayLike,
    cnr: ArrayLike,
    *,
    false_alarm_probability: float,
    model: str = "swerling1",
    clutter: str = "fluctuating",
    diffuse_cnr: ArrayLike = 0.0,
    threshold: str = "noise",
    noise_threshold: float | None = None,
) -> Any:
    """Return the probability that the cell of a target in clutter crosses the threshold.

    Parameters
    ----------
    snr : array_like
        Mean signal-to-noise power ratio S, linear, 0 or more.
    cnr : array_like
        Power of the clutter's mean over the noise, C, linear, 0 or more. Where `cnr` and
        `diffuse_cnr` are 0 the result is `detection_probability`'s, to the bit.
    false_alarm_probability : float
        Of noise alone: it sets the threshold V. 1e-100 to below 1.
    model : str
        ``swerling0`` (or ``swerling5``) … ``swerling4``. In one look I and II are the same, and
        so are III and IV.
    clutter : {"constant", "fluctuating"}
        Whether the clutter's mean fluctuates from look to look.
    diffuse_cnr : array_like
        Power of the clutter's zero-mean part over the noise, D, linear, 0 or more.
    threshold : {"noise", "adaptive"}
        Whether the threshold stays where noise alone has it, or rises with the mean power of noise
        and clutter, V (1 + C + D). Then the false alarms of fluctuating clutter stay what they
        are, and those of a constant mean are fewer.
    noise_threshold : float, optional
        V itself, 0 or more, in place of the probability that noise crosses it, which a double may
        not hold.

    Returns
    -------
    array of the broadcast shape
        In [0, 1].

    Raises
    ------
    ValueError
        If an argument is out of range or a name unknown.

    Notes
    -----
    One look (pulses = 1); for several, clutter's phase against the target's from pulse to pulse
    would have to be known. Formulas above; relative error below 1e-13 (1e-12 of the miss), except a
    steady target in constant clutter: a mean over 64 phases, good to 1e-14 while the weaker of
    the two is below 20 dB, to 1e-8 at 25 dB and 1e-4 at 30 dB.
    """
    name = checked_model(model)
    kind = one_of("clutter", clutter, KINDS)
    rises = one_of("threshold", threshold, ("noise", "adaptive")) == "adaptive"
    pfa = checked_probability("false_alarm_probability", false_alarm_probability)
    refuse(
        "false_alarm_probability",
        pfa,
        np.atleast_1d((pfa < _SMALLEST_FALSE_ALARM_PROBABILITY) | (pfa.ndim > 0)),
        "be one number of at least 1e-100",
    )
    shape, (target, mean, diffuse) = broadcast_flat(
        snr=not_negative("snr", snr),
        cnr=not_negative("cnr", cnr),
        diffuse_cnr=not_negative("diffuse_cnr", diffuse_cnr),
    )
    level = -math.log(float(pfa)) if noise_threshold is None else float(noise_threshold)
    result = np.empty_like(target)
    cluttered = (mean > 0.0) | (diffuse > 0.0)
    clear = ~cluttered
    clear_pfa = float(pfa) if noise_threshold is None else max(math.exp(-level), _LEAST)
    result[clear] = detection_probability(
        target[clear], false_alarm_probability=clear_pfa, model=name
    )
    noise = 1.0 + diffuse[cluttered]
    # A threshold that is so many times higher sees all powers so many times lower.
    over = noise + mean[cluttered] if rises else np.ones_like(noise)
    powers = (target[cluttered] / over, mean[cluttered] / over, noise / over)
    cell = (*powers, level, _ANY_THRESHOLD if rises else 0.0)
    with np.errstate(under="ignore"):  # vanishing probabilities are 0
        found = _fluctuating(name, *cell) if kind == "fluctuating" else _constant(name, *cell)
    result[cluttered] = np.minimum(np.maximum(found, 0.0), 1.0)
    return unflatten(result, shape)


def _fluctuating(
    model: str, target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, most: float
) -> FloatArray:
    noise = noise + mean
    if model == "swerling0":
        # With the mean as noise a threshold that rises is back at v, up to rounding.
        return marcum_q1(target / noise, v / noise, v)
    if model in ("swerling1", "swerling2"):
        return np.exp(-v / (noise + target))
    total = noise + 0.5 * target
    return np.exp(-v / total) * (1.0 + (v / total) * (0.5 * target / total))


def _constant(
    model: str, target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, most: float
) -> FloatArray:
    largest = max(v, most)
    if model == "swerling0":
        return _over_phases(target, mean, noise, v, largest)
    if model in ("swerling1", "swerling2"):
        total = noise + target
        return marcum_q1(mean / total, v / total, largest)
    a = 0.5 * target
    total = noise + a
    return marcum_q1(mean / total, v / total, largest) + a / total * _slope(mean / total, v / total)


def _slope(c: FloatArray, w: FloatArray) -> FloatArray:
    """Return M dQ(C/M, V/M)/dM for c = C/M and w = V/M."""
    from scipy.special import i0e, i1e

    root_c, root_w = np.sqrt(c), np.sqrt(w)
    x = 2.0 * root_c * root_w
    return np.exp(-((root_c - root_w) ** 2)) * (w * i0e(x) - root_c * root_w * i1e(x))


def _over_phases(
    target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, largest: float
) -> FloatArray:
    s, c = np.sqrt(target), np.sqrt(mean)
    total = np.zeros_like(s)
    for phase in (np.arange(_PHASES) + 0.5) * (math.pi / _PHASES):
        # |s + c e^(i phase)|² as (s - c)² + 4 s c cos²(phase/2): never negative.
        power = (s - c) ** 2 + 4.0 * s * c * math.cos(0.5 * phase) ** 2
        total += marcum_q1(power / noise, v / noise, largest)
    return total / _PHASES
