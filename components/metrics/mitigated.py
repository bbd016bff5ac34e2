"""NMAC and loss of well clear twice: as the ownship would have flown, and as it was steered.

Both are of one run of a closed loop, so the encounter and all random numbers are the same: flags
for a risk ratio (`components.metrics.risk`).
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from pydantic import Field

from components.messages.steering import Manoeuvre
from components.metrics.encounter import SizeParameters, losses_s, read_flights
from components.metrics.separation import separations, traffic_block
from dsa_des.arrays.types import AnyArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, Group, Metric, Result

_TOLD = Manoeuvre._fields


class RiskParameters(SizeParameters):
    """What counts as a loss of well clear, and as a near mid-air collision, and how it is found."""

    step_s: float = Field(
        default=0.1, gt=0, le=10, description="Spacing of the times at which distances are taken."
    )


class Mitigated(Metric):
    """Events with and without the manoeuvres that the ownship was told to fly."""

    Parameters = RiskParameters
    tables = {"manoeuvres": ("block", "time_s", *_TOLD)}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        traffic = traffic_block(scene).name
        #: Block that steers → how long its word is on the way.
        self._delays_s: dict[str, float] = {}
        for wire in scene.wires:
            if (wire.target, wire.input) == (traffic, "manoeuvres"):
                if wire.jitter_s or wire.drop_probability or wire.queued or wire.delay_scans:
                    raise ValueError(
                        f"the wire from {wire.source!r} to {traffic!r} must have a fixed delay in "
                        "seconds, without jitter, loss or a processor: when manoeuvres begin is "
                        "not recorded"
                    )
                self._delays_s[wire.source] = float(wire.total_delay_s)
        if not self._delays_s:
            raise ValueError(f"nothing steers the ownship: no manoeuvres are wired to {traffic!r}")

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
        read = partial(losses_s, self.p.sizes_m)
        nominal = read_flights(group, self.p.step_s, None, read, 3)[:2]
        mitigated = nominal.copy()
        for replica, told in self._manoeuvres(group).items():
            scene = group.scenes[replica]
            mitigated[:, replica] = read(separations(scene, self.p.step_s, told))[:2]
        found: dict[str, AnyArray] = {}
        for k, name in enumerate(("well_clear_lost", "nmac")):
            found[f"{name}_nominal"] = (~np.isnan(nominal[k])).astype(float)
            found[f"{name}_mitigated"] = (~np.isnan(mitigated[k])).astype(float)
        return found

    def _manoeuvres(self, group: Group) -> dict[int, list[tuple[float, Manoeuvre]]]:
        """Return the manoeuvres of every replica that has any, and when they come, s."""
        table: Any = group.tables["manoeuvres"]
        found: dict[int, list[tuple[float, Manoeuvre]]] = {}
        names = table["block"].names
        rows = zip(
            table["replica"].tolist(), table["block"].codes.tolist(), table["time_s"].tolist(),
            *(table[name].tolist() for name in _TOLD), strict=True,
        )  # fmt: skip
        for replica, block, time_s, *told in rows:
            came_s = time_s + self._delays_s[names[block]]
            if came_s < group.duration_s[replica]:
                found.setdefault(replica, []).append((came_s, Manoeuvre(*told)))
        return {replica: sorted(told, key=lambda one: one[0]) for replica, told in found.items()}
