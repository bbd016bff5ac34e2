"""What is stated of the errors of what aircraft say: variances, and what of them lasts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from components.aircraft.equipage import Equipage
from components.arguments.units import FOOT_M, FOOT_PER_MINUTE_M_S, KNOT_M_S
from components.estimation.carried_errors import (
    BEARING,
    CLIMB,
    EAST,
    HEIGHT,
    LATENCY,
    NORTH,
    RANGE,
    SPEED_EAST,
    SPEED_NORTH,
)
from components.messages.columns import TOLD
from components.messages.detections import LastingError, LastingPart, ToldError
from components.surveillance.altimetry import altimetry_variance_ft2
from components.surveillance.broadcast import CLIMB_SCALE_M_S, CORRELATION_TIME_S
from components.surveillance.extended_squitter import (
    ALTITUDE_STEP_FT,
    altitude_step_ft,
    speed_step_kt,
)
from components.surveillance.interrogation import RANGE_BIAS_M, RANGE_CORRELATION_S, RANGE_ERROR_M
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

#: Mean square error of a compact position in each axis: 360/60 degrees in 2^17 parts.
_COMPACT_M2 = (6.0 * 111_195.0 / 2**17) ** 2 / 12.0
#: What an aircraft without a velocity may have, a deviation; and how much another one changes its
#: own on the way from a message to a scan, where no filter says so by its own motion.
_UNKNOWN_M_S, _MANOEUVRE_M_S2 = 100.0, 1.0
#: An aircraft that sends the truth still has an error to a filter: a centimetre, or one per second.
_LEAST_M2 = 1e-4


def lasting_position_errors(
    position_errors: str, is_geometric: bool = False
) -> dict[str, LastingError]:
    """Return, by quantity, ADS-B position errors that stay correlated; empty without errors."""
    if position_errors == "none":
        return {}
    lasts_s = {} if is_geometric else {"elevation": math.inf}  # an aircraft keeps its altimeter
    if position_errors == "gauss_markov":
        for name in ("azimuth", "elevation", "range", "range_rate"):
            lasts_s.setdefault(name, CORRELATION_TIME_S)
    return {
        name: LastingError(parts=(LastingPart(lasts_s=time_s, share=1.0),))
        for name, time_s in lasts_s.items()
    }


#: The altimeter of an aircraft, which speaks through its broadcasts and its replies.
ALTIMETER = ToldError(HEIGHT, "height_deviation", math.inf)
#: What is new in each height: its rounding, of one that climbs; and in each vertical rate, by which
#: heights are carried on.
ROUNDING = ToldError(HEIGHT, "rounding_deviation", 0.0, of_aircraft=False)
VERTICAL_RATE = ToldError(CLIMB, "climb_deviation", 0.0, of_aircraft=False)


#: By how long all positions of an aircraft are late: what of its latency it does not compensate.
LATE = ToldError(LATENCY, "latency_deviation", math.inf)
#: Of what answers to interrogations tell.
ERRORS_OF_REPLIES = (
    ALTIMETER,
    ROUNDING,
    ToldError(BEARING, "bearing_deviation", 0.0, of_aircraft=False),
    ToldError(RANGE, "delay_deviation", math.inf),
    ToldError(RANGE, "range_deviation", RANGE_CORRELATION_S, of_aircraft=False),
)


def told_errors_of_broadcast(position_errors: str, is_geometric: bool) -> tuple[ToldError, ...]:
    """Return the kinds of error that broadcasts state, and how long each stays correlated."""
    lasts_s = 0.0 if position_errors == "white" else CORRELATION_TIME_S
    ways = {"place_deviation": (NORTH, EAST), "speed_deviation": (SPEED_NORTH, SPEED_EAST)}
    level = [ToldError(way, told, lasts_s) for told, both in ways.items() for way in both]
    height = replace(ALTIMETER, lasts_s=lasts_s) if is_geometric else ALTIMETER
    return (*level, height, ROUNDING, VERTICAL_RATE)


def empty_error_columns(count: int) -> dict[str, FloatArray]:
    """Return empty `TOLD` columns for `count` reports: 0 for deviations, ages; NaN for others."""
    none, unknown = np.zeros(count), np.full(count, np.nan)
    return {name: none if name.endswith(("deviation", "age_s")) else unknown for name in TOLD}


def position_variances_of_replies_m2(
    ned_m: FloatArray,
    bearing_rad2: FloatArray,
    place_m2: float,
    altitude_m: FloatArray,
    step_ft: FloatArray,
    mode_s: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return replies' position variances, m²: across and along the line of sight, and vertical.

    Bearing and range are counted from the ownship's own place, which has `place_m2`; the altitude
    is that of no pose.
    """
    across = np.hypot(ned_m[0], ned_m[1]) ** 2 * bearing_rad2 + place_m2
    along = RANGE_ERROR_M**2 + np.where(mode_s, *RANGE_BIAS_M) ** 2 + place_m2
    feet2 = altimetry_variance_ft2(altitude_m / FOOT_M) + step_ft**2 / 12.0
    return np.maximum(across, _LEAST_M2), along, feet2 * FOOT_M**2


