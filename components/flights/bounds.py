"""Bounds of flights over a run: speeds, times, lines of sight, and height above the terrain.

Nothing moves farther than its largest speed times half the spacing of the samples from where a
sample saw it. What holds at the samples, widened by that, holds all the time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.flights.fleet import Fleet
from components.flights.sampled_flight import SampledTrajectory
from components.flights.scripted_flights import ScriptedTrajectory
from components.geometry import (
    ECCENTRICITY_SQUARED,
    SEMI_MAJOR_AXIS_M,
    TrajectoryState,
    line_of_sight,
    wrap_by_sines,
)
from components.geometry.error_bounds import max_true_range_m
from components.messages.reach import REACH_MARGIN, FarthestLook
from components.terrain.raster import ElevationRaster
from dsa_des.arrays.types import FloatArray

Interval = tuple[float, float]
#: States of a flight at times (n,).
FlightAt = Callable[[FloatArray], TrajectoryState]

# Two per second where there are few aircraft, and a tenth of a second's work where there are many.
_SPACING_S = 0.5
_MOST_CELLS = 200_000
#: Instants, one a second, at which a flight is compared with the terrain.
_MOST_SAMPLES = 100_000
# As in `culling`: speeds of turns and long legs hold to 2e-4, positions to less than a metre.
_SPEED_MARGIN = 1.001
_POSITION_MARGIN_M = 1.0


class OwnPath(NamedTuple):
    """The ownship's sampled positions, and how far (m) it gets from one until halfway to the next.

    `place` is latitude and longitude in degrees, and altitude in m.
    """

    time_s: FloatArray
    place: tuple[FloatArray, FloatArray, FloatArray]
    moves_m: float
    half_s: float


@dataclass(frozen=True)
class TrafficEnvelope:
    """Bounds over a run on the ownship's flight and on the targets that come within reach of it.

    Sizes of angles are the largest, elevations above the ownship's horizon; `range_m` is the
    longest line of sight within reach, 0 if no target ever comes in reach.
    """

    range_m: float
    own_lat_deg: Interval
    own_alt_m: Interval
    target_alt_m: Interval
    elevation_rad: float
    pitch_rad: float
    roll_rad: float
    own_path: OwnPath


def traffic_envelope(own: Any, fleet: Fleet, duration_s: float, reach_m: float) -> TrafficEnvelope:
    """Return bounds on the ownship's flight and on targets that may come within ``reach_m``."""
    times, half_s = _midpoints_and_half_step_s(duration_s, len(fleet))
    own_state, states = own.at(times), fleet.at(times)
    own_moves = _max_distance_m(own.max_speed_mps, half_s)
    moves = _max_distance_m(fleet.max_speeds_mps, half_s)
    _, elevation, range_m = line_of_sight(
        own_state.lat_deg[:, np.newaxis],
        own_state.lon_deg[:, np.newaxis],
        own_state.alt_m[:, np.newaxis],
        states.lat_deg,
        states.lon_deg,
        states.alt_m,
        validate=False,
    )
    apart = moves + own_moves
    near = range_m - apart <= REACH_MARGIN * reach_m
    latitudes, alt, turns = _latitude_and_altitude_bounds(own_state, own_moves)
    pitch, roll = attitude_extremes_rad(own)
    place = own_state.lat_deg, own_state.lon_deg, own_state.alt_m
    path = OwnPath(times, place, float(own_moves), half_s)
    if not near.any():
        return TrafficEnvelope(0.0, latitudes, alt, alt, 0.0, pitch, roll, path)
    swing = np.arcsin(np.minimum(1.0, apart / np.maximum(range_m, 1e-3)))
    steepest = float(np.max((np.abs(elevation) + swing)[near])) + turns
    low, high = states.alt_m - moves, states.alt_m + moves
    return TrafficEnvelope(
        min(reach_m, float(np.max((range_m + apart)[near]))),
        latitudes,
        alt,
        (float(low[near].min()), float(high[near].max())),
        min(0.5 * math.pi, steepest),
        pitch,
        roll,
        path,
    )


def max_true_ranges_m(
    own: Fleet, targets: int, duration_s: float, look: FarthestLook
) -> FloatArray:
    """Return each run's largest true range (m) at which a sensor may still detect a target.

    That is its range, or what ranges by models of the Earth may truly be where this ownship flies;
    `targets` is how many there are in a run.
    """
    reaches_m: FloatArray = np.full(len(own), look.range_m)
    if look.seeming:
        times, half_s = _midpoints_and_half_step_s(duration_s, targets)
        for run, speed_mps in enumerate(own.max_speeds_mps.tolist()):
            state = own.each(np.full(len(times), run), times)
            latitudes, alt, _ = _latitude_and_altitude_bounds(
                state, _max_distance_m(speed_mps, half_s)
            )
            true_m = [max_true_range_m(earth, m, latitudes, alt) for earth, m in look.seeming]
            reaches_m[run] = max(look.range_m, *true_m)
    return reaches_m


