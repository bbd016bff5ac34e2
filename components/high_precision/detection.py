"""Probabilities of detection at 40 digits, summed over the quanta of the echo.

The yardstick for the reference rungs of ladders. It is slow and needs mpmath.
"""

from typing import Any

from scipy.special import gammainccinv

from components.high_precision.multiprecision import mpmath_library

DIGITS = 40


def detection_probability_error(
    pd: float, snr: float, pulses: int, false_alarm_probability: float, swerling: int
) -> float:
    """Return the absolute error of a detection probability, against mpmath at many digits.

    The sum of `pulses` echoes holds a random number K of signal quanta: Poisson for a steady
    target, negative binomial for a fluctuating one (shape 1, n, 2, 2 n for Swerling I to IV). Given
    K the sum is Gamma(n + K) distributed, so that 1 - Pd = sum of Pr(K = k) P(n + k, V), whose
    terms are positive and soon vanish.

    Parameters
    ----------
    pd : float
        To be judged.
    snr : float
        Mean, per pulse, linear.
    pulses : int
    false_alarm_probability : float
    swerling : int
        0 (steady) to 4.

    Returns
    -------
    float
        Absolute error.

    Raises
    ------
    ImportError
        If mpmath is not installed.
    """
    mp = mpmath_library()
    with mp.workdps(DIGITS):
        miss = _miss_probability(mp, snr, pulses, false_alarm_probability, swerling)
        return float(abs(mp.mpf(float(pd)) - 1 + miss))


def _miss_probability(mp: Any, snr: float, n: int, pfa: float, swerling: int) -> Any:
    threshold = _detection_threshold(mp, n, pfa)
    quanta = n * mp.mpf(float(snr))
    # Negative binomial; a shape of 0 stands for the steady target's Poisson.
    shape = (0, 1, n, 2, 2 * n)[swerling]
    ratio = quanta / (shape + quanta)
    weight = (1 - ratio) ** shape if shape else mp.exp(-quanta)
    # P(n + k, V) is the rest of e^-V V^j / j! from j = n + k on: summed from the far end, where the
    # terms are too small to matter, no digit is lost.
    term = mp.exp(-threshold) * threshold**n / mp.factorial(n)
    terms: list[Any] = []
    smallest = mp.mpf(10) ** (-DIGITS - 5)
    while not terms or n + len(terms) < threshold or term > smallest * terms[0]:
        terms.append(term)
        term *= threshold / (n + len(terms))
    below, rests = mp.mpf(0), []
    for term in reversed(terms):
        below += term
        rests.append(below)
    miss = mp.mpf(0)
    for k, rest in enumerate(reversed(rests), start=1):
        miss += weight * rest
        weight *= (ratio * (shape + k - 1) if shape else quanta) / k
    return miss


def _detection_threshold(mp: Any, n: int, pfa: float) -> Any:
    """Return the threshold V that n noise pulses' sum exceeds with probability Pfa (mpmath)."""
    wanted = mp.mpf(float(pfa))
    if n == 1:
        return -mp.log(wanted)

    def excess(v: Any) -> Any:
        return mp.gammainc(n, v, mp.inf, regularized=True) - wanted

    return mp.findroot(excess, mp.mpf(float(gammainccinv(n, pfa))))
