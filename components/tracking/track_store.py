"""Tracks of all replicas as columns, and the message that reports them."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from components.estimation.batched import is_everything, select_tracks
from components.estimation.estimator import Estimates, mixture_moments
from components.estimation.measurement import (
    azimuth_elevation_and_variances,
    relative_range_deviation,
)
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import COVARIANCE, DELETED, StateTracks
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Wake

#: Misdetections of a sensor that never hit a track.
NEVER = 1 << 40
# More than there are tracks in a run.
_NUMBERS = 1 << 32


class TrackStore(KeyedTable):
    """Table of tracks, one column per property, with tracks along the last axis.

    States are ``state0``, ``state1``, … (d, n), one for each motion model, covariances
    ``covariance0``, … (d, d, n); ``weights`` (models, n) says how likely each model is.
    ``misdetections`` (sensors, n) are those of each sensor since its last hit, from `NEVER` where
    it had none. ``seen`` (3, sensors, n) is where the track was expected, azimuth, elevation and
    range, when each sensor last updated it, and ``seen_tick`` (sensors, n) when that was; NaN and
    -1 where it did not, or where all its errors are new at every look. ``counted_tick`` (sensors,
    n) is when each sensor last hit it or was last counted as missing it. ``own_m_s`` (3, n) is how
    the ownship moved at the last detection, where that had a coarse bearing: then what is known of
    the target lies on an arc; else NaN.
    """

    #: Columns beside states, with their types.
    PLAIN = {
        "replica": np.int64,
        "number": np.int64,
        "tick": np.int64,  # that the state speaks of
        "born_tick": np.int64,
        "updated_tick": np.int64,
        # How long it lives without a detection, and how uncertain its position (m²) was, both as of
        # the last one.
        "life_ticks": np.int64,
        "updated_m2": np.float64,
        "history": np.int64,  # a bit for each expected look, 1 for a hit; the last look lowest
        "looks": np.int64,
        "misses": np.int64,  # misdetections since the last hit
        "status": np.int64,
        "score": np.float64,  # logarithm of the odds that there is something
        "contributors": np.int64,
        "updated_by": np.int64,
        "ranged": np.bool_,
        # Normalised innovations squared of the looks at `tick`, and of how many quantities they
        # are; both 0 where none updated the track with one detection.
        "nis": np.float64,
        "freedom": np.int64,
    }

    @classmethod
    def empty_of_models(cls, sizes: Sequence[int], sensors: int) -> Self:
        """Return an empty table for models with these state sizes and this number of sensors."""
        types: dict[str, type] = {
            **cls.PLAIN,
            "weights": float,
            "misdetections": np.int64,
            "seen": float,
        }
        types |= {"seen_tick": np.int64, "counted_tick": np.int64, "own_m_s": float}
        shapes: dict[str, tuple[int, ...]] = {"weights": (len(sizes),), "misdetections": (sensors,)}
        shapes |= {"seen": (3, sensors), "seen_tick": (sensors,)}
        shapes |= {"counted_tick": (sensors,), "own_m_s": (3,)}
        for i, size in enumerate(sizes):
            types |= {f"state{i}": float, f"covariance{i}": float}
            shapes |= {f"state{i}": (size,), f"covariance{i}": (size, size)}
        return cls.empty(types, shapes)

    @property
    def unique_numbers(self) -> IntArray:
        """Integer identifying each track among all runs; ascending in the table's order."""
        return np.asarray(self.replica * _NUMBERS + self.number)

    def sorted_by_key(self) -> Self:
        """Return the tracks sorted by run and then by number."""
        return self.take(np.lexsort((self.number, self.replica)))

    def append_deleted(self, before: Self) -> Self:
        """Return these tracks and those of `before` that no longer exist, the latter as deleted."""
        gone = before.take(~np.isin(before.unique_numbers, self.unique_numbers))
        if len(gone) == 0:
            return self
        ended = gone.with_columns(status=np.full(len(gone), DELETED))
        return self.concatenate([self, ended]).sorted_by_key()

    def estimates(self) -> Estimates:
        """Return states, covariances and model probabilities of all tracks."""
        return Estimates(self.states_by_model(), self.covariances_by_model(), self.weights)

    def replace_estimates(self, estimates: Estimates, **columns: Any) -> Self:
        """Return the tracks with new states, covariances, model probabilities, named columns."""
        return self.with_columns(**estimate_columns(estimates), **columns)

    def replace_columns(self, which: IntArray, new: dict[str, Any]) -> Self:
        """Return the tracks with new values in some columns for the tracks `which`."""
        if is_everything(which, len(self)):
            return self.with_columns(**new)
        changed = {}
        for name, values in new.items():
            whole = self.columns[name].copy()
            whole[..., which] = values
            changed[name] = whole
        return self.with_columns(**changed)

    def states_by_model(self) -> list[AnyArray]:
        """Return the states of all tracks, an array (size, tracks) for each motion model."""
        return [self.columns[f"state{i}"] for i in range(len(self.weights))]

    def covariances_by_model(self) -> list[AnyArray]:
        """Return all tracks' covariances, (size, size, tracks) for each motion model."""
        return [self.columns[f"covariance{i}"] for i in range(len(self.weights))]


def estimate_columns(estimates: Estimates) -> dict[str, AnyArray]:
    """Return states, covariances and model probabilities as columns of a track store, by name."""
    columns = {f"state{i}": x for i, x in enumerate(estimates.states)}
    columns |= {f"covariance{i}": p for i, p in enumerate(estimates.covariances)}
    return columns | {"weights": estimates.weights}


