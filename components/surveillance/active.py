"""Active surveillance, as TCAS has it: transponders are asked, and answer."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from components.arguments.units import FOOT_M
from components.geometry import wrap_pi_unchecked
from components.messages.detections import (
    LastingError,
    LastingPart,
    SensorOffer,
    range_and_report_interval_pairs,
)
from components.messages.reach import EVALUATE, Reach
from components.navigation.errors import position_and_attitude_deviations
from components.sensor.ladder_values import make_cell_measure
from components.sensor.look import Cells, Look
from components.sensor.parameters import check_field_of_view_elevations
from components.surveillance.altimetry import altimetry_variance_ft2
from components.surveillance.believed_line import (
    OwnBelief,
    line_of_sight_variances,
    ned_to_azimuth_elevation_range,
)
from components.surveillance.broadcast import Altimeters, Transponders
from components.surveillance.cooperative import (
    CooperativeParameters,
    CooperativeSensor,
    own_velocity,
)
from components.surveillance.extended_squitter import altitude_step_ft
from components.surveillance.interrogation import (
    CUT,
    IN_1_S,
    MODE_C_REACH_M,
    MODE_S_REACH_M,
    RANGE_BIAS_M,
    RANGE_CORRELATION_S,
    RANGE_ERROR_M,
    ROUND_S,
    ROUNDS,
    answer_probability_per_round,
    bearing_deviation_rad,
    is_met_within,
    sine_of_elevation,
    transponder_reach_m,
)
from components.surveillance.reports import empty_report_columns
from components.surveillance.stated_errors import (
    ERRORS_OF_REPLIES,
    empty_error_columns,
    position_variances_of_replies_m2,
)
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.gauss_markov import GaussMarkov

#: A rate of climb is that of the reported altitude over so long.
CLIMB_OVER_S = 5.0
_FARTHEST_M = max(MODE_S_REACH_M, *MODE_C_REACH_M)
_LEAST_M2 = 1e-4
#: So much of all else is taken to be new in every answer.
_WHITE_M2 = 0.25


class ActiveParameters(CooperativeParameters):
    """Parameters of active surveillance."""

    may_change: ClassVar[tuple[str, ...]] = ("mode_s_in_1_s", "mode_c_in_1_s")

    elevation_deg: Annotated[
        tuple[float, float], AfterValidator(check_field_of_view_elevations)
    ] = Field(default=(-15.0, 20.0), description="Elevations at which answers come, deg.")
    replies: Literal["certain", "rounds"] = Field(
        default="rounds",
        description="Whether all that are asked answer, or each with a probability in ten rounds "
        "of 0.1 s.",
    )
    mode_s_in_1_s: float = Field(
        default=IN_1_S[0], gt=0, lt=1, json_schema_extra={"unit": ""},
        description="Probability of a Mode S answer within 1 s.",
    )  # fmt: skip
    mode_c_in_1_s: float = Field(
        default=IN_1_S[1], gt=0, lt=1, json_schema_extra={"unit": ""},
        description="Probability of a Mode C answer within 1 s.",
    )  # fmt: skip
    measurement: Literal["exact", "do_365"] = Field(
        default="do_365",
        description="Errors of range, bearing and reported altitude: none, or those of DO-365.",
    )
    mode_s_step_ft: Literal[25, 100] = Field(
        default=25, description="Step of altitudes that Mode S reports, ft; Mode C has 100."
    )
    near_s: float = Field(
        default=60.0, ge=0,
        description="Aircraft that would be met within this time, by measured ranges, and new "
        "ones are interrogated at every scan, s.",
    )  # fmt: skip
    far_every: int = Field(
        default=5, ge=1, le=1000, description="Of others, one scan in so many asks each."
    )

    @model_validator(mode="after")
    def _check_sectors(self) -> Self:
        if self.range_km is not None and self.range_km * 1000.0 > _FARTHEST_M:
            raise ValueError(
                f"range_km is {self.range_km:g}: no transponder answers beyond "
                f"{_FARTHEST_M / 1000.0:.1f} km; it must be at most that"
            )
        return self

    def reach(self) -> Reach:
        """Return the reach; without ``range_km`` up to the farthest range of any reply."""
        reach = super().reach()
        return reach if self.range_km is not None else replace(reach, range_max_m=_FARTHEST_M)


def _answer_probabilities(active: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return the probability of an answer of each cell if it is asked."""
    return {"answers": active.answer_probability(cells)}


