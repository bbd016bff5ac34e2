"""NMAC and loss of well clear twice: as the ownship would have flown, and as it was steered.

Both are of one run of a closed loop, so the encounter and all random numbers are the same: flags
for a risk ratio (`components.metrics.risk`).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.metrics.encounter import STEP, SizeParameters, read_flights
from components.metrics.separation import traffic_block
from components.metrics.steered import ToldManoeuvres
from dsa_des.arrays.types import AnyArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, Group, Metric, Result


class RiskParameters(SizeParameters):
    """What counts as a loss of well clear, and as a near mid-air collision, and how it is found."""

    step_s: float | None = STEP


class Mitigated(Metric):
    """Events with and without the manoeuvres that the ownship was told to fly."""

    Parameters = RiskParameters

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self._told = ToldManoeuvres(scene)
        if not self._told:
            name = traffic_block(scene).name
            raise ValueError(f"nothing steers the ownship: no manoeuvres are wired to {name!r}")
        self.tables = {**self.tables, **self._told.tables}

    def results(self) -> list[Result]:
        """Return both events, nominal and mitigated."""
        sizes = self.p.sizes_m
        return [
            Result(f"{name}_{which}", EVENT, f"{said} within {radius:g} m and {half:g} m")
            for name, (radius, half) in zip(("well_clear_lost", "nmac"), sizes, strict=True)
            for which, said in (("nominal", "without manoeuvres,"), ("mitigated", "as steered,"))
        ]

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return all of it for every replica."""
        read = self.p.losses_s
        nominal = read_flights(group, self.p.step_s, None, read)[:2]
        told = self._told.of(group)
        mitigated = read_flights(group, self.p.step_s, None, read, told)[:2]
        found: dict[str, AnyArray] = {}
        for k, name in enumerate(("well_clear_lost", "nmac")):
            found[f"{name}_nominal"] = (~np.isnan(nominal[k])).astype(float)
            found[f"{name}_mitigated"] = (~np.isnan(mitigated[k])).astype(float)
        return found
