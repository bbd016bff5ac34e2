"""Detection and optical flow in a pair of pictures, with OpenCV (extra `image`)."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray

#: A spot that covers fewer pixels than this, as the picture has it, has no flow worth the name.
FEWEST_PIXELS = 3
_RING = 3
# Of normal noise, the median of its size; clutter counts where the ring varies so much more.
# Coarse filters leave few independent values there.
_OF_MEDIAN, _CLUTTERED, _COARSE = 0.6745, 1.5, 2.5
# How far the background beside a target says what it is behind it, pixels, how little of it, and
# how often what is behind is relaxed.
_NEAR, _LITTLE, _RELAXED = 1.5, 1e-3, 20
_FOUR = np.array([[0.0, 0.25, 0.0], [0.25, 0.0, 0.25], [0.0, 0.25, 0.0]])
# Smoothing of the correlation, pixels; rounds of whole pixels; steps, and the least of them.
_SMOOTH, _ROUNDS, _STEPS, _FINE = 0.7, 3, 12, 1e-4
#: Flows known to no better than this, pixels, are not told; and less correlation is another thing.
_WORST, _ALIKE = 0.25, 0.6
#: A flow this near to the whole pixels at which it was cut out stands.
_SETTLED = 0.75
#: So many times what is left says was measured in clutter (1 to 2.4, more for larger targets).
_IN_CLUTTER = 2.0
_AROUND = np.ones((3, 3), np.uint8)


@cache
def single_threaded_opencv() -> Any:
    """Return OpenCV set to one thread; raise ImportError with the command to install it."""
    try:
        import cv2
    except ImportError as error:
        raise ImportError("optical.image needs OpenCV: pip install 'dsa-des[image]'") from error
    # Several threads would add up sums in another order, and fight over the cores of a study.
    cv2.setNumThreads(1)
    cv2.ocl.setUseOpenCL(False)
    return cv2


class Spot(NamedTuple):
    """What stands out most in a part of a picture."""

    snr: float  # in standard deviations of what the same filter makes of the background
    x: float  # pixels from the picture's left edge, and from its upper edge
    y: float
    pixels: int  # how many stand out half as much as the middle does
    level: float  # how much the middle stands out
    behind: float  # the background's level
    cluttered: bool  # whether the background varies by more than noise


def find_spot(picture: FloatArray, sought: BoolArray, spread_pixels: float, noise: float) -> Spot:
    """Return the strongest spot of a picture among the pixels that are `sought`.

    Gaussian filters of the picture's own blur and of its multiples by 2, as far as the picture
    goes, each weighed by the noise that it lets through: the larger of what white noise of a pixel
    comes to, and of what the picture's rim varies by, where there is clutter. A place between
    pixels is the vertex of a parabola, or of a spot larger than its filter, over which the filter
    has no peak but noise, the middle of what stands out with it.
    """
    cv2 = single_threaded_opencv()
    rim = _rim_mask(picture.shape[0])
    behind = float(picture[rim].mean())
    flat = picture - behind
    best: tuple[float, Any, float] = (-math.inf, flat, 1.0)
    of_best = spread_pixels
    cluttered = False
    spread = spread_pixels
    while spread <= max(picture.shape[0] / 6.0, spread_pixels):
        through = cv2.GaussianBlur(flat, (0, 0), spread, borderType=cv2.BORDER_REFLECT)
        white = noise * _filter_noise_gain(picture.shape[0], spread)
        rough = float(np.median(np.abs(through[rim]))) / _OF_MEDIAN
        finest = spread == spread_pixels
        rough = rough if rough > (_CLUTTERED if finest else _COARSE) * white else 0.0
        cluttered |= finest and rough > 0.0
        deviation = max(rough, white)
        peak = float(np.where(sought, through, -math.inf).max())
        if peak / deviation > best[0]:
            best, of_best = (peak / deviation, through, peak), spread
        spread *= 2.0
    snr, through, peak = best
    row, column = np.unravel_index(
        int(np.argmax(np.where(sought, through, -math.inf))), picture.shape
    )
    x = float(column + 0.5 + _parabola_vertex_offset(through[row, max(column - 1, 0) : column + 2]))
    y = float(row + 0.5 + _parabola_vertex_offset(through[max(row - 1, 0) : row + 2, column]))
    finest = cv2.GaussianBlur(flat, (0, 0), spread_pixels, borderType=cv2.BORDER_REFLECT)
    level = float(finest[row, column])
    stands = sought & (finest > 0.5 * level)
    pixels = int(np.count_nonzero(stands)) if level > 0.0 else 0
    if pixels > 4.0 * math.pi * of_best**2:
        x, y = _spot_centroid(stands, finest, int(row), int(column), (x, y))
    return Spot(snr, x, y, pixels, level, behind, cluttered)


def _spot_centroid(
    stands: BoolArray, picture: FloatArray, row: int, column: int, otherwise: tuple[float, float]
) -> tuple[float, float]:
    """Return the bright region's centroid (x, y), or `otherwise` if that lies outside it.

    It is weighed by the picture, as its edge covers pixels in part.
    """
    _, labels = single_threaded_opencv().connectedComponents(
        stands.astype(np.uint8), connectivity=8
    )
    rows, columns = np.nonzero(labels == labels[row, column])
    weight = picture[rows, columns]
    x, y = (float(np.average(one + 0.5, weights=weight)) for one in (columns, rows))
    return (x, y) if labels[int(y), int(x)] == labels[row, column] else otherwise


@cache
def _filter_noise_gain(size: int, spread: float) -> float:
    """Return unit white noise's deviation after a Gaussian filter, with the rim's mean removed.

    Of the filter as it is in pixels: by the formula for a continuous picture noise comes out as 1.1
    to 1.5 times what is expected, and a false alarm at 3 deviations is 14 times as likely.
    """
    point = np.zeros((size, size))
    point[size // 2, size // 2] = 1.0
    weight = single_threaded_opencv().GaussianBlur(
        point, (0, 0), spread, borderType=single_threaded_opencv().BORDER_REFLECT
    )
    rim = _rim_mask(size)
    weight -= rim / np.count_nonzero(rim)
    return float(np.sqrt((weight**2).sum()))


@cache
def _rim_mask(size: int) -> BoolArray:
    rim = np.ones((size, size), dtype=bool)
    rim[_RING:-_RING, _RING:-_RING] = False
    return rim


def _parabola_vertex_offset(three: FloatArray) -> float:
    if len(three) < 3:
        return 0.0
    before, here, after = (float(v) for v in three)
    bend = before - 2.0 * here + after
    return 0.0 if bend >= 0.0 else max(-0.5, min(0.5, 0.5 * (before - after) / bend))


class Flow(NamedTuple):
    """A spot's displacement between two pictures and its deviation, pixels; NaN if unmeasured."""

    x: float
    y: float
    # standard deviation of either, as the pictures themselves tell it: of the axis that they say
    # least along, that of an outline's straight edge
    deviation: float


