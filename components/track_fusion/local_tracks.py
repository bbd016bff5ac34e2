"""The tracks of several trackers in one frame: what each reported last, and how that goes on."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from components.estimation.batched import matrix_times_vector
from components.estimation.frame import SensorPose, frame_change
from components.estimation.motion import ConstantVelocity
from components.geometry import unit_vector_unchecked
from components.messages.columns import ORIGIN, OWN_POSITION, STATE
from components.messages.state_tracks import DELETED, TENTATIVE, StateTracks, covariance_matrices
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
    def empty_table(cls) -> Self:
        """Return a table of local tracks with no row."""
        whole = ("replica", "tracker", "number", "system", "status", "contributors", "updated_by",
                 "row")  # fmt: skip
        numbers = (
            "existence", "azimuth_rad", "elevation_rad", "azimuth_variance_rad2",
            "elevation_variance_rad2", "time_s", "updated_s",
        )  # fmt: skip
        shapes = {"state": (6,), "covariance": (6, 6), "own_m": (3,), "turn": (3, 3)}
        floats = dict.fromkeys((*numbers, *shapes), float)
        return cls.empty({**dict.fromkeys(whole, int), **floats, "ranged": bool}, shapes)

    def unique_numbers(self) -> IntArray:
        """Return an integer per track that identifies it among all runs, trackers and times."""
        trackers = 64
        return (self.replica * trackers + self.tracker) * _NUMBERS + self.number

    def states_and_covariances_at(
        self, time_s: FloatArray, motion: ConstantVelocity
    ) -> tuple[FloatArray, FloatArray]:
        """Return states (6, n), covariances (6, 6, n) at times (s) not before the tracks' own."""
        return motion.predict(self.state, self.covariance, time_s - self.time_s)

    def with_fused_numbers_from(self, old: Self) -> Self:
        """Return these tracks with the fused track numbers that they have in `old`, 0 if none."""
        if len(old) == 0 or len(self) == 0:
            return self
        known = old.unique_numbers()
        order = np.argsort(known)
        mine = self.unique_numbers()
        index = order[np.minimum(np.searchsorted(known[order], mine), len(known) - 1)]
        return self.with_columns(system=np.where(known[index] == mine, old.system[index], 0))

    def pose(self) -> SensorPose:
        """Return position and axes of the sensors that the tracks' directions are measured from."""
        return SensorPose(self.own_m, self.turn.swapaxes(0, 1))

    def azimuth_elevation_in_frame_rad(self) -> tuple[FloatArray, FloatArray]:
        """Return azimuth from north and elevation (rad) of tracks' directions in replica frames."""
        unit = np.stack(unit_vector_unchecked(self.azimuth_rad, self.elevation_rad))
        north, east, down = matrix_times_vector(self.turn, unit)
        return np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))


def local_tracks_and_rows(
    message: StateTracks,
    replica: IntArray,
    tracker: int,
    origin_deg_m: FloatArray,
    masks: Sequence[int],
    tentative: bool,
) -> tuple[LocalTracks, IntArray]:
    """Return a message's live tracks, in their replicas' frames, and each one's message row."""
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
    covariance = np.where(ranged, covariance_matrices(message.covariance, which), one)
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
    """Return bit masks over all sensors, given bit masks over one tracker's own sensors."""
    result = np.zeros(len(mask), dtype=np.int64)
    for i, bit in enumerate(masks):
        result |= np.where(mask >> i & 1 == 1, np.int64(bit), 0)
    return result


def initial_records(replicas: IntArray) -> KeyedTable:
    """Return a table with one initial record per run: frame origin, next track number, newest
    instant and ownship position.

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


def records_with_newest_instants(
    records: KeyedTable, new: LocalTracks, on_board: BoolArray
) -> KeyedTable:
    """Return records with each replica's newest instant and ownship position from new tracks.

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
