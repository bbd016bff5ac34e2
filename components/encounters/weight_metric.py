"""The weight of the encounter that a run flies, as a metric beside what came of it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.encounters.encounter_traffic import chosen_encounter
from components.encounters.splitting import FAMILY
from components.metrics.separation import traffic_block
from dsa_des.arrays.types import AnyArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import NUMBER, Group, Metric, Result


def has_weights(scene: Scene) -> bool:
    """Return whether the traffic of a scene is one encounter of many, each with its weight."""
    return hasattr(traffic_block(scene).parameters, "encounter")


class EncounterWeight(Metric):
    """Number and weight of the encounter of each run, for risk ratios over a study."""

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if not has_weights(scene):
            block = traffic_block(scene)
            raise ValueError(
                f"the traffic of the scene, {block.name!r}, has no encounters with weights: it "
                "needs traffic.encounters or traffic.encounter_model"
            )

    def results(self) -> list[Result]:
        """Return number, weight and family."""
        return [
            Result("encounter", NUMBER, "number of the encounter"),
            Result("encounter_weight", NUMBER, "how often it happens in the airspace"),
            Result("encounter_family", NUMBER, "encounter of which it is a copy, or itself"),
        ]

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return all three for every replica."""
        numbers, weights, families = np.empty((3, len(group)))
        for row, scene in enumerate(group.scenes):
            block = traffic_block(scene)
            found, place = chosen_encounter(block.cls, block.parameters)
            numbers[row], weights[row] = found.numbers[place], found.weights[place]
            families[row] = found.extra.get(FAMILY, found.numbers)[place]
        return {
            "encounter": numbers, "encounter_weight": weights, "encounter_family": families,
        }  # fmt: skip
