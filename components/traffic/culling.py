"""Which targets can come near enough to matter, and when.

A target whose distance from the ownship is d at the middle of an interval of length 2h stays
farther away than d - (v_own + v_target)·h all through it, with v the largest speeds. Where that
is beyond every sensor's range, no sensor can look at the target during the interval: it need not
even be moved.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
from components.traffic.state import TrajectoryState
from dsa_des.types import FloatArray, IntArray

EPOCH_S = 10.0
# The speeds of turns and long legs hold to 2e-4; a metre covers the rounding of positions.
_SPEED_MARGIN = 1.001
_RANGE_MARGIN_M = 1.0


class Culling:
    """The targets that can come within a range of the ownship, epoch by epoch.

    Epochs last `EPOCH_S` seconds from time 0, so that the answer for an instant does not depend
    on how the instants are grouped into windows.

    Parameters
    ----------
    own, targets : objects with `at(time_s)` and `max_speed_mps`
    fleet : object with `at(time_s)` and `subset(columns)`
        All targets.
    reach_m : float
        Farthest range at which any sensor looks.
    """

    def __init__(
        self,
        own: Any,
        targets: Sequence[Any],
        fleet: Any,
        reach_m: float,
    ) -> None:
        self._own, self._fleet = own, fleet
        self.reach_m = reach_m
        speeds = np.array([target.max_speed_mps for target in targets]) + own.max_speed_mps
        half = EPOCH_S / 2.0
        self._near_m: FloatArray = reach_m + speeds * (_SPEED_MARGIN * half) + _RANGE_MARGIN_M
        self._last: tuple[int, int, IntArray, Any] | None = None

    def active(self, first_s: float, last_s: float) -> tuple[IntArray, Any]:
        """Return the targets that may come in reach between two times, and a fleet of them.

        Parameters
        ----------
        first_s, last_s : float
            Both included.

        Returns
        -------
        columns : ndarray of int
            Indices into the targets, ascending.
        fleet : object with `at(time_s)`
        """
        epochs = int(first_s // EPOCH_S), int(last_s // EPOCH_S)
        if self._last is None or self._last[:2] != epochs:
            columns = self._columns(*epochs)
            same = self._last is not None and np.array_equal(columns, self._last[2])
            fleet = (
                self._last[3] if same and self._last is not None else self._fleet.subset(columns)
            )
            self._last = (*epochs, columns, fleet)
        return self._last[2], self._last[3]

    def _columns(self, first: int, last: int) -> IntArray:
        middles = (np.arange(first, last + 1) + 0.5) * EPOCH_S
        own: TrajectoryState = self._own.at(middles)
        states: TrajectoryState = self._fleet.at(middles)
        _, _, range_m = line_of_sight(
            own.lat_deg[:, np.newaxis],
            own.lon_deg[:, np.newaxis],
            own.alt_m[:, np.newaxis],
            states.lat_deg,
            states.lon_deg,
            states.alt_m,
            validate=False,
        )
        return np.flatnonzero((range_m <= self._near_m).any(axis=0))
