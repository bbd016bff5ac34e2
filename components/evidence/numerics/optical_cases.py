"""Hard cases of the optical signature: edges of the silhouette, wrap, zenith, range 0."""

import math
from typing import Any

from components.evidence.numerics.case import NumericalCase
from components.high_precision.multiprecision import multiprecision
from components.optical.line_of_sight_rate import line_of_sight_rate
from components.optical.signature import pixels_covered
from components.optical.silhouette import visible_area

DEG = math.pi / 180.0
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
    mpmath = multiprecision()
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
