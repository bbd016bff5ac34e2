"""Segments of flights, each with a closed form: geodesics, turns, holds, and ramps of velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from geographiclib.geodesic import Geodesic

from components.flights.fleet import evaluate_in_blocks
from components.flights.geodesic_motion import (
    apply_elementwise,
    position_and_yaw_on_geodesic,
    power_rounded_as_python,
)
from components.geometry import (
    ECCENTRICITY_SQUARED,
    TWO_PI,
    TrajectoryState,
    east_north_up_axes,
    normal_to_degrees,
    radii_of_curvature,
    remainder,
    wrap_heading_rad,
)
from dsa_des.arrays.growing_arrays import Growing, GrowingArray
from dsa_des.arrays.types import FloatArray, IntArray

#: Parts east and north.
Pair = tuple[FloatArray, FloatArray]

LONGEST_FLIGHT_S = 1e12
"""Flights are held up to here (30,000 years) and stand still after, so that nothing overflows."""
LARGEST_TURN_RADIUS_M = 200_000.0
"""Up to here a turn keeps its speed to 2e-4; the error grows with the radius, 1e-6 at 1 km."""

# Rows: the centre's axes (east, north, up), reciprocal radii east and north, and the motion.
_EAST, _NORTH, _UP = 0, 3, 6

_PER_EAST, _PER_NORTH, _RADIUS, _PHASE, _RATE, _ALT, _CLIMB = range(9, 16)

TURN_ROWS = 16


def turn_parameters(
    lat_deg: Any,
    lon_deg: Any,
    alt_m: Any,
    azimuth_rad: Any,
    speed_mps: Any,
    climb_mps: Any,
    rate_rad_s: Any,
) -> FloatArray:
    """Return the precomputed parameters of a turn, shape (rows,), or of many turns, (rows, n).

    The circle lies around its own centre in the chart (east, north) -> (angle about the centre's
    prime-vertical and meridian radii), so it is round in metres although the ellipsoid's two
    radii differ by up to 0.7 %, and it returns to where it began.
    """
    radius = abs(speed_mps / rate_rad_s)
    if np.max(radius) > LARGEST_TURN_RADIUS_M:
        number = np.argmax(radius)
        radius_m, mps, rad_s = (np.ravel(of)[number] for of in (radius, speed_mps, rate_rad_s))
        raise ValueError(
            f"turn radius is {radius_m:.0f} metres ({mps:g} m/s at "
            f"{math.degrees(rad_s):g} deg/s): it must not exceed {LARGEST_TURN_RADIUS_M:g}; "
            "use a straight leg or waypoints"
        )
    circle = _turn_tables if isinstance(radius, np.ndarray) else _turn_table
    table = circle(lat_deg, lon_deg, alt_m, azimuth_rad, radius, rate_rad_s, climb_mps)
    # The circle in the chart is off the azimuth by some 1e-8 to 1e-6 rad, which turns in a row
    # would add up: it is begun as much the other way.
    yaw = position_and_yaw_on_turn(table, np.zeros(np.size(radius)))[3]
    off_rad = apply_elementwise(
        _wrap_to_half_turn_rad, (yaw if circle is _turn_tables else float(yaw[0])) - azimuth_rad
    )
    return circle(lat_deg, lon_deg, alt_m, azimuth_rad - off_rad, radius, rate_rad_s, climb_mps)


def _wrap_to_half_turn_rad(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)


def _turn_table(
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    azimuth_rad: float,
    radius: float,
    rate_rad_s: float,
    climb_mps: float,
) -> FloatArray:
    """Return the parameter table of a turn on a circle whose centre lies abeam of the azimuth."""
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    side = math.copysign(0.5 * math.pi, rate_rad_s)
    # Metres aloft to metres on the ellipsoid, along the line to the centre (abeam).
    cos2, sin2 = math.sin(azimuth_rad) ** 2, math.cos(azimuth_rad) ** 2
    abeam = 1.0 / (cos2 / float(meridian) + sin2 / float(prime_vertical))
    centre = Geodesic.WGS84.Direct(
        lat_deg,
        lon_deg,
        math.degrees(azimuth_rad + side),
        radius * abeam / (abeam + alt_m),
    )
    c_lat, c_lon = np.array([centre["lat2"]]), np.array([centre["lon2"]])
    axes = [np.array(axis)[:, 0] for axis in east_north_up_axes(c_lat, c_lon)]
    start = np.array(east_north_up_axes(np.array([lat_deg]), np.array([lon_deg]))[2])[:, 0]
    c_meridian, c_prime_vertical = radii_of_curvature(float(c_lat[0]))
    per_east, per_north = 1.0 / (c_prime_vertical + alt_m), 1.0 / (c_meridian + alt_m)
    east, north, up = (float(axis @ start) for axis in axes)
    chord = math.hypot(east, north)
    stretch = math.atan2(chord, up) / chord if chord else 1.0
    x, y = east * stretch / float(per_east), north * stretch / float(per_north)
    table = np.empty(TURN_ROWS)
    table[_EAST : _EAST + 3], table[_NORTH : _NORTH + 3], table[_UP : _UP + 3] = axes
    table[_PER_EAST], table[_PER_NORTH] = per_east, per_north
    table[_RADIUS], table[_PHASE] = math.hypot(x, y), math.atan2(x, y)
    table[_RATE], table[_ALT], table[_CLIMB] = rate_rad_s, alt_m, climb_mps
    return table


def _turn_tables(
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    azimuth_rad: FloatArray,
    radius: FloatArray,
    rate_rad_s: FloatArray,
    climb_mps: FloatArray,
) -> FloatArray:
    """Return many turns' parameter tables (rows, n), equal to the bit to those made singly."""
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    side = np.copysign(0.5 * math.pi, rate_rad_s)
    # Metres aloft to metres on the ellipsoid, along the line to the centre (abeam).
    cos2, sin2 = (
        power_rounded_as_python(apply_elementwise(of, azimuth_rad), 2)
        for of in (math.sin, math.cos)
    )
    abeam = 1.0 / (cos2 / meridian + sin2 / prime_vertical)
    ways = apply_elementwise(math.degrees, azimuth_rad + side), radius * abeam / (abeam + alt_m)
    places = zip(*(value.tolist() for value in (lat_deg, lon_deg, *ways)), strict=True)
    centres = [Geodesic.WGS84.Direct(*place) for place in places]
    c_lat, c_lon = (np.array([one[name] for one in centres]) for name in ("lat2", "lon2"))
    axes = np.array(east_north_up_axes(c_lat, c_lon))
    starts = np.array(east_north_up_axes(lat_deg, lon_deg)[2]).T.copy()
    of_each = np.ascontiguousarray(axes.transpose(2, 0, 1))
    east, north, up = np.array(
        [[axis @ start for axis in of_one] for of_one, start in zip(of_each, starts, strict=True)]
    ).T
    c_meridian, c_prime_vertical = radii_of_curvature(c_lat)
    per_east, per_north = 1.0 / (c_prime_vertical + alt_m), 1.0 / (c_meridian + alt_m)
    stretch = apply_elementwise(_arc_per_chord, apply_elementwise(math.hypot, east, north), up)
    x, y = east * stretch / per_east, north * stretch / per_north
    table = np.empty((TURN_ROWS, len(lat_deg)))
    table[_EAST : _UP + 3] = axes.reshape(9, -1)
    table[_PER_EAST], table[_PER_NORTH] = per_east, per_north
    table[_RADIUS], table[_PHASE] = (
        apply_elementwise(math.hypot, x, y),
        apply_elementwise(math.atan2, x, y),
    )
    table[_RATE], table[_ALT], table[_CLIMB] = rate_rad_s, alt_m, climb_mps
    return table


