"""Contacts: what the operator is shown of other aircraft, as the tracker or the fusion has them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from components.cdti.own_flight import OwnFlight, OwnNow
from components.display.picture import offset_positions
from components.geometry.attitude import body_to_ned, unit_vector_unchecked
from components.messages.alerts import TRACKS_FROM
from components.messages.fused import FusedDetections
from components.messages.state_tracks import DELETED, StateTracks
from components.messages.tracks import Tracks
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: A range that was measured counts for so long when only directions follow, s.
RANGE_HELD_S = 3.0


@dataclass(frozen=True)
class Contacts:
    """Contacts at one instant.

    Parameters
    ----------
    number : (n,) of int
        Of the target, -1 for none, or `TRACKS_FROM` and the tracker's number.
    seen_s : (n,)
        When it was seen last.
    ranged : (n,) of bool
    range_m, range_s : (n,)
        The range, and when it was measured; NaN without one.
    place_m : (n, 3)
        East and north in the plane, and altitude; NaN without a range.
    toward : (n, 2)
        Bearing from north and elevation of the line of sight, rad.
    """

    number: IntArray
    seen_s: FloatArray
    ranged: BoolArray
    range_m: FloatArray
    range_s: FloatArray
    place_m: FloatArray
    toward: FloatArray

    def shown(self, own: OwnNow, time_s: float, forgotten_s: float) -> list[list[Any]]:
        """Return the contacts as the page has them, ranged ones first.

        Returns
        -------
        list of [number, east_m, north_m, up_m, bearing_deg, age_s]
            From the ownship as it is now; the three are None without a range.
        """
        fresh = np.flatnonzero(time_s - self.seen_s < forgotten_s)
        fresh = fresh[np.argsort(~self.ranged[fresh], kind="stable")]
        away = self.place_m[fresh] - (own.east_m, own.north_m, own.alt_m)
        bearing = np.degrees(self.toward[fresh, 0]) % 360.0
        table = np.round(np.column_stack([away, bearing, time_s - self.seen_s[fresh]]), 2)
        found = []
        for number, ranged, row in zip(
            self.number[fresh].tolist(), self.ranged[fresh].tolist(), table.tolist(), strict=True
        ):
            found.append([number, *(row[:3] if ranged else (None, None, None)), *row[3:]])
        return found


def contacts_of_lines(
    message: Tracks | FusedDetections, own: OwnFlight, ticks_per_s: int, before: Contacts | None
) -> Contacts:
    """Return the contacts of one row of measured lines of sight.

    Where only a direction was measured, the last range counts for a while yet. Tracks hold what was
    measured; fused lines are of one instant, and contacts that are not among them stay.
    """
    seen_s = message.measured_tick / ticks_per_s
    range_m, range_s = message.range_m, np.where(np.isfinite(message.range_m), seen_s, np.nan)
    if before is not None:
        range_m, range_s = _held(message.target, seen_s, range_m, range_s, before)
    pose = own.poses(message.measured_tick)
    body = unit_vector_unchecked(message.azimuth_rad, message.elevation_rad)
    north, east, down = body_to_ned(*body, *pose[:, 3:].T)
    away = np.stack([east, north, -down], axis=1) * range_m[:, np.newaxis]
    toward = np.stack([np.arctan2(east, north), np.arcsin(np.clip(-down, -1.0, 1.0))], axis=1)
    found = Contacts(
        message.target, seen_s, np.isfinite(range_m), range_m, range_s, pose[:, :3] + away, toward
    )
    if before is None or isinstance(message, Tracks):
        return found
    stays = ~np.isin(before.number, found.number)
    pairs = zip(vars(found).values(), vars(before).values(), strict=True)
    return Contacts(*(np.concatenate([new, old[stays]]) for new, old in pairs))


def _held(
    number: IntArray, seen_s: FloatArray, range_m: FloatArray, range_s: FloatArray, before: Contacts
) -> tuple[FloatArray, FloatArray]:
    """Return the ranges with those of before where none was measured, and when they were."""
    order = np.argsort(before.number, kind="stable")
    known = before.number[order]
    place = np.searchsorted(known, number)
    there = place < len(known)
    there[there] = known[place[there]] == number[there]
    there &= number >= 0
    old = order[np.minimum(place, max(len(known) - 1, 0))] if len(known) else place
    for_it = np.flatnonzero(there & ~np.isfinite(range_m))
    for_it = for_it[seen_s[for_it] - before.range_s[old[for_it]] <= RANGE_HELD_S]
    range_m, range_s = range_m.copy(), range_s.copy()
    range_m[for_it], range_s[for_it] = before.range_m[old[for_it]], before.range_s[old[for_it]]
    return range_m, range_s


def contacts_of_states(message: StateTracks, own: OwnFlight, ticks_per_s: int) -> Contacts:
    """Return the contacts of one row of estimated states."""
    lives = np.flatnonzero(message.track_status != DELETED)
    place = np.full((len(lives), 3), np.nan)
    ranged = message.has_range[lives] & np.isfinite(message.north_m[lives])
    if own.plane is not None:
        ned_m = np.stack([message.north_m, message.east_m, message.down_m])[:, lives]
        origin = [message.origin_lat_deg, message.origin_lon_deg, message.origin_alt_m]
        ends = offset_positions(np.where(ranged, ned_m, np.nan), [part[lives] for part in origin])
        place = np.stack([*own.plane.east_north_m(*ends), ends[2]], axis=1)
    toward = np.stack([message.azimuth_rad[lives], message.elevation_rad[lives]], axis=1)
    seen_s = message.updated_s[lives]
    unknown = np.full(len(lives), np.nan)
    return Contacts(
        TRACKS_FROM + message.track[lives], seen_s, ranged, unknown, unknown, place, toward
    )
