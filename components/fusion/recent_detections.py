"""What came lately from each sensor, and which of it fused rows were made of already."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from components.messages.detections import Detections
from dsa_des.arrays.entries import selected_offsets_and_indices
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.wake import Arrivals


@dataclass(frozen=True, eq=False)
class Recent:
    """Every sensor's recent rows, which may yet be combined, and which entries were used."""

    seen: Mapping[str, Arrivals] = field(default_factory=dict)
    #: By sensor, which entries of its rows and of older ones fused rows were made of, and which
    #: of these are those of `seen`.
    used: Mapping[str, BoolArray] = field(default_factory=dict)
    kept: Mapping[str, slice | IntArray] = field(default_factory=dict)

    def joined_and_kept_arrivals(
        self, arrivals: Mapping[str, Arrivals], first_run: int, keep_ticks: int
    ) -> tuple[dict[str, Arrivals], Self]:
        """Return every sensor's recent and new rows joined, and those to keep as recent.

        Forgotten are runs before the first one, and what came more than `keep_ticks` ago.
        """
        together, used = {}, {}
        for name in sorted({*self.seen, *arrivals}):
            parts = []
            if (old := self.seen.get(name)) is not None:
                going = slice(int(np.searchsorted(old.message.run, first_run)), None)
                parts.append(_select_rows(old, self.used[name][self.kept[name]], going))
            if (new := arrivals.get(name)) is not None:
                parts.append((new, np.zeros(len(new.message.target), dtype=bool)))
            together[name], used[name] = _concatenate_by_run(parts)
        latest = max(int(new.tick.max()) for new in arrivals.values())
        seen, kept = {}, {}
        for name, all_seen in together.items():
            young = np.flatnonzero(all_seen.tick >= latest - keep_ticks)
            kept[name] = selected_offsets_and_indices(all_seen.message.offsets, young)[1]
            seen[name], _ = _select_rows(all_seen, used[name], young)
        return together, type(self)(seen, used, kept)

    def used_mask(self, arrivals: Mapping[str, Arrivals]) -> BoolArray:
        """Return a mask over the arrivals' entries, joined, True for those fused before.

        Of anything else none is known to be.
        """
        counts = {name: len(one.message.target) for name, one in arrivals.items()}
        known = {name: self.used.get(name, np.zeros(0, dtype=bool)) for name in arrivals}
        return np.concatenate(
            [
                one if len(one) == counts[name] else np.zeros(counts[name], dtype=bool)
                for name, one in known.items()
            ]
        )

    def mark_used(self, arrivals: Mapping[str, Arrivals], used: BoolArray) -> Self:
        """Return the recent rows with more entries marked as used, by a `used_mask` mask."""
        ends = np.cumsum([len(one.message.target) for one in arrivals.values()])
        parts = dict(zip(arrivals, np.split(used, ends[:-1]), strict=True))
        same = {n: one for n, one in parts.items() if len(self.used.get(n, ())) == len(one)}
        return replace(self, used={**self.used, **same})


def _select_rows(
    seen: Arrivals, used: BoolArray, rows: slice | IntArray
) -> tuple[Arrivals, BoolArray]:
    _, which = selected_offsets_and_indices(seen.message.offsets, rows)
    return Arrivals(seen.source, seen.instants.take(rows), seen.message.take(rows)), used[which]


def _concatenate_by_run(parts: list[tuple[Arrivals, BoolArray]]) -> tuple[Arrivals, BoolArray]:
    """Return one sensor's rows joined by run and time, and the mask of their used entries."""
    (first, used), *more = parts
    if not more:
        return first, used
    whole = Arrivals(
        first.source,
        RunTicks.concatenate([one.instants for one, _ in parts]),
        Detections.concatenate([one.message for one, _ in parts]),
    )
    used = np.concatenate([flags for _, flags in parts])
    order = whole.instants.sort_indices()
    return (whole, used) if order is None else _select_rows(whole, used, order)


def whole_rows_and_new_detections(
    row: IntArray, parts: IntArray, made: IntArray, used: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return fused rows all new and of one instant, and the others' new detections (row, index).

    A tracker that took a detection twice, or two of different instants for one of one, would be
    too sure. So a fused row counts as it is if all that it is made of is new and was measured at
    one instant. Of any other one its new detections count, each for itself.

    Parameters
    ----------
    row : (fused,) of int
        At which instant each is, by number, ascending.
    parts : (quantities, fused) of int
        The detections that it takes its values of; -1 for none.
    made : (detections,) of int
        When each was measured, tick.
    used : (detections,) of bool
        Whether it was in a fused row before these.

    Returns
    -------
    whole : (rows,) of int
        Which fused rows count as they are.
    at, alone : (more,) of int
        The row of each detection that counts for itself, and which one it is.
    """
    there = parts >= 0
    at = np.broadcast_to(row, parts.shape)
    first = np.full(len(made), np.iinfo(np.int64).max)
    np.minimum.at(first, parts[there], at[there])
    new = there & ~used[parts] & (first[parts] == at)
    ticks = made[parts]
    latest = np.where(there, ticks, np.iinfo(np.int64).min).max(axis=0)
    earliest = np.where(there, ticks, np.iinfo(np.int64).max).min(axis=0)
    whole = (new | ~there).all(axis=0) & (latest == earliest)
    in_whole = np.zeros(len(made), dtype=bool)
    in_whole[parts[there & whole]] = True
    alone = new & ~whole & ~in_whole[parts]
    pairs = np.unique(np.stack([at[alone], parts[alone]]), axis=1)
    return whole.nonzero()[0], pairs[0], pairs[1]
