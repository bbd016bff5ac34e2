"""Beyond which range a camera can detect nothing, whatever the attitude of its targets."""

import math
from typing import Any

import numpy as np

from components.aircraft.known_targets import known_targets

# Covers the rounding of areas, pixels and signatures many times over.
_MARGIN = 1.0 + 1e-9
_MARGIN_M = 1.0
# Effects on the contrast that only take from it.
_TAKING = ("visibility", "extinction in the band")


def farthest_detection_m(camera: Any, areas: str, contrast: str) -> float:
    """Return a range that no detection of this camera exceeds, m.

    The area shown is at most the sum of the bodies' areas and the contrast at most each target's
    own, so a·Q·P reaches the threshold at sqrt(a·A·P / (pixel · threshold)) at the latest (errata
    10). Infinite where that is not so: with a rate of the line of sight in the signature, with
    areas from a table, with effects that can add to area or contrast, or with targets that the
    camera was not told of.

    Parameters
    ----------
    camera : Camera
        After its effects were built.
    areas, contrast : str
        The roster's columns, ``"eo"`` or ``"ir"``, ``"contrast"`` or ``"contrast_ir"``; empty for
        a camera that shows other areas.
    """
    rosters = known_targets(camera.context)
    adding = [
        effect.name
        for effect in type(camera).effects
        if effect.name in camera.context.effects
        and effect.acts_on in ("area", "contrast", "signature")
        and effect.name not in _TAKING
    ]
    if (
        not areas
        or not rosters
        or adding
        or camera.p.silhouette in ("aspect_table", "sampled_table", "mesh")
        or camera.lowest_threshold() <= 0
    ):
        return math.inf
    roster = rosters[0]
    if len(roster) == 0:
        return 0.0
    ends = [roster.column(f"{areas}.front_m2")]
    if areas == "ir":
        ends.append(roster.column("ir.back_m2"))
    area = (
        np.max(ends, axis=0)
        + roster.column(f"{areas}.side_m2")
        + roster.column(f"{areas}.horizontal_m2")
    )
    gain = camera.p.static_weight * float(np.max(area * roster.column(contrast)))
    pixel = camera.pixel_azimuth_rad * camera.pixel_elevation_rad
    return math.sqrt(gain / (pixel * camera.lowest_threshold())) * _MARGIN + _MARGIN_M
