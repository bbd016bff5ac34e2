"""The scans of each sensor, and those in which it detected something, from a run's table."""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.display.row_groups import RowGroups, each_row_group, row_groups
from dsa_des.arrays.types import FloatArray

_COLUMNS = ("block", "time_s", "detected")


@dataclass
class SensorScans:
    """All scans of a sensor, in four numbers.

    Parameters
    ----------
    count : int
    first_s, last_s : float
        Times of the first and the last scan.
    first_hit_s : float or None
        Time of the first scan with a detection.
    """

    count: int
    first_s: float
    last_s: float
    first_hit_s: float | None

    @property
    def period_s(self) -> float | None:
        """Mean time from scan to scan; None for a single scan."""
        if self.count < 2:
            return None
        return (self.last_s - self.first_s) / (self.count - 1)

    @property
    def rate_hz(self) -> float | None:
        """Mean number of scans per second; None where all are at one time."""
        if self.last_s <= self.first_s:
            return None
        return (self.count - 1) / (self.last_s - self.first_s)


@dataclass
class ScansShown:
    """Single scans of a sensor, in a part of a run.

    Parameters
    ----------
    time_s : (scans,)
    hit_s : (hits,)
        Times of those with a detection, preceded by the last such time before the part.
    """

    time_s: FloatArray
    hit_s: FloatArray


def read_scans(folder: Path) -> dict[str, SensorScans]:
    """Return what the table ``scans`` of a run folder says of each sensor, by name."""
    found: dict[str, SensorScans] = {}
    for rows in each_row_group(folder / "scans.parquet", _COLUMNS):
        for name, (time_s, hit_s) in _by_sensor(rows).items():
            first, last = float(time_s[0]), float(time_s[-1])
            scans = found.setdefault(name, SensorScans(0, first, last, None))
            scans.count += len(time_s)
            scans.last_s = last
            if scans.first_hit_s is None and len(hit_s):
                scans.first_hit_s = float(hit_s[0])
    return dict(sorted(found.items()))


def scans_between(
    folder: Path, start_s: float, end_s: float, scans: Mapping[str, SensorScans]
) -> dict[str, ScansShown]:
    """Return the scans of each sensor in [start_s, end_s].

    Parameters
    ----------
    folder : Path
    start_s, end_s : float
    scans : mapping
        Of the same run, as from `read_scans`.
    """
    times: dict[str, list[FloatArray]] = {name: [] for name in scans}
    hits: dict[str, list[FloatArray]] = {name: [] for name in scans}
    with row_groups(folder / "scans.parquet", _COLUMNS) as groups:
        first = bisect_left(
            range(len(groups)), start_s, key=lambda number: groups.last(number, "time_s")
        )
        for number in range(first, len(groups)):
            rows = groups.read(number, _COLUMNS)
            if float(rows["time_s"][0]) > end_s:
                break
            for name, (time_s, hit_s) in _by_sensor(rows).items():
                times[name].append(time_s[(time_s >= start_s) & (time_s <= end_s)])
                hits[name].append(hit_s[(hit_s >= start_s) & (hit_s <= end_s)])
        before = _last_hits_before(groups, min(first, len(groups) - 1), start_s, scans)
    return {
        name: ScansShown(
            np.concatenate([*times[name], np.empty(0)]),
            np.concatenate([before.get(name, np.empty(0)), *hits[name]]),
        )
        for name in scans
    }


def _last_hits_before(
    groups: RowGroups, number: int, start_s: float, scans: Mapping[str, SensorScans]
) -> dict[str, FloatArray]:
    """Return the last scan with a detection before a time, searched backwards from a row group."""
    wanted = {
        name
        for name, scan in scans.items()
        if scan.first_hit_s is not None and scan.first_hit_s < start_s
    }
    found: dict[str, FloatArray] = {}
    while wanted and number >= 0:
        for name, (_, hit_s) in _by_sensor(groups.read(number, _COLUMNS)).items():
            earlier = hit_s[hit_s < start_s]
            if name in wanted and len(earlier):
                found[name] = earlier[-1:]
                wanted.remove(name)
        number -= 1
    return found


def _by_sensor(rows: Mapping[str, Any]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return for each sensor of a row group its times, and those of scans with a detection."""
    code, names = rows["block"]
    found = {}
    for number, name in enumerate(names):
        mine = code == number
        if mine.any():
            time_s = rows["time_s"][mine]
            found[name] = time_s, time_s[rows["detected"][mine] > 0]
    return found
