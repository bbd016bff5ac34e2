"""The area that an engine's hot exhaust adds for an infrared camera."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.aircraft.known_targets import known_targets
from components.optical.infrared_area import PLUME_SHARE_OF_BACK, plume_area
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class Plume(Effect):
    """Each aircraft's exhaust plume by its engine; those without one are not computed."""

    lockstep = True
    name = "plume"
    acts_on = "area"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``plume``, and for a target whose engine has one."""
        if not block.p.plume:
            return Verdict(False, "plume is false")
        rosters = known_targets(block.context)
        if not rosters:
            return Verdict(True, "plume is true and the targets are not known before the run")
        for roster in rosters:
            for name, engine in zip(roster.names, roster.engines.tolist(), strict=True):
                if PLUME_SHARE_OF_BACK[engine] > 0.0:
                    return Verdict(True, f"plume is true and {name!r} has a {engine}")
        return Verdict(False, "plume is true, but no target's engine has one")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return what is added to every cell's area."""
        scale = 1.0 if block.p.plume else 0.0
        shares = {engine: scale * share for engine, share in PLUME_SHARE_OF_BACK.items()}

        def added(cells: Cells) -> FloatArray:
            engines = cells.of_target(cells.roster.engines)
            back = cells.of_target(cells.roster.column("ir.back_m2"))
            area = np.zeros(len(cells))
            for engine in np.unique(engines).tolist():
                if PLUME_SHARE_OF_BACK[engine] == 0.0:
                    continue
                chosen = np.flatnonzero(engines == engine)
                area[chosen] = plume_area(
                    cells.relative_heading_rad[chosen],
                    cells.target_pitch_rad[chosen],
                    cells.target_roll_rad[chosen],
                    cells.elevation_rad[chosen],
                    back_m2=back[chosen],
                    engine=engine,
                    plume_share_of_back=shares[engine],
                )
            return area

        return added
