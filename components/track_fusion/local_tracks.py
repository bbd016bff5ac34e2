"""The tracks of several trackers in one frame: what each reported last, and how that goes on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from components.estimation.batched import times
from components.estimation.frame import SensorPose, frame_change
from components.estimation.motion import ConstantVelocity
from components.messages.state_tracks import COVARIANCE, DELETED, TENTATIVE, StateTracks
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_OWN = ("own_north_m", "own_east_m", "own_down_m")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")
#: Tracks of one tracker in a run are fewer than this.
_NUMBERS = 1 << 36


@dataclass(frozen=True, eq=False)
class LocalTracks:
    """Tracks of several trackers, in the frame of the replica that they belong to."""

    # (n,) of int, the tracker by its place among all of the scene, and its own number of the
    # track
    replica: IntArray
    # (n,) of int, the tracker by its place among all of the scene, and its own number of the
    # track
    tracker: IntArray
    # (n,) of int, the tracker by its place among all of the scene, and its own number of the
    # track
    number: IntArray
    system: IntArray  # (n,) of int, number of the fused track that it belongs to; 0 for none yet
    status: IntArray
    existence: FloatArray
    ranged: BoolArray
    state: FloatArray  # (6, n), (6, 6, n): Of a track without a range 0 and the identity
    covariance: FloatArray  # (6, n), (6, 6, n): Of a track without a range 0 and the identity
    azimuth_rad: FloatArray  # (n,), direction along the tracker's own axes, and its variances
    elevation_rad: FloatArray  # (n,), direction along the tracker's own axes, and its variances
    azimuth_variance_rad2: FloatArray
    elevation_variance_rad2: FloatArray
    own_m: FloatArray  # (3, n), where the ownship believed to be then
    turn: FloatArray  # (3, 3, n), turns the tracker's axes into those of the frame
    time_s: FloatArray  # (n,), the instant that all this speaks of
    updated_s: FloatArray
    contributors: IntArray  # (n,) of int, masks over all sensors
    updated_by: IntArray  # (n,) of int, masks over all sensors

    def __len__(self) -> int:
        return len(self.replica)

    def take(self, which: AnyArray) -> Self:
        """Return some of them."""
        return type(self)(**{f.name: getattr(self, f.name)[..., which] for f in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return those of all parts, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            **{
                f.name: np.concatenate([getattr(part, f.name) for part in parts], axis=-1)
                for f in fields(cls)
            }
        )

    @classmethod
    def none(cls) -> Self:
        """Return no tracks."""
        shapes: Mapping[str, tuple[int, ...]] = {
            "state": (6, 0), "covariance": (6, 6, 0), "own_m": (3, 0), "turn": (3, 3, 0),
        }  # fmt: skip
        whole = ("replica", "tracker", "number", "system", "status", "contributors", "updated_by")
        types = {**dict.fromkeys(whole, np.int64), "ranged": np.bool_}
        return cls(
            **{
                f.name: np.empty(shapes.get(f.name, (0,)), types.get(f.name, np.float64))
                for f in fields(cls)
            }
        )

    def key(self) -> IntArray:
        """Return a number for each that no other track bears, also later."""
        trackers = 64
        return (self.replica * trackers + self.tracker) * _NUMBERS + self.number

    def at(self, time_s: FloatArray, motion: ConstantVelocity) -> tuple[FloatArray, FloatArray]:
        """Return states and covariances at instants (n,) that are not before their own."""
        return motion.predict(self.state, self.covariance, time_s - self.time_s)

    def with_systems_of(self, old: Self) -> Self:
        """Return them with the fused tracks that they belonged to before."""
        if len(old) == 0 or len(self) == 0:
            return self
        known = old.key()
        order = np.argsort(known)
        mine = self.key()
        place = order[np.minimum(np.searchsorted(known[order], mine), len(known) - 1)]
        return replace(self, system=np.where(known[place] == mine, old.system[place], 0))

    def place(self) -> SensorPose:
        """Return from where, and along which axes, each reports its direction."""
        return SensorPose(self.own_m, self.turn.swapaxes(0, 1))

    def direction(self) -> tuple[FloatArray, FloatArray]:
        """Return azimuth and elevation along the frame's axes."""
        level = np.cos(self.elevation_rad)
        unit = np.stack(
            [level * np.cos(self.azimuth_rad), level * np.sin(self.azimuth_rad),
             -np.sin(self.elevation_rad)]
        )  # fmt: skip
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
    row = np.repeat(np.arange(len(message)), np.diff(message.offsets))
    kept = message.track_status != DELETED
    if not tentative:
        kept &= message.track_status != TENTATIVE
    which = np.flatnonzero(kept)
    row = row[which]

    def column(name: str) -> Any:
        return getattr(message, name)[which]

    ranged = column("has_range")
    state = np.stack([np.where(ranged, column(name), 0.0) for name in _STATE])
    covariance = np.empty((6, 6, len(which)))
    for (i, j), name in COVARIANCE.items():
        value = np.where(ranged, message.covariance[name][which], float(i == j))
        covariance[i, j] = covariance[j, i] = value
    change = frame_change(np.stack([column(name) for name in _ORIGIN]), origin_deg_m[:, row])
    found = LocalTracks(
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
        own_m=change.positions(np.stack([column(name) for name in _OWN])),
        turn=change.turn,
        time_s=column("state_s"),
        updated_s=column("updated_s"),
        contributors=_among_all(column("contributors"), masks),
        updated_by=_among_all(column("updated_by"), masks),
    )
    return found, row


def _among_all(mask: IntArray, masks: Sequence[int]) -> IntArray:
    """Return masks over a tracker's own sensors as masks over those of all."""
    found = np.zeros(len(mask), dtype=np.int64)
    for i, bit in enumerate(masks):
        found |= np.where(mask >> i & 1 == 1, np.int64(bit), 0)
    return found


@dataclass(frozen=True, eq=False)
class FusionRecords:
    """What is kept of each replica beside its tracks, replicas ascending."""

    replica: IntArray
    # (3, n), of its frame (latitude, longitude in deg, height in m); NaN before the first track
    origin: FloatArray
    next_number: IntArray
    time_s: FloatArray  # (n,), the newest instant that any track spoke of
    own_m: FloatArray  # (3, n), where in the frame the ownship was then

    def take(self, which: Any) -> "FusionRecords":
        """Return those of some replicas."""
        return FusionRecords(
            self.replica[which], self.origin[:, which], self.next_number[which],
            self.time_s[which], self.own_m[:, which],
        )  # fmt: skip

    def kept_with(self, newer: "FusionRecords", first_run: int) -> "FusionRecords":
        """Return those of all replicas that run, as in `newer` where they are among them."""
        old = self.take(~np.isin(self.replica, newer.replica) & (self.replica >= first_run))
        names = [field.name for field in fields(self)]
        both = (np.concatenate([getattr(part, n) for part in (old, newer)], axis=-1) for n in names)
        whole = FusionRecords(*both)
        return whole.take(np.argsort(whole.replica, kind="stable"))


def with_newest(records: FusionRecords, new: LocalTracks) -> FusionRecords:
    """Return records that know the newest instant, and where the ownship is then."""
    time_s, own_m = records.time_s.copy(), records.own_m.copy()
    order = np.lexsort((-new.tracker, new.time_s))
    of = np.searchsorted(records.replica, new.replica[order])
    late = new.time_s[order] >= time_s[of]
    time_s[of[late]] = new.time_s[order][late]
    own_m[:, of[late]] = new.own_m[:, order][:, late]
    return replace(records, time_s=time_s, own_m=own_m)
