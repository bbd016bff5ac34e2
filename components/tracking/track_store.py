"""Tracks of all replicas as columns: made anew at every change, never changed in place."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from components.estimation.batched import is_everything
from components.estimation.estimator import Estimates
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

#: Looks in vain of a sensor that never hit a track.
NEVER = 1 << 40


class TrackStore:
    """Columns over tracks, the tracks on their last axis.

    A column is asked for as an attribute. States are ``state0``, ``state1``, … (d, n), one for each
    motion model, covariances ``covariance0``, … (d, d, n); ``weights`` (models, n) says how likely
    each model is. ``vain`` (sensors, n) counts each sensor's looks in vain since its last hit, from
    `NEVER` where it had none. ``seen`` (3, sensors, n) is where the track was expected, azimuth,
    elevation and range, when each sensor last updated it, and ``seen_tick`` (sensors, n) when that
    was; NaN and -1 where none did.
    """

    #: Columns beside states, with their types.
    PLAIN = {
        "replica": np.int64,
        "number": np.int64,
        "tick": np.int64,  # that the state speaks of
        "born_tick": np.int64,
        "updated_tick": np.int64,
        "history": np.int64,  # a bit for each expected look, 1 for a hit; the last look lowest
        "looks": np.int64,
        "misses": np.int64,  # expected looks in vain since the last hit
        "status": np.int64,
        "score": np.float64,  # logarithm of the odds that there is something
        "contributors": np.int64,
        "updated_by": np.int64,
        "ranged": np.bool_,
        # Normalised innovations squared of the looks at `tick`, and of how many quantities they
        # are; both 0 where none updated the track with one detection.
        "nis": np.float64,
        "freedom": np.int64,
    }

    def __init__(self, columns: dict[str, Any]) -> None:
        self.columns = columns

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["columns"][name]
        except KeyError:
            raise AttributeError(name) from None

    def __len__(self) -> int:
        return len(self.columns["replica"])

    @classmethod
    def empty(cls, sizes: Sequence[int], sensors: int) -> Self:
        """Return a store without tracks for models with states of these sizes."""
        columns: dict[str, AnyArray] = {n: np.empty(0, dtype=t) for n, t in cls.PLAIN.items()}
        columns["weights"] = np.empty((len(sizes), 0))
        columns["vain"] = np.empty((sensors, 0), dtype=np.int64)
        columns["seen"] = np.empty((3, sensors, 0))
        columns["seen_tick"] = np.empty((sensors, 0), dtype=np.int64)
        for i, size in enumerate(sizes):
            columns[f"state{i}"] = np.empty((size, 0))
            columns[f"covariance{i}"] = np.empty((size, size, 0))
        return cls(columns)

    def take(self, which: IntArray | BoolArray) -> Self:
        """Return some tracks."""
        if which.dtype == bool:
            if which.all():
                return self
            which = which.nonzero()[0]
        if len(which) == 0:
            return self.none()
        return type(self)({name: v.take(which, axis=-1) for name, v in self.columns.items()})

    def none(self) -> Self:
        """Return no tracks of the same columns."""
        return type(self)({name: v[..., :0] for name, v in self.columns.items()})

    def with_columns(self, **columns: Any) -> Self:
        """Return the same tracks with other values."""
        return type(self)({**self.columns, **columns})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the tracks of all parts, by replica and in their order in it."""
        filled = [part for part in parts if len(part)] or [parts[0]]
        if len(filled) == 1:
            return filled[0]
        whole = cls(
            {
                name: np.concatenate([part.columns[name] for part in filled], axis=-1)
                for name in filled[0].columns
            }
        )
        if bool((whole.replica[1:] >= whole.replica[:-1]).all()):
            return whole
        return whole.take(np.argsort(whole.replica, kind="stable"))

    def estimates(self) -> Estimates:
        """Return what the filter knows of the tracks."""
        return Estimates(self.states(), self.covariances(), self.weights)

    def with_estimates(self, estimates: Estimates, **columns: Any) -> Self:
        """Return the same tracks with other estimates, and other values in some columns."""
        return self.with_columns(**estimate_columns(estimates), **columns)

    def put(self, which: IntArray, new: dict[str, Any]) -> Self:
        """Return tracks with other values in some columns of some of them."""
        if is_everything(which, len(self)):
            return self.with_columns(**new)
        changed = {}
        for name, values in new.items():
            whole = self.columns[name].copy()
            whole[..., which] = values
            changed[name] = whole
        return self.with_columns(**changed)

    def states(self) -> list[AnyArray]:
        """Return the states of every model."""
        return [self.columns[f"state{i}"] for i in range(len(self.weights))]

    def covariances(self) -> list[AnyArray]:
        """Return the covariances of every model."""
        return [self.columns[f"covariance{i}"] for i in range(len(self.weights))]


def estimate_columns(estimates: Estimates) -> dict[str, AnyArray]:
    """Return estimates as columns of a store."""
    columns = {f"state{i}": x for i, x in enumerate(estimates.states)}
    columns |= {f"covariance{i}": p for i, p in enumerate(estimates.covariances)}
    return columns | {"weights": estimates.weights}


class ReplicaRecords:
    """What is kept of each replica beside its tracks, replicas ascending."""

    def __init__(
        self, replica: IntArray, next_number: IntArray, tick: IntArray, origin: FloatArray
    ) -> None:
        self.replica, self.next_number, self.tick = replica, next_number, tick
        self.origin = origin

    @classmethod
    def none(cls) -> "ReplicaRecords":
        """Return those of no replica."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, none, none, np.empty((3, 0)))

    def take(self, which: Any) -> "ReplicaRecords":
        """Return some of them."""
        return ReplicaRecords(
            self.replica[which],
            self.next_number[which],
            self.tick[which],
            np.ascontiguousarray(self.origin[:, which]),
        )

    def kept_with(self, newer: "ReplicaRecords", first_run: int) -> "ReplicaRecords":
        """Return those of all replicas that run, as in `newer` where they are among them."""
        old = self.take(~np.isin(self.replica, newer.replica) & (self.replica >= first_run))
        names = ("replica", "next_number", "tick", "origin")
        both = (np.concatenate([getattr(part, n) for part in (old, newer)], axis=-1) for n in names)
        whole = ReplicaRecords(*both)
        return whole.take(np.argsort(whole.replica, kind="stable"))

    def continued_by(self, replica: IntArray, position_deg_m: FloatArray) -> "ReplicaRecords":
        """Return those of the replicas of some looks; a new one starts at its first look."""
        replicas, first = np.unique(replica, return_index=True)
        new = ReplicaRecords(
            replicas, np.ones(len(replicas), dtype=np.int64),
            np.full(len(replicas), np.iinfo(np.int64).min), position_deg_m[:, first].copy(),
        )  # fmt: skip
        for old in np.flatnonzero(np.isin(self.replica, replicas)).tolist():
            here = int(np.searchsorted(replicas, self.replica[old]))
            new.next_number[here], new.tick[here] = self.next_number[old], self.tick[old]
            new.origin[:, here] = self.origin[:, old]
        return new
