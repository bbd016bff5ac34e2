"""Silhouettes of bodies: projected areas, exact and as in the thesis, and convex outlines."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_angle_rad,
    check_not_negative,
    unflatten,
)
from components.geometry import sine_and_cosine
from dsa_des.arrays.column_values import first_row_if_stored_once
from dsa_des.arrays.types import FloatArray

if TYPE_CHECKING:
    from components.aircraft.aspect_tables import SilhouetteTable
    from components.optical.mesh import TriangleMesh


def line_of_sight_in_target_axes(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the unit line of sight in target axes (nose, right, down), and the sine off the nose.

    The line of sight runs from us to the target. Seen in a north-east-down frame turned so that
    its bearing is 0 it is (cos elevation, 0, -sin elevation); the target's yaw in that frame is
    its relative heading, and the rotation is yaw, pitch, roll (ZYX). Written out,

        u_x = cos(pitch) cos(yaw) cos(elevation) + sin(pitch) sin(elevation)
        m   = sin(pitch) cos(yaw) cos(elevation) - cos(pitch) sin(elevation)
        n   = sin(yaw) cos(elevation)
        u_y = sin(roll) m - cos(roll) n
        u_z = cos(roll) m + sin(roll) n

    m cancels when we look along the target's long axis, so it is evaluated as
    sin(pitch - elevation) - 2 sin(pitch) cos(elevation) sin²(yaw/2), or with the sum and the
    cosine when the target comes towards us. The sine of the angle off the nose, sqrt(m² + n²), then
    keeps full relative accuracy down to 0. The yaw's own sine and cosine are those of twice its
    half; of a flight that holds its pitch and roll these are taken once. Returned are the unit
    vector's components (u_x = 1 when the target flies straight away from us) and |x_body × u|, the
    sine of the angle off the nose. Replaces the small-angle subtraction of thesis eq. 6 (errata 4
    and 9).
    """
    half_yaw = 0.5 * relative_heading_rad
    sin_half, cos_half = np.sin(half_yaw), np.cos(half_yaw)
    sin_yaw = 2.0 * sin_half * cos_half
    cos_yaw = (cos_half - sin_half) * (cos_half + sin_half)
    sin_pitch, cos_pitch = sine_and_cosine(pitch_rad)
    sin_roll, cos_roll = sine_and_cosine(roll_rad)
    sin_elevation, cos_elevation = np.sin(elevation_rad), np.cos(elevation_rad)
    m = 0.0 - sin_elevation  # of one that flies level
    if first_row_if_stored_once(pitch_rad).any():
        leaving = cos_yaw >= 0.0
        tilt = np.sin(np.where(leaving, pitch_rad - elevation_rad, pitch_rad + elevation_rad))
        side = 2.0 * sin_pitch * cos_elevation
        m = np.where(leaving, tilt - side * np.square(sin_half), side * np.square(cos_half) - tilt)
    n = sin_yaw * cos_elevation

    u_x = cos_pitch * cos_yaw * cos_elevation + sin_pitch * sin_elevation
    u_y = sin_roll * m - cos_roll * n
    u_z = cos_roll * m + sin_roll * n
    return u_x, u_y, u_z, np.sqrt(m * m + n * n)


def blend_front_and_back_area(
    cos_off_nose: FloatArray, front_m2: FloatArray, back_m2: FloatArray
) -> FloatArray:
    """Return front and back area averaged by the cosine off the nose (thesis eq. 20-21, errata 12).

    (back - front)·(cos/2 + 1/2) + front: the back alone when the target flies away (cos = 1), the
    front alone when it comes head on (cos = -1). Written as a mean of the two so that it never
    leaves the interval between them by rounding.
    """
    share_of_back = np.clip(0.5 * cos_off_nose + 0.5, 0.0, 1.0)
    return back_m2 * share_of_back + front_m2 * (1.0 - share_of_back)


def exact_sum_of_body_areas(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
    front_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    back_m2: FloatArray | None,
) -> FloatArray:
    """Return the sum of the exact projected sphere, cylinder and plane areas (errata 9), m².

    front + side·|x_body × u| + horizontal·|u_z|, with u the line of sight in the target's body
    axes. With `back_m2` the sphere becomes the mix of eq. 20-21 with cos g = x_body·u.
    """
    u_x, _, u_z, sin_off_nose = line_of_sight_in_target_axes(
        relative_heading_rad, pitch_rad, roll_rad, elevation_rad
    )
    sphere = front_m2 if back_m2 is None else blend_front_and_back_area(u_x, front_m2, back_m2)
    return sphere + side_m2 * sin_off_nose + horizontal_m2 * np.abs(u_z)


