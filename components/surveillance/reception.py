"""How likely one squitter is received over range: laws of receivers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from components.arguments.units import NAUTICAL_MILE_M
from dsa_des.arrays.types import FloatArray

#: Farthest reception of the fitted law, and its coefficients of 1st to 4th order: amid 50 aircraft
#: and 50 airports, and how they change with each aircraft more and with each airport more.
FITTED_RANGE_M = 290.0 * NAUTICAL_MILE_M
FITTED_COEFFICIENTS = (-1.80, 11.96, -23.27, 20.30)
BY_AIRCRAFT = (-0.0212, 0.0743, -0.1534, 0.0978)
BY_AIRPORT = (0.1617, -0.9155, 2.1353, -1.5650)
_FITTED_AT = 50.0
#: Aircraft and airports around a receiver, where a scene says nothing: the median of the 23
#: receivers' aircraft, and the airports amid which their regressions mean most.
AIRCRAFT_AROUND, AIRPORTS_AROUND = 95.0, 50.0
#: Ranges up to which the two steps of DO-365's law hold, and probabilities of a report in 1 s:
#: 95 % within 3 s and within 7 s.
DO_365_RANGES_M = (10.0 * NAUTICAL_MILE_M, 20.0 * NAUTICAL_MILE_M)
DO_365_IN_1_S = (1.0 - 0.05 ** (1.0 / 3.0), 1.0 - 0.05 ** (1.0 / 7.0))
#: Squitters of one kind in a second, on average.
_PER_SECOND = 2.0
#: Of so many ranges it is told how long a message takes to come.
_PROMISED_RANGES = 40


def fitted_reception_probability(
    range_m: FloatArray, aircraft: float = AIRCRAFT_AROUND, airports: float = AIRPORTS_AROUND
) -> FloatArray:
    """Return a ground receiver's probability of one message by range, by a law fitted to data.

    ``p = exp(-3 x²) (1 + a₁ x + a₂ x² + a₃ x³ + a₄ x⁴)`` with x the range over that of the farthest
    message received, 290 nmi, cut at 0 and 1, and 0 beyond: the form of Nakagami fading in which
    F. Rahman published regressions of 23 receivers (adsb_reception_model_opensky, 2025), linear in
    the aircraft and the airports around. The numbers are ours, fitted to the median of those 23
    curves amid 10 to 250 aircraft and 20 to 80 airports, and exactly to that at 50 of both. There
    18 receivers lie within 2.5 % of it (rms over range), the other five within 18 to 41 %, all
    together 13 %. The regressions themselves err by 6.9 to 22.4 % of receivers not fitted.
    """
    x = np.asarray(range_m, np.float64) / FITTED_RANGE_M
    more = aircraft - _FITTED_AT, airports - _FITTED_AT
    a, b, c, d = (
        at + more[0] * one + more[1] * other
        for at, one, other in zip(FITTED_COEFFICIENTS, BY_AIRCRAFT, BY_AIRPORT, strict=True)
    )
    law = np.exp(-3.0 * x**2) * (1.0 + x * (a + x * (b + x * (c + x * d))))
    return np.where(x <= 1.0, np.clip(law, 0.0, 1.0), 0.0)


def do_365_reception_probability(range_m: FloatArray) -> FloatArray:
    """Return each range's chance to receive one message (two a second), DO-365, appendix Q.

    A report comes within 3 s with 95 % up to 10 nmi, within 7 s up to 20 nmi, and never beyond.
    """
    near, far = (1.0 - (1.0 - p) ** (1.0 / _PER_SECOND) for p in DO_365_IN_1_S)
    inner, outer = DO_365_RANGES_M
    return np.where(range_m <= inner, near, np.where(range_m <= outer, far, 0.0))


def time_to_receive_95_percent_s(probability: FloatArray) -> FloatArray:
    """Return the time (s, at most 60) to receive a message with 95 %, for two messages a second."""
    missed = np.log1p(-np.clip(probability, 1e-9, 1.0 - 1e-9))
    messages = np.maximum(np.ceil(np.log(0.05) / missed - 1e-6), 1.0)
    # Messages are up to 0.6 s apart, and a tracker heeds a look a tenth of the time before it.
    return np.minimum(messages / _PER_SECOND + 0.2, 60.0)


def reception_time_steps(
    law: Callable[[FloatArray], FloatArray], reach_m: float
) -> list[tuple[float, float]]:
    """Return steps (m, s): up to this range, 19 of 20 next positions arrive within this time."""
    ranges_m = np.array([np.inf])
    if np.isfinite(reach_m):
        ranges_m = np.linspace(0.0, reach_m, _PROMISED_RANGES + 1)[1:]
    within_s = time_to_receive_95_percent_s(law(ranges_m))
    return list(zip(ranges_m.tolist(), within_s.tolist(), strict=True))


def certain_reception_probability(range_m: FloatArray) -> FloatArray:
    """Return 1 for every range: all messages are received."""
    return np.ones_like(range_m, dtype=np.float64)


#: By name, with the range at which each law ends.
LAWS: dict[str, tuple[Callable[[FloatArray], FloatArray], float]] = {
    "certain": (certain_reception_probability, np.inf),
    "do_365": (do_365_reception_probability, DO_365_RANGES_M[1]),
    "fitted": (fitted_reception_probability, FITTED_RANGE_M),
}
