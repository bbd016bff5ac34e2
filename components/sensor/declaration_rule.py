"""The rule by which a sensor declares a target: m detections in its last n looks at *it*.

That knows which detections are of one target: `declaration_by_place` goes by what is measured.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from components.sensor.declaration import BoolArray, declare_looks, no_looks_yet
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

if TYPE_CHECKING:
    from components.sensor.look import Cells, Look


class DeclarationRule(Effect):
    """Marks the detections of declared targets; without a rule every detection declares."""

    name = "declaration"
    acts_on = "declaration"
    lockstep = True

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``declare_m`` and ``declare_n``."""
        m, n = block.p.declare_m, block.p.declare_n
        if m is None:
            return Verdict(False, "declare_m and declare_n are not given")
        if block.p.declares_by == "place":
            return Verdict(False, "places are declared, not targets")
        return Verdict(True, f"declare_m is {m} and declare_n is {n}")

    def build(self, block: Any) -> "Declarations":
        """Return what judges the looks of this sensor; 1 of 1 where it has no rule."""
        if block.p.declares_by == "place":  # built all the same, it declares whatever is reported
            return Declarations(1, 1)
        return Declarations(block.p.declare_m or 1, block.p.declare_n or 1)


class Declarations:
    """Remembers each target's last looks and when it was first declared.

    A look is a scan that had the target in reach: a scan that skipped it neither helps nor counts
    as a miss.

    Parameters
    ----------
    m, n : int
    """

    def __init__(self, m: int, n: int) -> None:
        self.m, self.n = m, n
        self._names: tuple[str, ...] = ()
        #: Of all targets of the first replica, of the second, and so on.
        self._memory: BoolArray = no_looks_yet(n, 0)
        self._first_tick: IntArray = np.empty(0, dtype=np.int64)
        self._first_range_m: FloatArray = np.empty(0)

    def __call__(self, cells: "Cells", look: "Look") -> "Look":
        """Return the look with a column ``declared``."""
        self._names = cells.roster.names
        who = cells.replica * len(self._names) + cells.target
        replicas = int(cells.replica.max(initial=0)) + 1
        if len(self._memory) < replicas * len(self._names):
            self._remember(replicas * len(self._names))
        declared, self._memory = declare_looks(who, look.detected, self.m, self.n, self._memory)
        self._note_first(cells, who, np.flatnonzero(declared))
        if self.m == 1:  # whatever is reported is declared, and a false alarm is like the others
            return look
        return replace(look, extras={**look.extras, "declared": declared})

    def _remember(self, count: int) -> None:
        """Remember so many targets."""
        more = count - len(self._memory)
        self._memory = np.concatenate([self._memory, no_looks_yet(self.n, more)])
        self._first_tick = np.append(self._first_tick, np.full(more, -1))
        self._first_range_m = np.append(self._first_range_m, np.full(more, np.nan))

    def _note_first(self, cells: "Cells", who: IntArray, declared: IntArray) -> None:
        target, place = np.unique(who[declared], return_index=True)
        new = self._first_tick[target] < 0
        first = declared[place[new]]
        self._first_tick[target[new]] = cells.scan_ticks[cells.row[first]]
        self._first_range_m[target[new]] = cells.range_m[first]

    def first(self, ticks_per_s: int) -> dict[str, dict[str, float] | None]:
        """Return by target when it was first declared and its true range then, or None."""
        return {
            name: None if tick < 0 else {"time_s": tick / ticks_per_s, "range_m": range_m}
            for name, tick, range_m in zip(
                self._names, self._first_tick.tolist(), self._first_range_m.tolist(), strict=True
            )
        }
