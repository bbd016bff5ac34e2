"""A receiver of ADS-B: the squitters that come through, put together into reports."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.known_targets import offered_rosters
from components.geometry import POSITION_FIELDS, line_of_sight_ned
from components.messages.columns import OWN_VELOCITY, TOLD
from components.messages.detections import Detections, SensorOffer, range_and_report_interval_pairs
from components.messages.reach import Reach
from components.navigation.errors import displaced_lat_lon_alt
from components.sensor.ladder_values import make_cell_measure
from components.sensor.look import Cells, Look
from components.surveillance.believed_line import (
    OwnBelief,
    line_of_sight_variances,
    ned_from_believed_position_m,
    ned_to_azimuth_elevation_range,
)
from components.surveillance.broadcast import (
    Broadcasts,
    Sent,
    Transponders,
    velocity_in_axes_of_later_position,
)
from components.surveillance.cooperative import (
    STEP_S,
    CooperativeParameters,
    CooperativeSensor,
    own_velocity,
    velocity_ned_from_positions,
)
from components.surveillance.reception import (
    AIRCRAFT_AROUND,
    AIRPORTS_AROUND,
    LAWS,
    fitted_reception_probability,
    reception_time_steps,
)
from components.surveillance.reports import empty_report_columns
from components.surveillance.squitter_clock import SHORTEST_S, SquitterClocks
from components.surveillance.stated_errors import (
    LATE,
    StatedByAircraft,
    lasting_position_errors,
    told_errors_of_broadcast,
)
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.wake import Wake
from dsa_des.time.clock import NANOSECONDS, ticks_to_nanoseconds

#: Longest time that a message counts for: nobody is reported by older ones.
LONGEST_S = 5.0


class AdsBParameters(CooperativeParameters):
    """Parameters of a receiver of ADS-B."""

    may_change: ClassVar[tuple[str, ...]] = ("aircraft_around", "airports_around")

    reception: Literal["certain", "do_365", "fitted"] = Field(
        default="fitted",
        description="Probability over range that a squitter is received: 1; the steps of DO-365 to "
        "20 nmi; the law fitted to 23 receivers, to 290 nmi.",
    )
    aircraft_around: float = Field(
        default=AIRCRAFT_AROUND, ge=0, le=300,
        description="Aircraft that a receiver of the fitted law hears besides, whose messages "
        "garble each other; the median of the 23 receivers is 95.",
    )  # fmt: skip
    airports_around: float = Field(
        default=AIRPORTS_AROUND, ge=20, le=100,
        description="Airports around a receiver of the fitted law, which stand for the aircraft "
        "that are low.",
    )  # fmt: skip
    position_errors: Literal["none", "white", "gauss_markov"] = Field(
        default="gauss_markov",
        description="Errors of what aircraft send, by their NACp and NACv and of their altimeters: "
        "none, new with each message, or lasting 300 s (DO-365).",
    )
    compact: bool = Field(
        default=True,
        description="Whether values are rounded as in the messages: compact positions, 25 ft, "
        "whole knots, 64 ft/min.",
    )
    heights: Literal["reported", "by_own_altimeter", "geometric"] = Field(  # type: ignore[assignment]
        default="reported",
        description="What reported pressure altitudes are taken for: 'reported', heights as they "
        "are; 'by_own_altimeter', heights once the difference between the ownship's own pressure "
        "altitude and its height by navigation is taken off. 'geometric': the heights above the "
        "ellipsoid that aircraft send with their velocities are taken in their place (ads_b.gva); "
        "who sends none is not placed.",
    )
    velocity_age_s: float = Field(
        default=3.0, ge=0.5, le=LONGEST_S,
        description="Oldest velocity message that goes with a position, s.",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_reception(self) -> Self:
        ends_km = LAWS[self.reception][1] / 1000.0
        if self.range_km is not None and self.range_km > ends_km:
            raise ValueError(
                f"range_km is {self.range_km:g}: nothing is received beyond {ends_km:.1f} km with "
                f"reception '{self.reception}'; it must be at most that"
            )
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence per key without effect under the chosen reception law and heights."""
        said = super().ineffective_key_notes()
        if self.reception != "fitted":
            around = "aircraft_around", "airports_around"
            said += self.note_ineffective(*around, because=f"reception is {self.reception!r}")
        if self.heights == "geometric":
            said += self.note_ineffective("pressure_deviation_m", because="heights is 'geometric'")
        return said

    def reach(self) -> Reach:
        """Return the reach; without ``range_km`` up to the farthest of the reception law."""
        reach = super().reach()
        if self.range_km is not None:
            return reach
        return replace(reach, range_max_m=LAWS[self.reception][1])


