"""A sensor's reach, and the decision whether a target needs its physics (thesis §3.4)."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
import numpy.typing as npt

from components.geometry import TWO_PI, FieldOfView, sector_width_rad
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

ReasonArray = npt.NDArray[np.uint8]

#: Reasons, in the order in which they are looked for; EVALUATE means that physics must decide.
EVALUATE, ABSENT, OFF, FIELD_OF_VIEW, RANGE, HIDDEN = range(6)
SKIP_REASONS = {
    "absent": ABSENT,
    "off": OFF,
    "field_of_view": FIELD_OF_VIEW,
    "range": RANGE,
    "hidden": HIDDEN,
}
#: Targets up to so many reaches away count when models of the line of sight are judged: one that
#: is off may take them to be in reach.
REACH_MARGIN = 1.05
_field_of_view = lru_cache(maxsize=256)(FieldOfView)
_ABSENT, _OFF, _FIELD_OF_VIEW, _RANGE = map(np.uint8, (ABSENT, OFF, FIELD_OF_VIEW, RANGE))
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
    range_slack : float
        Largest relative error of the range that leaves what the sensor says within ``[accuracy]``.
    exact_because : str
        Why only an exact line of sight will do; empty where another one may.
    lasts_s : float
        Above 0 where the flights are wanted too, so long after the instants of the scans.
    """

    azimuth_rad: tuple[float, float]
    elevation_rad: tuple[float, float]
    range_max_m: float = math.inf
    enabled: bool = True
    range_slack: float = math.inf
    exact_because: str = ""
    lasts_s: float = 0.0

    @property
    def width_rad(self) -> tuple[float, float]:
        """Return the field of view's widths in azimuth, in (0, 2 pi], and in elevation, rad."""
        low, high = self.elevation_rad
        return min(sector_width_rad(*self.azimuth_rad), TWO_PI), high - low

    @property
    def steepest_elevation_rad(self) -> float:
        """Largest absolute elevation in body axes inside the field of view, rad."""
        return max(abs(angle) for angle in self.elevation_rad)

    @cached_property
    def _field(self) -> FieldOfView:
        return _field_of_view(self.azimuth_rad, self.elevation_rad)

    def skip_reasons(
        self,
        body_azimuth_rad: FloatArray,
        body_elevation_rad: FloatArray,
        range_m: FloatArray,
        present: BoolArray,
        hidden: BoolArray | None = None,
    ) -> ReasonArray:
        """Return target codes: `EVALUATE`, or off, field of view, range, hidden, absent (skips).

        All arrays are of one shape and finite, the azimuth in (-pi, pi]; `hidden` says whether the
        Earth or its ground stands before the target, by default nowhere.
        """
        if not self.enabled:
            return np.where(present, _OFF, _ABSENT)
        # Sums of products: where one or the other is chosen element by element, processors guess.
        seen = self._field.holds(body_azimuth_rad, body_elevation_rad)
        reason = ~seen * _FIELD_OF_VIEW
        if self.range_max_m < math.inf:
            seen &= range_m > self.range_max_m
            reason += seen * _RANGE
        if hidden is not None:
            reason[hidden & (reason == EVALUATE)] = HIDDEN
        if np.count_nonzero(present) < present.size:
            reason[~present] = ABSENT
        return reason


@dataclass(frozen=True)
class FarthestLook:
    """What a block asks of the traffic: targets up to this range; farther ones do not matter.

    Parameters
    ----------
    range_m : float
        Infinite where a sensor has no limit.
    views : tuple of (range, elevation)
        For each sensor its range in m and the largest size of an elevation in body axes at which
        it looks.
    range_slack, exact_because
        How exactly the line of sight is needed, see `Reach`.
    lasts_s : float
        How long a look lasts: a sweeping beam meets targets where they are later in the scan.
    seeming : tuple of (model, range)
        Ranges in m up to which targets are looked at by where a model of the Earth puts them.
        How far these truly are depends on the flight of the ownship, which the traffic knows.
    """

    range_m: float
    views: tuple[tuple[float, float], ...] = ((math.inf, 0.5 * math.pi),)
    range_slack: float = math.inf
    exact_because: str = ""
    lasts_s: float = 0.0
    seeming: tuple[tuple[str, float], ...] = ()


def combined_farthest_look(requests: Iterable[object]) -> FarthestLook:
    """Return one request that covers all given; its range is infinite if one states none."""
    looks = [FarthestLook(0.0, ())]
    for request in requests:
        if isinstance(request, FarthestLook):
            looks.append(request)
        elif not isinstance(request, Reach):
            looks.append(FarthestLook(math.inf))
        elif request.enabled:
            looks.append(
                FarthestLook(
                    request.range_max_m,
                    ((request.range_max_m, request.steepest_elevation_rad),),
                    request.range_slack,
                    request.exact_because,
                    request.lasts_s,
                )
            )
    return FarthestLook(
        max(look.range_m for look in looks),
        tuple(sorted({view for look in looks for view in look.views})),
        min(look.range_slack for look in looks),
        next((look.exact_because for look in looks if look.exact_because), ""),
        max(look.lasts_s for look in looks),
        tuple(sorted({one for look in looks for one in look.seeming})),
    )


@dataclass(eq=False)
class Decision:
    """The reasons why one sensor skips targets, for the rows of a message."""

    rows: IntArray  # (scans,): the message rows at which the sensor scans, ascending
    reason: ReasonArray  # (scans, targets)
    count: int  # Rows of the message

    def reasons_at(self, rows: IntArray) -> ReasonArray | None:
        """Return reason codes (rows, targets) at some rows; None if one of them is not a scan."""
        own = self.rows
        if rows is own or (len(rows) == len(own) and bool((rows == own).all())):
            return self.reason
        scan = self._reason_index_of_rows[rows]
        return self.reason[scan] if scan.min(initial=0) >= 0 else None

    @property
    def _reason_index_of_rows(self) -> IntArray:
        """Return the row of `reason` for each message row; -1 where the sensor does not scan."""
        scan = np.full(self.count, -1, dtype=np.int64)
        scan[self.rows] = np.arange(len(self.rows))
        return scan

    def take_rows(self, rows: slice | IntArray) -> "Decision":
        """Return the decision for some message rows only."""
        scan = self._reason_index_of_rows[rows]
        kept = np.flatnonzero(scan >= 0)
        return Decision(kept, self.reason[scan[kept]], len(scan))

    def widen(self, columns: IntArray, width: int) -> "Decision":
        """Return the decision over `width` targets: its own at `columns`, all others absent."""
        reason = np.full((len(self.reason), width), ABSENT, dtype=np.uint8)
        reason[:, columns] = self.reason
        return Decision(self.rows, reason, self.count)

    @classmethod
    def join_rows(cls, parts: list[Self]) -> "Decision":
        """Return the decision over the rows of all parts."""
        starts = np.cumsum([0] + [part.count for part in parts]).tolist()
        rows = [part.rows + start for part, start in zip(parts, starts, strict=False)]
        reasons = np.concatenate([part.reason for part in parts])
        return Decision(np.concatenate(rows), reasons, starts[-1])
