"""Tracks of which nothing comes: they end in time, though nobody looks.

Where a fusion tells of looks in vain, or others are seen, a track that is missed ends at a look.
Where nothing at all comes, as from a fusion that passes on detections alone, a file without empty
looks or a sensor that has stopped, it ends at the first instant at which its tracker is awake.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from components.messages.state_tracks import DELETED
from components.tracking.track_store import TrackStore, tracks_after
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import RunTicks, last_of_run, next_of_run
from dsa_des.arrays.types import IntArray


@dataclass(frozen=True, eq=False)
class Silence:
    """The rows of a wake at which a tracker is awake and no look is worked on.

    They are numbered from 0, those of each run together. Within a second of a look nothing is
    silent: the next look says as much.
    """

    instants: RunTicks  # Of all rows of the wake
    rows: IntArray  # Which of them are silent, ascending
    late_ticks: int  # So much later than it was made a detection may come
    ticks_per_s: int

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def silent(self) -> RunTicks:
        """When they are."""
        return self.instants.take(self.rows)

    def before(self, row: IntArray, worked: IntArray) -> tuple[IntArray, IntArray]:
        """Return for works at some rows of the wake the silence since the work before it.

        It is the silent rows from the first to the second: none where the second is less. `worked`
        is when the last work of each one's run was, before this wake.
        """
        at = self.instants.take(row)
        order = np.lexsort((row, at.run))
        run, since = at.run[order], worked.copy()
        again = run[1:] == run[:-1]
        since[order[1:][again]] = at.tick[order[:-1][again]]
        return self._first(at.run, since), last_of_run(self.silent, at)

    def after(self, run: IntArray, worked: IntArray) -> tuple[IntArray, IntArray]:
        """Return the silent rows of some runs from their last work on."""
        ends = next_of_run(self.silent, RunTicks(run + 1, np.zeros_like(run)))
        return self._first(run, worked), ends - 1

    def _first(self, run: IntArray, worked: IntArray) -> IntArray:
        return next_of_run(self.silent, RunTicks(run, worked + self.ticks_per_s))

    def ended(
        self, store: TrackStore, records: KeyedTable, first: IntArray, last: IntArray
    ) -> tuple[TrackStore, list[TrackStore]]:
        """Return the tracks that live on, and what is reported of the runs in which some do not.

        Looked through are the tracks of the runs of `records`, at silent rows of each from `first`
        to `last`.
        """
        index = np.minimum(records.replica.searchsorted(store.replica), len(records) - 1)
        over = store.updated_tick + store.life_ticks + self.late_ticks
        row = np.maximum(next_of_run(self.silent, RunTicks(store.replica, over + 1)), first[index])
        due = (records.replica[index] == store.replica) & (store.status != DELETED)
        due &= row <= last[index]
        if not due.any():
            return store, []
        reported = []
        for one in np.unique(row[due]).tolist():
            mine = np.flatnonzero(records.replica == self.silent.run[one])
            shown = (store.replica == self.silent.run[one]) & (store.status != DELETED)
            status = np.where(due & (row == one), DELETED, store.status)
            now = store.with_columns(status=status).take(shown & ~(due & (row < one)))
            reported.append(tracks_after(now, records.take(mine), self.rows[[one]]))
        return store.take(~due), reported
