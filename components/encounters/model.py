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
    """A network that cannot be: `variable` says which of its variables is wrong, if one is."""

    def __init__(self, message: str, variable: str = "") -> None:
        super().__init__(f"variable '{variable}': {message}" if variable else message)
        self.variable = variable


@dataclass(frozen=True, eq=False)
class NetworkNode:
    """One variable given its parents, which are ascending indices in the network.

    A bin more of a parent adds its stride to the column of `counts` (columns, size).
    """

    name: str
    size: int
    parents: tuple[int, ...]
    strides: tuple[int, ...]
    counts: FloatArray

    @cached_property
    def totals(self) -> FloatArray:
        """Sum of each column's counts."""
        return self.counts.sum(axis=1)

    @cached_property
    def empty(self) -> BoolArray:
        """Return whether each column of counts is all zeros."""
        return self.totals == 0.0

    @cached_property
    def probabilities(self) -> FloatArray:
        """Probabilities, shape (columns, size); an empty column holds those of all columns."""
        filled = np.where(self.empty[:, np.newaxis], self.counts.sum(axis=0), self.counts)
        result: FloatArray = filled / filled.sum(axis=1, keepdims=True)
        return result

    @cached_property
    def edges(self) -> FloatArray:
        """Where each bin begins and the last one ends within [0, 1], shape (columns, size + 1)."""
        summed = np.cumsum(self.probabilities, axis=1)
        # Exactly 1 from the last bin on that can be drawn: rounding must not open a bin without
        # any probability behind it.
        last = self.size - 1 - np.argmax(self.probabilities[:, ::-1] > 0.0, axis=1)
        summed[np.arange(self.size) >= last[:, np.newaxis]] = 1.0
        return np.concatenate([np.zeros((len(summed), 1)), summed], axis=1)

    @cached_property
    def flat_edges(self) -> FloatArray:
        """`edges`, row after row."""
        return np.ascontiguousarray(self.edges).reshape(-1)

    def column(self, bins: Sequence[IntArray] | IntArray) -> IntArray:
        """Return the column for the bins of all variables, each (n,)."""
        result: AnyArray = np.zeros(np.shape(bins[0]), dtype=np.int64)
        for parent, stride in zip(self.parents, self.strides, strict=True):
            result += stride * bins[parent]
        return result


@dataclass(frozen=True)
class BayesNetwork:
    """Nodes by their index in the file's order (of a transition network only what is drawn), and
    the order in which they can be drawn, parents first.
    """

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
    """Return a checked network; arrows are 1 where the row's variable is a parent of the column's.

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
    return BayesNetwork(tuple(labels), tuple(sizes), nodes, _order(labels, nodes))


def _order(labels: Sequence[str], nodes: dict[int, NetworkNode]) -> tuple[int, ...]:
    """Return the nodes with parents first, and otherwise in the file's order."""
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
    """What the bins of a variable stand for: edges (bins + 1,), or None for a category, whose value
    is the number of its bin, from 1.
    """

    edges: FloatArray | None
    size: int

    @property
    def low(self) -> FloatArray:
        """Where a value of each bin begins; a bin around zero holds zero and nothing else."""
        if self.edges is None:
            return np.arange(1.0, self.size + 1.0)
        return np.where(self._around_zero, 0.0, self.edges[:-1])

    @property
    def width(self) -> FloatArray:
        """Return the width of each bin."""
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
    """A model as its file gives it, with dynamic variables matched by name.

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
        """Return the name of the model's file."""
        return self.path.stem

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the initial variables."""
        return self.initial.labels

    @property
    def dynamic(self) -> tuple[int, ...]:
        """Initial variables that change, in the file's order."""
        return tuple(sorted(self.targets.values()))

    def index_of(self, label: str) -> int | None:
        """Return which initial variable has this name; None where the model has none."""
        return self.labels.index(label) if label in self.labels else None
