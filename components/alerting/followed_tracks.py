"""Tracks with states as an alerting block follows them: one column each, named by the truth."""

from collections.abc import Mapping

import numpy as np

from components.alert_configuration.margins import Deviations
from components.alerting.believed_flights import BelievedFlights
from components.alerting.estimated_flights import EstimatedFlights
from components.alerting.track_slots import TrackSlots
from components.messages.state_tracks import StateTracks
from dsa_des.arrays.types import FloatArray, IntArray

# A track farther than this from every target belongs to none, for whoever evaluates, m.
_SAME_TARGET_M = 1000.0
_OWN_VELOCITY = ("east_mps", "north_mps", "climb_mps")


class FollowedTracks:
    """Tracks of one tracker over time.

    Parameters
    ----------
    forgotten_s : float
        After so long nothing of a track that is gone matters.
    """

    def __init__(self, forgotten_s: float) -> None:
        self._forgotten_s = forgotten_s
        self._estimates = EstimatedFlights()
        self._slots = TrackSlots()
        self._true_came: IntArray = np.empty(0, dtype=np.int64)
        self._true_m: FloatArray = np.empty((0, 0, 3))

    def add(self, came: IntArray, tracks: StateTracks) -> None:
        """Take in what a tracker told, and when each row came."""
        self._estimates.add(came, tracks)

    def add_truth(self, came: IntArray, position_m: FloatArray) -> None:
        """Take in where the targets are (rows, targets, 3): a track is named by the nearest."""
        held = self._true_m if len(self._true_m) else np.empty((0, *position_m.shape[1:]))
        self._true_came = np.concatenate([self._true_came, came])
        self._true_m = np.concatenate([held, position_m])

    def flights(
        self,
        ticks: IntArray,
        times: list[float],
        own: Mapping[str, FloatArray],
        places: FloatArray,
    ) -> BelievedFlights:
        """Return the flights of tracks at some scans, for the last time at these.

        Parameters
        ----------
        ticks : (scans,) of int
        times : list of float
            The same, s.
        own : mapping of (scans,)
            The ownship's ``east_mps``, ``north_mps``, ``climb_mps``; NaN where unknown yet.
        places : (3, scans)
            Its latitude and longitude (rad) and height (m).
        """
        numbers = self._estimates.numbers(int(ticks[-1]))
        number, new = self._slots.of(numbers, times, self._forgotten_s)
        order = np.argsort(number, kind="stable")
        shape = len(ticks), len(number)
        known = np.zeros(shape, dtype=bool)
        state = np.zeros((6, *shape))
        deviations = Deviations(*np.zeros((4, *shape)))
        for i, (tick, now_s) in enumerate(zip(ticks.tolist(), times, strict=True)):
            found = self._estimates.states(tick, now_s, number[order], places[:, i])
            known[i, order], state[:, i, order], wrong = found
            for whole, part in zip(deviations, wrong, strict=True):
                whole[i, order] = part
        target = self._nearest(ticks, state[:3])
        # Without two poses the ownship's own velocity is not known, and no relative one.
        known &= np.isfinite(own["east_mps"])[:, np.newaxis]
        mine = [np.nan_to_num(own[name])[:, np.newaxis] for name in _OWN_VELOCITY]
        velocity = (own_part - part for own_part, part in zip(mine, state[3:], strict=True))
        relative = tuple(np.where(known, part, 0.0) for part in (*-state[:3], *velocity))
        self._estimates.forget_before(int(ticks[-1]))
        return BelievedFlights(known, relative, target, number, deviations, new)

    def _nearest(self, ticks: IntArray, position: FloatArray) -> IntArray:
        """Return the target nearest to each track, -1 where none is near."""
        last = np.maximum(np.searchsorted(self._true_came, ticks, side="right") - 1, 0)
        found = np.full(position.shape[1:], -1, dtype=np.int64)
        for i, row in enumerate(last.tolist()):
            away = self._true_m[row][np.newaxis] - position[:, i].T[:, np.newaxis]
            range_m = np.nan_to_num(np.linalg.norm(away, axis=2), nan=np.inf)
            if range_m.shape[1]:
                near = range_m.min(axis=1) <= _SAME_TARGET_M
                found[i] = np.where(near, range_m.argmin(axis=1), -1)
        keep = int(last[-1])
        self._true_came, self._true_m = self._true_came[keep:], self._true_m[keep:]
        return found
