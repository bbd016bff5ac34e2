"""Random numbers of encounters: a function of seed, purpose, encounter number and attempt.

Encounter 77,123 draws the same numbers alone and in any batch, and a longer track begins with the
shorter one. The generators are Philox4x64 and, for a few draws each, Philox4x32 (Salmon, Moraes,
Dror & Shaw, SC11), their keys made of seed and purpose, their counters of encounter and attempt;
many draws of one encounter are taken in sequence, which is ten times faster than a call for each.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.encounters.model import EncounterModel, NetworkNode
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.time.randomness import key_of, philox4x32

_BLOCK = 64
#: Numbers of encounters or attempts.
Ints = Sequence[int] | IntArray


class EncounterDraws:
    """Random numbers for one purpose, fixed by encounter number and attempt."""

    def __init__(self, seed: int, purpose: str) -> None:
        self._key = np.array(
            [key_of(seed, "encounters", purpose), key_of(purpose, seed)], dtype=np.uint64
        )
        short = key_of(seed, "encounters", purpose, "few")
        self._short_key = (short & 0xFFFFFFFF, short >> 32)
        self._generator = np.random.Philox(key=0)
        self._numbers = np.random.Generator(self._generator)

    def uniform_fast(self, numbers: Ints, count: int, attempts: Ints | int = 0) -> FloatArray:
        """Return draws in [0, 1), (count, encounters), fast for few, unlike those of `uniform`."""
        number = np.asarray(numbers, dtype=np.uint64)
        attempt = np.asarray(attempts, dtype=np.uint64)
        blocks = np.arange((count + 1) // 2, dtype=np.uint64)[:, np.newaxis]
        low = np.uint64(0xFFFFFFFF)
        words = philox4x32(
            (blocks, attempt & low, number & low, number >> np.uint64(32)), self._short_key
        )
        pairs = ((words[0], words[1]), (words[2], words[3]))
        result = np.empty((2 * len(blocks), len(number)))
        for k, (high, rest) in enumerate(pairs):
            result[k::2] = ((high >> np.uint64(5)) * 67108864.0 + (rest >> np.uint64(6))) * 2.0**-53
        return result[:count]

    def uniform(self, numbers: Ints, count: int, attempts: Ints | int = 0) -> FloatArray:
        """Return 53-bit draws in [0, 1), (count, encounters), fixed by number and attempt."""
        numbers = np.asarray(numbers).tolist()
        tries = np.broadcast_to(attempts, len(numbers)).tolist()
        counter = np.zeros(4, dtype=np.uint64)
        inner = {"counter": counter, "key": self._key}
        state: Any = {
            "bit_generator": "Philox", "state": inner, "buffer": np.zeros(4, dtype=np.uint64),
            "buffer_pos": 4, "has_uint32": 0, "uinteger": 0,
        }  # fmt: skip
        generator = self._generator
        result, drawn = np.empty((count, len(numbers))), np.empty((_BLOCK, count))
        # Turned in blocks that stay in the processor's cache.
        for start in range(0, len(numbers), _BLOCK):
            end = min(start + _BLOCK, len(numbers))
            for row in range(start, end):
                counter[1], counter[2] = numbers[row], tries[row]
                generator.state = state
                self._numbers.random(out=drawn[row - start])
            result[:, start:end] = drawn[: end - start].T
        return result


#: Tracks that are sampled together: their arrays stay in the processor's cache.
TRACKS_AT_ONCE = 2048
_BELOW_1 = float(np.nextafter(1.0, 0.0))


@dataclass(frozen=True)
class SampledTracks:
    """Values that the networks gave for some tracks, before any of them is rejected.

    Values at time 0, their bins from 0 on, and where in its bin each lies, [0, 1), are (variables,
    tracks); `changing` is (seconds + 1, dynamic variables, tracks), as `EncounterModel.dynamic`.
    """

    numbers: IntArray
    initial: FloatArray
    initial_bins: IntArray
    left: FloatArray
    changing: FloatArray

    def replace(self, indices: IntArray, others: "SampledTracks", which: BoolArray) -> None:
        """Overwrite, in place, tracks at these indices with `others` where the mask is true."""
        self.initial[:, indices] = others.initial[:, which]
        self.initial_bins[:, indices] = others.initial_bins[:, which]
        self.left[:, indices] = others.left[:, which]
        self.changing[:, :, indices] = others.changing[:, :, which]


class TrackSampler:
    """Samples tracks of an encounter model by their numbers."""

    def __init__(self, model: EncounterModel, draws: EncounterDraws) -> None:
        self.model = model
        self._draws = draws
        self._low = [bins.low for bins in model.bins]
        self._width = [bins.width for bins in model.bins]
        dynamic = model.dynamic_indices
        self._steps = [
            _Step(model, index, dynamic.index(model.targets[index]))
            for index in model.transition.order
        ]

    def sample(self, numbers: Ints, seconds: int, attempts: Ints | int = 0) -> SampledTracks:
        """Return the tracks of these numbers and attempts, from 0 to `seconds` once per second."""
        model = self.model
        variables, changing = len(model.labels), len(model.dynamic_indices)
        uniform = self._draws.uniform_fast(numbers, variables, attempts)
        bins: IntArray = np.zeros((variables, len(numbers)), dtype=np.int64)
        values, left = np.zeros((2, variables, len(numbers)))
        for index in model.initial.order:
            node = model.initial.nodes[index]
            mine, left[index] = _draw_bins(node, node.column_of_parent_bins(bins), uniform[index])
            bins[index] = mine
            values[index] = self._low[index][mine] + self._width[index][mine] * left[index]
        over_time = np.empty((seconds + 1, changing, len(numbers)))
        over_time[0] = values[list(model.dynamic_indices)]
        # Places in the transition network: variables at t, static ones among them, and at t + 1.
        now: IntArray = np.zeros((len(model.sources), len(numbers)), dtype=np.int64)
        for index, source in enumerate(model.sources):
            if source >= 0:
                now[index] = bins[source]
        count = seconds * changing
        drawn = self._draws.uniform(numbers, count, attempts) if count else np.empty((0, 0))
        rows = drawn.reshape(seconds, changing, len(numbers))
        fixed = [step.static_column_offset(now) for step in self._steps]
        for second, row in enumerate(rows, start=1):
            for step, column in zip(self._steps, fixed, strict=True):
                step.draw_next(now, column, row, over_time[second - 1], over_time[second])
            for step in self._steps:
                now[step.before] = now[step.index]
        return SampledTracks(np.asarray(numbers, dtype=np.int64), values, bins, left, over_time)

    def batches(self, numbers: range, seconds: int) -> Iterator[SampledTracks]:
        """Yield a range's tracks in batches of a size that suits the processor's cache."""
        for start in range(0, len(numbers), TRACKS_AT_ONCE):
            yield self.sample(numbers[start : start + TRACKS_AT_ONCE], seconds)


class _Step:
    """Draws one dynamic variable at t + 1 for all tracks."""

    def __init__(self, model: EncounterModel, index: int, row: int) -> None:
        self.index, self._row = index, row
        variable = model.targets[index]
        self.before = model.sources.index(variable)
        self._node = node = model.transition.nodes[index]
        moves = {model.sources.index(of) for of in model.targets.values()} | set(model.targets)
        parts = list(zip(node.parents, node.strides, strict=True))
        self._static = [part for part in parts if part[0] not in moves]
        self._moving = [part for part in parts if part[0] in moves]
        self._low, self._width = model.bins[variable].low, model.bins[variable].width
        self._rate = float(model.resample_rates_hz[variable])
        begin, chance = (
            node.cumulative_probabilities[:, :-1],
            np.diff(node.cumulative_probabilities, axis=1),
        )
        # A bin without probability begins where no draw lies; an empty column is all of any bin.
        empty = node.has_no_counts[:, np.newaxis]
        self._begin = np.where(empty, 0.0, np.where(chance > 0.0, begin, 2.0)).reshape(-1)
        with np.errstate(divide="ignore"):
            each = np.where(empty, 1.0, np.where(chance > 0.0, 1.0 / chance, 1.0))
        self._each = each.reshape(-1)

    def static_column_offset(self, now: IntArray) -> IntArray:
        """Return the part of each track's column index due to parents that never change."""
        result: IntArray = np.zeros(now.shape[1], dtype=np.int64)
        for parent, stride in self._static:
            result += stride * now[parent]
        return result

    def draw_next(
        self,
        now: IntArray,
        fixed: IntArray,
        uniform: FloatArray,
        before: FloatArray,
        after: FloatArray,
    ) -> None:
        """Draw the variable for the next second: its bins into `now`, its values into `after`."""
        u, node = uniform[self._row], self._node
        column = fixed
        for parent, stride in self._moving:
            column = column + stride * now[parent]
        present = now[self.before]
        cell = column * node.size + present
        left = (u - self._begin.take(cell)) * self._each.take(cell)
        value = after[self._row]
        now[self.index] = present
        value[:] = before[self._row]
        # Those below 0 have left their bin: they get their values further down.
        if self._rate > 0.0:
            anew = (left < self._rate).nonzero()[0]
            bins = present[anew]
            value[anew] = self._low[bins] + self._width[bins] * (left[anew] / self._rate)
        moved = ((left < 0.0) | (left >= 1.0)).nonzero()[0]
        if len(moved):
            bins, rest = _draw_bins(node, column[moved], u[moved])
            now[self.index, moved] = bins
            value[moved] = self._low[bins] + self._width[bins] * rest


def _draw_bins(
    node: NetworkNode, column: IntArray, uniform: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the bin into which each draw falls, and where within it, as a share in [0, 1)."""
    edges, at = node.flat_cumulative_probabilities, column * (node.size + 1)
    bins: IntArray = np.zeros(len(column), dtype=np.int64)
    for k in range(1, node.size):
        bins += uniform >= edges.take(at + k)
    at += bins
    begin = edges.take(at)
    at += 1
    return bins, np.minimum((uniform - begin) / (edges.take(at) - begin), _BELOW_1)
