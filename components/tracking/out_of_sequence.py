"""Out-of-sequence measurements: in which order looks are worked on, and what is gone back to.

A look is late if one that was made after it has been worked on. Rungs, from crude to exact:

- ``drop``: it is left out.
- ``one_step``: tracks go one step back to its instant, are corrected there, and what that says of
  them now is carried over; nothing is worked on again, and no track is started.
- ``rerun``: tracks go back to how they were before it, and every look since is worked on again in
  the order in which they were made. What comes out is what would have been had all come in time.

Which looks are late follows from their instants alone; so the order of work is planned for a whole
window before any of it is done.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from components.messages.detections import SensorOffer
from components.tracking.scans import Scans
from components.tracking.track_store import TrackStore
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.component import Producer
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added
from dsa_des.time.clock import ClockSpec


class Snapshot(NamedTuple):
    """The tracks and next track number of a replica just before a look was processed."""

    store: TrackStore  # With this replica's tracks among others
    next_number: int


@dataclass(frozen=True, eq=False)
class Plan:
    """Order in which looks are processed, as columns with a row for each step."""

    forgotten: list[list[int]]  # Looks that need not be remembered after each
    look: IntArray
    of: IntArray  # Index of the replica
    row: IntArray  # Of the wake, that brings it about
    # Newest look by then: where tracks are seen from when they are reported
    seen_from: IntArray
    back_to: IntArray  # Look before which the tracks are gone back to first; -1 for none
    # Of a look that is worked on in one step, the first look of those made since; -1 of others
    since: IntArray

    @property
    def is_reported_after(self) -> BoolArray:
        """Mask over steps: True for a wake row's last step, after which tracks are reported."""
        return np.append(self.row[1:] != self.row[:-1], True)[: len(self.row)]

    @property
    def begins_several(self) -> BoolArray:
        """Mask over steps: True where the step is the first of several in its row of the wake."""
        return (
            np.append(True, self.row[1:] != self.row[:-1])[: len(self.row)]
            & ~self.is_reported_after
        )


@dataclass(frozen=True, eq=False)
class Past:
    """Looks kept, in order made, as an older one may yet arrive, with the tracks before each."""

    scans: Scans
    before: list[Snapshot]  # Of each look

    def __len__(self) -> int:
        return len(self.before)

    def split_runs(self, runs: IntArray, first_run: int) -> tuple["Past", "Past"]:
        """Return the given runs' kept looks, and all other runs' from `first_run` on."""
        run = self.scans.run
        mine = np.isin(run, runs)
        parts = [np.flatnonzero(which) for which in (mine, ~mine & (run >= first_run))]
        one, other = (Past(self.scans.take(p), [self.before[i] for i in p.tolist()]) for p in parts)
        return one, other

    @classmethod
    def from_looks(
        cls, scans: Scans, looks: list[int], before: Mapping[int, Snapshot], others: "Past | None"
    ) -> "Past":
        """Return the given looks, each with the tracks of its run before it, then `others`."""
        kept = []
        for look in looks:
            store, next_number = before[look]
            kept.append(Snapshot(store.take(store.replica == scans.run[look]), next_number))
        mine = scans.take(np.array(looks, dtype=np.int64))
        if others is None or not len(others):
            return cls(mine, kept)
        return cls(Scans.concatenate([mine, others.scans]), kept + others.before)


def plan_with_late_looks(
    scans: Scans, of: IntArray, begin: int, lag_ticks: int, *, rerun: bool
) -> tuple[Plan, list[int], list[int]]:
    """Return the plan of steps including late looks, looks too late (left out), and looks to keep.

    Looks before `begin` are those remembered; `of` is the index of each one's replica. With `rerun`
    late looks have all since them worked on again, else they are worked on in one step.
    """
    # When each look was made, and the first of its sensors: looks of one instant go by sensor.
    first: list[int] = (scans.sensors & -scans.sensors).tolist()
    keys: list[tuple[int, int]] = list(zip(scans.tick.tolist(), first, strict=True))
    key_of: Callable[[int], tuple[int, int]] = keys.__getitem__
    row = scans.row.tolist()
    remembered: dict[int, list[int]] = {}
    works: list[tuple[int, int, int, int, int, int]] = []
    forgotten: list[list[int]] = []
    left_out = []
    for look, number in enumerate(of.tolist()):
        known, key = remembered.setdefault(number, []), keys[look]
        if look < begin:
            known.append(look)
            continue
        newest = keys[known[-1]][0] if known else key[0]
        if key[0] < newest - lag_ticks:
            left_out.append(look)
            continue
        again = known[bisect_left(known, key, key=key_of) :] if rerun else []
        since = -1
        if key[0] < newest and not rerun:
            since = known[bisect_left(known, (key[0] + 1, 0), key=key_of)]
        else:
            known.insert(len(known) - len(again), look)
        # The look itself may be forgotten at once, though not before what it changes is done.
        oldest = keys[known[-1]][0] - lag_ticks
        gone = bisect_left(known, (oldest, 0), key=key_of)
        forgotten += [[] for _ in again] + [known[:gone]]
        del known[:gone]
        back_to = again[0] if again else -1
        for work in (look, *again):
            works.append((work, number, row[look], work if rerun else known[-1], back_to, since))
            back_to = -1
    columns = list(np.array(works, dtype=np.int64).reshape(-1, 6).T)
    kept = [look for known in remembered.values() for look in known]
    return Plan(forgotten, *columns), left_out, kept


