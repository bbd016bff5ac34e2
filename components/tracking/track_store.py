"""Tracks of all replicas as columns."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from components.estimation.batched import is_everything
from components.estimation.estimator import Estimates
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray

#: Misdetections of a sensor that never hit a track.
NEVER = 1 << 40


class TrackStore(KeyedTable):
    """Columns over tracks, the tracks on their last axis.

    States are ``state0``, ``state1``, … (d, n), one for each motion model, covariances
    ``covariance0``, … (d, d, n); ``weights`` (models, n) says how likely each model is.
    ``misdetections`` (sensors, n) are those of each sensor since its last hit, from `NEVER` where
    it had none. ``seen`` (3, sensors, n) is where the track was expected, azimuth, elevation and
    range, when each sensor last updated it, and ``seen_tick`` (sensors, n) when that was; NaN and
    -1 where none did.
    """

    #: Columns beside states, with their types.
    PLAIN = {
        "replica": np.int64,
        "number": np.int64,
        "tick": np.int64,  # that the state speaks of
        "born_tick": np.int64,
        "updated_tick": np.int64,
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
    def of_models(cls, sizes: Sequence[int], sensors: int) -> Self:
        """Return a store without tracks for models with states of these sizes."""
        types: dict[str, type] = {
            **cls.PLAIN,
            "weights": float,
            "misdetections": np.int64,
            "seen": float,
        }
        types["seen_tick"] = np.int64
        shapes: dict[str, tuple[int, ...]] = {"weights": (len(sizes),), "misdetections": (sensors,)}
        shapes |= {"seen": (3, sensors), "seen_tick": (sensors,)}
        for i, size in enumerate(sizes):
            types |= {f"state{i}": float, f"covariance{i}": float}
            shapes |= {f"state{i}": (size,), f"covariance{i}": (size, size)}
        return cls.empty(types, shapes)

    def estimates(self) -> Estimates:
        """Return what the filter knows of the tracks."""
        return Estimates(self.states(), self.covariances(), self.weights)

    def with_estimates(self, estimates: Estimates, **columns: Any) -> Self:
        """Return the same tracks with other estimates, and other values in some columns."""
        return self.with_columns(**estimate_columns(estimates), **columns)

    def put(self, which: IntArray, new: dict[str, Any]) -> Self:
        """Return tracks with other values in some columns of some of them."""
        if is_everything(which, len(self)):
            return self.with_columns(**new)
        changed = {}
        for name, values in new.items():
            whole = self.columns[name].copy()
            whole[..., which] = values
            changed[name] = whole
        return self.with_columns(**changed)

    def states(self) -> list[AnyArray]:
        """Return the states of every model."""
        return [self.columns[f"state{i}"] for i in range(len(self.weights))]

    def covariances(self) -> list[AnyArray]:
        """Return the covariances of every model."""
        return [self.columns[f"covariance{i}"] for i in range(len(self.weights))]


def estimate_columns(estimates: Estimates) -> dict[str, AnyArray]:
    """Return estimates as columns of a store."""
    columns = {f"state{i}": x for i, x in enumerate(estimates.states)}
    columns |= {f"covariance{i}": p for i, p in enumerate(estimates.covariances)}
    return columns | {"weights": estimates.weights}


def records_of(replica: IntArray, position_deg_m: FloatArray) -> KeyedTable:
    """Return what is kept of each run beside its tracks, where it starts at its first look."""
    replicas, first = np.unique(replica, return_index=True)
    return KeyedTable(
        replica=replicas,
        next_number=np.ones(len(replicas), dtype=np.int64),
        tick=np.full(len(replicas), np.iinfo(np.int64).min),
        origin=position_deg_m[:, first],
    )