# Assumption: the thesis gives the plate's area, not its shape. A rectangle three times as wide as
# deep makes the union 17-19 % smaller than the sum on average over all directions for the Beech 99
# and the Boeing 787 of Table 3.1, the range that errata 9 quotes.
PLATE_ASPECT_RATIO = 3.0

# Plates seen flatter than this, or bodies thinner, hide nothing that matters in a double.
_SMALLEST_PLATE_TILT = 1e-18
_SMALLEST_ROUND_M2 = 1e-30


def exact_area_of_bodies_union(
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
    """Return the exact silhouette of the union of the three bodies.

    The bodies are: a capsule along the x axis (cylinder of radius r = sqrt(front/pi) and length
    side/(2 r), closed by half spheres), which is its own convex hull; and a flat rectangle in the
    x-y plane, centred on the capsule, span = sqrt(horizontal · aspect ratio) along y. The
    silhouette is capsule + plate - overlap; the overlap of the two projections is a closed form
    (Notes), so nothing is rasterised and the result carries rounding errors only.

    With `back_m2` the radius follows eq. 21's mix for the direction looked along, the side area
    staying what it is. A front of 0 leaves no thickness to hide anything: the areas then add.

    Shadows along u on the body's x-y plane are an affine picture of the silhouette, with area
    factor |u_z|. There the plate is itself, and the capsule is an ellipse swept along x. For a
    strip at y = y_max·t the capsule covers x from -R(-t) to R(t), the plate from -chord/2 to
    chord/2, so the overlap is the integral of clip(R(t), ±chord/2) twice over; R is a straight
    line plus half an ellipse, which crosses each limit at most twice.
    """
    u_x, u_y, u_z, sin_off_nose = line_of_sight_in_target_axes(
        relative_heading_rad, pitch_rad, roll_rad, elevation_rad
    )
    round_m2 = front_m2 if back_m2 is None else blend_front_and_back_area(u_x, front_m2, back_m2)
    capsule_m2 = round_m2 + side_m2 * sin_off_nose
    plate_m2 = horizontal_m2 * np.abs(u_z)
    overlap_m2 = _overlap_area(
        np.abs(u_x * u_y),
        np.abs(u_z),
        sin_off_nose,
        round_m2,
        side_m2,
        horizontal_m2,
        plate_aspect_ratio,
    )
    return capsule_m2 + plate_m2 - np.clip(overlap_m2, 0.0, np.minimum(capsule_m2, plate_m2))


def _overlap_area(
    slant: FloatArray,
    tilt: FloatArray,
    sin_off_nose: FloatArray,
    round_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    plate_aspect_ratio: float,
) -> FloatArray:
    """Return the common area of capsule and plate projections, m²; slant |u_x u_y|, tilt |u_z|."""
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


def thesis_area(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
    front_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    back_m2: FloatArray | None,
) -> FloatArray:
    """Return the sum of the projected areas as in thesis eq. 9-13 (errata 4, 8, 12), m².

    With psi = relative heading, theta = elevation - pitch and phi = elevation - roll (eq. 6),

        shown = sqrt(sin² theta + cos² theta · sin² psi)          (eq. 12, its right-hand side)
        area  = front + side · shown + horizontal · |sin phi| · shown

    With `back_m2` the front becomes eq. 21's mix with cos psi. The plane is projected twice, as
    printed (eq. 13 put into eq. 12), and roll shares an axis with elevation only abeam: for
    attitudes other than level the exact model is the one to use. Magnitudes are taken, so the
    area is never negative.
    """
    theta_rad = elevation_rad - pitch_rad
    phi_rad = elevation_rad - roll_rad
    shown = np.hypot(np.sin(theta_rad), np.cos(theta_rad) * np.sin(relative_heading_rad))
    sphere = front_m2
    if back_m2 is not None:
        sphere = blend_front_and_back_area(np.cos(relative_heading_rad), front_m2, back_m2)
    return sphere + side_m2 * shown + horizontal_m2 * np.abs(np.sin(phi_rad)) * shown


MODELS = ("exact", "thesis", "aspect_table", "convex_hull")

_PARAMETRIC: dict[str, Callable[..., FloatArray]] = {
    "exact": exact_sum_of_body_areas,
    "thesis": thesis_area,
    "convex_hull": exact_area_of_bodies_union,
}


def visible_area(
    relative_heading_rad: ArrayLike,
    pitch_rad: ArrayLike,
    roll_rad: ArrayLike,
    elevation_rad: ArrayLike,
    *,
    front_m2: ArrayLike | None = None,
    side_m2: ArrayLike | None = None,
    horizontal_m2: ArrayLike | None = None,
    back_m2: ArrayLike | None = None,
    model: str = "exact",
    table: SilhouetteTable | None = None,
    mesh: TriangleMesh | None = None,
    validate: bool = True,
) -> Any:
    """Return the area of a target projected on the plane across the line of sight.

    All arrays broadcast together. What is computed, with u the unit vector of the line of sight
    from us to the target in the target's body axes (x nose, y right wing, z down):

    - ``exact``: front + side·|x × u| + horizontal·|u_z| (sphere, cylinder and plane each projected
      exactly, then added). With `back_m2` the sphere is (back - front)(cos g/2 + 1/2) + front,
      cos g = u_x. Nothing hides anything: the union of Table 3.1's aircraft is 13-19 % smaller
      on average over all directions.
    - ``thesis``: eq. 6 and 9-13 with errata 4, 8 and 12: small-angle aspect, the plane projected
      twice; for comparison with the thesis only.
    - ``convex_hull``: the exact silhouette of the union of the three bodies (capsule and plate, see
      `components.optical.silhouette`), or, with `mesh`, of a closed triangle mesh (see
      `components.optical.mesh` for how and how exactly).
    - ``aspect_table``: `table` interpolated at the observer's direction seen from the target.

    Thesis eq. 9-13 and 20-21; errata 4, 8, 9 and 12.
    """
    if not validate and model in _PARAMETRIC and mesh is None:
        arrays: Any = (relative_heading_rad, pitch_rad, roll_rad, elevation_rad)
        return _PARAMETRIC[model](*arrays, front_m2, side_m2, horizontal_m2, back_m2)
    angles: dict[str, FloatArray] = {
        "relative_heading_rad": check_angle_rad("relative_heading_rad", relative_heading_rad),
        "pitch_rad": check_angle_rad("pitch_rad", pitch_rad),
        "roll_rad": check_angle_rad("roll_rad", roll_rad),
        "elevation_rad": check_angle_rad("elevation_rad", elevation_rad),
    }
    if model not in MODELS:
        raise ValueError(f"model is {model!r}: it must be one of {', '.join(MODELS)}")
    if model == "aspect_table" or (model == "convex_hull" and mesh is not None):
        return _tabulated_or_mesh_area(angles, model, table, mesh)

    areas: dict[str, FloatArray] = {}
    for name, value in (
        ("front_m2", front_m2),
        ("side_m2", side_m2),
        ("horizontal_m2", horizontal_m2),
    ):
        if value is None:
            raise ValueError(f"{name} is missing: model {model!r} needs it, in square metres")
        areas[name] = check_not_negative(name, value)
    if back_m2 is not None:
        areas["back_m2"] = check_not_negative("back_m2", back_m2)
    shape, flat = broadcast_flat(**angles, **areas)
    heading, pitch, roll, elevation, front, side, horizontal = flat[:7]
    back = flat[7] if back_m2 is not None else None
    area = _PARAMETRIC[model](heading, pitch, roll, elevation, front, side, horizontal, back)
    return unflatten(area, shape)


def _tabulated_or_mesh_area(
    angles: dict[str, FloatArray],
    model: str,
    table: SilhouetteTable | None,
    mesh: TriangleMesh | None,
) -> Any:
    """Return the area from a silhouette table, or projected from a mesh."""
    shape, flat = broadcast_flat(**angles)
    u_x, u_y, u_z, _ = line_of_sight_in_target_axes(*flat)
    if mesh is not None and model == "convex_hull":
        return unflatten(mesh.projected_area(u_x, u_y, u_z), shape)
    if table is None:
        raise ValueError("table is None: model 'aspect_table' needs a SilhouetteTable")
    # The table is indexed by where the observer stands as seen from the target: -u.
    azimuth_rad = np.arctan2(-u_y, -u_x)
    elevation_rad = np.arctan2(u_z, np.hypot(u_x, u_y))
    return unflatten(table.area(azimuth_rad, elevation_rad), shape)
