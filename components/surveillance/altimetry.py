"""The altitude that a transponder reports: the error of its altimeter, then 25 or 100 ft steps."""

from __future__ import annotations

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Tops of the layers of altitude, ft; above the last one the last values hold.
LAYER_TOPS_FT = np.array([2300.0, 5000.0, 10_000.0, 20_000.0, 41_000.0])
#: Scale of the Laplace distribution of altimetry errors, ft, by layer: of the better altimeters, of
#: the others, and the share of better ones.
BETTER_FT = np.array([35.0, 38.0, 43.0, 58.0, 72.0, 94.0])
OTHER_FT = np.array([60.0, 60.0, 69.0, 87.0, 101.0, 101.0])
SHARE_OF_BETTER = np.array([0.391, 0.320, 0.345, 0.610, 0.610, 0.610])


def laplace_draws_from_uniform(uniform: FloatArray) -> FloatArray:
    """Return Laplace draws (mean 0, scale 1), one for each uniform draw in [0, 1)."""
    # The upper half is the mirrored lower one, and no draw is infinite.
    off = uniform - 0.5
    return np.asarray(-np.sign(off) * np.log(np.maximum(1.0 - 2.0 * np.abs(off), 2.0**-53)))


def altimetry_error_ft(
    altitude_ft: FloatArray, laplace: FloatArray, kind: FloatArray
) -> FloatArray:
    """Return altimetry errors in ft at altitudes (n,), from a Laplace draw and a uniform draw that
    selects the kind of altimeter.

    ICAO's model (Annex 10, volume IV, 4.4.2.4; as RTCA DO-365 appendix Q has it): a Laplace
    distribution whose scale is that of the layer. An aircraft keeps its standard Laplace draw and
    its uniform draw `kind`, which says whether its altimeter is one of the better ones there, so
    that the error changes with the layer alone.
    """
    layer = np.searchsorted(LAYER_TOPS_FT, altitude_ft, side="left")
    better: BoolArray = kind < SHARE_OF_BETTER[layer]
    return np.asarray(laplace * np.where(better, BETTER_FT[layer], OTHER_FT[layer]))


def altimetry_variance_ft2(altitude_ft: FloatArray) -> FloatArray:
    """Return altimetry variance, ft², at altitudes, averaged over better and other altimeters."""
    layer = np.searchsorted(LAYER_TOPS_FT, altitude_ft, side="left")
    share = SHARE_OF_BETTER[layer]
    return np.asarray(2.0 * (share * BETTER_FT[layer] ** 2 + (1.0 - share) * OTHER_FT[layer] ** 2))
