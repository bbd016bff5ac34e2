"""Resolution cells as an effect: targets that a radar cannot tell apart are one echo."""

from typing import Any

import numpy as np

from components.radar.field_of_view import cell_size
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class OneReportByCell(Effect):
    """Targets whose echoes fall into one resolution cell give one report.

    A cell is as wide as the beam, or as a step of the grid where no beamwidth is given.

    It is that of the strongest echo, looked at with the sum of their powers (phases are random
    against each other), and with that target's fluctuation and draws. So noise alone reports a
    cell with the probability of false alarm, however many faint targets it holds.
    """

    lockstep = True
    name = "resolution cells"
    acts_on = "one report by cell"
    neutral = False
    outside_the_proof = "without it every target has a report of its own"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``resolution_cells``."""
        p = block.p
        if p.resolution_cells is None and p.errors != "grid":
            if p.without_size:
                return Verdict(False, f"{p.without_size[0]} is 0: a cell has no size")
            return Verdict(True, f"errors is '{p.errors}', and resolution_cells not false")
        return Verdict(
            p.tells_cells_apart, f"resolution_cells is {str(p.tells_cells_apart).lower()}"
        )

    def build(self, block: Any) -> "Merging":
        """Return what adds up the echoes of each cell."""
        return Merging(block)


class Merging:
    """Adds up echoes by resolution cell; called with cells and their echoes' powers."""

    def __init__(self, block: Any) -> None:
        self._block = block
        self._widths = cell_size(block.p)

    def __call__(self, cells: Cells, power: FloatArray) -> FloatArray:
        """Return the power of the echo that stands for its resolution cell, and 0 of the others.

        Parameters
        ----------
        cells : Cells
        power : (cells,)
            0 where there is no echo.

        Returns
        -------
        (cells,) array
            The sum over the resolution cell.
        """
        if len(cells) < 2 or not (np.diff(cells.row) == 0).any():
            return power
        block = self._block
        seen = block.axes(cells.body_azimuth_rad, cells.body_elevation_rad)
        place = [
            np.rint(values / width)
            for values, width in zip((*seen, cells.range_m), self._widths, strict=True)
        ]
        # Astern the last cell is the first one.
        astern = np.rint(np.pi / self._widths[0])
        place[0] = np.where(place[0] == -astern, astern, place[0])
        # By cell, the strongest first; of equals the first of the roster.
        order = np.lexsort((cells.target, -power, *place, cells.row))
        new = np.ones(len(order), dtype=bool)
        new[1:] = False
        for values in (cells.row, *place):
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
