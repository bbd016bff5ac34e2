"""When within its scan does a sweeping beam look at a given azimuth?

The beam sweeps clockwise over the field of view once per scan, at an even rate, and flies back in
what is left of the period: it looks one way only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.radar.inputs import FloatArray, broadcast_flat, finite, positive, unflatten

_TURN = 2.0 * math.pi


def illumination_offset_s(
    azimuth_rad: ArrayLike,
    *,
    start_rad: float,
    width_rad: float,
    scan_period_s: float,
    sweep_fraction: float = 1.0,
    azimuth_rate_rad_s: ArrayLike = 0.0,
) -> Any:
    """Return how long after the start of its scan a target is illuminated.

    Parameters
    ----------
    azimuth_rad : array_like, rad
        The target's azimuth at the start of the scan, clockwise, in the frame in which the beam
        sweeps. Outside the field of view the nearer edge counts.
    start_rad, width_rad : float, rad
        The beam starts at `start_rad` and sweeps clockwise over `width_rad`, in (0, 2π].
    scan_period_s : float, s
        Above 0.
    sweep_fraction : float
        Share of the period spent sweeping, in (0, 1]; the rest is fly-back.
    azimuth_rate_rad_s : array_like, rad/s
        How fast the target's azimuth changes; it must be below the beam's own rate. With it the
        result is the first-order answer for a moving target: exact for a constant rate.

    Returns
    -------
    array of the broadcast shape, s
        In [0, sweep_fraction · scan_period_s].

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    The beam is at start + w t, the target at azimuth + r t: they meet at
    (azimuth - start) / (w - r). Without the rate, a target that crosses at r is dated early or
    late by about r/w of the offset: 0.5 % for 1 deg/s under a beam of 220 deg/s.
    """
    positive("width_rad", width_rad)
    if not width_rad <= _TURN * (1.0 + 1e-12):
        raise ValueError(f"width_rad is {width_rad:g}: it must be at most 2π")
    positive("scan_period_s", scan_period_s)
    if not 0.0 < sweep_fraction <= 1.0:
        raise ValueError(f"sweep_fraction is {sweep_fraction:g}: it must lie in (0, 1]")
    start = float(finite("start_rad", start_rad))
    sweep_s = scan_period_s * sweep_fraction
    beam_rate = width_rad / sweep_s
    shape, (azimuth, rate) = broadcast_flat(
        azimuth_rad=finite("azimuth_rad", azimuth_rad),
        azimuth_rate_rad_s=finite("azimuth_rate_rad_s", azimuth_rate_rad_s),
    )
    too_fast = rate >= beam_rate
    if too_fast.any():
        raise ValueError(
            f"azimuth_rate_rad_s is {rate[too_fast][0]:g}: it must be below the beam's rate, "
            f"{beam_rate:g} rad/s"
        )
    swept = _into_sweep(azimuth - start, width_rad)
    return unflatten(np.minimum(swept / (beam_rate - rate), sweep_s), shape)


def _into_sweep(angle: FloatArray, width: float) -> FloatArray:
    """Return the angle clockwise from the start, [0, width]; outside, the nearer edge."""
    angle = np.mod(angle, _TURN)
    past_the_end = angle > width
    nearer_to_start = _TURN - angle < angle - width
    return np.where(past_the_end, np.where(nearer_to_start, 0.0, width), angle)
