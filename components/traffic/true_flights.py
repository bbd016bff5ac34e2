"""The flights of all aircraft as the table of the truth asks for them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.geometry.state import TrajectoryState
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Context

#: The truth is recorded without being asked for where aircraft times seconds, of all runs that are
#: recorded together, are at most this: some ten thousand rows with the usual sensors.
SMALL_S = 600.0
_TABLE = "truth"


def truth_is_recorded(context: Context, targets: int) -> bool:
    """Return whether a scene records where all aircraft are.

    Where tables are chosen, as a study chooses those that its metrics read, that one is among them
    or it is not made.

    Parameters
    ----------
    context : Context
    targets : int

    Notes
    -----
    How often sensors look does not count: replicas whose clocks differ record the same tables.
    """
    record = context.sections.get("record")
    asked = "auto" if record is None else record.truth
    if context.recorded_tables is not None:
        return asked is not False and _TABLE in context.recorded_tables
    if asked == "auto":
        seconds = context.recorded_runs * float(context.duration_s)
        return (1 + targets) * seconds <= SMALL_S
    return bool(asked)


class TrueFlights:
    """The ownship's flight, as far as it is known, and those of all targets.

    Parameters
    ----------
    own, fleet
        As a traffic source has them.
    crabbing : sequence
        What turns noses into the wind.
    """

    def __init__(self, own: Any, fleet: Any, crabbing: Sequence[Any]) -> None:
        self._own, self._fleet, self._crabbing = own, fleet, crabbing

    def __call__(
        self, columns: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the ownship's states (rows, 1) and the targets' (rows, n) at times (rows, 1)."""
        times = np.repeat(time_s, len(columns), axis=1)
        each = np.broadcast_to(columns, times.shape).reshape(-1)
        others = self._fleet.each(each, times.reshape(-1)).reshaped(times.shape)
        own = self._own.at(time_s.reshape(-1)).reshaped(time_s.shape)
        for crabbing in self._crabbing:
            own = crabbing.of_own(self._own, own, time_s)
            others = crabbing.of_targets(columns, others, times)
        return own, others
