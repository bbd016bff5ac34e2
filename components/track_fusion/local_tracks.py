"""The tracks of several trackers in one frame: what each reported last, and how that goes on."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from components.estimation.batched import times
from components.estimation.frame import SensorPose, frame_change
from components.estimation.motion import ConstantVelocity
from components.geometry import unit_vector_unchecked
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import DELETED, TENTATIVE, StateTracks, full_covariance
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Tracks of one tracker in a run are fewer than this.
_NUMBERS = 1 << 36


class LocalTracks(KeyedTable):
    """Tracks of several trackers, in the frame of the replica that they belong to.

    ``tracker`` is its index among all of the scene, ``number`` its own number of the track,
    ``system`` that of the fused track that it belongs to, 0 for none yet. ``state`` (6, n) and
    ``covariance`` (6, 6, n) of a track without a range are 0 and the identity. ``azimuth_rad`` and
    ``elevation_rad`` are the direction along the tracker's own axes, ``own_m`` (3, n) is where the
    ownship believed to be, and ``turn`` (3, 3, n) turns the axes into those of the frame; all this
    speaks of ``time_s``. ``contributors`` and ``updated_by`` are masks over all sensors;
    ``row`` is that of the wake with which it came.
    """

    @classmethod
    def without_tracks(cls) -> Self:
        """Return no tracks."""
        whole = ("replica", "tracker", "number", "system", "status", "contributors", "updated_by",
                 "row")  # fmt: skip
        numbers = (
            "existence", "azimuth_rad", "elevation_rad", "azimuth_variance_rad2",
            "elevation_variance_rad2", "time_s", "updated_s",
        )  # fmt: skip
        shapes = {"state": (6,), "covariance": (6, 6), "own_m": (3,), "turn": (3, 3)}
        floats = dict.fromkeys((*numbers, *shapes), float)
        return cls.empty({**dict.fromkeys(whole, int), **floats, "ranged": bool}, shapes)

    def key(self) -> IntArray:
        """Return a number for each that no other track bears, also later."""
        trackers = 64
        return (self.replica * trackers + self.tracker) * _NUMBERS + self.number

    def predict_to(
        self, time_s: FloatArray, motion: ConstantVelocity
    ) -> tuple[FloatArray, FloatArray]:
        """Return states and covariances at instants (n,) that are not before their own."""
        return motion.predict(self.state, self.covariance, time_s - self.time_s)

    def copy_systems(self, old: Self) -> Self:
        """Return the tracks with the fused tracks that they belonged to before."""
        if len(old) == 0 or len(self) == 0:
            return self
        known = old.key()
        order = np.argsort(known)
        mine = self.key()
        index = order[np.minimum(np.searchsorted(known[order], mine), len(known) - 1)]
        return self.with_columns(system=np.where(known[index] == mine, old.system[index], 0))

    def pose(self) -> SensorPose:
        """Return from where, and along which axes, each reports its direction."""
        return SensorPose(self.own_m, self.turn.swapaxes(0, 1))

    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Return azimuth and elevation along the frame's axes."""
        unit = np.stack(unit_vector_unchecked(self.azimuth_rad, self.elevation_rad))
        north, east, down = times(self.turn, unit)
        return np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))


def local_tracks(
    message: StateTracks,
    replica: IntArray,
    tracker: int,
    origin_deg_m: FloatArray,
    masks: Sequence[int],
    tentative: bool,
) -> tuple[LocalTracks, IntArray]:
    """Return the tracks of a message in the frames of their replicas, and the row of each."""
    row = message.row_of_entries
    kept = message.track_status != DELETED
    if not tentative:
        kept &= message.track_status != TENTATIVE
    which = np.flatnonzero(kept)
    row = row[which]

    def column(name: str) -> Any:
        return getattr(message, name)[which]

    ranged = column("has_range")
    state = np.stack([np.where(ranged, column(name), 0.0) for name in STATE])
    one = np.eye(6)[:, :, np.newaxis]
    covariance = np.where(ranged, full_covariance(message.covariance, which), one)
    change = frame_change(np.stack([column(name) for name in ORIGIN]), origin_deg_m[:, row])
    result = LocalTracks(
        replica=replica[row],
        tracker=np.full(len(which), tracker, dtype=np.int64),
        number=column("track"),
        system=np.zeros(len(which), dtype=np.int64),
        status=column("track_status"),
        existence=column("existence"),
        ranged=ranged,
        state=np.where(ranged, change.states(state), 0.0),
        covariance=change.covariances(covariance),
        azimuth_rad=column("azimuth_rad"),
        elevation_rad=column("elevation_rad"),
        azimuth_variance_rad2=column("azimuth_variance_rad2"),
        elevation_variance_rad2=column("elevation_variance_rad2"),
        own_m=change.positions(np.stack([column(name) for name in OWN_POSITION])),
        turn=change.turn,
        time_s=column("state_s"),
        updated_s=column("updated_s"),
        contributors=_map_sensor_masks(column("contributors"), masks),
        updated_by=_map_sensor_masks(column("updated_by"), masks),
    )
    return result, row


def _map_sensor_masks(mask: IntArray, masks: Sequence[int]) -> IntArray:
    """Return masks over a tracker's own sensors as masks over those of all."""
    result = np.zeros(len(mask), dtype=np.int64)
    for i, bit in enumerate(masks):
        result |= np.where(mask >> i & 1 == 1, np.int64(bit), 0)
    return result


def records_of(replicas: IntArray) -> KeyedTable:
    """Return what is kept of each run beside its tracks, before the first of them.

    ``origin`` (3, n) of its frame is latitude, longitude and height in deg and m, ``time_s`` the
    newest instant that any track spoke of, and ``own_m`` (3, n) where the ownship was at ``own_s``,
    the newest instant that a tracker on board spoke of (``own_on_board``), or else any.
    """
    count = len(replicas)
    return KeyedTable(
        replica=replicas,
        origin=np.full((3, count), np.nan),
        next_number=np.ones(count, dtype=np.int64),
        time_s=np.full(count, -np.inf),
        own_m=np.full((3, count), np.nan),
        own_s=np.full(count, -np.inf),
        own_on_board=np.zeros(count, dtype=bool),
    )


def update_newest(records: KeyedTable, new: LocalTracks, on_board: BoolArray) -> KeyedTable:
    """Return records that know the newest instant, and where the ownship is.

    `on_board` says of each tracker whether it is.
    """
    time_s, own_m, own_s = (getattr(records, n).copy() for n in ("time_s", "own_m", "own_s"))
    here = records.own_on_board.copy()
    order = np.lexsort((-new.tracker, new.time_s, on_board[new.tracker]))
    of, when = np.searchsorted(records.replica, new.replica[order]), new.time_s[order]
    np.maximum.at(time_s, of, when)
    mine = on_board[new.tracker[order]]
    here[of[mine]] = True
    counts = (mine | ~here[of]) & (
        when >= np.where(records.own_on_board[of] == mine, own_s[of], -np.inf)
    )
    own_m[:, of[counts]] = new.own_m[:, order][:, counts]
    own_s[of[counts]] = when[counts]
    return records.with_columns(time_s=time_s, own_m=own_m, own_s=own_s, own_on_board=here)
