"""Proven bounds of the error of each model of the Earth.

The proof, in the order of the code. Let 1 be the observer and 2 the target, with latitudes φ,
longitudes λ and altitudes h; M and N the meridian and prime vertical radii, r = (N + h) cos φ the
distance from the Earth's axis, a = |φ2 - φ1|, b = |λ2 - λ1|. All radii, cosines and sines are
replaced by their extremes over the envelope; M and N grow with |φ|.

**Offsets are small angles.** Both aircraft lie outside the convex body "altitude at most h_min".
The projection onto a convex body lengthens no distance, and here it keeps latitude; the body's
meridian has a radius of curvature of ρ = M + h_min at least, so its chord is 2 ρ sin(a/2) at least.
With the turn of longitude, R² = D² + 4 r1 r2 sin²(b/2), D the distance with the target turned onto
the observer's meridian. So x = ρ a and y = r_min b obey x² + y² <= (κ R)², where κ = asin(t)/t,
t = R/(2 min(ρ, r_min)), takes the sines into angles.

**Local radii.** The exact offset in the observer's axes is ::

    north = ∫ M cos(φ - φ1) dφ + h2 sin Δφ + sin φ1 · k        k = 2 r2 sin²(Δλ/2)
    east  = r2 sin Δλ
    up    = h2 - h1 - ∫ M sin(φ - φ1) dφ - h2 (1 - cos Δφ) - cos φ1 · k

and the model's (M1 + h1) Δφ, r1 Δλ, h2 - h1. Subtracting term by term, with |M'| the largest
slope of M and r1 - r2 = ∫ (M + h1) sin φ dφ + (h1 - h2) cos φ2 ::

    |north error| <= sin φ · r b²/2 + M' a²/2 + |h2 - h1| a + (M + |h|) a³/6
    |east error|  <= (M + h) sin φ · a b + |h2 - h1| cos φ · b + r b³/6
    |up error|    <= (M + h) a²/2 + cos φ · r b²/2

The first terms of the first two lines are maximised together over x² + y² = (κ R)², the others
added. An error vector d turns a line of sight of length R by asin(|d|/R) at most. The range, with
v' the model's offset, is off by (2 v'·d - |d|²)/(R + R') exactly; in v'·d the terms of h2 - h1 and
of the drop have opposite signs, and so have those of k and of r1 - r2 on one side of the equator.

**Flat Earth** stretches the offset of local radii by K/(M1 + h1) to the north and K/(N1 + h1) to
the east, K = 111,195 m per degree, exactly. A stretch by factors from l to u turns no vector by
more than asin((u - l)/(u + l)) (the operator's angle; K. Gustafson, Bull. AMS 74, 1968).

**Geodesic.** On a geodesic of length s with tangent T, outward normal n, normal curvature k_n in
[1/N_pole, 1/M_equator] and torsion of size (1/M_equator - 1/N_pole)/2 at most: T' = -k_n n,
n' = k_n T + τ B. Integrating twice, the target's offset is s (1 + h2 k) T1, k the mean of the two
curvatures, less a drop of (k_n + |h2| k_n²) s²/2 at most, and a rest that is bounded likewise. The
stretch by 1 + h2 k is treated as above. That s is not much longer than R is Schur's theorem:
the chord of a curve of curvature 1/ρ at most is 2 ρ sin(s/2ρ) at least, for s up to π ρ; and no
shortest line is longer than the chord's shadow on the surface, 1.4 times the chord here.

**Every bound holds for two sets of targets**: those within the envelope's range in truth, and those
that the model takes to be so. All terms over R grow with R, so the largest range decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from components.geometry.earth_models import EARTH_MODELS, METRES_PER_DEGREE
from components.geometry.ellipsoid import (
    ECCENTRICITY_SQUARED,
    SEMI_MAJOR_AXIS_M,
    radii_of_curvature,
)

Interval = tuple[float, float]

# From half the radius of curvature on, "small angles" are not worth a proof.
_LARGEST_SINE = 0.5
# Of x y² over x² + y² = 1.
_LARGEST_X_Y2 = 2.0 / (3.0 * math.sqrt(3.0))

_M_EQUATOR = SEMI_MAJOR_AXIS_M * (1.0 - ECCENTRICITY_SQUARED)
_N_POLE = SEMI_MAJOR_AXIS_M / math.sqrt(1.0 - ECCENTRICITY_SQUARED)
_METRES_PER_RAD = math.degrees(METRES_PER_DEGREE)


@dataclass(frozen=True)
class Envelope:
    """Bounds on the ranges, positions and attitudes between which a scene's lines of sight lie."""

    range_max_m: float  # Longest line of sight that a sensor looks along
    # (low, high): geodetic latitude of the ownship, altitudes of the ownship and of its targets
    own_lat_deg: Interval
    own_alt_m: Interval
    target_alt_m: Interval
    # (low, high), optional: left out: whatever the range allows
    target_lat_deg: Interval | None = None
    # Largest size of a body elevation that a sensor reads; pi/2 bounds no azimuth
    steepest_rad: float = 0.5 * math.pi
    pitch_rad: float = 0.5 * math.pi  # Largest sizes of the ownship's pitch and roll
    roll_rad: float = math.pi

    def __post_init__(self) -> None:
        if not self.range_max_m >= 0.0:
            raise ValueError(f"range_max_m is {self.range_max_m}: it must be 0 or more")
        for name in ("own_lat_deg", "own_alt_m", "target_alt_m", "target_lat_deg"):
            pair = getattr(self, name)
            if pair is not None and not pair[0] <= pair[1]:
                raise ValueError(f"{name} is {pair}: it must hold two numbers, the lower first")


