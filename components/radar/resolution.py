"""Resolution cells: size and number, targets that are one echo in one, and ranges that fold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np
from pydantic import Field, model_validator

from components.messages.reach import Reach
from components.radar.detection.detector_output import MOST_CELLS
from components.radar.pulse_trains.ambiguity import coincident_range_m
from components.sensor.look import Cells
from components.sensor.parameters import RangeErrorParameters, SensorParameters
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.errors import Disagreements


def steps_across(width: float, step: float) -> int:
    """Return how many steps fill a width, 1 or more; a remainder counts as one.

    A width that is a whole number of steps up to rounding has that many.
    """
    return max(1, math.ceil(width / step - 1e-9))


@dataclass(frozen=True)
class ResolutionCells:
    """The grid of resolution cells that fills a field of view.

    By axis the number of cells, and the first edge and width of the field of view. Where there is
    a remainder the cells of an axis are equally a little smaller.
    """

    azimuth: int
    elevation: int
    range: int
    azimuth_rad: tuple[float, float]
    elevation_rad: tuple[float, float]
    range_m: tuple[float, float]

    @classmethod
    def from_reach(cls, reach: Reach, nearest_m: float, cell: tuple[float, float, float]) -> Self:
        """Return a reach's grid of cells of size `cell` (rad, rad, m); ValueError above 1e15."""
        firsts = reach.azimuth_rad[0], reach.elevation_rad[0], nearest_m
        widths = *reach.width_rad, reach.range_max_m - nearest_m
        azimuth, elevation, depth = map(steps_across, widths, cell)
        cells = cls(azimuth, elevation, depth, *zip(firsts, widths, strict=True))
        if cells.count > MOST_CELLS:
            raise ValueError(
                f"the field of view has {cells.count:g} resolution cells: it must have at most "
                "1e15; make the cells larger"
            )
        return cells

    @property
    def count(self) -> int:
        """Number of resolution cells."""
        return self.azimuth * self.elevation * self.range


#: Keys of a cell's size, which come before the grid step: what is told apart is seldom as fine as
#: what is reported.
CELL_SIZES = (
    ("azimuth_beamwidth_deg", "azimuth_resolution_deg"),
    ("elevation_beamwidth_deg", "elevation_resolution_deg"),
    ("range_cell_m", "range_resolution_m"),
)


class ResolutionParameters(RangeErrorParameters, SensorParameters):
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
    resolution_cells: bool | None = Field(
        default=None,
        description="Whether targets in one resolution cell (beam, or grid step) are one report, "
        "of the strongest echo at the sum of their powers; by default where errors is not 'grid' "
        "and cells have a size.",
    )

    @property
    def has_one_report_by_cell(self) -> bool:
        """Whether targets in the same resolution cell give one report."""
        if self.resolution_cells is None:
            return self.errors != "grid" and not self.zero_steps_without_beamwidth
        return self.resolution_cells

    @property
    def zero_steps_without_beamwidth(self) -> list[str]:
        """Names of the grid steps that are 0 and have no beamwidth instead."""
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
        Disagreements.raise_if_any(
            f"{step} is 0 and resolution_cells is true: a cell has a size, it must be above 0"
            for step in (self.zero_steps_without_beamwidth if self.resolution_cells else ())
        )
        return self


def cell_azimuth_elevation_range(parameters: Any) -> tuple[float, float, float]:
    """Return a cell's azimuth, elevation (rad), range (m): the beamwidth, else the grid step."""
    widths = [
        getattr(parameters, beam, None) or getattr(parameters, step) for beam, step in CELL_SIZES
    ]
    return math.radians(widths[0]), math.radians(widths[1]), float(widths[2])


def cells_of_radar(block: Any) -> ResolutionCells:
    """Return the resolution cells of a radar block from its minimum range to ``range_km``."""
    p = block.p
    if p.zero_steps_without_beamwidth:
        raise ValueError(
            f"{p.zero_steps_without_beamwidth[0]} is 0: false alarms are counted by resolution "
            f"cells, it must "
            "be above 0"
        )
    if p.range_km is None:
        raise ValueError(
            "range_km is not given: false alarms are counted by resolution cells up to it"
        )
    if block.budget.nearest_m >= block.reach.range_max_m:
        raise ValueError(
            f"range_km is {p.range_km:g}: it must be above the minimum range, "
            f"{block.budget.nearest_m / 1000:g} km"
        )
    # Where ranges fold there are no cells beyond.
    far_m = min(block.reach.range_max_m, p.farthest_report_m)
    reach = replace(block.reach, range_max_m=far_m)
    return ResolutionCells.from_reach(
        reach, block.budget.nearest_m, cell_azimuth_elevation_range(p)
    )


