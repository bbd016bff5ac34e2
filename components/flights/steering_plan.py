"""What is flown after a manoeuvre: turns, climbs and speeds side by side, as legs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from components.arguments.units import STANDARD_GRAVITY_M_S2
from components.flights.leg_motion import LARGEST_TURN_RADIUS_M, Segment
from components.flights.legs import Straight, Turn, segments_of_each
from components.flights.point_mass import eased_turn_durations_and_rates
from components.flights.scripted_flights import MOST_ALT_M, ScriptedTrajectory
from components.geometry import (
    TrajectoryState,
    heading_rad_from_deg,
    line_of_sight_ned,
    wrap_longitude_deg,
)
from components.messages.steering import Manoeuvre
from dsa_des.arrays.types import FloatArray

# Changes of speed are flown in steps no longer than this, each at its mean speed: with 2 m/s² the
# position is right to 0.0625 m on the way, and exact at the end.
_SPEED_STEP_S = 0.5
# Track and speed are taken over this time around a manoeuvre: right to 1e-4 in a turn of 3 deg/s.
_BASE_S = 0.5
_SHORTEST_PIECE_S = 1e-9
# A roll into a turn is flown in so many arcs: at 60 kt to 45 deg of bank it ends 2 cm off.
_ROLL_PIECES = 16
# Who is slower banks without turning: no rate is taken of less.
_SLOWEST_BANKED_MPS = 1.0

#: How long, s, at which mean rate, and how that changes each second; one after the other.
Pieces = tuple[tuple[float, float, float], ...]


def times_around_s(time_s: FloatArray) -> FloatArray:
    """Return three times (n, 3) for each (n,): shortly before, at and after it, none before 0."""
    ends = [np.maximum(time_s - _BASE_S, np.minimum(time_s, 0.0)), time_s, time_s + _BASE_S]
    return np.stack(ends, axis=-1)


class Turning(NamedTuple):
    """How an aircraft turns when a manoeuvre begins: track, turn rate, and turn in a second."""

    track_rad: float
    rate_rad_s: float
    turned_rad: float

    def eased_pieces(self, manoeuvre: Manoeuvre, speed_mps: float) -> Pieces:
        """Return the pieces of an eased turn to the manoeuvre's heading, the shorter way round."""
        left_rad = math.remainder(manoeuvre.heading_rad - self.track_rad, 2.0 * math.pi)
        rates = eased_turn_durations_and_rates(
            left_rad,
            left_rad + self.turned_rad,
            self.rate_rad_s,
            max(speed_mps, 1.0),
            manoeuvre.rate_rad_s,
            manoeuvre.eases_rad,
        )
        return tuple((lasts_s, rate_deg_s, 0.0) for lasts_s, rate_deg_s in rates)


