"""Hard cases of detection: vanishing and overwhelming SNR, many pulses, small Pfa."""

import math
from typing import Any

import numpy as np

from components.evidence.numerics.case import NumericalCase
from components.high_precision.multiprecision import multiprecision
from components.radar.detection import (
    detection_probability,
    detection_threshold,
    miss_probability,
)
from components.radar.link_budget import LinkBudget


def detection_cases() -> list[NumericalCase]:
    """Return the hard cases of radar detection."""
    return [
        _threshold(),
        _swerling_1("1000 pulses, -60 dB, Swerling I, Pfa 1e-6", 1000, 1e-6, 1e-6),
        _swerling_1("100 pulses, -20 dB, Swerling I, Pfa 1e-12", 100, 1e-12, 1e-2),
        _miss(),
        _gram_charlier(),
        _range_zero(),
    ]


def _threshold() -> NumericalCase:
    from scipy.special import gammaincinv

    return NumericalCase(
        "1 pulse, Pfa 1e-12: threshold V",
        "inverse of P(n, V) at 1 - Pfa",
        float(gammaincinv(1.0, 1.0 - 1e-12)),
        float(detection_threshold(1, 1e-12)),
        -math.log(1e-12),
        "-ln Pfa",
    )


def _swerling_1(what: str, pulses: int, pfa: float, snr: float) -> NumericalCase:
    ours = detection_probability(snr, pulses=pulses, false_alarm_probability=pfa)
    return NumericalCase(
        f"{what}: Pd",
        "thesis eq. 32",
        _equation_32(pulses, pfa, snr),
        float(ours),
        _swerling_1_truth(pulses, pfa, snr),
        "mpmath",
    )


def _equation_32(pulses: int, pfa: float, snr: float) -> float:
    """Give thesis eq. 32 as it stands, in doubles."""
    from scipy.special import gammainc

    v = float(detection_threshold(pulses, pfa))
    # What goes wrong here is the point of the comparison.
    with np.errstate(all="ignore"):
        n, gain = np.float64(pulses), 1.0 + 1.0 / np.float64(pulses * snr)
        return float(
            1.0
            - gammainc(n - 1.0, v)
            + gain ** (n - 1.0) * gammainc(n - 1.0, v / gain) * np.exp(-v / (1.0 + n * snr))
        )


def _threshold_truth(mpmath: Any, pulses: int, pfa: float) -> Any:
    """Solve Q(n, V) = Pfa by Newton's method from the double."""
    v = mpmath.mpf(float(detection_threshold(pulses, pfa)))
    for _ in range(4):
        excess = _upper(mpmath, pulses, v) - mpmath.mpf(pfa)
        v += excess * mpmath.factorial(pulses - 1) / (v ** (pulses - 1) * mpmath.exp(-v))
    return v


def _upper(mpmath: Any, pulses: int, v: Any) -> Any:
    """Return Q(n, V) = exp(-V) (1 + V + V²/2 + ... + V^(n-1)/(n-1)!), all terms positive."""
    term = total = mpmath.mpf(1)
    for m in range(1, pulses):
        term *= v / m
        total += term
    return total * mpmath.exp(-v)


def _swerling_1_truth(pulses: int, pfa: float, snr: float) -> float:
    """Give thesis eq. 32 with digits enough for its cancellation; 2 pulses or more."""
    mpmath = multiprecision()
    # (1 + 1/(n SNR))^(n - 1) and the incomplete gamma function cancel this many digits.
    lost = int(pulses * math.log10(1.0 + 1.0 / (pulses * snr)))
    with mpmath.workdps(60 + lost):
        v = _threshold_truth(mpmath, pulses, pfa)
        echo = pulses * mpmath.mpf(snr)
        gain = 1 + 1 / echo
        x, n = v / gain, pulses - 1
        return float(
            _upper(mpmath, n, v)
            + gain**n * (1 - _upper(mpmath, n, x)) * mpmath.exp(-v / (1 + echo))
        )


def _miss() -> NumericalCase:
    snr = 1e12
    radar: dict[str, Any] = {"pulses": 2, "false_alarm_probability": 1e-6, "model": "swerling2"}
    mpmath = multiprecision()
    with mpmath.workdps(60):
        x = _threshold_truth(mpmath, 2, 1e-6) / (1 + mpmath.mpf(snr))
        truth = float(1 - _upper(mpmath, 2, x))
    return NumericalCase(
        "2 pulses, 120 dB, Swerling II, Pfa 1e-6: 1 - Pd",
        "1 - Pd",
        1.0 - float(detection_probability(snr, **radar)),
        float(miss_probability(snr, **radar)),
        truth,
        "mpmath",
    )


def _gram_charlier() -> NumericalCase:
    """Compare eq. 27 as printed at the point of errata 15."""
    pulses, pfa, snr = 5, 1e-4, 10.0**0.8
    v = float(detection_threshold(pulses, pfa))
    spread = 2.0 * snr + 1.0
    z = (v - pulses * (1.0 + snr)) / math.sqrt(pulses * spread)
    c3 = -(snr + 1.0 / 3.0) / (math.sqrt(pulses) * spread**1.5)
    c4 = (snr + 0.25) / (pulses * spread**2)
    series = (
        c3 * (z * z - 1.0)
        + c4 * z * (3.0 - z * z)
        - 0.5 * c3 * c3 * z * (z**4 - 10.0 * z * z + 15.0)
    )
    printed = 0.5 * math.erfc(z / math.sqrt(2.0)) - math.exp(-0.5 * z * z) * series
    mpmath = multiprecision()
    with mpmath.workdps(50):
        v_exact, echo = _threshold_truth(mpmath, pulses, pfa), pulses * mpmath.mpf(snr)
        weight, truth = mpmath.exp(-echo), mpmath.mpf(0)
        for k in range(300):
            truth += weight * _upper(mpmath, pulses + k, v_exact)
            weight *= echo / (k + 1)
    ours = detection_probability(snr, pulses=pulses, false_alarm_probability=pfa, model="swerling0")
    return NumericalCase(
        "5 pulses, 8 dB, steady, Pfa 1e-4: Pd",
        "thesis eq. 27 as printed",
        printed,
        float(ours),
        float(truth),
        "mpmath",
    )


def _range_zero() -> NumericalCase:
    budget = LinkBudget(power_w=2.5, antenna_gain_db=29.5, bandwidth_hz=486.0, frequency_hz=35e9)
    return NumericalCase(
        "range 0: SNR",
        "thesis eq. 7",
        math.inf,
        float(budget.snr(0.0, 5.0)),
        0.0,
        "no echo inside the minimum range",
    )
