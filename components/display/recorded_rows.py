"""A run's tables read for figures, row group by row group: no table is ever in memory as a whole.

Detections are thinned where they are many; of scans each sensor's first times and first hit are
kept, and single scans of a part of the run.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from components.display.summary import rows_by_name
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.mark import Mark
from dsa_des.block.message import Text

MOST_ROWS = 400_000
"""More detections than this are thinned when they are read, those of long series first."""

#: So many scans of a sensor tell from when to when it usually is.
_FIRST_SCANS = 1000
#: Columns that are read as codes and names.
TEXT = ("block", "target", "sensors", "track_status")
_SCANS = ("block", "time_s", "detected")
_DETECTIONS = ("block", "target", "time_s", "true_range_m")


def iterate_row_groups(
    path: Path, columns: Sequence[str], most: float = math.inf
) -> Iterator[dict[str, Any]]:
    """Yield each Parquet row group's wanted columns by name; nothing if there is no such file.

    They are arrays, texts a `Text`. Of a table of more rows than `most`, groups spread over it.
    """
    if not path.is_file():
        return
    import pyarrow.parquet as pq

    text = [name for name in columns if name in TEXT]
    with pq.ParquetFile(path, read_dictionary=text) as file:
        step = max(1, math.ceil(file.metadata.num_rows / most))
        for number in range(0, file.num_row_groups, step):
            table = file.read_row_group(number, columns=list(columns))
            if table.num_rows:
                yield {name: _column_to_array(table[name], name in TEXT) for name in columns}


def row_count(path: Path) -> int:
    """Return the number of rows of a Parquet table; 0 if the file is missing."""
    if not path.is_file():
        return 0
    import pyarrow.parquet as pq

    return int(pq.read_metadata(path).num_rows)


def _column_to_array(column: Any, text: bool) -> Any:
    if not text:
        return column.combine_chunks().to_numpy(zero_copy_only=False)
    if column.num_chunks > 1:
        column = column.unify_dictionaries()
    chunks = column.chunks
    codes = [chunk.indices.fill_null(-1).to_numpy(zero_copy_only=False) for chunk in chunks]
    return Text(np.concatenate(codes).astype(np.int64), tuple(chunks[0].dictionary.to_pylist()))


def iterate_fused(folder: Path) -> Iterator[tuple[FloatArray, IntArray, tuple[str, ...]]]:
    """Yield by row group of ``fused`` times (s), codes of sensor combinations and their names."""
    for rows in iterate_row_groups(folder / "fused.parquet", ("time_s", "sensors")):
        yield rows["time_s"], rows["sensors"].codes, rows["sensors"].names


@dataclass
class Detected:
    """Times, true ranges and target indices of each sensor's detections, perhaps thinned.

    ``target`` is an index into the names of targets; ranges are true slant ranges.
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
        """Return by sensor a run folder's detections of true targets, thinned if very many."""
        known: dict[str, int] = {}
        series: dict[tuple[str, int], int] = {}

        def pieces() -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
            for group in iterate_row_groups(folder / "detections.parquet", _DETECTIONS):
                code, names = group["target"].codes, group["target"].names
                # Codes of a row group speak of that row group's names only.
                lookup = np.array([known.setdefault(name, len(known)) for name in names] or [0])
                index = np.flatnonzero(code >= 0)  # a false alarm is marked nowhere
                block, blocks = group["block"].codes, group["block"].names
                pair = block[index] * len(lookup) + code[index]
                pair, which = np.unique(pair, return_inverse=True)
                ids = [
                    series.setdefault((blocks[a], int(lookup[b])), len(series))
                    for a, b in zip(*(p.tolist() for p in divmod(pair, len(lookup))), strict=True)
                ]
                number = np.array(ids, dtype=np.int64)[which]
                yield number, group["time_s"][index], group["true_range_m"][index]

        number, (time_s, range_m) = thin_rows(pieces, MOST_ROWS, 2)
        all_sensors = sorted({*sensors, *(name for name, _ in series)})
        sensor = np.array([all_sensors.index(name) for name, _ in series], dtype=np.int64)[number]
        target = np.array([target for _, target in series], dtype=np.int64)[number]
        chosen = {name: np.flatnonzero(sensor == i) for i, name in enumerate(all_sensors)}
        return cls(
            all_sensors,
            {name: time_s[index] for name, index in chosen.items()},
            {name: range_m[index] for name, index in chosen.items()},
            {name: target[index] for name, index in chosen.items()},
            list(known),
        )


