"""Detection in a camera's picture: signature, noise and threshold, and what noise alone does.

A look measures each target's signature (eq. 18) once, with Gaussian noise, and detects it where
that sample reaches the threshold. Noise alone is sampled so often in a frame as there are
independent places for a target's picture, and a false alarm is a sample that reaches the same
threshold. Pure functions; the block draws with its own keys.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_positive,
    refuse,
    unflatten,
)
from components.messages.detections import REPORT, Detections, ReportTransform
from components.messages.false_detections import add_false_detections, sort_by_measurement
from components.radar.detection.detector_output import false_alarm_count
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict
from dsa_des.time.clock import ticks_to_nanoseconds

_NORMAL = NormalDist()
_PIXEL_VARIANCE = 1.0 / 12.0
#: A look that is less likely to detect its target than this is none.
FAINTEST_PD = 1e-6
#: So many standard deviations below the threshold a target is never detected.
FAINTEST_DEVIATIONS = -_NORMAL.inv_cdf(FAINTEST_PD)


def noise_equivalent_pixels(blur_pixels: float) -> float:
    """Return over how many pixels a blurred point is spread, as seen by its matched filter.

    The inverse of the sum of the squared shares of its pixels, for a Gaussian spot; King, Accuracy
    of measurement of star images on a pixel array, Publications of the Astronomical Society of the
    Pacific 95, 1983.
    """
    blur = float(check_positive("blur_pixels", blur_pixels))
    return 4.0 * math.pi * (blur**2 + _PIXEL_VARIANCE)


def point_filter_share(pixels: FloatArray, spot: float) -> FloatArray:
    """Return the factor (0 to 1) by which a target of many pixels stands out less than a point.

    A filter that fits a target of N pixels lets in the noise of the pixels of its blur and of its
    own, sqrt(spot + N) of a pixel's in place of sqrt(spot): its signal stands out by that much
    less. The spread of a compact target adds to that of the blur, as 4 pi times the variance of a
    disc of N pixels is N; a long and thin one stands out still less.
    """
    share: FloatArray = np.sqrt(spot / (spot + pixels))
    return share


def pixels_for_filtered_count(filtered: FloatArray, spot: float) -> FloatArray:
    """Return the pixel count N for which N times `point_filter_share` equals the filtered count."""
    half = filtered * filtered / (2.0 * spot)
    pixels: FloatArray = half + filtered * np.sqrt(1.0 + half / (2.0 * spot))
    return pixels


def detection_probability(signature: ArrayLike, threshold: ArrayLike, noise: ArrayLike) -> Any:
    """Return the probability that a sample of a signature with noise reaches the threshold."""
    from scipy.special import ndtr

    shape, (level, needed, deviation) = broadcast_flat(
        signature=check_finite("signature", signature),
        threshold=check_finite("threshold", threshold),
        noise=check_not_negative("noise", noise),
    )
    silent = deviation == 0.0
    above = (level - needed) / np.where(silent, 1.0, deviation)
    drawn = np.where(above > -FAINTEST_DEVIATIONS, ndtr(above), 0.0)
    return unflatten(np.where(silent, np.where(level >= needed, 1.0, 0.0), drawn), shape)


def deviations_of_exceedance(probability: float) -> float:
    """Return the level, in standard deviations, that Gaussian noise exceeds so often."""
    return -_NORMAL.inv_cdf(probability)


def exceeding_probability(deviations: float) -> float:
    """Return the probability that Gaussian noise exceeds a level in standard deviations."""
    return 0.5 * math.erfc(deviations / math.sqrt(2.0))


def false_alarm_direction(
    azimuth_uniform: ArrayLike,
    elevation_uniform: ArrayLike,
    *,
    azimuth_start_rad: float,
    azimuth_width_rad: float,
    lowest_elevation_rad: float,
    highest_elevation_rad: float,
) -> tuple[Any, Any]:
    """Return false alarms' azimuths and elevations, uniform over the picture, from uniform numbers.

    Evenly over azimuth and elevation, as pixels are; not over solid angle.
    """
    width = check_finite("azimuth_width_rad", azimuth_width_rad)
    good = (width > 0.0) & (width <= 2.0 * np.pi * (1.0 + 1e-12))
    refuse("azimuth_width_rad", width, ~good, "be in (0, 2π]")
    lowest = check_finite("lowest_elevation_rad", lowest_elevation_rad)
    highest = check_finite("highest_elevation_rad", highest_elevation_rad)
    refuse(
        "highest_elevation_rad", highest, ~(highest >= lowest), "be at least the lowest elevation"
    )
    start = check_finite("azimuth_start_rad", azimuth_start_rad)
    shape, (across, upwards) = broadcast_flat(
        azimuth_uniform=_check_unit_interval("azimuth_uniform", azimuth_uniform),
        elevation_uniform=_check_unit_interval("elevation_uniform", elevation_uniform),
    )
    azimuth = start + width * across
    elevation = lowest + (highest - lowest) * upwards
    return unflatten(azimuth, shape), unflatten(elevation, shape)


def false_alarm_signature(uniform: ArrayLike, *, threshold: float, noise: float) -> Any:
    """Return signatures of false alarms from uniform numbers: noise that reaches the threshold."""
    draws = _check_unit_interval("uniform", uniform)
    level = max(float(check_finite("threshold", threshold)), 0.0)
    deviation = float(check_positive("noise", noise))
    tail = exceeding_probability(level / deviation)
    # One by one: there are few, and the library's quantile is good to the last places.
    found = [
        deviation * deviations_of_exceedance(tail * (1.0 - u)) for u in draws.reshape(-1).tolist()
    ]
    return np.maximum(np.array(found), level).reshape(draws.shape)


def _check_unit_interval(name: str, value: ArrayLike) -> Any:
    array = check_finite(name, value)
    refuse(name, array, ~((array >= 0.0) & (array < 1.0)), "be in [0, 1)")
    return array


#: More say nothing of targets, and a second of them takes minutes to look at.
MOST_PER_FRAME = 1e4
# Draw 0 of a frame says how many; of each, by its number, where, how strong and which contrast.
_HOW_MANY, _AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST = range(5)
# Draws that belong to the frame and to no target.
_NO_TARGET = np.uint64(0)


class AddedFalseAlarms:
    """Adds a camera's random false alarms to its reports, drawn by scan.

    A false alarm is reported as a target would be: on the pixel grid, with the confidence of noise
    that reaches the threshold (`false_alarm_signature`), and with the pixels that follow from its
    signature as a target's do; where targets are seen without noise, it has the contrast of one of
    them. Detections of a frame stand by what was measured of them. With ``marked_false_alarms`` a
    false alarm comes last, with a confidence of 0 and no pixels.
    """

    def __init__(self, block: Any) -> None:
        self._block = block
        self._reports = block.p.has_false_alarms and block.p.enabled
        rate = block.detector.false_alarms
        if self._reports and rate > MOST_PER_FRAME:
            found = block.detector
            raise ValueError(
                f"{rate:,.0f} false alarms per frame: the threshold, {found.threshold:.4g}, is "
                f"{found.threshold / found.noise:.3g} standard deviations of noise, and at most "
                f"{MOST_PER_FRAME:,.0f} are allowed; give a higher threshold, a smaller "
                "noise_equivalent_contrast, or false_alarms = false"
            )
        self._draws = block.stream("false alarms")

    def __call__(self, detections: Detections, targets: Any, rows: Any) -> Detections:
        """Return the report with its false alarms."""
        if not self._reports:  # built all the same, it changes nothing
            return detections
        marked = self._block.p.marked_false_alarms
        joined = self._add_false_alarms(detections, marked)
        return joined if marked else sort_by_measurement(joined)

    def _add_false_alarms(self, detections: Detections, marked: bool) -> Detections:
        block, reach = self._block, self._block.reach
        found = block.detector
        now_ns = ticks_to_nanoseconds(detections.tick, block.context.ticks_per_s)
        every = self._draws.of_runs(detections.run, now_ns)
        count = false_alarm_count(
            every.uniform(_NO_TARGET, detections.scan, _HOW_MANY),
            cells=found.places,
            false_alarm_probability=found.false_alarms / found.places,
        )
        row = np.repeat(np.arange(len(count)), count)
        if len(row) == 0:
            return detections
        first = np.repeat(np.cumsum(count) - count, count)
        number = (np.arange(len(row)) - first).astype(np.uint64)
        scan, drawn = detections.scan[row], self._draws.of_runs(detections.run[row], now_ns[row])
        azimuth_draw, elevation_draw, strength, contrast = (
            drawn.uniform(number, scan, draw)
            for draw in (_AZIMUTH, _ELEVATION, _STRENGTH, _CONTRAST)
        )
        across, upward = false_alarm_direction(
            azimuth_draw,
            elevation_draw,
            azimuth_start_rad=reach.azimuth_rad[0],
            azimuth_width_rad=reach.width_rad[0],
            lowest_elevation_rad=reach.elevation_rad[0],
            highest_elevation_rad=reach.elevation_rad[1],
        )
        where = {"azimuth": across, "elevation": upward, "range": np.full(len(row), np.nan)}
        signature = false_alarm_signature(
            strength, threshold=found.threshold, noise=found.alarm_noise
        )
        contrasts = block.possible_false_alarm_contrasts(detections.roster)
        which = contrast * len(contrasts)
        signal = block.signal_from_signature(signature, contrasts[which.astype(np.int64)])
        azimuth, elevation, _, measured = block.report_false_alarms(where, signal)
        return add_false_detections(
            detections,
            row,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            confidence=0.0 if marked else signature - found.threshold,
            extras={} if marked else {"pixels": signal["pixels"]},
            measured=measured,
        )


class FrameFalseAlarms(Effect[ReportTransform]):
    """False alarms by noise anywhere in the picture, Binomial(places, Pfa) per frame."""

    name = "false alarms"
    acts_on = REPORT
    builds = AddedFalseAlarms

    def verdict(self, block: Any) -> Verdict:
        """Return whether false alarms are simulated: by ``false_alarms``,
        ``false_alarms_per_frame``, or as other keys imply their number.
        """
        p = block.p
        if not p.enabled:
            return Verdict(False, "enabled is false")
        if p.false_alarms is not None:
            return Verdict.of_flag(p, "false_alarms")
        if p.false_alarms_per_frame is None and p.has_implied_false_alarms:
            return Verdict(True, "two other keys say how many there are")
        if p.false_alarms_per_frame is None:
            return Verdict(False, "neither false_alarms nor false_alarms_per_frame is given")
        rate = p.false_alarms_per_frame
        return Verdict(rate > 0, f"false_alarms_per_frame is {rate:g}")
