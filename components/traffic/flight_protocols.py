"""What a traffic source asks of flights: of one aircraft, and of many."""

from typing import Any, Protocol

from components.geometry.state import TrajectoryState
from dsa_des.arrays.types import FloatArray, IntArray


class Trajectory(Protocol):
    """The flight of one aircraft."""

    name: str

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along its path."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return its state at some times."""


class EachFlight(Protocol):
    """Flights that are asked each at times of its own."""

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of aircraft (n,), each at a time (n,) of its own."""


class Fleet(EachFlight, Protocol):
    """The flights of many aircraft."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return their states, shape (times, aircraft)."""

    def subset(self, columns: IntArray) -> "Fleet":
        """Return the flights of some of them, given by their indices, ascending."""
