"""The rate at which the line of sight to a target turns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import angle, broadcast_flat, positive, unflatten
from components.geometry.directions import angle_between
from components.geometry.wrapping import wrap_by_sines


def line_of_sight_rate(
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    previous_azimuth_rad: ArrayLike,
    previous_elevation_rad: ArrayLike,
    interval_s: ArrayLike,
    *,
    seen_before: ArrayLike = True,
    model: str = "exact",
) -> Any:
    """Give the angular rate of the line of sight between two looks: the dynamic signature V.

    - ``exact``: angle between the two lines of sight / interval (errata 11). No jump where the
      azimuth wraps, none near the zenith.
    - ``thesis``: hypot(Δp, Δq) / interval (eq. 16-17) with Δp wrapped into [-pi, pi]; up to
      1/cos(elevation) too fast, so useless near the zenith.

    A target without a previous look has no rate: 0. The caller keeps the previous angles per
    target and drops them when the target leaves the field of view, so that it starts anew.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like, rad
        Direction now. In a frame that does not turn (north-east-down) the rate is the target's
        own; in body axes, as in the thesis, the ownship's turning is in it.
    previous_azimuth_rad, previous_elevation_rad : array_like, rad
        Direction at the previous look, same frame; anything, NaN included, where not seen before.
    interval_s : array_like, s
        Time since that look: after k missed frames it is k + 1 frame times. Anything where not
        seen before.
    seen_before : array_like of bool
        Whether there was a previous look.
    model : {"exact", "thesis"}

    Returns
    -------
    array of the broadcast shape, rad/s

    Raises
    ------
    ValueError
        If the model is unknown, an angle that counts is not finite, or an interval that counts is
        not above 0.

    Notes
    -----
    Thesis eq. 16-17, errata 11.
    """
    if model not in ("exact", "thesis"):
        raise ValueError(f"model is {model!r}: it must be 'exact' or 'thesis'")
    seen = np.asarray(seen_before, dtype=bool)
    azimuth = angle("azimuth_rad", azimuth_rad)
    elevation = angle("elevation_rad", elevation_rad)
    previous_azimuth = angle(
        "previous_azimuth_rad", np.where(seen, _floats(previous_azimuth_rad), 0.0)
    )
    previous_elevation = angle(
        "previous_elevation_rad", np.where(seen, _floats(previous_elevation_rad), 0.0)
    )
    interval = positive("interval_s", np.where(seen, _floats(interval_s), 1.0))
    shape, (p, q, p_before, q_before, time, seen_flag) = broadcast_flat(
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        previous_azimuth_rad=previous_azimuth,
        previous_elevation_rad=previous_elevation,
        interval_s=interval,
        seen_before=seen.astype(np.float64),
    )
    if model == "exact":
        moved = angle_between(p_before, q_before, p, q)
    else:
        turn = p - p_before
        moved = np.hypot(wrap_by_sines(turn), q - q_before)
    return unflatten(np.where(seen_flag > 0.0, moved, 0.0) / time, shape)


def _floats(value: ArrayLike) -> Any:
    return np.asarray(value, dtype=np.float64)
