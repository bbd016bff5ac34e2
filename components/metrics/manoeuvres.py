"""When the ownship is first told to fly otherwise, and how often (``manoeuvres``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.metrics.flown_flights import FlownMetric
from components.metrics.rows import PlatformParameters
from dsa_des.arrays.types import FloatArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import NUMBER, Group, Result


class ManoeuvreTimes(FlownMetric):
    """When the first manoeuvre reaches the ownship, or a platform, and how many do."""

    Parameters = PlatformParameters

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if not self.delays_s:
            raise ValueError("needs a block that steers the ownship: no manoeuvres are wired")

    def results(self) -> list[Result]:
        """Return two results' definitions: time of the first manoeuvre and number of manoeuvres."""
        return [
            Result("first_manoeuvre_time_s", NUMBER, "first manoeuvre of the ownship, s"),
            Result("manoeuvres", NUMBER, "manoeuvres that reach the ownship"),
        ]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return each replica's first manoeuvre arrival (s; else NaN) and their number."""
        first, count = np.full(len(group), np.nan), np.zeros(len(group))
        for replica, told in self.viewer_manoeuvres_by_replica(group).items():
            first[replica], count[replica] = told.came_s[0], len(told.came_s)
        return {"first_manoeuvre_time_s": first, "manoeuvres": count}
