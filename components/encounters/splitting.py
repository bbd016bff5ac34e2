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

from dataclasses import replace

import numpy as np

from components.encounters.sampling import EncounterDraws
from components.formats.encounter_set import FAMILY, EncounterSet
from components.well_clear.volume import PRESETS
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray

_NMAC = PRESETS["nmac"]


def expected_copy_counts(scores: FloatArray, levels: FloatArray, copies: FloatArray) -> FloatArray:
    """Return each encounter's expected copies, by how many falling levels its score is below.

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
    result: FloatArray = copies[stage]
    return result


def draw_copy_counts(numbers: IntArray, expected: FloatArray, seed: int) -> IntArray:
    """Return each encounter's copies: the expected number rounded down or, by chance, up."""
    uniform = EncounterDraws(seed, "splitting").uniform_fast(numbers, 1)[0]
    result: IntArray = np.floor(expected).astype(np.int64) + (uniform < expected % 1.0)
    return result


def split_set(encounters: EncounterSet, expected: FloatArray, seed: int) -> EncounterSet:
    """Return copies as a set, numbered from 0, with divided weights and originals' numbers."""
    many = draw_copy_counts(encounters.numbers, expected, seed)
    indices = np.repeat(np.arange(len(encounters)), many)
    family: AnyArray = encounters.extra.get(FAMILY, encounters.numbers)
    made = encounters.take(indices)
    return replace(
        made,
        numbers=np.arange(len(indices)),
        weights=(encounters.weights / expected)[indices],
        extra=made.extra | {FAMILY: family[indices]},
    )


def least_miss_in_nmac_sizes(encounters: EncounterSet, index: int) -> float:
    """Return an encounter's least distance in sizes of the NMAC cylinder; below 1 is an NMAC.

    The least, over the times of both paths' samples and over intruders, of the larger of horizontal
    distance over 500 ft and vertical distance over 100 ft; below 1 there is an NMAC. What happens
    between two samples is left out: it is a score, and no estimate rests on it.
    """
    best = np.inf
    for times, own, other in encounters.common_times_and_positions(index):
        if len(times):
            north, east, up = other - own
            horizontal = np.hypot(north, east) / _NMAC.horizontal_m
            best = min(best, float(np.maximum(horizontal, np.abs(up) / _NMAC.vertical_m).min()))
    return best
