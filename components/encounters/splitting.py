"""Splitting by stages: encounters that matter are flown more often, others less, without bias.

A stage is a set of encounters nearer than a level, by whatever score tells how near an event they
are: the geometry of the flights, or what a study measured of them. An encounter with the score s is
expected in r(s) copies, of which each weighs w / r: more than one near the event, less than one far
from it (Russian roulette). Whatever the score, the expected weight of its copies is its own, so any
weighted sum over the copies has the same expectation as over the set. Copies fly the same paths
under other random numbers; they hang together and are one *family*, over which intervals are taken.

H. Kahn & T. E. Harris, "Estimation of particle transmission by random sampling", National Bureau of
Standards AMS 12, 1951; P. Glasserman, P. Heidelberger, P. Shahabuddin & T. Zajic, "Multilevel
splitting for estimating rare event probabilities", Operations Research 47, 1999.
"""

import numpy as np

from components.encounters.sampling import EncounterDraws
from components.formats.encounter_set import FAMILY, EncounterSet
from components.well_clear.volume import PRESETS
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray

_NMAC = PRESETS["nmac"]


def expected_copies(scores: FloatArray, levels: FloatArray, copies: FloatArray) -> FloatArray:
    """Return in how many copies each encounter is expected; less of a score is nearer.

    Levels (k,) fall; copies (k + 1,) go from those of no stage to those of the last.
    """
    if len(copies) != len(levels) + 1:
        raise ValueError(
            f"{len(levels)} levels need {len(levels) + 1} numbers of copies; there are "
            f"{len(copies)}"
        )
    if not len(levels) or not np.isfinite(levels).all() or (np.diff(levels) >= 0.0).any():
        raise ValueError("levels must be falling numbers")
    if not np.isfinite(copies).all() or (copies <= 0.0).any():
        raise ValueError("numbers of copies must be above 0: what is never flown biases")
    if np.isnan(scores).any():
        raise ValueError("a score is missing")
    stage = (scores[:, np.newaxis] < levels).sum(axis=1)
    found: FloatArray = copies[stage]
    return found


def drawn_copies(numbers: IntArray, expected: FloatArray, seed: int) -> IntArray:
    """Return how many copies there are of each: the whole part, and one more by chance."""
    uniform = EncounterDraws(seed, "splitting").few(numbers, 1)[0]
    found: IntArray = np.floor(expected).astype(np.int64) + (uniform < expected % 1.0)
    return found


def split_set(found: EncounterSet, expected: FloatArray, seed: int) -> EncounterSet:
    """Return a set of copies, numbered from 0, that know their family."""
    many = drawn_copies(found.numbers, expected, seed)
    places = np.repeat(np.arange(len(found)), many)
    counts = np.diff(found.first_rows)
    rows = _runs(found.first_rows[:-1][places], counts[places])
    lengths = np.diff(found.starts)
    entries = _runs(found.starts[:-1][rows], lengths[rows])
    family: AnyArray = found.extra.get(FAMILY, found.numbers)
    return EncounterSet(
        found.source, found.kind, np.arange(len(places)), (found.weights / expected)[places],
        np.concatenate([[0], np.cumsum(counts[places])]),
        tuple(found.names[row] for row in rows.tolist()),
        {name: values[rows] for name, values in found.state.items()},
        np.concatenate([[0], np.cumsum(lengths[rows])]),
        {name: values[entries] for name, values in found.lists.items()},
        found.reference_deg,
        {n: v[places] for n, v in found.extra.items()} | {FAMILY: family[places]}, found.skipped,
    )  # fmt: skip


def _runs(firsts: IntArray, lengths: IntArray) -> IntArray:
    """Return first, first + 1, ... of every run, one run after the other."""
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if len(ends) else 0
    found: IntArray = np.arange(total) + np.repeat(firsts - (ends - lengths), lengths)
    return found


def nearness(found: EncounterSet, place: int) -> float:
    """Return how near an encounter's flights come, in sizes of the NMAC cylinder.

    The least, over the times of both paths' samples and over intruders, of the larger of horizontal
    distance over 500 ft and vertical distance over 100 ft; below 1 there is an NMAC. What happens
    between two samples is left out: it is a score, and no estimate rests on it.
    """
    first, end = (int(found.first_rows[place + k]) for k in (0, 1))
    own = found.path(first)
    best = np.inf
    for row in range(first + 1, end):
        other = found.path(row)
        times = np.union1d(own[0], other[0])
        times = times[(times >= max(own[0][0], other[0][0]))
                      & (times <= min(own[0][-1], other[0][-1]))]  # fmt: skip
        if not len(times):
            continue
        apart = [
            np.interp(times, other[0], other[k]) - np.interp(times, own[0], own[k])
            for k in (1, 2, 3)
        ]
        horizontal = np.hypot(apart[0], apart[1]) / _NMAC.horizontal_m
        best = min(best, float(np.maximum(horizontal, np.abs(apart[2]) / _NMAC.vertical_m).min()))
    return best