def _measured_ranges_and_altitudes(active: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return each cell's measured range and reported altitude, m."""
    every = np.arange(len(cells))
    return {
        "range": active.measured_range_m(cells, every),
        "altitude": active.reported_altitude_m(cells, every, cells.alt_m),
    }


REPLIES = Ladder(
    "replies",
    (
        Rung("certain", "whoever is asked answers", parameters={"replies": "certain"}),
        Rung("rounds", "ten rounds of 0.1 s (DO-365)", parameters={"replies": "rounds"}),
    ),
    "rounds",
    (Quantity("answers", ""),),
    make_cell_measure(_answer_probabilities),
)
MEASUREMENT = Ladder(
    "active measurement",
    (
        Rung("exact", "the truth", parameters={"measurement": "exact"}),
        Rung("do_365", "errors of DO-365", parameters={"measurement": "do_365"}),
    ),
    "do_365",
    (Quantity("range", "m"), Quantity("altitude", "m")),
    make_cell_measure(_measured_ranges_and_altitudes),
)


class Active(CooperativeSensor):
    """Asks transponders at its scans: range, coarse bearing, reported altitude, identity.

    An aircraft that is new, or may be met soon by the ranges measured of it, is asked at every
    scan, others at one in five, each in turn. Mode S answers with its address, Mode C without; how
    far, by sector. An answer counts if any of the last ten rounds of 0.1 s got one. The elevation
    is that of the reported altitude above the ownship's own. The confidence is the probability of
    an answer.

    Notes
    -----
    Numbers: RTCA DO-365, appendix Q. The stated variance of a range holds the delay of
    transponders, which is not known of any one of them.
    """

    Parameters = ActiveParameters
    hears_of = ("mode_s", "mode_c")
    ladders = (REPLIES, MEASUREMENT)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self._answers, self._bearings = self.stream("answers"), self.stream("bearing")
        self._ranges = GaussMarkov(self.stream("range"), RANGE_CORRELATION_S)
        self._altimeters = Altimeters(context.streams)
        self._errs = parameters.measurement != "exact"

    def offer(self, port: str) -> Any:
        """Return the offer: variances by reply, lasting range and elevation errors, reply rates."""
        offer: SensorOffer = super().offer(port)
        period_s, every = float(1 / self.p.scan_rate_hz), self.p.far_every
        # The delay of a transponder and the error of an altimeter stay; of a range what is stated
        # beyond the other errors, of an elevation nearly all.
        lasting = {
            "range": LastingError(parts=(
                LastingPart(RANGE_ERROR_M**2, RANGE_CORRELATION_S),
                LastingPart(-(RANGE_ERROR_M**2), share=1.0),
            )),
            "elevation": LastingError(parts=(LastingPart(share=1.0),)),
        }  # fmt: skip
        return replace(
            offer, azimuth_variance_rad2=None, elevation_variance_rad2=None,
            range_variance_m2=None, lasting=lasting if self._errs else {}, unstated_across_m2=0.0,
            promises=range_and_report_interval_pairs(
                period_s, [(math.inf, every * period_s)] if every > 1 else ()
            ),
            tells=self._errs, told_errors=ERRORS_OF_REPLIES if self._errs else (),
        )  # fmt: skip

    def answer_probability(self, cells: Cells) -> FloatArray:
        """Return the probability that each cell's aircraft answers if it is asked."""
        every = np.arange(len(cells))
        seen = cells.range_m, cells.body_azimuth_rad
        return self._answer_probability_at(cells, every, *seen, cells.state_ns)

    def _answer_probability_at(
        self, cells: Cells, which: AnyArray, range_m: FloatArray, azimuth_rad: FloatArray,
        instant_ns: IntArray,
    ) -> FloatArray:  # fmt: skip
        """Return chosen cells' answer probabilities; 0 out of reach or without a transponder."""
        equipage = cells.roster.equipage
        craft = cells.roster.equipage_rows(cells.craft[which], instant_ns)
        mode_s, mode_c = equipage.mode_s[craft], equipage.mode_c[craft]
        within = range_m <= transponder_reach_m(azimuth_rad, mode_s)
        in_1_s = np.where(mode_s, self.p.mode_s_in_1_s, self.p.mode_c_in_1_s)
        if self.p.replies == "certain":
            in_1_s = np.ones(len(range_m))
        return np.where(within & (mode_s | mode_c), in_1_s, 0.0)

    def look(self, cells: Cells) -> Look:
        """Interrogate the targets of the cells, and return the answers as a look."""
        probability = self.answer_probability(cells)
        detected = probability > 0.0
        asked = np.flatnonzero(detected)
        detected[asked] = self._is_interrogated(cells, asked)
        asked = np.flatnonzero(detected)
        if self.p.replies == "rounds":
            instant_ns = cells.state_ns[asked]
            detected[asked] = self._has_recent_answer(cells, asked, probability[asked], instant_ns)
        answered = np.flatnonzero(detected)
        now = self.reported_altitude_m(cells, answered, cells.alt_m[answered])
        detected[answered] = placed = self.has_position_counting_others(cells, answered, now)
        answered, now = answered[placed], now[placed]
        extras = empty_report_columns(len(cells))
        equipage, craft = cells.roster.equipage, cells.equipage_rows[answered]
        extras["address"][answered] = np.where(equipage.mode_s[craft], equipage.address[craft], -1)
        extras["reported_alt_m"][answered] = now
        extras["reported_s"][answered] = cells.state_ns[answered] / NANOSECONDS
        detected = self.is_heard_and_not_excluded(cells, detected, extras["address"])
        if len(answered):
            extras["reported_climb_m_s"][answered] = self._reported_climb_m_s(cells, answered, now)
        return Look(detected, probability, extras)

    def _is_interrogated(self, cells: Cells, which: AnyArray) -> BoolArray:
        """Return which aircraft are interrogated at this scan: near, new, or in their turn (mask).

        Near ones are known by the ranges measured at an aircraft's own last two turns, new ones by
        that it did not answer at one of them: it was not there, out of reach, or not heard.
        """
        if self.p.far_every == 1 or not len(which):
            return np.ones(len(which), dtype=bool)
        every = self.p.far_every
        turn = (cells.roster.draw_keys_of(cells.target[which]) % np.uint64(every)).astype(np.int64)
        due = (cells.scan[which] + turn) % every == 0
        rest = which[~due]
        if len(rest):
            period_s = 1.0 / float(self.p.scan_rate_hz)
            since_s = (cells.scan[rest] + turn[~due]) % every * period_s
            ranges, known = [], np.ones(len(rest), dtype=bool)
            for ago_s in (since_s, since_s + every * period_s):
                then = cells.relative_target_fields_ahead(rest, -ago_s)
                instant_ns = cells.state_ns[rest] - np.rint(ago_s * NANOSECONDS).astype(np.int64)
                known &= self._has_answered_at(cells, rest, then, instant_ns)
                ranges.append(self._add_range_errors(cells, rest, then["range_m"], instant_ns))
            rate = (ranges[0] - ranges[1]) / (every * period_s)
            due[~due] = ~known | is_met_within(ranges[0] + rate * since_s, rate, self.p.near_s)
        return np.asarray(due)

    def _has_answered_at(
        self, cells: Cells, which: AnyArray, then: Any, instant_ns: IntArray
    ) -> BoolArray:
        """Return which cells' aircraft, at positions `then`, answered at that instant (mask)."""
        azimuth, elevation = then["body_azimuth_rad"], then["body_elevation_rad"]
        there = then["present"] & (instant_ns >= 0)
        hidden = then.get("hidden")
        reason = self._reach_in_body_axes.skip_reasons(
            azimuth, elevation, then["range_m"], there, hidden
        )
        seen = then["range_m"], azimuth
        probability = self._answer_probability_at(cells, which, *seen, instant_ns)
        heard = np.asarray((reason == EVALUATE) & (probability > 0.0))
        if self.p.replies == "rounds":
            some = np.flatnonzero(heard)
            now_ns = instant_ns[some]
            heard[some] = self._has_recent_answer(cells, which[some], probability[some], now_ns)
        return heard

    def _has_recent_answer(
        self, cells: Cells, which: AnyArray, in_1_s: FloatArray, instant_ns: IntArray
    ) -> BoolArray:
        """Return where any of the last ten rounds (0.1 s each) got an answer, by draw (mask)."""
        last = instant_ns // round(ROUND_S * NANOSECONDS)
        rounds = last[:, np.newaxis] + ROUNDS - np.arange(ROUNDS)
        run = np.repeat(cells.run[which], ROUNDS)
        keys = np.repeat(cells.roster.draw_keys_of(cells.target[which]), ROUNDS)
        numbers = rounds.reshape(-1)
        over_ns = (numbers - ROUNDS) * round(ROUND_S * NANOSECONDS)
        drawn = self._answers.of_runs(run, over_ns).uniform(keys, numbers)
        p = answer_probability_per_round(in_1_s)[:, np.newaxis]
        return np.asarray((drawn.reshape(rounds.shape) < p).any(axis=1))

    def reported_altitude_m(
        self, cells: Cells, which: AnyArray, altitude_m: FloatArray
    ) -> FloatArray:
        """Return the altitudes that cells' transponders report for true altitudes, m."""
        step_ft = self._nominal_altitude_step_ft(cells, which) if self._errs else 0.0
        transponders = Transponders.from_cells(cells, which)
        altitude_m = self.pressure_altitude_m(altitude_m)
        return (
            self._altimeters.reported_altitude_ft(transponders, altitude_m, step_ft, self._errs)
            * FOOT_M
        )

    def _reported_climb_m_s(
        self, cells: Cells, detected: AnyArray, now_m: FloatArray
    ) -> FloatArray:
        """Return the reported mean climb over the last 5 s, m/s; NaN without a report 5 s ago."""
        then = cells.relative_target_fields_ahead(detected, np.full(len(detected), -CLIMB_OVER_S))
        before_m = self.reported_altitude_m(cells, detected, then["alt_m"])
        known = then["present"] & (cells.state_ns[detected] >= CLIMB_OVER_S * NANOSECONDS)
        return np.where(known, (now_m - before_m) / CLIMB_OVER_S, np.nan)

    def measured_range_m(self, cells: Cells, which: AnyArray) -> FloatArray:
        """Return cells' measured range, m, with transponder delay and random error."""
        return self._add_range_errors(cells, which, cells.range_m[which], cells.state_ns[which])

    def _add_range_errors(
        self, cells: Cells, which: AnyArray, range_m: FloatArray, instant_ns: IntArray
    ) -> FloatArray:
        if not self._errs:
            return range_m
        keys = cells.roster.draw_keys_of(cells.target[which])
        drawn = self._ranges(keys, instant_ns, run=cells.run[which])
        craft = cells.roster.equipage_rows(cells.craft[which], instant_ns)
        bias = np.where(cells.roster.equipage.mode_s[craft], *RANGE_BIAS_M)
        return np.maximum(range_m + bias + RANGE_ERROR_M * drawn, 1.0)

    def _measure(
        self,
        cells: Cells,
        detected: AnyArray,
        look: Look,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        range_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, Any]]:
        """Return measured lines of sight in body axes, and their variances."""
        own = OwnBelief.from_cells(cells, detected)
        distance = self.measured_range_m(cells, detected)
        deviation = bearing_deviation_rad(elevation_rad) * float(self._errs)
        keys, bearings = cells.roster.draw_keys_of(cells.target[detected]), self._bearings
        bearings = bearings.of_runs(cells.run[detected], cells.instant_ns[detected])
        drawn = bearings.normal(keys, cells.scan[detected])
        # The bearing is off the nose; the altitude, and so the elevation, is of no axes.
        turned = own.yaw_rad - cells.own_attitude[0][detected]
        bearing = cells.azimuth_rad[detected] + turned + deviation * np.clip(drawn, -CUT, CUT)
        altitude = look.extras["reported_alt_m"][detected]
        height = self.heights_from_altitudes_m(cells, detected, altitude)
        rise = sine_of_elevation(height - own.alt_m, distance)
        ground = np.sqrt(np.maximum(1.0 - rise**2, 0.0))
        ned = distance * np.stack([ground * np.cos(bearing), ground * np.sin(bearing), -rise])
        azimuth, elevation, _ = ned_to_azimuth_elevation_range(own, ned)
        variances = (np.full(len(detected), _LEAST_M2),) * 3
        if self._errs:
            position_m, attitude_rad = position_and_attitude_deviations(self.context)
            variances = position_variances_of_replies_m2(
                ned, deviation**2 + attitude_rad[0] ** 2, max(position_m[:2]) ** 2, altitude,
                self._altitude_step_ft(cells, detected, altitude),
                cells.roster.equipage.mode_s[cells.equipage_rows[detected]],
            )  # fmt: skip
        across, along, vertical = variances
        vertical = vertical + self.p.pressure_deviation_m**2
        beside: dict[str, Any] = line_of_sight_variances(own, ned, (across, along, vertical))
        if self._errs:
            beside["told_by_target"] = self._error_deviations(cells, detected, altitude, deviation)
        return wrap_pi_unchecked(azimuth), elevation, distance, beside

    def _error_deviations(
        self, cells: Cells, detected: AnyArray, altitude_m: FloatArray, deviation: FloatArray
    ) -> dict[str, FloatArray]:
        """Return standard deviations of replies' errors, and ownship velocity, by `TOLD` name."""
        none = np.zeros(len(detected))
        mode_s = cells.roster.equipage.mode_s[cells.equipage_rows[detected]]
        position_m, attitude_rad = position_and_attitude_deviations(self.context)
        own = own_velocity(cells, detected)
        altimetry_ft2 = altimetry_variance_ft2(altitude_m / FOOT_M)
        step_ft = self._altitude_step_ft(cells, detected, altitude_m)
        return empty_error_columns(len(detected)) | {
            "own_north": own[0], "own_east": own[1], "own_down": own[2],
            "height_deviation": np.hypot(
                np.sqrt(altimetry_ft2) * FOOT_M, self.p.pressure_deviation_m
            ),
            "rounding_deviation": step_ft * FOOT_M / math.sqrt(12.0),
            "bearing_deviation": np.hypot(deviation, attitude_rad[0]),
            "delay_deviation": np.where(mode_s, *RANGE_BIAS_M),
            "range_deviation": none + RANGE_ERROR_M,
            "white_variance": none + _WHITE_M2 + max(position_m) ** 2,
        }  # fmt: skip

    def _altitude_step_ft(
        self, cells: Cells, which: AnyArray, altitude_m: FloatArray
    ) -> FloatArray:
        return altitude_step_ft(altitude_m / FOOT_M, self._nominal_altitude_step_ft(cells, which))

    def _nominal_altitude_step_ft(self, cells: Cells, which: AnyArray) -> FloatArray:
        mode_s = cells.roster.equipage.mode_s[cells.equipage_rows[which]]
        return np.where(mode_s, float(self.p.mode_s_step_ft), 100.0)