class SteeringPlan(NamedTuple):
    """What is still to be flown, in parallel: pieces of turns (deg/s), of climbs and of ground
    speeds (m/s); after them straight flight at the remaining climb and speed.
    """

    turns: Pieces
    climbs: Pieces
    climb_mps: float
    speeds: Pieces
    speed_mps: float

    def remaining_after(self, elapsed_s: float) -> SteeringPlan:
        """Return the rest of the plan after some time."""
        return self._replace(
            turns=_remaining_pieces(self.turns, elapsed_s),
            climbs=_remaining_pieces(self.climbs, elapsed_s),
            speeds=_remaining_pieces(self.speeds, elapsed_s),
        )

    def with_manoeuvre(self, manoeuvre: Manoeuvre, alt_m: float, turning: Turning) -> SteeringPlan:
        """Return the plan changed by a manoeuvre at an altitude; what it does not command stays."""
        plan = self
        speed_now_mps = _mean_rate_of_first_piece(self.speeds, 0.0, self.speed_mps)
        if manoeuvre.eases_rad > 0.0:
            plan = plan._replace(turns=turning.eased_pieces(manoeuvre, speed_now_mps))
        elif manoeuvre.turn_rad != 0.0:
            plan = plan._replace(turns=_turn_pieces(manoeuvre, speed_now_mps))
        if manoeuvre.vertical_speed_mps != 0.0:
            climb_mps = _mean_rate_of_first_piece(self.climbs, 0.0, self.climb_mps)
            plan = plan._replace(
                climbs=_speed_change_pieces(
                    climb_mps, manoeuvre.vertical_speed_mps, manoeuvre.vertical_acceleration_mps2
                ),
                climb_mps=climb_mps + manoeuvre.vertical_speed_mps,
            )
        elif manoeuvre.climb_m != 0.0:
            rate_mps = math.copysign(manoeuvre.climb_rate_mps, manoeuvre.climb_m)
            rise_s = (alt_m + manoeuvre.climb_m - alt_m) / rate_mps
            plan = plan._replace(
                climbs=((rise_s, rate_mps, 0.0),) if rise_s > 0.0 else (), climb_mps=0.0
            )
        if manoeuvre.speed_mps != 0.0:
            speed_mps = _mean_rate_of_first_piece(self.speeds, 0.0, self.speed_mps)
            change = max(manoeuvre.speed_mps, -speed_mps)
            plan = plan._replace(
                speeds=_speed_change_pieces(speed_mps, change, manoeuvre.acceleration_mps2),
                speed_mps=speed_mps + change,
            )
        return plan

    def legs(self) -> list[Straight | Turn]:
        """Return the plan as legs of constant rates; the last one never ends."""
        legs: list[Straight | Turn] = []
        plan = self
        while plan.turns or plan.climbs or plan.speeds:
            parts = plan.turns, plan.climbs, plan.speeds
            lasts_s = min(part[0][0] for part in parts if part)
            climb_mps = _mean_rate_of_first_piece(plan.climbs, lasts_s, plan.climb_mps)
            speed_mps = max(_mean_rate_of_first_piece(plan.speeds, lasts_s, plan.speed_mps), 0.0)
            rate_deg_s = plan.turns[0][1] if plan.turns else 0.0
            legs.append(_leg(lasts_s, speed_mps, climb_mps, rate_deg_s))
            plan = plan.remaining_after(lasts_s)
        return [*legs, _leg(None, plan.speed_mps, plan.climb_mps)]


def _leg(
    lasts_s: float | None, speed_mps: float, climb_mps: float, rate_deg_s: float = 0.0
) -> Straight | Turn:
    """Return a leg without validating it, as the values of a plan are valid already."""
    flown: dict[str, Any] = {
        "duration_s": lasts_s, "speed_mps": speed_mps, "climb_mps": climb_mps,
    }  # fmt: skip
    if rate_deg_s:
        return Turn.model_construct(**flown, rate_deg_s=rate_deg_s)
    return Straight.model_construct(**flown)


def _turn_pieces(manoeuvre: Manoeuvre, speed_mps: float) -> Pieces:
    """Return the pieces of a turn at a ground speed: while the bank grows, then one steady."""
    rate_rad_s = manoeuvre.rate_rad_s
    if manoeuvre.bank_rad:
        slowest_mps = max(speed_mps, _SLOWEST_BANKED_MPS)
        rate_rad_s = STANDARD_GRAVITY_M_S2 * math.tan(manoeuvre.bank_rad) / slowest_mps
    rate_deg_s = math.copysign(math.degrees(rate_rad_s), manoeuvre.turn_rad)
    angle_rad = math.radians(math.degrees(abs(manoeuvre.turn_rad)))
    rolling: Pieces = ()
    if manoeuvre.roll_rate_rad_s:
        rolling = _roll_in_pieces(angle_rad, rate_rad_s, manoeuvre.roll_rate_rad_s, speed_mps)
        angle_rad -= math.radians(sum(lasts_s * mean for lasts_s, mean, _ in rolling))
        sign = math.copysign(1.0, manoeuvre.turn_rad)
        rolling = tuple((lasts_s, sign * mean, 0.0) for lasts_s, mean, _ in rolling)
    rest_s = angle_rad / abs(math.radians(rate_deg_s))
    return (*rolling, (rest_s, rate_deg_s, 0.0)) if rest_s > _SHORTEST_PIECE_S else rolling