_NOTHING = Flow(math.nan, math.nan, math.nan)


def spot_flow(
    earlier: FloatArray, later: FloatArray, spot: Spot, sought: BoolArray, noise: float
) -> Flow:
    """Return a spot's move (x, y) from earlier to later picture and its standard deviation, pixels.

    Of both pictures the share of each pixel that the target covers is worked out, from its level
    and from the background, as it is beside the target; so the flow is the target's, whatever the
    background does. Of these, first the whole pixel where they fit best, then the maximum of their
    correlation, as the Fourier series that goes through all pixels has it, by Newton's method: a
    shift in between costs no interpolation (Guizar-Sicairos, Thurman & Fienup, Optics Letters 33,
    2008). What is left between the pictures says how good the flow is. Nothing is told where the
    spot is too small, leaves the picture, is not the same again, or where the flow is known to
    no better than `_WORST` pixels.
    """
    if spot.pixels < FEWEST_PIXELS or spot.level <= 0.0:
        return _NOTHING
    mask = _spot_mask(later, spot, sought)
    if mask is None:
        return _NOTHING
    ahead = _whole_pixel_displacement(earlier, later, spot, mask)
    second = _pixel_coverage(later, mask, spot)
    flow = ahead.astype(np.float64)
    for _ in range(_ROUNDS):
        before = _shift_pixels(mask, -ahead)
        if before.sum() < mask.sum() or before[0].any() or before[:, 0].any():
            return _NOTHING
        if before[-1].any() or before[:, -1].any():
            return _NOTHING
        first = _pixel_coverage(earlier, before, spot)
        found = _subpixel_displacement(_shift_pixels(first, ahead), second, noise / spot.level)
        flow = ahead + np.array(found[:2])
        whole = np.rint(flow)
        if not np.isfinite(whole).all() or np.abs(whole - ahead).max() > 2.0:
            return _NOTHING
        if np.abs(flow - ahead).max() < _SETTLED:
            break
        ahead = whole.astype(np.int64)
    else:
        return _NOTHING
    # Along an edge the background is wrong in one way: that is not seen in what is left.
    deviation = found.deviation * (_IN_CLUTTER if spot.cluttered else 1.0)
    if not deviation < _WORST:
        return _NOTHING
    return Flow(float(flow[0]), float(flow[1]), deviation)


