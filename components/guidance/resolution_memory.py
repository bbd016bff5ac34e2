"""What guidance remembers of its resolutions: an earlier way out, and the preferred side."""

import math
from typing import Any

from components.alert_configuration.configuration import REGIONS
from components.guidance.intervals import FULL_TURN, Band, same_place
from components.guidance.recovery import Recovery
from components.guidance.resolution import Resolution

_SIDES = (-1.0, 1.0)


class ResolutionMemory:
    """The memory of one kind of resolutions of one ownship.

    An earlier way out is kept as long as what lies between it and the new one is not red, and there
    has not been one on its side for long, or it is near the new one, or had a larger recovery
    cylinder. The preferred side changes only when it is no longer young and the other way is
    clearly shorter.

    Parameters
    ----------
    values : mapping
        Values of a configuration, by key.
    kind_name : {"hdir", "hs", "vs", "alt"}
    """

    def __init__(self, values: Any, kind_name: str) -> None:
        self._hysteresis_s: float = values["hysteresis_time"]
        self._persistence_s: float = values["persistence_time"]
        self._near: float = values[f"persistence_preferred_{kind_name}"]
        self._least_red = REGIONS.index(values["corrective_region"])
        self._cyclic = kind_name == "hdir"
        self._last_s: float | None = None
        self._clear()

    def _clear(self) -> None:
        self._kept = [math.nan, math.nan]
        self._since_s = [0.0, 0.0]
        self._shrinks = [-1, -1]
        self._high: bool | None = None
        self._high_since_s = 0.0

    def step(
        self,
        now_s: float,
        found: Resolution | None,
        bands: list[Band],
        own_value: float,
        recovery: Recovery | None,
    ) -> Resolution | None:
        """Take in the resolution of one instant, and return the one that is shown.

        Parameters
        ----------
        now_s : float
        found : Resolution or None
            Of the bands of that instant.
        bands : list of Band
            The bands as remembered.
        own_value : float
        recovery : Recovery or None
        """
        since_s = None if self._last_s is None else now_s - self._last_s
        if since_s is None or not 0.0 < since_s <= self._hysteresis_s:
            self._clear()
        self._last_s = now_s
        if found is None or self._hysteresis_s == 0.0:
            self._clear()
            return found
        shrinks = -1 if recovery is None else recovery.shrinks
        open_above = math.isfinite(found.high) or recovery is not None
        for side, new in enumerate((found.low, found.high)):
            # So the reference is seen to do: a way down or left is not kept where none leads up.
            keeps = side == 1 or open_above
            if keeps and self._keeps(side, new, bands, own_value, now_s, shrinks):
                continue
            if self._kept[side] != new:
                if not math.isfinite(self._kept[side]):
                    self._since_s[side] = now_s
                self._kept[side] = new
            self._shrinks[side] = shrinks
        low, high = self._kept
        return Resolution(low, high, self._prefers(now_s, own_value, low, high))

    def _keeps(
        self,
        side: int,
        new: float,
        bands: list[Band],
        own_value: float,
        now_s: float,
        shrinks: int,
    ) -> bool:
        old = self._kept[side]
        if not (math.isfinite(old) and math.isfinite(new)):
            return False
        far = self._away(side, old, own_value) - self._away(side, new, own_value)
        if not self._free_between(side, new, old, far, bands):
            return False
        young = now_s - self._since_s[side] < self._persistence_s
        if not young and far < 0.0:  # by less than what is one place
            return False
        return young or self._shrinks[side] < shrinks or abs(far) <= self._near

    def _away(self, side: int, edge: float, own_value: float) -> float:
        away = _SIDES[side] * (edge - own_value)
        return away % FULL_TURN if self._cyclic else away

    def _free_between(
        self, side: int, new: float, old: float, far: float, bands: list[Band]
    ) -> bool:
        """Tell whether all from the new edge to the old one is free of red bands."""
        if same_place(new, old):
            return True
        if far < 0.0:
            return False
        for step in (0.0, FULL_TURN, -FULL_TURN) if self._cyclic else (0.0,):
            for band in bands:
                red = band.region != "RECOVERY" and REGIONS.index(band.region) >= self._least_red
                start, end = (new, new + far) if side else (new - far, new)
                low, high = band.low + step, band.high + step
                overlaps = low < end and start < high
                touches = same_place(low, end) or same_place(high, start)
                if red and overlaps and not touches:
                    return False
        return True

    def _prefers(self, now_s: float, own_value: float, low: float, high: float) -> bool:
        down = self._away(0, low, own_value) if math.isfinite(low) else math.inf
        up = self._away(1, high, own_value) if math.isfinite(high) else math.inf
        now_high = math.isfinite(up) and up <= down
        if self._high is None or now_high == self._high:
            if self._high is None:
                self._high_since_s = now_s
            self._high = now_high
            return now_high
        only_one = math.isinf(up) or math.isinf(down)
        old = now_s - self._high_since_s >= self._persistence_s
        if only_one or (old and abs(up - down) >= self._near):
            self._high, self._high_since_s = now_high, now_s
        return self._high
