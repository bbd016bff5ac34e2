"""A block and a metric of a user's own, in a module that no other process finds."""

from typing import Any

import numpy as np

from components.radar.threshold_radar import ThresholdRadar
from dsa_des.results.record import NUMBER, Result
from dsa_des.studies.metric import Metric


class OwnRadar(ThresholdRadar):
    """A radar like the other one."""


class Rows(Metric):
    """Counts the rows of detections."""

    tables = {"detections": ("block",)}

    def results(self) -> list[Result]:
        """Return one number."""
        return [Result("rows", NUMBER, "Rows of detections.")]

    def measure(self, group: Any) -> dict[str, Any]:
        """Count the rows of every replica."""
        replica = group.tables["detections"]["replica"]
        return {"rows": np.bincount(replica, minlength=len(group)).astype(float)}
