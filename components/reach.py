"""A sensor's reach, and the decision whether a target needs its physics (thesis §3.4)."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
import numpy.typing as npt

from components.geometry.field_of_view import FieldOfView
from dsa_des.types import BoolArray, FloatArray, IntArray

ReasonArray = npt.NDArray[np.uint8]

#: Reasons, in the order in which they are looked for; EVALUATE means that physics must decide.
EVALUATE, ABSENT, OFF, FIELD_OF_VIEW, RANGE = range(5)
SKIP_REASONS = {"absent": ABSENT, "off": OFF, "field_of_view": FIELD_OF_VIEW, "range": RANGE}
_field_of_view = lru_cache(maxsize=256)(FieldOfView)
_EVALUATE, _FIELD_OF_VIEW = np.uint8(EVALUATE), np.uint8(FIELD_OF_VIEW)
#: Targets that were not even moved, because no sensor could have looked at them.
CULLED = "culled"


@dataclass(frozen=True)
class Reach:
    """Where a sensor can see, in the ownship's body axes; bounds are inclusive.

    Parameters
    ----------
    azimuth_rad, elevation_rad : (low, high)
        Azimuth runs clockwise from low to high and may cross ±pi.
    range_max_m : float
        Infinite where the sensor has no limit of its own.
    enabled : bool
    """

    azimuth_rad: tuple[float, float]
    elevation_rad: tuple[float, float]
    range_max_m: float = math.inf
    enabled: bool = True

    @cached_property
    def _field(self) -> FieldOfView:
        return _field_of_view(self.azimuth_rad, self.elevation_rad)

    def decide(
        self, p_rad: FloatArray, q_rad: FloatArray, range_m: FloatArray, present: BoolArray
    ) -> ReasonArray:
        """Return the reason why each target is skipped, or EVALUATE.

        Parameters
        ----------
        p_rad, q_rad, range_m, present : arrays of one shape
            Body azimuth in (-pi, pi] and elevation, slant range, and whether the target is there;
            finite.
        """
        if not self.enabled:
            return np.full(range_m.shape, OFF, dtype=np.uint8)
        seen = self._field.holds(p_rad, q_rad)
        reason = np.where(seen, _EVALUATE, _FIELD_OF_VIEW)
        if self.range_max_m < math.inf:
            seen &= range_m > self.range_max_m
            reason[seen] = RANGE
        if np.count_nonzero(present) < present.size:
            reason[~present] = ABSENT
        return reason


@dataclass(frozen=True)
class FarthestLook:
    """What a block asks of the traffic: targets up to this range; farther ones matter to nobody.

    Parameters
    ----------
    range_m : float
        Infinite where somebody has no limit.
    """

    range_m: float


def farthest_look(requests: Iterable[object]) -> FarthestLook:
    """Return the farthest of what consumers ask for; who does not say asks for everything."""
    farthest = 0.0
    for request in requests:
        if isinstance(request, Reach):
            farthest = max(farthest, request.range_max_m if request.enabled else 0.0)
        elif isinstance(request, FarthestLook):
            farthest = max(farthest, request.range_m)
        else:
            farthest = math.inf
    return FarthestLook(farthest)


@dataclass(eq=False)
class Decision:
    """The decision for one sensor over the rows of a message.

    Parameters
    ----------
    place : (rows,) of int
        Row of `reason` that belongs to each message row; -1 where the sensor does not scan.
    reason : (scans, targets) of uint8
    """

    place: IntArray
    reason: ReasonArray

    def take_rows(self, rows: slice | IntArray) -> "Decision":
        """Return the decision for some of the rows."""
        return Decision(self.place[rows], self.reason)

    def widened(self, place: IntArray, width: int) -> "Decision":
        """Return the decision over `width` targets, ours at `place`, the others absent."""
        reason = np.full((len(self.reason), width), ABSENT, dtype=np.uint8)
        reason[:, place] = self.reason
        return Decision(self.place, reason)

    @classmethod
    def join_rows(cls, parts: list[Self]) -> "Decision":
        """Return the decision over the rows of all parts."""
        starts = np.cumsum([0] + [len(part.reason) for part in parts[:-1]])
        places = [
            np.where(part.place < 0, -1, part.place + start)
            for part, start in zip(parts, starts, strict=True)
        ]
        return Decision(np.concatenate(places), np.concatenate([part.reason for part in parts]))
