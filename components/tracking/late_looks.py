"""Looks that come late: in which order looks are worked on, and what is gone back to.

A look is late if one that was made after it has been worked on. Rungs, from crude to exact:

- ``drop``: it is left out.
- ``one_step``: tracks go one step back to its instant, are corrected there, and what that tells of
  them now is carried over; nothing is worked on again, and no track is started.
- ``rerun``: tracks go back to how they were before it, and every look since is worked on again in
  the order in which they were made. What comes out is what would have been had all come in time.

Which looks are late follows from their instants alone; so the order of work is planned for a whole
window before any of it is done.
"""

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.tracking.scans import Scans
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import BoolArray, IntArray

#: When a look was made, and the first of its sensors: looks of one instant go by sensor.
Key = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Before:
    """How tracks of a replica were before a look was worked on.

    Parameters
    ----------
    store : TrackStore
        With this replica's tracks among others.
    next_number : int
    """

    store: TrackStore
    next_number: int


@dataclass
class Memory:
    """The looks of one replica that may still have to be worked on again, in order.

    Parameters
    ----------
    keys, looks : lists
        When each was made, and its number among the looks of the wake.
    """

    keys: list[Key] = field(default_factory=list)
    looks: list[int] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Plan:
    """The order in which looks are worked on.

    Parameters
    ----------
    look : (works,)
    back_to : (works,)
        Look before which the tracks are gone back to first; -1 for none.
    since : (works,)
        Of a look that is worked on in one step, the first look of those made since; -1 of others.
    seen_from : (works,)
        Newest look by then: where tracks are seen from when they are told.
    tells : (works,) of bool
        Whether tracks are told after it: it is the last work that a row brings.
    of : (works,)
        Index of the replica.
    row : (works,)
        Row of the wake that brings it about.
    forgotten : list of lists
        Looks that need not be remembered after each.
    """

    look: IntArray
    back_to: IntArray
    since: IntArray
    seen_from: IntArray
    tells: BoolArray
    of: IntArray
    row: IntArray
    forgotten: list[list[int]]


def keys_of(scans: Scans) -> list[Key]:
    """Return when each look was made, and the first of its sensors."""
    first = scans.sensors & -scans.sensors
    return list(zip(scans.tick.tolist(), first.tolist(), strict=True))


def rerun_plan(
    scans: Scans, of: IntArray, begin: int, memory: dict[int, Memory], lag_ticks: int
) -> tuple[Plan, list[int]]:
    """Return the order of work where late looks have all since them worked on again.

    Parameters
    ----------
    scans : Scans
        The looks remembered, then the new ones by arrival.
    of : (looks,)
        Index of the replica of each.
    begin : int
        The first new look.
    memory : dict of Memory
        By index of the replica; kept up to date.
    lag_ticks : int
        A look that is older than the newest by more than this is left out.

    Returns
    -------
    plan : Plan
    left_out : list of int
        Looks that are not worked on.
    """
    keys = keys_of(scans)
    row = scans.row.tolist()
    look: list[int] = []
    back_to: list[int] = []
    brought_by: list[int] = []
    replica: list[int] = []
    forgotten: list[list[int]] = []
    left_out: list[int] = []
    for new, place in zip(range(begin, len(scans)), of[begin:].tolist(), strict=True):
        known = memory.setdefault(place, Memory())
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
        replica += [place] * len(works)
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
    for new, place in zip(range(begin, len(scans)), of[begin:].tolist(), strict=True):
        known = memory.setdefault(place, Memory())
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
        replica.append(place)
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
    rows, place_of = np.array(row, dtype=np.int64), np.array(replica, dtype=np.int64)
    tells = np.ones(len(look), dtype=bool)
    if len(look):
        tells[:-1] = (rows[1:] != rows[:-1]) | (place_of[1:] != place_of[:-1])
    return Plan(
        np.array(look, dtype=np.int64),
        none if back_to is None else np.array(back_to, dtype=np.int64),
        none if since is None else np.array(since, dtype=np.int64),
        np.array(seen_from, dtype=np.int64), tells, place_of, rows, forgotten,
    )  # fmt: skip


def straight_plan(scans: Scans, of: IntArray, newest: IntArray) -> tuple[Plan, list[int]]:
    """Return the order of work where late looks are left out.

    Parameters
    ----------
    scans : Scans
        By arrival.
    of : (looks,)
        Index of the replica of each.
    newest : (replicas,)
        When the newest look was made that was worked on before.
    """
    # Replicas lie end to end: what is before a replica's first look is older anyway.
    keep = (scans.tick >= np.maximum.accumulate(scans.tick)) & (scans.tick >= newest[of])
    look = np.flatnonzero(keep)
    row = scans.row[look]
    tells = np.append(row[1:] != row[:-1], True)[: len(look)]
    none = np.full(len(look), -1)
    plan = Plan(look, none, none, look, tells, of[look], row, [])
    return plan, np.flatnonzero(~keep).tolist()


def stores_before(before: dict[int, Before], looks: list[int], replicas: list[int]) -> TrackStore:
    """Return how tracks of some replicas (ascending) were, each before a look of its own."""
    return TrackStore.joined(
        [
            before[look].store.take(before[look].store.replica == replica)
            for look, replica in zip(looks, replicas, strict=True)
        ]
    )


def gone_back(store: TrackStore, back: dict[int, Before], replicas: Any) -> TrackStore:
    """Return tracks with those of some replicas as they were.

    Parameters
    ----------
    store : TrackStore
    back : dict of Before
        By number of the replica.
    replicas : (n,)
        Numbers of the replicas that go back.
    """
    by_store: dict[int, tuple[TrackStore, list[int]]] = {}
    for number in replicas:
        before = back[number].store
        by_store.setdefault(id(before), (before, []))[1].append(number)
    parts = [store.take(~np.isin(store.replica, replicas))]
    parts += [old.take(np.isin(old.replica, mine)) for old, mine in by_store.values()]
    return TrackStore.joined(parts)
