"""Flights of tracks with states: as estimated, carried on straight, in the ownship's plane."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.margins import Deviations, largest
from components.estimation.frame import ned_axes
from components.geometry.daidalus_sphere import east_north_m, east_north_mps
from components.geometry.enu import enu_to_geodetic
from components.messages.columns import COVARIANCE
from components.messages.state_tracks import COASTED, CONFIRMED, StateTracks
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
# Upper triangle of a covariance in its columns.
_PAIRS = tuple(COVARIANCE)


class _Row(NamedTuple):
    """The tracks that are told at one instant.

    Parameters
    ----------
    came : int
        Tick at which they came.
    number : (tracks,)
    time_s : (tracks,)
        That their states speak of.
    state : (6, tracks)
        North, east, down and their rates in the frame.
    covariance : (21, tracks)
    origin : (3, tracks)
        Of the frame: latitude, longitude (deg), height (m).
    """

    came: int
    number: IntArray
    time_s: FloatArray
    state: FloatArray
    covariance: FloatArray
    origin: FloatArray


class EstimatedFlights:
    """What has come of a tracker's states: confirmed and coasted tracks that have a range."""

    def __init__(self) -> None:
        self._rows: list[_Row] = []

    def add(self, came: IntArray, tracks: StateTracks) -> None:
        """Take in what a tracker told, and when each row came."""
        good = tracks.has_range & np.isin(tracks.track_status, (CONFIRMED, COASTED))
        state = np.stack([getattr(tracks, name) for name in _STATE])
        covariance = np.stack([tracks.covariance[COVARIANCE[pair]] for pair in _PAIRS])
        origin = np.stack([tracks.origin_lat_deg, tracks.origin_lon_deg, tracks.origin_alt_m])
        for row, tick in enumerate(came.tolist()):
            begin, end = tracks.offsets[row], tracks.offsets[row + 1]
            mine = begin + np.flatnonzero(good[begin:end])
            self._rows.append(
                _Row(
                    tick,
                    tracks.track[mine],
                    tracks.state_s[mine],
                    state[:, mine],
                    covariance[:, mine],
                    origin[:, mine],
                )
            )

    def numbers(self, until: int) -> IntArray:
        """Return all tracks that are told from the last row on until an instant, ascending."""
        some = [row.number for row in self._rows if row.came <= until]
        return np.unique(np.concatenate(some)) if some else np.empty(0, dtype=np.int64)

    def forget_before(self, tick: int) -> None:
        """Drop the rows that a later one has replaced at an instant."""
        until = sum(row.came <= tick for row in self._rows)
        self._rows = self._rows[max(until - 1, 0) :]

    def states(
        self, now: int, now_s: float, numbers: IntArray, own_place: FloatArray
    ) -> tuple[BoolArray, FloatArray, Deviations]:
        """Return whose flight is known at an instant, its state, and how uncertain it is.

        Parameters
        ----------
        now : int
            Ticks; what comes later is not known yet.
        now_s : float
            The same; states are carried on straight until then.
        numbers : (tracks,) of int
            Tracks that are asked for, ascending.
        own_place : (3,)
            Of the ownship: latitude and longitude (rad), height (m).

        Returns
        -------
        known : (tracks,) of bool
        state : (6, tracks)
            Place from the ownship, east, north, up in its plane, and velocity over ground there; 0
            where nothing is known.
        deviations : Deviations of (tracks,)
        """
        count = len(numbers)
        known, state = np.zeros(count, dtype=bool), np.zeros((6, count))
        deviations = Deviations(*np.zeros((4, count)))
        row = next((row for row in reversed(self._rows) if row.came <= now), None)
        if row is None or len(row.number) == 0:
            return known, state, deviations
        place = np.searchsorted(numbers, row.number)
        known[place] = True
        ahead_s = now_s - row.time_s
        state[:, place] = _in_plane(row, ahead_s, own_place)
        for whole, part in zip(deviations, _deviations(row.covariance, ahead_s), strict=True):
            whole[place] = part
        return known, state, deviations


def _in_plane(row: _Row, ahead_s: FloatArray, own_place: FloatArray) -> FloatArray:
    """Return places and velocities in the plane that touches the sphere below the ownship."""
    north, east, down = row.state[:3] + row.state[3:] * ahead_s
    lat_deg, lon_deg, alt_m = enu_to_geodetic(
        east, north, -down,
        reference_lat_deg=row.origin[0], reference_lon_deg=row.origin[1],
        reference_alt_m=row.origin[2],
    )  # fmt: skip
    # The frame's axes are those of its origin; velocity counts along those of the target's place.
    there, here = ned_axes(lat_deg, lon_deg), ned_axes(row.origin[0], row.origin[1])
    in_space = sum(v * axis for v, axis in zip(row.state[3:], here, strict=True))
    v_north, v_east, v_down = ((in_space * axis).sum(axis=0) for axis in there)
    own_lat, own_lon, own_alt_m = own_place
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    return np.stack(
        [
            *east_north_m(lat, lon, own_lat, own_lon),
            alt_m - own_alt_m,
            *east_north_mps(lat, lon, v_east, v_north, own_lat, own_lon),
            -v_down,
        ]
    )


def _deviations(covariance: FloatArray, ahead_s: FloatArray) -> Deviations:
    """Return the standard deviations of states that are carried on straight."""

    def of(i: int, j: int) -> AnyArray:
        return covariance[_PAIRS.index((min(i, j), max(i, j)))]

    def later(i: int, j: int) -> AnyArray:
        return of(i, j) + ahead_s * (of(i, j + 3) + of(j, i + 3)) + ahead_s**2 * of(i + 3, j + 3)

    def root(variance: AnyArray) -> AnyArray:
        return np.sqrt(np.maximum(variance, 0.0))

    return Deviations(
        largest(root(later(1, 1)), root(later(0, 0)), later(0, 1)),
        root(later(2, 2)),
        largest(root(of(4, 4)), root(of(3, 3)), of(3, 4)),
        root(of(5, 5)),
    )
