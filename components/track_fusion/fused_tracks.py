"""Fused tracks as they are told: what was told last, and the message of it."""

from collections.abc import Sequence

import numpy as np

from components.estimation.batched import product, product_transposed
from components.estimation.frame import SensorPose
from components.estimation.measurement import Kind, linearised
from components.messages.state_tracks import COVARIANCE, DELETED, StateTracks
from components.track_fusion.fused_states import FusedStates
from components.track_fusion.local_tracks import LocalTracks
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.message import offsets_of

_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_OWN = ("own_north_m", "own_east_m", "own_down_m")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")

#: Columns over fused tracks, the tracks on their last axis.
Told = dict[str, AnyArray]

_WHOLE = ("replica", "row", "track", "track_status", "contributors", "updated_by")
_NUMBERS = (
    "born_s", "existence", "azimuth_rad", "elevation_rad", "azimuth_variance_rad2",
    "elevation_variance_rad2", "age_s", "state_s", "updated_s",
)  # fmt: skip


def nothing_told() -> Told:
    """Return the columns of no track."""
    found: Told = {name: np.empty(0, dtype=np.int64) for name in _WHOLE}
    found |= {name: np.empty(0) for name in _NUMBERS}
    found |= {"state": np.empty((6, 0)), "covariance": np.empty((6, 6, 0))}
    found |= {"own": np.empty((3, 0)), "origin": np.empty((3, 0))}
    return {**found, "has_range": np.empty(0, dtype=bool)}


def taken(told: Told, which: AnyArray) -> Told:
    """Return some of the tracks."""
    return {name: values[..., which] for name, values in told.items()}


def joined(parts: Sequence[Told]) -> Told:
    """Return the tracks of all parts, one after the other."""
    return {n: np.concatenate([part[n] for part in parts], axis=-1) for n in parts[0]}


def told_after(
    before: Told,
    found: FusedStates,
    members: LocalTracks,
    origin_deg_m: FloatArray,
    own_m: FloatArray,
    replica: IntArray,
    row_of_replica: IntArray,
) -> Told:
    """Return what is told of fused tracks, and once of those that are no more."""
    row = row_of_replica[np.searchsorted(replica, found.replica)]
    count = len(found.replica)
    held = {
        key: place
        for place, key in enumerate(
            zip(before["replica"].tolist(), before["track"].tolist(), strict=True)
        )
    }
    keys = list(zip(found.replica.tolist(), found.number.tolist(), strict=True))
    old = np.array([held.get(key, -1) for key in keys], dtype=np.int64)
    known = old >= 0
    born_s, contributors = found.time_s.copy(), found.contributors.copy()
    born_s[known] = before["born_s"][old[known]]
    contributors[known] |= before["contributors"][old[known]]
    axes = np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2)
    seen, by_state = linearised(Kind(False), found.state, SensorPose(own_m, axes))
    spread = product_transposed(product(by_state, found.covariance[:3, :3]), by_state)
    newest = members.take(found.newest)
    azimuth, elevation = newest.direction()
    ranged = found.ranged
    new: Told = {
        "replica": found.replica,
        "row": row,
        "track": found.number,
        "track_status": found.status,
        "existence": found.existence,
        "born_s": born_s,
        "contributors": contributors,
        "updated_by": found.updated_by,
        "has_range": ranged,
        "state": np.where(ranged, found.state, np.nan),
        "covariance": np.where(ranged, found.covariance, np.nan),
        "azimuth_rad": np.where(ranged, seen[0], azimuth) % (2.0 * np.pi),
        "elevation_rad": np.where(ranged, seen[1], elevation),
        "azimuth_variance_rad2": np.where(ranged, spread[0, 0], newest.azimuth_variance_rad2),
        "elevation_variance_rad2": np.where(ranged, spread[1, 1], newest.elevation_variance_rad2),
        "own": np.where(ranged, own_m, newest.own_m),
        "origin": origin_deg_m,
        "state_s": np.where(ranged, found.time_s, newest.time_s),
        "updated_s": found.updated_s,
    }
    new["age_s"] = np.maximum(new["state_s"] - born_s, 0.0)
    alive = set(keys)
    ended = np.array([key not in alive for key in held], dtype=bool)
    if not ended.any():
        return new
    last = taken(before, ended)
    last["row"] = row_of_replica[np.searchsorted(replica, last["replica"])]
    last["track_status"] = np.full(int(ended.sum()), DELETED)
    return joined([last, new])


def state_tracks(
    told: Told, rows: IntArray, ticks: IntArray, sensors: tuple[str, ...]
) -> StateTracks:
    """Return the message of what is told at some rows."""
    order = np.lexsort((told["track"], told["row"]))
    told = taken(told, order)
    names = [name for name in (*_WHOLE, *_NUMBERS) if name not in ("replica", "row", "born_s")]
    return StateTracks(
        tick=ticks,
        offsets=offsets_of(np.searchsorted(rows, told["row"]), len(rows)),
        has_range=told["has_range"],
        covariance={name: told["covariance"][place] for place, name in COVARIANCE.items()},
        extras={},
        sensors=sensors,
        **{name: told[name] for name in names},
        **dict(zip(_STATE, told["state"], strict=True)),
        **dict(zip(_OWN, told["own"], strict=True)),
        **dict(zip(_ORIGIN, told["origin"], strict=True)),
    )
