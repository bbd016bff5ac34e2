"""Reading a run's detections for drawing: only what a figure needs, thinned where it is much."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from components.display.row_groups import each_row_group
from components.display.thinned_stream import ThinnedStream
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.mark import Mark

MOST_ROWS = 400_000
"""More detections than this are thinned when they are read, those of long series first."""

_DETECTION_COLUMNS = ("block", "target", "time_s", "true_range_m")


@dataclass
class Detected:
    """Where and when each sensor detected something.

    Parameters
    ----------
    sensors : list of str
        All sensors, in the order in which they are drawn.
    time_s, range_m : dict of (detections,)
        By sensor; true slant range.
    target : dict of (detections,)
        By sensor: index into `names`.
    names : list of str
        Targets that were detected.
    """

    sensors: list[str]
    time_s: dict[str, FloatArray]
    range_m: dict[str, FloatArray]
    target: dict[str, IntArray]
    names: list[str]
    #: How each sensor is marked.
    styles: dict[str, Mark] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path, sensors: Sequence[str]) -> "Detected":
        """Read the table ``detections`` of a run folder, if there is one."""
        rows = ThinnedStream(MOST_ROWS, 2)
        known: dict[str, int] = {}
        series: dict[tuple[str, int], int] = {}
        for group in each_row_group(folder / "detections.parquet", _DETECTION_COLUMNS):
            code, names = group["target"]
            # Codes of a row group speak of that row group's names only.
            lookup = np.array([known.setdefault(name, len(known)) for name in names] or [0])
            index = np.flatnonzero(code >= 0)  # a false alarm has no place to be marked at
            block, blocks = group["block"]
            pair, which = np.unique(block[index] * len(lookup) + code[index], return_inverse=True)
            ids = [
                series.setdefault((blocks[a], int(lookup[b])), len(series))
                for a, b in zip(*(part.tolist() for part in divmod(pair, len(lookup))), strict=True)
            ]
            number = np.array(ids, dtype=np.int64)[which]
            rows.add(number, group["time_s"][index], group["true_range_m"][index])
        return cls._of_series(sensors, list(series), list(known), rows)

    @classmethod
    def _of_series(
        cls,
        sensors: Sequence[str],
        series: list[tuple[str, int]],
        names: list[str],
        rows: ThinnedStream,
    ) -> "Detected":
        number, (time_s, range_m) = rows.rows()
        all_sensors = sorted({*sensors, *(name for name, _ in series)})
        sensor = np.array([all_sensors.index(name) for name, _ in series], dtype=np.int64)[number]
        target = np.array([target for _, target in series], dtype=np.int64)[number]
        chosen = {name: np.flatnonzero(sensor == i) for i, name in enumerate(all_sensors)}
        return cls(
            all_sensors,
            {name: time_s[index] for name, index in chosen.items()},
            {name: range_m[index] for name, index in chosen.items()},
            {name: target[index] for name, index in chosen.items()},
            names,
        )


def read_fused(folder: Path) -> Iterator[tuple[FloatArray, IntArray, list[str]]]:
    """Give for each row group of ``fused``, in order: times, codes of combinations, their names."""
    for rows in each_row_group(folder / "fused.parquet", ("time_s", "sensors")):
        code, names = rows["sensors"]
        yield rows["time_s"], code, names
