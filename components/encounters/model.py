"""An encounter model: where aircraft start, and how they fly on from second to second.

Described in M. J. Kochenderfer, L. P. Espindle, J. K. Kuchar, J. D. Griffith, "Uncorrelated
encounter model of the National Airspace System", MIT Lincoln Laboratory, ATC-345, 2008.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray


class NetworkError(ValueError):
    """A Bayesian network that is not valid; `variable` names the one at fault, if any."""

    def __init__(self, message: str, variable: str = "") -> None:
        super().__init__(f"variable '{variable}': {message}" if variable else message)
        self.variable = variable


@dataclass(frozen=True, eq=False)
class NetworkNode:
    """One variable of a Bayesian network, with counts given its parents (ascending indices).

    A bin more of a parent adds its stride to the column of `counts` (columns, size).
    """

    name: str
    size: int
    parents: tuple[int, ...]
    strides: tuple[int, ...]
    counts: FloatArray

    @cached_property
    def count_totals(self) -> FloatArray:
        """Sum of the counts for each combination of the parents' bins, shape (columns,)."""
        return self.counts.sum(axis=1)

    @cached_property
    def has_no_counts(self) -> BoolArray:
        """Whether all counts are 0 for each combination of the parents' bins, shape (columns,)."""
        return self.count_totals == 0.0

    @cached_property
    def probabilities(self) -> FloatArray:
        """Bin probabilities given parents (columns, size); of all where a column lacks counts."""
        filled = np.where(self.has_no_counts[:, np.newaxis], self.counts.sum(axis=0), self.counts)
        result: FloatArray = filled / filled.sum(axis=1, keepdims=True)
        return result

    @cached_property
    def cumulative_probabilities(self) -> FloatArray:
        """Cumulative probabilities 0 to 1 between bins given parents, (columns, size + 1)."""
        summed = np.cumsum(self.probabilities, axis=1)
        # Exactly 1 from the last bin on that can be drawn: rounding must not open a bin without
        # any probability behind it.
        last = self.size - 1 - np.argmax(self.probabilities[:, ::-1] > 0.0, axis=1)
        summed[np.arange(self.size) >= last[:, np.newaxis]] = 1.0
        return np.concatenate([np.zeros((len(summed), 1)), summed], axis=1)

    @cached_property
    def flat_cumulative_probabilities(self) -> FloatArray:
        """Elements of `edges`, row after row, shape (columns x (size + 1),)."""
        return np.ascontiguousarray(self.cumulative_probabilities).reshape(-1)

    def column_of_parent_bins(self, bins: Sequence[IntArray] | IntArray) -> IntArray:
        """Return the column index (n,) for the parents' bins, given all variables' bins."""
        result: AnyArray = np.zeros(np.shape(bins[0]), dtype=np.int64)
        for parent, stride in zip(self.parents, self.strides, strict=True):
            result += stride * bins[parent]
        return result


@dataclass(frozen=True)
class BayesNetwork:
    """Nodes of a Bayesian network in the file's order, and a drawing order with parents first."""

    labels: tuple[str, ...]
    sizes: tuple[int, ...]
    nodes: dict[int, NetworkNode]
    order: tuple[int, ...]


def make_network(
    labels: Sequence[str],
    sizes: Sequence[int],
    arrows: IntArray,
    counts: FloatArray,
    drawn: Sequence[int],
) -> BayesNetwork:
    """Return a Bayesian network; NetworkError unless counts and arrows (1: row to column) fit.

    Counts (m,) are those of all drawn variables, one behind the other, in the order of `drawn`.
    """
    nodes, start = {}, 0
    for index in drawn:
        parents = tuple(np.flatnonzero(arrows[:, index]).tolist())
        strides, columns = [], 1
        for parent in parents:
            strides.append(columns)
            columns *= sizes[parent]
        needed = columns * sizes[index]
        some = counts[start : start + needed]
        if len(some) < needed:
            raise NetworkError(
                f"{needed} counts are needed ({sizes[index]} bins times {columns} combinations of "
                f"its parents' bins), {len(some)} are left",
                labels[index],
            )
        start += needed
        table = some.reshape(columns, sizes[index])
        if not table.any():
            raise NetworkError("all its counts are 0", labels[index])
        nodes[index] = NetworkNode(labels[index], sizes[index], parents, tuple(strides), table)
    if start < len(counts):
        raise NetworkError(f"{len(counts)} counts stand there, {start} are needed")
    return BayesNetwork(tuple(labels), tuple(sizes), nodes, _parents_first_order(labels, nodes))


def _parents_first_order(labels: Sequence[str], nodes: dict[int, NetworkNode]) -> tuple[int, ...]:
    """Return node indices, parents first, else in the file's order; NetworkError for a cycle."""
    left, done = list(nodes), []
    while left:
        ready = next((p for p in left if not any(q in left for q in nodes[p].parents)), None)
        if ready is None:
            names = ", ".join(repr(labels[p]) for p in left)
            raise NetworkError(f"arrows form a circle among {names}")
        left.remove(ready)
        done.append(ready)
    return tuple(done)


#: Altitude layers of the models whose file gives none (``*``), ft above ground.
LAYERS_FT = (500.0, 1200.0, 3000.0, 5000.0, 18000.0)

AIRSPACE, LAYER, GEOGRAPHY = "A", "L", "G"
SPEED, ACCELERATION = "v", "\\dot v"
CLIMB, TURN = "\\dot h", "\\dot \\psi"


@dataclass(frozen=True)
class Bins:
    """Values of a variable's bins: edges (bins + 1,), or None for a category, counted from 1."""

    edges: FloatArray | None
    size: int

    @property
    def low(self) -> FloatArray:
        """Lowest value of each bin; 0 for a bin around zero, which stands for zero alone."""
        if self.edges is None:
            return np.arange(1.0, self.size + 1.0)
        return np.where(self._around_zero, 0.0, self.edges[:-1])

    @property
    def width(self) -> FloatArray:
        """Width of each bin; 0 for categories and for a bin around zero."""
        if self.edges is None:
            return np.zeros(self.size)
        return np.where(self._around_zero, 0.0, np.diff(self.edges))

    @property
    def _around_zero(self) -> BoolArray:
        assert self.edges is not None
        result: BoolArray = (self.edges[:-1] < 0.0) & (self.edges[1:] > 0.0)
        return result


@dataclass(frozen=True)
class EncounterModel:
    """An encounter model: networks of initial values and of transitions, with all bins.

    `bins` and `resample_rates_hz` (probability per second of a new value within the same bin) are
    of the initial variables. The transition network is over these (dynamic ones at t) and dynamic
    ones at t + 1: `sources` gives for each of its variables the initial one whose value it is at t,
    or -1, and `targets` maps those at t + 1 to the initial ones. `notes` say what is odd about the
    file, and which units were taken for others. Values are in knots, ft/min, deg/s and seconds.
    """

    path: Path
    initial: BayesNetwork
    transition: BayesNetwork
    bins: tuple[Bins, ...]
    resample_rates_hz: FloatArray
    sources: tuple[int, ...]
    targets: dict[int, int]
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the model's file without its ending."""
        return self.path.stem

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the initial variables."""
        return self.initial.labels

    @property
    def dynamic_indices(self) -> tuple[int, ...]:
        """Indices of those initial variables that change over time, ascending."""
        return tuple(sorted(self.targets.values()))

    def index_of(self, label: str) -> int | None:
        """Return the index of the initial variable with this label; None if the model has none."""
        return self.labels.index(label) if label in self.labels else None
