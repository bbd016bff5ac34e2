"""How far apart the aircraft of an encounter truly are: slant, horizontal and vertical distance.

Nothing here depends on what sensors see; it is read off the traffic block of a scene.
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
from components.traffic.source import TrafficSource
from dsa_des.component import Context
from dsa_des.randomness import Streams
from dsa_des.scene import Block, Scene
from dsa_des.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Separation:
    """Distances of one target from the ownship over time.

    Parameters
    ----------
    name : str
    time_s : (times,)
    range_m : (times,)
        Slant range; infinite where either is absent.
    horizontal_m : (times,)
        In the ownship's local level plane.
    vertical_m : (times,)
        Difference of the altitudes above the ellipsoid, not negative.
    """

    name: str
    time_s: FloatArray
    range_m: FloatArray
    horizontal_m: FloatArray
    vertical_m: FloatArray


def traffic_block(scene: Scene) -> Block:
    """Return the block that moves the aircraft.

    Raises
    ------
    ValueError
        If the scene has none, or one that cannot say where aircraft are.
    """
    found = [b for b in scene.blocks.values() if issubclass(b.cls, TrafficSource)]
    if len(found) != 1:
        raise ValueError(
            f"needs one block of traffic that knows its flights; this scene has {len(found)}"
        )
    return found[0]


def separations(scene: Scene, step_s: float) -> list[Separation]:
    """Return the distances of every target of a scene, on a regular grid and at the samples.

    Parameters
    ----------
    scene : Scene
    step_s : float
        Spacing of the grid; the times at which the source itself has samples are added.
    """
    block = traffic_block(scene)
    context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
    source: Any = block.cls(block.name, block.parameters, context)
    duration = scene.duration_s or source.natural_duration_s() or Fraction(0)
    context.duration_s = duration
    grid = np.round(np.arange(int(float(duration) / step_s) + 1) * step_s, 9)
    return [_separation(source, target, grid) for target in source.targets]


def _separation(source: Any, target: Any, grid: FloatArray) -> Separation:
    samples = source.sample_times_s(target)
    time_s = np.union1d(grid, samples[(samples >= 0.0) & (samples <= grid[-1])])
    own, other = source.own.at(time_s), target.at(time_s)
    _, elevation_rad, range_m = line_of_sight(
        own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m,
        validate=False,
    )  # fmt: skip
    there = np.asarray(own.present & other.present)
    return Separation(
        target.name,
        time_s,
        np.where(there, range_m, np.inf),
        np.where(there, range_m * np.cos(elevation_rad), np.inf),
        np.where(there, np.abs(np.asarray(other.alt_m) - np.asarray(own.alt_m)), np.inf),
    )


def first_inside(separation: Separation, horizontal_m: float, vertical_m: float) -> float:
    """Return when a target first is within both distances (exclusive), s; NaN if it never is."""
    inside: BoolArray = (separation.horizontal_m < horizontal_m) & (
        separation.vertical_m < vertical_m
    )
    if not inside.any():
        return float("nan")
    return float(separation.time_s[np.argmax(inside)])
