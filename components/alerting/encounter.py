"""A recorded encounter as relative states at the ownship's times."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from components.alert_configuration.configuration import (
    Configuration,
    Deviations,
    longest_axis_deviation,
    uncertainty_bounds,
)
from components.alerting.levels import AlertPairs
from components.flights.attitude import fit_velocity_and_acceleration
from components.flights.sampled_flight import SampledTrajectory
from components.formats.daa_file import DAIDALUS, EXTRA_COLUMNS, read_daa_samples
from components.formats.recorded.traffic_of_files import TrafficChoice, read_traffic
from components.formats.text_rows import Problems
from components.geometry import east_north_m, east_north_mps
from components.guidance.situation import State
from components.well_clear.detection import Bounds
from components.well_clear.volume import Relative
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.text.safe_text import shorten

Samples = dict[str, FloatArray]


class Encounter(NamedTuple):
    """An ownship and its targets at the ownship's times."""

    ownship: str
    targets: tuple[str, ...]
    time_s: FloatArray  # (times,): as in the file
    # (times, targets) of bool: where a target has a sample at the ownship's time
    present: BoolArray
    # six of (times, targets): east, north, up in m and their rates in m/s, ownship less
    # intruder, in the ownship's plane
    relative: Relative
    # (times, targets) of int: place of each target's alerter in the configuration, from 0
    alerter: IntArray
    bounds: Bounds | None  # How far the relative states may be wrong, where the file says so
    # (4, times): altitude, and velocity east, north, up of the ownship, m and m/s
    own_state: FloatArray
    # (2, times): east and north of the ownship in the plane of its first sample, m, for figures
    own_plane: FloatArray
    target_plane: FloatArray  # (2, times, targets): the same of the targets
    # (2, times): of the air, towards the east and north, m/s; velocities are relative to the
    # air, which changes none of the differences
    wind: FloatArray
    left_out: int  # Samples of targets at other instants than the ownship's
    notes: tuple[str, ...] = ()  # What was assumed in reading the file

    @property
    def pairs(self) -> AlertPairs:
        """Ownship and target at all times, (times, targets), as the alerting takes them."""
        alt_m, *velocity = (part[:, np.newaxis] for part in self.own_state)
        zero = np.zeros(1)
        own = State(*np.broadcast_arrays(zero, zero, alt_m, *velocity, self.present)[:6])
        return AlertPairs(self.relative, own, self.bounds)


def read_encounter(
    path: str | PathLike[str],
    configuration: Configuration,
    wind_mps: tuple[float, float] | None = None,
    choice: TrafficChoice = TrafficChoice(),  # noqa: B008
) -> Encounter:
    """Read a file of recorded aircraft, of any kind, as is chosen; the first is the ownship.

    Aircraft of another file than `.daa` and `.xyz` are sampled at the ownship's times, on the
    flights that traffic follows.
    The wind (towards the east and the north, m/s) is by default what the ownship's columns
    `heading` and `airspeed` imply, where both are given, else none. Targets count at the ownship's
    times: a sample at another instant is left out, as the reference leaves it out. Raises
    `TrafficFileError` with all problems of the file, also without velocities or with an alerter
    that is not there.
    """
    samples, notes = _read_samples_and_notes(path, choice)
    problems = Problems(str(path))
    names = tuple(samples)
    own = samples[names[0]]
    if "ve" not in own:
        problems.fail("there are no velocities: columns trk, gs, vs or vx, vy, vz are needed")
    wind = _wind(own, wind_mps)
    for aircraft in samples.values():
        for key, part in zip(("ve", "vn"), wind, strict=True):
            aircraft[key] = aircraft[key] - np.interp(aircraft["time"], own["time"], part)
    others = [samples[name] for name in names[1:]]
    index, present = _sample_index_and_is_exact(own["time"], others)
    targets = {key: _select_samples([o[key] for o in others], index) for key in own}
    flat = "sx" in own
    state = _states_of_flat_file if flat else _states_of_geodetic_file
    relative, own_state, own_plane, target_plane = state(own, targets)
    which = _alerter_indices(configuration, own, targets, present, problems)
    bounds = (
        _uncertainty_bounds(configuration, own, targets, relative) if "s_ew_std" in own else None
    )
    return Encounter(
        names[0],
        names[1:],
        own["time"],
        present,
        relative,
        which,
        bounds,
        own_state,
        own_plane,
        target_plane,
        wind,
        sum(len(other["time"]) for other in others) - int(present.sum()),
        notes,
    )