def plan_without_late_looks(scans: Scans, of: IntArray, newest: IntArray) -> tuple[Plan, list[int]]:
    """Return the plan in order of arrival, and looks left out as their replica had a newer one."""
    so_far = RunTicks(of, scans.tick).running_largest_tick().tick
    keep = (scans.tick >= so_far) & (scans.tick >= newest[of])
    look = np.flatnonzero(keep)
    none = np.full(len(look), -1)
    plan = Plan([], look, of[look], scans.row[look], look, none, none)
    return plan, np.flatnonzero(~keep).tolist()


def tracks_before(
    before: Mapping[int, Snapshot], looks: list[int], replicas: list[int]
) -> TrackStore:
    """Return the tracks of some replicas (ascending) as they were before one given look of each."""
    by_store: dict[int, tuple[TrackStore, list[int]]] = {}
    for look, replica in zip(looks, replicas, strict=True):
        store = before[look].store
        by_store.setdefault(id(store), (store, []))[1].append(replica)
    parts = [store.take(np.isin(store.replica, mine)) for store, mine in by_store.values()]
    return TrackStore.concatenate(parts).sort()


# Looks whose fate is worked out.
_MOST_LOOKS = 2000


def may_come_late(offers: Mapping[str, Any], producers: Iterable[Producer]) -> bool:
    """Return whether a look may arrive after a look that was made later."""
    return (
        not offers
        or any(one.jitter_s > 0 or one.unforeseen for one in producers)
        or any(
            not isinstance(o, SensorOffer) or o.latest_s is None or o.latest_s > 0 or o.unforeseen
            for o in offers.values()
        )
    )


def max_lateness_s(offers: Mapping[str, Any], producers: Iterable[Producer]) -> Fraction:
    """Return a look's largest delay, s, by the scene's latencies and jitter, without queues."""
    late_s = [o.latest_s or 0 for o in offers.values() if isinstance(o, SensorOffer)]
    return Fraction(max(late_s, default=0) + max((one.latest_s for one in producers), default=0))


def late_look_shares(
    offers: Mapping[str, Any], lag_s: Fraction, duration_s: Fraction
) -> dict[str, float]:
    """Return, by sensor, the share of looks that a look newer by more than `lag_s` may overtake."""
    said = {
        name: (o.clock(), o.latest_s, o.jitter_s)
        for name, o in sorted(offers.items())
        if isinstance(o, SensorOffer) and o.clock is not None and o.latest_s is not None
    }
    shares = {}
    for name, (clock, latest, jitter) in said.items():
        others = [
            (theirs, latest - (last - spread))
            for other, (theirs, last, spread) in said.items()
            if other != name
        ]
        # Its own looks overtake each other by jitter alone.
        others.append((clock, jitter))
        ahead_s = [(one, by_s) for one, by_s in others if by_s > lag_s]
        if not ahead_s:
            continue
        looks = [t for k in range(_MOST_LOOKS) if (t := _instant(clock, k)) < duration_s]
        late = sum(any(_is_overtaken(t, one, by_s, lag_s) for one, by_s in ahead_s) for t in looks)
        if late:
            shares[name] = late / len(looks)
    return shares


def _is_overtaken(t: Fraction, clock: ClockSpec, by_s: Fraction, lag_s: Fraction) -> bool:
    """Return whether a clock has an instant between ``t + lag_s`` and ``t + by_s``."""
    after = (t + lag_s - clock.offset_s) // clock.period_s + 1
    return _instant(clock, max(int(after), 0)) < t + by_s


def _instant(clock: ClockSpec, scan: int) -> Fraction:
    return clock.offset_s + scan * clock.period_s


def late_looks_warning(name: str, share: float, why: str) -> str:
    """Return a sentence: up to this share of a sensor's looks are too late and left out."""
    return f"{why}: up to {share:.0%} of the looks of {name} come too late and are left out"


@dataclass(frozen=True, eq=False)
class LookCount:
    """Numbers of each sensor's looks per run, and of those left out because they came too late."""

    #: By name of the sensor: of each run those left out, and all (2, runs).
    counts: Mapping[str, IntArray] = field(default_factory=dict)

    def add_looks(
        self, sensors: tuple[str, ...], looks: Scans, came: slice, left_out: IntArray | list[int]
    ) -> "LookCount":
        """Return new counts with looks that arrived and looks that were left out added."""

        def runs_of(some: slice | IntArray | list[int], sensor: int) -> IntArray:
            return looks.run[some][(looks.sensors[some] >> sensor & 1).astype(bool)]

        return LookCount(
            {
                name: counts_with_cases_added(
                    self.counts.get(name, NO_COUNTS), runs_of(left_out, i), runs_of(came, i)
                )
                for i, name in enumerate(sensors)
            }
        )

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by sensor, the number of looks per run that came too late, and of all looks."""
        return {
            f"a look of {name} comes too late and is left out": counts
            for name, counts in sorted(self.counts.items())
        }

    def late_look_statistics(self) -> dict[str, dict[str, float]]:
        """Return, by sensor that lost looks, its looks, how many were left out, their share."""
        both = {name: of.sum(axis=1).tolist() for name, of in sorted(self.counts.items())}
        return {
            name: {"looks": looks, "left_out": lost, "share": lost / looks}
            for name, (lost, looks) in both.items()
            if lost
        }
