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
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from components.messages.detections import SensorOffer
from components.tracking.scans import Scans
from components.tracking.track_store import TrackStore
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.component import Producer
from dsa_des.time.clock import ClockSpec

#: When a look was made, and the first of its sensors: looks of one instant go by sensor.
Key = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The tracks of a replica before a look was worked on."""

    store: TrackStore  # With this replica's tracks among others
    next_number: int


@dataclass
class Memory:
    """The looks of one replica that may still have to be worked on again, in order."""

    keys: list[Key] = field(default_factory=list)  # When each was made, and by whom
    looks: list[int] = field(default_factory=list)  # Its number among the looks of the wake


@dataclass(frozen=True, eq=False)
class Plan:
    """The order in which looks are worked on."""

    look: IntArray
    back_to: IntArray  # (works,), look before which the tracks are gone back to first; -1 for none
    # (works,), of a look that is worked on in one step, the first look of those made since; -1
    # of others
    since: IntArray
    # (works,), newest look by then: where tracks are seen from when they are reported
    seen_from: IntArray
    # (works,) of bool, whether tracks are reported after it: it is the last work that a row brings
    reports: BoolArray
    of: IntArray  # (works,), index of the replica
    row: IntArray  # (works,), row of the wake that brings it about
    forgotten: list[list[int]]  # Looks that need not be remembered after each


@dataclass(frozen=True, eq=False)
class Past:
    """The looks of a run that later ones may still come before, with snapshots of its tracks."""

    replica: int
    scans: Scans
    before: dict[int, Snapshot]

    @classmethod
    def of(cls, scans: Scans, memory: Memory, before: dict[int, Snapshot], replica: int) -> "Past":
        """Return the looks in memory, numbered anew in their order."""
        kept = {
            new: Snapshot(
                before[old].store.take(before[old].store.replica == replica),
                before[old].next_number,
            )
            for new, old in enumerate(memory.looks)
        }
        return cls(replica, scans.take(np.array(memory.looks, dtype=np.int64)), kept)

    def memory(self, first: int) -> Memory:
        """Return the looks in memory, numbered from `first` on."""
        return Memory(keys_of(self.scans), list(range(first, first + len(self.scans))))

    def numbered(self, first: int) -> dict[int, Snapshot]:
        """Return how tracks were before each of its looks, numbered from `first` on."""
        return {first + look: before for look, before in self.before.items()}


def keys_of(scans: Scans) -> list[Key]:
    """Return when each look was made, and the first of its sensors."""
    first = scans.sensors & -scans.sensors
    return list(zip(scans.tick.tolist(), first.tolist(), strict=True))


def rerun_plan(
    scans: Scans, of: IntArray, begin: int, memory: dict[int, Memory], lag_ticks: int
) -> tuple[Plan, list[int]]:
    """Return the order of work where late looks have all since them worked on again."""
    keys = keys_of(scans)
    row = scans.row.tolist()
    look: list[int] = []
    back_to: list[int] = []
    brought_by: list[int] = []
    replica: list[int] = []
    forgotten: list[list[int]] = []
    left_out: list[int] = []
    for new, number in zip(range(begin, len(scans)), of[begin:].tolist(), strict=True):
        known = memory.setdefault(number, Memory())
        key = keys[new]
        if known.keys and key[0] < known.keys[-1][0] - lag_ticks:
            left_out.append(new)
            continue
        here = bisect_left(known.keys, key)
        again = known.looks[here:]
        known.keys.insert(here, key)
        known.looks.insert(here, new)
        oldest = known.keys[-1][0] - lag_ticks
        gone = 0
        while known.keys[gone][0] < oldest:
            gone += 1
        # The look itself may be forgotten at once, though not before what it changes is done.
        past, known.keys, known.looks = known.looks[:gone], known.keys[gone:], known.looks[gone:]
        works = [new, *again]
        look += works
        back_to += [again[0] if again else -1, *([-1] * len(again))]
        brought_by += [row[new]] * len(works)
        replica += [number] * len(works)
        forgotten += [[] for _ in again] + [past]
    return _planned(look, back_to, None, look, brought_by, replica, forgotten), left_out


def one_step_plan(
    scans: Scans, of: IntArray, begin: int, memory: dict[int, Memory], lag_ticks: int
) -> tuple[Plan, list[int]]:
    """Return the order of work where late looks are worked on in one step.

    Parameters and what is returned are those of `rerun_plan`.
    """
    keys = keys_of(scans)
    look: list[int] = []
    since: list[int] = []
    seen_from: list[int] = []
    replica: list[int] = []
    forgotten: list[list[int]] = []
    left_out: list[int] = []
    for new, number in zip(range(begin, len(scans)), of[begin:].tolist(), strict=True):
        known = memory.setdefault(number, Memory())
        key, first, gone = keys[new], -1, 0
        newest = known.keys[-1][0] if known.keys else key[0]
        if key[0] < newest - lag_ticks:
            left_out.append(new)
            continue
        if key[0] < newest:
            first = known.looks[bisect_left(known.keys, (key[0] + 1, 0))]
        else:
            known.keys.append(key)
            known.looks.append(new)
            while known.keys[gone][0] < key[0] - lag_ticks:
                gone += 1
        past, known.keys, known.looks = known.looks[:gone], known.keys[gone:], known.looks[gone:]
        look.append(new)
        since.append(first)
        seen_from.append(known.looks[-1])
        replica.append(number)
        forgotten.append(past)
    row = scans.row[look].tolist()
    return _planned(look, None, since, seen_from, row, replica, forgotten), left_out


def _planned(
    look: list[int],
    back_to: list[int] | None,
    since: list[int] | None,
    seen_from: list[int],
    row: list[int],
    replica: list[int],
    forgotten: list[list[int]],
) -> Plan:
    none = np.full(len(look), -1)
    rows, replica_of = np.array(row, dtype=np.int64), np.array(replica, dtype=np.int64)
    reports = np.ones(len(look), dtype=bool)
    if len(look):
        reports[:-1] = (rows[1:] != rows[:-1]) | (replica_of[1:] != replica_of[:-1])
    return Plan(
        np.array(look, dtype=np.int64),
        none if back_to is None else np.array(back_to, dtype=np.int64),
        none if since is None else np.array(since, dtype=np.int64),
        np.array(seen_from, dtype=np.int64), reports, replica_of, rows, forgotten,
    )  # fmt: skip


def straight_plan(scans: Scans, of: IntArray, newest: IntArray) -> tuple[Plan, list[int]]:
    """Return the order of work where late looks are left out."""
    so_far = RunTicks(of, scans.tick).newest().tick
    keep = (scans.tick >= so_far) & (scans.tick >= newest[of])
    look = np.flatnonzero(keep)
    row = scans.row[look]
    reports = np.append(row[1:] != row[:-1], True)[: len(look)]
    none = np.full(len(look), -1)
    plan = Plan(look, none, none, look, reports, of[look], row, [])
    return plan, np.flatnonzero(~keep).tolist()


def tracks_before(before: dict[int, Snapshot], looks: list[int], replicas: list[int]) -> TrackStore:
    """Return how tracks of some replicas (ascending) were, each before a look of its own."""
    return TrackStore.joined(
        [
            before[look].store.take(before[look].store.replica == replica)
            for look, replica in zip(looks, replicas, strict=True)
        ]
    ).in_order()


def restored(store: TrackStore, back: dict[int, Snapshot], replicas: Any) -> TrackStore:
    """Return tracks with those of some replicas as they were."""
    by_store: dict[int, tuple[TrackStore, list[int]]] = {}
    for number in replicas:
        before = back[number].store
        by_store.setdefault(id(before), (before, []))[1].append(number)
    parts = [store.take(~np.isin(store.replica, replicas))]
    parts += [old.take(np.isin(old.replica, mine)) for old, mine in by_store.values()]
    return TrackStore.joined(parts).in_order()


# Looks whose fate is worked out.
_MOST_LOOKS = 2000


def may_come_late(offers: Mapping[str, Any], producers: Iterable[Producer]) -> bool:
    """Return whether a look may come after one that was made later."""
    return (
        not offers
        or any(one.jitter_s > 0 or one.unforeseen for one in producers)
        or any(
            not isinstance(o, SensorOffer) or o.latest_s is None or o.latest_s > 0 or o.unforeseen
            for o in offers.values()
        )
    )


def latest_s(offers: Mapping[str, Any], producers: Iterable[Producer]) -> Fraction:
    """Return how late a look may come at most, as far as the scene says; queues are not in it."""
    late_s = [o.latest_s or 0 for o in offers.values() if isinstance(o, SensorOffer)]
    return Fraction(max(late_s, default=0) + max((one.latest_s for one in producers), default=0))


def left_out(offers: Mapping[str, Any], lag_s: Fraction, duration_s: Fraction) -> dict[str, float]:
    """Return the share of each sensor's looks that come when a look newer by a lag is known."""
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
        late = sum(any(_overtaken(t, one, by_s, lag_s) for one, by_s in ahead_s) for t in looks)
        if late:
            shares[name] = late / len(looks)
    return shares


