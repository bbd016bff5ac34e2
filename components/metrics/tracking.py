"""How good estimated tracks are against the truth (``tracking``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from components.messages.columns import ORIGIN, STATE
from components.messages.state_tracks import (
    COVARIANCE,
    covariance_matrices,
    is_confirmed_or_coasted,
)
from components.metrics.flown_flights import PlatformTracks
from components.metrics.rows import PlatformParameters, is_named
from components.metrics.track_scores import ReportedTracks, TrackTally, innovation_results
from components.metrics.true_states import Coverage, states_and_presence_in_frame
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import FRACTION, NUMBER, Group, Result, blocks_recording

_TABLE = "state_tracks"
_MOST_STRETCHES = 400

_RESULTS = {
    "track_nees_mean": "mean normalised error squared of tracks' states; 6 if consistent",
    "track_nees_inside": "share of them within the 95 % bounds of chi-square with 6 degrees",
    "track_nis_per_freedom": "normalised innovations squared by the quantities measured; 1 if "
    "predictions are consistent",
    "track_nis_inside": "share of them within the 95 % bounds of chi-square",
    "track_position_error_m": "distance of tracks from their targets, rms, m",
    "track_horizontal_error_m": "its horizontal part, rms, m",
    "track_vertical_error_m": "its vertical part, rms, m",
    "track_velocity_error_m_s": "error of their velocity, rms, m/s",
    **{
        f"track_{axis}_error_{unit}": f"error of their {what} {axis}, rms, {written}"
        for what, unit, written in (("position", "m", "m"), ("velocity", "m_s", "m/s"))
        for axis in ("north", "east", "down")
    },
    "track_ospa_m": "OSPA distance of tracks and targets, mean over time, m",
    "track_gospa_m": "GOSPA distance, mean over time, m",
    "track_gospa_localisation_m": "its part of pairs, mean over time, m",
    "track_gospa_missed_m": "its part of targets without a track, mean over time, m",
    "track_gospa_false_m": "its part of tracks without a target, mean over time, m",
    "track_completeness": "share of the targets' time that they have a track (SIAP)",
    "track_ambiguity": "tracks of a target that has any, mean over time (SIAP)",
    "track_spuriousness": "share of the tracks' time that they have no target (SIAP)",
    "track_positional_accuracy_m": "distance of tracks from their targets, mean, m (SIAP)",
    "track_velocity_accuracy_m_s": "size of their velocity's error, mean, m/s (SIAP)",
    "track_number_changes_per_s": "changes of track number by the time tracked, 1/s (SIAP)",
    "track_longest_share": "share of targets' time that they keep their longest track (SIAP)",
    "track_confirmation_s": "time from a target's first detection to its first confirmed track, "
    "mean, s",
    "track_confirmation_from_coverage_s": "the same from when it enters the field and range of a "
    "sensor, mean, s",
    "track_confirmed_share": "share of the targets that ever are covered that get such a track",
    "track_false_per_hour": "confirmed tracks that never have a target, per hour",
    "track_broken": "times that a target's track goes on under a new number",
    "track_swapped": "times that it goes on under a number that was another target's",
}


class TrackingParameters(PlatformParameters):
    """When tracks are compared with the truth, and how far a track may be from its target."""

    block: str | None = Field(
        default=None,
        description="Whose tracks; results then bear its name. By default those of the blocks "
        "whose tracks go into no other's.",
    )
    step_s: float = Field(
        default=0.5, gt=0, le=60, description="Time from one comparison to the next, s."
    )
    from_s: float = Field(
        default=0.0, ge=0, description="Time from which on instants count, s: starts left out."
    )
    within_m: float = Field(
        default=300.0, gt=0,
        description="Distance up to which a track may be a target's; cut-off of OSPA and GOSPA, m.",
    )  # fmt: skip
    order: float = Field(default=2.0, ge=1, le=10, description="Power p of OSPA and GOSPA.")
    series_s: float | None = Field(
        default=None, gt=0,
        description="Length of stretches of the run, s: the normalised error squared at the last "
        "comparison in each is a result of its own, for a figure over time.",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_series_step(self) -> Any:
        if self.series_s is not None and self.series_s < self.step_s:
            raise ValueError(
                f"series_s = {self.series_s:g} is shorter than step_s = {self.step_s:g}, the time "
                "from one comparison to the next; allowed: at least as long"
            )
        return self


class Tracking(PlatformTracks):
    """Compares confirmed tracks that have a range with all targets, instant by instant.

    At every instant of the grid the last tracks that each block reported count, gone on at their
    velocities since, each against the truth of the instant its state then speaks of. How tracks and
    targets belong together, and what is counted: `TrackTally`; what covers a target: `Coverage`.
    """

    Parameters = TrackingParameters
    tables = {
        _TABLE: (
            "block", "time_s", "state_s", "track", "track_status", "has_range", "nis",
            "nis_freedom",
            *STATE, *ORIGIN, *COVARIANCE.values(),
        ),
        "detections": ("block", "time_s", "target"),
    }  # fmt: skip

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        known, block = self.blocks_on_board(blocks_recording(scene, _TABLE)), self.p.block
        if block is not None and block not in known:
            raise ValueError(f"block: {block!r} tells no tracks{did_you_mean(block, known)}")
        self._ends_s: list[float] = []
        if self.p.series_s is not None:
            many = int(Coverage(scene).duration_s / self.p.series_s)
            if not 1 <= many <= _MOST_STRETCHES:
                raise ValueError(
                    f"series_s: {self.p.series_s:g} s makes {many} stretches of the run; allowed: "
                    f"1 to {_MOST_STRETCHES}"
                )
            self._ends_s = [(k + 1) * self.p.series_s for k in range(many)]

    def results(self) -> list[Result]:
        """Return the definitions of the results: errors, consistency, set distances and identity
        scores, and the error over time.
        """
        of = "" if self.p.block is None else f".{self.p.block}"
        series = [
            Result(
                _nees_column_name(end, of),
                NUMBER,
                f"normalised error squared up to {end:g} s",
                least=0.0,
            )
            for end in self._ends_s
        ]
        whole = [
            Result(name + of, FRACTION if says.startswith("share") else NUMBER, says, least=0.0)
            for name, says in _RESULTS.items()
        ]
        return [*whole, *series]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return every track score of each replica by result name."""
        columns: Any = group.tables[_TABLE]
        of = "" if self.p.block is None else f".{self.p.block}"
        outcome = {result.name: np.full(len(group), np.nan) for result in self.results()}
        confirmed = is_confirmed_or_coasted(columns["track_status"])
        replica = np.asarray(columns["replica"])
        for number, scene in enumerate(group.scenes):
            asked = self._is_of_wanted_block(columns["block"], scene)
            flights = self.flights(group, number)
            coverage = self.coverage(scene, flights)
            mine = np.flatnonzero((replica == number) & asked)
            tally, names = self._tally(
                columns, mine, confirmed, flights[1:], float(group.duration_s[number])
            )
            first = _first_detection_times_s(
                group.tables["detections"], number, self.blocks_on_board
            )
            entered = coverage.first_covered_s(self.p.step_s, float(group.duration_s[number]))
            values = tally.results(names, first, entered, float(group.duration_s[number]))
            values |= innovation_results(*self._nis_and_freedom(columns, mine[confirmed[mine]]))
            for name, value in values.items():
                outcome[name + of][number] = value
            for end in self._ends_s:
                outcome[_nees_column_name(end, of)][number] = tally.mean_nees_at_last_instant(
                    end - self.p.series_s, end
                )
        return outcome

    def _is_of_wanted_block(self, column: Any, scene: Scene) -> Any:
        """Return which rows are of the wanted block, by default of any feeding no recorded one."""
        names = self.blocks_on_board(column.names)
        fed = {
            source for source, target in scene.graph.edges if source in names and target in names
        }
        last = [name for name in names if name not in fed]
        wanted = last if self.p.block is None else [self.p.block]
        return np.isin(column.codes, [i for i, name in enumerate(column.names) if name in wanted])

    def _tally(
        self,
        columns: Any,
        rows: IntArray,
        confirmed: BoolArray,
        targets: list[Any],
        duration_s: float,
    ) -> tuple[TrackTally, list[str]]:
        tally = TrackTally(self.p.within_m, self.p.order, self.p.step_s)
        grid = np.arange(self.p.step_s, duration_s + 1e-9, self.p.step_s)
        grid = grid[grid >= self.p.from_s]
        kept = confirmed & np.asarray(columns["has_range"], dtype=bool)  # of no rows it has no type
        key = _unique_track_number_of_rows(columns)
        first, confirmed_row = np.unique(key[rows[kept[rows]]], return_index=True)
        confirmed_s = columns["time_s"][rows[kept[rows]][confirmed_row]]
        instant, row = _valid_instant_row_pairs(columns, rows, grid)
        instant, row = instant[kept[row]], row[kept[row]]
        order = np.lexsort((row, instant))
        instant, row = instant[order], row[order]
        is_new = np.zeros(len(row), dtype=bool)
        is_new[np.unique(row, return_index=True)[1]] = True
        state = np.stack([columns[name][row] for name in STATE])
        origin = np.stack([columns[name][row] for name in ORIGIN])
        since_s, state_s = grid[instant] - columns["time_s"][row], columns["state_s"][row]
        as_reported = np.full((len(targets), *state.shape), np.nan)
        true, _ = states_and_presence_in_frame(targets, state_s[is_new], origin[:, is_new])
        as_reported[:, :, is_new] = state[:, is_new] - true
        state[:3] += state[3:] * since_s
        error = state - states_and_presence_in_frame(targets, state_s + since_s, origin)[0]
        covariance = np.moveaxis(covariance_matrices(columns, row), -1, 0)
        there = [np.broadcast_to(t.at(grid).present, grid.shape) for t in targets]
        present = np.array(there, dtype=bool).reshape(len(targets), len(grid))
        number, since = key[row], confirmed_s[np.searchsorted(first, key[row])]
        ends = np.searchsorted(instant, np.arange(len(grid) + 1))
        for k, time_s in enumerate(grid.tolist()):
            mine = slice(ends[k], ends[k + 1])
            tracks = ReportedTracks(
                time_s, number[mine], error[:, :, mine], as_reported[:, :, mine],
                covariance[mine], is_new[mine], since[mine],
            )  # fmt: skip
            tally.add(tracks, np.flatnonzero(present[:, k]))
        return tally, [target.name for target in targets]

    def _nis_and_freedom(self, columns: Any, rows: IntArray) -> tuple[FloatArray, IntArray]:
        """Return confirmed tracks' NIS, each once, and their degrees of freedom."""
        kept = (columns["nis_freedom"][rows] > 0) & (columns["state_s"][rows] >= self.p.from_s)
        rows = rows[kept]
        # A look that is worked on again, after an out-of-sequence one, is reported again.
        track, when = _unique_track_number_of_rows(columns)[rows], columns["state_s"][rows]
        order = np.lexsort((when, track))
        same = (np.diff(track[order]) == 0) & (np.diff(when[order]) == 0)
        rows = rows[order[np.append(~same, np.ones(min(len(rows), 1), dtype=bool))]]
        return columns["nis"][rows], columns["nis_freedom"][rows]


