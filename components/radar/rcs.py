"""The radar cross-section: constant, fluctuating, or from a table over aspect."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    checked_model,
    finite,
    not_negative,
    refuse,
    unflatten,
)


def fluctuating_rcs(mean_rcs_m2: ArrayLike, uniforms: ArrayLike, model: str) -> Any:
    """Return sampled RCS from uniform draws by the inverse of the distribution's function.

    Parameters
    ----------
    mean_rcs_m2 : array_like, m²
        Mean RCS, 0 or more.
    uniforms : array_like
        Draws in [0, 1), made by the caller. ``swerling1`` and ``swerling3``: one per scan, any
        shape that broadcasts with the mean. ``swerling2`` and ``swerling4``: one per pulse, with
        the pulses along the last axis; the mean broadcasts with the axes before it.
        ``swerling0`` ignores their values.
    model : str
        ``swerling0`` (steady; also ``swerling5``), ``swerling1`` and ``swerling2`` (exponential),
        ``swerling3`` and ``swerling4`` (Erlang of order 2).

    Returns
    -------
    array, m²
        Of the broadcast shape; its mean over the draws is `mean_rcs_m2`. Larger draws give larger
        RCS.

    Raises
    ------
    ValueError
        If an argument is out of range or the shapes do not fit.

    Notes
    -----
    Thesis eq. 22 with N = 1 (eq. 23: the exponential in power, Rayleigh in amplitude) and N = 2.
    """
    name = checked_model(model)
    mean, draw = not_negative("mean_rcs_m2", mean_rcs_m2), finite("uniforms", uniforms)
    refuse("uniforms", draw, ~((draw >= 0.0) & (draw < 1.0)), "lie in [0, 1)")
    if name in ("swerling2", "swerling4"):
        if draw.ndim == 0:
            raise ValueError("uniforms is a scalar: it must have one draw per pulse along an axis")
        mean = mean[..., None]
    shape, (mean, draw) = broadcast_flat(mean_rcs_m2=mean, uniforms=draw)
    if name == "swerling0":
        return unflatten(mean, shape)
    if name in ("swerling1", "swerling2"):
        return unflatten(mean * -np.log1p(-draw), shape)
    from scipy.special import gammaincinv

    return unflatten(mean * (0.5 * np.asarray(gammaincinv(2.0, draw))), shape)
