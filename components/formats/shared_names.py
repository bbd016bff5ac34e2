"""Aircraft that share a name in a table: told apart where no aircraft could fly between samples."""

import math
from collections.abc import Callable

import numpy as np

from components.geometry import SEMI_MAJOR_AXIS_M, unit_vectors
from dsa_des.arrays.types import FloatArray, IntArray

# Faster than any aircraft, m/s; and how far a position may be off besides, where times are rounded.
_FASTEST_MPS, _SLACK_M = 1000.0, 5000.0
# Fewer samples are positions gone wrong, and no aircraft.
_LEAST_SAMPLES = 3


def aircraft_of(time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray) -> IntArray:
    """Return which aircraft each sample of one name is of, numbered from 0 by their first samples.

    Samples are in the order of time. Each belongs to the aircraft whose last place is nearest if
    one could fly from there, else to another. Samples of none that has enough are the first one's.
    """
    place = SEMI_MAJOR_AXIS_M * unit_vectors(np.radians(lon_deg), np.radians(lat_deg))
    steps_m = np.linalg.norm(np.diff(place, axis=0), axis=1)
    number = np.zeros(len(time_s), dtype=np.int64)
    if not (steps_m > _FASTEST_MPS * np.diff(time_s) + _SLACK_M).any():
        return number
    last: list[tuple[float, list[float]]] = []
    for row, (now_s, here) in enumerate(zip(time_s.tolist(), place.tolist(), strict=True)):
        reached = [
            (away_m, k)
            for k, (then_s, there) in enumerate(last)
            if (away_m := math.dist(there, here)) <= _FASTEST_MPS * (now_s - then_s) + _SLACK_M
        ]
        mine = min(reached)[1] if reached else len(last)
        last[mine : mine + 1] = [(now_s, here)]
        number[row] = mine
    kept = np.flatnonzero(np.bincount(number) >= _LEAST_SAMPLES)
    renamed = np.zeros(len(last), dtype=np.int64)
    renamed[kept] = np.arange(len(kept))
    return renamed[number]


#: Lines and columns of each aircraft's samples, by name.
Samples = dict[str, tuple[IntArray, dict[str, FloatArray]]]


def told_apart(samples: Samples, note: Callable[[str, str], None]) -> Samples:
    """Return samples with names of their own for aircraft that share one, and note each such name.

    The first keeps its name, others are numbered from 2: ``"X (2)"``.
    """
    result: Samples = {}
    for name, (lines, columns) in samples.items():
        order = np.argsort(columns["time"], kind="stable")
        of = np.empty(len(lines), dtype=np.int64)
        of[order] = aircraft_of(*(columns[key][order] for key in ("time", "lat", "lon")))
        if not of.any():
            result[name] = lines, columns
            continue
        names = [name]
        while len(names) <= of.max():
            free = (f"{name} ({k})" for k in range(len(names) + 1, len(samples) + 10**6))
            names.append(next(one for one in free if one not in samples and one not in names))
        for number, one in enumerate(names):
            mine = of == number
            result[one] = lines[mine], {key: values[mine] for key, values in columns.items()}
        counts = [f"{one!r} with {np.count_nonzero(of == k)}" for k, one in enumerate(names)]
        note(name, f"is {len(names)} aircraft, for none flies so far from one sample to the "
                   f"next: {', '.join(counts)} samples")  # fmt: skip
    return result
