"""A radar that detects above a fixed SNR (``radar.threshold``, thesis §3.5.1)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from components.aircraft.aircraft import Roster
from components.aircraft.known_targets import offered_rosters
from components.messages.detections import Detections
from components.messages.false_detections import add_false_detections
from components.messages.targets import RelativeTargets
from components.radar.beam import BEAM_SHAPE, BeamShape, BeamSweep
from components.radar.detection.cfar import CellAveraging
from components.radar.detection.ladder import DETECTION, RCS
from components.radar.detection.probability import required_snr
from components.radar.detection.threshold import Crossing
from components.radar.doppler import DopplerFilter
from components.radar.false_alarms import (
    ClutterAlarms,
    FalseAlarms,
    false_alarm_count_warnings,
    high_pfa_warnings,
)
from components.radar.ground_clutter import (
    Clutter,
    GroundClutter,
    clutter_as_signal_warnings,
    terrain_of,
)
from components.radar.link_budget import beam_gain_warnings, implausible_value_warnings
from components.radar.measurement import (
    MeasuredStrength,
    signal_over_noise_and_clutter,
    signal_variances,
)
from components.radar.parameters import (
    LinkBudgetParameters,
    cued_snr_factor_function,
    moved_threshold_warnings,
)
from components.radar.radar import Radar
from components.radar.rain import FoldedClutter, RainClutter, SidelobeClutter
from components.radar.rcs import MEAN_RCS, AspectRcs, constant_rcs_m2, mean_rcs_m2
from components.radar.resolution import OneReportByCell, RangeFolding
from components.radar.timing import LOOK_ENERGY, TimeBudget, time_report
from components.radar.weather import (
    PROPAGATION,
    WEATHER_EFFECTS,
    BlindRange,
    Eclipsing,
    Multipath,
    neglected_gas_loss_notes,
    rain_echo_warnings,
)
from components.sensor.cued_looks import CUE, CUED_LOOKS, cue_warnings
from components.sensor.look import Cells, CellValues, Look, effect_values_of_cells
from components.sensor.sensor import CUED_INPUTS
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook
from dsa_des.block.wake import Wake
from dsa_des.time.clock import ticks_to_nanoseconds


class ThresholdParameters(LinkBudgetParameters):
    """Parameters of a threshold radar."""

    may_change: ClassVar[tuple[str, ...]] = ("threshold_db", "cued_threshold_db")

    threshold_db: float | None = Field(
        default=None,
        description="SNR that is detected, dB; by default that of the calibration, or of Pd 0.9.",
    )
    cued_threshold_db: float | None = Field(
        default=None,
        description="SNR that is detected within a cue cone, dB; by default the same.",
    )


class LinkBudgetRadar(Radar):
    """A radar whose decision rests on the SNR of its link budget."""

    Parameters = LinkBudgetParameters
    inputs = CUED_INPUTS
    hooks: ClassVar[tuple[Hook[Any], ...]] = (MEAN_RCS, LOOK_ENERGY, BEAM_SHAPE, PROPAGATION)
    effects: ClassVar[tuple[Effect, ...]] = (
        AspectRcs(),
        *WEATHER_EFFECTS,
        BlindRange(),
        Eclipsing(),
        RangeFolding(),
        Multipath(),
        BeamShape(),
        GroundClutter(),
        RainClutter(),
        SidelobeClutter(),
        FoldedClutter(),
        DopplerFilter(),
        CellAveraging(),
        OneReportByCell(),
        MeasuredStrength(),
        FalseAlarms(),
        ClutterAlarms(),
        TimeBudget(),
        BeamSweep(),
        CUED_LOOKS,
    )

    ladders = (DETECTION, RCS)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.budget = parameters.link_budget()
        self.wavelength_m = self.budget.wavelength
        # Until the scene's effects are known, all that the parameters and targets call for.
        self._echo_budget = self.budget
        #: Each cell's mean RCS, m².
        self.mean_rcs_m2: CellValues = mean_rcs_m2
        self._beam_shape: CellValues | None = None
        self._propagation: CellValues | None = None
        self._roster: Roster | None = None

    def setup(self) -> None:
        """Store the scene's effects on the SNR."""
        super().setup()
        self._echo_budget = self._far_field_link_budget()
        self.mean_rcs_m2 = self.built_one(MEAN_RCS) or constant_rcs_m2
        self._beam_shape = self.built_one(BEAM_SHAPE)
        self._propagation = self.built_one(PROPAGATION)
        if self.built(CUE) and self.p.cued_dwell_factor is not None:
            self.snr_factors = [*self.snr_factors, cued_snr_factor_function(self.p)]
        self._set_threshold()
        if noise := self.context.effects.get(FalseAlarms.name):
            noise.refuse_too_many()

    def _set_threshold(self) -> None:
        """Set the threshold once the scene's effects are known; by default do nothing."""

    def _far_field_link_budget(self) -> Any:
        """Return the link budget with far-field minimum range, or the present one if nearer."""
        far_field = replace(self.budget, minimum_range_m=None)
        # A minimum range inside the near field is the scene's word that there are echoes.
        return far_field if far_field.nearest_m < self.budget.nearest_m else self.budget

    def run(self, wake: Wake) -> Detections | None:
        """Look at every target in reach at every scan of the wake."""
        held = wake.held("targets")
        if held is not None and held[0].roster is not self._roster:
            self._roster = held[0].roster
            self._check_roster_was_offered(self._roster)
        return super().run(wake)

    def _check_roster_was_offered(self, roster: Roster) -> None:
        """Raise ValueError if the targets are not those that the traffic offered before."""
        known = offered_rosters(self.context)
        if known and not any(roster.names == other.names for other in known):
            raise ValueError(
                "these targets were not offered before the run, and others were: a traffic block "
                "must offer the roster that its messages carry"
            )

    def snr(self, cells: Cells) -> FloatArray:
        """Return each cell's mean SNR (linear), 0 closer than the minimum range (eq. 7-8)."""
        snr = self.echo_snr(cells, effect_values_of_cells(self, self.mean_rcs_m2, cells))
        return snr if self._propagation is None else snr * self._propagation(cells)

    def echo_snr(self, cells: Cells, rcs_m2: FloatArray) -> FloatArray:
        """Return each cell's SNR for the given cross-sections, with all losses on the way."""
        snr = self._echo_budget.snr_of_cells(cells.range_m, rcs_m2)
        for factor in self.snr_factors:
            snr = snr * effect_values_of_cells(self, factor, cells)
        return snr

    def signal_variances(self, signal: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return the variances that follow from the ratio of signal to noise and clutter."""
        return signal_variances(self.p, signal["snr"])

    def received_snr_and_clutter(self, cells: Cells) -> tuple[FloatArray, Clutter | None]:
        """Return cells' SNR after Doppler filter and merging, and the clutter or None.

        Both as the detector has them: behind a moving-target filter, where there is one.
        """
        snr, beside = self.snr(cells), [self.echo_snr(cells, echo(cells)) for echo in self.echoes]
        if self._beam_shape is not None:
            snr = snr * self._beam_shape(cells)
        snr, beside = self.filter_echoes(cells, snr, beside)
        clutter = Clutter.sum_echoes(self.echoes, beside, len(cells)) if self.echoes else None
        return self.merge_echoes_by_cell(cells, snr), clutter

    @property
    def crossing(self) -> Crossing:
        """Threshold of a look outside cue cones, with its probability of false alarm."""
        return Crossing.from_false_alarms(self.p.pulses_summed, self.p.false_alarm_probability)

    def cued_crossing(self) -> Crossing | None:
        """Return the threshold of a look inside a cue cone; None if it is the same as elsewhere."""
        return None

    def crossings_with_positions(
        self, cells: Cells, detected: IntArray
    ) -> list[tuple[Crossing, IntArray]]:
        """Return pairs of a threshold and the positions of the detected cells it applies to."""
        cued = self.cued_crossing()
        if cued is None or cells.cued is None:
            return [(self.crossing, np.arange(len(detected)))]
        inside = cells.cued[detected]
        return [(cued, np.flatnonzero(inside)), (self.crossing, np.flatnonzero(~inside))]

    def swerling_models_and_cells(self, cells: Cells) -> list[tuple[int, Any]]:
        """Return pairs (Swerling model for Pd, its cells); here model 0 (steady) for all."""
        return [(0, slice(None))]

    def confidence_zero_snr_db(self) -> float:
        """Return the SNR in dB at which the confidence of a false alarm is 0."""
        raise TypeError(f"{type(self).__name__} does not say what its confidence is measured from")

    def add_noise_reports(
        self,
        detections: Detections,
        targets: RelativeTargets,
        rows: IntArray,
        row: IntArray,
        where: dict[str, FloatArray],
        *,
        key: AnyArray,
        snr: FloatArray,
        rate: FloatArray,
        cued: bool | None = None,
    ) -> Detections:
        """Return the detections with false reports by noise added in the given rows.

        They are given by ascending row of the report, position by quantity in the sensor's axes,
        key of their draws, how strong they came out (linear, above 0), and a uniform number that
        says the range rate. `cued` says whether only those inside cue cones are kept, or those
        outside; None keeps all.
        """
        if self.p.measures_range_rate:
            range_rate = self.random_range_rates_m_s(rate, where, targets, rows[row])
            where = {**where, "range_rate": range_rate}
        scan, tick, run = detections.scan[row], detections.tick[row], detections.run[row]
        instant_ns = ticks_to_nanoseconds(tick, self.context.ticks_per_s)
        azimuth, elevation, range_m, measured = self.report_false_alarms(
            where, {"snr": snr}, (key, scan, instant_ns, run)
        )
        snr_db = 10.0 * np.log10(snr)
        extras: dict[str, AnyArray] = {"snr_db": snr_db}
        kept: Any = slice(None)
        if cones := self.built_one(CUE):
            inside = cones.is_in_cones(row, azimuth, elevation)
            extras["cued"] = inside
            kept = slice(None) if cued is None else np.flatnonzero(inside == cued)
        return add_false_detections(
            detections,
            row[kept],
            azimuth_rad=azimuth[kept],
            elevation_rad=elevation[kept],
            range_m=range_m[kept],
            confidence=(snr_db - self.confidence_zero_snr_db())[kept],
            extras={name: values[kept] for name, values in extras.items()},
            measured={name: values[kept] for name, values in measured.items()},
        )

    def describe_threshold_key(self) -> str:
        """Return the key that sets the probability of false alarm, and its value."""
        return f"false_alarm_probability is {self.p.false_alarm_probability:g}"

    def largest_pd_slope(self) -> float | None:
        """Return the largest |dPd / d ln SNR| of any target, or None where Pd jumps."""
        return None

    def required_snr_db(self, pd: float, model: str) -> float:
        """Return the mean SNR per pulse in dB at which the probability of detection is `pd`."""
        snr = required_snr(
            pd,
            pulses=self.p.pulses_summed,
            false_alarm_probability=self.p.false_alarm_probability,
            model=model,
        )
        return float(10.0 * np.log10(snr))

    def skipped_work_notes(self) -> list[str]:
        """Return sentences on attenuation that the scene leaves out, and on ambiguous echoes."""
        said = [*super().skipped_work_notes(), *neglected_gas_loss_notes(self)]
        if self.p.prf_hz is not None and self.p.range_km is None and not self.p.range_folds:
            range_km = self.stated_reach.range_max_m / 1000.0
            said.append(
                f"targets beyond {range_km:.4g} km: not looked at, their echoes come after the "
                f"next pulse (prf_hz is {self.p.prf_hz:g})"
            )
        return said

    def warnings(self) -> list[str]:
        """Return a warning for each value that no radar has, and on its false alarm probability."""
        snr_db = self.required_snr_db(0.5, "swerling1")
        return [
            *super().warnings(),
            *implausible_value_warnings(self.p),
            *high_pfa_warnings(self.p, snr_db),
            *cue_warnings(self),
            *moved_threshold_warnings(self.p),
            *false_alarm_count_warnings(self),
            *clutter_as_signal_warnings(self.p, terrain_of(self)),
            *beam_gain_warnings(self.p),
            *rain_echo_warnings(self),
            *neglected_gas_loss_notes(self),
        ]

    def report(self) -> dict[str, Any]:
        """Return the bandwidth in use and how a scan's time is spent, for the run's summary."""
        return {
            **super().report(),
            "link_budgets": {self.name: {"bandwidth_hz": float(self.budget.bandwidth_hz)}},
            **time_report(self.name, self.p),
        }


class ThresholdRadar(LinkBudgetRadar):
    """Detects a target when its mean SNR reaches a threshold.

    Confidence is the SNR above the threshold in dB. Ground clutter counts as more noise: where
    there is some, the SNR is that over noise and clutter (the recorded one is over noise alone).
    With ``clutter_threshold = "noise"`` it counts as signal. A threshold from reference cells is
    higher by the CFAR loss, that of the calibration's Pd and target (else Pd 0.9, Swerling I).
    """

    Parameters = ThresholdParameters

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        known = parameters.calibrate
        pd = 0.9 if known is None else known.pd
        self._stated_for = pd, "swerling1" if known is None else f"swerling{known.swerling}"
        if parameters.threshold_db is not None:
            self.threshold_db = float(parameters.threshold_db)
        else:
            self.threshold_db = self.required_snr_db(*self._stated_for)

    def _set_threshold(self) -> None:
        """Raise the threshold by the CFAR loss, and set the threshold for cue cones."""
        if self.cfar is not None:
            self.threshold_db += self.cfar.loss_db(*self._stated_for)
        self.cued_threshold_db = self.threshold_db
        if self.p.cued_threshold_db is not None:
            self.cued_threshold_db = self.p.cued_threshold_db
            if self.cfar is not None:
                self.cued_threshold_db += self.cfar.loss_db(*self._stated_for)

    @property
    def crossing(self) -> Crossing:
        """Threshold of a look outside cue cones, by ``threshold_db``, with the Pfa it implies."""
        return Crossing.from_snr(self.p.pulses_summed, self.threshold_db)

    def cued_crossing(self) -> Crossing | None:
        """Return the threshold of a look inside a cue cone; None if it is the same as elsewhere."""
        if self.cued_threshold_db == self.threshold_db:
            return None
        return Crossing.from_snr(self.p.pulses_summed, self.cued_threshold_db)

    def describe_threshold_key(self) -> str:
        """Return the key that sets the probability of false alarm, and its value."""
        given = "" if self.p.threshold_db is not None else " (not given)"
        return f"threshold_db{given} is {self.threshold_db:g}"

    def confidence_zero_snr_db(self) -> float:
        """Return the threshold in dB, from which the confidence of a false alarm is counted."""
        return self.threshold_db

    def look(self, cells: Cells) -> Look:
        """Return which cells' SNR reaches the threshold, with their margin."""
        snr, clutter = self.received_snr_and_clutter(cells)
        cnr = None if clutter is None else clutter.total
        echo = snr > 0.0
        snr_db = 10.0 * np.log10(np.where(echo, snr, np.nan))
        margin = snr_db - self._threshold_of(cells)
        if cnr is not None and self.p.clutter_threshold == "noise":
            margin = margin + 10.0 * np.log10(1.0 + cnr / np.where(echo, snr, 1.0))
        elif cnr is not None:
            margin = margin - 10.0 * np.log10(1.0 + cnr)
        return Look(
            margin >= 0.0, margin, {"snr_db": snr_db}, signal_over_noise_and_clutter(snr, cnr)
        )

    def _threshold_of(self, cells: Cells) -> Any:
        """Return the threshold in dB: one for all, or each cell's own where some are cued."""
        if cells.cued is None:
            return self.threshold_db
        return np.where(cells.cued, self.cued_threshold_db, self.threshold_db)