def initial_records(replica: IntArray, position_deg_m: FloatArray) -> KeyedTable:
    """Return a record per run, its frame's origin at the ownship's position at the first look.

    ``own`` is where the ownship was at the last one, in the frame with that ``origin``, and
    ``worked_tick`` is when that came.
    """
    replicas, first = np.unique(replica, return_index=True)
    return KeyedTable(
        replica=replicas,
        next_number=np.ones(len(replicas), dtype=np.int64),
        tick=np.full(len(replicas), np.iinfo(np.int64).min),
        origin=position_deg_m[:, first],
        own=np.zeros((3, len(replicas))),
        worked_tick=np.zeros(len(replicas), dtype=np.int64),
    )


#: By the size of a model's state: the column of its probability, and what it has besides.
_MODELS = {
    6: ("probability_velocity", ()),
    7: ("probability_turn", ("turn_rate_rad_s",)),
    9: ("probability_acceleration",
        ("acceleration_north_m_s2", "acceleration_east_m_s2", "acceleration_down_m_s2")),
}  # fmt: skip


def tracks_to_report(store: TrackStore, records: KeyedTable, rows: IntArray) -> TrackStore:
    """Return the tracks of some replicas with the row, ownship position and origin to report.

    ``row`` is the row of the wake of each replica's report, as given; ``own`` and ``origin`` are
    where the ownship was, as the records of these replicas have it.
    """
    index = np.minimum(records.replica.searchsorted(store.replica), len(rows) - 1)
    mine = records.replica[index] == store.replica
    index = index[mine]
    return store.take(mine).with_columns(
        row=rows[index],
        own=select_tracks(records.own, index),
        origin=select_tracks(records.origin, index),
    )


#: Columns that no message shows.
_UNSHOWN = {
    "history", "looks", "misses", "misdetections", "seen", "seen_tick", "counted_tick",
    "life_ticks", "updated_m2", "own_m_s",
}  # fmt: skip


def _store_by_row(reported: Sequence[TrackStore]) -> TrackStore:
    """Return all reported tracks in one table sorted by row of the wake."""
    parts = [part.columns for part in reported]
    row = np.concatenate([part["row"] for part in parts])
    if not bool((row[1:] < row[:-1]).any()):
        return TrackStore.concatenate(reported)
    order = np.argsort(row, kind="stable")
    columns = {}
    for name in parts[0].keys() - _UNSHOWN:
        first = parts[0][name]
        columns[name] = whole = np.empty((*first.shape[:-1], len(order)), first.dtype)
        for i in np.ndindex(first.shape[:-1]):
            joined = np.concatenate([part[name][i] for part in parts])
            joined.take(order, out=whole[i], mode="clip")  # "clip" needs no buffer
    return TrackStore(**columns)


def state_tracks_message(
    reported: Sequence[TrackStore],
    rows: IntArray,
    wake: Wake,
    sensors: tuple[str, ...],
    passive_range_share: float | None = None,
    errors: int = 0,
) -> StateTracks:
    """Return the message of these tracks; `errors` is how many sensor errors a state carries."""
    ticks = wake.ticks[rows]
    if not reported:
        empty = StateTracks.make_initial({}).with_runs(wake.run[rows])
        empty.tick, empty.offsets = ticks, np.zeros(len(ticks) + 1, dtype=np.int64)
        empty.sensors = sensors
        return empty
    tracks = _store_by_row(reported)
    state, covariance = mixture_moments(tracks.estimates())
    own, origin = tracks.own, tracks.origin
    away = state[:3] - own
    seen = azimuth_elevation_and_variances(away, covariance)
    unknown = ~tracks.ranged
    if passive_range_share is not None:
        unknown &= relative_range_deviation(away, covariance) > passive_range_share
    hidden = bool(unknown.any())

    def known(values: FloatArray) -> FloatArray:
        return np.where(unknown, np.nan, values) if hidden else values

    extras = {}
    states = tracks.states_by_model()
    for own_state, weight in zip(states, tracks.weights, strict=True) if len(states) > 1 else ():
        probability, names = _MODELS[len(own_state) - errors]
        extras[probability] = weight
        extras |= {n: known(x) for n, x in zip(names, own_state[6 + errors :], strict=True)}
    tick, per_s = tracks.tick, wake.ticks_per_s
    return StateTracks(
        tick=ticks,
        run=wake.run[rows],
        offsets=offsets_from_entry_rows(np.searchsorted(rows, tracks.row), len(ticks)),
        track=tracks.number,
        track_status=tracks.status,
        existence=1.0 / (1.0 + np.exp(-tracks.score)),
        azimuth_rad=seen[0] % (2.0 * np.pi),
        elevation_rad=seen[1],
        azimuth_variance_rad2=seen[2],
        elevation_variance_rad2=seen[3],
        has_range=~unknown,
        age_s=(tick - tracks.born_tick) / per_s,
        state_s=tick / per_s,
        updated_s=tracks.updated_tick / per_s,
        contributors=tracks.contributors,
        updated_by=tracks.updated_by,
        covariance={name: known(covariance[element]) for element, name in COVARIANCE.items()},
        extras=extras,
        sensors=sensors,
        nis=np.where(tracks.freedom > 0, tracks.nis, np.nan),
        nis_freedom=tracks.freedom,
        **{name: known(values) for name, values in zip(STATE, state, strict=True)},
        **dict(zip((*OWN_POSITION, *ORIGIN), (*own, *origin), strict=True)),
    )  # fmt: skip