def _midpoints_and_half_step_s(duration_s: float, targets: int) -> tuple[FloatArray, float]:
    """Return midpoints (s) of as many equal parts of a run as affordable, and half a part (s)."""
    count = min(duration_s / _SPACING_S, _MOST_CELLS / max(1, targets))
    intervals = max(1, math.ceil(count))
    half_s = 0.5 * duration_s / intervals
    times = (np.arange(intervals, dtype=np.float64) + 0.5) * (2.0 * half_s)
    return times, half_s


def _latitude_and_altitude_bounds(
    state: TrajectoryState, moves_m: float
) -> tuple[Interval, Interval, float]:
    """Return the intervals of latitude (deg) and altitude (m) within ``moves_m`` of the ownship's
    samples, and that distance as an angle (rad).
    """
    lowest = float(state.alt_m.min()) - moves_m
    # The normal turns fastest along the equator's meridian.
    turns = moves_m / (SEMI_MAJOR_AXIS_M * (1.0 - ECCENTRICITY_SQUARED) + lowest)
    latitudes = (
        max(-90.0, float(state.lat_deg.min()) - math.degrees(turns)),
        min(90.0, float(state.lat_deg.max()) + math.degrees(turns)),
    )
    return latitudes, (lowest, float(state.alt_m.max()) + moves_m), turns


def attitude_extremes_rad(trajectory: Any) -> tuple[float, float]:
    """Return a flight's largest absolute pitch and roll (rad); pi/2 and pi where not known."""
    if isinstance(trajectory, SampledTrajectory):
        # Between samples both change evenly, roll by the shorter way round.
        turned = np.diff(trajectory.roll_rad)
        after = trajectory.roll_rad[:-1] + wrap_by_sines(turned)
        roll = np.concatenate((trajectory.roll_rad, after))
        return float(np.max(np.abs(trajectory.pitch_rad))), float(np.max(np.abs(roll)))
    if isinstance(trajectory, ScriptedTrajectory):
        _, pitch, roll_fixed = trajectory.fixed_attitude_rad
        pitches = [s.pitch_rad for s in trajectory.segments] if pitch is None else [pitch]
        rolls = [s.roll_rad for s in trajectory.segments] if roll_fixed is None else [roll_fixed]
        return max(map(abs, pitches)), max(map(abs, rolls))
    return 0.5 * math.pi, math.pi


def _max_distance_m(speed_mps: Any, half_s: float) -> Any:
    return _SPEED_MARGIN * speed_mps * half_s + _POSITION_MARGIN_M


def _times_and_states_each_second(
    own_at: FlightAt, duration_s: float
) -> tuple[FloatArray, TrajectoryState]:
    times = np.linspace(0.0, duration_s, min(math.ceil(duration_s), _MOST_SAMPLES) + 1)
    return times, own_at(times)


def check_above_terrain(own_at: FlightAt, terrain_m: float, duration_s: float) -> None:
    """Raise ValueError if the ownship is not above the terrain, checked at each second."""
    times, state = _times_and_states_each_second(own_at, duration_s)
    hit = np.flatnonzero((state.alt_m <= terrain_m) & state.present)
    if len(hit):
        first = hit[0]
        raise ValueError(
            f"[terrain] height_m is {terrain_m:g}: it must be below the ownship, which is at "
            f"{state.alt_m[first]:g} m at {times[first]:g} s"
        )


def check_over_raster_above_ground(
    own_at: FlightAt, raster: ElevationRaster, offset_m: float, duration_s: float
) -> None:
    """Raise ValueError if the ownship never is over the raster, or is once not above its ground."""
    times, state = _times_and_states_each_second(own_at, duration_s)
    there = np.flatnonzero(state.present)
    ground, inside = raster.heights_and_coverage(state.lat_deg[there], state.lon_deg[there])
    if len(there) and not inside.any():
        first = there[0]
        raise ValueError(
            f"[terrain] raster {raster.name} covers {raster.bounds_text()}: the ownship is at "
            f"latitude "
            f"{state.lat_deg[first]:.6g}, longitude {state.lon_deg[first]:.6g} and never over it; "
            "they must overlap"
        )
    hit = np.flatnonzero(state.alt_m[there] <= ground + offset_m)
    if len(hit):
        first = there[hit[0]]
        raise ValueError(
            f"[terrain] raster {raster.name} is {ground[hit[0]] + offset_m:.6g} m high under the "
            f"ownship, which is at {state.alt_m[first]:.6g} m at {times[first]:.6g} s: it must fly "
            "above the ground"
        )
