"""The area that each target of a camera's cells shows: by its size, table or mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.aircraft.aspect_tables import SilhouetteTable
from components.optical.infrared_area import infrared_area
from components.optical.mesh import TriangleMesh
from components.optical.silhouette import (
    PLATE_ASPECT_RATIO,
    exact_area_of_bodies_union,
    visible_area,
)
from components.sensor.look import Cells, aspect_pitch_roll_elevation_rad
from dsa_des.arrays.types import FloatArray


def aspect_tables_of_targets(roster: Roster, path: str) -> list[Any]:
    """Return every target's own silhouette table, one per target; ValueError if one has none."""
    tables, place = roster.tables(path)
    missing = np.flatnonzero(place < 0)
    if missing.size:
        name = roster.names[missing[0]]
        more = f" (and of {missing.size - 1} more)" if missing.size > 1 else ""
        raise ValueError(
            f"{path} of target {name!r}{more} is None: silhouette 'aspect_table' needs a table of "
            "every target"
        )
    return [tables[index] for index in place]


def area_by_table(cells: Cells, of_target: Mapping[str, Sequence[Any]], model: str) -> FloatArray:
    """Return each cell's area from its target's silhouette table or mesh, m²."""
    ((kind, measured),) = of_target.items()
    distinct = list({id(item): item for item in measured}.values())
    which = np.array([next(i for i, d in enumerate(distinct) if d is m) for m in measured])
    area = np.empty(len(cells))
    for index, item in enumerate(distinct):
        chosen = np.flatnonzero(which[cells.craft] == index)
        area[chosen] = visible_area(
            *aspect_pitch_roll_elevation_rad(cells, chosen),
            model=model,
            **{kind: item},
        )
    return area


STEP_DEG = 5.0

# A plate must be a body to be meshed; one millimetre adds less than 0.02 m² edge-on.
_PLATE_THICKNESS_M = 1e-3
_SIDES, _RINGS = 16, 4
MESH_ROWS = 64


@lru_cache(maxsize=256)
def silhouette_table_of_bodies(
    front_m2: float, side_m2: float, horizontal_m2: float, back_m2: float | None = None
) -> SilhouetteTable:
    """Return the three bodies' united silhouette area, every 5 degrees of azimuth, elevation."""
    azimuth_deg = np.arange(0.0, 360.0, STEP_DEG)
    elevation_deg = np.linspace(-90.0, 90.0, round(180.0 / STEP_DEG) + 1)
    azimuth, elevation = (grid.reshape(-1) for grid in np.meshgrid(azimuth_deg, elevation_deg))
    level = np.zeros_like(azimuth)

    def filled(value: float) -> FloatArray:
        return np.full_like(azimuth, value)

    # An observer who stands at this azimuth and elevation of a level target looks along the
    # opposite direction: at minus his elevation, and nose-on is a relative heading of pi.
    area = exact_area_of_bodies_union(
        np.pi - np.radians(azimuth), level, level, -np.radians(elevation),
        filled(front_m2), filled(side_m2), filled(horizontal_m2),
        None if back_m2 is None else filled(back_m2),
    )  # fmt: skip
    return SilhouetteTable(
        azimuth_deg, elevation_deg, area.reshape(elevation_deg.size, azimuth_deg.size)
    )


@lru_cache(maxsize=64)
def capsule_and_plate_mesh(front_m2: float, side_m2: float, horizontal_m2: float) -> TriangleMesh:
    """Return a closed triangle mesh of the capsule and the plate that have these areas."""
    if min(front_m2, side_m2, horizontal_m2) <= 0.0:
        raise ValueError("an aircraft without front, side or horizontal area has no mesh")
    bodies = [
        _capsule_vertices_and_faces(front_m2, side_m2),
        _plate_vertices_and_faces(horizontal_m2),
    ]
    count = len(bodies[0][0])
    vertices = np.concatenate([vertices for vertices, _ in bodies])
    return TriangleMesh(vertices, np.concatenate([bodies[0][1], bodies[1][1] + count]), MESH_ROWS)


