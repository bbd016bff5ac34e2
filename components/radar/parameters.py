"""Parameters that radar blocks share, and the link budget they describe."""

import math
from dataclasses import replace
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from components.radar.clutter_parameters import ClutterParameters
from components.radar.cued_parameters import CuedRadarParameters
from components.radar.error_parameters import RadarErrorParameters, SignalErrorParameters
from components.radar.link_budget import LinkBudget, calibrated_bandwidth
from components.radar.plausible import implausible
from components.radar.signal_errors import check_signal_errors
from components.radar.time_parameters import TimeBudgetParameters
from dsa_des.block.component import Parameters


class RadarParameters(RadarErrorParameters, ClutterParameters):
    """Parameters of every radar."""

    def without_effect(self) -> list[str]:
        """Say that what a circular polarisation rejects belongs to no other."""
        said = super().without_effect()
        if self.polarisation != "circular":
            because = f"polarisation is '{self.polarisation}'"
            said += self.idle("rain_rejection_db", because=because)
        return said

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


class LinkBudgetParameters(
    SignalErrorParameters, RadarParameters, TimeBudgetParameters, CuedRadarParameters
):
    """Parameters of a radar with a link budget (thesis eq. 7-8, errata 5)."""

    as_written_with = {("calibrate", "false_alarm_probability"): "false_alarm_probability"}
    former = {
        "cell_false_alarm_probability": "false alarms cross the one threshold that targets cross: "
        "use false_alarm_probability, of radar.threshold threshold_db"
    }

    power_w: float = Field(gt=0, description="Transmitted power, W.")
    antenna_gain_db: float = Field(description="Gain of the antenna, both ways the same, dB.")
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

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.wavelength_m is None) == (self.frequency_hz is None):
            raise ValueError("exactly one of wavelength_m and frequency_hz must be given")
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
        """Pulses summed non-coherently in the look that the link budget describes."""
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
        budget = LinkBudget(
            power_w=self.power_w,
            antenna_gain_db=self.antenna_gain_db,
            bandwidth_hz=self.bandwidth_hz or 1.0,
            wavelength_m=self.wavelength_m,
            frequency_hz=self.frequency_hz,
            integration_gain_db=self.integration_gain_db,
            noise_figure_db=self.noise_figure_db,
            losses_db=self.losses_db,
            minimum_range_m=self.minimum_range_m,
        )
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
            wrong = implausible(self)
            raise ValueError("; ".join([*wrong, str(error)])) from error
        return replace(budget, bandwidth_hz=bandwidth_hz)


def budget_report(name: str, budget: LinkBudget) -> dict[str, Any]:
    """Return the section of the run's summary that records the bandwidth in use."""
    return {"link_budgets": {name: {"bandwidth_hz": float(budget.bandwidth_hz)}}}