class Merging:
    """Adds up echoes by resolution cell; called with cells and their echoes' powers."""

    def __init__(self, block: Any) -> None:
        self._block = block
        self._widths = cell_azimuth_elevation_range(block.p)

    def __call__(self, cells: Cells, power: FloatArray) -> FloatArray:
        """Return each cell's summed power for its strongest echo, and 0 for the others."""
        if len(cells) < 2 or not (np.diff(cells.row) == 0).any():
            return power
        block = self._block
        seen = block.axes(cells.body_azimuth_rad, cells.body_elevation_rad)
        cell = [
            np.rint(values / width)
            for values, width in zip(
                (*seen, block.apparent_range_m(cells.range_m)), self._widths, strict=True
            )
        ]
        # Astern the last cell is the first one.
        astern = np.rint(np.pi / self._widths[0])
        cell[0] = np.where(cell[0] == -astern, astern, cell[0])
        # By cell, the strongest first; of equals the first of the roster.
        order = np.lexsort((cells.target, -power, *cell, cells.row))
        new = np.ones(len(order), dtype=bool)
        new[1:] = False
        for values in (cells.row, *cell):
            ordered = values[order]
            new[1:] |= ordered[1:] != ordered[:-1]
        total = np.zeros(len(order))
        # One after the other from the strongest on, so that a cell's sum does not depend on others.
        first = np.flatnonzero(new)
        count = np.diff(np.append(first, len(order)))
        summed = power[order[first]]
        for later in range(1, int(count.max(initial=1))):
            more = count > later
            summed[more] += power[order[first[more] + later]]
        total[order[first]] = summed
        return total


ONE_REPORT = Hook(
    "one report by cell",
    Merging,
    "power of the echo that stands for its resolution cell, 0 of the others",
)


class OneReportByCell(Effect[Merging]):
    """Targets whose echoes fall into one resolution cell give one report.

    A cell is as wide as the beam, or as a step of the grid where no beamwidth is given.

    It is that of the strongest echo, looked at with the sum of their powers (phases are random
    against each other), and with that target's fluctuation and draws. So noise alone reports a
    cell with the probability of false alarm, however many faint targets it holds.
    """

    name = "resolution cells"
    acts_on = ONE_REPORT
    builds = Merging
    outside_the_proof = "without it every target has a report of its own"

    def verdict(self, block: Any) -> Verdict:
        """Return whether targets merge into one report a cell: needs ``resolution_cells``."""
        p = block.p
        if p.resolution_cells is None and p.errors != "grid":
            if p.zero_steps_without_beamwidth:
                return Verdict(
                    False, f"{p.zero_steps_without_beamwidth[0]} is 0: a cell has no size"
                )
            return Verdict(True, f"errors is '{p.errors}', and resolution_cells not false")
        return Verdict(
            p.has_one_report_by_cell, f"resolution_cells is {str(p.has_one_report_by_cell).lower()}"
        )


class SeemingRange(Protocol):
    """Function that returns the ranges that the radar attributes to echoes."""

    def __call__(self, range_m: FloatArray, /) -> FloatArray:
        """Return the folded ranges of true ranges, m."""


SEEMING_RANGE = Hook("seeming range", SeemingRange, "range that an echo seems to come from, m")


class RangeFolding(Effect[SeemingRange]):
    """Echoes of earlier pulses are taken for those of the last one.

    Of several PRFs those see a target that receive as much of it as the one that decides; the range
    is where they agree. Echoes of ground and rain fold too (`FoldedClutter`); ghosts between the
    echoes of two targets are left out.
    """

    name = "range folding"
    acts_on = SEEMING_RANGE
    outside_the_proof = "without it nothing is seen beyond c / 2PRF"

    def verdict(self, block: Any) -> Verdict:
        """Return whether ranges fold: needs ``range_folds``; with the PRFs that resolve them."""
        p = block.p
        if not p.range_folds:
            return Verdict(False, "range_folds is false")
        if not p.other_prfs_hz:
            return Verdict(True, f"range_folds is true: at {p.farthest_report_m / 1000:.4g} km")
        count = len(p.prfs_hz)
        return Verdict(True, f"range_folds is true: {p.prfs_needed or count} of {count} PRFs")

    def build(self, block: Any) -> SeemingRange:
        """Return a function from true to folded ranges."""
        p = block.p
        if not p.range_folds:
            return lambda range_m: range_m

        def seeming(range_m: FloatArray) -> FloatArray:
            shares = p.received_shares(range_m)
            return coincident_range_m(
                range_m,
                prfs_hz=p.prfs_hz,
                seen=shares >= p.decisive_share(shares),
                tolerance_m=0.5 * cell_azimuth_elevation_range(p)[2],
            )

        return seeming
