"""Parameters of what a radar's range and range rate err by, beside its angles."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from components.radar.resolution_parameters import ResolutionParameters
from components.sensor.error_parameters import CorrelationTime, ErrorParameters, GlintParameters
from dsa_des.errors import Disagreements


class RadarErrorParameters(ResolutionParameters):
    """Errors of range and range rate, and whether the latter is measured."""

    quantities: ClassVar[Mapping[str, str]] = {
        **ErrorParameters.quantities, "range": "m", "range_rate": "m_s"
    }  # fmt: skip

    range_error_m: float = Field(
        default=0.0, ge=0, description="Standard deviation of measured range, m."
    )
    range_bias_m: float = Field(default=0.0, description="Bias of measured range, m; see biases.")
    range_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of range_error_m, s."
    )
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

    @model_validator(mode="after")
    def _rate_is_measured(self) -> Self:
        Disagreements.refuse(
            f"{key} is {getattr(self, key):g} and measures_range_rate is false: set it to true, "
            f"or leave {key} out"
            for key in ("range_rate_resolution_m_s", "range_rate_error_m_s", "range_rate_bias_m_s")
            if not self.measures_range_rate and getattr(self, key)
        )
        return self


class SignalErrorParameters(GlintParameters, RadarErrorParameters):
    """Errors that follow from the signal-to-noise ratio of each detection."""

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

    def without_effect(self) -> list[str]:
        """Say which keys belong to errors by signal, where there are none."""
        said = super().without_effect()
        if self.errors != "signal":
            said += self.idle("angle_measurement", because=f"errors is '{self.errors}'")
        return said
