"""The unit tokens that traffic files use, and what they are in SI."""

from __future__ import annotations

import math
import re

_FOOT_M = 0.3048
_NAUTICAL_MILE_M = 1852.0

LENGTH_M = {
    "m": 1.0,
    "metre": 1.0,
    "metres": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "km": 1000.0,
    "ft": _FOOT_M,
    "foot": _FOOT_M,
    "feet": _FOOT_M,
    "nmi": _NAUTICAL_MILE_M,
    "nm": _NAUTICAL_MILE_M,
}
SPEED_MPS = {
    "m/s": 1.0,
    "mps": 1.0,
    "km/h": 1.0 / 3.6,
    "kph": 1.0 / 3.6,
    "kmh": 1.0 / 3.6,
    "knot": _NAUTICAL_MILE_M / 3600.0,
    "knots": _NAUTICAL_MILE_M / 3600.0,
    "kn": _NAUTICAL_MILE_M / 3600.0,
    "kt": _NAUTICAL_MILE_M / 3600.0,
    "kts": _NAUTICAL_MILE_M / 3600.0,
    "nmi/h": _NAUTICAL_MILE_M / 3600.0,
    "nmi/s": _NAUTICAL_MILE_M,
    "fpm": _FOOT_M / 60.0,
    "ft/min": _FOOT_M / 60.0,
    "ft/s": _FOOT_M,
    "fps": _FOOT_M,
}
ANGLE_DEG = {
    "deg": 1.0,
    "degree": 1.0,
    "degrees": 1.0,
    "rad": 180.0 / math.pi,
    "radian": 180.0 / math.pi,
    "radians": 180.0 / math.pi,
}
TIME_S = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "min": 60.0,
    "h": 3600.0,
    "hr": 3600.0,
}
NO_UNIT = {"none": 1.0, "unitless": 1.0, "": 1.0, "-": 1.0, "1": 1.0}

ALL_TOKENS = {*LENGTH_M, *SPEED_MPS, *ANGLE_DEG, *TIME_S, *NO_UNIT}


def clean_token(token: str) -> str:
    """Take a unit token to its plain form: no brackets, no blanks, lower case."""
    return re.sub(r"[\s\[\](){}]", "", token).lower()
