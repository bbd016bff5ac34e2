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
            The instants that they are of, since the start of their run.
        position_m : (n, targets, 3)
            East, north, up; NaN where a target was not seen.
        """
        self._came = np.concatenate([self._came, came])
        self._time_s = np.concatenate([self._time_s, time_s])
        self._position_m = np.concatenate([self._position_m, position_m])
        if bool((self._came[1:] < self._came[:-1]).any()):  # replicas that go side by side
            self._keep(np.argsort(self._came, kind="stable"))

    def forget_before(self, now_s: float) -> None:
        """Drop what is too old at an instant, and at all later ones."""
        self._keep(np.flatnonzero(self._time_s >= now_s - self._keep_s))

    def forget_ticks_before(self, tick: int) -> None:
        """Drop what came before a tick."""
        self._keep(np.flatnonzero(self._came >= tick))

    def _keep(self, lines: IntArray) -> None:
        self._came, self._time_s = self._came[lines], self._time_s[lines]
        self._position_m = self._position_m[lines]

    def states(
        self, since: IntArray, now: IntArray, now_s: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """Return whose flight is known at some instants, and its state then.

        Parameters
        ----------
        since, now : (n,) of int
            Ticks; what came before the one or arrives after the other is not known.
        now_s : (n,)
            The instants since the start of their run; positions older than `keep_s` do not count.

        Returns
        -------
        known : (n, targets) of bool
            Whether there are positions at two instants.
        state : (6, n, targets)
            East, north, up and their rates; 0 where nothing is known.
        """
        first = np.searchsorted(self._came, since)
        counts = np.searchsorted(self._came, now, side="right") - first
        of = np.repeat(np.arange(len(now)), counts)
        start = np.cumsum(counts) - counts
        line = np.arange(len(of)) + (first - start)[of]
        young = self._time_s[line] >= now_s[of] - self._keep_s
        of, line = of[young], line[young]
        counts = np.bincount(of, minlength=len(now))
        start = np.cumsum(counts) - counts
        targets = self._position_m.shape[1]
        known = np.zeros((len(now), targets), dtype=bool)
        state = np.zeros((6, len(now), targets))
        # Instants with as many positions are added up alike, each as it would be by itself.
        for count in np.flatnonzero(np.bincount(counts)).tolist():
            alike = np.flatnonzero(counts == count)
            if count < 2:
                continue
            lines = line[start[alike] + np.arange(count)[:, np.newaxis]]
            known[alike], state[:, alike] = _fitted(
                self._time_s[lines], self._position_m[lines], now_s[alike]
            )
        return known, state


def _fitted(
    time_s: FloatArray, position_m: FloatArray, now_s: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return the states at some instants of least-squares lines through positions.

    Parameters
    ----------
    time_s : (positions, n)
    position_m : (positions, n, targets, 3)
    now_s : (n,)
    """
    seen = np.isfinite(position_m[..., 0])
    count = np.maximum(seen.sum(axis=0), 1)
    # Relative to now, so that clock readings do not cost digits.
    ago_s = np.where(seen, (time_s - now_s)[:, :, np.newaxis], 0.0)
    mean_s = _sum(ago_s) / count
    off_s = np.where(seen, ago_s - mean_s, 0.0)
    spread = _sum(off_s * off_s)
    known = np.asarray(spread > _SHORTEST_S**2)
    position = np.where(seen[..., np.newaxis], position_m, 0.0)
    mean_m = position.sum(axis=0) / count[..., np.newaxis]
    moved = np.where(seen[..., np.newaxis], position - mean_m, 0.0)
    slope = (off_s[..., np.newaxis] * moved).sum(axis=0)
    rate = slope / np.where(known, spread, 1.0)[..., np.newaxis]
    now_m = mean_m - rate * mean_s[..., np.newaxis]
    state = np.concatenate([np.moveaxis(now_m, -1, 0), np.moveaxis(rate, -1, 0)])
    return known, np.where(known, state, 0.0)


def _sum(values: FloatArray) -> FloatArray:
    """Return the sums over the first axis of (positions, n, targets), each as it would be alone.

    NumPy adds the numbers of a single target in pairs, and those of several one after the other.
    """
    if values.shape[2] != 1:
        return np.asarray(values.sum(axis=0))
    alone = np.ascontiguousarray(values[:, :, 0].T)
    return np.asarray(alone.sum(axis=1))[:, np.newaxis]