def flat_earth_error_bounds(envelope: Envelope) -> Interval | None:
    """Return the flat Earth's largest direction (rad) and relative range error; None if unknown."""
    meridian, prime_vertical = _radius_ranges(*_abs_latitude_range(envelope.own_lat_deg))
    low_alt, high_alt = envelope.own_alt_m
    if meridian[0] + low_alt <= 0.0:
        return None
    most = max(1.0, _METRES_PER_RAD / (meridian[0] + low_alt))
    least = min(1.0, _METRES_PER_RAD / (prime_vertical[1] + high_alt))
    local = local_radii_error_bounds(envelope, envelope.range_max_m / least)
    if local is None:
        return None
    angle, relative = local
    stretch = max(most - 1.0, 1.0 / least - 1.0)
    return angle + _largest_direction_change_rad(least, most), stretch * (
        1.0 + relative
    ) + relative / least


def local_radii_error_bounds(envelope: Envelope, range_m: float) -> Interval | None:
    """Return local radii's largest direction (rad) and relative range error to a range, or None."""
    low_alt = min(envelope.own_alt_m[0], envelope.target_alt_m[0])
    high_alt = max(envelope.own_alt_m[1], envelope.target_alt_m[1], 0.0)
    if range_m > 2.0 * _LARGEST_SINE * (_M_EQUATOR + low_alt):
        return None
    widest = math.degrees(2.0 * math.asin(range_m / (2.0 * (_M_EQUATOR + low_alt))))
    south, north = _latitude_span(envelope, widest)
    if south <= -90.0 or north >= 90.0:
        return None
    low, high = _abs_latitude_range((south, north))
    (m_min, m_max), (n_min, n_max) = _radius_ranges(low, high)
    cos_max, cos_min = math.cos(math.radians(low)), math.cos(math.radians(high))
    sin_max = math.sin(math.radians(high))
    rho = m_min + low_alt
    r_min, r_max = (n_min + low_alt) * cos_min, (n_max + high_alt) * cos_max
    sine = range_m / (2.0 * min(rho, r_min))
    if not 0.0 < sine <= _LARGEST_SINE:
        return None
    s = range_m * math.asin(sine) / sine

    m_high, m_low = m_max + high_alt, m_min + low_alt  # of M + h
    wide, long = s / rho, s / r_min  # largest a and b
    drop = 0.5 * max(m_high * wide**2, cos_max * r_max * long**2)
    rise = min(_largest_altitude_difference_m(envelope), range_m + drop)
    slope = 1.5 * m_max * ECCENTRICITY_SQUARED * _largest_sin_2lat(low, high)
    slope /= 1.0 - ECCENTRICITY_SQUARED * sin_max**2
    thick = max(high_alt, -low_alt)
    cubic = max((m_max + thick) * wide**3, r_max * long**3) / 6.0
    to_axis, convergence = 0.5 * sin_max * r_max * long**2, m_high * sin_max * wide * long
    level = (
        _largest_hypot(to_axis, convergence)
        + 0.5 * slope * wide**2
        + rise * max(wide, cos_max * long)
        + cubic
    )
    off = math.hypot(level, drop)
    if off >= range_m:
        return None
    # What is left of the opposite terms of v'·d; the least of one goes off the most of the other.
    shrink_a, shrink_b = 1.0 - wide**2 / 12.0, 1.0 - long**2 / 12.0
    sloping = max(
        (m_high - 0.5 * m_low * shrink_a) * wide**2,
        (cos_max * r_max - 0.5 * cos_min * r_min * shrink_b) * long**2,
    )
    turning = m_high * r_max * sin_max
    if south * north > 0.0:
        turning -= 0.5 * m_low * r_min * math.sin(math.radians(low)) * shrink_b
    else:
        turning *= 1.5
    along = (
        rise * max(sloping, drop)
        + max(turning, 0.5 * m_high * r_max * sin_max) * wide * long**2 * _LARGEST_X_Y2
        + 0.5 * m_high * slope * wide**3
        + max(m_high * wide, r_max * long) * cubic
        + 0.5 * off**2
    )
    return math.asin(off / range_m), along / ((range_m - 0.5 * off) * range_m)