def _spot_mask(later: FloatArray, spot: Spot, sought: BoolArray) -> Any:
    """Return a mask (0 or 1) of the spot's pixels and those beside them; None if not found."""
    cv2, size = single_threaded_opencv(), later.shape[0]
    stands = (sought & (later - spot.behind > 0.5 * spot.level)).astype(np.uint8)
    _, labels = cv2.connectedComponents(stands, connectivity=8)
    mine = labels[min(int(spot.y), size - 1), min(int(spot.x), size - 1)]
    return None if mine == 0 else cv2.dilate((labels == mine).astype(np.uint8), _AROUND)


def _whole_pixel_displacement(
    earlier: FloatArray, later: FloatArray, spot: Spot, mask: AnyArray
) -> AnyArray:
    """Return the spot's displacement (x, y) in whole pixels, by the pictures' best correlation."""
    cv2 = single_threaded_opencv()
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    first, second = ((one - spot.behind).astype(np.float32) for one in (earlier, later))
    part = (second * mask)[top:bottom, left:right]
    alike = cv2.matchTemplate(first, part, cv2.TM_CCORR)
    row, column = np.unravel_index(int(np.argmax(alike)), alike.shape)
    return np.array([left - column, top - row])


def _shift_pixels(picture: AnyArray, by: AnyArray) -> AnyArray:
    """Return a picture moved by whole pixels, x and y; what comes in is 0."""
    moved = np.zeros_like(picture)
    (x, y), (rows, columns) = by.tolist(), picture.shape
    moved[max(y, 0) : rows + min(y, 0), max(x, 0) : columns + min(x, 0)] = picture[
        max(-y, 0) : rows + min(-y, 0), max(-x, 0) : columns + min(-x, 0)
    ]
    return moved


def _pixel_coverage(picture: FloatArray, mask: AnyArray, spot: Spot) -> FloatArray:
    """Return the share of each pixel that the target covers, 0 beyond its own pixels.

    A pixel is partly the target's and partly the background's: the background counts less the more
    is covered.
    """
    cv2 = single_threaded_opencv()
    own = cv2.dilate(mask, _AROUND)
    behind: Any = np.full_like(picture, spot.behind)
    if spot.cluttered:
        behind = _interpolate_background(picture, own, spot.behind)
    level = float(cv2.GaussianBlur(picture, (0, 0), 0.5)[mask > 0].max(initial=-math.inf))
    share = (picture - behind) / np.maximum(level - behind, 0.3 * spot.level)
    return np.asarray(np.where((mask if spot.cluttered else own) > 0, share, 0.0))


