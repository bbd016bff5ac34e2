"""An observer who looks out of the window (``visual.acquisition``), and its ladder."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from components.aircraft.known_targets import offered_rosters
from components.atmosphere.visibility import KOSCHMIEDER
from components.geometry import FieldOfView
from components.messages.reach import Reach
from components.optical.area_of_cells import area_of_cells
from components.optical.weather_effects import (
    DARKNESS,
    TRANSMISSION,
    CellsInTheWay,
    Night,
    scene_visibility_m,
)
from components.sensor.ladder_values import make_cell_measure
from components.sensor.look import Cells, Look, effect_values_of_cells
from components.sensor.palette import EYES
from components.sensor.parameters import (
    CorrelationTime,
    ErrorParameters,
    SensorParameters,
    check_field_of_view_azimuths,
    check_field_of_view_elevations,
)
from components.sensor.sensor import Sensor
from components.visual.acquisition import (
    UNALERTED_PER_SR_S,
    acquisition_rate_per_s,
    angular_size_rad,
    integrate_rate_while_shown,
    max_visible_range_m,
)
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.randomness import Stream

_PROBABILITY = Quantity("acquisition_probability", "P")
_NEVER = np.iinfo(np.int64).max
# Covers the rounding of ranges and areas many times over.
_MARGIN, _MARGIN_M = 1.0 + 1e-9, 1.0
_ARCMIN_RAD = math.radians(1.0 / 60.0)


class LookoutParameters(SensorParameters):
    """Parameters of one or two observers; the defaults are the left pilot of Andrews's model."""

    may_change: ClassVar[tuple[str, ...]] = (
        "left_looking", "right_looking", "beta_per_sr_s", "smallest_arcmin",
    )  # fmt: skip

    quantities: ClassVar[Mapping[str, str]] = {**ErrorParameters.quantities, "range": "m"}

    azimuth_deg: Annotated[tuple[float, float], AfterValidator(check_field_of_view_azimuths)] = (
        Field(
            default=(-110.0, 90.0),
            description="Field of view from the left seat, clockwise from the first to the second, "
            "deg; that from the right seat is its mirror image.",
        )
    )
    elevation_deg: Annotated[
        tuple[float, float], AfterValidator(check_field_of_view_elevations)
    ] = Field(
        default=(-20.0, 35.0), description="Field of view in elevation, lowest and highest, deg."
    )
    left_looking: float = Field(
        default=1.0, ge=0, le=1, description="Share of time in which the left pilot looks out."
    )
    right_looking: float = Field(
        default=0.0, ge=0, le=1, description="The same for the right pilot; 0: there is none."
    )
    looking: Literal["glances", "spells"] = Field(
        default="glances",
        description="Whether the share is of short glances, which scale the search, or of spells "
        "longer than an approach: each looks out through all of a run with that probability.",
    )
    search: Literal["random", "round"] = Field(
        default="random",
        description="Whether an aircraft is seen at Andrews's rate, or at the first look at its "
        "place of a search that comes round.",
    )
    beta_per_sr_s: float = Field(
        default=UNALERTED_PER_SR_S,
        gt=0,
        description="Rate of acquisition per solid angle of the aircraft, 1/(sr s); 17,000 is of "
        "pilots whom nothing alerts.",
    )
    round_s: float = Field(default=36.0, gt=0, description="Time in which a search comes round, s.")
    smallest_arcmin: float = Field(
        default=1.0,
        ge=0,
        description="Angular size of the smallest disc that is seen; an aircraft counts as the "
        "disc of its projected area.",
    )
    between_scans: Literal["as_at_scan", "integral"] = Field(
        default="integral",
        description="Whether the search since the last scan is taken to be as at the scan, or is "
        "integrated along the flights.",
    )
    judges_range: bool = Field(
        default=False, description="Whether the range is judged too, with range_error_m."
    )
    range_error_m: float = Field(
        default=0.0, ge=0, description="Standard deviation of judged range, m."
    )
    range_bias_m: float = Field(default=0.0, description="Bias of judged range, m; see biases.")
    range_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of range_error_m, s."
    )

    @model_validator(mode="after")
    def _check_seats(self) -> Self:
        low, high = self.azimuth_deg
        if self.right_looking and not (-180.0 <= low < 0.0 < high <= 180.0):
            raise ValueError(
                f"azimuth_deg is [{low:g}, {high:g}]: with somebody on the right it must hold "
                "straight ahead, from [-180, 0) to (0, 180]"
            )
        return self

    def reach(self) -> Reach:
        """Return the reach over all fields of view of active observers; disabled if none."""
        reach = super().reach()
        low, high = reach.azimuth_rad
        fields = [
            edges
            for share, edges in (
                (self.left_looking, (low, high)), (self.right_looking, (-high, -low)),
            )
            if share > 0.0
        ]  # fmt: skip
        if not fields:
            return replace(reach, enabled=False)
        both = min(low for low, _ in fields), max(high for _, high in fields)
        return replace(reach, azimuth_rad=both)

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a search or a range estimate that is not chosen."""
        said = super().ineffective_key_notes()
        other = "round_s" if self.search == "random" else "beta_per_sr_s"
        said += self.note_ineffective(other, because=f"search is '{self.search}'")
        if not self.judges_range:
            said += self.note_ineffective(
                "range_error_m", "range_bias_m", "range_correlation_time_s",
                because="judges_range is false",
            )  # fmt: skip
        if not (self.left_looking or self.right_looking):
            said.append("left_looking and right_looking are 0: nobody looks out")
        return said


def _acquisition_probability(observer: Any, cells: Cells) -> dict[str, FloatArray]:
    """Return the probability that each cell's target was acquired since the last scan."""
    return {_PROBABILITY.name: observer.acquisition_probability(cells)}


