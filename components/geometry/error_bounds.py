"""Upper bounds of the error of each model of the line of sight, proven, not measured.

The proof for the models of the Earth is at the head of `earth_model_error`. The attitude's error
(`attitude_error_rad`) adds to theirs. In body axes a direction that is off by e is off in azimuth
by asin(sin e / cos q) at most, q the elevation of either direction; if e reaches the zenith
(e >= 90° - |q|) nothing can be said. A sensor reads azimuths inside its field of view only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from components.geometry.earth_model_error import (
    Envelope,
    Interval,
    flat_earth_error,
    geodesic_error,
    local_radii_error,
)
from components.geometry.line_of_sight import EARTH_MODELS

__all__ = [
    "Envelope",
    "ErrorBound",
    "attitude_error_rad",
    "azimuth_error_rad",
    "error_bound",
]

# Rounding: the exact form errs by 1.1e-15 of the range (measured), the others by no more than
# some roundings of coordinates and sines.
_EXACT = 4e-15
_ROUNDING = 1e-13


@dataclass(frozen=True)
class ErrorBound:
    """Largest possible errors of a model over an envelope.

    Parameters
    ----------
    direction_rad : float
        Angle between the model's line of sight and the true one; pi where nothing is proven.
    azimuth_rad : float
        Error of the azimuth in body axes at elevations up to the envelope's steepest.
    range_m : float
        Error of the slant range; infinite where nothing is proven.
    relative_range : float
        Error of the slant range over the slant range, at any range.
    """

    direction_rad: float
    azimuth_rad: float
    range_m: float
    relative_range: float

    @property
    def elevation_rad(self) -> float:
        """Error of the elevation in body axes: as a rolled aircraft reads it, the direction's."""
        return self.direction_rad

    @property
    def angle_rad(self) -> float:
        """Error of any angle: direction, elevation and azimuth."""
        return max(self.direction_rad, self.azimuth_rad)


def error_bound(earth: str, envelope: Envelope, attitude: str = "exact") -> ErrorBound:
    """Bound the error of a model of the Earth and of the attitude over an envelope.

    Parameters
    ----------
    earth : {"flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid"}
    envelope : Envelope
    attitude : {"exact", "small_angle"}

    Returns
    -------
    ErrorBound
        Against the exact line of sight on WGS-84 and the exact rotation.

    Raises
    ------
    ValueError
        An unknown model.

    Notes
    -----
    Over usual envelopes (10 to 30 km, within 70 degrees
    of latitude) the bounds are 1.0 to 1.7 times the worst direction found by search, and 1.0 to
    1.8 times the worst range; up to 5 times where altitudes span 12 km, more beside a pole.
    """
    if earth not in EARTH_MODELS:
        allowed = ", ".join(repr(name) for name in EARTH_MODELS)
        raise ValueError(f"earth is {earth!r}: it must be one of {allowed}")
    if attitude not in ("exact", "small_angle"):
        raise ValueError(f"attitude is {attitude!r}: it must be 'exact' or 'small_angle'")
    if earth == "ellipsoid":
        found: Interval | None = (_EXACT, _EXACT)
    elif envelope.range_max_m == 0.0:
        found = (0.0, 0.0)
    elif earth == "geodesic":
        found = geodesic_error(envelope)
    elif earth == "local_radii":
        found = local_radii_error(envelope, envelope.range_max_m)
    elif earth == "daidalus_sphere":
        found = None  # nobody has proven one: it is there to be compared with, not to be picked
    else:
        found = flat_earth_error(envelope)
    if found is None or not math.isfinite(envelope.range_max_m):
        return ErrorBound(math.pi, math.pi, math.inf, math.inf)
    rounding = 0.0 if earth == "ellipsoid" else _ROUNDING
    direction, relative = found[0] + rounding, found[1] + rounding
    if attitude == "small_angle":
        direction += attitude_error_rad(envelope.pitch_rad, envelope.roll_rad)
    direction = min(direction, math.pi)
    return ErrorBound(
        direction,
        azimuth_error_rad(direction, envelope.steepest_rad),
        relative * envelope.range_max_m,
        relative,
    )


def attitude_error_rad(pitch_rad: float, roll_rad: float) -> float:
    """Bound the direction error of the small-angle attitude (thesis eq. 4-5).

    Parameters
    ----------
    pitch_rad, roll_rad : float
        Largest sizes.

    Returns
    -------
    float
        2 |pitch| + |roll|, at most pi; reached by pitch astern.

    Notes
    -----
    The exact rotation turns the direction by |pitch| and by |roll| at most; the small-angle form
    moves it along its own meridian by |pitch|. Both take a level aircraft to be the same.
    """
    return min(math.pi, 2.0 * abs(pitch_rad) + abs(roll_rad))


def azimuth_error_rad(direction_rad: float, steepest_rad: float) -> float:
    """Bound the error in azimuth of a direction that is off, at elevations up to the steepest."""
    if direction_rad == 0.0:
        return 0.0
    if direction_rad + steepest_rad >= 0.5 * math.pi:
        return math.pi
    return math.asin(min(1.0, math.sin(direction_rad) / math.cos(steepest_rad)))