def _capsule_vertices_and_faces(front_m2: float, side_m2: float) -> tuple[FloatArray, np.ndarray]:
    """Return vertices and faces of a capsule along the x axis."""
    radius = np.sqrt(front_m2 / np.pi)
    half_length = side_m2 / (4.0 * radius)
    turn = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    wider = radius * np.sqrt((2.0 * np.pi / _SIDES) / np.sin(2.0 * np.pi / _SIDES))
    tilts = 0.5 * np.pi * np.arange(1, _RINGS + 1) / _RINGS
    front = [(half_length + radius * np.cos(t), wider * np.sin(t)) for t in tilts]
    rings = front + [(-x, r) for x, r in reversed(front)]
    points = [[half_length + radius, 0.0, 0.0]]
    points += [[x, r * np.cos(a), r * np.sin(a)] for x, r in rings for a in turn]
    points.append([-half_length - radius, 0.0, 0.0])
    faces = []
    last = len(points) - 1
    for side in range(_SIDES):
        beside = (side + 1) % _SIDES
        faces += [[0, 1 + side, 1 + beside], [last, last - _SIDES + beside, last - _SIDES + side]]
        for ring in range(len(rings) - 1):
            here, there = 1 + ring * _SIDES, 1 + (ring + 1) * _SIDES
            faces.append([here + side, there + side, there + beside])
            faces.append([here + side, there + beside, here + beside])
    return np.array(points), np.array(faces)


def _plate_vertices_and_faces(horizontal_m2: float) -> tuple[FloatArray, np.ndarray]:
    span = np.sqrt(horizontal_m2 * PLATE_ASPECT_RATIO)
    half = 0.5 * np.array([horizontal_m2 / span, span, _PLATE_THICKNESS_M])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    return signs * half, np.array(corners)


# Cells worked on together, so that what is in flight stays in the processor's cache.
CELLS_AT_ONCE = 8192

_BODIES = ("front_m2", "side_m2", "horizontal_m2")


def check_silhouette(roster: Roster, band: str, silhouette: str) -> None:
    """Raise ValueError if a target lacks what the camera's kind of silhouette needs."""
    if silhouette == "aspect_table":
        aspect_tables_of_targets(roster, f"{band}.silhouette_table")
    elif silhouette == "mesh":
        for name, craft in zip(roster.names, roster.aircraft, strict=True):
            of: Any = getattr(craft, band)
            for key in _BODIES:
                if getattr(of, key) <= 0.0:
                    raise ValueError(
                        f"{band}.{key} of target {name!r} is 0: silhouette 'mesh' needs every body"
                    )
            if band == "ir" and of.back_m2 != of.front_m2:
                raise ValueError(
                    f"target {name!r} has ir.back_m2 {of.back_m2:g} and ir.front_m2 "
                    f"{of.front_m2:g}: silhouette 'mesh' needs them alike, a mesh has one shape"
                )


def area_fit_warnings(roster: Roster, band: str, silhouette: str) -> list[str]:
    """Return a warning in a list if areas fitted for the union are used with single bodies."""
    if silhouette not in ("exact", "thesis"):
        return []
    names = [
        name
        for name, craft in zip(roster.names, roster.aircraft, strict=True)
        if getattr(craft, band).made_for is not None
    ]
    if not names:
        return []
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return [
        f"the areas of {names[0]!r}{more} were fitted for silhouette 'convex_hull' and silhouette "
        f"is {silhouette!r}: from above and below they show too much"
    ]


def area_of_cells(cells: Cells, band: str, silhouette: str) -> FloatArray:
    """Return the silhouette area of each cell's target by the given model, m²."""
    if silhouette == "aspect_table":
        tables = aspect_tables_of_targets(cells.roster, f"{band}.silhouette_table")
        return area_by_table(cells, {"table": tables}, "aspect_table")
    names = (*_BODIES, "back_m2") if band == "ir" else _BODIES
    areas = {name: cells.roster.column(f"{band}.{name}") for name in names}
    if silhouette == "sampled_table":
        tables = [
            silhouette_table_of_bodies(*map(float, row))
            for row in zip(*areas.values(), strict=True)
        ]
        return area_by_table(cells, {"table": tables}, "aspect_table")
    if silhouette == "mesh":
        check_silhouette(cells.roster, band, silhouette)
        bodies = zip(*(areas[key] for key in _BODIES), strict=True)
        meshes = [capsule_and_plate_mesh(*map(float, body)) for body in bodies]
        return area_by_table(cells, {"mesh": meshes}, "convex_hull")
    compute: Any = infrared_area if band == "ir" else visible_area
    view = aspect_pitch_roll_elevation_rad(cells)
    shown = {name: cells.column_at_targets(column) for name, column in areas.items()}
    if len(cells) <= CELLS_AT_ONCE:
        small: FloatArray = compute(*view, model=silhouette, validate=False, **shown)
        return small
    area = np.empty(len(cells))
    for start in range(0, len(cells), CELLS_AT_ONCE):
        block = slice(start, start + CELLS_AT_ONCE)
        area[block] = compute(
            *(angle[block] for angle in view),
            model=silhouette,
            validate=False,
            **{name: values[block] for name, values in shown.items()},
        )
    return area
