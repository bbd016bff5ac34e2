"""Parameters of what a sensor's measured values err by."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from dsa_des.block.component import ClockedParameters
from dsa_des.errors import Disagreements
from dsa_des.time.gauss_markov import LONGEST_S

CorrelationTime = Annotated[float, Field(gt=0, le=LONGEST_S)]


@dataclass(frozen=True)
class StatedError:
    """What a scene states of the error of one measured quantity; in the scene's unit.

    Parameters
    ----------
    deviation : float
        Standard deviation of what changes from look to look.
    bias : float
        What stays the same throughout a run, or the largest it may be.
    correlation_time_s : float or None
        How long the changing part lasts; None for an error that is new at every look.
    """

    deviation: float
    bias: float
    correlation_time_s: float | None


class ErrorParameters(ClockedParameters):
    """Errors of measured angles, in the sensor's own axes; radars add range and range rate."""

    #: Measured quantities, and the unit in which scenes give their errors.
    quantities: ClassVar[Mapping[str, str]] = {"azimuth": "deg", "elevation": "deg"}

    errors: Literal["grid", "stated"] = Field(
        default="grid",
        description="What measured values err by: 'grid', rounding to the grid alone; 'stated', "
        "the standard deviations and biases that the scene gives.",
    )
    quantised: bool = Field(
        default=True,
        description="Whether values with errors other than 'grid' are rounded to the grid too.",
    )
    biases: Literal["drawn", "fixed"] = Field(
        default="drawn",
        description="Whether a bias is drawn once for a run, uniformly between minus and plus the "
        "value given, or is that value.",
    )
    azimuth_error_deg: float = Field(
        default=0.0, ge=0, le=180, description="Standard deviation of measured azimuth, deg."
    )
    azimuth_bias_deg: float = Field(
        default=0.0, ge=-180, le=180, description="Bias of measured azimuth, deg; see biases."
    )
    azimuth_correlation_time_s: CorrelationTime | None = Field(
        default=None,
        description="Time after which azimuth_error_deg has forgotten all but 1/e, s; by default "
        "it is new at every look.",
    )
    elevation_error_deg: float = Field(
        default=0.0, ge=0, le=90, description="Standard deviation of measured elevation, deg."
    )
    elevation_bias_deg: float = Field(
        default=0.0, ge=-90, le=90, description="Bias of measured elevation, deg; see biases."
    )
    elevation_correlation_time_s: CorrelationTime | None = Field(
        default=None, description="As azimuth_correlation_time_s, of elevation_error_deg, s."
    )

    @model_validator(mode="after")
    def _errors(self) -> Self:
        wrong = []
        for name, unit in self.quantities.items():
            deviation, bias, lasts = self._keys(name, unit)
            wrong += [
                f"{key} is {getattr(self, key):g} and errors is 'grid', which knows no errors but "
                f"rounding: set errors to 'stated', or leave {key} out"
                for key in (deviation, bias)
                if self.errors == "grid" and getattr(self, key)
            ]
            if getattr(self, lasts) is not None and not getattr(self, deviation):
                wrong.append(
                    f"{lasts} is given and {deviation} is 0: there is nothing that lasts; give "
                    f"both or neither"
                )
        Disagreements.refuse(wrong)
        return self

    def without_effect(self) -> list[str]:
        """Say which keys belong to errors that there are not."""
        said = super().without_effect()
        if self.errors == "grid":
            return said + self.idle("quantised", "biases", because="errors is 'grid'")
        biases = [self._keys(name, unit)[1] for name, unit in self.quantities.items()]
        if not any(getattr(self, key) for key in biases):
            said += self.idle("biases", because=f"none of {', '.join(biases)} is given")
        return said

    @staticmethod
    def _keys(name: str, unit: str) -> tuple[str, str, str]:
        return f"{name}_error_{unit}", f"{name}_bias_{unit}", f"{name}_correlation_time_s"

    def stated_error(self, name: str) -> StatedError:
        """Return what the scene states of one of the `quantities`."""
        values = (getattr(self, key) for key in self._keys(name, self.quantities[name]))
        return StatedError(*values)


class GlintParameters(ErrorParameters):
    """How far the centre of a target that is seen wanders over it, beside errors by signal."""

    glint_share: float = Field(
        default=0.2,
        ge=0,
        le=1,
        description="Standard deviation of where a target seems to be, as a share of its extent, "
        "for errors = 'signal': glint of radars, the centroid's wander of cameras; 0.15 to 0.25 is "
        "measured of aircraft.",
    )
    glint_correlation_time_s: CorrelationTime = Field(
        default=0.2, description="Time after which that has forgotten all but 1/e, s."
    )

    def without_effect(self) -> list[str]:
        """Say which keys belong to a wander that there is not."""
        said = super().without_effect()
        if self.errors != "signal":
            return said + self.idle(
                "glint_share", "glint_correlation_time_s", because=f"errors is '{self.errors}'"
            )
        if not self.glint_share:
            said += self.idle("glint_correlation_time_s", because="glint_share is 0")
        return said
