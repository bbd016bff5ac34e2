"""Contacts as the tracker or the fusion has them, and where the ownship was when it saw them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.display.picture_plane import geodetic_from_ned_offsets
from components.estimation.frame import vectors_in_frame
from components.geometry import body_to_ned, north_east_up_offsets_m, unit_vector_unchecked
from components.messages.alerts import TRACKS_FROM
from components.messages.fused import FusedDetections
from components.messages.state_tracks import DELETED, StateTracks
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: A range that was measured counts for so long when only directions follow, s.
RANGE_HELD_S = 3.0
_KEPT = 600
_SPEED_OVER_S = 0.5


@dataclass(frozen=True)
class OwnNow:
    """The ownship's position, attitude, speed and climb at the latest instant received."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    speed_mps: float
    climb_mps: float


class OwnFlight:
    """The ownship's latest positions and attitudes, in order of time."""

    def __init__(self) -> None:
        self.now: OwnNow | None = None
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        # Latitude, longitude (deg), altitude, yaw, pitch, roll.
        self._pose: FloatArray = np.empty((0, 6))

    def store_states(self, states: TrafficStates, ticks_per_s: int) -> None:
        """Store newly received own poses, and update the latest state with speed and climb."""
        new = np.stack([
            states.own_lat_deg, states.own_lon_deg, states.own_alt_m, states.own_yaw_rad,
            states.own_pitch_rad, states.own_roll_rad,
        ], axis=1)  # fmt: skip
        keep = self._tick < states.tick[0]
        self._tick = np.concatenate([self._tick[keep], states.tick])[-_KEPT:]
        self._pose = np.concatenate([self._pose[keep], new])[-_KEPT:]
        then = int(np.searchsorted(self._tick, self._tick[-1] - _SPEED_OVER_S * ticks_per_s))
        then = min(then, max(len(self._tick) - 2, 0))
        apart_s = (self._tick[-1] - self._tick[then]) / ticks_per_s
        speed, climb = 0.0, 0.0
        if apart_s > 0.0:
            east, north, up = _displacement_from(self._pose[-1], self._pose[then, np.newaxis, :3])[
                0
            ].tolist()
            speed, climb = math.hypot(east, north) / apart_s, -up / apart_s
        lat_deg, lon_deg, alt_m, yaw, pitch, roll = self._pose[-1].tolist()
        self.now = OwnNow(lat_deg, lon_deg, alt_m, yaw, pitch, roll, speed, climb)

    def poses_at(self, tick: IntArray) -> FloatArray:
        """Return the last own pose by each tick, else the first, (n, 6): lat, lon (deg), alt (m),
        yaw, pitch, roll (rad).
        """
        index = np.searchsorted(self._tick, tick, side="right") - 1
        return self._pose[np.maximum(index, 0)]


def _displacement_from(own: FloatArray, position: FloatArray) -> FloatArray:
    """Return how far positions (n, 3) lie east, north and up of the own position, m (n, 3).

    Latitude and longitude, deg, and altitude, m; NaN where they are not known.
    """
    result = np.full(position.shape, np.nan)
    known = np.isfinite(position).all(axis=1)
    there = position[known]
    here = (np.full(len(there), value) for value in own[:3].tolist())
    north, east, _ = north_east_up_offsets_m(*here, *np.ascontiguousarray(there.T))
    result[known] = np.column_stack([east, north, there[:, 2] - own[2]])
    return result


@dataclass(frozen=True)
class Contacts:
    """Contacts at one instant, (n,) each.

    The number is that of the target, -1 for none, or `TRACKS_FROM` and the tracker's number. Of one
    that was seen last at `seen_s` the range and when it was measured are NaN without one, as is the
    position (n, 3): latitude, longitude (deg) and altitude (m). The line of sight is `toward`
    (n, 2): bearing from north where the ownship was, and elevation, rad.
    """

    number: IntArray
    seen_s: FloatArray
    ranged: BoolArray
    range_m: FloatArray
    range_s: FloatArray
    position: FloatArray
    toward: FloatArray

    def rows_to_show(self, own: OwnNow, time_s: float, forgotten_s: float) -> list[list[Any]]:
        """Return a row of numbers per contact up to `forgotten_s` old, those with a range first.

        [number, east_m, north_m, up_m, bearing_deg, age_s] from the ownship as it is now; the three
        are None without a range.
        """
        fresh = np.flatnonzero(time_s - self.seen_s < forgotten_s)
        fresh = fresh[np.argsort(~self.ranged[fresh], kind="stable")]
        here = np.array([own.lat_deg, own.lon_deg, own.alt_m])
        away = _displacement_from(here, self.position[fresh])
        bearing = np.degrees(self.toward[fresh, 0]) % 360.0
        table = np.round(np.column_stack([away, bearing, time_s - self.seen_s[fresh]]), 2)
        result = []
        for number, ranged, row in zip(
            self.number[fresh].tolist(), self.ranged[fresh].tolist(), table.tolist(), strict=True
        ):
            result.append([number, *(row[:3] if ranged else (None, None, None)), *row[3:]])
        return result


