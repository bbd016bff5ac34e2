"""The farthest true range of a target that a model of the Earth takes to be in reach."""

import math

from components.aircraft.known_targets import KnownTraffic
from components.geometry.error_bounds import Envelope, error_bound
from components.messages.reach import FarthestLook
from dsa_des.block.component import Context

# A bound this large proves hardly anything.
_LARGEST_RELATIVE_ERROR = 0.5


def true_reach_m(context: Context, earth: str, look: FarthestLook) -> float:
    """Return a true range beyond which no target seems to be within the range of a look.

    Traffic leaves far targets out by their true ranges; sensors go by those of the model.
    With a relative error e of the range, proven for all targets that seem to be in reach, these
    are within R / (1 - e).

    Parameters
    ----------
    context : Context
        Of the transform.
    earth : str
        Its model of the Earth.
    look : FarthestLook
        What is asked for downstream, with ranges as the model gives them.

    Returns
    -------
    float, m
        Infinite where nothing is proven: near a pole, far away, or with traffic that does not say
        where the ownship can be.
    """
    reach_m = look.range_m
    offers = [producer.offer for producer in context.producers]
    if earth == "ellipsoid" or reach_m == 0.0 or not math.isfinite(reach_m):
        return reach_m
    if len(offers) != 1 or not isinstance(offers[0], KnownTraffic):
        return math.inf
    traffic = offers[0].envelope(reach_m, look.lasts_s)
    if traffic is None:
        return math.inf
    low_m, high_m = traffic.own_alt_m
    envelope = Envelope(
        range_max_m=reach_m,
        own_lat_deg=traffic.own_lat_deg,
        own_alt_m=traffic.own_alt_m,
        # Every model takes the difference of altitudes as it is, and none is longer than the range.
        target_alt_m=(low_m - reach_m, high_m + reach_m),
    )
    relative = error_bound(earth, envelope).relative_range
    return reach_m / (1.0 - relative) if relative < _LARGEST_RELATIVE_ERROR else math.inf
