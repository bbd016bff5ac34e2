"""Fused tracks: their states, from those of their members, and the message that reports them."""

import numpy as np

from components.estimation.batched import matrix_product, matrix_times_vector, multiply_by_transpose
from components.estimation.covariance_intersection import Rule, intersect_covariances, inverse
from components.estimation.frame import SensorPose
from components.estimation.measurement import Kind, linearise
from components.estimation.motion import ConstantVelocity
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import (
    COASTED,
    CONFIRMED,
    COVARIANCE,
    DELETED,
    TENTATIVE,
    StateTracks,
)
from components.track_fusion.local_tracks import LocalTracks
from components.track_fusion.track_association import leader_indices, linearised_direction
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import RunTicks, positions_with_found_mask
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import offsets_from_entry_rows


def fuse_states(
    tracks: LocalTracks, time_s: FloatArray, motion: ConstantVelocity, rule: Rule
) -> KeyedTable:
    """Return a table of fused tracks (state, covariance, status), one per replica and number.

    ``existence`` is the largest of any member: as much is sure whatever they have in common.
    ``newest`` is the index of the member that gives the direction where there is no range; there
    ``state`` (6, n) and ``covariance`` mean nothing.
    Members with a range come first, then those without, each group by tracker; each is combined
    with what those before it gave.
    """
    leader, of = leader_indices(tracks)
    count = len(leader)
    rank = _ranks_in_fused_track(tracks, of)
    state, covariance = tracks.states_and_covariances_at(time_s, motion)
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
                pull = matrix_times_vector(information, state[:, mine] - x[:, into])
            else:
                angles = linearised_direction(tracks.take(mine), x[:, into], time_s[mine])
                weighed = angles.jacobian.swapaxes(0, 1) / angles.variance
                information = matrix_product(weighed, angles.jacobian)
                pull = matrix_times_vector(weighed, angles.residual)
            shift, result, _ = intersect_covariances(p[:, :, into], information, pull, rule)
            x[:, into] += shift
            p[:, :, into] = result
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
    return KeyedTable(
        replica=tracks.replica[leader],
        track=tracks.system[leader],
        track_status=status,
        existence=existence,
        has_range=tracks.ranged[leader],
        state=x,
        covariance=p,
        newest=_newest_member(tracks, of, count),
        state_s=time_s[leader],
        updated_s=updated_s,
        updated_by=updated_by,
        contributors=contributors,
    )


def _ranks_in_fused_track(tracks: LocalTracks, of: IntArray) -> IntArray:
    """Return each track's position in its fused track: with a range first, then by tracker."""
    order = np.lexsort((tracks.tracker, ~tracks.ranged, of))
    counts = np.bincount(of)
    rank = np.empty(len(of), dtype=np.int64)
    rank[order] = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    return rank


def _newest_member(tracks: LocalTracks, of: IntArray, count: int) -> IntArray:
    order = np.lexsort((-tracks.tracker, tracks.time_s, of))
    return order[np.cumsum(np.bincount(of, minlength=count)) - 1]


_WHOLE = ("replica", "row", "track", "track_status", "contributors", "updated_by")
_NUMBERS = (
    "born_s", "existence", "azimuth_rad", "elevation_rad", "azimuth_variance_rad2",
    "elevation_variance_rad2", "age_s", "state_s", "updated_s",
)  # fmt: skip


def empty_fused_tracks() -> KeyedTable:
    """Return a table of fused tracks with no row."""
    shapes = {"state": (6,), "covariance": (6, 6), "own": (3,), "origin": (3,)}
    floats = dict.fromkeys((*_NUMBERS, *shapes), float)
    return KeyedTable.empty({**dict.fromkeys(_WHOLE, int), **floats, "has_range": bool}, shapes)


def fused_tracks_to_report(
    before: KeyedTable,
    fused: KeyedTable,
    members: LocalTracks,
    origin_deg_m: FloatArray,
    own_m: FloatArray,
    replica: IntArray,
    row_of_replica: IntArray,
) -> KeyedTable:
    """Return fused tracks to report: current ones, and reported ones ended since, as deleted."""
    count, ranged = len(fused), fused.has_range
    keys, old_keys = (RunTicks(one.replica, one.track) for one in (fused, before))
    old, known = positions_with_found_mask(old_keys, keys)
    known = np.ones(count, dtype=bool) if known is None else known
    born_s, contributors = fused.state_s.copy(), fused.contributors.copy()
    born_s[known] = before.born_s[old[known]]
    contributors[known] |= before.contributors[old[known]]
    axes = np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2)
    seen, by_state = linearise(Kind(False), fused.state, SensorPose(own_m, axes))
    spread = multiply_by_transpose(matrix_product(by_state, fused.covariance[:3, :3]), by_state)
    newest = members.take(fused.newest)
    azimuth, elevation = newest.azimuth_elevation_in_frame_rad()
    state_s = np.where(ranged, fused.state_s, newest.time_s)
    columns = {name: fused.columns[name] for name in fused.columns if name != "newest"}
    new = KeyedTable(**columns).with_columns(
        row=row_of_replica[np.searchsorted(replica, fused.replica)],
        born_s=born_s,
        contributors=contributors,
        state=np.where(ranged, fused.state, np.nan),
        covariance=np.where(ranged, fused.covariance, np.nan),
        azimuth_rad=np.where(ranged, seen[0], azimuth) % (2.0 * np.pi),
        elevation_rad=np.where(ranged, seen[1], elevation),
        azimuth_variance_rad2=np.where(ranged, spread[0, 0], newest.azimuth_variance_rad2),
        elevation_variance_rad2=np.where(ranged, spread[1, 1], newest.elevation_variance_rad2),
        own=np.where(ranged, own_m, newest.own_m),
        origin=origin_deg_m,
        state_s=state_s,
        age_s=np.maximum(state_s - born_s, 0.0),
    )
    _, goes_on = positions_with_found_mask(keys, old_keys)
    if goes_on is None or len(before) == 0:
        return new
    last = before.take(~goes_on)
    last = last.with_columns(
        row=row_of_replica[np.searchsorted(replica, last.replica)],
        track_status=np.full(len(last), DELETED),
    )
    return KeyedTable.concatenate([last, new])


def state_tracks_message(
    reported: KeyedTable, rows: IntArray, instants: RunTicks, sensors: tuple[str, ...]
) -> StateTracks:
    """Return the message that reports the fused tracks at the given rows."""
    order = np.lexsort((reported.track, reported.row))
    reported = reported.take(order)
    names = [name for name in (*_WHOLE, *_NUMBERS) if name not in ("replica", "row", "born_s")]
    return StateTracks(
        tick=instants.tick,
        run=instants.run,
        offsets=offsets_from_entry_rows(np.searchsorted(rows, reported.row), len(rows)),
        has_range=reported.has_range,
        covariance={name: reported.covariance[index] for index, name in COVARIANCE.items()},
        extras={},
        sensors=sensors,
        **{name: reported.columns[name] for name in names},
        **dict(zip(STATE, reported.state, strict=True)),
        **dict(zip(OWN_POSITION, reported.own, strict=True)),
        **dict(zip(ORIGIN, reported.origin, strict=True)),
    )
