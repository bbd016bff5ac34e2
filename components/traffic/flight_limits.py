"""The largest speeds of flights and the times they are there, for many at once."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from components.traffic.straight_flights import StraightFlights
from dsa_des.arrays.types import FloatArray


def max_speeds_mps(flights: Sequence[Any]) -> FloatArray:
    """Return the largest speed of each flight along its path, shape (flights,)."""
    if isinstance(flights, StraightFlights):
        return flights.max_speeds_mps
    return np.array([flight.max_speed_mps for flight in flights], dtype=np.float64)


def intervals_present_s(flights: Sequence[Any]) -> FloatArray:
    """Return the first and the last time at which each flight may be there, shape (flights, 2).

    A flight that does not say it may be there at any time from 0 on.
    """
    if isinstance(flights, StraightFlights):
        return flights.intervals_present_s
    always = (0.0, math.inf)
    there = [f.interval_present() if hasattr(f, "interval_present") else always for f in flights]
    return np.array(there, dtype=np.float64).reshape(-1, 2)
