"""The area of a target that a camera sees: one call, several rungs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, angle, broadcast_flat, not_negative, unflatten
from components.optical.convex_hull import union_area
from components.optical.silhouette_exact import exact_area, line_of_sight_in_target_axes
from components.optical.silhouette_thesis import thesis_area

if TYPE_CHECKING:
    from components.aircraft.aspect_tables import SilhouetteTable
    from components.optical.mesh import TriangleMesh

MODELS = ("exact", "thesis", "aspect_table", "convex_hull")

_PARAMETRIC: dict[str, Callable[..., FloatArray]] = {
    "exact": exact_area,
    "thesis": thesis_area,
    "convex_hull": union_area,
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
    """Give the area of a target projected on the plane across the line of sight.

    All arrays broadcast together. What is computed, with u the unit vector of the line of sight
    from us to the target in the target's body axes (x nose, y right wing, z down):

    - ``exact``: front + side·|x × u| + horizontal·|u_z| (sphere, cylinder and plane each projected
      exactly, then added). With `back_m2` the sphere is (back - front)(cos g/2 + 1/2) + front,
      cos g = u_x. Nothing hides anything: the union of Table 3.1's aircraft is 13-19 % smaller
      on average over all directions.
    - ``thesis``: eq. 6 and 9-13 with errata 4, 8 and 12: small-angle aspect, the plane projected
      twice; for comparison with the thesis only.
    - ``convex_hull``: the exact silhouette of the union of the three bodies (capsule and plate, see
      `components.optical.convex_hull`), or, with `mesh`, of a closed triangle mesh (see
      `components.optical.mesh` for how and how exactly).
    - ``aspect_table``: `table` interpolated at the observer's direction seen from the target.

    Parameters
    ----------
    relative_heading_rad : array_like, rad
        The target's heading minus the bearing of the line of sight from us to it: 0 when it flies
        away from us, pi when it comes towards us, pi/2 when it crosses to the right.
    pitch_rad, roll_rad : array_like, rad
        The target's own attitude (yaw-pitch-roll, ZYX): pitch is positive nose up, roll positive
        right wing down.
    elevation_rad : array_like, rad
        Elevation of the line of sight from us to the target, positive when it is above us.
    front_m2, side_m2, horizontal_m2 : array_like, m²
        Front sphere, side of the cylinder, horizontal planes (Table 3.1). Needed by every model
        but `aspect_table` and `convex_hull` with a mesh, which ignore them.
    back_m2 : array_like, m², optional
        Back sphere, for infrared (Table 3.2); equal to the front if not given.
    model : {"exact", "thesis", "aspect_table", "convex_hull"}
        Which rung.
    table : SilhouetteTable, optional
        For ``aspect_table``.
    mesh : TriangleMesh, optional
        For ``convex_hull``.
    validate : bool
        False skips the checks, for a caller that has flat contiguous arrays of one shape and knows
        the areas to be there.

    Returns
    -------
    array of the broadcast shape, m²
        Never negative.

    Raises
    ------
    ValueError
        If an argument is not finite, an area is negative, the model is unknown, or the model lacks
        its areas or its table.

    Notes
    -----
    Thesis eq. 9-13 and 20-21; errata 4, 8, 9 and 12.
    """
    if not validate and model in _PARAMETRIC and mesh is None:
        arrays: Any = (relative_heading_rad, pitch_rad, roll_rad, elevation_rad)
        return _PARAMETRIC[model](*arrays, front_m2, side_m2, horizontal_m2, back_m2)
    angles: dict[str, FloatArray] = {
        "relative_heading_rad": angle("relative_heading_rad", relative_heading_rad),
        "pitch_rad": angle("pitch_rad", pitch_rad),
        "roll_rad": angle("roll_rad", roll_rad),
        "elevation_rad": angle("elevation_rad", elevation_rad),
    }
    if model not in MODELS:
        raise ValueError(f"model is {model!r}: it must be one of {', '.join(MODELS)}")
    if model == "aspect_table" or (model == "convex_hull" and mesh is not None):
        return _measured_area(angles, model, table, mesh)

    areas: dict[str, FloatArray] = {}
    for name, value in (
        ("front_m2", front_m2),
        ("side_m2", side_m2),
        ("horizontal_m2", horizontal_m2),
    ):
        if value is None:
            raise ValueError(f"{name} is missing: model {model!r} needs it, in square metres")
        areas[name] = not_negative(name, value)
    if back_m2 is not None:
        areas["back_m2"] = not_negative("back_m2", back_m2)
    shape, flat = broadcast_flat(**angles, **areas)
    heading, pitch, roll, elevation, front, side, horizontal = flat[:7]
    back = flat[7] if back_m2 is not None else None
    area = _PARAMETRIC[model](heading, pitch, roll, elevation, front, side, horizontal, back)
    return unflatten(area, shape)


def _measured_area(
    angles: dict[str, FloatArray],
    model: str,
    table: SilhouetteTable | None,
    mesh: TriangleMesh | None,
) -> Any:
    """Look the area up in a table or project the mesh."""
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
