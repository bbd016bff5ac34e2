"""The base class of radar blocks, and the crudest of them (``radar.range_boundary``, §2.2.2)."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from components.geometry import body_to_ned, unit_vector
from components.messages.targets import RelativeTargets, own_velocity_ned_m_s
from components.radar.beam import BeamSweep, SweepingSensor
from components.radar.detection.cfar import REFERENCE_CELLS, Averaging, CellAveraging
from components.radar.detection.ladder import DETECTION
from components.radar.detection.probability import required_snr
from components.radar.doppler import (
    DOPPLER,
    LASTS_S,
    RANGE_RATE,
    DopplerFilter,
    DopplerProcessing,
    RangeRate,
    RangeRates,
    folded_range_rate,
)
from components.radar.ground_clutter import (
    CLUTTER,
    Echo,
    GroundClutter,
    clutter_as_signal_warnings,
    terrain_of,
)
from components.radar.link_budget import wavelength
from components.radar.measurement import OwnVelocity
from components.radar.parameters import RadarParameters
from components.radar.rain import RainClutter, SidelobeClutter
from components.radar.resolution import ONE_REPORT, SEEMING_RANGE, Merging, OneReportByCell
from components.radar.timing import check_unambiguous
from components.radar.weather import (
    SNR,
    WEATHER_EFFECTS,
    BlindRange,
    rain_echo_warnings,
    weather_without_carrier_warnings,
)
from components.sensor.acquisition import (
    STEP_S,
    Acquired,
    AcquisitionRange,
    check_ranges_cover_all_speeds,
)
from components.sensor.cued_looks import refuse_if_cued
from components.sensor.look import Cells, CellValues, Look, effect_values_of_cells
from components.sensor.palette import RADAR
from components.sensor.sensor import CUED_INPUTS
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict

_RANGE_RATE, _OWN_VELOCITY = RangeRate(), OwnVelocity()
#: Over ground, of the fastest aircraft that a radar listens for: a jet's at cruise.
FASTEST_M_S = 250.0


class Radar(SweepingSensor):
    """A sensor that measures range; subclasses decide what is detected."""

    mark = RADAR
    measures_range = True
    #: Of the carrier, m; None where it is not known.
    wavelength_m: float | None = None
    #: Whether a range stands for the link budget; ground then echoes in cells with a size only.
    boundary: ClassVar[bool] = False
    hooks: ClassVar[tuple[Hook[Any], ...]] = (
        SNR, DOPPLER, RANGE_RATE, ONE_REPORT, CLUTTER, REFERENCE_CELLS, SEEMING_RANGE,
    )  # fmt: skip

    effects: ClassVar[tuple[Effect, ...]] = (_RANGE_RATE, _OWN_VELOCITY)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # Their key is one of every radar. The velocity is of what the reports before it say:
        # false alarms, and when a sweeping beam met each target.
        both = (_RANGE_RATE, _OWN_VELOCITY)
        others = tuple(effect for effect in cls.effects if effect not in both)
        cls.effects = (_RANGE_RATE, *others, _OWN_VELOCITY)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.snr_factors: list[CellValues] = []
        #: What gives an echo beside the target.
        self.echoes: list[Echo] = []
        self.cfar: Averaging | None = None
        self._merging: Merging | None = None
        self.doppler: DopplerProcessing | None = None

    def setup(self) -> None:
        """Store the scene's effects on the SNR."""
        self.snr_factors = self.built(SNR)
        self.doppler = self.built_one(DOPPLER)
        self.echoes = self.built(CLUTTER)
        self.cfar = self.built_one(REFERENCE_CELLS)
        self._merging = self.built_one(ONE_REPORT)

    def merge_echoes_by_cell(self, cells: Cells, power: FloatArray) -> FloatArray:
        """Return echo powers; where targets merge, the strongest has the sum, the others 0."""
        return power if self._merging is None else self._merging(cells, power)

    def apparent_range_m(self, range_m: FloatArray) -> FloatArray:
        """Return the range (m) the radar takes each range for; the same unless ranges fold."""
        seeming: Any = self.built_one(SEEMING_RANGE)
        return range_m if seeming is None else np.asarray(seeming(np.asarray(range_m)))

    def filter_echoes(
        self, cells: Cells, signal: FloatArray, beside: list[FloatArray]
    ) -> tuple[FloatArray, list[FloatArray]]:
        """Return target and other echo powers after the Doppler filter; unchanged without one."""
        if self.doppler is None:
            return signal, beside
        passed, residues = self.doppler(cells, self.echoes)
        return signal * passed, [power * left for power, left in zip(beside, residues, strict=True)]

    def request(self, port: str) -> Any:
        """Return a request for targets in reach, with their motion where rates are measured."""
        reach = super().request(port)
        if not (self.p.enabled and (self._rates or self.built(DOPPLER))):
            return reach
        return replace(reach, lasts_s=LASTS_S + reach.lasts_s)

    def offer(self, port: str) -> Any:
        """Return the sensor's offer, with whether range rates fold and from where ranges do."""
        return replace(
            super().offer(port),
            folds_range_rate=self.p.range_rate_folds,
            ambiguous_m=getattr(self.p, "farthest_report_m", math.inf),
        )

    def why_exact_line_of_sight(self) -> str:
        """Return why an exact line of sight is needed (range rates), else an empty string."""
        return f"{self.name} measures range rates" if self._rates else ""

    @cached_property
    def _rates(self) -> RangeRates | None:
        return self.built_one(RANGE_RATE)

    @property
    def grid_step_by_quantity(self) -> dict[str, float]:
        """Grid step of each quantity that is measured: rad, m and m/s."""
        rate = {"range_rate": self.p.range_rate_resolution_m_s}
        return super().grid_step_by_quantity | (rate if self.p.measures_range_rate else {})

    def range_rate(self, cells: Cells, detected: IntArray) -> FloatArray | None:
        """Return the true range rates of some cells, m/s; None where they are not measured."""
        return None if self._rates is None else self._rates(cells, detected)

    def _to_body_axes(
        self, values: Mapping[str, FloatArray], variances: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return measured azimuth, elevation, range and further quantities in body axes, with range
        rates folded if the radar does.
        """
        azimuth, elevation, range_m, beside = super()._to_body_axes(values, variances)
        if self.p.range_rate_folds and "range_rate_m_s" in beside:
            assert self.wavelength_m is not None
            limit_m_s = 0.25 * self.wavelength_m * self.p.prf_hz
            folded = folded_range_rate(beside["range_rate_m_s"], limit_m_s)
            beside = {**beside, "range_rate_m_s": folded}
        return azimuth, elevation, range_m, beside

    def random_range_rates_m_s(
        self,
        uniform: FloatArray,
        where: Mapping[str, FloatArray],
        targets: RelativeTargets,
        row: IntArray,
    ) -> FloatArray:
        """Return random range rates of false alarms, m/s, from uniform numbers.

        From uniform numbers in [0, 1). A radar of one PRF listens for all that are unambiguous;
        another for those of aircraft up to `FASTEST_M_S` over ground, by its own motion along the
        line of sight.
        """
        off = 2.0 * uniform - 1.0
        if self.p.range_rate_folds:
            assert self.wavelength_m is not None
            return off * 0.25 * self.wavelength_m * self.p.prf_hz
        each, index = np.unique(row, return_inverse=True)
        time_s = targets.position_ticks[each] / self.context.ticks_per_s
        velocity = own_velocity_ned_m_s(targets, each, time_s)
        body = unit_vector(*self.axes.true_direction_in_body(where["azimuth"], where["elevation"]))
        attitude = targets.own_attitude
        if attitude is None or not np.isfinite(velocity).all():
            return off * FASTEST_M_S
        turned = (attitude[f"{name}_rad"][row] for name in ("yaw", "pitch", "roll"))
        towards = np.stack(body_to_ned(*body, *turned))
        nearer_m_s: FloatArray = (towards * velocity[:, index]).sum(axis=0)
        return off * FASTEST_M_S - nearer_m_s


class LaterAcquisition(Effect[CellValues]):
    """Sees a target from where it is acquired on, as long as no scan misses it."""

    name = "acquisition"
    acts_on = SNR

    def verdict(self, block: Any) -> Verdict:
        """Return whether targets are acquired after a delay: needs ``acquisition``."""
        if not block.p.acquisition:
            return Verdict(False, "acquisition is not given")
        return Verdict(True, f"acquisition has {len(block.p.acquisition)} ranges")

    def build(self, block: Any) -> CellValues:
        """Return a function giving cells' SNR factor: 1 once the target is acquired, else 0."""
        return Acquired(block.p.acquisition)


class RangeBoundaryParameters(RadarParameters):
    """Parameters of a range boundary radar."""

    may_change: ClassVar[tuple[str, ...]] = (
        "minimum_range_m", "boundary_pd", "false_alarm_probability",
    )  # fmt: skip

    range_km: float = Field(gt=0, description="Range inside which every target is detected, km.")
    minimum_range_m: float | None = Field(
        default=None, gt=0, description="Closer than this nothing is detected, m; none by default."
    )
    acquisition: tuple[AcquisitionRange, ...] = Field(
        default=(),
        description="Where targets are acquired that it then keeps, by their speed, slowest first; "
        "by default anywhere within range_km.",
    )
    boundary_rcs_dbsm: float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="Target that the range is stated for, dBsm; used with clutter and rain only.",
    )
    boundary_pd: float = Field(
        default=0.9,
        gt=0,
        lt=1,
        description="Pd at that range (Swerling I); used with clutter, rain and CFAR only.",
    )
    false_alarm_probability: float = Field(
        default=1e-6,
        gt=0,
        lt=1,
        description="Probability of false alarm that goes with it; used as boundary_pd is.",
    )

    frequency_hz: float | None = Field(
        default=None,
        gt=0,
        description="Carrier, Hz; for weather, a moving_target_filter and range_rate_folds.",
    )
    prf_hz: float | None = Field(
        default=None,
        gt=0,
        description="Pulse repetition frequency, Hz; as frequency_hz.",
    )

    @model_validator(mode="after")
    def _check_frequency_and_prf(self) -> Self:
        check_ranges_cover_all_speeds(self.acquisition)
        for key, off in (("moving_target_filter", "none"), ("range_rate_folds", False)):
            if getattr(self, key) != off and self.frequency_hz is None:
                raise ValueError(
                    f"{key} is {getattr(self, key)!r} and frequency_hz is not given: blind speeds "
                    "and the unambiguous velocity follow from it"
                )
        if self.prf_hz is not None:
            check_unambiguous(self.prf_hz, self.range_km)
        return self

    @property
    def pulses_summed(self) -> int:
        """Number of pulses summed non-coherently: 1."""
        return 1


