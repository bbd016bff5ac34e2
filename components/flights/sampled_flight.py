"""Flights known from samples: cubics between them, and nothing beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from components.flights.attitude import (
    attitude_from_path,
    fit_velocity_and_acceleration,
    overlapping_path_blocks,
)
from components.flights.fleet import (
    CELLS_AT_ONCE,
    Fleet,
    PieceSearch,
    checked_one_axis_times,
    evaluate_in_blocks,
    uninitialized_state,
)
from components.flights.sampled_segments import (
    ATTITUDE_ROWS,
    POSITION_ROWS,
    STRAIGHT_ROWS,
    all_within_limits,
    checked_samples,
    evaluate_segments,
    fit_segments,
    segments_elapsed_and_presence,
)
from components.geometry import (
    TrajectoryState,
    Vector,
    slant_range_m,
    wrap_heading_rad,
    wrap_longitude_deg,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class SampledTrajectory:
    """An aircraft known at samples in time, interpolated between them and nowhere else.

    Between two samples the unit normal of the ellipsoid and the altitude follow a cubic (Hermite)
    that meets both samples and both velocities where velocities were measured and fit the samples,
    and a straight line otherwise. Working on the normal there is no seam at the antimeridian and no
    singular pole. At a sample, position and attitude are the sample's own bits. Measured errors in
    a 3 deg/s turn at 60 m/s: with velocities 23 µm from 1 Hz samples and 0.5 µm from 10 Hz;
    without, 0.39 m (V·rate·dt²/8) and 3.9 mm. Ten-hertz flight recordings thinned to 1 Hz come back
    within 0.4 m.

    Columns are (n,), n of at least 1; times strictly increase, longitudes may have any number of
    turns. Attitude that is not given is derived from the path through the air, which moves by
    `wind_east_north_mps`. After samples that are `away` (n,) it is not there until the next one.
    ValueError names what cannot be.
    """

    #: Position and attitude at the samples.
    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    yaw_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray
    #: A table of a fleet that holds its coefficients, and in which row they begin.
    place: tuple[FloatArray, int] | None = None

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
        away: BoolArray | None = None,
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
            self.velocity_was_ignored = not _is_velocity_of_path(velocity, *path)
            self.velocity_enu_mps = None if self.velocity_was_ignored else velocity
        #: Which of yaw, pitch and roll were derived from the path, not given.
        self.derived_attitude = tuple(
            angle for angle in ("yaw", "pitch", "roll") if f"{angle}_rad" not in given
        )
        #: After which samples it is not there until the next one; None where there is no such.
        self.away = away if away is not None and away.any() else None
        attitude = self._attitude_of_path_rad(path, wind_east_north_mps)
        yaw, pitch, roll = (
            given.get(key, derived)
            for key, derived in zip(("yaw_rad", "pitch_rad", "roll_rad"), attitude, strict=True)
        )
        self.yaw_rad, self.pitch_rad, self.roll_rad = wrap_heading_rad(yaw), pitch, roll
        self.max_speed_mps = self._speed_bound()

    def _attitude_of_path_rad(
        self, path: tuple[FloatArray, ...], wind_east_north_mps: tuple[float, float]
    ) -> tuple[FloatArray, ...]:
        """Return yaw, pitch and roll (rad) of a path, derived singly for pieces between gaps."""
        ends = [] if self.away is None else (np.flatnonzero(self.away) + 1).tolist()
        pieces = []
        for first, end in pairwise([0, *ends, len(path[0])]):
            part = slice(first, end)
            velocity: Vector | None = None
            if self.velocity_enu_mps is not None:
                east, north, up = (along[part] for along in self.velocity_enu_mps)
                velocity = east, north, up
            pieces.append(
                attitude_from_path(
                    *(column[part] for column in path),
                    velocity_enu_mps=velocity,
                    wind_east_north_mps=wind_east_north_mps,
                )
            )
        if len(pieces) == 1:
            return pieces[0]
        return tuple(np.concatenate(parts) for parts in zip(*pieces, strict=True))

    def __getattr__(self, name: str) -> Any:
        """Return what a flight that was made with others has in its coefficients only."""
        if name not in _ROWS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return np.ascontiguousarray(self.coefficients[_ROWS[name]])

    @cached_property
    def coefficients(self) -> FloatArray:
        """Each segment's polynomial coefficients, (rows, samples), as `fit_segments` makes them."""
        return fit_segments(
            self.sample_times_s,
            (self.lat_deg, self.lon_deg, self.alt_m),
            (self.yaw_rad, self.pitch_rad, self.roll_rad),
            self.velocity_enu_mps,
        )

    @classmethod
    def from_common_times(
        cls,
        names: Sequence[str],
        time_s: FloatArray,
        lat_deg: FloatArray,
        lon_deg: FloatArray,
        alt_m: FloatArray,
        place: tuple[FloatArray, int] | None = None,
    ) -> list[SampledTrajectory]:
        """Return a flight for each name, all sampled at the same times, as if made one by one.

        Their coefficients go to a table that is given, from a row on, or to one of their own.
        """
        count = len(time_s)
        table, start = place or (np.empty((len(names) * count, STRAIGHT_ROWS)), 0)
        flights: list[SampledTrajectory] = []
        width = max(1, CELLS_AT_ONCE // max(1, count))
        for first in range(0, len(names), width):
            block = slice(first, first + width)
            lat, lon, alt = (
                np.ascontiguousarray(part[:, block]) for part in (lat_deg, lon_deg, alt_m)
            )
            at = table, start + first * count
            flights += cls._make_all_alike(names[block], time_s, lat, lon, alt, at)
        return flights

    @classmethod
    def _make_all_alike(
        cls,
        names: Sequence[str],
        time_s: FloatArray,
        lat_deg: FloatArray,
        lon_deg: FloatArray,
        alt_m: FloatArray,
        place: tuple[FloatArray, int],
    ) -> list[SampledTrajectory]:
        columns = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m}
        for number in range(1 if all_within_limits(columns) else len(names)):
            given = checked_samples(
                names[number], time_s=time_s, **{k: v[:, number] for k, v in columns.items()}
            )
        position = (lat_deg, wrap_longitude_deg(lon_deg), alt_m)
        yaw, pitch, roll = attitude_from_path(time_s, *position)
        fitted = fit_segments(time_s, position, (wrap_heading_rad(yaw), pitch, roll))
        speeds = _largest_mean_speed_bound(time_s, *position).tolist()
        (table, end), flights = place, []
        for number, (name, speed_mps) in enumerate(zip(names, speeds, strict=True)):
            start, end = end, end + len(time_s)
            table[start:end] = fitted[..., number].T
            made = cls.__new__(cls)
            made.name, made.sample_times_s = name, given["time_s"]
            made.velocity_enu_mps, made.velocity_was_ignored = None, False
            made.derived_attitude, made.away = ("yaw", "pitch", "roll"), None
            made.coefficients, made.place = table[start:end].T, (table, start)
            made.max_speed_mps = speed_mps
            flights.append(made)
        return flights

    def with_derived_angles_in_wind(
        self, east_mps: float, north_mps: float, alt_m: FloatArray | None = None
    ) -> SampledTrajectory:
        """Return the same flight with its path-derived attitude angles derived anew in a wind.

        With `alt_m` it is at these altitudes.
        """
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
            self.alt_m if alt_m is None else alt_m,
            velocity_enu_mps=self.velocity_enu_mps,
            wind_east_north_mps=(east_mps, north_mps),
            away=self.away,
            **known,
        )

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Return the aircraft's state at some times."""
        times = np.asarray(time_s, dtype=np.float64)
        flat = np.ascontiguousarray(times).reshape(-1)
        segment, elapsed, present = segments_elapsed_and_presence(self.sample_times_s, flat)
        if self.away is not None:
            present &= ~self.away[segment] | (elapsed == 0.0)
        table = np.ascontiguousarray(self.coefficients[:, segment])
        state = evaluate_segments(table, elapsed, present)
        return state.reshape(times.shape)

    def interval_present(self) -> tuple[float, float]:
        """Return the times of the first and the last sample, both included."""
        return float(self.sample_times_s[0]), float(self.sample_times_s[-1])

    def _speed_bound(self) -> float:
        """Return a speed that the interpolated path never exceeds.

        A cubic's velocity is a mix of its end velocities (weights adding up to 1 at most) and of
        1.5 times its mean velocity at most.
        """
        position = self.lat_deg, self.lon_deg, self.alt_m
        mean = float(_largest_mean_speed_bound(self.sample_times_s, *position))
        if self.velocity_enu_mps is None or len(self.sample_times_s) < 2:
            return mean
        east, north, up = self.velocity_enu_mps
        return 1.5 * mean + float(np.max(np.sqrt(east**2 + north**2 + up**2)))


