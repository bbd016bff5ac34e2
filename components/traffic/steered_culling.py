"""The targets that may come in reach of an ownship whose path is not known in advance.

At the start of an epoch of a few seconds the ownship is somewhere. Until its end it and a target
cannot close in by more than their two largest speeds allow, whatever is steered meanwhile. What a
row holds follows from its own epoch and so does not depend on the window that it is in.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
from components.geometry.state import TrajectoryState
from components.traffic.flight_limits import max_speeds_mps
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# An epoch lasts until the fastest target can have come nearer by this part of the reach.
_DRIFT_SHARE = 0.25
SHORTEST_EPOCH_S = 1.0
# Steering keeps the speed to 1e-4; what the ownship flies may be this much faster at most.
_OWN_SPEED_MARGIN = 1.05
_SPEED_MARGIN = 1.001
# Targets are placed for so many epochs at once that it takes about this many cells.
_CELLS_AT_ONCE = 8192
_RANGE_MARGIN_M = 1.0


def closing_speeds_mps(targets_mps: FloatArray, own_mps: Any) -> FloatArray:
    """Return how fast each target and a steered ownship can come nearer to each other."""
    closing: FloatArray = (targets_mps + own_mps * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
    return closing


def epochs_of(closing_mps: FloatArray, reach_m: float) -> tuple[FloatArray, FloatArray]:
    """Return how long an epoch lasts around each ownship, and how near counts at its start.

    Parameters
    ----------
    closing_mps : (ownships, targets)
    reach_m : float

    Returns
    -------
    epoch_s : (ownships,)
    within_m : (ownships, targets)
    """
    fastest = np.maximum(closing_mps.max(axis=1, initial=0.0), 1e-3)
    epoch_s = np.maximum(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)
    return epoch_s, reach_m + closing_mps * epoch_s[:, np.newaxis] + _RANGE_MARGIN_M


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
        closing = closing_speeds_mps(max_speeds_mps(targets), own_speed_mps)
        epoch_s, within_m = epochs_of(closing[np.newaxis], reach_m)
        self.epoch_s, self._within_m = float(epoch_s[0]), within_m[0]
        #: By number of the epoch, for one path of the ownship.
        self._near: dict[int, BoolArray] = {}
        self._own: Any = None
        #: Where all targets are at the starts of some epochs, from the first of them on.
        self._placed: tuple[int, Any] | None = None
        self._most_epochs = max(1, _CELLS_AT_ONCE // max(1, len(targets)))
        self._last: tuple[IntArray, Any] = np.arange(len(targets)), fleet

    def cut(self, own: Any, time_s: FloatArray) -> tuple[Any, IntArray, Any, BoolArray]:
        """Return the targets that may be in reach at some of the times.

        Parameters
        ----------
        own : object with `at(time_s)`
            The path of the ownship as it is now; another object after every manoeuvre.
        time_s : (rows,)

        Returns
        -------
        state : TrajectoryState
            The ownship at the times.
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
        # One call for the rows and the epochs: a steered flight has many parts to go through.
        both = own.at(np.concatenate([time_s, np.array(new) * self.epoch_s]))
        rows = len(time_s)
        state = TrajectoryState(*(values[:rows] for values in both.arrays()))
        here = [both.lat_deg[rows:], both.lon_deg[rows:], both.alt_m[rows:]]
        self._learn(np.array(new, dtype=np.int64), here)
        near = np.array([self._near[number] for number in numbers])
        columns = np.flatnonzero(near.any(axis=0))
        if not np.array_equal(columns, self._last[0]):
            self._last = columns, self._fleet.subset(columns)
        return state, columns, self._last[1], near[:, columns][of_row]

    def _learn(self, epochs: IntArray, here: list[FloatArray]) -> None:
        """Find who may come in reach in some epochs, given where the ownship starts each."""
        while len(epochs):
            first, others = self._placed or (0, None)
            if others is None or not first <= epochs[0] < first + self._most_epochs:
                first = int(epochs[0])
                others = self._fleet.at((first + np.arange(self._most_epochs)) * self.epoch_s)
                self._placed = first, others
            known = int(np.searchsorted(epochs, first + self._most_epochs))
            row = epochs[:known] - first
            own_lat, own_lon, own_alt = (values[:known, np.newaxis] for values in here)
            _, _, range_m = line_of_sight(
                own_lat, own_lon, own_alt,
                others.lat_deg[row], others.lon_deg[row], others.alt_m[row],
                validate=False,
            )  # fmt: skip
            self._near.update(zip(epochs[:known].tolist(), range_m <= self._within_m, strict=True))
            epochs, here = epochs[known:], [values[known:] for values in here]