def geodesic_error_bounds(envelope: Envelope) -> Interval | None:
    """Return the geodesic model's largest direction (rad), relative range error, or None."""
    low_alt = min(envelope.own_alt_m[0], envelope.target_alt_m[0], 0.0)
    rho = _M_EQUATOR + low_alt
    range_m = envelope.range_max_m
    if range_m > 2.0 * _LARGEST_SINE * rho:
        return None
    s = max(range_m, 2.0 * _M_EQUATOR * math.asin(range_m / (2.0 * rho)))
    k_max, k_min = 1.0 / _M_EQUATOR, 1.0 / _N_POLE
    mean = 0.5 * (k_max + k_min)
    thick = max(abs(alt) for alt in envelope.target_alt_m)
    most = max(1.0, 1.0 + envelope.target_alt_m[1] * mean)
    least = min(1.0, 1.0 + envelope.target_alt_m[0] * mean)
    drop = 0.5 * (k_max + thick * k_max**2) * s**2
    # The normal's turn off the mean curvature and off the plane, and what bends within it.
    level = thick * (k_max - k_min) / math.sqrt(2.0) * s
    level += k_max**2 * s**3 / 6.0 * (1.0 + thick * k_max)
    rise = min(_largest_altitude_difference_m(envelope), range_m + drop)
    rest = _direction_and_range_bounds(
        level, drop, rise, range_m, least * range_m - math.hypot(level, drop)
    )
    if rest is None:
        return None
    angle, relative = rest
    stretch = max(most - 1.0, 1.0 - least)
    off = 1.0 + math.hypot(level, drop) / range_m
    return angle + _largest_direction_change_rad(least, most), stretch * off / least + relative


def _direction_and_range_bounds(
    level_m: float, drop_m: float, rise_m: float, range_m: float, shortest_m: float
) -> Interval | None:
    """Return direction (rad) and relative range error bounds from offset errors (m), or None.

    With offsets v and v' of lengths R and R', R' - R = (v' + v)·(v' - v)/(R' + R): the error of
    the level offset counts in full, that of the vertical one by the slope (u + u')/(R + R').
    """
    off = math.hypot(level_m, drop_m)
    if off >= shortest_m:
        return None
    slope = min(1.0, (2.0 * rise_m + drop_m) / (2.0 * shortest_m - off))
    return math.asin(off / shortest_m), (level_m + slope * drop_m) / range_m


def _largest_hypot(to_axis: float, convergence: float) -> float:
    """Return the largest hypot(to_axis y², convergence x y) over x² + y² = 1."""
    c, p = convergence**2, to_axis**2
    share = 1.0 if c <= 2.0 * p else c / (2.0 * (c - p))
    return math.sqrt(share * (c - (c - p) * share))


def _largest_direction_change_rad(least: float, most: float) -> float:
    """Return the largest turn (rad) of a vector with components scaled by least to most."""
    return math.asin((most - least) / (most + least))


def _largest_altitude_difference_m(envelope: Envelope) -> float:
    own, target = envelope.own_alt_m, envelope.target_alt_m
    return max(target[1] - own[0], own[1] - target[0])


def _latitude_span(envelope: Envelope, widest_deg: float) -> Interval:
    """Return the lowest and highest latitude (deg) of ownship and targets within ``widest_deg``."""
    low, high = envelope.own_lat_deg
    south, north = low - widest_deg, high + widest_deg
    if envelope.target_lat_deg is not None:
        south = max(south, envelope.target_lat_deg[0])
        north = min(north, envelope.target_lat_deg[1])
    return min(low, south), max(high, north)


def _abs_latitude_range(lat_deg: Interval) -> Interval:
    """Return the smallest and the largest absolute latitude (deg) in an interval of latitudes."""
    low, high = lat_deg
    return (0.0 if low <= 0.0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))


def _radius_ranges(low_deg: float, high_deg: float) -> tuple[Interval, Interval]:
    """Return the smallest and largest meridian radius, and the same of the prime vertical radius
    (m), between two absolute latitudes.
    """
    meridian, prime_vertical = radii_of_curvature([low_deg, high_deg])
    return (
        (float(meridian[0]), float(meridian[1])),
        (float(prime_vertical[0]), float(prime_vertical[1])),
    )