def _read_samples_and_notes(
    path: str | PathLike[str], choice: TrafficChoice
) -> tuple[dict[str, Samples], tuple[str, ...]]:
    """Return a file's samples by aircraft name, and notes on assumptions made in reading."""
    file = read_traffic([Path(path)], choice)
    if file.kind == DAIDALUS and choice == TrafficChoice():
        return read_daa_samples(path, tuple(EXTRA_COLUMNS)), ()
    own = file.ownship
    time_s = own.sample_times_s
    time_s = time_s[time_s >= 0.0]
    result, far = {own.name: _sample_flight(own, time_s, file.start_time_s)}, []
    for craft in file.intruders:
        there = time_s[craft.at(time_s).present]
        if len(there):
            result[craft.name] = _sample_flight(craft, there, file.start_time_s)
        else:
            far.append(craft.name)
    if len(result) < 2:
        Problems(str(path)).fail(
            f"no aircraft is there at a time at which {own.name} is" if file.intruders else
            f"there is one aircraft only, {shorten(own.name)!r}: an ownship and at least one "
            "intruder are needed"
        )  # fmt: skip
    notes = [*file.notes, "flights are interpolated to the times of the ownship"]
    if far:
        notes.append(f"never there at a time of the ownship: {shorten(', '.join(far))}")
    return result, tuple(notes)


def _sample_flight(craft: SampledTrajectory, time_s: FloatArray, start_s: float) -> Samples:
    """Return columns time, lat, lon, alt, velocity of an aircraft, interpolated to these times."""
    known_s, path = craft.sample_times_s, (craft.lat_deg, craft.lon_deg, craft.alt_m)
    velocity = craft.velocity_enu_mps
    if velocity is None:
        velocity = fit_velocity_and_acceleration(known_s, *path)[0]
    state = craft.at(time_s)
    place = {"lat": state.lat_deg, "lon": state.lon_deg, "alt": state.alt_m}
    rates = {
        name: np.interp(time_s, known_s, part)
        for name, part in zip(("ve", "vn", "vu"), velocity, strict=True)
    }
    return {"time": time_s + start_s, **place, **rates}


def _wind(own: Samples, wind_mps: tuple[float, float] | None) -> FloatArray:
    """Return wind (2, times), m/s to east, north: given, else by heading and airspeed, else 0."""
    count = len(own["time"])
    if wind_mps is not None:
        return np.repeat(np.asarray(wind_mps, dtype=np.float64)[:, np.newaxis], count, axis=1)
    if not {"yaw", "airspeed"} <= own.keys():
        return np.zeros((2, count))
    nose = np.radians(own["yaw"])
    through_air = own["airspeed"] * np.stack([np.sin(nose), np.cos(nose)])
    return np.asarray(np.stack([own["ve"], own["vn"]]) - through_air)


def _sample_index_and_is_exact(
    own_s: FloatArray, others: list[Samples]
) -> tuple[IntArray, BoolArray]:
    """Return each target's first sample index at or after own times, and whether times agree."""
    index = np.stack([np.searchsorted(o["time"], own_s) for o in others], axis=1)
    index = np.minimum(index, np.array([len(other["time"]) - 1 for other in others]))
    times = _select_samples([other["time"] for other in others], index)
    return index, times == own_s[:, np.newaxis]


def _select_samples(columns: list[FloatArray], place: IntArray) -> FloatArray:
    return np.stack(
        [column[np.maximum(place[:, i], 0)] for i, column in enumerate(columns)], axis=1
    )


