"""Ground clutter as an effect on a radar's detections."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.radar.field_of_view import cell_size
from components.radar.ground_clutter import ground_clutter_rcs_m2, height_above_terrain_m
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict

_CELL = ("azimuth_resolution_deg", "elevation_resolution_deg", "range_resolution_m")


class GroundClutter(Effect):
    """Echo of flat terrain in the cell of each target, where the beam meets it.

    The beam points at the target and is as wide as a resolution cell, unless the scene gives its
    beamwidths; clutter more than two beamwidths off its axis is 0. The air takes from the echo of
    the ground what it takes from the target's. What the threshold does there is said by
    ``clutter_threshold``.
    """

    lockstep = True
    name = "ground clutter"
    acts_on = "clutter"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[terrain] height_m``."""
        terrain = terrain_of(block)
        if terrain is None:
            return Verdict(False, "[terrain] height_m is not given")
        return Verdict(True, f"[terrain] height_m is {terrain.height_m:g}")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return each cell's ground clutter as an RCS, m²; without terrain it is 0."""
        terrain = terrain_of(block)
        if terrain is None:
            return lambda cells: np.zeros(len(cells))
        for width, name in zip(cell_size(block.p), _CELL, strict=True):
            if width == 0:
                raise ValueError(
                    f"{name} is 0: ground clutter fills a resolution cell, it must be above 0"
                )
        if block.p.pulses_summed > 1:
            if block.p.budget == "dwell" and block.p.integration == "noncoherent":
                raise ValueError(
                    f"integration is 'noncoherent', which sums {block.p.pulses_summed} pulses: "
                    "ground clutter is known for one look only; set it to 'coherent'"
                )
            raise ValueError(
                f"pulses is {block.p.pulses_summed}: ground clutter is known for one look only; "
                "set it to 1, with integration_gain_db for pulses integrated coherently"
            )

        if terrain.clutter_mean == "constant" and block.p.cfar_reference_cells is not None:
            raise ValueError(
                f"cfar_reference_cells is {block.p.cfar_reference_cells} and [terrain] "
                "clutter_mean is 'constant': an average of cells is known for clutter that "
                "fluctuates; leave one of them out"
            )

        across_rad, upwards_rad = beamwidths_rad(block)

        def clutter_rcs_m2(cells: Cells) -> FloatArray:
            height_m = height_above_terrain_m(cells.of_row("own_alt_m"), terrain.height_m)
            rcs = ground_clutter_rcs_m2(
                cells.range_m,
                cells.elevation_rad,
                height_m,
                gamma_db=terrain.clutter_gamma_db,
                azimuth_beamwidth_rad=across_rad,
                elevation_beamwidth_rad=upwards_rad,
                range_resolution_m=block.range_step_m,
            )
            return np.asarray(rcs)

        return clutter_rcs_m2


class BoundaryClutter(GroundClutter):
    """The same for a range boundary, which hears the ground if its cells have a size."""

    lockstep = True

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[terrain] height_m``, and for a cell."""
        found = super().verdict(block)
        zero = [name for width, name in zip(cell_size(block.p), _CELL, strict=True) if not width]
        if found.simulated and zero:
            return Verdict(False, f"{zero[0]} is 0: no cell, no ground in it")
        return found

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return each cell's ground clutter; 0 where the verdict was that there is none."""
        if not self.verdict(block).simulated:
            return lambda cells: np.zeros(len(cells))
        return super().build(block)


def beamwidths_rad(block: Any) -> tuple[float, float]:
    """Return a radar's beamwidths in azimuth and elevation, rad; by default its resolution."""
    azimuth_rad, elevation_rad, _ = cell_size(block.p)
    return azimuth_rad, elevation_rad


def terrain_of(block: Any) -> Any:
    """Return the terrain of a block's scene, or None where there is none."""
    terrain = block.context.sections.get("terrain")
    return None if terrain is None or terrain.height_m is None else terrain
