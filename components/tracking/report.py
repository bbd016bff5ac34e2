"""The message of a tracker: its columns, made once for all looks of a wake."""

from collections.abc import Sequence

import numpy as np

from components.estimation.batched import selected
from components.estimation.estimator import combined
from components.estimation.frame import SensorPose
from components.estimation.measurement import direction, range_share
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import COVARIANCE, StateTracks
from components.tracking.management import existence
from components.tracking.track_store import TrackStore
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import offsets_of
from dsa_des.block.wake import Wake

#: By the size of a model's state: the column of its probability, and what it has besides.
_MODELS = {
    6: ("probability_velocity", ()),
    7: ("probability_turn", ("turn_rate_rad_s",)),
    9: ("probability_acceleration",
        ("acceleration_north_m_s2", "acceleration_east_m_s2", "acceleration_down_m_s2")),
}  # fmt: skip


def tracks_after(
    store: TrackStore, replica: IntArray, looks: IntArray, rows: IntArray
) -> TrackStore:
    """Return the tracks of some replicas (ascending) after their looks.

    Columns ``look`` and ``row`` are the last look that was worked on, and the row of the wake.
    """
    index = np.minimum(np.searchsorted(replica, store.replica), len(replica) - 1)
    mine = replica[index] == store.replica
    index = index[mine]
    return store.take(mine).with_columns(look=looks[index], row=rows[index])


def state_tracks(
    reported: Sequence[TrackStore],
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
    tracks = TrackStore.joined(reported)
    if bool((tracks.row[1:] < tracks.row[:-1]).any()):
        tracks = tracks.take(np.argsort(tracks.row, kind="stable"))
    state, covariance = combined(tracks.estimates())
    own, origin = selected(poses.position_m, tracks.look), selected(origin, tracks.look)
    away = state[:3] - own
    seen = direction(away, covariance)
    unknown = ~tracks.ranged
    if passive_range_share is not None:
        unknown &= range_share(away, covariance) > passive_range_share
    hidden = bool(unknown.any())

    def known(values: FloatArray) -> FloatArray:
        return np.where(unknown, np.nan, values) if hidden else values

    extras = {}
    states = tracks.states()
    for own_state, weight in zip(states, tracks.weights, strict=True) if len(states) > 1 else ():
        probability, names = _MODELS[len(own_state) - errors]
        extras[probability] = weight
        extras |= {n: known(x) for n, x in zip(names, own_state[6 + errors :], strict=True)}
    tick, per_s = tracks.tick, wake.ticks_per_s
    return StateTracks(
        tick=ticks,
        run=wake.run[rows],
        offsets=offsets_of(np.searchsorted(rows, tracks.row), len(ticks)),
        track=tracks.number,
        track_status=tracks.status,
        existence=existence(tracks.score),
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
