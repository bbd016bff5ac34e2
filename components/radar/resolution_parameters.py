"""Parameters of every radar that say what two targets in one resolution cell come to."""

from typing import Self

from pydantic import Field, model_validator

from components.sensor.parameters import SensorParameters

_CELL = ("azimuth_resolution_deg", "elevation_resolution_deg", "range_resolution_m")


class ResolutionParameters(SensorParameters):
    """Grid of range, and whether its cells are what the radar tells apart."""

    range_resolution_m: float = Field(
        default=0.0, ge=0, description="Grid step of measured range, m; 0 measures exactly."
    )
    resolution_cells: bool = Field(
        default=False,
        description="Whether targets in one cell of the grid are one report, of the strongest "
        "echo at the sum of their powers.",
    )

    @model_validator(mode="after")
    def _cells_have_a_size(self) -> Self:
        for name in _CELL:
            if self.resolution_cells and getattr(self, name) == 0:
                raise ValueError(
                    f"{name} is 0 and resolution_cells is true: a cell has a size, it must be "
                    "above 0"
                )
        return self
