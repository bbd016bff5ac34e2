"""Parameters of every radar that say how its threshold follows noise and clutter."""

from typing import Literal, Self

from pydantic import Field, model_validator

from components.radar.cfar import FEWEST_CELLS, MOST_CELLS
from components.radar.moving_target_filter import FEWEST_PULSES, MOST_PULSES
from components.sensor.parameters import SensorParameters


class ClutterParameters(SensorParameters):
    """What the threshold does where there is more than noise."""

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
        description="Whether measured range rates are ambiguous, as those of one PRF are: what is "
        "beyond the unambiguous velocity, wavelength * prf_hz / 4, folds back within.",
    )

    def without_effect(self) -> list[str]:
        """Say which keys belong to a filter that there is not."""
        said, kind = super().without_effect(), self.moving_target_filter
        because = f"moving_target_filter is '{kind}'"
        if kind != "filter_bank":
            said += self.idle("filter_pulses", because=because)
        if kind == "none":
            said += self.idle("clutter_lock", "improvement_limit_db", because=because)
        return said

    @model_validator(mode="after")
    def _one_threshold(self) -> Self:
        if self.cfar_reference_cells is not None and self.clutter_threshold == "noise":
            raise ValueError(
                f"cfar_reference_cells is {self.cfar_reference_cells} and clutter_threshold is "
                "'noise': an average of cells follows clutter; leave one of them out"
            )
        return self

    @model_validator(mode="after")
    def _filter(self) -> Self:
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
