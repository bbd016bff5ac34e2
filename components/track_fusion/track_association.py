"""Track-to-track association: which tracks of different trackers are of one target.

They are associated by their estimates, never by truth. A fused track has a leader: the first of its
members that has a range, or else the first. A track belongs to it if it lies in the gate around the
leader, and a fused track has at most one member of every tracker. Distances take the errors of two
trackers as independent: they share the motion's noise, which makes the true differences smaller, so
that the gate errs on the wide side.
"""

from dataclasses import dataclass

import numpy as np

from components.association.assignment import least_total_pair_indices, squared_gate_distance
from components.estimation.batched import (
    cholesky,
    mahalanobis_squared,
    matrix_product,
    multiply_by_transpose,
)
from components.estimation.measurement import Kind, linearise, residual
from components.estimation.motion import ConstantVelocity
from components.track_fusion.local_tracks import LocalTracks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_DIRECTION = Kind(has_range=False)


@dataclass(frozen=True)
class MatchRules:
    """Rules by which tracks of different trackers are taken to be of one target."""

    gate_probability: float  # That two tracks of one target lie in each other's gate
    motion: ConstantVelocity  # How targets move from the instant of one track to that of another
    # Standard deviation of the rate at which a line of sight turns that has no range
    bearing_rate_rad_s: float
    # How many times as far as the gate a member may drift from its leader before it leaves
    stay_factor: float
    platforms: tuple[str, ...] | None = None  # What carries each tracker; None where one does


@dataclass(frozen=True, eq=False)
class Bearing:
    """Residual, Jacobian and variance of a track's direction for a state at another instant."""

    # (2, n), azimuth and elevation as reported, less those of the state carried back to their
    # instant
    residual: FloatArray
    jacobian: FloatArray  # (2, 6, n), of the direction by the state
    variance: FloatArray  # (2, n)


def linearised_direction(tracks: LocalTracks, state: FloatArray, time_s: FloatArray) -> Bearing:
    """Return direction tracks' residual, Jacobian and variance for a state at another instant."""
    back_s = tracks.time_s - time_s
    then = state.copy()
    then[:3] += back_s * state[3:]
    seen, by_position = linearise(_DIRECTION, then, tracks.pose())
    measured = np.stack([tracks.azimuth_rad, tracks.elevation_rad])
    return Bearing(
        residual(measured, seen),
        np.concatenate([by_position, back_s * by_position], axis=1),
        np.stack([tracks.azimuth_variance_rad2, tracks.elevation_variance_rad2]),
    )


def gate_distance_ratio(
    rules: MatchRules, leader: LocalTracks, other: LocalTracks, time_s: FloatArray
) -> FloatArray:
    """Return pairs' squared statistical distance over the gate's threshold: at most 1 inside."""
    share = np.empty(len(leader))
    both, one = leader.ranged & other.ranged, leader.ranged ^ other.ranged
    none = ~(leader.ranged | other.ranged)
    if both.any():
        mine, theirs = leader.take(both), other.take(both)
        x, p = mine.states_and_covariances_at(time_s[both], rules.motion)
        y, q = theirs.states_and_covariances_at(time_s[both], rules.motion)
        share[both] = mahalanobis_squared(cholesky(p + q), x - y) / squared_gate_distance(
            rules.gate_probability, 6
        )
    two = squared_gate_distance(rules.gate_probability, 2)
    if one.any():
        swap = other.ranged & one
        mine = LocalTracks.concatenate([leader.take(one & ~swap), other.take(swap)])
        theirs = LocalTracks.concatenate([other.take(one & ~swap), leader.take(swap)])
        when = np.concatenate([time_s[one & ~swap], time_s[swap]])
        x, p = mine.states_and_covariances_at(when, rules.motion)
        angles = linearised_direction(theirs, x, when)
        spread = multiply_by_transpose(matrix_product(angles.jacobian, p), angles.jacobian)
        for i in range(2):
            spread[i, i] += angles.variance[i]
        result = mahalanobis_squared(cholesky(spread), angles.residual) / two
        result[_may_be_seeing_platform(rules, mine, theirs, x, p)] = np.inf
        where = np.concatenate([np.flatnonzero(one & ~swap), np.flatnonzero(swap)])
        share[where] = result
    if none.any():
        share[none] = _squared_bearing_distances(rules, leader.take(none), other.take(none)) / two
    return share


def _may_be_seeing_platform(
    rules: MatchRules, ranged: LocalTracks, seen: LocalTracks, x: FloatArray, p: FloatArray
) -> BoolArray:
    """Return a mask: True where the track with a range may be the very platform whose sensor
    measures the other track's direction.

    Of such a one each direction is likely. Who has it sees from elsewhere: nobody sees itself.
    """
    if rules.platforms is None:
        return np.zeros(len(ranged), dtype=bool)
    on = np.unique(rules.platforms, return_inverse=True)[1]
    near = mahalanobis_squared(cholesky(p[:3, :3]), x[:3] - seen.own_m)
    gate = squared_gate_distance(rules.gate_probability, 3)
    return np.asarray((on[ranged.tracker] != on[seen.tracker]) & (near <= gate))