def _nees_column_name(end_s: float, of: str) -> str:
    return f"track_nees.time_s{of}.{end_s:g}"


def _unique_track_number_of_rows(columns: Any) -> IntArray:
    """Return a number for each row that is unique for its block and track."""
    track = np.asarray(columns["track"], dtype=np.int64)
    return columns["block"].codes * (track.max(initial=0) + 1) + track


def _valid_instant_row_pairs(
    columns: Any, rows: IntArray, grid: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return pairs as two arrays: the index of a grid instant and a row that is valid at it.

    A report stands from its own instant until its block's next one. A block reports all of its
    tracks at once, and the end of each, so that one without rows was left without tracks before.
    """
    instants, standing = [], []
    for code in np.unique(columns["block"].codes[rows]).tolist():
        mine = rows[columns["block"].codes[rows] == code]
        told_s, start = np.unique(columns["time_s"][mine], return_index=True)
        end = np.append(start[1:], len(mine))
        last = np.searchsorted(told_s, grid + 1e-9, side="right") - 1
        at = np.flatnonzero(last >= 0)
        count = (end - start)[last[at]]
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        instants.append(np.repeat(at, count))
        standing.append(mine[np.repeat(start[last[at]], count) + within])
    none = rows[:0]
    return np.concatenate([none, *instants]), np.concatenate([none, *standing])


def _first_detection_times_s(columns: Any, replica: int, on_board: Any) -> dict[str, float]:
    names = columns["block"].names
    aboard = [names.index(name) for name in on_board(names)]
    mine = (np.asarray(columns["replica"]) == replica) & np.isin(columns["block"].codes, aboard)
    result = {}
    for name in columns["target"].names:
        rows = mine & is_named(columns["target"], name)
        if rows.any():
            result[name] = float(columns["time_s"][rows].min())
    return result