def _roll_in_pieces(
    angle_rad: float, rate_rad_s: float, roll_rad_s: float, speed_mps: float
) -> Pieces:
    """Return the first pieces of a turn, with steadily growing bank, each at its mean rate (deg/s).

    With the bank p t the rate is g tan(p t) / v, and the change of heading after t is
    -g / (v p) ln cos(p t). The first piece is longer where the turn would hardly show in it.
    """
    per_rad = speed_mps * roll_rad_s / STANDARD_GRAVITY_M_S2
    if not per_rad:
        return ()
    full_rad = math.atan(rate_rad_s * speed_mps / STANDARD_GRAVITY_M_S2)
    lasts_s = min(full_rad, math.acos(math.exp(-angle_rad * per_rad))) / roll_rad_s
    ends_s = [lasts_s * k / _ROLL_PIECES for k in range(_ROLL_PIECES + 1)]
    turned_rad = [-math.log(math.cos(roll_rad_s * end_s)) / per_rad for end_s in ends_s]
    first = next(
        (
            k
            for k in range(1, _ROLL_PIECES)
            if speed_mps * ends_s[k] < 0.5 * LARGEST_TURN_RADIUS_M * turned_rad[k]
        ),
        _ROLL_PIECES,
    )
    kept = [0, *range(first, _ROLL_PIECES + 1)]
    return tuple(
        (
            ends_s[end] - ends_s[begin],
            math.degrees((turned_rad[end] - turned_rad[begin]) / (ends_s[end] - ends_s[begin])),
            0.0,
        )
        for begin, end in itertools.pairwise(kept)
    )


def _remaining_pieces(pieces: Pieces, elapsed_s: float) -> Pieces:
    for number, (lasts_s, mean, change) in enumerate(pieces):
        # What rounding leaves of a piece is none.
        if elapsed_s < lasts_s - _SHORTEST_PIECE_S:
            gone_s = max(elapsed_s, 0.0)
            return ((lasts_s - gone_s, mean + 0.5 * change * gone_s, change), *pieces[number + 1 :])
        elapsed_s -= lasts_s
    return ()


def _mean_rate_of_first_piece(pieces: Pieces, first_s: float, without: float) -> float:
    """Return the mean rate over the first ``first_s`` of the first piece; ``without`` if none."""
    if not pieces:
        return without
    lasts_s, mean, change = pieces[0]
    return mean - 0.5 * change * (lasts_s - first_s)


class SteeredPart(ScriptedTrajectory):
    """The flight after a manoeuvre, with the plan that it follows."""

    plan: SteeringPlan


def steered_parts(
    name: str,
    around: TrajectoryState,
    time_s: FloatArray,
    manoeuvres: Sequence[Manoeuvre],
    before: Sequence[SteeredPart | None],
) -> list[SteeredPart]:
    """Return for each aircraft the part of its flight that begins with its manoeuvre.

    `around` says where each would be without it, (n, 3), at `times_around_s`. Parts of an
    earlier manoeuvre, `before`, that are not commanded anew go on.
    """
    starts: list[_Start] = []
    ways = displacements_around(around, time_s) if any(one is None for one in before) else []
    rows = zip(time_s.tolist(), manoeuvres, before, strict=True)
    for row, (at_s, manoeuvre, earlier) in enumerate(rows):
        low, here, high = around.alt_m[row].tolist()
        position = float(around.lat_deg[row, 1]), float(around.lon_deg[row, 1]), here
        if earlier is None:
            north_m, east_m, base_s = ways[row]
            heading_deg = math.degrees(math.atan2(east_m, north_m))
            speed_mps = math.hypot(north_m, east_m) / base_s
            plan = SteeringPlan(
                (), (), _kept_climb_mps((high - low) / base_s, manoeuvre), (), speed_mps
            )
            turned_rad = math.remainder(
                float(around.yaw_rad[row, 2] - around.yaw_rad[row, 0]), 2.0 * math.pi
            )
            rate_rad_s = turned_rad / base_s
        else:
            heading_deg = math.degrees(float(around.yaw_rad[row, 1]))
            elapsed_s = at_s - earlier.start_time_s
            plan = earlier.plan.remaining_after(elapsed_s)
            turned_rad = math.radians(
                _turned_angle_deg(earlier.plan.turns, elapsed_s)
                - _turned_angle_deg(earlier.plan.turns, elapsed_s - 1.0)
            )
            rate_rad_s = math.radians(_mean_rate_of_first_piece(plan.turns, 0.0, 0.0))
        turning = Turning(math.radians(heading_deg), rate_rad_s, turned_rad)
        plan = plan.with_manoeuvre(manoeuvre, here, turning)
        starts.append(_Start(name, position, heading_deg, at_s, plan))
    new = [start for start in dict.fromkeys(starts) if start not in _KNOWN]
    _KNOWN.update(zip(new, _fly_plans(new), strict=True))
    flown = [_KNOWN[start] for start in starts]
    while len(_KNOWN) > _MOST_KNOWN:
        del _KNOWN[next(iter(_KNOWN))]
    return flown


