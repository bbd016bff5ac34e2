"""How far relative states may be wrong: standard deviations times z-scores."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.well_clear.uncertainty import Bounds
from dsa_des.arrays.types import FloatArray


class Deviations(NamedTuple):
    """Standard deviations of states, those of ownship and target added, arrays of one shape.

    Parameters
    ----------
    position_m, height_m, velocity_mps, climb_mps : ndarray
        Of horizontal ones along their longest axis.
    """

    position_m: FloatArray
    height_m: FloatArray
    velocity_mps: FloatArray
    climb_mps: FloatArray


def margins(configuration: Configuration, deviations: Deviations, range_m: FloatArray) -> Bounds:
    """Return how far relative states may be wrong.

    Parameters
    ----------
    configuration : Configuration
    deviations : Deviations
    range_m : ndarray
        Horizontal: far away, less of the velocity's deviation counts.
    """
    position = configuration["h_pos_z_score"] * deviations.position_m
    least, most = configuration["h_vel_z_score_min"], configuration["h_vel_z_score_max"]
    distance_m = configuration["h_vel_z_distance"]
    away = np.maximum(range_m - position, 0.0)
    share = np.minimum(away / distance_m, 1.0) if distance_m > 0.0 else 1.0
    return Bounds(
        position,
        configuration["v_pos_z_score"] * deviations.height_m,
        (most - (most - least) * share) * deviations.velocity_mps,
        configuration["v_vel_z_score"] * deviations.climb_mps,
    )


def largest(east: FloatArray, north: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the standard deviation along the longest axis of 2 by 2 covariances.

    Parameters
    ----------
    east, north : ndarray
        Standard deviations.
    covariance : ndarray
        Of the two.
    """
    mean, half = 0.5 * (east**2 + north**2), 0.5 * (east**2 - north**2)
    return np.asarray(np.sqrt(mean + np.hypot(half, covariance)))
