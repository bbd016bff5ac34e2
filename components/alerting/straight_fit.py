"""Relative states of targets from positions of the last seconds: straight lines through them."""

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# Positions closer in time than this are one instant, from which no velocity follows, s.
_SHORTEST_S = 1e-6


class StraightFit:
    """Keeps relative positions for some time and fits straight flights to them.

    Parameters
    ----------
    keep_s : float
        For how long a position counts.
    targets : int
    """

    def __init__(self, keep_s: float, targets: int) -> None:
        self._keep_s = keep_s
        self._came = np.empty(0, dtype=np.int64)
        self._time_s = np.empty(0)
        self._position_m = np.empty((0, targets, 3))

    def add(self, came: IntArray, time_s: FloatArray, position_m: FloatArray) -> None:
        """Take in positions.

        Parameters
        ----------
        came : (n,) of int
            When they arrived, ticks in order.
        time_s : (n,)
            The instants that they are of.
        position_m : (n, targets, 3)
            East, north, up; NaN where a target was not seen.
        """
        self._came = np.concatenate([self._came, came])
        self._time_s = np.concatenate([self._time_s, time_s])
        self._position_m = np.concatenate([self._position_m, position_m])

    def forget_before(self, now_s: float) -> None:
        """Drop what is too old at an instant, and at all later ones."""
        young = self._time_s >= now_s - self._keep_s
        self._came, self._time_s = self._came[young], self._time_s[young]
        self._position_m = self._position_m[young]

    def states(self, now: int, now_s: float) -> tuple[BoolArray, FloatArray]:
        """Return whose flight is known at an instant, and its state then.

        Parameters
        ----------
        now : int
            Ticks; what arrives later is not known yet.
        now_s : float
            The same; positions older than `keep_s` do not count.

        Returns
        -------
        known : (targets,) of bool
            Whether there are positions at two instants.
        state : (6, targets)
            East, north, up and their rates; 0 where nothing is known.
        """
        until = int(np.searchsorted(self._came, now, side="right"))
        here = np.flatnonzero(self._time_s[:until] >= now_s - self._keep_s)
        return _fitted(self._time_s[here], self._position_m[here], now_s)


def _fitted(
    time_s: FloatArray, position_m: FloatArray, now_s: float
) -> tuple[BoolArray, FloatArray]:
    """Return the states at an instant of least-squares lines through positions."""
    seen = np.isfinite(position_m[:, :, 0])
    count = np.maximum(seen.sum(axis=0), 1)
    # Relative to now, so that clock readings do not cost digits.
    ago_s = np.where(seen, (time_s - now_s)[:, np.newaxis], 0.0)
    mean_s = ago_s.sum(axis=0) / count
    off_s = np.where(seen, ago_s - mean_s, 0.0)
    spread = (off_s * off_s).sum(axis=0)
    known = np.asarray(spread > _SHORTEST_S**2)
    position = np.where(seen[:, :, np.newaxis], position_m, 0.0)
    mean_m = position.sum(axis=0) / count[:, np.newaxis]
    moved = np.where(seen[:, :, np.newaxis], position - mean_m, 0.0)
    slope = (off_s[:, :, np.newaxis] * moved).sum(axis=0)
    rate = slope / np.where(known, spread, 1.0)[:, np.newaxis]
    now_m = mean_m - rate * mean_s[:, np.newaxis]
    state = np.concatenate([now_m.T, rate.T])
    return known, np.where(known, state, 0.0)
