"""Parameters of every radar that say what two targets in one resolution cell come to."""

from typing import Self

from pydantic import Field, model_validator

from components.sensor.parameters import SensorParameters
from dsa_des.errors import Disagreements

#: Keys of a cell's size, which come before the grid step: what is told apart is seldom as fine as
#: what is reported.
CELL_SIZES = (
    ("azimuth_beamwidth_deg", "azimuth_resolution_deg"),
    ("elevation_beamwidth_deg", "elevation_resolution_deg"),
    ("range_cell_m", "range_resolution_m"),
)


class ResolutionParameters(SensorParameters):
    """Beam, grid of range, and whether its cells are what the radar tells apart."""

    azimuth_beamwidth_deg: float | None = Field(
        default=None,
        gt=0,
        le=360,
        description="Half-power beamwidth in azimuth, deg; where none is given the grid's step "
        "stands for the beam.",
    )
    elevation_beamwidth_deg: float | None = Field(
        default=None, gt=0, le=180, description="Half-power beamwidth in elevation, deg."
    )
    range_cell_m: float | None = Field(
        default=None,
        gt=0,
        description="Depth of a resolution cell, c / 2B, m; by default the grid's step of range.",
    )
    sidelobe_level_db: float | None = Field(
        default=None,
        ge=-100,
        lt=0,
        description="Mean level of the sidelobes over the main beam, one way, dB: ground and rain "
        "all around are heard through them. By default there are none.",
    )
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
    def _two_beamwidths(self) -> Self:
        if (self.azimuth_beamwidth_deg is None) != (self.elevation_beamwidth_deg is None):
            raise ValueError(
                "azimuth_beamwidth_deg and elevation_beamwidth_deg belong together: give both or "
                "neither"
            )
        return self

    @model_validator(mode="after")
    def _cells_have_a_size(self) -> Self:
        Disagreements.refuse(
            f"{step} is 0 and resolution_cells is true: a cell has a size, it must be above 0"
            for step in (self.without_size if self.resolution_cells else ())
        )
        return self
