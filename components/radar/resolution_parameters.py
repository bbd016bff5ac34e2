"""Parameters of every radar that say what two targets in one resolution cell come to."""

from typing import Self

from pydantic import Field, model_validator

from components.sensor.parameters import SensorParameters
from dsa_des.errors import Disagreements

#: Keys of a cell's size: the beamwidth, which comes before the grid step.
CELL_SIZES = (
    ("azimuth_beamwidth_deg", "azimuth_resolution_deg"),
    ("elevation_beamwidth_deg", "elevation_resolution_deg"),
    ("", "range_resolution_m"),
)


class ResolutionParameters(SensorParameters):
    """Grid of range, and whether its cells are what the radar tells apart."""

    range_resolution_m: float = Field(
        default=0.0, ge=0, description="Grid step of measured range, m; 0 measures exactly."
    )
    resolution_cells: bool | None = Field(
        default=None,
        description="Whether targets in one resolution cell (beam, or grid step) are one report, "
        "of the strongest echo at the sum of their powers; by default where errors is not 'grid' "
        "and cells have a size.",
    )

    @property
    def tells_cells_apart(self) -> bool:
        """Whether targets of one resolution cell are one report."""
        if self.resolution_cells is None:
            return self.errors != "grid" and not self.without_size
        return self.resolution_cells

    @property
    def without_size(self) -> list[str]:
        """Grid steps of 0 that no beamwidth stands for: such a cell has no size."""
        return [
            step
            for beam, step in CELL_SIZES
            if not (getattr(self, beam, None) or getattr(self, step))
        ]

    @model_validator(mode="after")
    def _cells_have_a_size(self) -> Self:
        Disagreements.refuse(
            f"{step} is 0 and resolution_cells is true: a cell has a size, it must be above 0"
            for step in (self.without_size if self.resolution_cells else ())
        )
        return self