def _arc_per_chord(chord: float, up: float) -> float:
    return math.atan2(chord, up) / chord if chord else 1.0


def position_and_yaw_on_turn(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude (deg), altitude (m) and yaw (rad) on turns after times (s)."""
    angle = table[_PHASE] + table[_RATE] * elapsed
    sine, cosine = np.sin(angle), np.cos(angle)
    # Offsets from the centre as angles, and their derivatives by `angle`.
    east, north = (
        table[_RADIUS] * sine * table[_PER_EAST],
        table[_RADIUS] * cosine * table[_PER_NORTH],
    )
    d_east, d_north = (
        table[_RADIUS] * cosine * table[_PER_EAST],
        -table[_RADIUS] * sine * table[_PER_NORTH],
    )
    rho = np.sqrt(east * east + north * north)
    lat, lon, to_east, to_north = _position_and_direction(
        table, (east, north), (d_east, d_north), rho
    )
    direction = np.where(table[_RATE] + 0.0 * rho > 0.0, 1.0, -1.0)
    yaw = wrap_heading_rad(np.arctan2(to_east * direction, to_north * direction))
    return lat, lon, table[_ALT] + table[_CLIMB] * elapsed, yaw


def _position_and_direction(
    table: FloatArray, offset: Pair, motion: Pair, rho: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude (deg) at angular offsets, and unscaled motion east and north."""
    (east, north), (d_east, d_north) = offset, motion
    sin_rho, cos_rho = np.sin(rho), np.cos(rho)
    sinc = sin_rho / rho
    d_rho = (east * d_east + north * d_north) / rho
    d_sinc = (cos_rho - sinc) / rho * d_rho
    x, y, z = (
        cos_rho * table[_UP + i] + sinc * (east * table[_EAST + i] + north * table[_NORTH + i])
        for i in range(3)
    )
    dx, dy, dz = (
        d_sinc * (east * table[_EAST + i] + north * table[_NORTH + i])
        + sinc * (d_east * table[_EAST + i] + d_north * table[_NORTH + i])
        - sin_rho * d_rho * table[_UP + i]
        for i in range(3)
    )
    lat, lon = normal_to_degrees(x, y, z)
    # The velocity's east and north parts, both times the distance to the axis; the meridian's
    # radius is the prime vertical's times (1 - e²) / w², of which altitude changes next to nothing.
    level = x * x + y * y
    to_east = x * dy - y * dx
    to_north = level * dz - z * (x * dx + y * dy)
    to_north = to_north * ((1.0 - ECCENTRICITY_SQUARED) / (1.0 - ECCENTRICITY_SQUARED * z * z))
    return lat, lon, to_east, to_north


# Rows of a ramp from 9 on: those of its chart, its velocity at first and how that changes, for how
# long, its altitude, and where its nose points while it stands.
_FROM_EAST, _FROM_NORTH, _MORE_EAST, _MORE_NORTH, _LASTS, _LEVEL, _NOSE = range(11, 18)
#: How many there are.
RAMP_ROWS = 18
# Who is slower stands; and offsets are no less than this, as angles, for their direction.
_STANDS_MPS, _LEAST_ANGLE = 1e-6, 1e-15


def ramp_parameters(
    position: tuple[FloatArray, FloatArray, FloatArray],
    yaw_rad: FloatArray,
    velocity_mps: Pair,
    wanted_mps: Pair,
    acceleration_mps2: FloatArray,
) -> FloatArray:
    """Return the precomputed parameters (rows, n) of ramps: level flights whose velocity (east,
    north) changes steadily to the wanted one and then stays.

    `position` is latitude and longitude (deg) and altitude (m), (n,) each.
    """
    lat_deg, lon_deg, alt_m = position
    change = wanted_mps[0] - velocity_mps[0], wanted_mps[1] - velocity_mps[1]
    lasts_s = np.hypot(*change) / acceleration_mps2
    at_once = np.where(lasts_s > 0.0, lasts_s, 1.0)
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    east, north, up = (np.array(axis) for axis in east_north_up_axes(lat_deg, lon_deg))
    rows = (
        1.0 / (prime_vertical + alt_m), 1.0 / (meridian + alt_m), *velocity_mps,
        change[0] / at_once, change[1] / at_once, lasts_s, alt_m, yaw_rad,
    )  # fmt: skip
    return np.concatenate([east, north, up, np.stack(rows)])


def ramp_velocity_in_start_axes(table: FloatArray, elapsed: FloatArray) -> Pair:
    """Return ramps' velocities (m/s) east and north after times (s), in each one's start axes."""
    gone = np.minimum(elapsed, table[_LASTS])
    return (
        table[_FROM_EAST] + table[_MORE_EAST] * gone,
        table[_FROM_NORTH] + table[_MORE_NORTH] * gone,
    )


def position_and_yaw_on_ramp(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude (deg), altitude (m) and yaw (rad) on ramps (level, velocity
    changing steadily at first) after the elapsed times (s).

    The way is v t + a (T t - T²/2) with T the time gone of the change, along an arc with the radii
    of where it begins: over 10 km it keeps its length to 0.5 m.
    """
    gone = np.minimum(elapsed, table[_LASTS])
    more = gone * elapsed - 0.5 * gone * gone
    offset = (
        (table[_FROM_EAST] * elapsed + table[_MORE_EAST] * more) * table[_PER_EAST],
        (table[_FROM_NORTH] * elapsed + table[_MORE_NORTH] * more) * table[_PER_NORTH],
    )
    velocity = ramp_velocity_in_start_axes(table, elapsed)
    motion = velocity[0] * table[_PER_EAST], velocity[1] * table[_PER_NORTH]
    rho = np.maximum(np.hypot(*offset), _LEAST_ANGLE)
    lat, lon, to_east, to_north = _position_and_direction(table, offset, motion, rho)
    nose = np.where(np.hypot(*velocity) > _STANDS_MPS, np.arctan2(to_east, to_north), table[_NOSE])
    return lat, lon, table[_LEVEL] + 0.0 * elapsed, wrap_heading_rad(nose)


Kind = Literal["geodesic", "turn", "hold", "ramp"]


@dataclass(frozen=True)
class Segment:
    """A leg to evaluate: its formula's parameters, start (s) in flight, pitch, roll, path speed.

    A "ramp" is level, from one velocity to another (`ramp_parameters`), with its largest speed.
    A "hold" stays in one position, and may climb and turn on the spot; the rows of its table are
    lat_deg, lon_deg, alt_m, climb_mps, yaw_rad and rate_rad_s.
    """

    kind: Kind
    start_s: float
    parameters: FloatArray
    pitch_rad: float
    roll_rad: float
    speed_mps: float


def position_and_yaw_held(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude (deg), altitude (m), yaw (rad) held still; rows: see `Segment`."""
    zero = np.zeros_like(elapsed)
    # Reduced before the sum, so that hours of turning keep their digits and stay in [0, 2 pi).
    yaw = remainder(table[4] + table[5] * elapsed, TWO_PI)
    return zero + table[0], zero + table[1], table[2] + table[3] * elapsed, yaw


FORMULAS = {
    "geodesic": position_and_yaw_on_geodesic, "turn": position_and_yaw_on_turn,
    "hold": position_and_yaw_held, "ramp": position_and_yaw_on_ramp,
}  # fmt: skip
KINDS: tuple[Kind, ...] = ("geodesic", "turn", "hold", "ramp")


class Ramps(Growing):
    """Flights of a single ramp each, by start time (s) and the `ramp_parameters` table.

    They fly as scripts of one such leg, of which only what differs is held: every multirotor of a
    fleet begins one in every second.
    """

    def __init__(self, start_s: FloatArray, table: FloatArray, fastest_mps: FloatArray) -> None:
        self._start_s, self.max_speeds_mps = start_s, fastest_mps
        #: The rows of a ramp beside each other in memory: some ramps are taken at once.
        self._tables = GrowingArray(np.asfortranarray(table))

    def with_flights(self, ramps: Ramps) -> Ramps:
        """Return a collection of these ramps followed by more ramps."""
        if not len(self):  # nothing says there how the rows lie in memory
            return ramps
        fleet = self.with_appended(_start_s=ramps._start_s, max_speeds_mps=ramps.max_speeds_mps)
        fleet._tables = self._tables.with_appended(ramps._tables.values)
        return fleet

    def __len__(self) -> int:
        return len(self._start_s)

    def segment(self, ramp: int) -> tuple[Segment, float]:
        """Return a ramp as a leg, and the time (s) at which it begins."""
        table = self._tables.values[:, ramp].copy()
        fastest_mps = float(self.max_speeds_mps[ramp])
        return Segment("ramp", 0.0, table, 0.0, 0.0, fastest_mps), float(self._start_s[ramp])

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the given ramps, each at its own time (s)."""
        return evaluate_in_blocks(self._state, aircraft, time_s)

    def velocities_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return ramps' velocities (2, n) to the east and north (m/s), each at its own time (s)."""
        return np.stack(
            ramp_velocity_in_start_axes(*self._tables_elapsed_and_starts(aircraft, time_s)[:2])
        )

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the ground speeds (m/s) of the given ramps, each at its own time (s)."""
        return np.asarray(np.hypot(*self.velocities_mps(aircraft, time_s)))

    def _tables_elapsed_and_starts(
        self, aircraft: IntArray, time_s: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return ramps' tables (rows, n), times (s) since their starts, and start times (s)."""
        table = np.ascontiguousarray(self._tables.values.T.take(aircraft, axis=0).T)
        start_s = self._start_s.take(aircraft)
        elapsed = np.minimum(np.maximum(time_s, start_s), start_s + LONGEST_FLIGHT_S) - start_s
        return table, elapsed, start_s

    def _state(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        table, elapsed, start_s = self._tables_elapsed_and_starts(aircraft, time_s)
        level = np.zeros(len(elapsed))
        return TrajectoryState(
            *position_and_yaw_on_ramp(table, elapsed), level, level, time_s >= start_s
        )
