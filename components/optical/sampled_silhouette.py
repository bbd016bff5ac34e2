"""Silhouettes of the three bodies by other means: a table sampled from them, a mesh of them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from components.aircraft.aspect_tables import SilhouetteTable
from components.arguments.checks import FloatArray
from components.optical.convex_hull import PLATE_ASPECT_RATIO, union_area
from components.optical.mesh import TriangleMesh

STEP_DEG = 5.0

# A plate must be a body to be meshed; one millimetre adds less than 0.02 m² edge-on.
_PLATE_THICKNESS_M = 1e-3
_SIDES, _RINGS = 16, 4
MESH_ROWS = 64


@lru_cache(maxsize=256)
def sampled_table(
    front_m2: float, side_m2: float, horizontal_m2: float, back_m2: float | None = None
) -> SilhouetteTable:
    """Return the silhouette of the union of the three bodies at every 5 degrees of aspect.

    Parameters
    ----------
    front_m2, side_m2, horizontal_m2, back_m2
        As for `components.optical.silhouette.visible_area`.

    Returns
    -------
    SilhouetteTable
        Bilinear between its nodes.
    """
    azimuth_deg = np.arange(0.0, 360.0, STEP_DEG)
    elevation_deg = np.linspace(-90.0, 90.0, round(180.0 / STEP_DEG) + 1)
    azimuth, elevation = (grid.reshape(-1) for grid in np.meshgrid(azimuth_deg, elevation_deg))
    level = np.zeros_like(azimuth)

    def filled(value: float) -> FloatArray:
        return np.full_like(azimuth, value)

    # An observer who stands at this azimuth and elevation of a level target looks along the
    # opposite direction: at minus his elevation, and nose-on is a relative heading of pi.
    area = union_area(
        np.pi - np.radians(azimuth), level, level, -np.radians(elevation),
        filled(front_m2), filled(side_m2), filled(horizontal_m2),
        None if back_m2 is None else filled(back_m2),
    )  # fmt: skip
    return SilhouetteTable(
        azimuth_deg, elevation_deg, area.reshape(elevation_deg.size, azimuth_deg.size)
    )


@lru_cache(maxsize=64)
def body_mesh(front_m2: float, side_m2: float, horizontal_m2: float) -> TriangleMesh:
    """Return a closed mesh of the capsule and the plate.

    Parameters
    ----------
    front_m2, side_m2, horizontal_m2 : float
        As for `components.optical.silhouette.visible_area`; none of them 0.

    Raises
    ------
    ValueError
        If an area is 0, and the body has no volume to mesh.
    """
    if min(front_m2, side_m2, horizontal_m2) <= 0.0:
        raise ValueError("an aircraft without front, side or horizontal area has no mesh")
    bodies = [_capsule(front_m2, side_m2), _plate(horizontal_m2)]
    count = len(bodies[0][0])
    vertices = np.concatenate([vertices for vertices, _ in bodies])
    return TriangleMesh(vertices, np.concatenate([bodies[0][1], bodies[1][1] + count]), MESH_ROWS)


def _capsule(front_m2: float, side_m2: float) -> tuple[FloatArray, np.ndarray]:
    """Return rings round the x axis; their radius makes the polygon's area that of the circle."""
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


def _plate(horizontal_m2: float) -> tuple[FloatArray, np.ndarray]:
    span = np.sqrt(horizontal_m2 * PLATE_ASPECT_RATIO)
    half = 0.5 * np.array([horizontal_m2 / span, span, _PLATE_THICKNESS_M])
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    return signs * half, np.array(corners)
