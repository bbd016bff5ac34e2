"""The ladders of cameras: how large a target looks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.optical.convex_hull import union_area
from components.sensor.ladder_values import over_cells
from components.sensor.look import Cells
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable
from dsa_des.block.wake import Wake

_AREA = Quantity("area", "m²")


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return the area a camera sees at every (scan, target), m².

    A range boundary sees none: it decides as a camera would whose every target shows the area that
    is just detected at the boundary. That area is taken, for the pixels, weights and threshold of
    the reference.
    """
    camera: Any = block
    if not hasattr(camera, "shown_area"):
        as_camera: Any = reference

        def values(cells: Cells) -> dict[str, FloatArray]:
            contrast = np.maximum(as_camera.contrast(cells), 1e-12)
            pixel_m2 = (
                camera.reach.range_max_m**2
                * as_camera.pixel_azimuth_rad
                * as_camera.pixel_elevation_rad
            )
            weight = as_camera.p.static_weight
            return {_AREA.name: pixel_m2 * as_camera.detector.threshold / (weight * contrast)}

    else:

        def values(cells: Cells) -> dict[str, FloatArray]:
            return {_AREA.name: camera.shown_area(cells)}

    return dict(over_cells(camera, wake, values))


def truth(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return the rounding errors of the union of the bodies, against extended precision."""
    if np.finfo(np.longdouble).eps >= np.finfo(np.float64).eps:
        raise Unavailable("not measured: this machine has no extended precision")
    camera: Any = block
    if getattr(camera.p, "silhouette", "") != "convex_hull" or camera.built("area"):
        raise Unavailable("nothing more exact is known")

    def values(cells: Cells) -> dict[str, FloatArray]:
        roster = cells.roster
        names = ["front_m2", "side_m2", "horizontal_m2"]
        names += ["back_m2"] if camera.areas == "ir" else []
        angles = (
            cells.relative_heading_rad,
            cells.target_pitch_rad,
            cells.target_roll_rad,
            cells.elevation_rad,
        )
        bodies = [cells.of_target(roster.column(f"{camera.areas}.{name}")) for name in names]
        wide = [array.astype(np.longdouble) for array in (*angles, *bodies)]
        areas: Any = (*wide, None)[:8]
        exact = union_area(*areas)
        error = np.abs(camera.shown_area(cells).astype(np.longdouble) - exact)
        return {_AREA.name: error.astype(np.float64)}

    found = over_cells(camera, wake, values)
    return {_AREA.name: found[_AREA.name][cells[:, 0], cells[:, 1]]}


def _ladder(band: str, type_name: str) -> Ladder:
    def silhouette(name: str) -> Mapping[str, Any]:
        return {"silhouette": name}

    return Ladder(
        "silhouette",
        (
            Rung("range_boundary", "all inside 3 km (TECVOL, section 2.3.1)",
                 "optical.range_boundary", {"range_km": 3.0}),
            Rung("projection", "a line: size, range, colour (section 2.2.2)",
                 "optical.projection", {"band": band}),
            Rung("thesis", "thesis eq. 9-13", type_name, silhouette("thesis")),
            Rung("exact", "sum of the three bodies, each exact", type_name, silhouette("exact")),
            Rung("sampled_table", "the union in a table of 5 degrees", type_name,
                 silhouette("sampled_table")),
            Rung("aspect_table", "each aircraft's measured silhouette_table", type_name,
                 silhouette("aspect_table")),
            Rung("mesh", "a mesh of the three bodies, projected", type_name, silhouette("mesh")),
            Rung("union", "union of the three bodies, closed form", type_name,
                 silhouette("convex_hull")),
        ),
        "union",
        (_AREA,),
        measure,
        truth,
        clears=("model",),
    )  # fmt: skip


VISIBLE = _ladder("eo", "optical.eo")
INFRARED = _ladder("ir", "optical.ir")