def _squared_bearing_distances(
    rules: MatchRules, one: LocalTracks, other: LocalTracks
) -> FloatArray:
    apart = residual(
        np.stack(one.azimuth_elevation_in_frame_rad()),
        np.stack(other.azimuth_elevation_in_frame_rad()),
    )
    turned = (rules.bearing_rate_rad_s * (one.time_s - other.time_s)) ** 2
    level = np.maximum(np.cos(one.elevation_rad) ** 2, 1e-12)
    spread = np.stack(
        [
            one.azimuth_variance_rad2 + other.azimuth_variance_rad2 + turned / level,
            one.elevation_variance_rad2 + other.elevation_variance_rad2 + turned,
        ]
    )
    square = apart * apart / spread
    return np.asarray(square[0] + square[1])


def leader_indices(tracks: LocalTracks) -> tuple[IntArray, IntArray]:
    """Return the index of each fused track's leader, and each track's place in that array."""
    order = np.lexsort((tracks.tracker, ~tracks.ranged, tracks.system, tracks.replica))
    replica, system = tracks.replica[order], tracks.system[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (replica[1:] != replica[:-1]) | (system[1:] != system[:-1])
    of = np.empty(len(order), dtype=np.int64)
    of[order] = np.cumsum(first) - 1
    return order[first], of


def reset_numbers_of_strays(
    rules: MatchRules, tracks: LocalTracks, time_s: FloatArray
) -> LocalTracks:
    """Return the tracks; those too far from their fused track's leader get number 0 (none)."""
    member = np.flatnonzero(tracks.system > 0)
    if len(member) == 0:
        return tracks
    leader, of = leader_indices(tracks.take(member))
    lead = member[leader[of]]
    pair = np.flatnonzero(lead != member)
    if len(pair) == 0:
        return tracks
    share = gate_distance_ratio(
        rules, tracks.take(lead[pair]), tracks.take(member[pair]), time_s[member[pair]]
    )
    system = tracks.system.copy()
    system[member[pair[share > rules.stay_factor**2]]] = 0
    return tracks.with_columns(system=system)


def assign_fused_numbers(
    rules: MatchRules,
    tracks: LocalTracks,
    time_s: FloatArray,
    trackers: int,
    next_number: IntArray,
    replica: IntArray,
) -> tuple[LocalTracks, IntArray]:
    """Return tracks with a fused number each, kept or new, and each replica's next free number.

    Tracker by tracker, its tracks that belong nowhere, or stand alone, are assigned to the fused
    tracks that have none of it: the least sum of distances, none beyond its gate. One that stands
    alone goes to older ones only. What is left starts fused tracks of its own.
    """
    system = tracks.system.copy()
    next_number = next_number.copy()
    for tracker in range(trackers):
        now = tracks.with_columns(system=system)
        mine = tracks.tracker == tracker
        alone = _is_only_member(now)
        free = np.flatnonzero(mine & ((system == 0) | alone))
        if len(free) == 0:
            continue
        _assign_to_fused_tracks(rules, now, free, time_s, system)
        new = free[system[free] == 0]
        new = new[np.lexsort((tracks.number[new], tracks.replica[new]))]
        index = np.searchsorted(replica, tracks.replica[new])
        counts = np.bincount(index, minlength=len(replica))
        within = np.arange(len(new)) - (np.cumsum(counts) - counts)[index]
        system[new] = next_number[index] + within
        next_number += counts
    return tracks.with_columns(system=system), next_number


def _is_only_member(tracks: LocalTracks) -> BoolArray:
    """Return a mask over tracks: True where no other track belongs to the same fused track."""
    result = np.zeros(len(tracks), dtype=bool)
    member = np.flatnonzero(tracks.system > 0)
    if len(member):
        leader, of = leader_indices(tracks.take(member))
        result[member] = (np.bincount(of, minlength=len(leader)) == 1)[of]
    return result


def _assign_to_fused_tracks(
    rules: MatchRules,
    tracks: LocalTracks,
    free: IntArray,
    time_s: FloatArray,
    system: IntArray,
) -> None:
    """Write into `system` the fused track of each free track of one tracker, if near enough."""
    member = np.flatnonzero(tracks.system > 0)
    if len(member) == 0:
        return
    leader, of = leader_indices(tracks.take(member))
    tracker = tracks.tracker[free[0]]
    taken = np.bincount(of, weights=tracks.tracker[member] == tracker, minlength=len(leader)) > 0
    lead = member[leader[~taken]]
    begin = np.searchsorted(tracks.replica[lead], tracks.replica[free], side="left")
    many = np.searchsorted(tracks.replica[lead], tracks.replica[free], side="right") - begin
    candidate = np.repeat(np.arange(len(free)), many)
    start = np.cumsum(many) - many
    which = np.arange(len(candidate)) - np.repeat(start - begin, many)
    home = tracks.system[free[candidate]]
    older = (home == 0) | (tracks.system[lead[which]] < home)
    candidate, which = candidate[older], which[older]
    if len(candidate) == 0:
        return
    share = gate_distance_ratio(
        rules, tracks.take(lead[which]), tracks.take(free[candidate]), time_s[free[candidate]]
    )
    inside = share <= 1.0
    candidate, which, share = candidate[inside], which[inside], share[inside]
    won = least_total_pair_indices(which, candidate, share, 1.0)
    system[free[candidate[won]]] = tracks.system[lead[which[won]]]
