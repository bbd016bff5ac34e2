"""Chance that lasts: a stationary Gauss-Markov process whose value at an instant is keyed.

Errors of a sensor and the fading of an echo do not forget at once: their correlation falls as
exp(-|dt| / tau). A recursion from one look to the next would depend on which looks there are. Here
a value is a function of its key and its instant alone, so any window, scan rate and order of looks
sees the same process, at the instants it happens to look.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.randomness import Stream

# Knots so many correlation times apart are drawn as if independent; exp(-40) is 4e-18.
_APART = 40.0
# An interval's number may take more bits than a scan number has: the rest goes to the target's
# key, spread over all of its bits.
_LOW = 0xFFFFFFFF
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
# Draw numbers of one process: the knots, and two levels of halving by draw.
_LEVELS = 32
MOST_PROCESSES = 2**16 // _LEVELS

#: Longest correlation time: instants are 64-bit numbers of nanoseconds.
LONGEST_S = 1e7


class GaussMarkov:
    """A Gauss-Markov process of mean 0, variance 1, correlation exp(-|dt| / tau), per target.

    Parameters
    ----------
    stream : Stream
        Used by nothing else.
    correlation_time_s : float
        tau, above 0 and up to `LONGEST_S`.

    Raises
    ------
    ValueError
        If the correlation time is out of range.

    Notes
    -----
    The Ornstein-Uhlenbeck process (Uhlenbeck & Ornstein, Phys. Rev. 36, 1930), the only stationary
    Gaussian process that is Markov (Doob, 1942). Given its values at both ends of an interval of
    length h, the value half-way is normal with mean (a + b) / (2 cosh(h / 2 tau)) and variance
    tanh(h / 2 tau), independent of all that is outside. So it is drawn at knots more than 40 tau
    apart, independently, and then half-way between, again and again, down to the nanosecond: exact
    at each one, with a draw for each interval on the way (Lévy's construction of Brownian motion).

    Where a run branches, the process goes on from the value that it has: from there on it is that
    value, falling off by its correlation, and what another such process, of the branch's seed, adds
    to it meanwhile.
    """

    def __init__(self, stream: Stream, correlation_time_s: float) -> None:
        if not 0.0 < correlation_time_s <= LONGEST_S:
            raise ValueError(
                f"correlation_time_s is {correlation_time_s:g}: it must be above 0 and at most "
                f"{LONGEST_S:g}"
            )
        self._stream = stream
        self._tau_ns = tau_ns = correlation_time_s * NANOSECONDS
        halvings = max(0, math.ceil(math.log2(_APART * tau_ns)))
        #: Two halvings a step: knots are 4**steps ns apart.
        self._steps = (halvings + 1) // 2
        self._bridges = [_bridge_weights(4**step / tau_ns) for step in range(self._steps + 1)]

    def __call__(
        self,
        targets: npt.ArrayLike,
        instants_ns: IntArray,
        process: int = 0,
        run: npt.ArrayLike = 0,
    ) -> FloatArray:
        """Return the process's values.

        Parameters
        ----------
        targets : (n,) array of uint64, or one key
            Whose process it is, as for `Stream.uniform`.
        instants_ns : (n,) array of int64
            Since the start of the run (`dsa_des.time.clock.ticks_to_nanoseconds`).
        process : int
            Which of a target's independent processes, 0 to 2047.
        run : (n,) array of int64, or one number
            Whose seed it is, where there are many.

        Returns
        -------
        (n,) array
        """
        if not 0 <= process < MOST_PROCESSES:
            raise ValueError(f"process is {process}: it must lie in [0, {MOST_PROCESSES})")
        instants = np.ascontiguousarray(instants_ns, dtype=np.int64)
        who = np.broadcast_to(np.asarray(targets, dtype=np.uint64), instants.shape)
        runs = np.broadcast_to(run, instants.shape)
        return self._values_after_branches(
            self._stream.branches, who, instants, process * _LEVELS, runs
        )

    def _values_after_branches(
        self, branches: int, who: Any, instants: IntArray, first: int, runs: IntArray
    ) -> FloatArray:
        """Return the process values after runs' first `branches` branches, each with new draws."""
        if not branches:
            return self._values_from_stream(self._stream.of_runs(runs), who, instants, first)
        begin = self._stream.branch_start_and_stream(runs, branches)[0]
        before = self._values_after_branches(
            branches - 1, who, np.minimum(instants, begin), first, runs
        )
        later = np.flatnonzero(instants > begin)
        if len(later):
            begin, stream = self._stream.branch_start_and_stream(runs[later], branches)
            left = np.exp((begin - instants[later]) / self._tau_ns)
            ends = (instants[later], begin)
            now, then = (self._values_from_stream(stream, who[later], at, first) for at in ends)
            before[later] = left * before[later] + now - left * then
        return before

    def _values_from_stream(
        self, stream: Stream, who: Any, instants: IntArray, first: int
    ) -> FloatArray:
        """Return the process values at the given instants, from the draws of one stream."""

        def normals_of_numbers(
            number: IntArray, level: int
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            key = who + (number >> 32).astype(np.uint64) * _SPREAD
            return stream.three_normals(key, number & _LOW, first + level)

        step = self._steps
        number = instants >> (2 * step)
        left, right = normals_of_numbers(number, 0)[0], normals_of_numbers(number + 1, 0)[0]
        for step in range(self._steps, 0, -1):
            (mean, spread), (mean_of_half, spread_of_half) = self._bridges[step]
            of_half, of_first, of_second = normals_of_numbers(instants >> (2 * step), step)
            quarter = (instants >> (2 * step - 2)) & 3
            half = mean * (left + right) + spread * of_half
            later = quarter >= 2
            left, right = np.where(later, half, left), np.where(later, right, half)
            half = mean_of_half * (left + right)
            half += spread_of_half * np.where(later, of_second, of_first)
            later = (quarter & 1) == 1
            left, right = np.where(later, half, left), np.where(later, right, half)
        return left


def _bridge_weights(length: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return (weight of either end, spread) for the middle of an interval of `length` correlation
    times, and for the middle of its half.
    """
    halves = length / 2.0, length / 4.0
    first, second = ((0.5 / math.cosh(s), math.sqrt(math.tanh(s))) for s in halves)
    return first, second
