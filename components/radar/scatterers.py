"""The echo of many scatterers spread over a target, and how it changes with the aspect."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.randomness import Stream
from dsa_des.time.timeline import first_scan

#: Scatterers of an echo whose strengths are fixed, and of one whose strengths change with time.
#: Gaussian strengths make the power exponential for any number, over targets; over all aspects of
#: one target it has that target's own mean, which varies by 1 / sqrt(number) (0.6 dB), unless
#: strengths change.
FIXED, CHANGING = 48, 8


class Scatterers:
    """Scatterers at fixed places of each target's body, evenly spread over a ball.

    Parameters
    ----------
    stream : Stream
        Used by nothing else.
    extent_m : float
        Diameter of the ball.
    wavelength_m : float
    count : int
        Scatterers of an echo.

    Notes
    -----
    An echo that goes to a scatterer at r and back has the phase 4π r·u / λ for the direction u to
    the radar. The sum of many with complex Gaussian strengths is a complex Gaussian
    amplitude; over targets its correlation between two aspects Δ apart is that of the ball,
    3 (sin x - x cos x) / x³ with x = 2π Δ extent / λ: half of it is left at Δ = 0.40 λ / extent,
    nothing at 0.72 λ / extent. For the usual estimate λ / (2 extent): D. K. Barton, *Modern Radar
    System Analysis*, 1988, section 2.4; M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed.,
    section 2.8.
    """

    def __init__(
        self, stream: Stream, extent_m: float, wavelength_m: float, count: int = FIXED
    ) -> None:
        self._stream, self._count = stream, count
        self._reach = 2.0 * math.pi * extent_m / wavelength_m

    def echo(
        self,
        keys: Any,
        aspect: tuple[FloatArray, FloatArray, FloatArray],
        which: int,
        strengths: Callable[[int], tuple[FloatArray, FloatArray]] | None = None,
        replica: IntArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return real and imaginary part of the amplitude of echoes, each of variance 1.

        Parameters
        ----------
        keys : (n,) array of uint64
            Of the targets.
        aspect : three (n,) arrays
            Unit vector to the radar in the target's body axes.
        which : int
            Of a target's independent echoes.
        strengths : callable, optional
            From a scatterer's number to standard normal numbers, (n,) twice; by default they are
            fixed to the target.
        replica : (n,) array of int, optional
            Where replicas run in lock step, whose targets they are.

        Returns
        -------
        two (n,) arrays
        """
        whose = np.zeros(len(keys), dtype=np.uint64) if replica is None else replica
        pairs = np.stack([keys, whose.astype(np.uint64)])
        (targets, runs), of_target = np.unique(pairs, axis=1, return_inverse=True)
        of_target = of_target.reshape(-1)
        begin = runs.astype(np.int64) * first_scan(1)
        real, imaginary = np.zeros(len(keys)), np.zeros(len(keys))
        for number in range(which * self._count, (which + 1) * self._count):
            numbers = begin + number
            place = self._places(targets, numbers)
            # One after the other, so that an element's sum has one order in any array.
            phase = np.zeros(len(keys))
            for along, component in zip(place, aspect, strict=True):
                phase += along[of_target] * component
            if strengths is None:
                normal = (self._stream.normal(targets, numbers, draw) for draw in (2, 3))
                a, b = (value[of_target] for value in normal)
            else:
                a, b = strengths(number)
            cosine, sine = np.cos(phase), np.sin(phase)
            real += a * cosine - b * sine
            imaginary += a * sine + b * cosine
        scale = 1.0 / math.sqrt(self._count)
        return scale * real, scale * imaginary

    def _places(self, targets: Any, numbers: IntArray) -> list[FloatArray]:
        """Return where a scatterer is along each axis, as phase per unit of aspect."""
        # One draw number is two uniforms (`Stream.uniform`), so 0 and 1 are the first of them.
        out, up, around = (self._stream.uniform(targets, numbers, draw) for draw in (0, 1, 2))
        radius = self._reach * np.cbrt(out)
        z = 2.0 * up - 1.0
        level = np.sqrt(1.0 - z * z)
        turn = 2.0 * math.pi * around
        return [radius * level * np.cos(turn), radius * level * np.sin(turn), radius * z]
