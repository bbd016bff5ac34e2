"""Pictures of targets, pixel by pixel: outlines, exact coverage of pixels, a drawn background.

Pixels are counted from the upper left corner of the frame: pixel (row, column) covers
[column, column + 1] x [row, row + 1]. Pure functions; they know neither cameras nor OpenCV.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import check_finite
from components.geometry import body_to_ned, unit_vector_unchecked
from components.optical.silhouette import PLATE_ASPECT_RATIO
from dsa_des.arrays.types import FloatArray, IntArray

_SIDES = 32
# Edges that are steeper than this across a row are taken at their middle: wrong by less than 1e-7.
_STEEP = 1e-6
# Pixels times edges that are worked on together: they stay in the cache.
_AT_ONCE = 2**17
#: A picture that turns farther from the optical axis than this has no plane to be drawn on.
WIDEST_RAD = math.radians(170.0)


@dataclass(frozen=True)
class Pinhole:
    """A plane picture: straight lines stay straight, and pixels off the axis see less.

    The field of view is `width_rad` across, and from the lower to the upper `elevation_rad` at its
    middle column. The optical axis lies at `azimuth_rad` in the sensor's axes and in `axis_column`,
    by default the middle of the frame.
    """

    width_rad: float
    elevation_rad: tuple[float, float]
    columns: int
    rows: int
    azimuth_rad: float = 0.0
    axis_column: float | None = None

    def __post_init__(self) -> None:
        low, high = self.elevation_rad
        if not (0.0 < self.width_rad <= WIDEST_RAD and -1.5 < low < high < 1.5):
            raise ValueError(
                f"the field of view is {math.degrees(self.width_rad):g} deg wide and reaches from "
                f"{math.degrees(low):g} to {math.degrees(high):g} deg: a plane picture needs at "
                f"most {math.degrees(WIDEST_RAD):g} deg across, within 85 deg up and down; use "
                "several cameras, each with a mounting"
            )

    @classmethod
    def from_intrinsics(
        cls,
        focal_px: tuple[float, float],
        principal_px: tuple[float, float],
        columns: int,
        rows: int,
    ) -> Pinhole:
        """Return the picture from focal lengths and principal point, each (column, row), pixels.

        The optical axis is the first of the sensor's axes; the principal point may lie anywhere.
        """
        (across, upward), (column, row) = focal_px, principal_px
        if not (across > 0.0 and upward > 0.0):
            raise ValueError(f"focal_px is {across:g} and {upward:g}: both must be above 0")
        edges = math.atan((row - rows) / upward), math.atan(row / upward)
        return cls(2.0 * math.atan(0.5 * columns / across), edges, columns, rows, 0.0, column)

    @property
    def middle_column(self) -> float:
        """Column coordinate of the optical axis, pixels."""
        return 0.5 * self.columns if self.axis_column is None else self.axis_column

    @property
    def focal_pixels(self) -> tuple[float, float]:
        """Focal length in pixels along columns and along rows."""
        low, high = self.elevation_rad
        across = 2.0 * math.tan(0.5 * self.width_rad)
        return self.columns / across, self.rows / (math.tan(high) - math.tan(low))

    def pixel(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> tuple[Any, Any]:
        """Return the picture's (column, row) of directions in sensor axes; NaN if behind."""
        turned = np.asarray(azimuth_rad) - self.azimuth_rad
        ahead = np.cos(turned)
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.where(ahead > 1e-9, np.tan(turned), np.nan)
            upward = np.where(ahead > 1e-9, np.tan(elevation_rad) / ahead, np.nan)
        focal_x, focal_y = self.focal_pixels
        return self.middle_column + focal_x * across, (
            focal_y * (math.tan(self.elevation_rad[1]) - upward)
        )

    def direction(self, column: ArrayLike, row: ArrayLike) -> tuple[Any, Any]:
        """Return azimuth and elevation (rad) in sensor axes of what is at picture positions."""
        focal_x, focal_y = self.focal_pixels
        across = (np.asarray(column) - self.middle_column) / focal_x
        upward = math.tan(self.elevation_rad[1]) - np.asarray(row) / focal_y
        return self.azimuth_rad + np.arctan(across), np.arctan2(upward, np.hypot(1.0, across))

    def is_in_frame(self, column: FloatArray, row: FloatArray) -> Any:
        """Return a mask of the picture positions (True) that lie inside the frame."""
        return (column >= 0) & (column <= self.columns) & (row >= 0) & (row <= self.rows)


