"""What a tracker keeps of every replica beside its tracks."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from components.tracking.late_looks import Before, Memory, keys_of
from components.tracking.scans import Scans
from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Past:
    """What a replica must remember of looks, for later ones that come late."""

    replica: int
    scans: Scans
    before: dict[int, Before]

    @classmethod
    def of(
        cls, scans: Scans, memory: Memory | None, before: dict[int, Before], replica: int
    ) -> "Past | None":
        """Return the looks in memory, numbered anew in their order."""
        if memory is None:
            return None
        kept = {
            new: Before(
                before[old].store.take(before[old].store.replica == replica),
                before[old].next_number,
            )
            for new, old in enumerate(memory.looks)
        }
        return cls(replica, scans.take(np.array(memory.looks, dtype=np.int64)), kept)

    def memory(self) -> Memory:
        """Return the looks in memory."""
        return Memory(keys_of(self.scans), list(range(len(self.scans))))


class Heads:
    """What is kept of each replica beside its tracks, replicas ascending."""

    def __init__(
        self, replica: IntArray, next_number: IntArray, tick: IntArray, origin: FloatArray
    ) -> None:
        self.replica, self.next_number, self.tick = replica, next_number, tick
        self.origin = origin

    @classmethod
    def none(cls) -> "Heads":
        """Return those of no replica."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, none, none, np.empty((3, 0)))

    def take(self, which: Any) -> "Heads":
        """Return some of them."""
        return Heads(
            self.replica[which],
            self.next_number[which],
            self.tick[which],
            np.ascontiguousarray(self.origin[:, which]),
        )

    def kept_with(self, newer: "Heads") -> "Heads":
        """Return those of all replicas, as they are in `newer` where they are among them."""
        old = self.take(~np.isin(self.replica, newer.replica))
        names = ("replica", "next_number", "tick", "origin")
        both = (np.concatenate([getattr(h, n) for h in (old, newer)], axis=-1) for n in names)
        whole = Heads(*both)
        return whole.take(np.argsort(whole.replica, kind="stable"))

    def followed_by(self, replica: IntArray, place: FloatArray) -> "Heads":
        """Return those of the replicas of some looks; a new one starts at its first look."""
        found, first = np.unique(replica, return_index=True)
        new = Heads(
            found, np.ones(len(found), dtype=np.int64),
            np.full(len(found), np.iinfo(np.int64).min), place[:, first].copy(),
        )  # fmt: skip
        for old in np.flatnonzero(np.isin(self.replica, found)).tolist():
            here = int(np.searchsorted(found, self.replica[old]))
            new.next_number[here], new.tick[here] = self.next_number[old], self.tick[old]
            new.origin[:, here] = self.origin[:, old]
        return new
