"""The ladder of the fusion of tracks: how two estimates are weighed."""

from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.wake import Wake

# Fused tracks by number: as many as are compared.
_TRACKS = 64
_POSITION = ("north_m", "east_m", "down_m")


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return the position of each fused track, and how uncertain it is."""
    position = np.full((len(wake), _TRACKS, 3), np.nan)
    spread = np.full((len(wake), _TRACKS), np.nan)
    told: Any = block.run(wake)
    if told is not None:
        row = np.repeat(np.searchsorted(wake.ticks, told.tick), np.diff(told.offsets))
        mine = np.flatnonzero(told.has_range & (told.track <= _TRACKS))
        place = row[mine], told.track[mine] - 1
        position[place] = np.stack([getattr(told, name)[mine] for name in _POSITION], axis=-1)
        variance = sum(told.covariance[f"covariance_{i}{i}_m2"][mine] for i in range(3))
        spread[place] = np.sqrt(np.asarray(variance))
    return {"position": position, "spread": spread}


def _distance(values: AnyArray, reference: AnyArray) -> FloatArray:
    return np.asarray(np.sqrt(((values - reference) ** 2).sum(axis=-1)))


RULE = Ladder(
    "rule",
    (
        Rung("independent", "information added, as if errors had nothing in common",
             parameters={"rule": "independent"}),
        Rung("trace", "covariance intersection, least trace of the position",
             parameters={"rule": "trace"}),
        Rung("determinant", "covariance intersection, least determinant",
             parameters={"rule": "determinant"}),
    ),
    "determinant",
    (Quantity("position", "m", _distance), Quantity("spread", "m")),
    measure,
)  # fmt: skip
