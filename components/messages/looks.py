"""When and from where sensors looked: what a row knows of the reports that led to it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Looks:
    """The looks behind the rows of a message, also those in which nothing was detected.

    Parameters
    ----------
    offsets : (rows + 1,)
        Looks ``offsets[i]:offsets[i + 1]`` belong to row i.
    sensor : (looks,) of int
        Index into the message's ``sensors``.
    age_ticks : (looks,) of int
        How long before its row's tick each was made.
    pose : (6, looks)
        Of the ownship as believed then: `components.messages.detections.POSE`; NaN where the
        sensor does not say.
    """

    offsets: IntArray
    sensor: IntArray
    age_ticks: IntArray
    pose: FloatArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def take_rows(self, rows: slice | IntArray) -> Self:
        """Return the looks of some rows."""
        if isinstance(rows, slice):
            rows = np.arange(*rows.indices(len(self)))
        counts = (self.offsets[1:] - self.offsets[:-1])[rows]
        offsets = np.concatenate(([0], np.cumsum(counts)))
        which = np.repeat(self.offsets[rows] - offsets[:-1], counts) + np.arange(offsets[-1])
        return type(self)(offsets, self.sensor[which], self.age_ticks[which], self.pose[:, which])

    @classmethod
    def join_rows(cls, parts: Sequence[Self]) -> Self:
        """Return the looks of all parts' rows."""
        counts = [np.diff(part.offsets) for part in parts]
        joined = {
            item.name: np.concatenate([getattr(part, item.name) for part in parts], axis=-1)
            for item in fields(cls)
            if item.name != "offsets"
        }
        return cls(offsets=np.concatenate(([0], np.cumsum(np.concatenate(counts)))), **joined)
