"""The echo of the ground in the cell of a target, over flat terrain of one altitude."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    as_numbers,
    broadcast_flat,
    finite,
    not_negative,
    positive,
    refuse,
    unflatten,
)

# Ground farther from the beam's axis than this many beamwidths (two-way gain below -96 dB) is dark.
BEAM_REACH_BEAMWIDTHS = 2.0

_LN_2 = math.log(2.0)


def height_above_terrain_m(own_alt_m: ArrayLike, terrain_alt_m: ArrayLike) -> Any:
    """Return the height above terrain, or refuse terrain above the ownship.

    Parameters
    ----------
    own_alt_m, terrain_alt_m : array_like, m
        Above sea level.

    Returns
    -------
    array of the broadcast shape, m

    Raises
    ------
    ValueError
        If the terrain is as high as the ownship or higher.
    """
    shape, (own, terrain) = broadcast_flat(
        own_alt_m=finite("own_alt_m", own_alt_m),
        terrain_alt_m=finite("terrain_alt_m", terrain_alt_m),
    )
    buried = terrain >= own
    if buried.any():
        first = int(np.argmax(buried))
        raise ValueError(
            f"terrain_alt_m is {terrain[first]:g}: it must be below the ownship's altitude, "
            f"{own[first]:g} m"
        )
    return unflatten(own - terrain, shape)


def ground_clutter_rcs_m2(
    range_m: ArrayLike,
    elevation_rad: ArrayLike,
    height_m: ArrayLike,
    *,
    gamma_db: float,
    azimuth_beamwidth_rad: float,
    elevation_beamwidth_rad: float,
    range_resolution_m: float,
) -> Any:
    """Return the RCS of the ground in the range cell of a target at which the beam points.

    Parameters
    ----------
    range_m : array_like, m
        Slant range of the target, so of its cell.
    elevation_rad : array_like, rad
        Elevation of the beam's axis above the local horizontal.
    height_m : array_like, m
        Height above terrain, above 0.
    gamma_db : float, dB
        Reflectivity γ of the terrain in σ0 = γ sin(grazing): about -20 for a smooth desert or
        sea, -15 for farmland, -10 for woodland and -5 for a town, with ±5 dB between places.
    azimuth_beamwidth_rad, elevation_beamwidth_rad : float, rad
        One-way half-power beamwidths, above 0.
    range_resolution_m : float, m
        Depth of a range cell, above 0.

    Returns
    -------
    array of the broadcast shape, m²
        As the target's RCS goes into the radar equation, the beam's gain towards the ground
        included. 0 where the cell holds no ground (nearer than the height) or the ground is more
        than `BEAM_REACH_BEAMWIDTHS` beamwidths off the axis.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    σ = σ0 · A · g: constant-γ reflectivity (D. K. Barton, "Land clutter models for radar design
    and analysis", Proc. IEEE 73(2), 1985); patch A = R θ_az · min(ΔR / cos ψ, R θ_el / sin ψ),
    limited by the range cell or, looking steeply down, by the beam; two-way gain of a Gaussian
    beam g = exp(-8 ln 2 (Δ/θ_el)²), Δ between the beam's axis and the ground at that range.
    Sidelobes (`ground_ring_rcs_m2`) are left out, and the spread of the ground's depression over
    the patch.
    """
    for name, value in (
        ("azimuth_beamwidth_rad", azimuth_beamwidth_rad),
        ("elevation_beamwidth_rad", elevation_beamwidth_rad),
        ("range_resolution_m", range_resolution_m),
    ):
        positive(name, value)
    reflectivity = as_numbers("gamma_db", gamma_db)
    refuse("gamma_db", reflectivity, ~(np.abs(reflectivity) <= 100.0), "lie in ±100 dB")
    shape, (distance, elevation, height) = broadcast_flat(
        range_m=not_negative("range_m", range_m),
        elevation_rad=finite("elevation_rad", elevation_rad),
        height_m=positive("height_m", height_m),
    )
    sine = np.minimum(height, distance) / _or_height(distance, height)
    grazing = np.arcsin(sine)
    off_axis = (elevation + grazing) / elevation_beamwidth_rad
    lit = (distance >= height) & (np.abs(off_axis) <= BEAM_REACH_BEAMWIDTHS)
    off_axis = np.where(lit, off_axis, 0.0)
    # Looking straight down cos ψ is 0: the beam limits the patch there, so any floor does.
    cosine = np.maximum(np.cos(grazing), 1e-12)
    across = distance * azimuth_beamwidth_rad
    along = np.minimum(
        range_resolution_m / cosine, distance * elevation_beamwidth_rad / np.maximum(sine, 1e-300)
    )
    gain = np.exp(-8.0 * _LN_2 * off_axis * off_axis)
    rcs = 10.0 ** (0.1 * float(reflectivity)) * sine * across * along * gain
    return unflatten(np.where(lit, rcs, 0.0), shape)


def ground_ring_rcs_m2(
    range_m: ArrayLike, height_m: ArrayLike, *, gamma_db: float, range_resolution_m: float
) -> Any:
    """Return the RCS of the ground at a slant range in all directions, which sidelobes meet.

    Parameters
    ----------
    range_m, height_m : array_like, m
        Slant range, and height above terrain, above 0.
    gamma_db : float, dB
        As for `ground_clutter_rcs_m2`.
    range_resolution_m : float, m
        Above 0.

    Returns
    -------
    array of the broadcast shape, m²
        σ0 2 pi R ΔR, before any gain: on flat ground the ring at slant range R has that area
        whatever the height. 0 nearer than the height.
    """
    positive("range_resolution_m", range_resolution_m)
    shape, (distance, height) = broadcast_flat(
        range_m=not_negative("range_m", range_m), height_m=positive("height_m", height_m)
    )
    sine = np.minimum(height, distance) / _or_height(distance, height)
    area = 2.0 * math.pi * distance * range_resolution_m
    rcs = 10.0 ** (0.1 * float(gamma_db)) * sine * area
    return unflatten(np.where(distance >= height, rcs, 0.0), shape)


def _or_height(distance: Any, height: Any) -> Any:
    """Return the distance, or the height where the distance is 0 (no division by 0)."""
    return np.where(distance > 0.0, distance, height)
