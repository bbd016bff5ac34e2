"""The check that the terrain is below the ownship all along its flight."""

import math
from typing import Any, Protocol

import numpy as np

from components.geometry.state import TrajectoryState

_MOST_SAMPLES = 100_000


class OwnshipFlight(Protocol):
    """The flight of the ownship."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return its state at some times."""


def check_above_terrain(own: OwnshipFlight, terrain_m: float, duration_s: float) -> None:
    """Refuse terrain that the ownship does not fly above.

    Parameters
    ----------
    own : OwnshipFlight
    terrain_m : float, m
        Altitude of the ground.
    duration_s : float, s
        Length of the run; the flight is looked at every second.

    Raises
    ------
    ValueError
        If the ground is as high as the ownship somewhere, or higher.
    """
    count = min(math.ceil(duration_s), _MOST_SAMPLES) + 1
    times = np.linspace(0.0, duration_s, count)
    state = own.at(times)
    hit = np.flatnonzero((state.alt_m <= terrain_m) & state.present)
    if len(hit):
        first = hit[0]
        raise ValueError(
            f"[terrain] height_m is {terrain_m:g}: it must be below the ownship, which is at "
            f"{state.alt_m[first]:g} m at {times[first]:g} s"
        )
