"""When straight flights meet what an alert level keeps them out of: whichever kind it is."""

from typing import Any

import numpy as np

from components.well_clear.tcas import TcasAdvisory, tcas_span
from components.well_clear.uncertainty import Bounds, uncertain_violation_span
from components.well_clear.vertical_interval import Span
from components.well_clear.violation import Relative, violation_span
from components.well_clear.volume import Volume


def detection_span(
    volume: Volume | TcasAdvisory,
    relative: Relative,
    own_up_mps: tuple[Any, Any] | None,
    bounds: Bounds | None,
    begin_s: Any,
    end_s: Any,
) -> Span:
    """Return from when to when pairs of aircraft in straight flight meet a volume.

    Parameters
    ----------
    volume : Volume or TcasAdvisory
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder, at time 0.
    own_up_mps : (altitude in m, climb in m/s) of (n,) or None
        Of the ownship at time 0; only advisories ask for it.
    bounds : Bounds or None
        How far the states may be wrong, for volumes of modified tau.
    begin_s, end_s : float or (n,)
        The times looked at.

    Raises
    ------
    ValueError
        An advisory's sizes are asked for without the ownship's altitude.
    """
    if isinstance(volume, TcasAdvisory):
        if own_up_mps is None:
            raise ValueError("advisories of TCAS II need the ownship's altitude and climb")
        return tcas_span(
            relative, *own_up_mps, resolution=volume.resolution, begin_s=begin_s, end_s=end_s
        )
    if bounds is not None:
        return uncertain_violation_span(volume, relative, bounds, begin_s, end_s)
    return violation_span(volume, relative, begin_s, end_s)


def some_bounds(bounds: Bounds | None, which: Any) -> Bounds | None:
    """Return the bounds of some pairs; None where there are none."""
    return None if bounds is None else Bounds(*(np.asarray(bound)[which] for bound in bounds))
