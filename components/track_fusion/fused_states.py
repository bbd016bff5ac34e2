"""The state of a fused track from those of its members."""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import product, times
from components.estimation.covariance_intersection import Rule, combined, inverse
from components.estimation.motion import ConstantVelocity
from components.messages.state_tracks import COASTED, CONFIRMED, TENTATIVE
from components.track_fusion.local_tracks import LocalTracks
from components.track_fusion.track_association import bearing, leaders
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class FusedStates:
    """Fused tracks by replica and number."""

    replica: IntArray  # (n,) of int
    number: IntArray  # (n,) of int
    status: IntArray  # (n,) of int
    # (n,): The largest of any member: as much is sure whatever they have in common
    existence: FloatArray
    ranged: BoolArray  # (n,) of bool
    state: FloatArray  # (6, n), (6, 6, n): Of those without a range meaningless
    covariance: FloatArray  # (6, n), (6, 6, n): Of those without a range meaningless
    newest: IntArray  # (n,): Index of the member whose direction is told where there is no range
    time_s: FloatArray  # (n,)
    updated_s: FloatArray  # (n,)
    updated_by: IntArray  # (n,) of int
    contributors: IntArray  # (n,) of int


def fused_states(
    tracks: LocalTracks, time_s: FloatArray, motion: ConstantVelocity, rule: Rule
) -> FusedStates:
    """Return the fused tracks to which tracks belong.

    Members with a range come first, then those without, each group by tracker; each is combined
    with what those before it gave.
    """
    leader, of = leaders(tracks)
    count = len(leader)
    rank = _ranks(tracks, of)
    state, covariance = tracks.at(time_s, motion)
    x, p = state[:, leader].copy(), covariance[:, :, leader].copy()
    for turn in range(1, int(rank.max(initial=0)) + 1):
        member = np.flatnonzero((rank == turn) & tracks.ranged[leader[of]])
        for ranged in (True, False):
            mine = member[tracks.ranged[member] == ranged]
            if len(mine) == 0:
                continue
            into = of[mine]
            if ranged:
                information = inverse(covariance[:, :, mine])
                pull = times(information, state[:, mine] - x[:, into])
            else:
                told = bearing(tracks.take(mine), x[:, into], time_s[mine])
                weighed = told.jacobian.swapaxes(0, 1) / told.variance
                information = product(weighed, told.jacobian)
                pull = times(weighed, told.residual)
            shift, found, _ = combined(p[:, :, into], information, pull, rule)
            x[:, into] += shift
            p[:, :, into] = found
    status = np.full(count, TENTATIVE)
    for held in (COASTED, CONFIRMED):
        status[of[tracks.status == held]] = held
    existence, updated_s = np.zeros(count), np.full(count, -np.inf)
    np.maximum.at(existence, of, tracks.existence)
    np.maximum.at(updated_s, of, tracks.updated_s)
    contributors, updated_by = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    np.bitwise_or.at(contributors, of, tracks.contributors)
    last = tracks.updated_s == updated_s[of]
    np.bitwise_or.at(updated_by, of[last], tracks.updated_by[last])
    return FusedStates(
        replica=tracks.replica[leader],
        number=tracks.system[leader],
        status=status,
        existence=existence,
        ranged=tracks.ranged[leader],
        state=x,
        covariance=p,
        newest=_newest(tracks, of, count),
        time_s=time_s[leader],
        updated_s=updated_s,
        updated_by=updated_by,
        contributors=contributors,
    )


def _ranks(tracks: LocalTracks, of: IntArray) -> IntArray:
    """Return the place of each member in its fused track: by range, then by tracker."""
    order = np.lexsort((tracks.tracker, ~tracks.ranged, of))
    counts = np.bincount(of)
    rank = np.empty(len(of), dtype=np.int64)
    rank[order] = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    return rank


def _newest(tracks: LocalTracks, of: IntArray, count: int) -> IntArray:
    order = np.lexsort((-tracks.tracker, tracks.time_s, of))
    return order[np.cumsum(np.bincount(of, minlength=count)) - 1]
