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
# Steering keeps the speed to 1e-4 unless another one is told.
_OWN_SPEED_MARGIN = 1.05
_SPEED_MARGIN = 1.001
# Targets are placed for so many epochs at once that it takes about this many cells.
_CELLS_AT_ONCE = 8192
_RANGE_MARGIN_M = 1.0


def closing_speeds_mps(targets_mps: FloatArray, own_mps: Any) -> FloatArray:
    """Return how fast each target and a steered ownship can come nearer to each other."""
    closing: FloatArray = (targets_mps + own_mps * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
    return closing


def epochs_of(closing_mps: FloatArray, reach_m: float) -> FloatArray:
    """Return how long an epoch lasts around each ownship, of closing speeds (ownships, targets)."""
    fastest = np.maximum(closing_mps.max(axis=1, initial=0.0), 1e-3)
    return np.maximum(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)


def within_of(closing_mps: FloatArray, reach_m: float, epoch_s: Any) -> FloatArray:
    """Return how near at the start of an epoch counts for who closes in so fast."""
    return np.asarray(reach_m + closing_mps * epoch_s + _RANGE_MARGIN_M)


class SteeredCulling:
    """The targets near an ownship that is steered, by epochs of time.

    Parameters
    ----------
    own_speed_mps : float
        Largest speed of the ownship before it is steered.
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
        self._speeds_mps, self._own_mps = max_speeds_mps(targets), own_speed_mps
        closing = closing_speeds_mps(self._speeds_mps, own_speed_mps)
        self.epoch_s = float(epochs_of(closing[np.newaxis], reach_m)[0])
        #: Ranges at the start of an epoch by its number, for one path of the ownship.
        self._range_m: dict[int, FloatArray] = {}
        self._own: Any = None
        #: Where all targets are at the starts of some epochs, from the first of them on.
        self._placed: tuple[int, Any] | None = None
        self._most_epochs = max(1, _CELLS_AT_ONCE // max(1, len(targets)))
        self._last: tuple[IntArray, Any] = np.arange(len(targets)), fleet

    def cut(self, own: Any, time_s: FloatArray) -> tuple[Any, IntArray, Any, BoolArray]:
        """Return the targets that may be in reach at some of the times.

        Parameters
        ----------
        own : SteeredFlight
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
            self._own, self._range_m = own, {}
        # By a row's own instant the ownship may have been told to fly faster.
        fastest = np.maximum(own.fastest_by(time_s), self._own_mps)
        of_rows = np.stack([np.floor(time_s / self.epoch_s), fastest])
        pairs, of_row = np.unique(of_rows, axis=1, return_inverse=True)
        of_row = of_row.reshape(-1)
        numbers = pairs[0].astype(np.int64).tolist()
        new = sorted({number for number in numbers if number not in self._range_m})
        # One call for the rows and the epochs: a steered flight has many parts to go through.
        both = own.at(np.concatenate([time_s, np.array(new) * self.epoch_s]))
        rows = len(time_s)
        state = TrajectoryState(*(values[:rows] for values in both.arrays()))
        here = [both.lat_deg[rows:], both.lon_deg[rows:], both.alt_m[rows:]]
        self._learn(np.array(new, dtype=np.int64), here)
        closing = closing_speeds_mps(self._speeds_mps, pairs[1][:, np.newaxis])
        within_m = within_of(closing, self.reach_m, self.epoch_s)
        near = np.array([self._range_m[number] for number in numbers]) <= within_m
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
            self._range_m.update(zip(epochs[:known].tolist(), range_m, strict=True))
            epochs, here = epochs[known:], [values[known:] for values in here]
