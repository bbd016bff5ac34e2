"""When a detection of a track is due: what sensors promise, what counts as missed, and silence.

A look counts for a track only if the track lies in the field of the sensor, and only of sensors
that see it: one that never hit it, or that has missed it for a while where another one hits, may be
too far away, and says nothing. Nor does one that has reported the track, or was counted as missing
it, within the time in which it promises a report.

Where a fusion tells of looks in vain, or others are seen, a track that is missed ends at a look.
Where nothing at all comes, as from a fusion that passes on detections alone, a file without empty
looks or a sensor that has stopped, it ends at the first instant at which its tracker is awake.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, Self

import numpy as np

from components.estimation.batched import squared_length
from components.estimation.frame import SensorPose
from components.estimation.measurement import Kind, expected_measurement
from components.messages.detections import SensorOffer
from components.messages.reach import EVALUATE, Reach
from components.messages.state_tracks import DELETED
from components.tracking.scans import LookBatch
from components.tracking.track_store import NEVER, TrackStore, tracks_to_report
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import (
    RunTicks,
    first_position_at_or_after,
    last_position_at_or_before,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: A track lives without a detection for so long, s, and for so many promises of its sensors.
LIVES_S, LIVES_PROMISES = 6.0, 3.0
#: How often tracks are looked through that nothing comes of, s.
ACTS_EVERY_S = Fraction(1, 2)
#: Looks come a little before their time where a clock jitters.
_NEARLY = 0.9
#: After so many misdetections a sensor is taken not to see a track that another one sees.
BLIND_AFTER = 5


@dataclass(frozen=True, eq=False)
class Promises:
    """Times within which sensors promise to report a visible target again, as steps over range."""

    steps: tuple[tuple[tuple[float, float], ...], ...]  # Of each sensor
    ticks_per_s: int

    @classmethod
    def of(cls, offers: Mapping[str, Any], sensors: tuple[str, ...], ticks_per_s: int) -> Self:
        """Return the promises that the named sensors state in their offers, in ticks."""
        known = (offers.get(name) for name in sensors)
        steps = tuple(one.promises if isinstance(one, SensorOffer) else () for one in known)
        return cls(steps, ticks_per_s)

    def __bool__(self) -> bool:
        """Return whether any does not report at every look."""
        return any(self.steps)

    def promised_ticks(self, sensor: int, range_m: FloatArray) -> FloatArray:
        """Return promised ticks until a sensor reports again at each range; 0: every look."""
        if not (steps := self.steps[sensor]):
            return np.zeros(len(range_m))
        far, within_s = np.array(steps).T
        step = np.minimum(np.searchsorted(far, range_m), len(far) - 1)
        return np.asarray(within_s[step] * self.ticks_per_s)

    def track_life_ticks(self, sees: BoolArray, range_m: FloatArray) -> IntArray:
        """Return how many ticks tracks live undetected; `sees` (sensors, n): who sees one."""
        life = np.full(len(range_m), int(LIVES_S * self.ticks_per_s))
        if not self:
            return life
        soonest = np.full(len(range_m), np.inf)
        for sensor, mine in enumerate(sees):
            promised = LIVES_PROMISES * self.promised_ticks(sensor, range_m)
            soonest = np.minimum(soonest, np.where(mine, promised, np.inf))
        soonest = np.where(np.isinf(soonest), 0.0, soonest)
        return np.maximum(life, soonest.astype(np.int64))


def is_seen_by_sensor(misdetections: IntArray) -> BoolArray:
    """Return where (sensors, tracks) a sensor missed a track rarely, or the least often (mask)."""
    return np.asarray(
        (misdetections < BLIND_AFTER)
        | ((misdetections == misdetections.min(axis=0)) & (misdetections < NEVER))
    )


def is_detection_expected(
    fields: tuple[Reach | None, ...],
    promises: Promises,
    part: TrackStore,
    of: IntArray,
    batch: LookBatch,
    pose: SensorPose,
    direction: FloatArray | None,
) -> BoolArray:
    """Return a mask (sensors, tracks): True where the sensor looked, sees this track, has it in its
    field of view, and a report was due.

    (sensors, tracks)
    """
    scans = batch.scans
    sensors = np.where(scans.tells_misses[batch.look], scans.sensors[batch.look], 0)
    used = int(np.bitwise_or.reduce(sensors)) if len(sensors) else 0
    looked = np.zeros((len(fields), len(part)), dtype=bool)
    if used == 0:
        return looked
    mine = sensors[of]
    sees = is_seen_by_sensor(part.misdetections)
    where: tuple[FloatArray, FloatArray, FloatArray] | None = None
    for i, field in enumerate(fields):
        if not used >> i & 1:
            continue
        looked[i] = (mine >> i & 1).astype(bool) & sees[i]
        if promises:
            promised = _NEARLY * promises.promised_ticks(i, range_or_infinity_m(part, pose))
            looked[i] &= part.tick - part.counted_tick[i] >= promised
        if field is None:
            continue
        if where is None:
            if direction is None:
                direction = expected_measurement(Kind(False), part.state0, pose)
            away = range_or_infinity_m(part, pose)
            where = (*direction, np.where(part.ranged, away, 0.0))
        inside = np.ones(len(part), dtype=bool)
        looked[i] &= field.skip_reasons(*where, inside) == EVALUATE
    return looked


def range_or_infinity_m(part: TrackStore, pose: SensorPose) -> FloatArray:
    """Return the distance of each track from its sensor, m; infinity for tracks without a range."""
    away = np.sqrt(squared_length(part.state0[:3] - pose.position_m))
    return np.where(part.ranged, away, np.inf)


def update_misdetection_counts(
    misdetections: IntArray, by: IntArray, looked: BoolArray
) -> IntArray:
    """Return misses (sensors, tracks) since the last hit: one more where looked, 0 where hit.

    `by` is the mask of the sensors that updated each track.
    """
    new = misdetections.copy()
    hitting = int(np.bitwise_or.reduce(by)) if len(by) else 0
    for i, mine in enumerate(looked):
        new[i] += mine
        if hitting >> i & 1:
            new[i][(by >> i & 1).astype(bool)] = 0
    return new


@dataclass(frozen=True, eq=False)
class Silence:
    """Rows of a wake at which a tracker runs without a look to process, so that tracks may end.

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
    def silent_instants(self) -> RunTicks:
        """Run and tick of each silent row."""
        return self.instants.take(self.rows)

    def silent_rows_before_work(self, row: IntArray, worked: IntArray) -> tuple[IntArray, IntArray]:
        """Return, per processed wake row, the first and last silent row since its run's last work.

        It is the silent rows from the first to the second: none where the second is less. `worked`
        is when the last work of each one's run was, before this wake.
        """
        at = self.instants.take(row)
        order = np.lexsort((row, at.run))
        run, since = at.run[order], worked.copy()
        again = run[1:] == run[:-1]
        since[order[1:][again]] = at.tick[order[:-1][again]]
        return self._first_silent_row(at.run, since), last_position_at_or_before(
            self.silent_instants, at
        )

    def silent_rows_after_work(self, run: IntArray, worked: IntArray) -> tuple[IntArray, IntArray]:
        """Return the first and last silent row after the last work of each run."""
        ends = first_position_at_or_after(
            self.silent_instants, RunTicks(run + 1, np.zeros_like(run))
        )
        return self._first_silent_row(run, worked), ends - 1

    def _first_silent_row(self, run: IntArray, worked: IntArray) -> IntArray:
        return first_position_at_or_after(
            self.silent_instants, RunTicks(run, worked + self.ticks_per_s)
        )

    def end_silent_tracks(
        self, store: TrackStore, records: KeyedTable, first: IntArray, last: IntArray
    ) -> tuple[TrackStore, list[TrackStore]]:
        """Return living tracks, and tables to report of runs where any ended, those as deleted.

        Looked through are the tracks of the runs of `records`, at silent rows of each from `first`
        to `last`.
        """
        index = np.minimum(records.replica.searchsorted(store.replica), len(records) - 1)
        over = store.updated_tick + store.life_ticks + self.late_ticks
        row = np.maximum(
            first_position_at_or_after(self.silent_instants, RunTicks(store.replica, over + 1)),
            first[index],
        )
        due = (records.replica[index] == store.replica) & (store.status != DELETED)
        due &= row <= last[index]
        if not due.any():
            return store, []
        reported = []
        for one in np.unique(row[due]).tolist():
            mine = np.flatnonzero(records.replica == self.silent_instants.run[one])
            shown = (store.replica == self.silent_instants.run[one]) & (store.status != DELETED)
            status = np.where(due & (row == one), DELETED, store.status)
            now = store.with_columns(status=status).take(shown & ~(due & (row < one)))
            reported.append(tracks_to_report(now, records.take(mine), self.rows[[one]]))
        return store.take(~due), reported
