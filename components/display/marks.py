"""Reading a run's detections for drawing: only what a figure needs, thinned where it is much."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsa_des.types import AnyArray, FloatArray, IntArray

MOST_ROWS = 200_000
"""More detections than this are thinned, sensor by sensor, when they are read."""


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

    @classmethod
    def read(cls, folder: Path, sensors: Sequence[str]) -> "Detected":
        """Read the table ``detections`` of a run folder, if there is one."""
        parts: dict[str, list[Any]] = {name: [] for name in sensors}
        known: dict[str, int] = {}
        columns = ("block", "target", "time_s", "true_range_m")
        for rows, most in _row_groups(folder / "detections.parquet", columns):
            code, names = rows["target"]
            # Codes of a row group speak of that row group's names only.
            lookup = np.array([known.setdefault(name, len(known)) for name in names] or [0])
            for name, index in _by_name(rows["block"]):
                index = index[code[index] >= 0]  # a false alarm has no place to be marked at
                index = index[:: max(1, len(index) // most)]
                part = (rows["time_s"][index], rows["true_range_m"][index], lookup[code[index]])
                parts.setdefault(name, []).append(part)
        joined = {name: [_join(part, i) for i in (0, 1, 2)] for name, part in parts.items()}
        return cls(
            sorted(parts),
            {name: values[0] for name, values in joined.items()},
            {name: values[1] for name, values in joined.items()},
            {name: values[2].astype(np.int64) for name, values in joined.items()},
            list(known),
        )


def read_scans(folder: Path) -> dict[str, tuple[FloatArray, AnyArray]]:
    """Return for each sensor the times of its scans and the number of detections in each."""
    parts: dict[str, list[Any]] = {}
    for rows, _ in _row_groups(folder / "scans.parquet", ("block", "time_s", "detected")):
        for name, index in _by_name(rows["block"]):
            parts.setdefault(name, []).append((rows["time_s"][index], rows["detected"][index]))
    return {name: (_join(part, 0), _join(part, 1)) for name, part in sorted(parts.items())}


def read_fused(folder: Path) -> Iterator[tuple[FloatArray, IntArray, list[str]]]:
    """Give for each row group of ``fused``, in order: times, codes of combinations, their names."""
    for rows, _ in _row_groups(folder / "fused.parquet", ("time_s", "sensors")):
        code, names = rows["sensors"]
        yield rows["time_s"], code, names


def _row_groups(path: Path, columns: Sequence[str]) -> Iterator[tuple[dict[str, Any], int]]:
    """Give each row group as arrays, with the number of rows per sensor to keep of it."""
    if not path.is_file():
        return
    import pyarrow.parquet as pq

    text = [name for name in columns if name in ("block", "target", "sensors")]
    file = pq.ParquetFile(path, read_dictionary=text)
    groups = file.num_row_groups
    for number in range(groups):
        table = file.read_row_group(number, columns=list(columns))
        if table.num_rows:
            rows = {name: _array(table[name], name in text) for name in columns}
            yield rows, max(500, MOST_ROWS // groups)


def _array(column: Any, text: bool) -> Any:
    if not text:
        return column.combine_chunks().to_numpy(zero_copy_only=False)
    if column.num_chunks > 1:
        column = column.unify_dictionaries()
    chunks = column.chunks
    codes = [chunk.indices.fill_null(-1).to_numpy(zero_copy_only=False) for chunk in chunks]
    return np.concatenate(codes).astype(np.int64), chunks[0].dictionary.to_pylist()


def _by_name(column: tuple[IntArray, list[str]]) -> list[tuple[str, IntArray]]:
    code, names = column
    return [(name, np.flatnonzero(code == i)) for i, name in enumerate(names)]


def _join(parts: list[Any], item: int) -> Any:
    return np.concatenate([part[item] for part in parts]) if parts else np.empty(0)
