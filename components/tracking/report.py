"""The message of a tracker: its columns, made once for all looks of a wake."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.estimation.batched import selected
from components.estimation.estimator import Estimates, combined
from components.estimation.frame import SensorPose
from components.estimation.measurement import direction, range_share
from components.messages.columns import STATE
from components.messages.state_tracks import COVARIANCE, StateTracks
from components.tracking.management import existence
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import offsets_of
from dsa_des.block.wake import Wake

_ACCELERATIONS = (
    "acceleration_north_m_s2", "acceleration_east_m_s2", "acceleration_down_m_s2",
)  # fmt: skip
#: Column of a model's probability, by the size of its state.
_PROBABILITIES = {
    6: "probability_velocity", 7: "probability_turn", 9: "probability_acceleration",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Reported:
    """Tracks as they are reported after a look."""

    store: TrackStore
    look: IntArray  # (tracks,), the last that was worked on
    row: IntArray  # (tracks,), row of the wake at which it is reported

    @classmethod
    def of(
        cls, store: TrackStore, replica: IntArray, looks: IntArray, rows: IntArray
    ) -> "Reported":
        """Return the tracks of some replicas (ascending) after their looks."""
        index = np.minimum(np.searchsorted(replica, store.replica), len(replica) - 1)
        mine = replica[index] == store.replica
        return cls(store.take(mine), looks[index[mine]], rows[index[mine]])


def state_tracks(
    reported: Sequence[Reported],
    poses: SensorPose,
    origin: FloatArray,
    rows: IntArray,
    wake: Wake,
    sensors: tuple[str, ...],
    passive_range_share: float | None = None,
    errors: int = 0,
) -> StateTracks:
    """Return the message of what is reported, of states that carry so many errors."""
    ticks = wake.ticks[rows]
    if not reported:
        empty = StateTracks.initial({}).of_runs(wake.run[rows])
        empty.tick, empty.offsets = ticks, np.zeros(len(ticks) + 1, dtype=np.int64)
        empty.sensors = sensors
        return empty
    look = np.concatenate([part.look for part in reported])
    row = np.concatenate([part.row for part in reported])
    order = np.argsort(row, kind="stable")
    look, row = look[order], row[order]
    store = _Columns(reported, order)
    models = len(reported[0].store.weights)
    state, covariance = store.state(models)
    own, origin = selected(poses.position_m, look), selected(origin, look)
    seen = direction(state[:3] - own, covariance)
    unknown = ~store.plain("ranged")
    if passive_range_share is not None:
        unknown &= range_share(state[:3] - own, covariance) > passive_range_share
    hidden = bool(unknown.any())

    def known(values: FloatArray) -> FloatArray:
        return np.where(unknown, np.nan, values) if hidden else values

    tick, score = store.plain("tick"), store.plain("score")
    per_s = wake.ticks_per_s
    freedom = store.plain("freedom")
    return StateTracks(
        tick=ticks,
        run=wake.run[rows],
        offsets=offsets_of(np.searchsorted(rows, row), len(ticks)),
        track=store.plain("number"),
        track_status=store.plain("status"),
        existence=existence(score),
        azimuth_rad=seen[0] % (2.0 * np.pi),
        elevation_rad=seen[1],
        azimuth_variance_rad2=seen[2],
        elevation_variance_rad2=seen[3],
        has_range=~unknown,
        age_s=(tick - store.plain("born_tick")) / per_s,
        state_s=tick / per_s,
        updated_s=store.plain("updated_tick") / per_s,
        contributors=store.plain("contributors"),
        updated_by=store.plain("updated_by"),
        own_north_m=own[0],
        own_east_m=own[1],
        own_down_m=own[2],
        origin_lat_deg=origin[0],
        origin_lon_deg=origin[1],
        origin_alt_m=origin[2],
        covariance={name: known(covariance[place]) for place, name in COVARIANCE.items()},
        extras={} if models == 1 else store.extras(models, known, errors),
        sensors=sensors,
        nis=np.where(freedom > 0, store.plain("nis"), np.nan),
        nis_freedom=freedom,
        **{name: known(state[i]) for i, name in enumerate(STATE)},
    )  # fmt: skip


class _Columns:
    """Tracks that were reported look by look, as columns in the order of the message."""

    def __init__(self, reported: Sequence[Reported], order: IntArray) -> None:
        self._parts = [part.store.columns for part in reported]
        self._order = order

    def plain(self, name: str) -> Any:
        """Return a column."""
        return np.concatenate([part[name] for part in self._parts]).take(self._order)

    def element(self, name: str, *place: int) -> FloatArray:
        """Return one component of a vector, or one element of a matrix."""
        return np.concatenate([part[name][place] for part in self._parts]).take(self._order)

    def state(self, models: int) -> tuple[FloatArray, dict[tuple[int, int], FloatArray]]:
        """Return position and velocity, and their covariance by its elements, over all models."""
        states, covariances = [], []
        for m in range(models):
            state = np.empty((6, len(self._order)))
            for i in range(6):
                state[i] = self.element(f"state{m}", i)
            states.append(state)
            covariances.append({k: self.element(f"covariance{m}", *k) for k in COVARIANCE})
        if models == 1:
            return states[0], covariances[0]
        weights = np.stack([self.element("weights", m) for m in range(models)])
        whole = [
            np.stack([np.stack([one[min(i, j), max(i, j)] for j in range(6)]) for i in range(6)])
            for one in covariances
        ]
        state, covariance = combined(Estimates(states, whole, weights))
        return state, {place: covariance[place] for place in COVARIANCE}

    def extras(
        self, models: int, known: Callable[[FloatArray], FloatArray], errors: int
    ) -> dict[str, FloatArray]:
        """Return what models have besides position, velocity and errors."""
        found = {}
        for m in range(models):
            size = len(self._parts[0][f"state{m}"]) - errors
            found[_PROBABILITIES[size]] = self.element("weights", m)
            if size == 7:
                found["turn_rate_rad_s"] = known(self.element(f"state{m}", 6 + errors))
            elif size == 9:
                for i, name in enumerate(_ACCELERATIONS):
                    found[name] = known(self.element(f"state{m}", 6 + errors + i))
        return found
