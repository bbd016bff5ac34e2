"""A look: the cells that need a sensor's physics, and what the physics says of each."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.messages.targets import RelativeTargets
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Look:
    """What a sensor's physics says of each cell.

    Parameters
    ----------
    detected : (cells,) of bool
    confidence : (cells,)
    extras : dict of (cells,)
        Recorded beside the detection: ``snr_db``, ``detection_probability``, ``pixels``.
    """

    detected: BoolArray
    confidence: FloatArray
    extras: dict[str, AnyArray] = field(default_factory=dict)


class Cells:
    """The (scan, target) pairs that need a sensor's physics, as flat contiguous arrays.

    Any field of `RelativeTargets` can be read as an attribute, for example ``cells.range_m``.

    Parameters
    ----------
    targets : RelativeTargets
    rows : (scans,)
        Message row of each scan; kept as ``message_rows``.
    wanted : (scans, targets) of bool
    scans : (scans,)
        Scan numbers.
    scan_ticks : (scans,), optional
        When each scan is; needed by what compares one scan with the next.
    """

    def __init__(
        self,
        targets: RelativeTargets,
        rows: IntArray,
        wanted: BoolArray,
        scans: IntArray,
        scan_ticks: IntArray | None = None,
    ) -> None:
        self._targets = targets
        self.message_rows = rows
        self.roster = targets.roster
        place = wanted.ravel().nonzero()[0]
        width = max(1, wanted.shape[1])
        #: Index of each cell's scan within this look, and of its target in the roster.
        if len(rows) == 1:
            self.row, self.target = np.zeros(len(place), dtype=np.int64), place
        elif width == 1:
            self.row, self.target = place, np.zeros(len(place), dtype=np.int64)
        else:
            self.row, self.target = np.divmod(place, width)
        self.scan = scans[self.row]
        self.scan_ticks = targets.tick[rows] if scan_ticks is None else scan_ticks
        self._width = width
        # Rows that only rise and are as many as there are, are all of them.
        self._everything = len(place) == targets.range_m.size and (
            len(rows) == 1 or bool((rows[1:] > rows[:-1]).all())
        )
        self._flat = place if self._everything else rows[self.row] * width + self.target
        self.target = targets.columns[self.target]

    def __len__(self) -> int:
        return len(self.target)

    def __getattr__(self, name: str) -> Any:
        if name[0] == "_":
            raise AttributeError(name)
        flat = getattr(self._targets, name).reshape(-1)
        gathered = flat if self._everything else flat.take(self._flat)
        self.__dict__[name] = gathered  # the next time it is a plain attribute
        return gathered

    def of_row(self, name: str) -> AnyArray:
        """Return a field of the message that has one value per row, for each cell."""
        return getattr(self._targets, name).take(self._flat // self._width)

    def of_target(self, column: FloatArray) -> AnyArray:
        """Return a per-target column (shape (targets,)) for each cell."""
        return column[self.target]

    def draws(self, stream: Any, draw: int = 0) -> FloatArray:
        """Return uniform draws keyed by each cell's target and scan."""
        return stream.uniform(self.roster.keys_of(self.target), self.scan, draw)
