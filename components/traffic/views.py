"""Which aircraft each platform may see: those that may come within the reach of its sensors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from components.flights.bounds import max_true_ranges_m
from components.flights.culling import NearIntervals, SteeredCulling, near_intervals
from components.geometry import TrajectoryState
from components.messages.reach import FarthestLook
from components.traffic.flown_flights import FlownFlights
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class View:
    """Which targets one platform may see, over all flights, and when they are near enough.

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
        self._width = flights.targets_per_run
        #: The places in the view of who may be steered, without who looks.
        self._steered = [viewer if one < 0 else one for one in steered or () if one != viewer]
        if math.isinf(look.range_m):
            return
        own, others = flights.viewer_and_target_fleets(viewer)
        if steered is None:
            self.reach_m = max_true_ranges_m(own, flights.targets_per_run, end_s, look)
            if not np.isinf(self.reach_m).all():
                self.intervals = near_intervals(own, others, self.reach_m, end_s)
        elif look.lasts_s == 0.0 and not look.seeming:  # who is steered may come anywhere
            self.epochs = SteeredCulling(own, others, look.range_m, end_s)

    @property
    def max_near_targets_at_once(self) -> int:
        """Largest number of targets that can be near this platform at one time."""
        return self._width if self.intervals is None else self.intervals.max_near_targets_at_once()

    @property
    def is_leaving_out_far_targets(self) -> bool:
        """Return whether targets too far for this platform's sensors are left out, not moved."""
        return self.intervals is not None or self.epochs is not None

    def culling_note(self, names: Sequence[str]) -> str:
        """Return a sentence on the range beyond which this platform omits the targets `names`."""
        whose = "" if self.viewer < 0 else f" on {names[self.viewer]}"
        return (
            f"targets beyond {self.reach_m[0] / 1000.0:.2f} km: not moved, no sensor{whose} looks "
            "farther"
        )

    def near_targets(
        self, flown: FlownFlights, run: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState | None, IntArray, BoolArray | None]:
        """Return the ownship's states at the rows (None for another viewer), the columns of targets
        that may be near, and a mask (rows, columns), None for always.
        """
        every, lasts_s, one_run = np.arange(self._width), self.look.lasts_s, flown.runs == 1
        if self.epochs is not None:
            looking = flown.flights_of_platform(self.viewer)
            state, near = self.epochs.own_states_and_near_mask(looking, run, time_s)
            near[:, self._steered] = True
            columns = np.flatnonzero(near.any(axis=0)) if one_run else every
            return self._ownship_states(flown, run, time_s, state), columns, near[:, columns]
        own = self._ownship_states(flown, run, time_s)
        if self.intervals is None:
            return own, every, None
        if one_run:
            columns = self.intervals.targets_near(
                float(time_s.min()), float(time_s.max()) + lasts_s
            )
            return own, columns, self.intervals.may_be_near(columns, time_s, lasts_s)
        each = (run[:, np.newaxis] * flown.targets_per_run + every).reshape(-1)
        times = np.repeat(time_s, len(every))
        near = self.intervals.may_be_near_throughout(each, times, times + lasts_s)
        return own, every, near.reshape(len(time_s), len(every))

    def _ownship_states(
        self,
        flown: FlownFlights,
        run: IntArray,
        time_s: FloatArray,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState | None:
        """Return the ownship's states at the rows if the ownship is the viewer, else None."""
        return flown.platform_states_at(-1, run, time_s, state=state) if self.viewer < 0 else None


def views_of_platforms(
    flights: FlownFlights,
    looks: Mapping[int, FarthestLook],
    culls: bool,
    duration_s: float,
    steered: Sequence[int] | None,
) -> list[View]:
    """Return a view for each platform in `looks`; without `culls` all targets are always near."""
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
    """Which targets each platform may see at the rows of a wake, the ownship's first."""

    def __init__(
        self, views: Sequence[View], flown: FlownFlights, run: IntArray, time_s: FloatArray
    ) -> None:
        self._width, self._views, self._unseen = flown.targets_per_run, views, flown.unseen
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

    def visible_to_ownship(self, there: BoolArray) -> tuple[BoolArray, IntArray | None]:
        """Return visible targets (mask (rows, targets)) and the left-out count per row, or None."""
        return self._visible_to(-1, there, self.own.present)

    def visible_to_other_platforms(
        self, there: BoolArray, names: Sequence[str]
    ) -> Mapping[str, tuple[BoolArray, IntArray | None]]:
        """Return by platform whom it may see (rows, targets) and the number left out per row."""
        result = {}
        for view in self._views[1:]:
            place = int(np.searchsorted(self.columns, view.viewer))
            changed = there.copy()
            changed[:, place] = self.own.present
            result[names[view.viewer]] = self._visible_to(view.viewer, changed, there[:, place])
        return result

    def _visible_to(
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
