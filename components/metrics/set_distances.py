"""How far a set of tracks is from the set of what is there: OSPA and GOSPA, with their parts.

Sources: Schuhmacher, Vo, Vo, IEEE Trans. Signal Proc. 56 (2008), eq. 3 (OSPA); Rahmathullah,
García-Fernández, Svensson, *Generalized optimal sub-pattern assignment metric*, FUSION 2017, with
alpha = 2, where missed and false ones are told apart.
"""

import math
from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(frozen=True)
class SetDistance:
    """The distance of two sets and what it is made of.

    Parameters
    ----------
    ospa_m : float
        Between 0 and the cut-off; 0 where both sets are empty.
    gospa_m : float
    localisation_m, missed_m, false_m : float
        Parts of GOSPA: localisation^p + missed^p + false^p = gospa^p.
    """

    ospa_m: float
    gospa_m: float
    localisation_m: float
    missed_m: float
    false_m: float


def set_distance(distance_m: FloatArray, cutoff_m: float, order: float = 2.0) -> SetDistance:
    """Return OSPA and GOSPA of tracks and truths.

    Parameters
    ----------
    distance_m : (tracks, truths)
    cutoff_m : float
        No pair counts as farther apart.
    order : float
        The power p, at least 1.
    """
    tracks, truths = distance_m.shape
    if tracks == 0 and truths == 0:
        return SetDistance(0.0, 0.0, 0.0, 0.0, 0.0)
    powers = np.minimum(distance_m, cutoff_m) ** order
    row, column = assigned(powers)
    near = powers[row, column]
    apart = abs(tracks - truths)
    ospa = (near.sum() + cutoff_m**order * apart) / max(tracks, truths)
    # A pair at the cut-off costs as much as one missed and one false: GOSPA leaves it unassigned.
    together = near[distance_m[row, column] < cutoff_m]
    half = 0.5 * cutoff_m**order
    missed, false = half * (truths - len(together)), half * (tracks - len(together))
    parts = [float(together.sum()), missed, false]
    return SetDistance(
        float(ospa) ** (1.0 / order),
        math.fsum(parts) ** (1.0 / order),
        *(part ** (1.0 / order) for part in parts),
    )


def assigned(cost: FloatArray) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the assignment that costs least."""
    if cost.size == 0:
        none = np.empty(0, dtype=np.int64)
        return none, none
    from scipy.optimize import linear_sum_assignment

    row, column = linear_sum_assignment(cost)
    return row, column