def displacements_around(around: TrajectoryState, time_s: FloatArray) -> list[list[float]]:
    """Return displacements from shortly before to after each time: north, east (m) and time (s).

    Its ends are seen from its middle, so that the track is the one there.
    """
    positions = around.lat_deg, around.lon_deg, around.alt_m
    middle, ends = [part[:, 1:2] for part in positions], [part[:, [0, 2]] for part in positions]
    north, east, _ = line_of_sight_ned(*middle, *ends)
    ways = north[:, 1] - north[:, 0], east[:, 1] - east[:, 0]
    return np.stack([*ways, np.ptp(times_around_s(time_s), axis=1)], axis=-1).tolist()


def _turned_angle_deg(turns: Pieces, elapsed_s: float) -> float:
    """Return the angle (deg, to the right) that the turns have covered after some time."""
    turned_deg, left_s = 0.0, elapsed_s
    for lasts_s, rate_deg_s, _ in turns:
        if left_s <= 0.0:
            break
        turned_deg += min(lasts_s, left_s) * rate_deg_s
        left_s -= lasts_s
    return turned_deg


def _kept_climb_mps(climb_mps: float, manoeuvre: Manoeuvre) -> float:
    """Return the climb rate (m/s) a manoeuvre keeps: 0 if a turn or altitude change ends it."""
    turns = manoeuvre.turn_rad != 0.0 or manoeuvre.eases_rad > 0.0
    ends = turns or manoeuvre.climb_m != 0.0
    return 0.0 if ends and manoeuvre.vertical_speed_mps == 0.0 else climb_mps


class _Start(NamedTuple):
    """The name, position, heading and time from which a plan is flown."""

    name: str
    position: tuple[float, float, float]
    heading_deg: float
    time_s: float
    plan: SteeringPlan


#: A study's metrics fly again what its runs flew.
_KNOWN: dict[_Start, SteeredPart] = {}
_MOST_KNOWN = 4096
_FEW = 2


def _fly_plans(starts: Sequence[_Start]) -> list[SteeredPart]:
    """Return the parts flown by several plans from their starts, as if flown one by one."""
    legs = [start.plan.legs() for start in starts]
    if len(starts) > _FEW:
        headings = np.array([heading_rad_from_deg(start.heading_deg) for start in starts])
        lat_deg, lon_deg, alt_m = np.array([start.position for start in starts]).T
        speeds = [start.plan.speed_mps for start in starts]
        known = np.isfinite([lat_deg, lon_deg, alt_m, headings, speeds])
        if known.all() and np.abs(alt_m).max() <= MOST_ALT_M and min(speeds) >= 0.0:
            with suppress(ValueError):
                here = lat_deg, wrap_longitude_deg(lon_deg), alt_m
                segments = segments_of_each(here, headings, legs)
                return [_part(*both) for both in zip(starts, segments, strict=True)]
    return [  # each by itself, which of a few takes less time, and says what is wrong
        _part(start, ScriptedTrajectory(
            start.name,
            lat_deg=start.position[0], lon_deg=start.position[1], alt_m=start.position[2],
            heading_deg=start.heading_deg, speed_mps=start.plan.speed_mps, legs=mine,
            start_time_s=start.time_s,
        ).segments)
        for start, mine in zip(starts, legs, strict=True)
    ]  # fmt: skip


def _part(start: _Start, segments: list[Segment]) -> SteeredPart:
    free = (None, None, None)
    part = SteeredPart.of_segments_unchecked(start.name, segments, free, start.time_s, math.inf)
    part.plan = start.plan
    return part


def _speed_change_pieces(from_mps: float, change_mps: float, acceleration_mps2: float) -> Pieces:
    """Return a steady change of speed as pieces of equal length, each at its mean speed."""
    time_s = abs(change_mps) / acceleration_mps2
    count = max(math.ceil(time_s / _SPEED_STEP_S), 1)
    lasts_s = max(time_s / count, 1e-9)
    rate_mps2 = math.copysign(acceleration_mps2, change_mps)
    return tuple(
        (lasts_s, from_mps + change_mps * (k + 0.5) / count, rate_mps2) for k in range(count)
    )
