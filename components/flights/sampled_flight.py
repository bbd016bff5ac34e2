"""A flight known from samples: cubics between them, and nothing beyond them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np
import numpy.typing as npt

from components.flights.attitude import attitude_from_path, fit_path
from components.geometry.angles import (
    FloatArray,
    Vector,
    local_axes,
    normal_to_degrees,
    wrap_difference_rad,
    wrap_heading_rad,
    wrap_longitude_deg,
)
from components.geometry.ellipsoid import SEMI_MAJOR_AXIS_M, line_of_sight, radii_of_curvature
from components.geometry.state import TrajectoryState

LARGEST = 1e12
"""Times, longitudes and angles beyond this carry no useful digits any more."""

_LIMITS = {
    "lat_deg": (90.0, "it must lie in [-90, 90] degrees"),
    "lon_deg": (1e6, "it must lie within ±1e6 degrees"),
    "alt_m": (1e6, "it must lie within ±1e6 metres"),
    "yaw_rad": (1e6, "it must lie within ±1e6 radians"),
    "pitch_rad": (np.pi / 2, "it must lie in [-pi/2, pi/2] radians"),
    "roll_rad": (1e6, "it must lie within ±1e6 radians"),
}


def checked_samples(name: str, **columns: npt.ArrayLike | None) -> dict[str, FloatArray]:
    """Return the given columns as contiguous arrays of one length."""
    checked: dict[str, FloatArray] = {}
    for column, values in columns.items():
        if values is None:
            continue
        array = np.array(values, dtype=np.float64, order="C")
        if array.ndim != 1 or len(array) == 0:
            raise ValueError(
                f"{name}: {column} has shape {array.shape}: it must have one axis and at least "
                "one sample"
            )
        limit, allowed = _LIMITS.get(column, (LARGEST, f"it must be finite, within ±{LARGEST:g}"))
        bad = ~(np.abs(array) <= limit)
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(f"{name}: {column} is {array[first]} (sample {first}): {allowed}")
        checked[column] = array
        if len(array) != len(checked["time_s"]):
            raise ValueError(
                f"{name}: {column} has {len(array)} samples: time_s has {len(checked['time_s'])}"
            )
    late = np.diff(checked["time_s"]) <= 0.0
    if late.any():
        first = int(np.argmax(late)) + 1
        raise ValueError(
            f"{name}: time_s is {checked['time_s'][first]} at sample {first}, after "
            f"{checked['time_s'][first - 1]}: times must strictly increase"
        )
    return checked


def all_within_limits(columns: Mapping[str, FloatArray]) -> bool:
    """Tell whether no value of any column, of any shape, is one that `checked_samples` refuses."""
    return all(bool((np.abs(array) <= _LIMITS[name][0]).all()) for name, array in columns.items())


RAD_PER_DEG = np.pi / 180.0

MOST_ACCELERATION_MPS2 = 20.0
MISFIT_MPS = 0.5
MISFIT_MPS2 = 1.0
"""Measured velocities bend the path of a segment of duration dt only if the mean of the two lies
within 0.5 m/s + 1 m/s²·dt of the segment's mean velocity (at constant acceleration they are
equal) and the two differ by less than 20 m/s²·dt + 1 m/s. Real files hold worse, and a wrong
velocity would bend a path that a straight line leaves good."""

# Rows of the coefficient table: four cubics (normal x, y, z and altitude) and the attitude.
_ALT, _LAT, _LON, _YAW, _YAW_RATE, _TURN_WITH_LON = 12, 16, 17, 18, 19, 20
_PITCH, _PITCH_RATE, _ROLL, _ROLL_RATE = 21, 22, 23, 24
_ROWS = 25


def fit_segments(
    time_s: FloatArray,
    place: tuple[FloatArray, FloatArray, FloatArray],
    attitude_rad: tuple[FloatArray, FloatArray, FloatArray],
    velocity_enu_mps: Vector | None = None,
) -> FloatArray:
    """Tabulate each segment's polynomials, (25, n), or (25, n, aircraft) at the same times.

    The last sample is a segment of its own; place is latitude, longitude (deg) and altitude (m).
    """
    lat_deg, lon_deg, alt_m = place
    yaw_rad, pitch_rad, roll_rad = attitude_rad
    table = np.zeros((_ROWS, *lat_deg.shape))
    _, _, normal = local_axes(lat_deg, lon_deg)
    start = (*normal, alt_m)
    table[_LAT], table[_LON] = lat_deg, lon_deg
    table[_YAW], table[_PITCH], table[_ROLL] = attitude_rad
    duration = np.diff(time_s).reshape(-1, *(1 for _ in lat_deg.shape[1:]))
    tangents = None
    if velocity_enu_mps is not None:
        tangents = _tangents(lat_deg, lon_deg, alt_m, velocity_enu_mps)
    bent = None if tangents is None else _bent_segments(start, tangents, duration)
    for row, value in enumerate(start):
        table[4 * row] = value
        slope = np.diff(value, axis=0) / duration
        table[4 * row + 1, :-1] = slope
        if tangents is not None and bent is not None:
            m0, m1 = tangents[row][:-1], tangents[row][1:]
            table[4 * row + 1, :-1] = np.where(bent, m0, slope)
            second = (3.0 * slope - 2.0 * m0 - m1) / duration
            third = (m0 + m1 - 2.0 * slope) / (duration * duration)
            table[4 * row + 2, :-1] = np.where(bent, second, 0.0)
            table[4 * row + 3, :-1] = np.where(bent, third, 0.0)
    # Near a pole yaw turns with longitude, by a whole turn for a whole turn, so that it is
    # yaw minus longitude (plus, in the south) that changes slowly and can be interpolated.
    turn = np.where(np.abs(lat_deg) > 60.0, np.sign(lat_deg), 0.0)
    lon_change = wrap_longitude_deg(np.diff(lon_deg, axis=0)) * RAD_PER_DEG
    yaw_change = wrap_difference_rad(np.diff(yaw_rad, axis=0) - turn[:-1] * lon_change)
    table[_YAW_RATE, :-1] = yaw_change / duration
    table[_TURN_WITH_LON] = turn * RAD_PER_DEG
    table[_PITCH_RATE, :-1] = np.diff(pitch_rad, axis=0) / duration
    table[_ROLL_RATE, :-1] = wrap_difference_rad(np.diff(roll_rad, axis=0)) / duration
    return table


def _tangents(
    lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray, velocity_enu_mps: Vector
) -> tuple[FloatArray, ...]:
    """Rates of change of the normal's components and of altitude, from the velocity."""
    east, north, _ = local_axes(lat_deg, lon_deg)
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    v_east, v_north, v_up = velocity_enu_mps
    turn_east = v_east / (prime_vertical + alt_m)
    turn_north = v_north / (meridian + alt_m)
    rates = (turn_east * e + turn_north * n for e, n in zip(east, north, strict=True))
    return (*rates, v_up)


