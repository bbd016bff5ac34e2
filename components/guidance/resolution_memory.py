"""What guidance remembers of its resolutions: an earlier way out, and the preferred side."""

import math
from typing import Any

from components.alert_configuration.configuration import REGIONS
from components.guidance.band_memory import band_at
from components.guidance.intervals import FULL_TURN, Band, same_place
from components.guidance.recovery import Recovery
from components.guidance.resolution import Resolution, away, is_red

_LOW, _HIGH = 0, 1


class ResolutionMemory:
    """The memory of one kind of resolutions of one ownship.

    An earlier way out is kept while the preferred side is young, while the recovery cylinder was
    larger, or while it is near the new one; and as long as the bands between the two are not red.
    The preferred side changes only when it is no longer young and the other way clearly shorter.

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
        self._shown = [math.nan, math.nan]
        # How often the recovery cylinder had been made smaller for what is shown.
        self._shrinks = [-1, -1]
        self._prefers_high = False
        self._since_s: float | None = None

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
        if self._hysteresis_s == 0.0:
            return found
        raw = [math.nan, math.nan] if found is None else [found.low, found.high]
        shrinks = -1 if recovery is None else recovery.shrinks
        if self._since_s is None or now_s <= self._since_s or self._near == 0.0:
            self._shown, self._shrinks, self._since_s = list(raw), [shrinks, shrinks], None
        else:
            young = now_s - self._since_s < self._persistence_s
            for side in (_HIGH, _LOW):
                holds = young or self._shrinks[side] < shrinks
                if not self._keeps(side, raw[side], bands, own_value, holds):
                    self._shown[side], self._shrinks[side] = raw[side], shrinks
        self._prefer(now_s, raw, own_value, shrinks)
        if found is None:
            return None
        return Resolution(self._shown[_LOW], self._shown[_HIGH], self._prefers_high)

    def _keeps(
        self, side: int, raw: float, bands: list[Band], own_value: float, holds: bool
    ) -> bool:
        """Tell whether the way out that was shown stays; `holds` however far it is."""
        old = self._shown[side]
        if not (math.isfinite(old) and math.isfinite(raw)):
            return False
        beyond = self._outwards(side, own_value, old)
        if not (beyond <= math.pi if self._cyclic else beyond >= 0.0):
            return False
        if not holds and self._outwards(side, raw, old) >= self._near:
            return False
        return self._leads(self._band_of(side, raw, bands), band_at(bands, old), bands)

    def _outwards(self, side: int, start: float, end: float) -> float:
        """Return how far it is from one value to another, to a side."""
        way = end - start if side == _HIGH else start - end
        return way % FULL_TURN if self._cyclic else way

    def _band_of(self, side: int, edge: float, bands: list[Band]) -> int:
        """Return which band that is not red begins above an edge, or ends below it."""
        if self._cyclic and (same_place(edge, 0.0) or same_place(edge, FULL_TURN)):
            return 0 if side == _HIGH else len(bands) - 1
        free = [i for i, band in enumerate(bands) if not is_red(band, self._least_red)]
        if side == _HIGH:
            return next((i for i in free if same_place(bands[i].low, edge)), -1)
        return next((i for i in reversed(free) if same_place(bands[i].high, edge)), -1)

    def _leads(self, start: int, end: int, bands: list[Band]) -> bool:
        """Tell whether bands lead to another one, towards the preferred side, and none is red."""
        if start < 0:
            return False
        at = start
        while at != end:
            at += 1 if self._prefers_high else -1
            if self._cyclic:
                at %= len(bands)
            if at == start or not 0 <= at < len(bands) or is_red(bands[at], self._least_red):
                return False
        return True

    def _prefer(self, now_s: float, raw: list[float], own_value: float, shrinks: int) -> None:
        low, high = raw
        if not (math.isfinite(low) or math.isfinite(high)):
            self._prefers_high, self._since_s = False, None
        elif not math.isfinite(high):
            if self._prefers_high:
                self._switch(now_s, raw, shrinks)
        elif not math.isfinite(low):
            if not self._prefers_high:
                self._switch(now_s, raw, shrinks)
        else:
            down, up = (away(own_value, edge, self._cyclic) for edge in (low, high))
            nearer_high = up <= down or same_place(up, down)
            other = self._shrinks[_LOW if self._prefers_high else _HIGH]
            mine = self._shrinks[_HIGH if self._prefers_high else _LOW]
            if self._since_s is None:
                self._prefers_high, self._since_s = nearer_high, now_s
            elif now_s - self._since_s < self._persistence_s or abs(up - down) < self._near:
                return
            elif other <= mine and nearer_high != self._prefers_high:
                self._switch(now_s, raw, shrinks)

    def _switch(self, now_s: float, raw: list[float], shrinks: int) -> None:
        self._prefers_high, self._since_s = not self._prefers_high, now_s
        for side in (_LOW, _HIGH):
            if self._shrinks[side] >= shrinks:
                self._shown[side] = raw[side]
