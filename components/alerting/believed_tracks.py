"""Flights believed from tracks with states: carried on straight, in the ownship's plane."""

from collections.abc import Mapping

import numpy as np

from components.alert_configuration.configuration import Deviations, longest_axis_deviation
from components.alerting.believed_positions import BelievedFlights, unjudged_counts_by_cause
from components.alerting.others_tracks import OthersTracks
from components.alerting.received import OwnPoses, ReceivedRows
from components.estimation.frame import vectors_in_frame
from components.geometry import east_north_m, east_north_mps, enu_to_geodetic
from components.messages.columns import ORIGIN, STATE
from components.messages.state_tracks import (
    COASTED,
    CONFIRMED,
    COVARIANCE,
    STALE_S,
    StateTracks,
)
from dsa_des.arrays.entries import rows_of_entries
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import RunTicks, last_position_at_or_before
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.failure_counts import counts_with_cases_added

# Upper triangle of a covariance in its columns.
_PAIRS = tuple(COVARIANCE)
# A track farther than this from every target belongs to none, for whoever evaluates, m.
_SAME_TARGET_M = 1000.0
_SHAPES = {"state": (6,), "covariance": (len(_PAIRS),), "origin": (3,)}
_OWN_VELOCITY = ("east_mps", "north_mps", "climb_mps")


class EstimatedFlights:
    """Remembers the tracks received so far that are confirmed or coasted and have a range.

    One that has had no detection for `STALE_S` is refused, whatever is still held of it, and so is
    one of the platform itself that another platform's sensor made.
    """

    def __init__(self, others: OthersTracks | None = None) -> None:
        self._others = others
        #: How many tracks have no range, of how many, by run.
        self.rangeless = np.zeros((2, 0), dtype=np.int64)
        #: Where the tracks of each row begin and how many there are.
        self._rows = ReceivedRows.empty_with_columns("begin", "count")
        #: Tracks, in no order: states (6, n) and covariances (21, n) in frames with an origin (3,
        #: n) of latitude, longitude (deg) and height (m), of the instant ``time_s``.
        self._tracks = KeyedTable.empty(
            {
                "replica": int,
                "number": int,
                "from_others": bool,
                "time_s": float,
                "updated_s": float,
                **dict.fromkeys(_SHAPES, float),
            },
            _SHAPES,
        )

    def add(self, came: RunTicks, tracks: StateTracks) -> None:
        """Store each message row's confirmed and coasted tracks with a range, and when it came."""
        good = np.isin(tracks.track_status, (CONFIRMED, COASTED))
        run = came.run[rows_of_entries(tracks.offsets)]
        self.rangeless = counts_with_cases_added(
            self.rangeless, run[good & ~tracks.has_range], run[good]
        )
        good &= tracks.has_range
        before = np.concatenate([[0], np.cumsum(good)])[tracks.offsets]
        begin = len(self._tracks) + before[:-1]
        self._rows = self._rows.append(came, begin=begin, count=np.diff(before))
        new = KeyedTable(
            replica=run,
            number=tracks.track,
            from_others=np.zeros(len(run), dtype=bool)
            if self._others is None
            else self._others.are_of_others_only(tracks),
            time_s=tracks.state_s,
            updated_s=tracks.updated_s,
            state=np.array([getattr(tracks, name) for name in STATE]),
            covariance=np.array([tracks.covariance[COVARIANCE[pair]] for pair in _PAIRS]),
            origin=np.array([getattr(tracks, name) for name in ORIGIN]),
        )
        self._tracks = KeyedTable.concatenate([self._tracks, new.take(good)])

    def keep_rows(self, which: BoolArray) -> None:
        """Drop all received message rows, with their tracks, but those where the mask is true."""
        if which.all():
            return
        rows = self._rows.take(which)
        self._tracks = self._tracks.take(_enumerate_entries(rows.begin, rows.count)[1])
        self._rows = rows.with_columns(begin=np.cumsum(rows.count) - rows.count)

    @property
    def arrival_ticks(self) -> RunTicks:
        """Run and tick at which each remembered message row came."""
        return self._rows.instants

    def states_at(
        self,
        now: RunTicks,
        now_s: FloatArray,
        own_place: FloatArray,
        own_velocity: FloatArray | None = None,
    ) -> tuple[IntArray, IntArray, FloatArray, Deviations, FloatArray]:
        """Return five arrays of known tracks: instant, track number, state, deviations, age in s.

        They are the instant, number, state and deviations of each, and how old its last
        measurement is. `own_velocity` (north, east, down) tells which one is the ownship.
        """
        last = self._rows.last_row_index(now)
        some = np.flatnonzero(last >= 0)
        rows = self._rows.take(last[some])
        index, entry = _enumerate_entries(rows.begin, rows.count)
        instant = some[index]
        young = now_s[instant] - self._tracks.updated_s[entry] <= STALE_S
        instant, entry = instant[young], entry[young]
        order = np.lexsort((self._tracks.number[entry], instant))
        instant, tracks = instant[order], self._tracks.take(entry[order])
        ahead_s = now_s[instant] - tracks.time_s
        state = _project_to_plane(tracks, ahead_s, own_place[:, instant])
        deviations = _predicted_deviations(tracks.covariance, ahead_s)
        age_s = now_s[instant] - tracks.updated_s
        given = np.flatnonzero(tracks.from_others)
        if len(given) == 0 or self._others is None or own_velocity is None:
            return instant, tracks.number, state, deviations, age_s
        of = instant[given]
        is_own, theirs = self._others.own_tracks_and_deviations(
            tracks.take(given), ahead_s[given], own_place[:, of], own_velocity[:, of], of
        )
        for mine, values in zip(deviations, theirs, strict=True):
            mine[given] = values
        kept = np.delete(np.arange(len(instant)), given[is_own])
        deviations = Deviations(*(part[kept] for part in deviations))
        return instant[kept], tracks.number[kept], state[:, kept], deviations, age_s[kept]


