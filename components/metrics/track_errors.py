"""How wrong tracks are at which range (``track_errors_by_range``), against bounds such as DO-365's.

Of every run there is one sample at each range: the instant at which a target is nearest to it,
while a sensor covers it, and the track of that target. So samples of different runs are
independent, and the quantile of an error over runs has an interval by order statistics.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from components.arguments.units import NAUTICAL_MILE_M
from components.messages.columns import ORIGIN, STATE
from components.messages.state_tracks import is_confirmed_or_coasted
from components.metrics.flown_flights import PlatformTracks
from components.metrics.rows import PlatformParameters
from components.metrics.true_states import (
    Coverage,
    position_and_presence_in_frame,
    states_and_presence_in_frame,
)
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result

_TABLE = "state_tracks"
_ERRORS = {
    "error_across_m": "horizontal error of the position across the line of sight, m",
    "error_horizontal_m": "horizontal error of the position, m",
    "error_vertical_m": "vertical error of the position, m",
    "error_horizontal_rate_m_s": "horizontal error of the velocity, m/s",
    "error_vertical_rate_m_s": "vertical error of the velocity, m/s",
}


class ErrorsByRangeParameters(PlatformParameters):
    """At which ranges errors are evaluated, and which quantile of them is the result."""

    ranges_nmi: tuple[float, ...] = Field(
        default=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), min_length=1, max_length=40,
        description="Ranges at which tracks are looked at, nautical miles.",
    )  # fmt: skip
    quantile: float = Field(
        default=0.95, gt=0, lt=1, description="Share of the runs whose error is at most the result."
    )
    from_s: float = Field(
        default=30.0, ge=0,
        description="Time from which on instants count, s: a target that is near when the run "
        "begins would have been tracked before.",
    )  # fmt: skip
    step_s: float = Field(
        default=1.0, gt=0, le=10,
        description="Spacing of the instants that are looked at, s; a track is at most twice as "
        "old.",
    )  # fmt: skip
    within_m: float = Field(
        default=3000.0, gt=0, description="Distance up to which a track is the target's, m."
    )


class ErrorsByRange(PlatformTracks):
    """Quantiles of the errors of confirmed tracks at given ranges, and the share with a track."""

    Parameters = ErrorsByRangeParameters
    tables = {_TABLE: ("block", "time_s", "state_s", "track_status", "has_range", *STATE, *ORIGIN)}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if any(not 0.0 < r <= 1000.0 for r in self.p.ranges_nmi):
            raise ValueError("ranges_nmi: must lie above 0, at most 1000")
        if len(set(self.p.ranges_nmi)) < len(self.p.ranges_nmi):
            raise ValueError("ranges_nmi: names a range twice")

    def results(self) -> list[Result]:
        """Return a result for each kind of error and range, and where tracks begin."""
        share = f"{100 * self.p.quantile:g} % quantile over runs"
        results = [Result("first_track_range_nmi", NUMBER, "range at the first confirmed track")]
        for r in self.p.ranges_nmi:
            results.append(Result(f"tracked.{r:g}", EVENT, f"there is a track at {r:g} nmi"))
            results += [
                Result(f"{name}.{r:g}", NUMBER, f"{what}, at {r:g} nmi: {share}",
                       quantile=self.p.quantile, least=0.0)
                for name, what in _ERRORS.items()
            ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return replicas' track errors by range, whether tracked there, first track's range."""
        values = {result.name: np.full(len(group), np.nan) for result in self.results()}
        columns: Any = group.tables[_TABLE]
        kept = is_confirmed_or_coasted(columns["track_status"]) & np.asarray(
            columns["has_range"], dtype=bool
        )
        names = columns["block"].names
        aboard = [names.index(name) for name in self.blocks_on_board(names)]
        kept &= np.isin(columns["block"].codes, aboard)
        replica = np.asarray(columns["replica"])[kept]
        rows = np.flatnonzero(kept)
        starts = np.searchsorted(replica, np.arange(len(group) + 1))
        for number, scene in enumerate(group.scenes):
            mine = rows[starts[number] : starts[number + 1]]
            end_s = float(group.duration_s[number])
            coverage = self.coverage(scene, self.flights(group, number))
            for name, value in self._run_errors(columns, mine, coverage, end_s).items():
                values[name][number] = value
        return values

    def _run_errors(
        self, columns: Any, rows: IntArray, coverage: Coverage, end_s: float
    ) -> dict[str, float]:
        own, targets = coverage.aircraft
        time_s = np.arange(self.p.from_s, end_s + 1e-9, self.p.step_s)
        values: dict[str, float] = {}
        if not len(targets) or not len(time_s):
            return values
        state = own.at(time_s)
        origin = np.stack([np.broadcast_to(v, time_s.shape) for v in
                           (state.lat_deg, state.lon_deg, state.alt_m)])  # fmt: skip
        error, rows, of, first_m = self._row_errors_and_targets(columns, rows, own, targets)
        if math.isfinite(first_m):
            values["first_track_range_nmi"] = first_m / NAUTICAL_MILE_M
        told_s = columns["time_s"][rows]
        range_m = np.full((len(targets), len(time_s)), np.inf)
        for number, target in enumerate(targets):
            position, there = position_and_presence_in_frame(target, time_s, origin)
            seen = coverage.is_covered(target, time_s) & there
            range_m[number, seen] = np.sqrt((position[:, seen] ** 2).sum(axis=0))
        for r in self.p.ranges_nmi:
            target, k = _target_and_instant_at_range(range_m, r * NAUTICAL_MILE_M)
            if k < 0:
                continue
            inside = (told_s <= time_s[k] + 1e-9) & (told_s > time_s[k] - 2.0 * self.p.step_s)
            inside &= of == target
            values[f"tracked.{r:g}"] = float(inside.any())
            if inside.any():
                last = int(np.flatnonzero(inside)[-1])
                values |= {f"{n}.{r:g}": float(error[n][last]) for n in _ERRORS}
        return values

    def _row_errors_and_targets(
        self, columns: Any, rows: IntArray, own: Any, targets: Sequence[Any]
    ) -> tuple[dict[str, FloatArray], IntArray, IntArray, float]:
        """Return row errors by name, targets' rows, the target of each, and the first's range (m).

        A row is of the target that is nearest to it.
        """
        origin = np.stack([columns[name][rows] for name in ORIGIN])
        estimate = np.stack([columns[name][rows] for name in STATE])
        true, there = states_and_presence_in_frame(targets, columns["state_s"][rows], origin)
        away_m = np.sqrt(((estimate[:3] - true[:, :3]) ** 2).sum(axis=1))
        away_m = np.where(there, away_m, np.inf)
        of = away_m.argmin(axis=0)
        mine = away_m.min(axis=0) < self.p.within_m
        rows, of, origin = rows[mine], of[mine], origin[:, mine]
        true = true[of, :, np.flatnonzero(mine)].T
        apart = estimate[:, mine] - true
        seen_from, _ = position_and_presence_in_frame(own, columns["state_s"][rows], origin)
        sight = true[:3] - seen_from
        with np.errstate(invalid="ignore", divide="ignore"):
            level = np.hypot(sight[0], sight[1])
            across = np.abs(apart[0] * sight[1] - apart[1] * sight[0]) / level
        error = dict(
            zip(
                _ERRORS,
                (across, np.hypot(apart[0], apart[1]), np.abs(apart[2]),
                 np.hypot(apart[3], apart[4]), np.abs(apart[5])),
                strict=True,
            )
        )  # fmt: skip
        first = float(np.sqrt((sight[:, 0] ** 2).sum())) if len(rows) else math.nan
        return error, rows, of, first


def _target_and_instant_at_range(range_m: FloatArray, wanted_m: float) -> tuple[int, int]:
    """Return target and instant (indices) with range nearest the wanted; (-1, -1) if none near.

    Within half a mile of it, or -1; ranges of who is not seen are infinite.
    """
    target, k = np.unravel_index(np.argmin(np.abs(range_m - wanted_m)), range_m.shape)
    near = abs(range_m[target, k] - wanted_m) <= 0.5 * NAUTICAL_MILE_M
    return (int(target), int(k)) if near else (-1, -1)
