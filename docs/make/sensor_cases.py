"""Hard cases of the numerics: radar detection and the optical signature."""

import math
from typing import Any

import numpy as np

from components.high_precision.multiprecision import mpmath_library
from components.optical.signature import line_of_sight_rate, pixels_covered
from components.optical.silhouette import visible_area
from components.radar.detection import (
    detection_probability,
    detection_threshold,
    miss_probability,
)
from components.radar.link_budget import LinkBudget
from docs.make.numerical_cases import DEG, NumericalCase


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
    mpmath = mpmath_library()
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
    mpmath = mpmath_library()
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
    mpmath = mpmath_library()
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


_SIDE: dict[str, Any] = {"front_m2": 0.0, "side_m2": 1.0, "horizontal_m2": 0.0}
_PLATE: dict[str, Any] = {"front_m2": 0.0, "side_m2": 0.0, "horizontal_m2": 1.0}


def optical_cases() -> list[NumericalCase]:
    """Return the hard cases of the optical signature."""
    climbing = (math.pi, 5 * DEG, 0.0, -5 * DEG)
    from_below = (math.pi, 0.0, 0.0, 30 * DEG)
    nose_on = (1e-9, 0.0, 0.0, 0.0)
    return [
        NumericalCase("1e-9 rad off the nose: share of the side shown", "sqrt(1 - cos²)",
             math.sqrt(1.0 - math.cos(1e-9) ** 2), float(visible_area(*nose_on, **_SIDE)),
             math.sin(1e-9), "sin(1e-9)"),
        NumericalCase("climbs 5° straight at us: share of the side shown", "thesis eq. 12",
             float(visible_area(*climbing, **_SIDE, model="thesis")),
             round(float(visible_area(*climbing, **_SIDE)), 12), 0.0, "seen along its axis"),
        NumericalCase("head-on from 30° below: share of the plate shown", "thesis eq. 13",
             float(visible_area(*from_below, **_PLATE, model="thesis")),
             float(visible_area(*from_below, **_PLATE)), 0.5, "sin 30°"),
        _rate("bearing from 179.5° to -179.5° in 0.1 s: rate, rad/s", (-179.5, 0.0), (179.5, 0.0),
              0.1),
        _rate("overhead at 89.9°, 20 Hz: rate, rad/s", (180.0, 89.9), (0.0, 89.9), 0.05),
        _rate("1e-9 rad between looks, 1 s: rate, rad/s", (1e-9 / DEG, 0.0), (0.0, 0.0), 1.0),
        NumericalCase("12 m² at range 0: pixels covered", "thesis eq. 14-15", math.inf,
             float(pixels_covered(12.0, 0.0, pixel_azimuth_rad=6e-4, pixel_elevation_rad=5e-4,
                                  sensor_pixels=6144.0 * 2048.0)),
             6144.0 * 2048.0, "the sensor's own"),
    ]  # fmt: skip


def _rate(
    what: str, now_deg: tuple[float, float], before_deg: tuple[float, float], interval_s: float
) -> NumericalCase:
    now, before = ((x * DEG, y * DEG) for x, y in (now_deg, before_deg))
    if what.startswith("1e-9"):
        # The angle between the two unit vectors, by the cosine.
        formula, turned = "acos(a·b)", math.acos(math.cos(now[0] - before[0]))
    else:
        formula, turned = "thesis eq. 16-17", math.hypot(now[0] - before[0], now[1] - before[1])
    mpmath = mpmath_library()
    with mpmath.workdps(40):
        (p1, q1), (p2, q2) = (tuple(mpmath.mpf(x) for x in pair) for pair in (before, now))
        # Haversine: sums of squares only.
        half = mpmath.sin((q2 - q1) / 2) ** 2 + mpmath.cos(q1) * mpmath.cos(q2) * (
            mpmath.sin((p2 - p1) / 2) ** 2
        )
        truth = float(2 * mpmath.asin(mpmath.sqrt(half)) / mpmath.mpf(interval_s))
    ours = line_of_sight_rate(*now, *before, interval_s)
    return NumericalCase(
        what, formula, turned / interval_s, float(ours), truth, "mpmath", digits=10
    )