def _largest_sin_2lat(low_deg: float, high_deg: float) -> float:
    if low_deg <= 45.0 <= high_deg:
        return 1.0
    return max(math.sin(math.radians(2.0 * low_deg)), math.sin(math.radians(2.0 * high_deg)))


__all__ = [
    "Envelope",
    "ErrorBound",
    "attitude_error_bound_rad",
    "azimuth_error_bound_rad",
    "error_bound",
]

# Rounding: the exact form errs by 1.1e-15 of the range (measured), the others by no more than
# some roundings of coordinates and sines.
_EXACT = 4e-15
_ROUNDING = 1e-13

# A bound this large proves hardly anything.
_LARGEST_RELATIVE_ERROR = 0.5


@dataclass(frozen=True)
class ErrorBound:
    """Largest possible errors of a model over an envelope."""

    # Angle between the model's line of sight and the true one; pi where nothing is proven
    direction_rad: float
    # Error of the azimuth in body axes at elevations up to the envelope's steepest
    azimuth_rad: float
    range_m: float  # Error of the slant range; infinite where nothing is proven
    relative_range: float  # Error of the slant range over the slant range, at any range

    @property
    def elevation_rad(self) -> float:
        """Bound on elevation error (rad) in body axes: the direction's, as aircraft may roll."""
        return self.direction_rad

    @property
    def angle_rad(self) -> float:
        """Bound (rad) on direction, elevation and azimuth errors, the largest of the three."""
        return max(self.direction_rad, self.azimuth_rad)


def error_bound(earth: str, envelope: Envelope, attitude: str = "exact") -> ErrorBound:
    """Return bounds on the errors of an Earth model and an attitude model over an envelope.

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
        errors: Interval | None = (_EXACT, _EXACT)
    elif envelope.range_max_m == 0.0:
        errors = (0.0, 0.0)
    elif earth == "geodesic":
        errors = geodesic_error_bounds(envelope)
    elif earth == "local_radii":
        errors = local_radii_error_bounds(envelope, envelope.range_max_m)
    elif earth == "daidalus_sphere":
        errors = None  # nobody has proven one: it is there to be compared with, not to be picked
    else:
        errors = flat_earth_error_bounds(envelope)
    if errors is None or not math.isfinite(envelope.range_max_m):
        return ErrorBound(math.pi, math.pi, math.inf, math.inf)
    rounding = 0.0 if earth == "ellipsoid" else _ROUNDING
    direction, relative = errors[0] + rounding, errors[1] + rounding
    if attitude == "small_angle":
        direction += attitude_error_bound_rad(envelope.pitch_rad, envelope.roll_rad)
    direction = min(direction, math.pi)
    return ErrorBound(
        direction,
        azimuth_error_bound_rad(direction, envelope.steepest_rad),
        relative * envelope.range_max_m,
        relative,
    )


def max_true_range_m(
    earth: str, reach_m: float, own_lat_deg: Interval, own_alt_m: Interval
) -> float:
    """Return a true range (m) beyond which models put no target within ``reach_m``; or infinity.

    With a relative error e of the range, proven for all targets that seem to be in reach, these
    are within R / (1 - e).
    """
    low_m, high_m = own_alt_m
    envelope = Envelope(
        range_max_m=reach_m,
        own_lat_deg=own_lat_deg,
        own_alt_m=own_alt_m,
        # Every model takes the difference of altitudes as it is, and none is longer than the range.
        target_alt_m=(low_m - reach_m, high_m + reach_m),
    )
    relative = error_bound(earth, envelope).relative_range
    return reach_m / (1.0 - relative) if relative < _LARGEST_RELATIVE_ERROR else math.inf


def attitude_error_bound_rad(pitch_rad: float, roll_rad: float) -> float:
    """Return a bound (rad) on the direction error of the small-angle attitude (thesis eq. 4-5).

    The exact rotation turns the direction by |pitch| and by |roll| at most; the small-angle form
    moves it along its own meridian by |pitch|. Both take a level aircraft to be the same.
    """
    return min(math.pi, 2.0 * abs(pitch_rad) + abs(roll_rad))


def azimuth_error_bound_rad(direction_rad: float, steepest_rad: float) -> float:
    """Return an azimuth error bound (rad) for error ``direction_rad``, up to steepest elevation."""
    if direction_rad == 0.0:
        return 0.0
    if direction_rad + steepest_rad >= 0.5 * math.pi:
        return math.pi
    return math.asin(min(1.0, math.sin(direction_rad) / math.cos(steepest_rad)))