BETWEEN_SCANS = Ladder(
    "between scans",
    (
        Rung("as_at_scan", "the rate at the scan, times the period",
             parameters={"between_scans": "as_at_scan"}),
        Rung("integral", "the rate integrated along the flights",
             parameters={"between_scans": "integral"}),
    ),
    "integral",
    (_PROBABILITY,),
    make_cell_measure(_acquisition_probability, out_of_range=0.0),
)  # fmt: skip


@dataclass(frozen=True)
class _Seat:
    """One observer: number, field of view in sensor axes, and share of time looking out."""

    number: int
    field: FieldOfView
    share: float


class _SeenBefore:
    """What is seen of chosen cells at other instants than their scans, readable like `Cells`."""

    def __init__(self, cells: Cells, which: IntArray, ahead_s: FloatArray) -> None:
        self.seen: Mapping[str, AnyArray] = cells.relative_target_fields_ahead(which, ahead_s)
        self.state_ns = cells.state_ns[which] + np.rint(ahead_s * NANOSECONDS).astype(np.int64)
        self.roster, self.craft = cells.roster, cells.craft[which]

    def __len__(self) -> int:
        return len(self.craft)

    def __getattr__(self, name: str) -> AnyArray:
        return self.seen[name]

    def column_at_targets(self, column: FloatArray) -> AnyArray:
        """Return, for each chosen cell, the value of a roster column for its target."""
        return column[self.craft]

    def field_at_rows(self, name: str) -> AnyArray:
        """Return each cell's field (such as own altitude) at the cell's instant."""
        return self.seen[name]


