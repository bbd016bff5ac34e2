"""A recorded operator (``operator.recorded``): what was decided once is decided again."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from components.messages.decisions import OperatorDecision
from components.operator.console import Console, ConsoleParameters
from components.operator.decision_table import read_decisions
from dsa_des.block.component import ScenePath
from dsa_des.block.wake import Wake


class RecordedParameters(ConsoleParameters):
    """Parameters of a recorded operator."""

    decisions: ScenePath = Field(
        description="Table of decisions: a run's folder, its decisions.parquet, or a CSV file."
    )


class RecordedOperator(Console):
    """Repeats a table of decisions, each at the first scan not before its time.

    With the scan rate and the wires of the console that the table was recorded at, everything
    comes out as it did then, byte by byte.
    """

    Parameters = RecordedParameters
    windowed = True
    rewindable = True

    def setup(self) -> None:
        """Read the table."""
        super().setup()
        found = read_decisions(self.p.decisions)
        per_s = self.context.ticks_per_s
        self._ticks = np.array([round(time_s * per_s) for time_s, _ in found], dtype=np.int64)
        self._decided = tuple(decision for _, decision in found)
        self._next = 0

    def due(self, wake: Wake) -> Sequence[tuple[int, OperatorDecision]]:
        """Return what is due since the last scan."""
        scans = wake.ticks[wake.scans >= 0]
        if len(scans) == 0 or self._next == len(self._decided):
            return []
        first = self._next
        self._next = int(np.searchsorted(self._ticks, scans[-1], side="right"))
        at = scans[np.searchsorted(scans, self._ticks[first : self._next])]
        return list(zip(at.tolist(), self._decided[first : self._next], strict=True))

    def warnings(self) -> list[str]:
        """Say what comes too late to be decided in this run."""
        end = float(self.context.duration_s * self.context.ticks_per_s)
        late = int(np.count_nonzero(self._ticks >= end))
        return [f"decisions: {late} of {len(self._ticks)} come after the end"] if late else []