def _states_of_flat_file(
    own: Samples, targets: Samples
) -> tuple[Relative, FloatArray, FloatArray, FloatArray]:
    """Return relative states, own altitude, velocity, position, target position of an ENU file."""
    velocity = [(own[key][:, np.newaxis], targets[key]) for key in ("ve", "vn", "vu")]
    at = [(own[key][:, np.newaxis], targets[key]) for key in ("sx", "sy", "sz")]
    relative = tuple(mine - other for mine, other in [*at, *velocity])
    return (
        relative,
        np.stack([own[key] for key in ("sz", "ve", "vn", "vu")]),
        np.stack([own["sx"], own["sy"]]),
        np.stack([at[0][1], at[1][1]]),
    )


def _states_of_geodetic_file(
    own: Samples, targets: Samples
) -> tuple[Relative, FloatArray, FloatArray, FloatArray]:
    """Return relative states, own altitude and velocity, own and target positions of a file with
    latitude and longitude, in tangent planes.
    """
    own_lat, own_lon = (np.radians(own[key])[:, np.newaxis] for key in ("lat", "lon"))
    lat, lon = (np.radians(targets[key]) for key in ("lat", "lon"))
    mine = east_north_mps(
        own_lat, own_lon, own["ve"][:, np.newaxis], own["vn"][:, np.newaxis], own_lat, own_lon
    )
    theirs = east_north_mps(lat, lon, targets["ve"], targets["vn"], own_lat, own_lon)
    at = east_north_m(lat, lon, own_lat, own_lon)
    relative = (
        -at[0],
        -at[1],
        own["alt"][:, np.newaxis] - targets["alt"],
        mine[0] - theirs[0],
        mine[1] - theirs[1],
        own["vu"][:, np.newaxis] - targets["vu"],
    )
    first = own_lat[:1], own_lon[:1]
    return (
        relative,
        np.stack([own["alt"], mine[0][:, 0], mine[1][:, 0], own["vu"]]),
        np.stack(east_north_m(own_lat, own_lon, *first))[:, :, 0],
        np.stack(east_north_m(lat, lon, *first)),
    )


def _alerter_indices(
    configuration: Configuration,
    own: Samples,
    targets: Samples,
    present: BoolArray,
    problems: Problems,
) -> IntArray:
    """Return each target's alerter index, from 0, at each time; a problem if it does not exist."""
    shape = present.shape
    if "alerter" not in own:
        return np.zeros(shape, dtype=np.int64)
    count = len(configuration.alerters)
    if configuration["ownship_centric_alerting"]:
        number = np.broadcast_to(own["alerter"][:, np.newaxis], shape)
    else:
        number = targets["alerter"]
    bad = present & ~((number >= 1) & (number <= count) & (number == np.floor(number)))
    if bad.any():
        problems.fail(
            f"an alerter is {number[bad][0]:g}: it must be a whole number from 1 to {count}, the "
            "number of alerters of the configuration",
            column="alerter",
        )
    return np.where(present, number, 1.0).astype(np.int64) - 1


def _uncertainty_bounds(
    configuration: Configuration, own: Samples, targets: Samples, relative: Relative
) -> Bounds:
    """Return how far relative states may be wrong: standard deviations times z-scores."""

    def deviations_of_both(find: Callable[..., Any], *keys: str) -> FloatArray:
        mine = [own[key][:, np.newaxis] for key in keys]
        theirs = [targets[key] for key in keys]
        return np.asarray(find(*mine) + find(*theirs))

    deviations = Deviations(
        deviations_of_both(_longest_axis_deviation, "s_ew_std", "s_ns_std", "s_en_std"),
        deviations_of_both(np.abs, "sz_std"),
        deviations_of_both(_longest_axis_deviation, "v_ew_std", "v_ns_std", "v_en_std"),
        deviations_of_both(np.abs, "vz_std"),
    )
    return uncertainty_bounds(configuration, deviations, np.hypot(relative[0], relative[1]))


def _longest_axis_deviation(
    east: FloatArray, north: FloatArray, signed_root: FloatArray
) -> FloatArray:
    """Return the longest axis's deviation, where the covariance is given as its signed root."""
    return longest_axis_deviation(east, north, np.sign(signed_root) * signed_root**2)