class Lookout(Sensor):
    """One or two observers who see an aircraft from random acquisition on, while in view.

    With ``search = "random"`` acquisitions are a Poisson process whose rate is Andrews's; with
    ``"round"`` the place of an aircraft is looked at once a round, at a phase drawn for each run
    and aircraft. What happens between scans counts at the next scan, if the aircraft is in view
    then; what came before the run began does not. Confidence is the angular size over the smallest
    that is seen, less 1. Haze is ``[weather] visibility_km`` (3.912 over it; a visual range of 5 %
    contrast is 0.766 of that visibility).
    """

    mark = EYES
    Parameters = LookoutParameters
    remembers = ("_first_seen",)
    hooks = (DARKNESS, TRANSMISSION)
    effects: ClassVar[tuple[Effect, ...]] = (Night(), CellsInTheWay())
    ladders = (BETWEEN_SCANS,)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.measures_range = bool(parameters.judges_range)
        self._smallest_rad = parameters.smallest_arcmin * _ARCMIN_RAD
        self._period_s = 1.0 / float(parameters.scan_rate_hz)
        self._finds = self.stream("acquisition")
        self._phases, self._attends = self.stream("phase"), self.stream("attention")
        #: The first scan at which each target is seen: of the first run, the second, and so on.
        self._first_seen: IntArray = np.empty(0, dtype=np.int64)

    def setup(self) -> None:
        """Look no farther than the largest aircraft shows, and not in the dark."""
        visibility_m = scene_visibility_m(self.context.sections["weather"])
        self._extinction_per_m = 0.0 if visibility_m is None else KOSCHMIEDER / visibility_m
        if self.built_one(DARKNESS):
            self.reach = replace(self.reach, enabled=False)
        rosters = offered_rosters(self.context)
        if rosters and self._smallest_rad and not self.context.simulate_everything:
            bodies = [rosters[0].column(f"eo.{n}_m2") for n in ("front", "side", "horizontal")]
            largest_m2 = float(np.sum(bodies, axis=0).max(initial=0.0))
            farthest_m = max_visible_range_m(largest_m2, self._smallest_rad) * _MARGIN + _MARGIN_M
            nearer_m = min(self.reach.range_max_m, farthest_m)
            self.reach = replace(self.reach, range_max_m=nearer_m)

    def request(self, port: str) -> Any:
        """Return a request for targets with flights: aircraft may be acquired between scans."""
        reach = super().request(port)
        along = self.p.enabled and self.p.between_scans == "integral"
        return replace(reach, lasts_s=self._period_s) if along else reach

    @cached_property
    def _seats(self) -> list[_Seat]:
        low, high = (math.radians(angle) for angle in self.p.azimuth_deg)
        elevation = self.reach.elevation_rad
        sides = ((self.p.left_looking, (low, high)), (self.p.right_looking, (-high, -low)))
        return [
            _Seat(number, FieldOfView(edges, elevation), share)
            for number, (share, edges) in enumerate(sides)
            if share > 0.0
        ]

    def look(self, cells: Cells) -> Look:
        """Draw acquisitions; return a look that detects all acquired still large enough to see."""
        who = cells.run * len(cells.roster.names) + cells.target
        missing = int(who.max(initial=-1)) + 1 - len(self._first_seen)
        if missing > 0:
            never = np.full(missing, _NEVER)
            self._first_seen = np.concatenate([self._first_seen, never])
        size = angular_size_rad(self._visible_area_m2(cells), cells.range_m)
        limit = self._smallest_rad or _ARCMIN_RAD
        confidence = size / limit - 1.0
        extras: dict[str, AnyArray] = {}
        if self._is_every_look_recorded:
            extras["detection_probability"] = self.acquisition_probability(cells)
        searched = np.flatnonzero(self._first_seen[who] > cells.scan)
        result = searched[self._draw_acquisitions(cells, searched)]
        first = self._first_seen.copy()
        np.minimum.at(first, who[result], cells.scan[result])
        self._first_seen = first
        seen = (first[who] <= cells.scan) & (size >= self._smallest_rad)
        return Look(seen, confidence, extras)

    def acquisition_probability(self, cells: Cells) -> FloatArray:
        """Return the probability that each cell's aircraft was acquired since the last scan.

        For who was not found before. A search that comes round finds it with the share of a round
        for which it showed, over all phases.
        """
        expected = self._expected_acquisitions(cells, np.arange(len(cells)))
        return np.minimum(expected, 1.0) if self.p.search == "round" else -np.expm1(-expected)

    def _expected_acquisitions(self, cells: Cells, which: IntArray) -> FloatArray:
        """Return the cells' expected acquisitions since the last scan, summed over observers."""
        total = np.zeros(len(which))
        for seat in self._seats:
            total += self._looking_share(seat, cells, which) * self._integrated_search_rate(
                seat, cells, which
            )
        return total

    def _draw_acquisitions(self, cells: Cells, which: IntArray) -> BoolArray:
        """Return which cells' aircraft are acquired, at random, since the last scan (mask)."""
        if self.p.search == "random":
            expected = self._expected_acquisitions(cells, which)
            keys = cells.roster.draw_keys_of(cells.target[which])
            finds = self._finds.of_runs(cells.run[which], cells.instant_ns[which])
            drawn = finds.uniform(keys, cells.scan[which])
            return np.asarray(drawn < -np.expm1(-expected))
        result = np.zeros(len(which), dtype=bool)
        for seat in self._seats:
            result |= self._is_looked_at_by_search(seat, cells, which)
        return result

    def _integrated_search_rate(self, seat: _Seat, cells: Cells, which: IntArray) -> FloatArray:
        """Return, for each chosen cell, the search rate of a seat integrated since the last scan
        while the aircraft shows; for a periodic search the number of rounds.
        """
        before_s = self._since_last_scan_s(cells, which)
        if not len(which):
            return before_s
        if self.p.between_scans == "as_at_scan":
            now = np.where(self._is_shown(seat, cells)[which], before_s, 0.0)
            if self.p.search == "round":
                return now / self.p.round_s
            return now * self._acquisition_rate_per_s(cells)[which]

        def shown(some: IntArray, ahead_s: FloatArray) -> BoolArray:
            return self._is_shown(seat, _SeenBefore(cells, which[some], ahead_s))

        def rate(some: IntArray, ahead_s: FloatArray) -> FloatArray:
            if self.p.search == "round":
                return np.full(len(some), 1.0 / self.p.round_s)
            return self._acquisition_rate_per_s(_SeenBefore(cells, which[some], ahead_s))

        return integrate_rate_while_shown(before_s, shown, rate)

    def _is_looked_at_by_search(self, seat: _Seat, cells: Cells, which: IntArray) -> BoolArray:
        """Return which cells' visible aircraft a search looked at since the last scan (mask)."""
        share = self._looking_share(seat, cells, which)
        looks = np.flatnonzero(share > 0.0)
        mine, share = which[looks], share[looks]
        keys = cells.roster.draw_keys_of(cells.target[mine])
        round_s = self.p.round_s / share
        phase_s = round_s * _draw_once_per_run(self._phases, cells.run[mine], keys, seat.number)
        now_s = cells.state_ns[mine] / NANOSECONDS
        # The last instant up to now at which the search was at its place, in (last scan, now].
        ahead_s = -np.remainder(now_s - phase_s, round_s)
        in_time = np.flatnonzero(-ahead_s < self._since_last_scan_s(cells, mine))
        met = np.zeros(len(which), dtype=bool)
        if len(in_time) and self.p.between_scans == "integral":
            there = _SeenBefore(cells, mine[in_time], ahead_s[in_time])
            met[looks[in_time]] = self._is_shown(seat, there)
        elif len(in_time):
            met[looks[in_time]] = self._is_shown(seat, cells)[mine[in_time]]
        return met

    def _since_last_scan_s(self, cells: Cells, which: IntArray) -> FloatArray:
        """Return time, s, since the last scan or the run's start; a scan period if as_at_scan."""
        if self.p.between_scans == "as_at_scan":
            return np.full(len(which), self._period_s)
        return np.minimum(self._period_s, cells.state_ns[which] / NANOSECONDS)

    def _looking_share(self, seat: _Seat, cells: Cells, which: IntArray) -> FloatArray:
        """Return the share of time looking out (cells,), or 1 or 0 per run if it is in spells."""
        if self.p.looking == "glances":
            return np.full(len(which), seat.share)
        nobody = np.zeros(len(which), dtype=np.uint64)
        drawn = _draw_once_per_run(self._attends, cells.run[which], nobody, seat.number)
        return np.where(drawn < seat.share, 1.0, 0.0)

    def _visible_area_m2(self, view: Any) -> FloatArray:
        return area_of_cells(view, "eo", "convex_hull")

    def _acquisition_rate_per_s(self, view: Any) -> FloatArray:
        """Return Andrews's acquisition rate per cell, 1/s, reduced by the air's transmission."""
        rate: FloatArray = acquisition_rate_per_s(
            self._visible_area_m2(view),
            np.maximum(view.range_m, 1.0),
            beta_per_sr_s=self.p.beta_per_sr_s,
            extinction_per_m=self._extinction_per_m,
        )
        for left in self.built(TRANSMISSION):
            rate = rate * effect_values_of_cells(self, left, view)
        return rate

    def _is_shown(self, seat: _Seat, view: Any) -> BoolArray:
        """Return which cells' aircraft are in view, in range, large enough, not hidden (mask)."""
        azimuth, elevation = self.axes(view.body_azimuth_rad, view.body_elevation_rad)
        shows = seat.field.holds(azimuth, elevation)
        shows &= view.range_m <= self.reach.range_max_m
        if self._smallest_rad:
            shows &= (
                angular_size_rad(self._visible_area_m2(view), view.range_m) >= self._smallest_rad
            )
        if isinstance(view, _SeenBefore):
            shows &= view.present
            if "hidden" in view.seen:
                shows &= ~view.hidden
        return np.asarray(shows)


def _draw_once_per_run(stream: Stream, run: IntArray, keys: AnyArray, number: int) -> FloatArray:
    """Return uniform draws in [0, 1), one for each run and key, that do not change during a run."""
    return stream.of_runs(run).uniform(keys, np.zeros(len(run), dtype=np.int64), number)