def _bent_segments(
    start: tuple[FloatArray, ...], tangents: tuple[FloatArray, ...], duration: FloatArray
) -> npt.NDArray[np.bool_]:
    """Tell which segments' end velocities are plausible beside their mean velocity."""
    misfit, change = np.zeros_like(duration), np.zeros_like(duration)
    for row, (value, tangent) in enumerate(zip(start, tangents, strict=True)):
        to_metres = 1.0 if row == 3 else SEMI_MAJOR_AXIS_M
        mean = 0.5 * (tangent[1:] + tangent[:-1])
        misfit = misfit + (to_metres * (np.diff(value, axis=0) / duration - mean)) ** 2
        change = change + (to_metres * np.diff(tangent, axis=0)) ** 2
    fits = misfit <= (MISFIT_MPS + MISFIT_MPS2 * duration) ** 2
    return fits & (change <= (MOST_ACCELERATION_MPS2 * duration + 1.0) ** 2)


def locate(
    sample_times: FloatArray, times: FloatArray
) -> tuple[npt.NDArray[np.intp], FloatArray, npt.NDArray[np.bool_]]:
    """Return each time's segment, the time elapsed in it (s), and whether it is within the samples.

    Times outside are moved to the nearest sample.
    """
    present = (times >= sample_times[0]) & (times <= sample_times[-1])
    inside = np.where(times > sample_times[0], times, sample_times[0])
    inside = np.where(inside < sample_times[-1], inside, sample_times[-1])
    segment = np.searchsorted(sample_times, inside, side="right") - 1
    return segment, inside - sample_times[segment], present


def evaluate_segments(
    table: FloatArray, elapsed: FloatArray, present: npt.NDArray[np.bool_]
) -> TrajectoryState:
    """Evaluate gathered segments, element by element."""
    x, y, z, alt = (
        ((table[r + 3] * elapsed + table[r + 2]) * elapsed + table[r + 1]) * elapsed + table[r]
        for r in (0, 4, 8, _ALT)
    )
    lat, lon = normal_to_degrees(x, y, z)
    at_sample = elapsed == 0.0
    lat = np.where(at_sample, table[_LAT], lat)
    lon = np.where(at_sample, table[_LON], lon)
    yaw = table[_YAW] + table[_YAW_RATE] * elapsed
    yaw += table[_TURN_WITH_LON] * wrap_longitude_deg(lon - table[_LON])
    pitch = table[_PITCH] + table[_PITCH_RATE] * elapsed
    roll = table[_ROLL] + table[_ROLL_RATE] * elapsed
    return TrajectoryState(lat, lon, alt, wrap_heading_rad(yaw), pitch, roll, present)


