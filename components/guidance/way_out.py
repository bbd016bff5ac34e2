"""How the ownship gets out of the bands around it, of an alerting block's message."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration
from components.alert_configuration.margins import Deviations, margins
from components.guidance.bands import GuidedIntruder, guidance
from components.guidance.intervals import FULL_TURN
from components.guidance.resolution import resolution
from components.guidance.situation import State
from components.well_clear.detection import some_bounds
from dsa_des.arrays.types import FloatArray

_OWN = ("alt_m", "east_mps", "north_mps", "climb_mps")
_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")


def changes_out(
    kind_name: str,
    configuration: Configuration,
    alerter: Alerter,
    own_motion: Mapping[str, FloatArray],
    relative: Mapping[str, FloatArray],
    row: int,
    entries: slice,
    deviations: Mapping[str, FloatArray] | None = None,
) -> tuple[float, float] | None:
    """Return the smallest changes to either side that lead out of the bands at one instant.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    alerter : Alerter
        Of all targets.
    own_motion, relative : mapping
        As in an alerting block's message: of the ownship (rows,), and ownship less target
        (entries,).
    row : int
    entries : slice
        Of that row.
    deviations : mapping of (entries,), optional
        Standard deviations by the fields of `components.alert_configuration.margins.Deviations`,
        for levels that heed them.

    Returns
    -------
    (float, float) or None
        To the left or down, negative, and to the right or up, positive, rad, m/s or m; infinite
        where nothing there leads out. None where the own value needs no change or is not known yet.
    """
    own_values: list[Any] = [np.asarray(own_motion[name][row]) for name in _OWN]
    if not np.all(np.isfinite(own_values)):
        return None
    alt, *velocity = own_values
    own = State(np.zeros(()), np.zeros(()), alt, *velocity)
    parts = [relative[name][entries] for name in _RELATIVE]
    bounds = None
    if deviations:
        of_row = Deviations(*(deviations[name][entries] for name in Deviations._fields))
        bounds = margins(configuration, of_row, np.hypot(parts[0], parts[1]))
    intruders = [
        GuidedIntruder(
            State(*(mine - part[i] for mine, part in zip(own, parts, strict=True))),
            alerter,
            bounds=some_bounds(bounds, i),
        )
        for i in range(len(parts[0]))
    ]
    found = guidance(kind_name, configuration, own, intruders)
    region, cyclic = configuration["corrective_region"], kind_name == "hdir"
    way = resolution(found.bands, found.own_value, region, cyclic)
    if way is None:
        return None
    if not cyclic:
        return way.low - found.own_value, way.high - found.own_value
    low = -((found.own_value - way.low) % FULL_TURN) if math.isfinite(way.low) else -math.inf
    high = (way.high - found.own_value) % FULL_TURN if math.isfinite(way.high) else math.inf
    return low, high


def smaller(changes: tuple[float, float]) -> float | None:
    """Return the smaller of two changes, to the right or up where they are equal.

    None where there is neither.
    """
    low, high = changes
    change = high if high <= -low else low
    return change if math.isfinite(change) else None