def capsule_and_plate_outlines(
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    range_m: FloatArray,
    attitude_rad: tuple[FloatArray, FloatArray, FloatArray],
    bodies_m2: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return targets' capsule and plate outlines as unit vectors in north-east-down axes.

    Shapes (n, points, 3); the bodies are those of
    `components.optical.silhouette.exact_area_of_bodies_union`, with front, side and horizontal
    areas. A circle is drawn as a polygon of its area. The outline lies in the plane across the
    line of sight through the target's middle: what perspective adds is the ratio of the target's
    size to its range, of a picture point's distance from the middle.
    """
    front, side, flat = bodies_m2
    along = np.stack(unit_vector_unchecked(azimuth_rad, elevation_rad), axis=-1)
    right = np.stack([-np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0 * azimuth_rad], axis=-1)
    down = np.cross(along, right)
    nose, wing = (
        np.stack(body_to_ned(*axis, *attitude_rad), axis=-1)
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    )

    def seen(axis: FloatArray) -> FloatArray:
        return np.stack([(axis * right).sum(axis=-1), (axis * down).sum(axis=-1)], axis=-1)

    nose_2, wing_2 = seen(nose), seen(wing)
    radius = np.sqrt(front / math.pi)
    half = 0.25 * side / np.where(radius > 0.0, radius, np.inf)
    wider = radius * math.sqrt((math.pi / _SIDES) / math.sin(math.pi / _SIDES))
    wider *= 1.0 / math.sqrt(math.cos(math.pi / _SIDES))
    # Half a circle at either end of the capsule, beginning across its axis.
    turn = np.arctan2(nose_2[:, 1], nose_2[:, 0])[:, np.newaxis]
    around = np.linspace(-0.5 * math.pi, 0.5 * math.pi, _SIDES // 2 + 1)
    around = np.concatenate([around, around + math.pi]) + turn
    end = np.repeat([1.0, -1.0], _SIDES // 2 + 1)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    capsule = circle * wider[:, np.newaxis, np.newaxis]
    capsule += (end[:, np.newaxis] * half[:, np.newaxis, np.newaxis]) * nose_2[:, np.newaxis]
    span = np.sqrt(flat * PLATE_ASPECT_RATIO)
    chord = flat / np.where(span > 0.0, span, np.inf)
    signs = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    plate = (
        signs[:, :1] * (0.5 * chord[:, np.newaxis] * nose_2)[:, np.newaxis]
        + signs[:, 1:] * (0.5 * span[:, np.newaxis] * wing_2)[:, np.newaxis]
    )
    found = []
    for outline in (capsule, plate):
        at = outline[..., :1] * right[:, np.newaxis] + outline[..., 1:] * down[:, np.newaxis]
        at = at + (range_m[:, np.newaxis] * along)[:, np.newaxis]
        found.append(at / np.linalg.norm(at, axis=-1, keepdims=True))
    return found[0], found[1]


def polygon_intersection(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the corners of two convex polygons' intersection, (n, 2); empty if none."""
    sense = np.sign(_cross(other[1] - other[0], other[2] - other[0])) if len(other) > 2 else 0.0
    if sense == 0.0:
        return np.empty((0, 2))
    kept = one
    for start, end in zip(other, np.roll(other, -1, axis=0), strict=True):
        if len(kept) == 0:
            break
        inside = sense * _cross(end - start, kept - start)
        # As np.roll by one does, in a fraction of its time.
        following = np.concatenate([kept[1:], kept[:1]])
        after = np.concatenate([inside[1:], inside[:1]])
        crosses = (inside >= 0.0) != (after >= 0.0)
        share = inside / np.where(crosses, inside - after, 1.0)
        met = kept + share[:, np.newaxis] * (following - kept)
        both = np.stack([kept, met], axis=1).reshape(-1, 2)
        kept = both[np.stack([inside >= 0.0, crosses], axis=1).reshape(-1)]
    return kept


def _cross(a: FloatArray, b: FloatArray) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def polygon_pixel_shares(
    corners: FloatArray, rows: int, columns: int
) -> Iterator[tuple[tuple[slice, slice], FloatArray]]:
    """Yield each polygon's bounding box in the picture and the share of each pixel it covers.

    Exact to 1e-7. Each edge's part of a row hides what lies to the right of it: the mean, over that
    part, of the share of the pixel right of the edge is that of a clipped line, in closed form
    (Green's theorem, pixel by pixel). Corners, x to the right and y down in pixels, are those of
    any simple polygon, in either sense.
    """
    corners = np.asarray(check_finite("corners", corners))
    count, edges = corners.shape[:2]
    if edges < 3:
        return
    low = np.clip(np.floor(corners.min(axis=1)), 0, (columns, rows)).astype(np.int64)
    high = np.clip(np.ceil(corners.max(axis=1)), 0, (columns, rows)).astype(np.int64)
    width, height = (high - low).max(axis=0).tolist()
    at_once = max(1, _AT_ONCE // max(1, width * height * edges))
    for first in range(0, count, at_once):
        several = slice(first, first + at_once)
        x0, y0 = np.moveaxis(corners[several] - low[several, np.newaxis], -1, 0)
        x1, y1 = np.roll(x0, -1, axis=1), np.roll(y0, -1, axis=1)
        row = np.arange(height)[:, np.newaxis]
        top, bottom = (np.clip(y[:, np.newaxis], row, row + 1.0) for y in (y0, y1))
        # Few edges pass through a row; the others hide nothing there.
        polygon, met, edge = np.nonzero(bottom != top)
        top, bottom = top[polygon, met, edge], bottom[polygon, met, edge]
        x0, x1, y0, y1 = (each[polygon, edge] for each in (x0, x1, y0, y1))
        slope = (x1 - x0) / (y1 - y0)
        right = np.arange(1.0, width + 1.0)[:, np.newaxis]
        begin, end = right - (x0 + slope * (top - y0)), right - (x0 + slope * (bottom - y0))
        wide = end - begin
        steep = np.abs(wide) < _STEEP
        mean = np.where(
            steep,
            np.clip(0.5 * (begin + end), 0.0, 1.0),
            (_clipped_ramp_integral(end) - _clipped_ramp_integral(begin))
            / np.where(steep, 1.0, wide),
        )
        # Edges are summed up in their order, whatever their number in a row.
        hidden = np.zeros((len(corners[several]), width, height, edges))
        hidden[polygon, :, met, edge] = (mean * (bottom - top)).T
        shares = np.clip(np.abs(hidden.sum(axis=-1)), 0.0, 1.0)
        for share, (left, above), (beyond, below) in zip(
            shares, low[several].tolist(), high[several].tolist(), strict=True
        ):
            box = slice(above, below), slice(left, beyond)
            yield box, share[: beyond - left, : below - above].T


def _clipped_ramp_integral(u: FloatArray) -> FloatArray:
    """Return the integral from 0 to u of a line clipped to [0, 1]."""
    inner = np.clip(u, 0.0, 1.0)
    result: FloatArray = 0.5 * inner * inner + np.maximum(u - 1.0, 0.0)
    return result


def union_coverage(
    outlines: Sequence[FloatArray], rows: int, columns: int, smear: FloatArray
) -> FloatArray:
    """Return pixels' mean share in either of two convex outlines over exposure, (rows, columns).

    `smear` is how far they move meanwhile (x, y), pixels, half before and half after; the mean of
    so many exact pictures that the outline moves at most a quarter of a pixel between them, of 64
    beyond 16 pixels.
    """
    one, other = outlines
    parts = ((1.0, one), (1.0, other), (-1.0, polygon_intersection(one, other)))
    steps = min(64, 1 + math.ceil(4.0 * float(np.hypot(*smear))))
    moved = ((np.arange(steps) + 0.5) / steps - 0.5)[:, np.newaxis, np.newaxis] * smear
    drawn = [
        (sign, polygon_pixel_shares(part + moved, rows, columns))
        for sign, part in parts
        if len(part) > 2
    ]
    total: FloatArray = np.zeros((rows, columns))
    for boxes in zip(*(covered for _, covered in drawn), strict=True):
        for (sign, _), (box, share) in zip(drawn, boxes, strict=True):
            total[box] += sign * share
    return np.clip(total / steps, 0.0, 1.0)


def grey_levels(picture: FloatArray, most: int) -> Any:
    """Return a patch as 8-bit grey levels, with at most `most` pixels along a side."""
    largest = max(float(np.abs(picture).max()), 1e-12)
    grey = np.clip(128.0 - 120.0 * picture / largest, 0.0, 255.0).astype(np.uint8)
    step = max(1, math.ceil(len(grey) / most))
    return grey[::step, ::step]


def patch_azimuths_elevations(
    middle: FloatArray, right: FloatArray, down: FloatArray, offset: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a square patch's pixel azimuths and elevations, interpolated linearly, rad.

    They are those in its middle, and one patch to the right and down; `offset` (side,) is how far a
    row or column is from the middle, in patches.
    """
    turn = np.array([right - middle, down - middle])
    turn[:, 0] = np.remainder(turn[:, 0] + np.pi, 2.0 * np.pi) - np.pi
    azimuth, elevation = (
        middle[i] + offset * turn[0, i] + offset[:, np.newaxis] * turn[1, i] for i in (0, 1)
    )
    return azimuth, elevation


def textured_background(
    normal: Callable[[IntArray, IntArray], FloatArray],
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    grain_rad: float,
) -> FloatArray:
    """Return patch texture, random, mean 0, standard deviation 1, fixed to north-east-down axes.

    Normal draws on a lattice of azimuth and elevation, smoothly interpolated (value noise) and
    scaled to the same variance everywhere. `normal` gives the draw of a lattice point by its two
    whole numbers, of azimuth and elevation, 0 or more; neighbours across north meet.
    """
    around = max(4, round(2.0 * math.pi / grain_rad))
    at = np.stack([
        np.mod(azimuth_rad, 2.0 * math.pi) * (around / (2.0 * math.pi)),
        (elevation_rad + math.pi) / grain_rad,
    ])  # fmt: skip
    first = np.floor(at).astype(np.int64)
    fine = at - first
    weight = fine * fine * (3.0 - 2.0 * fine)
    total, square = np.zeros(at.shape[1:]), np.zeros(at.shape[1:])
    # Few lattice points lie under a patch: each is drawn once.
    points = np.stack([
        np.stack([(first[0] + i) % around, first[1] + j]) for i in (0, 1) for j in (0, 1)
    ])  # fmt: skip
    code = points[:, 0] * 2**31 + points[:, 1]
    known, place = np.unique(code, return_inverse=True)
    drawn = normal(known // 2**31, known % 2**31)[place.reshape(code.shape)]
    for number, (i, j) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        share = (weight[0] if i else 1.0 - weight[0]) * (weight[1] if j else 1.0 - weight[1])
        total += share * drawn[number]
        square += share * share
    return np.asarray(total / np.sqrt(square))
