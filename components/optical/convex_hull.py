"""The silhouette area of fuselage and wing together, where one hides the other."""

from __future__ import annotations

import numpy as np

from components.arguments.checks import FloatArray
from components.optical.silhouette_exact import front_and_back_area, line_of_sight_in_target_axes

# Assumption: the thesis gives the plate's area, not its shape. A rectangle three times as wide as
# deep makes the union 17-19 % smaller than the sum on average over all directions for the Beech 99
# and the Boeing 787 of Table 3.1, the range that errata 9 quotes.
PLATE_ASPECT_RATIO = 3.0

# Plates seen flatter than this, or bodies thinner, hide nothing that matters in a double.
_SMALLEST_PLATE_TILT = 1e-18
_SMALLEST_ROUND_M2 = 1e-30


def union_area(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
    front_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    back_m2: FloatArray | None,
    plate_aspect_ratio: float = PLATE_ASPECT_RATIO,
) -> FloatArray:
    """Give the exact silhouette of the union of the three bodies.

    The bodies are: a capsule along the x axis (cylinder of radius r = sqrt(front/pi) and length
    side/(2 r), closed by half spheres), which is its own convex hull; and a flat rectangle in the
    x-y plane, centred on the capsule, span = sqrt(horizontal · aspect ratio) along y. The
    silhouette is capsule + plate - overlap; the overlap of the two projections is a closed form
    (Notes), so nothing is rasterised and the result carries rounding errors only.

    With `back_m2` the radius follows eq. 21's mix for the direction looked along, the side area
    staying what it is. A front of 0 leaves no thickness to hide anything: the areas then add.

    Parameters
    ----------
    relative_heading_rad, pitch_rad, roll_rad, elevation_rad : flat arrays, rad
    front_m2, side_m2, horizontal_m2, back_m2 : flat arrays, m²
    plate_aspect_ratio : float
        Span over chord of the plate.

    Returns
    -------
    flat array, m²

    Notes
    -----
    Shadows along u on the body's x-y plane are an affine picture of the silhouette, with area
    factor |u_z|. There the plate is itself, and the capsule is an ellipse swept along x. For a
    strip at y = y_max·t the capsule covers x from -R(-t) to R(t), the plate from -chord/2 to
    chord/2, so the overlap is the integral of clip(R(t), ±chord/2) twice over; R is a straight
    line plus half an ellipse, which crosses each limit at most twice.
    """
    u_x, u_y, u_z, sin_off_nose = line_of_sight_in_target_axes(
        relative_heading_rad, pitch_rad, roll_rad, elevation_rad
    )
    round_m2 = front_m2 if back_m2 is None else front_and_back_area(u_x, front_m2, back_m2)
    capsule_m2 = round_m2 + side_m2 * sin_off_nose
    plate_m2 = horizontal_m2 * np.abs(u_z)
    overlap_m2 = _overlap(
        np.abs(u_x * u_y),
        np.abs(u_z),
        sin_off_nose,
        round_m2,
        side_m2,
        horizontal_m2,
        plate_aspect_ratio,
    )
    return capsule_m2 + plate_m2 - np.clip(overlap_m2, 0.0, np.minimum(capsule_m2, plate_m2))


def _overlap(
    slant: FloatArray,
    tilt: FloatArray,
    sin_off_nose: FloatArray,
    round_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    plate_aspect_ratio: float,
) -> FloatArray:
    """Integrate what the capsule and the plate cover twice; slant = |u_x u_y|, tilt = |u_z|."""
    # Where nothing can overlap, harmless stand-ins keep the arithmetic finite.
    overlaps = (
        (tilt > _SMALLEST_PLATE_TILT) & (round_m2 > _SMALLEST_ROUND_M2) & (horizontal_m2 > 0.0)
    )
    tilt = np.where(overlaps, tilt, 1.0)
    across = np.where(overlaps, sin_off_nose, 1.0)
    radius = np.sqrt(np.where(overlaps, round_m2, 1.0) / np.pi)
    plate = np.where(overlaps, horizontal_m2, 1.0)
    span = np.sqrt(plate * plate_aspect_ratio)
    half_chord = 0.5 * across * np.sqrt(plate / plate_aspect_ratio)
    half_length = 0.25 * across * side_m2 / radius

    # t = sin(q): the edge is R = shear·sin q + radius·cos q + half_length, for |q| <= q_end.
    shear = slant * radius / tilt
    t_end = np.minimum(1.0, span * tilt / (2.0 * radius * across))
    q_end = np.arcsin(t_end)
    amplitude = np.hypot(shear, radius)
    q_peak = np.arctan2(shear, radius)

    def integral(q: FloatArray) -> FloatArray:
        sin_q = np.sin(q)
        return (
            0.5 * shear * sin_q * sin_q
            + 0.5 * radius * (q + sin_q * np.cos(q))
            + half_length * sin_q
        )

    def where_edge_exceeds(level: FloatArray) -> tuple[FloatArray, FloatArray]:
        half_width = np.arccos(np.clip((level - half_length) / amplitude, -1.0, 1.0))
        return (
            np.clip(q_peak - half_width, -q_end, q_end),
            np.clip(q_peak + half_width, -q_end, q_end),
        )

    full_start, full_end = where_edge_exceeds(half_chord)
    some_start, some_end = where_edge_exceeds(-half_chord)
    clipped_high = half_chord * (np.sin(full_end) - np.sin(full_start))
    clipped_low = half_chord * (2.0 * t_end - (np.sin(some_end) - np.sin(some_start)))
    between = (integral(some_end) - integral(full_end)) + (
        integral(full_start) - integral(some_start)
    )
    area = 2.0 * radius * (clipped_high + between - clipped_low)
    return np.where(overlaps, area, 0.0)