class RangeBoundary(Radar):
    """Detects every target inside its range, as the DUT/NLDA simulator's radar did.

    Confidence is 40·log10(range limit / range), the SNR margin in dB that a radar would have
    whose threshold lies at the limit.

    Ground clutter brings the boundary nearer: for the target that it is stated for, the noise at
    the boundary has that target's echo over the SNR that `boundary_pd` needs; the ground's echo
    comes on top of it, and a threshold from reference cells needs the CFAR loss more. A
    moving-target filter changes both echoes. With ``frequency_hz`` it obeys the weather: air and
    rain take from both, and rain echoes as the ground does.
    """

    Parameters = RangeBoundaryParameters
    inputs = CUED_INPUTS
    boundary = True
    effects = (
        *WEATHER_EFFECTS,
        BlindRange(),
        LaterAcquisition(),
        GroundClutter(),
        RainClutter(),
        SidelobeClutter(),
        DopplerFilter(),
        CellAveraging(),
        OneReportByCell(),
        BeamSweep(),
    )
    ladders = (DETECTION,)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        frequency_hz = parameters.frequency_hz
        self.wavelength_m = None if frequency_hz is None else float(wavelength(frequency_hz))

    def setup(self) -> None:
        """Store the scene's effects that change the range of detection."""
        super().setup()
        refuse_if_cued(self)

    def request(self, port: str) -> Any:
        """Return a request for targets in reach, with their motion if speed decides acquisition."""
        reach = super().request(port)
        if not (self.p.enabled and len(self.p.acquisition) > 1):
            return reach
        return replace(reach, lasts_s=max(reach.lasts_s, 2.0 * STEP_S))

    def warnings(self) -> list[str]:
        """Return warnings where clutter counts as signal, and on which weather has an effect."""
        return [
            *super().warnings(),
            *clutter_as_signal_warnings(self.p, terrain_of(self)),
            *weather_without_carrier_warnings(self),
            *rain_echo_warnings(self),
        ]

    def look(self, cells: Cells) -> Look:
        """Return which cells in range no effect, clutter or merging hides, with their margins."""
        # A metre is closer than any radar sees; it keeps the margin finite at range 0.
        ratio = self.reach.range_max_m / np.maximum(cells.range_m, 1.0)
        margin_db = 40.0 * np.log10(ratio)
        detected = np.ones(len(cells), dtype=bool)
        through = np.ones(len(cells))
        for factor in self.snr_factors:
            through = through * effect_values_of_cells(self, factor, cells)
        audible = through > 0.0
        lossy = bool((through[audible] != 1.0).any())
        if lossy or self.echoes or not (self.cfar is self.doppler is None):
            margin_db = self._margin_db(cells, margin_db, np.where(audible, through, 1.0))
            detected = margin_db >= 0.0
        detected &= audible
        # Of equal targets the nearer one has the stronger echo.
        detected &= self.merge_echoes_by_cell(cells, np.where(detected, ratio**4, 0.0)) > 0.0
        return Look(detected, margin_db)

    def _margin_db(
        self, cells: Cells, over_noise_db: FloatArray, through: FloatArray
    ) -> FloatArray:
        """Return each cell's margin over noise and clutter from that over noise, dB."""
        p = self.p
        needed = required_snr(p.boundary_pd, false_alarm_probability=p.false_alarm_probability)
        noise = alone = 10.0 ** (-0.1 * over_noise_db)
        signal, beside = self.filter_echoes(cells, through, [through] * len(self.echoes))
        for echo, left in zip(self.echoes, beside, strict=True):
            clutter = left * echo(cells) * 10.0 ** (-0.1 * p.boundary_rcs_dbsm)
            if p.clutter_threshold == "noise":
                signal = signal + clutter
            else:
                noise = noise + needed * clutter
        # Where nothing is added, no bit is: that margin is the one over noise.
        same = (signal == 1.0) & (noise == alone)
        margin_db: FloatArray = np.where(same, over_noise_db, 10.0 * np.log10(signal / noise))
        if self.cfar is not None:
            margin_db = margin_db - self.cfar.loss_db(p.boundary_pd, "swerling1")
        return margin_db
