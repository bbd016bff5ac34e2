"""Wires between posts as obstacles: each span hangs as a catenary, a row of pieces at rest."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import Field

from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Parameters

_MOST_PIECES = 10_000
NO_AREAS = {"front_m2": 0.0, "side_m2": 0.0, "horizontal_m2": 0.0}


class Post(Parameters):
    """Top of a post that holds a wire, as an offset from the ownship's start."""

    east_m: float = Field(description="Offset to the east, m.")
    north_m: float = Field(description="Offset to the north, m.")
    up_m: float = Field(description="Offset upward, m.")


class OverheadWire(Parameters):
    """A wire over posts; sensors see pieces of it, each a target of its own at rest."""

    name: str = Field(
        min_length=1, description="Name; pieces are named after it, 'name-1' and so on."
    )
    posts: list[Post] = Field(min_length=2, description="Posts in order.")
    sag_m: float = Field(
        default=0.0, ge=0, description="How far each span hangs below the line of its posts, m."
    )
    diameter_mm: float = Field(gt=0, le=1000, description="Thickness of the wire, mm.")
    reflectivity: float = Field(
        default=0.2, gt=0, le=1, description="Diffuse reflectivity for lasers; an assumption."
    )
    piece_m: float = Field(
        default=25.0, gt=0, description="Longest piece that is a target of its own, m."
    )
    rcs_dbsm: float = Field(
        default=-20.0, description="Radar cross-section of each piece, dBsm (Table 2.3)."
    )

    def piece_intruder_keys(self) -> Iterator[dict[str, Any]]:
        """Yield each piece as a dict of intruder keys: position, radar, laser; no camera areas."""
        posts = np.array([[post.east_m, post.north_m, post.up_m] for post in self.posts])
        ends = [catenary_points_m(a, b, self.sag_m, self.piece_m) for a, b in pairwise(posts)]
        spans = [(line[:-1], line[1:]) for line in ends]
        first, last = (np.concatenate(parts) for parts in zip(*spans, strict=True))
        if len(first) > _MOST_PIECES:
            raise ValueError(
                f"wire {self.name!r}: piece_m is {self.piece_m:g}, which makes {len(first):,} "
                f"pieces; allowed: at most {_MOST_PIECES:,}"
            )
        along, middle = last - first, 0.5 * (first + last)
        for number, (way, at) in enumerate(zip(along.tolist(), middle.tolist(), strict=True), 1):
            level_m = math.hypot(way[0], way[1])
            yield {
                "name": f"{self.name}-{number}",
                "east_m": at[0],
                "north_m": at[1],
                "up_m": at[2],
                "rcs_dbsm": self.rcs_dbsm,
                "swerling": 0,
                "eo": NO_AREAS,
                "ir": {**NO_AREAS, "back_m2": 0.0},
                "laser": {
                    "reflectivity": self.reflectivity,
                    "wire_diameter_mm": self.diameter_mm,
                    "wire_length_m": math.hypot(level_m, way[2]),
                    "wire_direction_deg": math.degrees(math.atan2(way[0], way[1])),
                    "wire_slope_deg": math.degrees(math.atan2(way[2], level_m)),
                },
            }


def catenary_points_m(
    first: FloatArray, last: FloatArray, sag_m: float, step_m: float
) -> FloatArray:
    """Return points (n, 3) east, north, up (m), in order, of a wire hanging between two posts.

    `sag_m` is its depth below the middle of the line between them, `step_m` the longest level
    distance from point to point, all in m. It is a cosh(x / a), a by the sag, hung from the line:
    exact for posts of one height, within sag times (rise / length)² for others.
    """
    level_m = math.hypot(*(last - first)[:2].tolist())
    if not level_m > 0.0:
        raise ValueError("two posts that follow each other stand in one place")
    if sag_m > level_m:
        raise ValueError(f"sag_m is {sag_m:g}: a span of {level_m:g} m sags by at most its length")
    count = max(1, math.ceil(level_m / step_m))
    part = np.linspace(0.0, 1.0, count + 1)
    points: FloatArray = first + part[:, np.newaxis] * (last - first)
    if sag_m > 0.0:
        # (cosh u - 1) / u = 2 sag / length with u = length / 2a grows with u: halved until it fits.
        low, high = 0.0, 10.0
        for _ in range(100):
            u = 0.5 * (low + high)
            deeper = 2.0 * math.sinh(0.5 * u) ** 2 / u > 2.0 * sag_m / level_m
            low, high = (low, u) if deeper else (u, high)
        a_m = 0.5 * level_m / u
        points[:, 2] += a_m * (np.cosh(u * (2.0 * part - 1.0)) - math.cosh(u))
    return points
