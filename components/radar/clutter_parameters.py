"""Parameters of every radar that say how its threshold follows noise and clutter."""

from typing import Literal, Self

from pydantic import Field, model_validator

from components.radar.cfar import FEWEST_CELLS, MOST_CELLS
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

    @model_validator(mode="after")
    def _one_threshold(self) -> Self:
        if self.cfar_reference_cells is not None and self.clutter_threshold == "noise":
            raise ValueError(
                f"cfar_reference_cells is {self.cfar_reference_cells} and clutter_threshold is "
                "'noise': an average of cells follows clutter; leave one of them out"
            )
        return self