def _reported_position_errors_m(receiver: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return reported positions' errors north, east at each look, m, if all messages arrive."""
    receiver.law = LAWS["certain"][0]
    look = receiver.look(cells)
    here = cells.relative_target_fields_ahead(np.arange(len(cells)), np.zeros(len(cells)))
    said = [look.extras[f"reported_{name}"] for name in POSITION_FIELDS]
    away = line_of_sight_ned(
        *(here[f"target_{name}"] for name in POSITION_FIELDS), *said, validate=False
    )
    return {"north": away[0], "east": away[1]}


RECEPTION = Ladder(
    "reception",
    (
        Rung("certain", "all squitters in reach", parameters={"reception": "certain"}),
        Rung("do_365", "two steps to 20 nmi (DO-365)", parameters={"reception": "do_365"}),
        Rung("fitted", "the law fitted to 23 receivers", parameters={"reception": "fitted"}),
    ),
    "fitted",
    (Quantity("reception", ""),),
    make_cell_measure(lambda receiver, cells: {"reception": receiver.law(cells.range_m)}),
    clears=("range_km",),
)
ERRORS = Ladder(
    "broadcast errors",
    (
        Rung("none", "what the aircraft truly do",
             parameters={"position_errors": "none", "compact": False}),
        Rung("compact", "rounded as in the messages",
             parameters={"position_errors": "none", "compact": True}),
        Rung("white", "errors new with each message",
             parameters={"position_errors": "white", "compact": True}),
        Rung("gauss_markov", "errors that last 300 s",
             parameters={"position_errors": "gauss_markov", "compact": True}),
    ),
    "gauss_markov",
    (Quantity("north", "m"), Quantity("east", "m")),
    make_cell_measure(_reported_position_errors_m),
)  # fmt: skip


class AdsB(CooperativeSensor):
    """Reports equipped aircraft by the last position and velocity messages received of each.

    Aircraft send positions and velocities at random intervals of 0.4 to 0.6 s, each by a clock of
    its own; a message comes through with a probability by range. At each scan an aircraft is
    reported of which a position was received since the last one (in the last 5 s at most), as
    decoded from a single message, carried on to the scan by the last velocity. The confidence is
    the NACp.

    Notes
    -----
    Errors: RTCA DO-365, appendix Q; messages: DO-260B. A message is judged at its own instant:
    where both aircraft then are, by what is known of their flights at the scan.
    """

    Parameters = AdsBParameters
    hears_of = ("ads_b",)
    ladders = (RECEPTION, ERRORS)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.law = LAWS[parameters.reception][0]
        if parameters.reception == "fitted":
            self.law = partial(
                fitted_reception_probability,
                aircraft=parameters.aircraft_around,
                airports=parameters.airports_around,
            )
        #: Scan of each cell of the last look, and the ownship's velocity then.
        self._rows: tuple[IntArray, FloatArray] | None = None
        #: When the scan before each of the last look was, in ns of its run.
        self._before_ns: IntArray = np.zeros(0, dtype=np.int64)
        streams = context.streams
        self._clocks = {
            kind: SquitterClocks(streams.stream("[equipage]", f"{kind} messages"))
            for kind in ("position", "velocity")
        }
        self._received = {kind: self.stream(f"{kind} received") for kind in self._clocks}
        self._broadcasts = Broadcasts(streams, parameters.position_errors, parameters.compact)

    @property
    def _is_height_geometric(self) -> bool:
        return bool(self.p.heights == "geometric")

    def offer(self, port: str) -> Any:
        """Return the sensor's declaration: range rates, no fixed variances, lasting errors."""
        offer: SensorOffer = super().offer(port)
        errs = self.p.position_errors != "none" or self.p.compact or self.p.pressure_deviation_m
        model = self.p.position_errors, self._is_height_geometric
        told = told_errors_of_broadcast(*model) if errs else ()
        # Of targets that may be anything some may be late.
        late = [
            (one.equipage.uncompensated_latency_s > 0.0).any()
            for one in offered_rosters(self.context)
        ]
        told = (*told, LATE) if any(late or [True]) else told
        far_m = min(self.reach.range_max_m, LAWS[self.p.reception][1])
        return replace(
            offer, measures_range_rate=True, azimuth_variance_rad2=None,
            elevation_variance_rad2=None, range_variance_m2=None, range_rate_variance_m2_s2=None,
            lasting=lasting_position_errors(*model), unstated_across_m2=0.0,
            promises=range_and_report_interval_pairs(
                float(1 / self.p.scan_rate_hz), reception_time_steps(self.law, far_m)
            ),
            tells=True, told_errors=told,
        )  # fmt: skip

    @property
    def grid_step_by_quantity(self) -> dict[str, float]:
        """Grid steps of quantities as in other sensors, but 0 (no rounding) for range rate."""
        return {**super().grid_step_by_quantity, "range_rate": 0.0}

    def cells(self, targets: Any, rows: IntArray, wake: Wake) -> tuple[Cells, Any]:
        """Return cells and reasons; remember each previous scan, from which on messages count."""
        self._before_ns = ticks_to_nanoseconds(wake.previous_scan_tick, wake.ticks_per_s)
        return super().cells(targets, rows, wake)

    def look(self, cells: Cells) -> Look:
        """Return a look at each aircraft's newest message since the last scan, with its report."""
        extras = empty_report_columns(len(cells))
        moves = np.full((3, len(cells)), np.nan)
        sends = np.flatnonzero(cells.roster.ever_broadcasts[cells.craft])
        reported, number, sent_ns = self._received_cells_numbers_sent_ns("position", cells, sends)
        detected = np.zeros(len(cells), dtype=bool)
        detected[reported] = True
        if len(reported):
            self._fill_report_columns(cells, reported, number, sent_ns, extras)
            taken = extras["reported_height_m" if self._is_height_geometric else "reported_alt_m"]
            placed = self.has_position_counting_others(cells, reported, taken[reported])
            detected[reported], reported = placed, reported[placed]
            moves[:, reported] = own_velocity(cells, reported)
            detected = self.is_heard_and_not_excluded(cells, detected, extras["address"])
        signal = {f"own_{axis}": moves[i] for i, axis in enumerate(("north", "east", "down"))}
        self._rows = cells.row, moves
        confidence = np.where(detected, extras["nacp"], 0.0)
        return Look(detected, confidence, extras, signal=signal)

    def _received_cells_numbers_sent_ns(
        self, kind: str, cells: Cells, asked: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """Return indices of cells with a message, the newest's number and sending instant (ns)."""
        none = np.zeros(0, dtype=np.int64)
        if not len(asked):
            return none, none, none
        now_ns = cells.state_ns[asked]
        oldest_ns = now_ns - self._max_message_age_ns(kind, cells, asked)
        count = math.ceil(int((now_ns - oldest_ns).max()) / (SHORTEST_S * NANOSECONDS)) + 1
        senders = Transponders.from_cells(cells, asked)
        number, sent_ns, counts = self._clocks[kind].latest_messages(
            senders.keys, senders.run, now_ns, count
        )
        counts &= sent_ns > oldest_ns[:, np.newaxis]
        roster = cells.roster
        craft = roster.equipage_rows(cells.craft[asked][:, np.newaxis], sent_ns)
        counts &= roster.equipage.ads_b[craft]
        counts &= sent_ns < roster.equipage.silent_after_s[craft] * NANOSECONDS
        row, column = np.nonzero(counts)
        if not len(row):
            return none, none, none
        ahead_s = (sent_ns[row, column] - now_ns[row]) / NANOSECONDS
        then = cells.relative_target_fields_ahead(asked[row], ahead_s)
        stream = self._received[kind].of_runs(senders.run[row], sent_ns[row, column])
        drawn = stream.uniform(senders.keys[row], number[row, column])
        came = then["present"] & (drawn < self.law(then["range_m"]))
        if "hidden" in then:
            came &= ~then["hidden"]
        counts[row, column] = came
        some = np.flatnonzero(counts.any(axis=1))
        newest = counts[some].argmax(axis=1)
        return asked[some], number[some, newest], sent_ns[some, newest]

    def _max_message_age_ns(self, kind: str, cells: Cells, asked: IntArray) -> IntArray:
        """Return the oldest age, ns, at which a message still counts, for each cell of the indices
        `asked`: of positions the time since the last scan, at most `LONGEST_S`, of velocities a
        fixed age.
        """
        if kind == "velocity":
            return np.full(len(asked), round(self.p.velocity_age_s * NANOSECONDS))
        # What delays the picture of the aircraft delays that of both scans.
        since_ns = cells.instant_ns[asked] - self._before_ns[cells.row[asked]]
        return np.minimum(since_ns, round(LONGEST_S * NANOSECONDS))

    def _fill_report_columns(
        self,
        cells: Cells,
        reported: IntArray,
        number: IntArray,
        sent_ns: IntArray,
        extras: dict[str, AnyArray],
    ) -> None:
        """Fill cells' report columns in place: decoded position, velocity, quality categories."""
        equipage, senders = cells.roster.equipage, Transponders.from_cells(cells, reported, sent_ns)
        sent = self._true_states_when_sent(cells, reported, number, sent_ns)
        position = self._broadcasts.broadcast_position(equipage, senders, sent)
        for name, values in zip(POSITION_FIELDS, position, strict=True):
            extras[f"reported_{name}"][reported] = values
        extras["reported_s"][reported] = sent_ns / NANOSECONDS
        for name in ("address", "nacp", "nic"):
            extras[name][reported] = getattr(equipage, name)[senders.craft]
        moving, number, sent_ns = self._received_cells_numbers_sent_ns("velocity", cells, reported)
        if not len(moving):
            return
        senders = Transponders.from_cells(cells, moving, sent_ns)
        sent = self._true_states_when_sent(cells, moving, number, sent_ns)
        velocity = self._broadcasts.broadcast_velocity(equipage, senders, sent)
        for axis, values in zip(("north", "east", "climb"), velocity, strict=True):
            extras[f"reported_{axis}_m_s"][moving] = values
        extras["velocity_s"][moving] = sent_ns / NANOSECONDS
        above_m = self._broadcasts.broadcast_height_difference_m(equipage, senders, sent)
        extras["reported_height_m"][moving] = extras["reported_alt_m"][moving] + above_m
        extras["nacv"][moving] = equipage.nacv[senders.craft]

    def _true_states_when_sent(
        self, cells: Cells, which: IntArray, number: IntArray, sent_ns: IntArray
    ) -> Sent:
        """Return aircraft's true positions and velocities when message content was measured.

        Before a flight begins its aircraft flew on towards there as it is when the message is sent.
        """
        roster = cells.roster
        latency_s = roster.equipage.latency_s[roster.equipage_rows(cells.craft[which], sent_ns)]
        instant_ns = sent_ns - np.rint(latency_s * NANOSECONDS).astype(np.int64)
        ahead_s = (instant_ns - cells.state_ns[which]) / NANOSECONDS
        back_s = np.zeros(len(which))
        if latency_s.any():
            known = cells.relative_target_fields_ahead(which, ahead_s)["present"]
            back_s = np.where(known, 0.0, latency_s)
            ahead_s = ahead_s + back_s
        then = cells.relative_target_fields_ahead(which, ahead_s)
        velocity = velocity_ned_from_positions(cells, which, ahead_s, then, "target")
        position = [then[f"target_{name}"] for name in POSITION_FIELDS]
        if back_s.any():
            before = displaced_lat_lon_alt(*position, *(-velocity * back_s))
            position = [np.where(back_s > 0.0, b, p) for b, p in zip(before, position, strict=True)]
        velocity[2] = -velocity[2]
        lat, lon, height = position
        altitude = self.pressure_altitude_m(height)
        return Sent(lat, lon, altitude, height, velocity, number, instant_ns)

    def _measure(
        self,
        cells: Cells,
        detected: IntArray,
        look: Look,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        range_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return azimuth, elevation, range of reports extrapolated to the scan, and variances."""
        said = {name: values[detected] for name, values in look.extras.items()}
        own = OwnBelief.from_cells(cells, detected)
        velocity = np.stack([
            said["reported_north_m_s"], said["reported_east_m_s"], -said["reported_climb_m_s"]
        ])  # fmt: skip
        now_s = cells.state_ns[detected] / NANOSECONDS
        age_s = now_s - said["reported_s"]
        lat, lon, altitude = (said[f"reported_{name}"] for name in POSITION_FIELDS)
        height = said["reported_height_m"]
        if not self._is_height_geometric:
            height = self.heights_from_altitudes_m(cells, detected, altitude)
        position = [lat, lon, height]
        velocity = velocity_in_axes_of_later_position(
            position, velocity, said["reported_s"] - said["velocity_s"]
        )
        carried = np.nan_to_num(velocity)
        ned = ned_from_believed_position_m(
            own, *displaced_lat_lon_alt(*position, *(carried * age_s))
        )
        # Its velocity is in its own axes, which are turned against ours.
        ahead = ned_from_believed_position_m(
            own, *displaced_lat_lon_alt(*position, *(carried * (age_s + STEP_S)))
        )
        moving = np.where(np.isnan(velocity), np.nan, (ahead - ned) / STEP_S)
        azimuth, elevation, distance = ned_to_azimuth_elevation_range(own, ned)
        sent_ns = np.rint(said["reported_s"] * NANOSECONDS).astype(np.int64)
        roster = cells.roster
        stated = StatedByAircraft(
            roster.equipage, roster.equipage_rows(cells.craft[detected], sent_ns), said,
            errs=self.p.position_errors != "none", rounds=self.p.compact,
            pressure_deviation_m=self.p.pressure_deviation_m,
            is_geometric=self._is_height_geometric,
        )  # fmt: skip
        late_m = stated.position_lag_s * np.nan_to_num(moving)
        variances = line_of_sight_variances(own, ned, stated.position_variances_m2(age_s), late_m)
        moves = np.stack(
            [look.signal[f"own_{axis}"][detected] for axis in ("north", "east", "down")]
        )
        rate = ((moving - moves) * ned).sum(axis=0) / distance
        beside = {
            **variances,
            "range_rate_m_s": rate,
            "range_rate_variance_m2_s2": np.where(
                np.isnan(rate), np.nan, stated.velocity_axis_variance_m2_s2
            ),
            "told_by_target": stated.velocities_and_errors(
                moving, now_s - said["velocity_s"], age_s
            ),
        }
        return azimuth, elevation, distance, beside

    def run(self, wake: Wake) -> Detections | None:
        """Report what was received, with the ownship's velocity beside."""
        self._rows = None
        report = super().run(wake)
        if report is None:
            return None
        moves = np.full((3, len(report)), np.nan)
        if self._rows is not None:
            row, velocity = self._rows
            some = np.flatnonzero(np.isfinite(velocity[0]))
            moves[:, row[some]] = velocity[:, some]
        own = dict(zip(OWN_VELOCITY, moves, strict=True))
        told = report.told_by_target or {name: np.zeros(0) for name in TOLD}
        return replace(report, own_velocity=own, told_by_target=told)