class SampledFleet(Fleet):
    """A fleet of sampled flights; sample times that flights share are searched only once."""

    def __init__(self, trajectories: Sequence[SampledTrajectory]) -> None:
        self._flights = list(trajectories)

    @cached_property
    def _flights_by_sample_times(self) -> list[tuple[FloatArray, list[int]]]:
        """The distinct arrays of sample times, each with the indices of its flights."""
        by_bytes: dict[bytes, list[int]] = {}
        for i, flight in enumerate(self._flights):
            by_bytes.setdefault(flight.sample_times_s.tobytes(), []).append(i)
        return [(self._flights[of[0]].sample_times_s, of) for of in by_bytes.values()]

    @cached_property
    def _coefficients_and_shifts(self) -> tuple[FloatArray, IntArray | None]:
        """Return all segments' coefficients, a row each, and flights' row shifts (None if all 0).

        With it goes how much later those of each are than in order; None for nowhere. A table is
        there once: flights have theirs from there, and so has another fleet of some of them.
        """
        places = [flight.place for flight in self._flights]
        table = places[0][0] if places and places[0] is not None else None
        if table is None or any(place is None or place[0] is not table for place in places):
            each = list({id(flight): flight for flight in self._flights}.values())
            table, end = _stack_segment_rows([flight.coefficients for flight in each]), 0
            for flight in each:
                start, end = end, end + len(flight.sample_times_s)
                flight.coefficients = table[start:end, : len(flight.coefficients)].T
                flight.place = table, start
        starts = [flight.place[1] for flight in self._flights if flight.place is not None]
        later = np.array(starts, dtype=np.int64) - self._segment_search.first
        return table, later if later.any() else None

    @cached_property
    def _away_segments(self) -> BoolArray | None:
        """Mask over all flights' segments, True in gaps with aircraft away; None without gaps."""
        gaps = [flight.away for flight in self._flights]
        if all(one is None for one in gaps):
            return None
        none = (np.zeros(len(flight.sample_times_s), dtype=bool) for flight in self._flights)
        return np.concatenate(
            [empty if one is None else one for one, empty in zip(gaps, none, strict=True)]
        )

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, index: int) -> SampledTrajectory:  # type: ignore[override]
        return self._flights[index]

    @cached_property
    def _segment_search(self) -> PieceSearch:
        return PieceSearch.from_starts([flight.sample_times_s for flight in self._flights])

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Return every aircraft's state at some times."""
        times, count = checked_one_axis_times(time_s), len(self)
        state = uninitialized_state(len(times), count)
        rows = max(1, CELLS_AT_ONCE // max(1, count))
        for first in range(0, len(times), rows) if count else ():
            block = slice(first, first + rows)
            t = times[block]
            shape = (len(t), count)
            index, elapsed = np.empty(shape, dtype=np.intp), np.empty(shape)
            present = np.empty(shape, dtype=bool)
            for base, columns in self._flights_by_sample_times:
                segment, since, there = segments_elapsed_and_presence(base, t)
                index[:, columns] = segment[:, np.newaxis] + self._segment_search.first[columns]
                elapsed[:, columns] = since[:, np.newaxis]
                present[:, columns] = there[:, np.newaxis]
            if self._away_segments is not None:
                present &= ~self._away_segments[index] | (elapsed == 0.0)
            aircraft = np.broadcast_to(np.arange(count), shape).reshape(-1)
            table = self._coefficients_of_segments(index.reshape(-1), aircraft)
            values = evaluate_segments(table, elapsed.reshape(-1), present.reshape(-1))
            values = values.reshape(shape)
            for out, value in zip(state.arrays(), values.arrays(), strict=True):
                out[block] = value
        return state

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of chosen aircraft (n,), each at its own time (n,) in s."""
        return evaluate_in_blocks(self._state, aircraft, time_s)

    def _coefficients_of_segments(self, index: IntArray, aircraft: IntArray) -> FloatArray:
        table, later = self._coefficients_and_shifts
        index = index if later is None else index + later.take(aircraft)
        return np.ascontiguousarray(table.take(index, axis=0).T)

    def _state(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        samples, first, last = (
            self._segment_search.starts_s,
            self._segment_search.first,
            self._segment_search.last,
        )
        start, end = samples[first[aircraft]], samples[last[aircraft]]
        inside = np.where(time_s > start, time_s, start)
        inside = np.where(inside < end, inside, end)
        segment = self._segment_search(aircraft, inside)
        present = (time_s >= start) & (time_s <= end)
        elapsed = inside - samples[segment]
        if self._away_segments is not None:
            present &= ~self._away_segments[segment] | (elapsed == 0.0)
        return evaluate_segments(
            self._coefficients_of_segments(segment, aircraft), elapsed, present
        )


_NAMES = "lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad", "roll_rad"
_ROWS = dict(zip(_NAMES, (*POSITION_ROWS, *ATTITUDE_ROWS), strict=True))


def _stack_segment_rows(tables: Sequence[FloatArray]) -> FloatArray:
    """Return flights' coefficients (rows, n) as one table, a row per segment, filled with zeros."""
    rows = max(map(len, tables), default=STRAIGHT_ROWS)
    result = np.zeros((sum(table.shape[1] for table in tables), rows))
    end = 0
    for table in tables:
        start, end = end, end + table.shape[1]
        result[start:end, : len(table)] = table.T
    return result


def _largest_mean_speed_bound(
    time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray
) -> FloatArray:
    """Return an upper bound (m/s) on mean speeds between samples, for one or each aircraft."""
    if len(time_s) < 2:
        return np.zeros(lat_deg.shape[1:])
    fastest: list[FloatArray] = []
    for first in range(0, len(time_s) - 1, CELLS_AT_ONCE):
        end = min(first + CELLS_AT_ONCE, len(time_s) - 1)
        at = slice(first, end), slice(first + 1, end + 1)
        ends = (column[rows] for rows in at for column in (lat_deg, lon_deg, alt_m))
        duration = np.diff(time_s[first : end + 1]).reshape(-1, *(1 for _ in lat_deg.shape[1:]))
        fastest.append(np.max(slant_range_m(*ends) / duration, axis=0))
    # Chords are shorter than paths on the ground by far less than one per cent.
    bound: FloatArray = 1.01 * np.max(fastest, axis=0)
    return bound


def _is_velocity_of_path(measured: Vector, time_s: FloatArray, *place: FloatArray) -> bool:
    """Return whether velocities fit the path: median misfit up to 5 m/s or 10 % of median speed."""
    misfit, speed = np.empty(len(time_s)), np.empty(len(time_s))
    for part, inner, rows, offsets in overlapping_path_blocks(time_s):
        fitted, _ = fit_velocity_and_acceleration(
            time_s[part], *(column[part] for column in place), offsets=offsets
        )
        off = sum((m[part] - f) ** 2 for m, f in zip(measured, fitted, strict=True))
        misfit[rows] = np.sqrt(off)[inner]
        speed[rows] = np.sqrt(sum(f**2 for f in fitted))[inner]
    return len(misfit) < 2 or float(np.median(misfit)) <= max(5.0, 0.1 * float(np.median(speed)))