def _interpolate_background(picture: FloatArray, own: AnyArray, level: float) -> FloatArray:
    """Return the background, with the target's pixels filled smoothly from those beside them."""
    cv2 = single_threaded_opencv()
    outside = 1.0 - own.astype(np.float64)
    weight = cv2.GaussianBlur(outside, (0, 0), _NEAR) + _LITTLE
    beside = cv2.GaussianBlur((picture - level) * outside, (0, 0), _NEAR) / weight
    inner = own > 0
    filled = np.where(inner, beside, picture - level)
    for _ in range(_RELAXED):
        filled[inner] = cv2.filter2D(filled, -1, _FOUR)[inner]
    return filled + level


def _subpixel_displacement(first: FloatArray, second: FloatArray, noise: float) -> Flow:
    """Return the second picture's sub-pixel shift and its standard deviation, pixels.

    The correlation is that of both, smoothed by `_SMOOTH`: the sharpest detail is not sampled
    finely enough to say where it is.
    """
    k, square, soft, counted = _wave_numbers_and_weights(len(first))
    one, other = np.fft.rfft2(first), np.fft.rfft2(second)
    both = other * np.conj(one) * (soft * counted)
    shift = np.zeros(2)
    for _ in range(_STEPS):
        turned = both * np.exp(1j * (k[0] * shift[0] + k[1] * shift[1]))
        bend = _moment_matrix(square, turned.real)
        if not (bend[0, 0] > 0.0 and np.linalg.det(bend) > 0.0):
            return _NOTHING
        slope = -np.array([(k[0] * turned.imag).sum(), (k[1] * turned.imag).sum()])
        step = np.linalg.solve(bend, slope)
        shift = shift + np.clip(step, -1.0, 1.0)
        if np.abs(step).max() < _FINE:
            break
    # What is left between the two, in each wave: that of the pixels' noise at least.
    left = np.abs(other - one * np.exp(-1j * (k[0] * shift[0] + k[1] * shift[1]))) ** 2
    # In the waves that say where it is, or in all; those of what is cut out go together, so that as
    # many of them are their own as the target has pixels.
    telling = (square[0] + square[2]) * soft * np.abs(turned)
    power = max(float((left * by).sum() / by.sum()) for by in (telling, soft * counted))
    power = max(power * second.size / np.count_nonzero(second), 2.0 * noise**2 * second.size)
    energy = [float((np.abs(of) ** 2 * soft * counted).sum()) for of in (one, other)]
    if float(turned.real.sum()) < _ALIKE * math.sqrt(energy[0] * energy[1]):
        return _NOTHING
    inverse = np.linalg.inv(bend)
    covariance = power * inverse @ _moment_matrix(square, soft * turned.real) @ inverse
    return Flow(float(shift[0]), float(shift[1]), math.sqrt(_largest_axis_variance(covariance)))


def _largest_axis_variance(covariance: FloatArray) -> float:
    """Return the largest eigenvalue of a covariance matrix (2, 2)."""
    (xx, xy), (_, yy) = covariance
    return float(0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy))


def _moment_matrix(square: Any, values: FloatArray) -> FloatArray:
    xx, xy, yy = ((one * values).sum() for one in square)
    return np.array([[xx, xy], [xy, yy]])


@cache
def _wave_numbers_and_weights(size: int) -> tuple[Any, Any, FloatArray, FloatArray]:
    """Return wave numbers (x, y; rad per pixel), products, smoothing weights, each wave's count."""
    x = 2.0 * np.pi * np.fft.rfftfreq(size)[np.newaxis]
    y = 2.0 * np.pi * np.fft.fftfreq(size)[:, np.newaxis]
    soft = np.exp(-0.5 * _SMOOTH**2 * (x * x + y * y)) * (x < np.pi) * (np.abs(y) < np.pi)
    counted = np.where((x > 0.0) & (x < np.pi), 2.0, 1.0) * np.ones_like(y)
    return (x, y), (x * x, x * y, y * y), soft, counted
