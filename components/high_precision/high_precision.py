"""What blocks compute, computed again at 40 digits by other means.

These are the yardsticks for the reference rungs of ladders. They are slow and need mpmath.
"""

from typing import Any

from components.evidence.numerics.case import multiprecision

DIGITS = 40


def line_of_sight_errors(
    own: tuple[float, float, float],
    other: tuple[float, float, float],
    attitude: tuple[float, float, float],
    given: tuple[float, float, float],
) -> tuple[float, float, float, float]:
    """Return the errors of a line of sight in the ownship's body axes.

    Through Earth-centred coordinates, the textbook way that loses digits in doubles.

    Parameters
    ----------
    own, other : latitude and longitude in degrees, altitude in metres (WGS-84)
    attitude : yaw, pitch and roll of the ownship (ZYX), rad
    given : azimuth and elevation in body axes in rad and slant range in m, to be judged

    Returns
    -------
    direction, azimuth, elevation : float, rad
    range : float, m

    Raises
    ------
    ImportError
        If mpmath is not installed.
    """
    mp = multiprecision()
    with mp.workdps(DIGITS):
        here, there = _earth_centred(mp, *own), _earth_centred(mp, *other)
        apart = [t - h for t, h in zip(there, here, strict=True)]
        body = _to_body(mp, _to_ned(mp, apart, own[0], own[1]), attitude)
        distance = mp.sqrt(sum(part * part for part in body))
        azimuth = mp.atan2(body[1], body[0])
        elevation = mp.atan2(-body[2], mp.hypot(body[0], body[1]))
        p, q = mp.mpf(float(given[0])), mp.mpf(float(given[1]))
        seen = (mp.cos(q) * mp.cos(p), mp.cos(q) * mp.sin(p), -mp.sin(q))
        across = _cross(seen, body)
        along = sum(s * b for s, b in zip(seen, body, strict=True))
        off = mp.atan2(mp.sqrt(sum(part * part for part in across)), along)
        turn = p - azimuth
        turn -= 2 * mp.pi * mp.nint(turn / (2 * mp.pi))
        return (
            float(off),
            float(abs(turn)),
            float(abs(q - elevation)),
            float(abs(mp.mpf(float(given[2])) - distance)),
        )


def _earth_centred(mp: Any, lat_deg: float, lon_deg: float, alt_m: float) -> tuple[Any, ...]:
    flattening = 1 / mp.mpf("298.257223563")
    e2 = flattening * (2 - flattening)
    lat, lon = mp.radians(mp.mpf(float(lat_deg))), mp.radians(mp.mpf(float(lon_deg)))
    height = mp.mpf(float(alt_m))
    normal = mp.mpf(6378137) / mp.sqrt(1 - e2 * mp.sin(lat) ** 2)
    level = (normal + height) * mp.cos(lat)
    return level * mp.cos(lon), level * mp.sin(lon), (normal * (1 - e2) + height) * mp.sin(lat)


def _to_ned(mp: Any, vector: list[Any], lat_deg: float, lon_deg: float) -> tuple[Any, ...]:
    lat, lon = mp.radians(mp.mpf(float(lat_deg))), mp.radians(mp.mpf(float(lon_deg)))
    x, y, z = vector
    outward = mp.cos(lon) * x + mp.sin(lon) * y
    return (
        -mp.sin(lat) * outward + mp.cos(lat) * z,
        -mp.sin(lon) * x + mp.cos(lon) * y,
        -(mp.cos(lat) * outward + mp.sin(lat) * z),
    )


def _to_body(mp: Any, ned: tuple[Any, ...], attitude: tuple[float, float, float]) -> Any:
    yaw, pitch, roll = (mp.mpf(float(angle)) for angle in attitude)
    north, east, down = ned
    x, y = mp.cos(yaw) * north + mp.sin(yaw) * east, mp.cos(yaw) * east - mp.sin(yaw) * north
    x, z = mp.cos(pitch) * x - mp.sin(pitch) * down, mp.sin(pitch) * x + mp.cos(pitch) * down
    return x, mp.cos(roll) * y + mp.sin(roll) * z, mp.cos(roll) * z - mp.sin(roll) * y


def _cross(a: Any, b: Any) -> tuple[Any, Any, Any]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def detection_error(
    pd: float, snr: float, pulses: int, false_alarm_probability: float, swerling: int
) -> float:
    """Return how far a probability of detection is from the truth at a mean SNR.

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
    mp = multiprecision()
    with mp.workdps(DIGITS):
        miss = _miss(mp, snr, pulses, false_alarm_probability, swerling)
        return float(abs(mp.mpf(float(pd)) - 1 + miss))


def _miss(mp: Any, snr: float, n: int, pfa: float, swerling: int) -> Any:
    threshold = _threshold(mp, n, pfa)
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


def _threshold(mp: Any, n: int, pfa: float) -> Any:
    """Solve Q(n, V) = Pfa."""
    wanted = mp.mpf(float(pfa))
    if n == 1:
        return -mp.log(wanted)
    from components.radar.threshold import threshold_of

    def excess(v: Any) -> Any:
        return mp.gammainc(n, v, mp.inf, regularized=True) - wanted

    return mp.findroot(excess, mp.mpf(threshold_of(n, pfa)))
