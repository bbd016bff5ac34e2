"""Flights believed from tracks with states: carried on straight, in the ownship's plane."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from components.alert_configuration.configuration import Deviations, largest
from components.alerting.believed_positions import BelievedFlights
from components.alerting.own_poses import OwnPoses
from components.estimation.frame import ned_axes
from components.geometry import east_north_m, east_north_mps, enu_to_geodetic
from components.messages.columns import STATE
from components.messages.state_tracks import COASTED, CONFIRMED, COVARIANCE, StateTracks
from dsa_des.arrays.run_ticks import RunTicks, last_of_run
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Arrivals, Wake

# Upper triangle of a covariance in its columns.
_PAIRS = tuple(COVARIANCE)
# A track farther than this from every target belongs to none, for whoever evaluates, m.
_SAME_TARGET_M = 1000.0
_OWN_VELOCITY = ("east_mps", "north_mps", "climb_mps")


class _Estimates(NamedTuple):
    """Tracks as they were estimated, (tracks,) in the last axis."""

    number: IntArray  # (tracks,)
    time_s: FloatArray  # (tracks,): that their states speak of
    state: FloatArray  # (6, tracks): north, east, down and their rates in the frame
    covariance: FloatArray  # (21, tracks)
    origin: FloatArray  # (3, tracks): of the frame: latitude, longitude (deg), height (m)

    @classmethod
    def of(cls, tracks: StateTracks) -> "_Estimates":
        return cls(
            tracks.track,
            tracks.state_s,
            np.stack([getattr(tracks, name) for name in STATE]),
            np.stack([tracks.covariance[COVARIANCE[pair]] for pair in _PAIRS]),
            np.stack([tracks.origin_lat_deg, tracks.origin_lon_deg, tracks.origin_alt_m]),
        )

    def take(self, which: IntArray | BoolArray) -> "_Estimates":
        parts: Any = (part[..., which] for part in self)
        return _Estimates(*parts)

    def with_more(self, more: "_Estimates") -> "_Estimates":
        both: Any = zip(self, more, strict=True)
        return _Estimates(*(np.concatenate(parts, axis=-1) for parts in both))


_NONE = _Estimates(
    np.empty(0, dtype=np.int64), np.empty(0), np.empty((6, 0)), np.empty((21, 0)), np.empty((3, 0))
)


class EstimatedFlights:
    """What has come of trackers' states: confirmed and coasted tracks that have a range.

    What came in each run stands together, in order.
    """

    def __init__(self) -> None:
        #: When each row came, where its tracks begin and how many there are.
        self._came = RunTicks.none()
        self._begin: IntArray = np.empty(0, dtype=np.int64)
        self._count: IntArray = np.empty(0, dtype=np.int64)
        self._estimate = _NONE

    def add(self, came: RunTicks, tracks: StateTracks) -> None:
        """Take in tracks of a tracker, and when each row came."""
        good = tracks.has_range & np.isin(tracks.track_status, (CONFIRMED, COASTED))
        before = np.concatenate([[0], np.cumsum(good)])[tracks.offsets]
        self._came = RunTicks.joined([self._came, came])
        self._begin = np.concatenate([self._begin, len(self._estimate.number) + before[:-1]])
        self._count = np.concatenate([self._count, np.diff(before)])
        self._estimate = self._estimate.with_more(_Estimates.of(tracks).take(np.flatnonzero(good)))
        if (order := self._came.order()) is not None:
            self._keep_rows(order)

    def _keep_rows(self, which: IntArray | BoolArray) -> None:
        self._came, self._begin = self._came.take(which), self._begin[which]
        self._count = self._count[which]

    def keep(self, which: BoolArray) -> None:
        """Keep some of the rows that came."""
        if which.all():
            return
        self._keep_rows(which)
        self._estimate = self._estimate.take(_each(self._begin, self._count)[1])
        self._begin = np.cumsum(self._count) - self._count

    @property
    def came(self) -> RunTicks:
        """When the rows that are remembered came."""
        return self._came

    def states(
        self, now: RunTicks, now_s: FloatArray, own_place: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray, Deviations]:
        """Return the flights that are known at some instants, by instant and track."""
        last = last_of_run(self._came, now)
        some = np.flatnonzero(last >= 0)
        place, entry = _each(self._begin[last[some]], self._count[last[some]])
        instant = some[place]
        order = np.lexsort((self._estimate.number[entry], instant))
        instant, estimate = instant[order], self._estimate.take(entry[order])
        ahead_s = now_s[instant] - estimate.time_s
        state = _in_plane(estimate, ahead_s, own_place[:, instant])
        return instant, estimate.number, state, _deviations(estimate.covariance, ahead_s)


def _each(begin: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Return the row of every entry of some rows, and its place."""
    row = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return row, np.arange(len(row)) + (begin - first)[row]


