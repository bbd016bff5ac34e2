"""The part of a camera's picture in which a target was detected, drawn from its three bodies."""

import math
from typing import NamedTuple

import numpy as np

from components.aircraft.aircraft import VisibleAreas
from components.geometry.attitude import body_to_ned
from components.optical.convex_hull import PLATE_ASPECT_RATIO
from dsa_des.arrays.types import FloatArray

_AROUND = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)


class Silhouette(NamedTuple):
    """Outlines on the picture, in pixels from its middle: to the right and up.

    Parameters
    ----------
    fuselage, wing : (points, 2)
    """

    fuselage: FloatArray
    wing: FloatArray


def silhouette(
    areas: VisibleAreas,
    target_attitude_rad: FloatArray,
    own_attitude_rad: FloatArray,
    direction_rad: tuple[float, float],
    range_m: float,
    pixel_rad: tuple[float, float],
) -> Silhouette:
    """Return the outlines of a target as a camera on the ownship has them.

    The bodies are those whose areas decide about the detection: a sphere drawn out into a capsule
    along the x axis, and a plate in the x-y plane (`components.optical.convex_hull`).

    Parameters
    ----------
    areas : VisibleAreas
    target_attitude_rad, own_attitude_rad : (3,)
        Yaw, pitch and roll, NED to body.
    direction_rad : (azimuth, elevation)
        Of the target, in the ownship's body axes.
    range_m : float
    pixel_rad : (across, up)
        What a pixel sees.
    """
    to_body = _body_to_ned(own_attitude_rad).T @ _body_to_ned(target_attitude_rad)
    right, up, _ = _axes(direction_rad)
    scale = np.stack([right / pixel_rad[0], up / pixel_rad[1]]) @ to_body / range_m
    radius = math.sqrt(areas.front_m2 / math.pi)
    half = 0.25 * areas.side_m2 / radius if radius else 0.0
    ends = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0]]) @ scale.T
    circle = np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1)
    round_px = circle * radius / (range_m * np.array(pixel_rad))
    fuselage = _hull(np.concatenate([ends[0] + round_px, ends[1] + round_px]))
    span = math.sqrt(areas.horizontal_m2 * PLATE_ASPECT_RATIO)
    chord = areas.horizontal_m2 / span if span else 0.0
    corners = 0.5 * np.array([
        [chord, span, 0.0], [chord, -span, 0.0], [-chord, -span, 0.0], [-chord, span, 0.0],
    ])  # fmt: skip
    return Silhouette(fuselage, corners @ scale.T)


class Horizon(NamedTuple):
    """The horizon on the picture, as a straight line.

    Parameters
    ----------
    height : float
        Distance of the line from the middle of the picture, pixels; positive where the middle is
        below it.
    tilt_rad : float
        Where the line's upper side points, clockwise from the top of the picture.
    """

    height: float
    tilt_rad: float


def horizon(
    own_attitude_rad: FloatArray,
    direction_rad: tuple[float, float],
    dip_rad: float,
    pixel_rad: tuple[float, float],
) -> Horizon:
    """Return where the horizon lies on the picture around a direction.

    Parameters
    ----------
    own_attitude_rad : (3,)
        Yaw, pitch and roll, NED to body.
    direction_rad : (azimuth, elevation)
        Of the middle of the picture, in the ownship's body axes.
    dip_rad : float
        How far the horizon lies below the level.
    pixel_rad : (across, up)
        What a pixel sees.

    Notes
    -----
    The sine of the elevation over the level is linear in the direction; what is far from the middle
    lies where its tangent there puts it.
    """
    right, up, along = _axes(direction_rad)
    upward = -_body_to_ned(own_attitude_rad)[2]
    across, upright = float(right @ upward) * pixel_rad[0], float(up @ upward) * pixel_rad[1]
    missing = -math.sin(dip_rad) - float(along @ upward)
    return Horizon(missing / max(math.hypot(across, upright), 1e-12), math.atan2(across, upright))


def _axes(direction_rad: tuple[float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the picture's axes to the right and up and the line of sight, in body axes."""
    azimuth, elevation = direction_rad
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    along = np.array([
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        -math.sin(elevation),
    ])  # fmt: skip
    return right, np.cross(right, along), along  # body z points down


def _body_to_ned(attitude_rad: FloatArray) -> FloatArray:
    """Return the rotation of yaw, pitch and roll, (3, 3)."""
    return np.stack(body_to_ned(*np.eye(3), *attitude_rad))


def _hull(points: FloatArray) -> FloatArray:
    """Return the convex hull of points in a plane, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, points.tolist()))
    return np.array([*_chain(ordered), *_chain(ordered[::-1])])


def _chain(points: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    found: list[tuple[float, ...]] = []
    for point in points:
        while len(found) > 1 and _left(found[-2], found[-1], point) <= 0.0:
            found.pop()
        found.append(point)
    return found[:-1]


def _left(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
