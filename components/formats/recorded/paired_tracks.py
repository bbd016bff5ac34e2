"""Recorded flights as encounters that never were: windows of two, turned and moved together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from components.formats.recording import Samples
from components.geometry import line_of_sight_ned
from dsa_des.arrays.types import FloatArray

#: Unheard for longer, a flight is not known in between, s.
_LONGEST_GAP_S = 30.0
#: Slower ones stand, taxi or hover: their courses are noise, m/s.
_SLOWEST_MPS = 5.0


@dataclass(frozen=True)
class _Piece:
    """A part of a flight without a gap, and the number of its first window among all windows."""

    flight: int
    samples: Samples
    first: int


class TrackWindows:
    """All windows of one duration in several flights, one per second at which one can begin.

    `samples` are those of each flight; windows are closest to others `closest_s` after they begin.
    """

    def __init__(self, samples: Sequence[Samples], duration_s: int, closest_s: int) -> None:
        self._duration_s, self._closest_s = duration_s, closest_s
        self._pieces: list[_Piece] = []
        self.count = 0
        for flight, columns in enumerate(samples):
            time_s = columns["time"]
            ends = np.flatnonzero(np.diff(time_s) > _LONGEST_GAP_S) + 1
            for part in np.split(np.arange(len(time_s)), ends):
                lasts_s = float(time_s[part[-1]] - time_s[part[0]])
                if lasts_s >= duration_s:
                    cut = {key: columns[key][part] for key in ("time", "lat", "lon", "alt")}
                    cut["lon"] = np.unwrap(cut["lon"], period=360.0)
                    self._pieces.append(_Piece(flight, cut, self.count))
                    self.count += int(lasts_s - duration_s) + 1
        #: How many flights have a window.
        self.flights = len({piece.flight for piece in self._pieces})

    def window_at_share(self, share: float) -> tuple[int, FloatArray]:
        """Return a flight's number and the path of its window at a share [0, 1) of all windows.

        It is north, east and altitude (3, seconds + 1) in m, north and east from where it is at the
        closest approach.
        """
        number = int(share * self.count)
        firsts = [piece.first for piece in self._pieces]
        piece = self._pieces[int(np.searchsorted(firsts, number, side="right")) - 1]
        known_s = piece.samples["time"]
        begins_s = known_s[0] + (number - piece.first)
        times_s = np.minimum(begins_s + np.arange(self._duration_s + 1), known_s[-1])
        lat, lon, alt = (
            np.interp(times_s, known_s, piece.samples[key]) for key in ("lat", "lon", "alt")
        )
        here = [np.full(len(lat), part[self._closest_s]) for part in (lat, lon)]
        north, east, _ = line_of_sight_ned(here[0], here[1], np.zeros_like(lat), lat, lon,
                                           np.zeros_like(lat))  # fmt: skip
        return piece.flight, np.array([north, east, alt])

    def velocity_at_closest(self, path: FloatArray) -> FloatArray:
        """Return a path's velocity (3,) north, east, up (m/s) at its closest approach."""
        at = self._closest_s
        return np.asarray((path[:, at + 1] - path[:, at - 1]) / 2.0)


def is_flying(velocity: FloatArray) -> bool:
    """Return whether an aircraft with this velocity flies."""
    return bool(np.hypot(velocity[0], velocity[1]) >= _SLOWEST_MPS)


def turn_path(path: FloatArray, velocity: FloatArray, course_rad: float) -> FloatArray:
    """Return a path turned about its closest approach to have the course ``course_rad`` there."""
    angle = course_rad - np.arctan2(velocity[1], velocity[0])
    cos, sin = np.cos(angle), np.sin(angle)
    north, east, up = path
    return np.array([north * cos - east * sin, north * sin + east * cos, up])


def place_other_path(
    own: FloatArray, other: FloatArray, at: int, place_m: tuple[float, float], up_m: float
) -> FloatArray:
    """Return the other path shifted to the north and east by ``place_m``, and up so that it is
    ``up_m`` above the own path at sample ``at``.
    """
    shift = np.array([place_m[0], place_m[1], own[2, at] + up_m - other[2, at]])
    return np.asarray(other + shift[:, np.newaxis])
