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
_ITERATIONS, _STEP = 60, 1e-3
# How far the background beside a target says what it is behind it, pixels, and how little of it.
_NEAR, _LITTLE = 1.5, 1e-3
# Smoothing before the flow, as sampling between pixels is linear, and how the rest fades out.
_SMOOTH, _FADES, _ROUNDS = 0.7, 1.0, 3
_AROUND = np.ones((3, 3), np.uint8)


@cache
def opencv() -> Any:
    """Return OpenCV on one thread, or say how it is had."""
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
    pixels is the vertex of a parabola.
    """
    cv2 = opencv()
    rim = _rim(picture.shape[0])
    behind = float(picture[rim].mean())
    flat = picture - behind
    best: tuple[float, Any, float] = (-math.inf, flat, 1.0)
    cluttered = False
    spread = spread_pixels
    while spread <= max(picture.shape[0] / 6.0, spread_pixels):
        through = cv2.GaussianBlur(flat, (0, 0), spread, borderType=cv2.BORDER_REFLECT)
        white = noise * _let_through(picture.shape[0], spread)
        rough = float(np.median(np.abs(through[rim]))) / _OF_MEDIAN
        finest = spread == spread_pixels
        rough = rough if rough > (_CLUTTERED if finest else _COARSE) * white else 0.0
        cluttered |= finest and rough > 0.0
        deviation = max(rough, white)
        peak = float(np.where(sought, through, -math.inf).max())
        if peak / deviation > best[0]:
            best = peak / deviation, through, peak
        spread *= 2.0
    snr, through, peak = best
    row, column = np.unravel_index(
        int(np.argmax(np.where(sought, through, -math.inf))), picture.shape
    )
    x = column + 0.5 + _vertex(through[row, max(column - 1, 0) : column + 2])
    y = row + 0.5 + _vertex(through[max(row - 1, 0) : row + 2, column])
    finest = cv2.GaussianBlur(flat, (0, 0), spread_pixels, borderType=cv2.BORDER_REFLECT)
    level = float(finest[row, column])
    pixels = int(np.count_nonzero(sought & (finest > 0.5 * level))) if level > 0.0 else 0
    return Spot(snr, x, y, pixels, level, behind, cluttered)


@cache
def _let_through(size: int, spread: float) -> float:
    """Return the deviation that a filter, less the rim's mean, makes of white noise of deviation 1.

    Of the filter as it is in pixels: by the formula for a continuous picture noise comes out as 1.1
    to 1.5 times what is expected, and a false alarm at 3 deviations is 14 times as likely.
    """
    point = np.zeros((size, size))
    point[size // 2, size // 2] = 1.0
    weight = opencv().GaussianBlur(point, (0, 0), spread, borderType=opencv().BORDER_REFLECT)
    rim = _rim(size)
    weight -= rim / np.count_nonzero(rim)
    return float(np.sqrt((weight**2).sum()))


@cache
def _rim(size: int) -> BoolArray:
    rim = np.ones((size, size), dtype=bool)
    rim[_RING:-_RING, _RING:-_RING] = False
    return rim


def _vertex(three: FloatArray) -> float:
    if len(three) < 3:
        return 0.0
    before, here, after = (float(v) for v in three)
    bend = before - 2.0 * here + after
    return 0.0 if bend >= 0.0 else max(-0.5, min(0.5, 0.5 * (before - after) / bend))


def spot_flow(
    earlier: FloatArray, later: FloatArray, spot: Spot, sought: BoolArray, reach: int
) -> tuple[float, float]:
    """Return how far the spot of the later picture has come since the earlier one, x and y, pixels.

    Only pixels of the spot and one beside it count, so that the flow is the target's, whatever the
    background does: first the whole pixel where they fit best, then Evangelidis and Psarakis's
    maximisation of the correlation (an iterated Lucas-Kanade step, IEEE PAMI 30(10), 2008). NaN
    where the spot is too small, or leaves the picture.
    """
    cv2 = opencv()
    nothing = (math.nan, math.nan)
    if spot.pixels < FEWEST_PIXELS or spot.level <= 0.0:
        return nothing
    size = later.shape[0]
    stands = (sought & (later - spot.behind > 0.5 * spot.level)).astype(np.uint8)
    _, labels = cv2.connectedComponents(stands, connectivity=8)
    mine = labels[min(int(spot.y), size - 1), min(int(spot.x), size - 1)]
    if mine == 0:
        return nothing
    mask = cv2.dilate((labels == mine).astype(np.uint8), np.ones((3, 3), np.uint8))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    first, second = earlier.astype(np.float32), later.astype(np.float32)
    part, weight = second[top:bottom, left:right], mask[top:bottom, left:right]
    apart = cv2.matchTemplate(first, part, cv2.TM_SQDIFF, mask=weight.astype(np.float32))
    near = apart[max(top - reach, 0) : top + reach + 1, max(left - reach, 0) : left + reach + 1]
    row, column = np.unravel_index(int(np.argmin(near)), near.shape)
    ahead = np.array([left - max(left - reach, 0) - column, top - max(top - reach, 0) - row])
    flow = ahead.astype(np.float64)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, _ITERATIONS, _STEP)
    soft = cv2.GaussianBlur(cv2.dilate(mask, _AROUND).astype(np.float32), (0, 0), _FADES)
    outside = 1.0 - cv2.dilate(mask, _AROUND).astype(np.float32)
    masks = np.dstack([soft, outside])
    for _ in range(_ROUNDS):
        # What is not the target fades out in both pictures, each about its own place of it.
        back = np.array([[1.0, 0.0, -flow[0]], [0.0, 1.0, -flow[1]]], dtype=np.float32)
        moved = cv2.warpAffine(masks, back, (size, size), borderValue=(0.0, 1.0, 0.0, 0.0))
        pair = []
        for frame, (share, beside) in (
            (first, np.moveaxis(moved, -1, 0)),
            (second, (soft, outside)),
        ):
            behind: Any = np.float32(spot.behind)
            if spot.cluttered:
                behind = _behind(frame, np.ascontiguousarray(beside), spot.behind)
            pair.append(cv2.GaussianBlur(frame - behind, (0, 0), _SMOOTH) * share)
        guess = np.array([[1.0, 0.0, flow[0]], [0.0, 1.0, flow[1]]], dtype=np.float32)
        try:
            _, found = cv2.findTransformECC(
                pair[0], pair[1], guess, cv2.MOTION_TRANSLATION, stop, None, 1
            )
        except cv2.error:  # it does not converge
            return nothing
        flow = found[:, 2].astype(np.float64)
    return (float(flow[0]), float(flow[1])) if np.hypot(*(flow - ahead)) < 2.0 else nothing


def _behind(frame: AnyArray, outside: AnyArray, level: float) -> AnyArray:
    """Return the background of a picture, carried on behind the target from what is beside it."""
    cv2 = opencv()
    weight = cv2.GaussianBlur(outside, (0, 0), _NEAR) + np.float32(_LITTLE)
    beside = cv2.GaussianBlur((frame - np.float32(level)) * outside, (0, 0), _NEAR)
    return beside / weight + np.float32(level)