def _overtaken(t: Fraction, clock: ClockSpec, by_s: Fraction, lag_s: Fraction) -> bool:
    """Return whether a clock has an instant between ``t + lag_s`` and ``t + by_s``."""
    after = (t + lag_s - clock.offset_s) // clock.period_s + 1
    return _instant(clock, max(int(after), 0)) < t + by_s


def _instant(clock: ClockSpec, scan: int) -> Fraction:
    return clock.offset_s + scan * clock.period_s


def warning(name: str, share: float, why: str) -> str:
    """Return a sentence about looks that will be left out."""
    return f"{why}: up to {share:.0%} of the looks of {name} come too late and are left out"


@dataclass(frozen=True, eq=False)
class LookCount:
    """Counts of each sensor's looks, and of those that came too late."""

    came: Mapping[str, int] = field(default_factory=dict)  # By name of the sensor
    left_out: Mapping[str, int] = field(default_factory=dict)  # By name of the sensor

    def of(self, sensors: tuple[str, ...], came: IntArray, left_out: IntArray) -> "LookCount":
        """Return the count with more looks, each a mask of its sensors."""
        return LookCount(
            {n: self.came.get(n, 0) + int((came >> i & 1).sum()) for i, n in enumerate(sensors)},
            {
                n: self.left_out.get(n, 0) + int((left_out >> i & 1).sum())
                for i, n in enumerate(sensors)
            },
        )

    def late(self) -> dict[str, dict[str, float]]:
        """Return looks, those left out and their share, by sensor; of those that lost any."""
        return {
            name: {"looks": self.came[name], "left_out": lost, "share": lost / self.came[name]}
            for name, lost in sorted(self.left_out.items())
            if lost
        }