def _enumerate_entries(begin: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return row and index of every entry, for rows of `count` entries starting at `begin`."""
    row = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return row, np.arange(len(row)) + (begin - first)[row]


def _project_to_plane(tracks: KeyedTable, ahead_s: FloatArray, own_place: FloatArray) -> FloatArray:
    """Return tracks predicted `ahead_s`, east, north, up, rates (6, n), in own tangent plane."""
    north, east, down = tracks.state[:3] + tracks.state[3:] * ahead_s
    lat_deg, lon_deg, alt_m = enu_to_geodetic(
        east, north, -down,
        reference_lat_deg=tracks.origin[0], reference_lon_deg=tracks.origin[1],
        reference_alt_m=tracks.origin[2],
    )  # fmt: skip
    # The frame's axes are those of its origin; velocity counts along those of the target's place.
    position_deg = np.array([lat_deg, lon_deg])
    v_north, v_east, v_down = vectors_in_frame(position_deg, tracks.origin, tracks.state[3:])
    own_lat, own_lon, own_alt_m = own_place
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    return np.array(
        [
            *east_north_m(lat, lon, own_lat, own_lon),
            alt_m - own_alt_m,
            *east_north_mps(lat, lon, v_east, v_north, own_lat, own_lon),
            -v_down,
        ]
    )


def _predicted_deviations(covariance: FloatArray, ahead_s: FloatArray) -> Deviations:
    """Return standard deviations of tracks after `ahead_s` straight on, from covariances now."""

    def covariance_of(i: int, j: int) -> AnyArray:
        return covariance[_PAIRS.index((min(i, j), max(i, j)))]

    def predicted_covariance_of(i: int, j: int) -> AnyArray:
        return (
            covariance_of(i, j)
            + ahead_s * (covariance_of(i, j + 3) + covariance_of(j, i + 3))
            + ahead_s**2 * covariance_of(i + 3, j + 3)
        )

    def root_or_zero(variance: AnyArray) -> AnyArray:
        return np.sqrt(np.maximum(variance, 0.0))

    return Deviations(
        longest_axis_deviation(
            root_or_zero(predicted_covariance_of(1, 1)),
            root_or_zero(predicted_covariance_of(0, 0)),
            predicted_covariance_of(0, 1),
        ),
        root_or_zero(predicted_covariance_of(2, 2)),
        longest_axis_deviation(
            root_or_zero(covariance_of(4, 4)),
            root_or_zero(covariance_of(3, 3)),
            covariance_of(3, 4),
        ),
        root_or_zero(covariance_of(5, 5)),
    )


class BelievedTracks:
    """Remembers the tracks of one tracker, and gives relative flights of them at any scan."""

    def __init__(self, targets: int, others: OthersTracks) -> None:
        self._estimates = EstimatedFlights(others)
        #: Where the targets are: a track is named by the nearest.
        self._true = ReceivedRows.empty_with_columns(position_m=(targets, 3))
        #: At how many scans the ownship's velocity is not known yet, of how many, by run.
        self._unmoving = np.zeros((2, 0), dtype=np.int64)

    def failure_counts(self) -> dict[str, IntArray]:
        """Return cause → (2, runs) counts: targets that could not be judged for it, and cases."""
        return unjudged_counts_by_cause(self._estimates.rangeless, self._unmoving)

    def add(self, arrived: Arrivals, own: OwnPoses, wake: Wake) -> None:
        """Store the tracks of a tracker's message and when each of its rows came."""
        self._estimates.add(arrived.instants, arrived.message)

    def add_truth(self, came: RunTicks, time_s: FloatArray, position_m: FloatArray) -> None:
        """Store true target positions (rows, targets, 3), and when each message came."""
        self._true = self._true.append(came, position_m=np.moveaxis(position_m, 0, -1))

    def flights(
        self,
        asked: RunTicks,
        times_s: FloatArray,
        own: Mapping[str, FloatArray],
        poses: OwnPoses,
    ) -> BelievedFlights:
        """Return relative flights, one row per scan and track; none if own velocity is unknown.

        `own` has the ownship's velocity, NaN where unknown yet.
        """
        # Without two poses the ownship's own velocity is not known, and no relative one.
        known = np.isfinite(own["east_mps"])
        moving = known.nonzero()[0]
        self._unmoving = counts_with_cases_added(self._unmoving, asked.run[~known], asked.run)
        now = asked.take(moving)
        east, north, climb = (own[name][moving] for name in _OWN_VELOCITY)
        velocity_m_s = np.stack([north, east, -climb])
        result = self._estimates.states_at(
            now, times_s[moving], poses.position_known_at(now), velocity_m_s
        )
        scan, number, state, deviations, age_s = moving[result[0]], *result[1:]
        mine = (own[name][scan] for name in _OWN_VELOCITY)
        velocity = (own_part - part for own_part, part in zip(mine, state[3:], strict=True))
        relative = tuple(part[:, np.newaxis] for part in (*-state[:3], *velocity))
        known = np.ones((len(scan), 1), dtype=bool)
        target = self._nearest_target(asked.take(scan), state[:3].T)
        return BelievedFlights(known, relative, scan, target, number, deviations, age_s)

    def _nearest_target(self, now: RunTicks, position_m: FloatArray) -> IntArray:
        """Return the index of the nearest true target (n,), -1 for none within `_SAME_TARGET_M`."""
        true = self._true
        if true.position_m.shape[0] == 0 or len(true) == 0 or len(now) == 0:
            return np.full(len(now), -1, dtype=np.int64)
        true_m = np.moveaxis(true.position_m[:, :, np.maximum(true.last_row_index(now), 0)], -1, 0)
        away = true_m - position_m[:, np.newaxis]
        range_m = np.nan_to_num(np.linalg.norm(away, axis=2), nan=np.inf)
        return np.where(range_m.min(axis=1) <= _SAME_TARGET_M, range_m.argmin(axis=1), -1)

    def forget(self, asked: RunTicks, times_s: FloatArray, wake: Wake) -> None:
        """Drop tracks and true positions superseded by these scans, and those of ended runs."""
        self._estimates.keep_rows(_is_needed_later(self._estimates.arrival_ticks, asked, wake))
        self._true = self._true.take(_is_needed_later(self._true.instants, asked, wake))


def _is_needed_later(came: RunTicks, asked: RunTicks, wake: Wake) -> BoolArray:
    """Return a mask of rows to keep: last before a run's latest scan, or later, if it goes on."""
    ends = asked.take(asked.last_position_of_runs)
    last = last_position_at_or_before(came, ends)
    there = np.minimum(np.searchsorted(ends.run, came.run), len(ends) - 1)
    # Of runs without a scan all rows, unless they have ended.
    kept = (ends.run[there] != came.run) | (np.arange(len(came)) >= last[there])
    return kept & (came.run >= wake.first_run)