def contacts_after_lines(
    message: Tracks | FusedDetections, own: OwnFlight, ticks_per_s: int, before: Contacts | None
) -> Contacts:
    """Return contacts after new lines of sight, from those before; a missing range is held a while.

    Where only a direction was measured, the last range counts for a while yet. Tracks hold what was
    measured; fused lines are of one instant, and contacts that are not among them stay.
    """
    seen_s = message.measured_tick / ticks_per_s
    range_m, range_s = message.range_m, np.where(np.isfinite(message.range_m), seen_s, np.nan)
    if before is not None:
        range_m, range_s = _fill_missing_ranges_and_times(
            message.target, seen_s, range_m, range_s, before
        )
    pose = own.poses_at(message.measured_tick)
    body = unit_vector_unchecked(message.azimuth_rad, message.elevation_rad)
    north, east, down = body_to_ned(*body, *pose[:, 3:].T)
    ends = geodetic_from_ned_offsets(np.stack([north, east, down]) * range_m, pose[:, :3].T)
    toward = np.stack([np.arctan2(east, north), np.arcsin(np.clip(-down, -1.0, 1.0))], axis=1)
    result = Contacts(
        message.target, seen_s, np.isfinite(range_m), range_m, range_s, ends.T, toward
    )
    if before is None or isinstance(message, Tracks):
        return result
    stays = ~np.isin(before.number, result.number)
    pairs = zip(vars(result).values(), vars(before).values(), strict=True)
    return Contacts(*(np.concatenate([new, old[stays]]) for new, old in pairs))


def _fill_missing_ranges_and_times(
    number: IntArray, seen_s: FloatArray, range_m: FloatArray, range_s: FloatArray, before: Contacts
) -> tuple[FloatArray, FloatArray]:
    """Return ranges and their times; missing ones as the contact's last within `RANGE_HELD_S`."""
    order = np.argsort(before.number, kind="stable")
    known = before.number[order]
    index = np.searchsorted(known, number)
    there = index < len(known)
    there[there] = known[index[there]] == number[there]
    there &= number >= 0
    old = order[np.minimum(index, max(len(known) - 1, 0))] if len(known) else index
    for_it = np.flatnonzero(there & ~np.isfinite(range_m))
    for_it = for_it[seen_s[for_it] - before.range_s[old[for_it]] <= RANGE_HELD_S]
    range_m, range_s = range_m.copy(), range_s.copy()
    range_m[for_it], range_s[for_it] = before.range_m[old[for_it]], before.range_s[old[for_it]]
    return range_m, range_s


def contacts_of_states(message: StateTracks, own: OwnFlight, ticks_per_s: int) -> Contacts:
    """Return the contacts in one row of a tracker's state estimates, without deleted tracks."""
    lives = np.flatnonzero(message.track_status != DELETED)
    ranged = message.has_range[lives] & np.isfinite(message.north_m[lives])
    ned_m = np.stack([message.north_m, message.east_m, message.down_m])[:, lives]
    origin = [message.origin_lat_deg, message.origin_lon_deg, message.origin_alt_m]
    origin = [part[lives] for part in origin]
    ends = geodetic_from_ned_offsets(np.where(ranged, ned_m, np.nan), origin)
    sight = np.stack(
        unit_vector_unchecked(message.azimuth_rad[lives], message.elevation_rad[lives])
    )
    if own.now is not None:  # directions are along the axes of the tracker's frame
        here = np.repeat([[own.now.lat_deg], [own.now.lon_deg]], len(lives), axis=1)
        sight = vectors_in_frame(here, np.array(origin), sight)
    toward = np.stack(
        [np.arctan2(sight[1], sight[0]), np.arcsin(np.clip(-sight[2], -1, 1))], axis=1
    )
    seen_s = message.updated_s[lives]
    unknown = np.full(len(lives), np.nan)
    return Contacts(
        TRACKS_FROM + message.track[lives], seen_s, ranged, unknown, unknown, ends.T, toward
    )
