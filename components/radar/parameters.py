"""Parameters that radar blocks share: beam, threshold, filter, cues, and the link budget."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from components.radar.detection.cfar import FEWEST_CELLS, MOST_CELLS
from components.radar.detection.probability import detection_probability, required_snr
from components.radar.doppler import FEWEST_PULSES, MOST_PULSES
from components.radar.link_budget import (
    LinkBudget,
    antenna_gain_from_beam_db,
    calibrated_bandwidth,
    implausible_value_warnings,
)
from components.radar.measurement import check_signal_errors
from components.radar.resolution import ResolutionParameters
from components.radar.timing import TimeBudgetParameters
from components.sensor.parameters import CorrelationTime, GlintParameters
from dsa_des.block.component import Parameters
from dsa_des.errors import Disagreements


def cued_snr_factor_function(parameters: Any) -> Any:
    """Return a function giving cells' SNR factor: the cued dwell factor in cue cones, else 1."""

    def factor(cells: Any) -> Any:
        if cells.cued is None:
            return 1.0
        return 1.0 + (parameters.cued_dwell_factor - 1.0) * cells.cued

    return factor


class RadarParameters(ResolutionParameters):
    """Parameters of every radar: range rate, threshold and filter beyond noise, and beam."""

    may_change: ClassVar[tuple[str, ...]] = (
        "range_rate_resolution_m_s", "range_rate_error_m_s", "improvement_limit_db",
        "rain_rejection_db",
    )  # fmt: skip

    quantities: ClassVar[Mapping[str, str]] = {
        **ResolutionParameters.quantities, "range_rate": "m_s"
    }  # fmt: skip

    measures_range_rate: bool = Field(
        default=False,
        description="Whether the rate of the slant range is measured, by its Doppler shift.",
    )
    range_rate_resolution_m_s: float = Field(
        default=0.0, ge=0, description="Grid step of measured range rate, m/s; 0 measures exactly."
    )
    range_rate_error_m_s: float = Field(
        default=0.0, ge=0, description="Standard deviation of measured range rate, m/s."
    )
    range_rate_bias_m_s: float = Field(
        default=0.0, description="Bias of measured range rate, m/s; see biases."
    )
    range_rate_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of range_rate_error_m_s, s."
    )

    clutter_threshold: Literal["adaptive", "noise"] = Field(
        default="adaptive",
        description="Over ground clutter: 'adaptive' follows its power and keeps the probability "
        "of false alarm, so clutter hides targets; 'noise' stays, so clutter is detected as if it "
        "were the target.",
    )
    cfar_reference_cells: int | None = Field(
        default=None,
        ge=FEWEST_CELLS,
        le=MOST_CELLS,
        description="Cells around whose average (CFAR) sets the threshold, with the loss of so "
        "few; by default the mean power of noise and clutter is known.",
    )

    moving_target_filter: Literal["none", "single_canceller", "double_canceller", "filter_bank"] = (
        Field(
            default="none",
            description="Doppler processing that takes out the echo of the ground, and of "
            "targets as slow or at a blind speed; it needs prf_hz.",
        )
    )
    filter_pulses: int = Field(
        default=16,
        ge=FEWEST_PULSES,
        le=MOST_PULSES,
        description="Pulses, and filters, of a filter_bank.",
    )
    notch_m_s: float | None = Field(
        default=None,
        ge=0,
        description="Filters of a filter_bank nearer to the ground's range rate than this are not "
        "used, m/s; by default those within the half width of their main lobe.",
    )
    clutter_lock: bool = Field(
        default=True,
        description="Whether the notch follows the range rate of the ground in the beam; else it "
        "lies at range rate 0.",
    )
    improvement_limit_db: float = Field(
        default=60.0,
        ge=0,
        le=150,
        description="Clutter over what a filter leaves of it at most, by the radar's own "
        "instabilities, dB (assumption).",
    )

    range_rate_folds: bool = Field(
        default=False,
        description="Whether measured range rates are ambiguous, as those of one PRF are: a rate "
        "beyond the unambiguous velocity, wavelength * prf_hz / 4, folds back within.",
    )

    beam_sweep: bool = Field(
        default=False,
        description="Whether a beam sweeps clockwise over the field of view once per scan: each "
        "target is measured at the instant it is lit, which is recorded.",
    )
    polarisation: Literal["horizontal", "vertical", "slant", "circular"] = Field(
        default="slant",
        description="Polarisation of the wave, 'slant' being linear at 45 deg. Rain attenuates "
        "slant and circular waves alike, and echoes circular ones less (rain_rejection_db).",
    )
    rain_rejection_db: float = Field(
        default=15.0,
        ge=0,
        le=40,
        description="How much less of the rain's echo a circular polarisation receives, dB: 10 in "
        "heavy rain to 30 in drizzle (assumption).",
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key without effect, as the filter or rain is switched off."""
        said, kind = super().ineffective_key_notes(), self.moving_target_filter
        because = f"moving_target_filter is '{kind}'"
        if kind != "filter_bank":
            said += self.note_ineffective("filter_pulses", because=because)
        if kind == "none":
            said += self.note_ineffective("clutter_lock", "improvement_limit_db", because=because)
        if self.polarisation != "circular":
            because = f"polarisation is '{self.polarisation}'"
            said += self.note_ineffective("rain_rejection_db", because=because)
        return said

    @model_validator(mode="after")
    def _check_range_rate_keys(self) -> Self:
        Disagreements.raise_if_any(
            f"{key} is {getattr(self, key):g} and measures_range_rate is false: set it to true, "
            f"or leave {key} out"
            for key in ("range_rate_resolution_m_s", "range_rate_error_m_s", "range_rate_bias_m_s")
            if not self.measures_range_rate and getattr(self, key)
        )
        return self

    @model_validator(mode="after")
    def _check_cfar_or_noise_threshold(self) -> Self:
        if self.cfar_reference_cells is not None and self.clutter_threshold == "noise":
            raise ValueError(
                f"cfar_reference_cells is {self.cfar_reference_cells} and clutter_threshold is "
                "'noise': an average of cells follows clutter; leave one of them out"
            )
        return self

    @model_validator(mode="after")
    def _check_doppler_filter_keys(self) -> Self:
        kind = self.moving_target_filter
        if self.range_rate_folds:
            for key in ("measures_range_rate", "prf_hz"):
                if not getattr(self, key, None):
                    said = "is false" if key == "measures_range_rate" else "is not given"
                    raise ValueError(
                        f"range_rate_folds is true and {key} {said}: the unambiguous velocity "
                        "follows from prf_hz, and what folds is the measured range rate"
                    )
        if kind != "none" and getattr(self, "prf_hz", None) is None:
            raise ValueError(
                f"moving_target_filter is {kind!r} and prf_hz is not given: blind speeds and the "
                "width of the notch follow from it"
            )
        needed = {"single_canceller": 2, "double_canceller": 3, "filter_bank": self.filter_pulses}
        look = getattr(self, "look_energy", None)
        known = getattr(self, "stated_pulses", None) if look is None else look.pulses
        if kind != "none" and known is not None and known < needed[kind]:
            raise ValueError(
                f"moving_target_filter is {kind!r}: it adds up {needed[kind]} pulses, and a look "
                f"has {known}; lengthen the dwell, or take a filter of fewer pulses"
            )
        if kind != "filter_bank" and self.notch_m_s is not None:
            raise ValueError(
                f"notch_m_s is {self.notch_m_s:g} and moving_target_filter is {kind!r}: only a "
                "'filter_bank' has filters to leave out"
            )
        return self


class Calibration(Parameters):
    """One known detection range, from which the bandwidth follows (errata 6)."""

    rcs_dbsm: float = Field(description="Radar cross-section of the target, dBsm.")
    range_km: float = Field(gt=0, description="Range at which Pd is known, km.")
    pd: float = Field(gt=0, lt=1, description="Probability of detection there.")
    swerling: int = Field(
        default=1, ge=0, le=5, description="Fluctuation model the range was stated for."
    )
    false_alarm_probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Probability of false alarm that the range was stated for; by default the "
        "radar's own in the file that calibrates it. Whoever overrides that one moves the "
        "threshold and keeps the hardware.",
    )


class LinkBudgetParameters(GlintParameters, RadarParameters, TimeBudgetParameters):
    """Parameters of a radar with a link budget (thesis eq. 7-8, errata 5)."""

    may_change: ClassVar[tuple[str, ...]] = (
        "power_w", "antenna_gain_db", "integration_gain_db", "noise_figure_db", "losses_db",
        "minimum_range_m", "false_alarm_probability",
    )  # fmt: skip

    as_written_with = {("calibrate", "false_alarm_probability"): "false_alarm_probability"}
    former = {
        "cell_false_alarm_probability": "false alarms cross the one threshold that targets cross: "
        "use false_alarm_probability, of radar.threshold threshold_db"
    }

    errors: Literal["grid", "stated", "signal"] = Field(  # type: ignore[assignment]
        default="grid",
        description="What measured values err by: 'grid', rounding to the grid alone; 'stated', "
        "the standard deviations and biases that the scene gives; 'signal', those that follow from "
        "the SNR and the widths of beam and resolution cell, beside the stated ones.",
    )
    angle_measurement: Literal["monopulse", "scan"] = Field(
        default="monopulse",
        description="How errors = 'signal' has angles measured: by beams at the same time, or by "
        "splitting one beam that scans over the target.",
    )
    power_w: float | None = Field(
        default=None,
        gt=0,
        description="Transmitted power, W; with calibrate it changes nothing and may be left out.",
    )
    antenna_gain_db: float | None = Field(
        default=None,
        description="Gain of the antenna, both ways the same, dB; with calibrate it changes only "
        "the antenna's far field (minimum_range_m) and is by default that of the beamwidths.",
    )
    wavelength_m: float | None = Field(default=None, gt=0, description="Wavelength, m.")
    frequency_hz: float | None = Field(
        default=None, gt=0, description="Frequency instead of the wavelength, Hz."
    )
    integration_gain_db: float = Field(
        default=0.0, description="Coherent integration gain, dB; never together with pulses > 1."
    )
    noise_figure_db: float = Field(default=0.0, description="Noise figure, dB.")
    losses_db: float = Field(default=0.0, description="System losses, dB.")
    bandwidth_hz: float | None = Field(default=None, gt=0, description="Noise bandwidth, Hz.")
    calibrate: Calibration | None = Field(
        default=None, description="A known detection range instead of the bandwidth."
    )
    minimum_range_m: float | None = Field(
        default=None,
        gt=0,
        description="Closer than this no echo is processed, m; by default the antenna's far field.",
    )
    false_alarm_probability: float = Field(
        default=0.05, gt=0, lt=1, description="Probability of false alarm per look and cell."
    )
    false_alarms: bool = Field(
        default=False, description="Whether noise is reported too, in any resolution cell."
    )
    aspect_rcs: bool = Field(
        default=True, description="Whether an aircraft's rcs_table is used; else its rcs_dbsm."
    )
    pulses: int = Field(default=1, ge=1, le=1000, description="Pulses integrated non-coherently.")
    cued_dwell_factor: float | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="Time on a beam within a cue cone, in times of the usual one, added up "
        "coherently: a factor of the SNR. By default as usual.",
    )
    cued_beam_first: bool = Field(
        default=False,
        description="Whether a sweeping beam visits cue cones as a scan begins, and then sweeps.",
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key on errors by signal, where there are no such errors."""
        said = super().ineffective_key_notes()
        if self.errors != "signal":
            said += self.note_ineffective("angle_measurement", because=f"errors is '{self.errors}'")
        return said

    @model_validator(mode="after")
    def _check_link_budget_is_complete(self) -> Self:
        if (self.wavelength_m is None) == (self.frequency_hz is None):
            raise ValueError("exactly one of wavelength_m and frequency_hz must be given")
        if self.calibrate is None:
            missing = [k for k in ("power_w", "antenna_gain_db") if getattr(self, k) is None]
            if missing:
                raise ValueError(
                    f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not given: "
                    "only calibrate, a known detection range, stands for them"
                )
        if (self.bandwidth_hz is None) == (self.calibrate is None):
            raise ValueError("exactly one of bandwidth_hz and calibrate must be given")
        if self.pulses > 1 and self.integration_gain_db > 0:
            raise ValueError(
                "integration_gain_db and pulses > 1 would count the same pulses twice; "
                "set one of them"
            )
        self.check_pulses_once(self.pulses, self.integration_gain_db)
        look = self.look_energy
        if look is not None and self.calibrate is not None and self.stated_dwell_s is None:
            raise ValueError(
                "calibrate is given and budget is 'dwell': how long was the look that the range "
                "was stated for? Give dwell_s or pulses_per_dwell"
            )
        check_signal_errors(self)
        if self.cued_beam_first and not self.beam_sweep:
            raise ValueError("cued_beam_first is true and beam_sweep is false: no beam sweeps")
        return self

    @property
    def pulses_summed(self) -> int:
        """Pulses of a look that are summed non-coherently."""
        if self.budget != "dwell" or (look := self.look_energy) is None:
            return self.pulses
        return look.summed

    @property
    def calibrated_pfa(self) -> float:
        """Probability of false alarm at which the calibration's range holds."""
        stated = None if self.calibrate is None else self.calibrate.false_alarm_probability
        return self.false_alarm_probability if stated is None else stated

    @property
    def stated_pulses_summed(self) -> int:
        """Pulses summed non-coherently in the look for which the link budget is stated."""
        if self.budget == "dwell" and self.integration == "noncoherent":
            return self.stated_pulses or 1
        return self.pulses

    def link_budget(self) -> LinkBudget:
        """Return the link budget of a look, its bandwidth calibrated where the scene asks for it.

        What is calibrated is the look that the scene states; the energy of the look that the scan
        leaves time for comes after.
        """
        budget = self._stated_link_budget()
        look = self.look_energy
        if look is None or look.gain == 1.0:
            return budget
        gain_db = self.integration_gain_db + 10.0 * math.log10(look.gain)
        return replace(budget, integration_gain_db=gain_db)

    def _stated_link_budget(self) -> LinkBudget:
        given = {one.name: getattr(self, one.name) for one in fields(LinkBudget)}
        if self.power_w is None:  # the bandwidth that is calibrated makes up for it
            given["power_w"] = 1.0
        if self.antenna_gain_db is None:
            given["antenna_gain_db"] = antenna_gain_from_beam_db(
                self.azimuth_beamwidth_deg, self.elevation_beamwidth_deg
            )
        budget = LinkBudget(**{**given, "bandwidth_hz": self.bandwidth_hz or 1.0})
        if self.calibrate is None:
            return budget
        try:
            bandwidth_hz = calibrated_bandwidth(
                budget,
                rcs_dbsm=self.calibrate.rcs_dbsm,
                range_km=self.calibrate.range_km,
                pd=self.calibrate.pd,
                pulses=self.stated_pulses_summed,
                false_alarm_probability=self.calibrated_pfa,
                model=f"swerling{self.calibrate.swerling}",
            )
        except ValueError as error:
            # What follows from a carrier of 24 Hz must not be blamed on the range.
            wrong = implausible_value_warnings(self)
            raise ValueError("; ".join([*wrong, str(error)])) from error
        return replace(budget, bandwidth_hz=bandwidth_hz)


def moved_threshold_warnings(p: LinkBudgetParameters) -> list[str]:
    """Return a sentence with Pd at the calibration range, if Pfa there is not that in use."""
    known, stated, now = p.calibrate, p.calibrated_pfa, p.false_alarm_probability
    if known is None or stated == now:
        return []
    look: dict[str, Any] = {
        "pulses": p.stated_pulses_summed,
        "model": f"swerling{known.swerling}",
    }
    snr = required_snr(known.pd, false_alarm_probability=stated, **look)
    pd = float(detection_probability(snr, false_alarm_probability=now, **look))
    return [
        f"calibrate holds at false_alarm_probability {stated:g} and the threshold is set for "
        f"{now:g}: the hardware stays, and Pd at {known.range_km:g} km is {pd:.3g} instead of "
        f"{known.pd:g}"
    ]
