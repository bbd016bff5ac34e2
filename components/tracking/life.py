"""The life of a track: when it is confirmed, coasts and ends.

Two rules confirm: m hits among the last n expected looks, or the sequential likelihood ratio of
Wald, applied to tracks by Sittler (IEEE Trans. Military Electronics 8, 1964): the logarithm of the
odds that there is something rises with every hit by ln(Pd N(z) / λ) and falls with every look in
vain by ln(1 - Pd Pg). A look counts for a track only if the track lies in the field of the sensor,
and only of sensors that see it: one that never hit it, or that has looked in vain for a while where
another one hits, may be too far away, and says nothing.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from components.messages.state_tracks import COASTED, CONFIRMED, DELETED, TENTATIVE
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Odds are kept within this: a track of an hour must not take an hour to be doubted.
LARGEST_SCORE = 20.0
#: Looks in vain of a sensor that never hit a track.
NEVER = 1 << 40
#: After so many looks in vain a sensor is taken not to see a track that another one sees.
BLIND_AFTER = 5
#: Looks that a history can hold.
LONGEST_WINDOW = 62


@dataclass(frozen=True)
class LifeRules:
    """When tracks are confirmed and deleted.

    Parameters
    ----------
    rule : {"m_of_n", "likelihood_ratio"}
    confirm_m, confirm_n : int
        Hits and looks of the first rule.
    false_confirmation, missed_confirmation : float
        Shares of false tracks that are confirmed and of true ones that are dropped, of the second.
    delete_misses : int
        Expected looks in vain in a row that end a confirmed track.
    """

    rule: Literal["m_of_n", "likelihood_ratio"]
    confirm_m: int
    confirm_n: int
    false_confirmation: float
    missed_confirmation: float
    delete_misses: int

    def judge(
        self,
        status: IntArray,
        history: IntArray,
        looks: IntArray,
        misses: IntArray,
        score: FloatArray,
        start_score: float,
    ) -> IntArray:
        """Return the status of tracks after a look.

        Parameters
        ----------
        status, history, looks, misses : (n,) of int
        score : (n,)
        start_score : float
            The odds with which a track starts.
        """
        if self.rule == "m_of_n":
            window = np.minimum(looks, self.confirm_n)
            hits = bits_set(history & ((np.int64(1) << np.int64(self.confirm_n)) - 1))
            confirm = hits >= self.confirm_m
            # What cannot come to m hits any more within its first n looks is dropped.
            hopeless = hits + (self.confirm_n - window) < self.confirm_m
        else:
            gained = score - start_score
            low = np.log(self.missed_confirmation / (1.0 - self.false_confirmation))
            confirm = gained >= np.log((1.0 - self.missed_confirmation) / self.false_confirmation)
            hopeless = gained <= low
        tentative = status == TENTATIVE
        new = np.where(tentative & confirm, CONFIRMED, status)
        new = np.where(tentative & ~confirm & hopeless, DELETED, new)
        held = (new == CONFIRMED) | (new == COASTED)
        new = np.where(held, np.where(misses > 0, COASTED, CONFIRMED), new)
        return np.where(held & (misses >= self.delete_misses), DELETED, new)


def seeing(vain: IntArray) -> BoolArray:
    """Return which sensors see which tracks, (sensors, n), from their looks in vain."""
    return np.asarray((vain < BLIND_AFTER) | ((vain == vain.min(axis=0)) & (vain < NEVER)))


def bits_set(values: IntArray) -> IntArray:
    """Return how many bits are 1 in numbers below 2^62."""
    v = values - (values >> 1 & 0x5555555555555555)
    v = (v & 0x3333333333333333) + (v >> 2 & 0x3333333333333333)
    v = v + (v >> 4) & 0x0F0F0F0F0F0F0F0F
    v = v + (v >> 8)
    v = v + (v >> 16)
    return np.asarray((v + (v >> 32)) & 0x7F, dtype=np.int64)


def existence(score: FloatArray) -> FloatArray:
    """Return the probability that belongs to the logarithm of odds."""
    return np.asarray(1.0 / (1.0 + np.exp(-score)))


def after_hits_and_misses(
    history: IntArray, looks: IntArray, misses: IntArray, hit: BoolArray, missed: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return history, looks and misses after a look that hit or missed some of the tracks."""
    counted = hit | missed
    mask = (np.int64(1) << np.int64(LONGEST_WINDOW)) - 1
    moved = np.where(counted, (history << 1 & mask) | hit, history)
    return moved, looks + counted, np.where(hit, 0, misses + missed)
