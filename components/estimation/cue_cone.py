"""Cones in which targets are thought to be: how wide, and what lies in them."""

import numpy as np

from components.estimation.batched import product, product_transposed, times
from components.estimation.frame import Place
from components.estimation.measurement import Kind, linearised
from dsa_des.arrays.types import BoolArray, FloatArray


def half_angle_rad(
    position_m: FloatArray, covariance: FloatArray, place: Place, sigmas: float
) -> FloatArray:
    """Return how far from its expected direction a target may be seen.

    Parameters
    ----------
    position_m : (3, n)
    covariance : (3, 3, n)
        Of the position, m².
    place : Place
        Of the one who looks.
    sigmas : float
        Standard deviations across the line of sight along the widest axis.

    Returns
    -------
    ndarray of shape (n,)
        At most pi.
    """
    seen, by_position = linearised(Kind(has_range=False), position_m, place)
    spread = product_transposed(product(by_position, covariance), by_position)
    level = np.cos(seen[1])
    across, upward = spread[0, 0] * level * level, spread[1, 1]
    both = spread[0, 1] * level
    # The larger eigenvalue of two by two.
    mean, half = 0.5 * (across + upward), 0.5 * (across - upward)
    widest = mean + np.sqrt(half * half + both * both)
    return np.minimum(sigmas * np.sqrt(np.maximum(widest, 0.0)), np.pi)


def axis_in_body(
    ahead_s: FloatArray,
    state: FloatArray,
    direction: FloatArray,
    has_range: BoolArray,
    place: Place,
) -> FloatArray:
    """Return unit vectors from the one who looks along cones' axes, in body axes.

    Parameters
    ----------
    ahead_s : (n,)
        How much later than the cone's state, s.
    state : (6, n)
        Position and velocity in the frame; not used without a range.
    direction : (2, n)
        Azimuth and elevation in the frame's axes, used without a range.
    has_range : (n,) of bool
    place : Place
    """
    level = np.cos(direction[1])
    told = np.stack(
        [level * np.cos(direction[0]), level * np.sin(direction[0]), -np.sin(direction[1])]
    )
    away = state[:3] + ahead_s * state[3:] - place.position_m
    away = np.where(has_range, away, told)
    length = np.sqrt(away[0] ** 2 + away[1] ** 2 + away[2] ** 2)
    return times(place.to_body, away / np.maximum(length, 1e-9))
