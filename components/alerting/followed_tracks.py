"""Tracks with states as an alerting block follows them, named by the truth."""

from collections.abc import Mapping

import numpy as np

from components.alerting.believed_flights import BelievedFlights
from components.alerting.estimated_flights import EstimatedFlights
from components.messages.state_tracks import StateTracks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake

# A track farther than this from every target belongs to none, for whoever evaluates, m.
_SAME_TARGET_M = 1000.0
_OWN_VELOCITY = ("east_mps", "north_mps", "climb_mps")


class FollowedTracks:
    """Tracks of one tracker over time, in one run or in many; what came in each stands together."""

    def __init__(self) -> None:
        self._estimates = EstimatedFlights()
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
        if bool((self._true_came[1:] < self._true_came[:-1]).any()):
            self._keep_true(np.argsort(self._true_came, kind="stable"))

    def _keep_true(self, which: IntArray | BoolArray) -> None:
        self._true_came, self._true_m = self._true_came[which], self._true_m[which]

    def flights(
        self,
        ticks: IntArray,
        times_s: FloatArray,
        begins: IntArray,
        own: Mapping[str, FloatArray],
        places: FloatArray,
    ) -> BelievedFlights:
        """Return the flights of tracks at some scans.

        Parameters
        ----------
        ticks : (scans,) of int
        times_s : (scans,)
            The same, since the start of the run.
        begins : (scans,) of int
            When the run of each begins.
        own : mapping of (scans,)
            The ownship's ``east_mps``, ``north_mps``, ``climb_mps``; NaN where unknown yet.
        places : (3, scans)
            Its latitude and longitude (rad) and height (m).

        Returns
        -------
        BelievedFlights
            One in each row.
        """
        # Without two poses the ownship's own velocity is not known, and no relative one.
        asked = np.flatnonzero(np.isfinite(own["east_mps"]))
        found = self._estimates.states(
            ticks[asked], times_s[asked], begins[asked], places[:, asked]
        )
        scan, number, state, deviations = asked[found[0]], *found[1:]
        mine = (own[name][scan] for name in _OWN_VELOCITY)
        velocity = (own_part - part for own_part, part in zip(mine, state[3:], strict=True))
        relative = tuple(part[:, np.newaxis] for part in (*-state[:3], *velocity))
        known = np.ones((len(scan), 1), dtype=bool)
        target = self._nearest(ticks[scan], state[:3].T)
        return BelievedFlights(known, relative, scan, target, number, deviations)

    def _nearest(self, ticks: IntArray, position_m: FloatArray) -> IntArray:
        """Return the target nearest to each of some positions (n, 3), -1 where none is near."""
        if self._true_m.shape[1] == 0 or len(ticks) == 0:
            return np.full(len(ticks), -1, dtype=np.int64)
        last = np.maximum(np.searchsorted(self._true_came, ticks, side="right") - 1, 0)
        away = self._true_m[last] - position_m[:, np.newaxis]
        range_m = np.nan_to_num(np.linalg.norm(away, axis=2), nan=np.inf)
        return np.where(range_m.min(axis=1) <= _SAME_TARGET_M, range_m.argmin(axis=1), -1)

    def forget_before(self, ticks: IntArray, wake: Wake) -> None:
        """Drop what later ones have replaced at some scans.

        Parameters
        ----------
        ticks : (scans,) of int
        wake : Wake
        """
        self._estimates.keep(_still_asked(self._estimates.came, ticks, wake))
        kept = _still_asked(self._true_came, ticks, wake)
        if not kept.all():
            self._keep_true(kept)


def _still_asked(came: IntArray, ticks: IntArray, wake: Wake) -> BoolArray:
    """Return which rows are asked for after some scans: the last before them, and later ones."""
    run, of_scan = wake.replica_of(came), wake.replica_of(ticks)
    ends = np.flatnonzero(np.append(of_scan[1:] != of_scan[:-1], True))
    last = np.searchsorted(came, ticks[ends], side="right") - 1
    place = np.searchsorted(of_scan[ends], run)
    there = np.minimum(place, len(ends) - 1)
    # Of runs without a scan all rows; side by side these come again, else they have passed.
    kept = (of_scan[ends][there] != run) | (np.arange(len(came)) >= last[there])
    return kept if wake.side_by_side else kept & (run >= of_scan[-1])
