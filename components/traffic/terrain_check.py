"""The check that the terrain is below the ownship all along its flight."""

import math
from typing import Any, Protocol

import numpy as np

from components.geometry.state import TrajectoryState
from components.terrain.raster import ElevationRaster

_MOST_SAMPLES = 100_000


class OwnshipFlight(Protocol):
    """The flight of the ownship."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return its state at some times."""


class FlightOf:
    """One flight of many that are evaluated together.

    Parameters
    ----------
    fleet : object with `each(aircraft, time_s)`
    aircraft : int
    """

    def __init__(self, fleet: Any, aircraft: int) -> None:
        self._fleet, self._aircraft = fleet, aircraft

    def at(self, time_s: Any) -> TrajectoryState:
        """Return its state at times (n,)."""
        state: TrajectoryState = self._fleet.each(np.full(len(time_s), self._aircraft), time_s)
        return state


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


def check_on_raster(
    own: OwnshipFlight, raster: ElevationRaster, offset_m: float, duration_s: float
) -> None:
    """Refuse a raster over which the ownship never flies, or whose ground it flies through.

    Parameters
    ----------
    own : OwnshipFlight
    raster : ElevationRaster
    offset_m : float
        Height above the ellipsoid of the raster's zero.
    duration_s : float, s
        Length of the run; the flight is looked at every second.

    Raises
    ------
    ValueError
        If they do not overlap, or the ownship is below the ground somewhere.
    """
    count = min(math.ceil(duration_s), _MOST_SAMPLES) + 1
    times = np.linspace(0.0, duration_s, count)
    state = own.at(times)
    there = np.flatnonzero(state.present)
    ground, inside = raster.height(state.lat_deg[there], state.lon_deg[there])
    if len(there) and not inside.any():
        first = there[0]
        raise ValueError(
            f"[terrain] raster {raster.name} covers {raster.box()}: the ownship is at latitude "
            f"{state.lat_deg[first]:.6g}, longitude {state.lon_deg[first]:.6g} and never over it; "
            "they must overlap"
        )
    hit = np.flatnonzero(state.alt_m[there] <= ground + offset_m)
    if len(hit):
        first = there[hit[0]]
        raise ValueError(
            f"[terrain] raster {raster.name} is {ground[hit[0]] + offset_m:.6g} m high under the "
            f"ownship, which is at {state.alt_m[first]:.6g} m at {times[first]:.6g} s: it must fly "
            "above the ground"
        )
