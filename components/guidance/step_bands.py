"""Which steps of a manoeuvre meet a volume, on the way or after it."""

from typing import Any

import numpy as np

from components.guidance.situation import Detector, State, meets
from components.guidance.steps import Steps
from dsa_des.arrays.types import BoolArray, FloatArray

_MOST = np.iinfo(np.int64).max


class StepConflicts:
    """When the flights after all steps meet a volume about one intruder of each ownship.

    The times are found once, over all that may be asked; every question only cuts them.

    Parameters
    ----------
    steps : Steps
        Of n ownships.
    intruder : State of (n, 1)
    detector : Detector
    lookahead_s : float
    from_now : bool
        Whether horizons count from time 0, not from the end of a manoeuvre.
    """

    def __init__(
        self,
        steps: Steps,
        intruder: State,
        detector: Detector,
        lookahead_s: float,
        from_now: bool = False,
    ) -> None:
        self._after_s = np.zeros((1, 1)) if from_now else steps.time_s
        self._from_now = from_now
        self._steps = steps
        self._lookahead_s = lookahead_s
        self._count = np.abs(steps.number)
        # In recovery, one that ends beyond its horizon keeps clear of the cylinder all the time.
        self._late = (steps.time_s > lookahead_s) & from_now
        # Others that end later are not asked for.
        begin_s = np.where(self._late, 0.0, np.minimum(steps.time_s, lookahead_s))
        end_s = lookahead_s + steps.step_time_s
        self._span = detector.span(steps.flight, intruder, begin_s, end_s)
        self._takes_time = bool(steps.step_time_s.any())
        lasts_s = steps.time_s + steps.step_time_s
        self._while_flown = (
            meets(self._span, steps.time_s, lasts_s) & steps.there
            if self._takes_time
            else np.zeros(steps.there.shape, dtype=bool)
        )

    def soon(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps meet it after the manoeuvre.

        Parameters
        ----------
        from_s : float or (n, 1)
            From when on it counts.
        horizon_s : float or (n, 1)
            How long after the manoeuvre.

        Returns
        -------
        (n, k) of bool
        """
        time_s = self._steps.time_s
        begin_s = np.maximum(from_s, time_s)
        met = meets(self._span, begin_s, np.minimum(self._lookahead_s, horizon_s + self._after_s))
        return np.asarray(met & self._steps.there & np.asarray(from_s <= horizon_s))

    def unsafe(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps meet it, or lie beyond one that meets it while it is flown."""
        met = self.soon(from_s, horizon_s)
        if self._takes_time:
            met |= self.lost(from_s, horizon_s)
        return met

    def lost(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps lie at or beyond the first that meets it while it is flown."""
        if not self._takes_time:
            return self._while_flown
        first = np.ceil(from_s / self._steps.step_time_s)
        # Where horizons count from now, what is flown after them is not looked at either.
        last_s = np.minimum(self._lookahead_s, horizon_s) if self._from_now else self._lookahead_s
        last = np.floor(last_s / self._steps.step_time_s)
        due = (self._count >= first) & (self._count <= last)
        due = due & (self._steps.time_s < self._lookahead_s) & np.asarray(from_s <= horizon_s)
        return self._beyond(self._while_flown & due)

    def unsafe_before(self, until_s: FloatArray) -> BoolArray:
        """Tell which steps meet it until a time (n, 1), or while they are flown until then."""
        begin_s = np.where(self._late, 0.0, self._steps.time_s)
        end_s = np.where(self._late, self._lookahead_s, np.minimum(self._lookahead_s, until_s))
        met = meets(self._span, begin_s, end_s)
        met &= self._steps.there
        if self._takes_time:
            until_s = np.minimum(until_s, self._lookahead_s)
            early = self._count <= np.floor(until_s / self._steps.step_time_s)
            met |= self._beyond(self._while_flown & early)
        return met

    def _beyond(self, met: BoolArray) -> BoolArray:
        if not met.any():
            return met
        number = self._steps.number
        lost = np.zeros(met.shape, dtype=bool)
        for side in (number >= 0, number <= 0):
            first = np.where(met & side, self._count, _MOST).min(axis=1, initial=_MOST)
            lost |= side & (self._count >= first[:, np.newaxis])
        return lost
