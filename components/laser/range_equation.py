"""The laser range equation, and how often a scan's shots meet a target.

A beam of divergence θ and even brightness lights a disc of π (θR)² / 4 at the range R. What of it
a target takes, times its reflectivity, is scattered evenly over the half space (Lambert), and the
aperture D collects its part:

    P = P0 ρ s η T² D² / (4 R²)

with the share s of the disc that the target fills: 1 for one that is larger than the beam (P falls
with R²), A over the disc for a small one (with R⁴), 4 d / (π θ R) for a wire through the middle of
the disc (with R³), and T the transmission one way. These are the laser radar cross-sections
π ρ R² θ², 4 ρ A and 4 ρ d θ R of A. V. Jelalian, Laser Radar Systems, Artech House 1992, chapter 1.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_positive,
    unflatten,
)
from components.optical.detection import detection_probability

__all__ = [
    "beam_share_on_target",
    "beam_share_on_wire",
    "mean_shots_on_target",
    "received_laser_power_w",
    "scan_detection_probability",
]


def beam_share_on_target(area_m2: ArrayLike, range_m: ArrayLike, divergence_rad: float) -> Any:
    """Return the share, at most 1, of the beam at a range that a target of some area fills."""
    return _filled_beam_share("area_m2", area_m2, range_m, divergence_rad, 2)


def beam_share_on_wire(diameter_m: ArrayLike, range_m: ArrayLike, divergence_rad: float) -> Any:
    """Return the beam's share (at most 1) that a wire across its middle fills: 4 d / (π θ R)."""
    return _filled_beam_share("diameter_m", diameter_m, range_m, divergence_rad, 1)


def _filled_beam_share(
    name: str, size: ArrayLike, range_m: ArrayLike, divergence_rad: float, power: int
) -> Any:
    shape, (filled, distance) = broadcast_flat(
        **{name: check_not_negative(name, size), "range_m": check_positive("range_m", range_m)}
    )
    width_m = float(check_positive("divergence_rad", divergence_rad)) * distance
    return unflatten(np.minimum(filled / (0.25 * math.pi * width_m**power), 1.0), shape)


def received_laser_power_w(
    share: ArrayLike,
    range_m: ArrayLike,
    *,
    peak_power_w: float,
    aperture_m: float,
    efficiency: float = 1.0,
    reflectivity: ArrayLike = 1.0,
    extinction_per_m: float = 0.0,
) -> Any:
    """Return the peak power (W) received from a Lambertian target filling a share of the beam.

    `efficiency` is that of transmitter and receiver together, `extinction_per_m` that of the air.
    Jelalian, eq. 1.1 with the cross-sections of his chapter 1; R. D. Richmond and S. C. Cain,
    Direct-Detection LADAR Systems, SPIE 2010, chapter 1.
    """
    shape, (part, distance, bright) = broadcast_flat(
        share=check_not_negative("share", share),
        range_m=check_positive("range_m", range_m),
        reflectivity=check_not_negative("reflectivity", reflectivity),
    )
    sent_w = float(check_positive("peak_power_w", peak_power_w)) * float(
        check_not_negative("efficiency", efficiency)
    )
    depth = 2.0 * float(check_not_negative("extinction_per_m", extinction_per_m)) * distance
    with np.errstate(under="ignore"):
        left = np.exp(-depth)
        collected = (0.5 * float(check_positive("aperture_m", aperture_m)) / distance) ** 2
        return unflatten(sent_w * part * bright * collected * left, shape)


def mean_shots_on_target(
    area_rad2: ArrayLike, beam_area_rad2: ArrayLike, spacing_rad2: ArrayLike
) -> Any:
    """Return the mean number of a scan's shots that hit a target, each with its whole share.

    The larger of the target and the beam, over the solid angle of a shot (sr). What a beam meets
    with its edge alone is not counted as a shot of its own: shots times share times the disc is the
    target's area whatever the beam, so that no light is made. Of a wire, the target is its length
    by its thickness and the beam its length by π θ / 4.
    """
    shape, (target, beam, each) = broadcast_flat(
        area_rad2=check_not_negative("area_rad2", area_rad2),
        beam_area_rad2=check_not_negative("beam_area_rad2", beam_area_rad2),
        spacing_rad2=check_positive("spacing_rad2", spacing_rad2),
    )
    return unflatten(np.maximum(target, beam) / each, shape)


def scan_detection_probability(
    snr: ArrayLike, shots: ArrayLike, *, threshold: float, needed: int = 1
) -> Any:
    """Return the probability that in a scan at least `needed` shots on target exceed threshold.

    Each shot that meets it is detected where its amplitude (over the noise's standard deviation, of
    optical power) with Gaussian noise reaches the threshold, Q(threshold - SNR), and `needed` of
    them must be. Where the mean number of shots is not whole, the pattern's phase says whether
    there is one more: it is even from scan to scan.

    Direct detection of a pulse in the noise of the receiver: Richmond and Cain, chapter 3. Speckle
    is left out: an aperture of many speckles averages it, and so does a wide band.
    """
    from scipy.special import bdtrc

    shape, (ratio, mean) = broadcast_flat(
        snr=check_not_negative("snr", snr), shots=check_not_negative("shots", shots)
    )
    one = detection_probability(ratio, threshold, 1.0)
    whole = np.floor(mean)

    def probability_of_enough(count: Any) -> Any:
        possible = count >= needed
        tried = bdtrc(needed - 1, np.where(possible, count, needed).astype(np.int64), one)
        return np.where(possible, tried, 0.0)

    more = mean - whole
    return unflatten(
        (1.0 - more) * probability_of_enough(whole) + more * probability_of_enough(whole + 1.0),
        shape,
    )
