"""What guidance is asked about: the ownship's state, the intruders', and volumes to keep clear."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.well_clear.cylinder import cylinder_span
from components.well_clear.vertical_interval import Span
from components.well_clear.violation import Relative, violation_span
from components.well_clear.volume import Volume
from dsa_des.arrays.types import BoolArray, FloatArray


class State(NamedTuple):
    """Where aircraft are at time 0 and how fast, arrays that broadcast against each other.

    Parameters
    ----------
    east_m, north_m, up_m : ndarray
        In the ownship's plane; up is altitude.
    east_mps, north_mps, climb_mps : ndarray
    """

    east_m: FloatArray
    north_m: FloatArray
    up_m: FloatArray
    east_mps: FloatArray
    north_mps: FloatArray
    climb_mps: FloatArray

    def less(self, other: "State") -> Relative:
        """Return these states less others."""
        return tuple(mine - theirs for mine, theirs in zip(self, other, strict=True))

    def row(self, number: int) -> "State":
        """Return the state of one aircraft."""
        return State(*(part[number] for part in self))


@dataclass(frozen=True)
class Detector:
    """A volume, or an open cylinder, that flights must not meet.

    Parameters
    ----------
    volume : Volume or None
    cylinder_m : (float, float) or None
        Radius and half of the height, where there is no volume.
    """

    volume: Volume | None = None
    cylinder_m: tuple[float, float] | None = None

    def span(self, relative: Relative, begin_s: Any, end_s: Any) -> Span:
        """Return from when to when flights meet it."""
        if self.volume is not None:
            return violation_span(self.volume, relative, begin_s, end_s)
        assert self.cylinder_m is not None
        return cylinder_span(*self.cylinder_m, relative, begin_s, end_s)

    def meets(self, relative: Relative, begin_s: Any, end_s: Any) -> BoolArray:
        """Tell whether flights meet it in an interval; never in an empty one."""
        end_s = np.maximum(end_s, begin_s)
        found = self.span(relative, begin_s, end_s)
        return np.asarray(np.isfinite(found.begin_s) & (begin_s < end_s))


class Required(NamedTuple):
    """What flights must keep clear of, and when.

    Parameters
    ----------
    detector : Detector
        From `from_s` on.
    horizon_s : float
        How long after a manoeuvre.
    lookahead_s : float
        Beyond it nothing is asked.
    from_s : float
        0 but in the search for a recovery.
    before : Detector or None
        What counts until `from_s`.
    """

    detector: Detector
    horizon_s: float
    lookahead_s: float
    from_s: float = 0.0
    before: Detector | None = None
