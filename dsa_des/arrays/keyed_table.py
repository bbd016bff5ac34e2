"""What blocks remember of the runs they serve: columns over things, each of which is of a run."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np

from dsa_des.arrays.types import BoolArray, IntArray


class KeyedTable:
    """Columns (..., n) over things of some runs, made anew at every change.

    The things are on the last axis; ``replica`` says of which run each is. A column is asked for as
    an attribute.
    """

    def __init__(self, **columns: Any) -> None:
        self.__dict__ = columns

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)

    def __len__(self) -> int:
        return len(self.__dict__["replica"])

    @property
    def columns(self) -> dict[str, Any]:
        """The columns of the table by name."""
        return self.__dict__

    @classmethod
    def from_columns(cls, columns: dict[str, Any]) -> Self:
        """Return a table of the given columns; it uses the dict itself and does not copy it."""
        table = object.__new__(cls)
        table.__dict__ = columns
        return table

    @classmethod
    def empty(
        cls, types: Mapping[str, type], shapes: Mapping[str, tuple[int, ...]] | None = None
    ) -> Self:
        """Return a table of no rows; columns by type, `shapes` gives axes before the last."""
        shapes = shapes or {}
        return cls.from_columns(
            {n: np.empty((*shapes.get(n, ()), 0), dtype=t) for n, t in types.items()}
        )

    def take(self, which: IntArray | BoolArray) -> Self:
        """Return the rows of the table at the given indices, or those where the mask is True."""
        if which.dtype == bool:
            if which.all():
                return self
            which = which.nonzero()[0]
        if len(which) == 0:
            return self.from_columns({name: v[..., :0] for name, v in self.__dict__.items()})
        return self.from_columns({name: v.take(which, -1) for name, v in self.__dict__.items()})

    def with_columns(self, **columns: Any) -> Self:
        """Return the table with the given columns replaced or added."""
        return self.from_columns({**self.__dict__, **columns})

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the things of all parts, one after the other."""
        filled = [part for part in parts if len(part)] or [parts[0]]
        if len(filled) == 1:
            return filled[0]
        names = filled[0].columns
        return cls.from_columns(
            {n: np.concatenate([p.columns[n] for p in filled], axis=-1) for n in names}
        )

    def sort(self) -> Self:
        """Return the rows in ascending order of their run; rows of one run keep their order."""
        if bool((self.replica[1:] >= self.replica[:-1]).all()):
            return self
        return self.take(np.argsort(self.replica, kind="stable"))

    def _has_surely_only_runs(self, runs: IntArray) -> bool:
        """Return True if all rows surely are of `runs` (its only one, or one row each)."""
        replica = self.replica
        if not len(replica) or replica[0] != runs[0] or replica[-1] != runs[-1]:
            return False
        return bool(replica[0] == replica[-1] or np.array_equal(replica, runs))

    def rows_of_runs(self, runs: IntArray) -> Self:
        """Return the rows that belong to one of the given ascending runs."""
        if len(self) == 0 or self._has_surely_only_runs(runs):
            return self
        return self.take(np.isin(self.replica, runs))

    def replace_and_drop_earlier_runs(self, runs: IntArray, newer: Self, first_run: int) -> Self:
        """Return the table with `newer` for its `runs`, without runs before `first_run`, sorted."""
        if len(self) == 0 or self._has_surely_only_runs(runs):
            return newer.sort()
        others = (self.replica >= first_run) & ~np.isin(self.replica, runs)
        return self.concatenate([self.take(others), newer]).sort()

    def kept_rows_or_new(self, new: Self) -> Self:
        """Return a row for each run in `new`: this table's if there is one, else that of `new`."""
        old = self.rows_of_runs(new.replica)
        if len(old) == len(new):
            return self.from_columns({name: old.columns[name].copy() for name in new.columns})
        here = np.searchsorted(new.replica, old.replica)
        columns = {name: values.copy() for name, values in new.columns.items()}
        for name, values in columns.items():
            values[..., here] = old.columns[name]
        return self.from_columns(columns)


def indices_by_occurrence(keys: IntArray) -> list[IntArray]:
    """Return index arrays of each key's first occurrence, then of its second, and so on."""
    if len(keys) == 0 or bool((keys == keys[0]).all()):
        return list(np.arange(len(keys))[:, np.newaxis])
    if bool((keys[1:] > keys[:-1]).all()):  # the usual case: a row of each run
        return [np.arange(len(keys))]
    order = np.argsort(keys, kind="stable")
    begins = np.append(True, keys[order][1:] != keys[order][:-1])
    turn = np.empty(len(keys), dtype=np.int64)
    turn[order] = np.arange(len(keys)) - np.flatnonzero(begins)[np.cumsum(begins) - 1]
    return np.split(np.argsort(turn, kind="stable"), np.cumsum(np.bincount(turn))[:-1])
