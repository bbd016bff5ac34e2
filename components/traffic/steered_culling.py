"""Which targets may come in reach of an ownship that nobody knows the path of?

At the start of an epoch of a few seconds the ownship is somewhere. Until its end it and a target
cannot close in by more than their two largest speeds allow, whatever is steered meanwhile. What a
row holds follows from its own epoch and so does not depend on the window that it is in.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
from dsa_des.types import BoolArray, FloatArray, IntArray

# An epoch lasts until the fastest target can have come nearer by this part of the reach.
_DRIFT_SHARE = 0.25
SHORTEST_EPOCH_S = 1.0
# Steering keeps the speed to 1e-4; what the ownship flies may be this much faster at most.
_OWN_SPEED_MARGIN = 1.05
_SPEED_MARGIN = 1.001
_RANGE_MARGIN_M = 1.0


class SteeredCulling:
    """The targets near an ownship that is steered, by epochs of time.

    Parameters
    ----------
    own_speed_mps : float
        Largest speed of the ownship.
    targets : sequence of objects with `max_speed_mps`
    fleet : object with `at(time_s)` and `subset(columns)`
        All targets.
    reach_m : float
        Farthest range at which any sensor looks.
    """

    def __init__(
        self, own_speed_mps: float, targets: Sequence[Any], fleet: Any, reach_m: float
    ) -> None:
        self.reach_m, self._fleet = reach_m, fleet
        speeds = np.array([target.max_speed_mps for target in targets])
        closing = (speeds + own_speed_mps * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
        fastest = max(float(closing.max(initial=0.0)), 1e-3)
        self.epoch_s = max(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)
        self._within_m = reach_m + closing * self.epoch_s + _RANGE_MARGIN_M
        #: By number of the epoch, for one path of the ownship.
        self._near: dict[int, BoolArray] = {}
        self._own: Any = None
        self._last: tuple[IntArray, Any] = np.arange(len(targets)), fleet

    def cut(self, own: Any, time_s: FloatArray) -> tuple[IntArray, Any, BoolArray]:
        """Return the targets that may be in reach at some of the times.

        Parameters
        ----------
        own : object with `at(time_s)`
            The path of the ownship as it is now; another object after every manoeuvre.
        time_s : (rows,)

        Returns
        -------
        columns : (n,) of int
            Indices into the targets, ascending.
        fleet : object with `at(time_s)`
            Those targets.
        near : (rows, n) of bool
            At which times they may be.
        """
        if own is not self._own:
            self._own, self._near = own, {}
        epochs, of_row = np.unique(np.floor(time_s / self.epoch_s), return_inverse=True)
        numbers = epochs.astype(np.int64).tolist()
        new = [number for number in numbers if number not in self._near]
        if new:
            self._near.update(zip(new, self._near_at(np.array(new) * self.epoch_s), strict=True))
        near = np.array([self._near[number] for number in numbers])
        columns = np.flatnonzero(near.any(axis=0))
        if not np.array_equal(columns, self._last[0]):
            self._last = columns, self._fleet.subset(columns)
        return columns, self._last[1], near[:, columns][of_row]

    def _near_at(self, start_s: FloatArray) -> BoolArray:
        """Return which targets may come in reach in the epochs that start at some times."""
        own, others = self._own.at(start_s), self._fleet.at(start_s)
        _, _, range_m = line_of_sight(
            own.lat_deg[:, np.newaxis], own.lon_deg[:, np.newaxis], own.alt_m[:, np.newaxis],
            others.lat_deg, others.lon_deg, others.alt_m,
            validate=False,
        )  # fmt: skip
        near: BoolArray = range_m <= self._within_m
        return near