__all__ = ["SampledTrajectory", "TrajectoryState", "evaluate_segments", "locate"]

CELLS_AT_ONCE = 8192
"""Cells worked on together: the two dozen arrays in flight then stay in the processor's cache."""


class SampledTrajectory:
    """An aircraft known at samples in time, interpolated between them and nowhere else.

    Between two samples the unit normal of the ellipsoid and the altitude follow a cubic (Hermite)
    that meets both samples and both velocities where velocities were measured and fit the
    samples, and a straight line otherwise. Working on the normal there is no seam at the
    antimeridian and no singular pole. At a sample, position and attitude are the sample's own
    bits. Measured errors in a 3 deg/s turn at 60 m/s: with velocities 23 µm from 1 Hz samples and
    0.5 µm from 10 Hz; without, 0.39 m (V·rate·dt²/8) and 3.9 mm. Ten-hertz flight recordings
    thinned to 1 Hz come back within 0.4 m, mostly the recordings' own inconsistency.

    Parameters
    ----------
    name : str
        The aircraft's name.
    time_s : array_like, shape (n,)
        Strictly increasing; any spacing; n of at least 1.
    lat_deg, lon_deg, alt_m : array_like, shape (n,)
        Geodetic position; longitude may have any number of turns.
    velocity_enu_mps : tuple of three array_like, optional
        Ground velocity east, north, up at the samples.
    yaw_rad, pitch_rad, roll_rad : array_like, optional
        Attitude where known; what is not given is derived from the path.
    wind_east_north_mps : tuple of two float
        Where the air goes: a derived attitude is that of the velocity through it.

    Raises
    ------
    ValueError
        Times that do not increase, values that are not finite, a latitude outside ±90, or
        arrays of different lengths.
    """

    def __init__(
        self,
        name: str,
        time_s: npt.ArrayLike,
        lat_deg: npt.ArrayLike,
        lon_deg: npt.ArrayLike,
        alt_m: npt.ArrayLike,
        *,
        velocity_enu_mps: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike] | None = None,
        yaw_rad: npt.ArrayLike | None = None,
        pitch_rad: npt.ArrayLike | None = None,
        roll_rad: npt.ArrayLike | None = None,
        wind_east_north_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        east, north, up = velocity_enu_mps if velocity_enu_mps is not None else (None,) * 3
        given = checked_samples(
            name,
            time_s=time_s,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            alt_m=alt_m,
            velocity_east_mps=east,
            velocity_north_mps=north,
            velocity_up_mps=up,
            yaw_rad=yaw_rad,
            pitch_rad=pitch_rad,
            roll_rad=roll_rad,
        )
        self.name = name
        self.sample_times_s = given["time_s"]
        self.lat_deg, self.alt_m = given["lat_deg"], given["alt_m"]
        self.lon_deg = wrap_longitude_deg(given["lon_deg"])
        path = (self.sample_times_s, self.lat_deg, self.lon_deg, self.alt_m)
        self.velocity_enu_mps: Vector | None = None
        self.velocity_was_ignored = False
        if "velocity_east_mps" in given:
            velocity = (
                given["velocity_east_mps"],
                given["velocity_north_mps"],
                given["velocity_up_mps"],
            )
            self.velocity_was_ignored = not _agrees_with_path(velocity, fit_path(*path)[0])
            self.velocity_enu_mps = None if self.velocity_was_ignored else velocity
        #: Which of yaw, pitch and roll were derived from the path, not given.
        self.derived_attitude = tuple(
            angle for angle in ("yaw", "pitch", "roll") if f"{angle}_rad" not in given
        )
        attitude = attitude_from_path(
            *path,
            velocity_enu_mps=self.velocity_enu_mps,
            wind_east_north_mps=wind_east_north_mps,
        )
        yaw, pitch, roll = (
            given.get(key, derived)
            for key, derived in zip(("yaw_rad", "pitch_rad", "roll_rad"), attitude, strict=True)
        )
        self.yaw_rad, self.pitch_rad, self.roll_rad = wrap_heading_rad(yaw), pitch, roll
        self.coefficients = fit_segments(
            self.sample_times_s,
            (self.lat_deg, self.lon_deg, self.alt_m),
            (self.yaw_rad, self.pitch_rad, self.roll_rad),
            self.velocity_enu_mps,
        )
        self.max_speed_mps = self._speed_bound()

    @classmethod
    def together(
        cls,
        names: Sequence[str],
        time_s: FloatArray,
        lat_deg: FloatArray,
        lon_deg: FloatArray,
        alt_m: FloatArray,
    ) -> list[SampledTrajectory]:
        """Return aircraft that are known at the same times, as each would be made alone."""
        found: list[SampledTrajectory] = []
        width = max(1, CELLS_AT_ONCE // max(1, len(time_s)))
        for first in range(0, len(names), width):
            block = slice(first, first + width)
            place = [np.ascontiguousarray(part[:, block]) for part in (lat_deg, lon_deg, alt_m)]
            found += cls._alike(names[block], time_s, *place)
        return found

    @classmethod
    def _alike(
        cls,
        names: Sequence[str],
        time_s: FloatArray,
        lat_deg: FloatArray,
        lon_deg: FloatArray,
        alt_m: FloatArray,
    ) -> list[SampledTrajectory]:
        one = cls(names[0], time_s, lat_deg[:, 0], lon_deg[:, 0], alt_m[:, 0])
        columns = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m}
        for number in range(1, len(names)) if not all_within_limits(columns) else ():
            checked_samples(
                names[number], time_s=time_s, **{k: v[:, number] for k, v in columns.items()}
            )
        place = (lat_deg, wrap_longitude_deg(lon_deg), alt_m)
        yaw, pitch, roll = attitude_from_path(time_s, *place)
        attitude = wrap_heading_rad(yaw), pitch, roll
        tables = fit_segments(time_s, place, attitude)
        rows = [np.ascontiguousarray(part.T) for part in (*place, *attitude)]
        speeds = _mean_speed_bound(time_s, *place)
        found = [one]
        for number, name in enumerate(names[1:], start=1):
            made = copy(one)
            made.name = name
            made.lat_deg, made.lon_deg, made.alt_m = (part[number] for part in rows[:3])
            made.yaw_rad, made.pitch_rad, made.roll_rad = (part[number] for part in rows[3:])
            made.coefficients = np.ascontiguousarray(tables[..., number])
            made.max_speed_mps = float(speeds[number])
            found.append(made)
        return found

    def in_wind(self, east_mps: float, north_mps: float) -> SampledTrajectory:
        """Return the same flight with what was derived of its attitude derived with a wind."""
        known = {
            f"{angle}_rad": getattr(self, f"{angle}_rad")
            for angle in ("yaw", "pitch", "roll")
            if angle not in self.derived_attitude
        }
        return SampledTrajectory(
            self.name,
            self.sample_times_s,
            self.lat_deg,
            self.lon_deg,
            self.alt_m,
            velocity_enu_mps=self.velocity_enu_mps,
            wind_east_north_mps=(east_mps, north_mps),
            **known,
        )

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Give the aircraft's state at some times."""
        times = np.asarray(time_s, dtype=np.float64)
        flat = np.ascontiguousarray(times).reshape(-1)
        segment, elapsed, present = locate(self.sample_times_s, flat)
        state = evaluate_segments(self.coefficients[:, segment], elapsed, present)
        return state.reshaped(times.shape)

    def interval_present(self) -> tuple[float, float]:
        """Return the times of the first and the last sample, both included."""
        return float(self.sample_times_s[0]), float(self.sample_times_s[-1])

    def _speed_bound(self) -> float:
        """Return a speed that the interpolated path never exceeds.

        A cubic's velocity is a mix of its end velocities (weights adding up to 1 at most) and of
        1.5 times its mean velocity at most.
        """
        place = self.lat_deg, self.lon_deg, self.alt_m
        mean = float(_mean_speed_bound(self.sample_times_s, *place))
        if self.velocity_enu_mps is None or len(self.sample_times_s) < 2:
            return mean
        east, north, up = self.velocity_enu_mps
        return 1.5 * mean + float(np.max(np.sqrt(east**2 + north**2 + up**2)))


def _mean_speed_bound(
    time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray
) -> FloatArray:
    """Return what no mean speed between two samples exceeds, of one aircraft or of several."""
    if len(time_s) < 2:
        return np.zeros(lat_deg.shape[1:])
    at = slice(None, -1), slice(1, None)
    _, _, step_m = line_of_sight(
        *(column[rows] for rows in at for column in (lat_deg, lon_deg, alt_m)), validate=False
    )
    duration = np.diff(time_s).reshape(-1, *(1 for _ in lat_deg.shape[1:]))
    # Chords are shorter than paths on the ground by far less than one per cent.
    bound: FloatArray = 1.01 * np.max(step_m / duration, axis=0)
    return bound


def _agrees_with_path(measured: Vector, fitted: Vector) -> bool:
    """Tell whether velocities are those of the path: median misfit in 5 m/s or 10 % of speed."""
    misfit = np.sqrt(sum((m - f) ** 2 for m, f in zip(measured, fitted, strict=True)))
    speed = np.sqrt(sum(f**2 for f in fitted))
    return len(misfit) < 2 or float(np.median(misfit)) <= max(5.0, 0.1 * float(np.median(speed)))