@dataclass(frozen=True)
class StatedByAircraft:
    """Errors and ages that some aircraft state of their reports through quality categories.

    `errs` and `rounds` say whether what they send has errors, and is rounded; pressure altitudes
    are off heights by so much beside, unless it is their geometric heights that are taken.
    """

    equipage: Equipage
    craft: IntArray
    said: dict[str, AnyArray]
    errs: bool
    rounds: bool
    pressure_deviation_m: float = 0.0
    is_geometric: bool = False

    @property
    def velocity_axis_variance_m2_s2(self) -> FloatArray:
        """Mean square error of the north and of the east velocity, m²/s², (n,)."""
        square = self.equipage.velocity_deviation_m_s[self.craft] ** 2
        speed = np.where(self.errs, square, _LEAST_M2)
        return speed + self._speed_rounding_m2_s2

    @property
    def _speed_rounding_m2_s2(self) -> FloatArray:
        if not self.rounds:
            return np.zeros(len(self.craft))
        north, east = (self.said[f"reported_{axis}_m_s"] / KNOT_M_S for axis in ("north", "east"))
        rounding: FloatArray = (speed_step_kt(north, east) * KNOT_M_S) ** 2 / 12.0
        return rounding

    @property
    def _height_rounding_m2(self) -> FloatArray:
        step = altitude_step_ft(self.said["reported_alt_m"] / FOOT_M, ALTITUDE_STEP_FT)
        rounding: FloatArray = self.rounds * (step * FOOT_M) ** 2 / 12.0
        if self.is_geometric and self.rounds:  # and its difference from the altitude is
            rounding = rounding + (ALTITUDE_STEP_FT * FOOT_M) ** 2 / 12.0
        return rounding

    @property
    def position_lag_s(self) -> FloatArray:
        """Time, s, that reported positions lag by uncompensated latency; 0 without velocity."""
        known = ~np.isnan(self.said["reported_north_m_s"])
        return np.where(known, self.equipage.uncompensated_latency_s[self.craft], 0.0)

    def extrapolation_time_s(self, age_s: FloatArray) -> FloatArray:
        """Return positions' total extrapolation time: age and what the aircraft compensates itself.

        Without a velocity of theirs nobody carries them on, and they are as old as they are.
        """
        known = ~np.isnan(self.said["reported_north_m_s"])
        own_s = self.equipage.latency_s, self.equipage.compensated_s
        latency_s, compensated_s = (one[self.craft] for one in own_s)
        return age_s + np.where(known, compensated_s, latency_s)

    def position_variances_m2(self, age_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return variances (m²) of extrapolated positions: two horizontal axes, then vertical.

        What they are late by (`position_lag_s`) is beside these.
        """
        square = self.equipage.position_deviation_m[self.craft] ** 2
        level = np.where(self.errs, square, _LEAST_M2)
        feet = self.said["reported_alt_m"] / FOOT_M
        altimetry = altimetry_variance_ft2(feet) * FOOT_M**2
        if self.is_geometric:
            altimetry = self.equipage.height_deviation_m[self.craft] ** 2
        high = np.where(self.errs, altimetry, _LEAST_M2)
        if self.pressure_deviation_m and not self.is_geometric:
            high = high + self.pressure_deviation_m**2
        if self.rounds:
            level = level + _COMPACT_M2
            high = high + self._height_rounding_m2
        # Without a velocity an aircraft may have gone anywhere at the speed of one.
        moving = ~np.isnan(self.said["reported_north_m_s"])
        level = (
            level
            + np.where(moving, self.velocity_axis_variance_m2_s2, _UNKNOWN_M_S**2)
            * self.extrapolation_time_s(age_s) ** 2
        )
        return level, level, high

    def velocities_and_errors(
        self, north_east_down_m_s: FloatArray, velocity_age_s: FloatArray, age_s: FloatArray
    ) -> dict[str, FloatArray]:
        """Return velocities, and stated velocity and position errors, by column in `TOLD`."""
        climb = 2.0 * CLIMB_SCALE_M_S**2 if self.errs else 0.0
        climb += (64.0 * FOOT_PER_MINUTE_M_S) ** 2 / 12.0 if self.rounds else 0.0
        none = np.zeros(len(age_s))
        tells = (
            (self.position_lag_s > 0.0)
            | self.errs
            | self.rounds
            | (self.pressure_deviation_m > 0.0)
        )
        carried_s, latency_s = self.extrapolation_time_s(age_s), self.equipage.latency_s[self.craft]
        # Where errors are stated, filters know how targets move on the way.
        turned = np.where(tells, 0.0, _MANOEUVRE_M_S2 * (velocity_age_s + latency_s)) ** 2
        # Whole knots last while a flight is steady and are new while it is not: counted as both.
        new = turned + _LEAST_M2 + self._speed_rounding_m2_s2
        variances = new, new, turned + _LEAST_M2
        velocity = dict(zip(TOLD[:6], (*north_east_down_m_s, *variances), strict=True))
        known = ~np.isnan(north_east_down_m_s[0])
        rounding_m2 = self._height_rounding_m2
        _, _, high = self.position_variances_m2(none)
        # Without a velocity an aircraft may have gone anywhere at the speed of one.
        carried_m = np.where(known, 0.0, _UNKNOWN_M_S) * carried_s
        white = (_COMPACT_M2 if self.rounds else 0.0) + _LEAST_M2 + carried_m**2
        position = self.equipage.position_deviation_m[self.craft] if self.errs else none
        told = empty_error_columns(len(age_s)) | {
            "place_deviation": position,
            "height_deviation": np.sqrt(np.maximum(high - rounding_m2, 0.0)),
            "rounding_deviation": np.sqrt(rounding_m2),
            "climb_deviation": none + math.sqrt(climb),
            "speed_deviation": np.sqrt(self.velocity_axis_variance_m2_s2),
            "latency_deviation": self.position_lag_s,
            "age_s": np.where(known, carried_s, 0.0),
            "velocity_age_s": np.where(known, velocity_age_s + latency_s, 0.0),
            "white_variance": white,
        }  # fmt: skip
        return {name: np.where(tells, one, np.nan) for name, one in told.items()} | velocity