def _in_plane(estimate: _Estimates, ahead_s: FloatArray, own_place: FloatArray) -> FloatArray:
    """Return places and velocities in the plane that touches the sphere below the ownship."""
    north, east, down = estimate.state[:3] + estimate.state[3:] * ahead_s
    lat_deg, lon_deg, alt_m = enu_to_geodetic(
        east, north, -down,
        reference_lat_deg=estimate.origin[0], reference_lon_deg=estimate.origin[1],
        reference_alt_m=estimate.origin[2],
    )  # fmt: skip
    # The frame's axes are those of its origin; velocity counts along those of the target's place.
    there, here = ned_axes(lat_deg, lon_deg), ned_axes(estimate.origin[0], estimate.origin[1])
    in_space = sum(v * axis for v, axis in zip(estimate.state[3:], here, strict=True))
    v_north, v_east, v_down = ((in_space * axis).sum(axis=0) for axis in there)
    own_lat, own_lon, own_alt_m = own_place
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    return np.stack(
        [
            *east_north_m(lat, lon, own_lat, own_lon),
            alt_m - own_alt_m,
            *east_north_mps(lat, lon, v_east, v_north, own_lat, own_lon),
            -v_down,
        ]
    )


def _deviations(covariance: FloatArray, ahead_s: FloatArray) -> Deviations:
    """Return the standard deviations of states that are carried on straight."""

    def of(i: int, j: int) -> AnyArray:
        return covariance[_PAIRS.index((min(i, j), max(i, j)))]

    def later(i: int, j: int) -> AnyArray:
        return of(i, j) + ahead_s * (of(i, j + 3) + of(j, i + 3)) + ahead_s**2 * of(i + 3, j + 3)

    def root(variance: AnyArray) -> AnyArray:
        return np.sqrt(np.maximum(variance, 0.0))

    return Deviations(
        largest(root(later(1, 1)), root(later(0, 0)), later(0, 1)),
        root(later(2, 2)),
        largest(root(of(4, 4)), root(of(3, 3)), of(3, 4)),
        root(of(5, 5)),
    )


class BelievedTracks:
    """Tracks of one tracker over time; what came in each run stands together."""

    def __init__(self) -> None:
        self._estimates = EstimatedFlights()
        self._true_came = RunTicks.none()
        self._true_m: FloatArray = np.empty((0, 0, 3))

    def add(self, arrived: Arrivals, own: OwnPoses, wake: Wake) -> None:
        """Take in the tracks of a tracker."""
        self._estimates.add(arrived.instants, arrived.message)

    def add_truth(self, came: RunTicks, time_s: FloatArray, position_m: FloatArray) -> None:
        """Take in where the targets are (rows, targets, 3): a track is named by the nearest."""
        held = self._true_m if len(self._true_m) else np.empty((0, *position_m.shape[1:]))
        self._true_came = RunTicks.joined([self._true_came, came])
        self._true_m = np.concatenate([held, position_m])
        if (order := self._true_came.order()) is not None:
            self._keep_true(order)

    def _keep_true(self, which: IntArray | BoolArray) -> None:
        self._true_came, self._true_m = self._true_came.take(which), self._true_m[which]

    def flights(
        self,
        asked: RunTicks,
        times_s: FloatArray,
        own: Mapping[str, FloatArray],
        poses: OwnPoses,
    ) -> BelievedFlights:
        """Return the flights of tracks at some scans, one in each row.

        `own` has the ownship's velocity, NaN where unknown yet.
        """
        # Without two poses the ownship's own velocity is not known, and no relative one.
        moving = np.flatnonzero(np.isfinite(own["east_mps"]))
        now = asked.take(moving)
        found = self._estimates.states(now, times_s[moving], poses.place(now))
        scan, number, state, deviations = moving[found[0]], *found[1:]
        mine = (own[name][scan] for name in _OWN_VELOCITY)
        velocity = (own_part - part for own_part, part in zip(mine, state[3:], strict=True))
        relative = tuple(part[:, np.newaxis] for part in (*-state[:3], *velocity))
        known = np.ones((len(scan), 1), dtype=bool)
        target = self._nearest(asked.take(scan), state[:3].T)
        return BelievedFlights(known, relative, scan, target, number, deviations)

    def _nearest(self, now: RunTicks, position_m: FloatArray) -> IntArray:
        """Return the target nearest to each of some positions (n, 3), -1 where none is near."""
        if self._true_m.shape[1] == 0 or len(now) == 0:
            return np.full(len(now), -1, dtype=np.int64)
        last = np.maximum(last_of_run(self._true_came, now), 0)
        away = self._true_m[last] - position_m[:, np.newaxis]
        range_m = np.nan_to_num(np.linalg.norm(away, axis=2), nan=np.inf)
        return np.where(range_m.min(axis=1) <= _SAME_TARGET_M, range_m.argmin(axis=1), -1)

    def forget(self, asked: RunTicks, times_s: FloatArray, wake: Wake) -> None:
        """Drop what later ones have replaced at some scans."""
        self._estimates.keep(_still_asked(self._estimates.came, asked, wake))
        kept = _still_asked(self._true_came, asked, wake)
        if not kept.all():
            self._keep_true(kept)


def _still_asked(came: RunTicks, asked: RunTicks, wake: Wake) -> BoolArray:
    """Return which rows are asked for after some scans: the last before them, and later ones."""
    ends = asked.take(asked.last_of_each)
    last = last_of_run(came, ends)
    there = np.minimum(np.searchsorted(ends.run, came.run), len(ends) - 1)
    # Of runs without a scan all rows, unless they have ended.
    kept = (ends.run[there] != came.run) | (np.arange(len(came)) >= last[there])
    return kept & (came.run >= wake.first_run)
