"""Pairs of paths in the plane of their origin: how they pass, and what can be said without flights.

Encounters are known as north, east and altitude from sample to sample. Flights lie on the ellipsoid
and are flown straight from sample to sample too, so that a plane tells what they do but for an
error with a bound: within `_FARTHEST_M` of the origin, `_HIGHEST_M` up and with samples less than
`_LONGEST_M` apart, distances in the ownship's level plane are those here, times 1 + altitude /
radius of the Earth, to 1e-4 of themselves and 0.7 m. Whatever lies within `_MARGIN_M` and
`_MARGIN` of a limit is called unsure, and must be asked of the flights.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

_FARTHEST_M, _HIGHEST_M, _LONGEST_M = 50e3, 20e3, 10e3
_EARTH_M = 6_371_000.0
_MARGIN_M, _MARGIN = 1.5, 1e-3
#: How far ahead conflicts are foreseen, s.
_FORESEEN_S = 60.0
#: Directions of slower flight are asked of the flights, and angles so close to an edge, degrees.
_SLOW_MPS, _MARGIN_DEG = 0.5, 0.3


@dataclass(frozen=True)
class PairPaths:
    """Paths of each pair's ownship and intruder at common times: north, east and altitude, m.

    Positions are (3, instants, pairs).
    """

    time_s: FloatArray
    own_m: FloatArray
    other_m: FloatArray

    def cut_at(self, end_s: float) -> "PairPaths":
        """Return the paths cut at `end_s`, from time 0 on."""
        time_s = self.time_s
        if not len(time_s) or (time_s[0] >= 0.0 and time_s[-1] <= end_s):
            return self
        ends = [t for t in (0.0, end_s) if time_s[0] < t < time_s[-1]]
        wanted = np.union1d(time_s[(time_s >= 0.0) & (time_s <= end_s)], ends)
        after = np.clip(np.searchsorted(time_s, wanted, side="right"), 1, max(len(time_s) - 1, 1))
        before = after - 1
        part = (wanted - time_s[before]) / (time_s[after] - time_s[before])
        own, other = (
            at[:, before] + part[:, np.newaxis] * (at[:, after] - at[:, before])
            for at in (self.own_m, self.other_m)
        )
        return PairPaths(wanted, own, other)


@dataclass(frozen=True)
class Meetings:
    """How the nearest intruder passes in each of many runs, for paths in a plane.

    Time (s), horizontal and vertical distance (m), relative speed in the level plane (m/s), for how
    long before it was `foreseen` (s), course and bearing (degrees) at the closest approach, (7,
    runs), NaN where nobody is met. Whether any
    intruder surely comes inside each of some cylinders, and whether that is `unsure`, (cylinders,
    runs). How near any comes to the side (`beside_m`) while no further up or down than each of some
    cylinders reaches, and how near up or down (`above_m`) while no further to the side, (cylinders,
    runs); infinite where it never is. Between which courses and bearings it may be, (2, 2, runs),
    degrees; and of which runs that is unsure.
    """

    closest: FloatArray
    inside: BoolArray
    unsure: BoolArray
    beside_m: FloatArray
    above_m: FloatArray
    angles_deg: FloatArray
    unsure_angles: BoolArray


def closest_meetings(
    paths: Iterable[tuple[IntArray, PairPaths]],
    runs: int,
    end_s: float,
    sizes_m: Sequence[tuple[float, float]],
    missed_m: Sequence[tuple[float, float]],
) -> Meetings:
    """Return each run's closest passing of an intruder; `paths` are run numbers and pairs' paths.

    They are looked at from time 0 to `end_s`; cylinders are (radius, half height), m: as many that
    somebody comes inside of, or that are missed.
    """
    inside, unsure = np.zeros((2, len(sizes_m), runs), dtype=np.bool_)
    beside_m, above_m = np.full((2, len(missed_m), runs), np.inf)
    result = Meetings(
        np.full((7, runs), np.nan), inside, unsure, beside_m, above_m,
        np.full((2, 2, runs), np.nan), np.zeros(runs, dtype=np.bool_),
    )  # fmt: skip
    parts: list[tuple[AnyArray, ...]] = []
    for number, of in paths:
        pairs = PairsInPlane(of.cut_at(end_s))
        for k, limits in enumerate(sizes_m):
            surely, maybe = pairs.masks_sure_and_uncertain_entry(*limits)
            inside[k, number[surely]] = True
            unsure[k, number[maybe]] = True
        for k, limits in enumerate(missed_m):
            for found, miss_m in zip(
                (beside_m, above_m), pairs.least_distances_by_cylinder_m(*limits), strict=True
            ):
                np.minimum.at(found[k], number, miss_m)
        closest, *angles = pairs.closest_approaches()
        foreseen_s = pairs.foreseen_conflict_duration_s(*sizes_m[0], closest[0])
        parts.append((number, np.insert(closest, 4, foreseen_s, axis=0), *angles))
    unsure &= ~inside
    if not parts:
        return result
    number, closest, angles_deg, vague = (
        np.concatenate(p, axis=-1) for p in zip(*parts, strict=True)
    )
    range_m = np.hypot(closest[1], closest[2])
    order = np.lexsort((range_m, number))
    number, range_m = number[order], range_m[order]
    first = np.flatnonzero(np.diff(number, prepend=-1))
    met = first[~np.isnan(range_m[first])]
    which, pair = number[met], order[met]
    result.closest[:, which] = closest[:, pair]
    result.angles_deg[:, :, which] = angles_deg[:, :, pair]
    result.unsure_angles[which] = vague[pair]
    # Of two that come as near, either may be the nearer one.
    close = (np.diff(number) == 0) & ~(
        range_m[1:] > range_m[:-1] + _closest_approach_tolerance_m(range_m[:-1])
    )
    close &= np.diff(number[:-1], prepend=-1) != 0
    result.unsure_angles[number[:-1][close]] = True
    return result


def _closest_approach_tolerance_m(range_m: FloatArray) -> FloatArray:
    """Return how much farther, m, an approach may be to count as closest, given the margins."""
    result: FloatArray = 2.0 * (_MARGIN_M + _MARGIN * range_m)
    return result


class PairsInPlane:
    """Evaluates many pairs of paths in a plane at once."""

    def __init__(self, paths: PairPaths) -> None:
        self._paths = paths
        own, other = paths.own_m, paths.other_m
        self._count = own.shape[2]
        apart = other - own
        apart[:2] *= 1.0 + other[2] / _EARTH_M
        self._apart = apart
        #: From each sample to the next.
        self._moved = np.diff(apart, axis=1)
        self._lasts_s = np.diff(paths.time_s)
        self._level_m = np.sqrt(apart[0] ** 2 + apart[1] ** 2)
        self._half_m = 0.5 * np.sqrt(self._moved[0] ** 2 + self._moved[1] ** 2)
        #: Pairs that the plane is not good enough for.
        self.beyond: BoolArray = np.full(self._count, len(paths.time_s) < 2)
        for path in (own, other):
            step_m = np.abs(np.diff(path[:2], axis=1)).max(axis=(0, 1), initial=0.0)
            good = np.abs(path[:2]).max(axis=(0, 1), initial=0.0) <= _FARTHEST_M
            good &= np.abs(path[2]).max(axis=0, initial=0.0) <= _HIGHEST_M
            self.beyond |= ~(good & (step_m <= _LONGEST_M))

    def masks_sure_and_uncertain_entry(
        self, horizontal_m: float, vertical_m: float
    ) -> tuple[BoolArray, BoolArray]:
        """Return which pairs enter the cylinder surely, and for which it is uncertain (masks)."""
        level, up, half = self._level_m, self._apart[2], self._half_m
        outer = self._widen_size(horizontal_m, 1.0), vertical_m + _MARGIN_M
        nearest = np.minimum(level[:-1], level[1:]) - half
        lowest, highest = np.minimum(up[:-1], up[1:]), np.maximum(up[:-1], up[1:])
        step, pair = ((nearest < outer[0]) & (lowest < outer[1]) & (highest > -outer[1])).nonzero()
        apart, moved = self._apart[:, step, pair], self._moved[:, step, pair]
        maybe, surely = np.zeros((2, self._count), dtype=np.bool_)
        maybe[pair[_enters_cylinder(apart, moved, *outer)]] = True
        inner = self._widen_size(horizontal_m, -1.0), vertical_m - _MARGIN_M
        if min(inner) > 0.0:
            surely[pair[_enters_cylinder(apart, moved, *inner)]] = True
        surely &= ~self.beyond
        return surely, (maybe & ~surely) | self.beyond

    def least_distances_by_cylinder_m(self, horizontal_m: float, vertical_m: float) -> FloatArray:
        """Return (2, pairs), m: least horizontal distance within height, vertical within radius."""
        result = np.full((2, self._count), np.inf)
        up = self._apart[2]
        lowest, highest = np.minimum(up[:-1], up[1:]), np.maximum(up[:-1], up[1:])
        step, pair = ((lowest < vertical_m) & (highest > -vertical_m)).nonzero()
        apart, moved = self._apart[:, step, pair], self._moved[:, step, pair]
        begin, end = _fractions_within_height(apart[2], moved[2], vertical_m)
        squared = moved[0] ** 2 + moved[1] ** 2
        part = -(apart[0] * moved[0] + apart[1] * moved[1])
        part = part / np.where(squared > 0.0, squared, 1.0)
        part = np.clip(part, np.maximum(begin, 0.0), np.minimum(end, 1.0))
        north, east = apart[:2] + part * moved[:2]
        np.minimum.at(result[0], pair, np.hypot(north, east))
        nearest = np.minimum(self._level_m[:-1], self._level_m[1:]) - self._half_m
        step, pair = (nearest < horizontal_m).nonzero()
        apart, moved = self._apart[:, step, pair], self._moved[:, step, pair]
        begin, end, crosses = _fractions_within_radius(apart, moved, horizontal_m)
        begin, end = np.maximum(begin, 0.0), np.minimum(end, 1.0)
        there = (crosses & (begin < end)).nonzero()[0]
        ends = apart[2, there] + np.array([begin[there], end[there]]) * moved[2, there]
        least = np.where(ends[0] * ends[1] < 0.0, 0.0, np.abs(ends).min(axis=0))
        np.minimum.at(result[1], pair[there], least)
        return result

    def closest_approaches(self) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the closest approach of each pair (rows as in `Meetings`), bounds of course and
        bearing there, and a mask of pairs where these are uncertain.

        Columns are those of `Meetings`, without what was foreseen: closest, between which angles,
        and where these are unsure.
        """
        if not len(self._lasts_s):
            none = np.full((10, self._count), np.nan)
            return none[:6], none[6:].reshape(2, 2, -1), self.beyond
        range_m = np.sqrt(self._level_m**2 + self._apart[2] ** 2)
        sample, every = np.argmin(range_m, axis=0), np.arange(self._count)
        steps = np.maximum(sample - 1, 0), np.minimum(sample, len(self._lasts_s) - 1)
        before, after = (self._closest_between_samples(step, every) for step in steps)
        nearer = after[3] < before[3]
        time_s, level_m, up_m, best_m = np.where(nearer, after, before)
        own, other = self._velocities(np.where(nearer, steps[1], steps[0]), every)
        angles = _course_and_approach_bearing_deg(own, other)
        closest = np.array([time_s, level_m, up_m, np.hypot(*(other - own)), *angles % 360.0])
        # Wherever a pair may be closest, and over one sample more to both sides.
        near = np.minimum(range_m[:-1], range_m[1:]) - self._half_m - 0.5 * np.abs(self._moved[2])
        near_by: BoolArray = near < best_m + _closest_approach_tolerance_m(best_m)
        step, pair = near_by.nonzero()
        here_m = self._closest_between_samples(step, pair)[3]
        near_by[step, pair] = here_m < best_m[pair] + _closest_approach_tolerance_m(best_m[pair])
        wider = near_by.copy()
        wider[1:] |= near_by[:-1]
        wider[:-1] |= near_by[1:]
        step, pair = wider.nonzero()
        own, other = self._velocities(step, pair)
        off = (
            _course_and_approach_bearing_deg(own, other) - angles[:, pair] + 180.0
        ) % 360.0 - 180.0
        between = np.zeros((2, 2, self._count))
        for k in (0, 1):
            np.minimum.at(between[k, 0], pair, off[k])
            np.maximum.at(between[k, 1], pair, off[k])
        between += angles[:, np.newaxis] + np.array([[-_MARGIN_DEG], [_MARGIN_DEG]])
        vague = self.beyond.copy()
        slow = [np.hypot(*way) < _SLOW_MPS for way in (own, other, own - other)]
        vague[pair[np.any(slow, axis=0)]] = True
        return closest, between, vague

    def foreseen_conflict_duration_s(
        self, horizontal_m: float, vertical_m: float, until_s: FloatArray
    ) -> FloatArray:
        """Return for how many s before `until_s` straight pairs would have entered the cylinder.

        So a conflict is told from `_FORESEEN_S` ahead, where sensors tell of it; one that comes by
        a late turn is foreseen late.
        """
        apart, moved_mps = self._apart[:, :-1], self._moved / self._lasts_s[:, np.newaxis]
        squared = moved_mps[0] ** 2 + moved_mps[1] ** 2
        ahead_s = -(apart[0] * moved_mps[0] + apart[1] * moved_mps[1])
        ahead_s = np.clip(ahead_s / np.where(squared > 0.0, squared, 1.0), 0.0, _FORESEEN_S)
        north, east, up = apart + ahead_s * moved_mps
        inside = (north**2 + east**2 < horizontal_m**2) & (np.abs(up) < vertical_m)
        inside &= self._paths.time_s[:-1, np.newaxis] < until_s
        each_s = np.where(inside, self._lasts_s[:, np.newaxis], 0.0)
        # One after the other, so that a pair alone has the same bits as among many.
        return each_s.cumsum(axis=0)[-1] if len(each_s) else np.full(self._count, np.nan)

    def _closest_between_samples(self, step: IntArray, pair: IntArray) -> FloatArray:
        """Return closest approaches between samples (4, n): time, horizontal, vertical, range."""
        apart, moved = self._apart[:, step, pair], self._moved[:, step, pair]
        squared = (moved**2).sum(axis=0)
        part = -(apart * moved).sum(axis=0) / np.where(squared > 0.0, squared, 1.0)
        part = np.clip(part, 0.0, 1.0)
        north, east, up = apart + part * moved
        time_s = self._paths.time_s[step] + part * self._lasts_s[step]
        level_m = np.hypot(north, east)
        return np.array([time_s, level_m, np.abs(up), np.hypot(level_m, up)])

    def _velocities(self, step: IntArray, pair: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return velocities (2, n) north, east, m/s, between samples, of ownships and intruders."""
        own, other = (
            (at[:2, step + 1, pair] - at[:2, step, pair]) / self._lasts_s[step]
            for at in (self._paths.own_m, self._paths.other_m)
        )
        return own, other

    @staticmethod
    def _widen_size(size_m: float, sign: float) -> float:
        return size_m + sign * (_MARGIN_M + _MARGIN * size_m)


def _course_and_approach_bearing_deg(own: FloatArray, other: FloatArray) -> FloatArray:
    """Return the intruder's course and approach direction, relative to own course, deg."""
    ways = own, other, own - other
    heading, course, closing = (np.degrees(np.arctan2(way[1], way[0])) for way in ways)
    return np.array([course - heading, closing - heading])


def _enters_cylinder(
    apart: FloatArray, moved: FloatArray, horizontal_m: float, vertical_m: float
) -> BoolArray:
    """Return which straight movements from `apart` by `moved` ((3, n) each) enter the cylinder."""
    begin, end, crosses = _fractions_within_radius(apart, moved, horizontal_m)
    low, high = _fractions_within_height(apart[2], moved[2], vertical_m)
    first = np.maximum(np.maximum(begin, low), 0.0)
    last = np.minimum(np.minimum(end, high), 1.0)
    entered: BoolArray = crosses & (first < last)
    return entered


def _fractions_within_radius(
    apart: FloatArray, moved: FloatArray, horizontal_m: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return begin, end within a radius as fractions of straight movements; which enter (mask)."""
    north, east = apart[:2]
    a = moved[0] ** 2 + moved[1] ** 2
    b = north * moved[0] + east * moved[1]
    c = north**2 + east**2 - horizontal_m**2
    moves = a > 0.0
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    scale = np.where(moves, a, 1.0)
    begin = np.where(moves, (-b - root) / scale, np.where(c < 0.0, -np.inf, np.inf))
    end = np.where(moves, (-b + root) / scale, np.where(c < 0.0, np.inf, -np.inf))
    crosses: BoolArray = ~moves | (b * b > a * c)
    return begin, end, crosses


def _fractions_within_height(
    up: FloatArray, climbed: FloatArray, vertical_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return begin and end, as fractions of movements, of being vertically within `vertical_m`, not
    clipped to 0 to 1; of level movements -inf and inf if within, else inf and -inf.
    """
    climbs = climbed != 0.0
    rate = np.where(climbs, climbed, 1.0)
    edges = (-vertical_m - up) / rate, (vertical_m - up) / rate
    level = np.abs(up) < vertical_m
    low = np.where(climbs, np.minimum(*edges), np.where(level, -np.inf, np.inf))
    high = np.where(climbs, np.maximum(*edges), np.where(level, np.inf, -np.inf))
    return low, high
