"""Monte Carlo over the looks of one sensor: errors, and the bounds that a stated model gives."""

import math
from collections.abc import Mapping
from statistics import NormalDist
from typing import Any

import numpy as np
import wired

import dsa_des

#: Statistics that are looked at together lie outside of their bounds in 1 run of 100.
RISK = 0.01
TRUTH = {
    "azimuth_rad": ("true_azimuth_rad", "azimuth_variance_rad2"),
    "elevation_rad": ("true_elevation_rad", "elevation_variance_rad2"),
    "range_m": ("true_range_m", "range_variance_m2"),
}


def looks(kind: str, *, scene: Mapping[str, Any] | None = None, **keys: Any) -> dict[str, Any]:
    """Return the recorded columns of one sensor's detections as arrays; null is NaN."""
    run = wired.alone(kind, **keys) if scene is None else dsa_des.run(scene)
    table = run["detections"]
    return {
        name: table[name].to_numpy(zero_copy_only=False)
        for name in table.column_names
    }  # fmt: skip