def thin_rows(
    pieces: Callable[[], Iterable[tuple[Any, ...]]], most: int, columns: int
) -> tuple[IntArray, list[FloatArray]]:
    """Return series number and columns of the rows kept when rows of many series are thinned.

    Pieces are read twice, first to count; each is the rows' series 0, 1, 2, ... and columns. Every
    series keeps its first row and every n-th from there on (`strides`), so a series with few rows
    keeps them beside one with millions, whatever the pieces.
    """
    counts: IntArray = np.empty(0, dtype=np.int64)
    for series, *_ in pieces():
        counts = np.bincount(series, minlength=len(counts)) + np.pad(
            counts, (0, max(0, int(series.max(initial=-1)) + 1 - len(counts)))
        )
    every, before = row_strides(counts, most), np.zeros_like(counts)
    result: list[list[Any]] = [[np.empty(0, np.int64)], *([np.empty(0)] for _ in range(columns))]
    for series, *values in pieces():
        kept = (before[series] + index_in_groups(series)) % every[series] == 0
        before += np.bincount(series, minlength=len(before))
        for parts, column in zip(result, (series, *values), strict=True):
            parts.append(column[kept])
    series, *values = map(np.concatenate, result)
    return series, values


def row_strides(counts: IntArray, most: int) -> IntArray:
    """Return n for each series, a power of two: only every n-th row of it is kept.

    Series of up to some length keep all their rows, longer ones at most that length, such that
    all together keep `most`, or one each. Where any count grows, no stride shrinks.
    """
    if int(counts.sum()) <= most:
        return np.ones(len(counts), dtype=np.int64)
    ascending = np.sort(counts)
    shorter = np.concatenate(([0], np.cumsum(ascending)[:-1]))
    # The length when the i-th and all longer series share what the shorter ones leave over.
    shared = (most - shorter) // np.arange(len(counts), 0, -1)
    longest = max(1, int(shared[np.argmax(shared < ascending)]))
    every: IntArray = np.ones(len(counts), dtype=np.int64)
    while (long := -(-counts // every) > longest).any():
        every[long] *= 2
    return every


def index_in_groups(group: IntArray) -> IntArray:
    """Return how many rows of its own group come before each row, shape (rows,)."""
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    lengths = np.diff(starts, append=len(group))
    indices = np.empty(len(group), dtype=np.int64)
    indices[order] = np.arange(len(group)) - np.repeat(starts, lengths)
    return indices


@dataclass
class SensorScans:
    """Times of a sensor's first `_FIRST_SCANS` scans, and of its first scan with a detection."""

    first_s: FloatArray
    first_hit_s: float | None

    @property
    def period_s(self) -> float | None:
        """Usual time between scans, s; None for a single scan."""
        return scan_period_s(self.first_s)


def scan_period_s(time_s: FloatArray) -> float | None:
    """Return the usual time between scans, s; None where all are at one time.

    It is the mean of the usual steps: a sensor that is out for a while scans no slower.
    """
    steps_s = np.diff(np.unique(time_s))
    if not len(steps_s):
        return None
    usual_s = np.sort(steps_s)[(len(steps_s) - 1) // 2]
    return float(steps_s[steps_s <= 1.5 * usual_s].mean())


@dataclass
class ScansShown:
    """Times of scans in part of a run, of those with a detection, and of the last such before."""

    time_s: FloatArray
    hit_s: FloatArray


def read_scans(folder: Path) -> dict[str, SensorScans]:
    """Return by sensor the times of first scans and of the first detection, from ``scans``."""
    result: dict[str, SensorScans] = {}
    for rows in iterate_row_groups(folder / "scans.parquet", _SCANS):
        for name, (time_s, hit_s) in _scan_and_hit_times(rows).items():
            scans = result.setdefault(name, SensorScans(time_s[:0], None))
            if len(scans.first_s) < _FIRST_SCANS:
                scans.first_s = np.concatenate([scans.first_s, time_s])[:_FIRST_SCANS]
            if scans.first_hit_s is None and len(hit_s):
                scans.first_hit_s = float(hit_s[0])
    return dict(sorted(result.items()))


def scans_between(
    folder: Path, start_s: float, end_s: float, scans: Iterable[str]
) -> dict[str, ScansShown]:
    """Return by sensor the times of scans in [start_s, end_s], and of those with a detection, with
    the last one before.
    """
    times: dict[str, list[FloatArray]] = {name: [] for name in scans}
    hits: dict[str, list[FloatArray]] = {name: [] for name in times}
    before: dict[str, FloatArray] = {}
    for rows in iterate_row_groups(folder / "scans.parquet", _SCANS):
        if float(rows["time_s"][0]) > end_s:
            break
        for name, (time_s, hit_s) in _scan_and_hit_times(rows).items():
            first, last = np.searchsorted(hit_s, start_s), np.searchsorted(hit_s, end_s, "right")
            before[name] = hit_s[:first][-1:] if first else before.get(name, hit_s[:0])
            hits[name].append(hit_s[first:last])
            times[name].append(time_s[(time_s >= start_s) & (time_s <= end_s)])
    nothing = np.empty(0)
    return {
        name: ScansShown(
            np.concatenate([*times[name], nothing]),
            np.concatenate([before.get(name, nothing), *hits[name]]),
        )
        for name in times
    }


def _scan_and_hit_times(rows: Mapping[str, Any]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return by sensor the times of a row group's scans, and of those with a detection."""
    return {
        name: (rows["time_s"][mine], rows["time_s"][mine[rows["detected"][mine] > 0]])
        for name, mine in rows_by_name(rows["block"])
    }
