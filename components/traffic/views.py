"""Which aircraft each platform may see: those that may come within the reach of its sensors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from components.flights.bounds import true_reaches_m
from components.flights.culling import NearIntervals, SteeredCulling, near_intervals
from components.geometry import TrajectoryState
from components.messages.reach import FarthestLook
from components.traffic.flown_flights import FlownFlights
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class View:
    """What one platform may look at of all flights.

    The target from which it looks, -1 for the ownship, has changed places with that one. Where
    platforms are `steered`, nothing is known of them ahead: these are looked at all the time.
    """

    def __init__(
        self,
        flights: FlownFlights,
        viewer: int,
        look: FarthestLook,
        end_s: float,
        steered: Sequence[int] | None,
    ) -> None:
        self.viewer, self.look = viewer, look
        self.intervals: NearIntervals | None = None
        self.epochs: SteeredCulling | None = None
        self.reach_m: FloatArray = np.full(1, look.range_m)
        self._width = flights.width
        #: The places in the view of who may be steered, without who looks.
        self._steered = [viewer if one < 0 else one for one in steered or () if one != viewer]
        if math.isinf(look.range_m):
            return
        own, others = flights.seen_from(viewer)
        if steered is None:
            self.reach_m = true_reaches_m(own, flights.width, end_s, look)
            if not np.isinf(self.reach_m).all():
                self.intervals = near_intervals(own, others, self.reach_m, end_s)
        elif look.lasts_s == 0.0 and not look.seeming:  # who is steered may come anywhere
            self.epochs = SteeredCulling(own, others, look.range_m, end_s)

    @property
    def most_at_once(self) -> int:
        """Most targets that may be near at one time."""
        return self._width if self.intervals is None else self.intervals.most_at_once()

    @property
    def culls(self) -> bool:
        """Return whether any target may be left out."""
        return self.intervals is not None or self.epochs is not None

    def culling_note(self, names: Sequence[str]) -> str:
        """Return a sentence on the range beyond which targets of these names are left out."""
        whose = "" if self.viewer < 0 else f" on {names[self.viewer]}"
        return (
            f"targets beyond {self.reach_m[0] / 1000.0:.2f} km: not moved, no sensor{whose} looks "
            "farther"
        )

    def near_targets(
        self, flown: FlownFlights, run: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState | None, IntArray, BoolArray | None]:
        """Return the state of the ownship, if it looks, at each row, which targets may come in the
        reach of who looks, and when (rows, targets); None for always.
        """
        every, lasts_s, one_run = np.arange(self._width), self.look.lasts_s, flown.runs == 1
        if self.epochs is not None:
            looking = flown.of_platform(self.viewer)
            state, near = self.epochs.states_and_near(looking, run, time_s)
            near[:, self._steered] = True
            columns = np.flatnonzero(near.any(axis=0)) if one_run else every
            return self._own(flown, run, time_s, state), columns, near[:, columns]
        own = self._own(flown, run, time_s)
        if self.intervals is None:
            return own, every, None
        if one_run:
            columns = self.intervals.targets_near(
                float(time_s.min()), float(time_s.max()) + lasts_s
            )
            return own, columns, self.intervals.may_be_near(columns, time_s, lasts_s)
        each = (run[:, np.newaxis] * flown.width + every).reshape(-1)
        times = np.repeat(time_s, len(every))
        near = self.intervals.holds(each, times, times + lasts_s)
        return own, every, near.reshape(len(time_s), len(every))

    def _own(
        self,
        flown: FlownFlights,
        run: IntArray,
        time_s: FloatArray,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState | None:
        """Return the state of the ownship; other platforms are moved as targets are."""
        return flown.platform_at(-1, run, time_s, state=state) if self.viewer < 0 else None


def views_of(
    flights: FlownFlights,
    looks: Mapping[int, FarthestLook],
    culls: bool,
    duration_s: float,
    steered: Sequence[int] | None,
) -> list[View]:
    """Return what each platform may look at; all the time at everything unless it `culls`."""
    return [
        View(
            flights,
            viewer,
            look if culls else replace(look, range_m=math.inf),
            duration_s + look.lasts_s,
            steered,
        )
        for viewer, look in looks.items()
    ]


class Seen:
    """Who may see whom at the rows of a wake: the ownship first, then the other platforms."""

    def __init__(
        self, views: Sequence[View], flown: FlownFlights, run: IntArray, time_s: FloatArray
    ) -> None:
        self._width, self._views, self._unseen = flown.width, views, flown.unseen
        self._near = {view.viewer: view.near_targets(flown, run, time_s) for view in views}
        own, columns, _ = self._near[-1]
        assert own is not None
        #: The state of the ownship at each row, and which targets are to be moved.
        self.own = own
        self.columns: IntArray = columns
        if len(views) > 1:
            others = [self._near[view.viewer][1] for view in views[1:]]
            viewers = np.array([view.viewer for view in views[1:]])
            self.columns = np.unique(np.concatenate([columns, viewers, *others]))

    def present_for_ownship(self, there: BoolArray) -> tuple[BoolArray, IntArray | None]:
        """Return which targets the ownship may see at each row, and how many are left out."""
        return self._present_for(-1, there, self.own.present)

    def present_for_others(
        self, there: BoolArray, names: Sequence[str]
    ) -> Mapping[str, tuple[BoolArray, IntArray | None]]:
        """Return the same for the other platforms, by name, with the ownship in their places."""
        result = {}
        for view in self._views[1:]:
            place = int(np.searchsorted(self.columns, view.viewer))
            changed = there.copy()
            changed[:, place] = self.own.present
            result[names[view.viewer]] = self._present_for(view.viewer, changed, there[:, place])
        return result

    def _present_for(
        self, viewer: int, there: BoolArray, looking: BoolArray
    ) -> tuple[BoolArray, IntArray | None]:
        _, columns, near = self._near[viewer]
        present: BoolArray = there & looking[:, np.newaxis]
        if self._unseen:
            # In the place of who looks is the ownship.
            present[:, np.isin(self.columns, [k for k in self._unseen if k != viewer])] = False
        if near is None:
            return present, None
        if len(columns) != len(self.columns):
            wide = np.zeros(present.shape, dtype=bool)
            wide[:, np.searchsorted(self.columns, columns)] = near
            near = wide
        return present & near, self._width - near.sum(axis=1)
