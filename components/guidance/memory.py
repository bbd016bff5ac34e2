"""Memory of guidance: M-of-N and persistence of bands, hysteresis of resolutions."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

from components.alert_configuration.configuration import REGIONS, Configuration
from components.guidance.bands import (
    Guidance,
    Resolution,
    distance_to_edge,
    is_red,
    nearest_values_outside_red,
)
from components.guidance.intervals import (
    FULL_TURN,
    Band,
    is_same_value,
    join_neighbours,
    rename_none_to_recovery,
)
from components.guidance.recovery import Recovery

_OUTSIDE = -1
_SEVERE = ("FAR", "MID", "NEAR")


class BandMemory:
    """Remembers one ownship's bands of one kind, so that they do not change at every instant."""

    def __init__(self, values: Any, cyclic: bool) -> None:
        self._hysteresis_s: float = values["hysteresis_time"]
        self._m, self._n = int(values["alerting_m"]), int(values["alerting_n"])
        self._counts = self._hysteresis_s > 0.0 and 0 < self._m <= self._n
        self._persistence_s: float = values["persistence_time"]
        self._persists = self._persistence_s > 0.0 and values["bands_persistence"]
        self._persists = self._persists and self._hysteresis_s > 0.0
        self._cyclic = cyclic
        self._last_s: float | None = None
        self._clear()

    def _clear(self) -> None:
        self._places: list[float] = []
        self._queues: list[tuple[list[int], list[int]]] = []
        self._held: Band | None = None
        self._risen_s = 0.0

    def step(
        self, now_s: float, line: list[Band], own_value: float, recovery: Recovery | None
    ) -> list[Band]:
        """Update the memory with the bands of one instant, and return the remembered bands."""
        since_s = None if self._last_s is None else now_s - self._last_s
        if since_s is None or not 0.0 < since_s <= self._hysteresis_s:
            self._clear()
        self._last_s = now_s
        if self._counts:
            line = self._filter_colours(line)
        if self._persists:
            line = self._paint_remembered(now_s, line, own_value)
        # Ways out that are remembered count as long as one is needed, also where none is left now.
        if recovery is None:
            line = [b._replace(region="NONE") if b.region == "RECOVERY" else b for b in line]
        line = join_neighbours(line)
        recovers = recovery is not None and recovery.time_s >= 0.0
        bands = rename_none_to_recovery(line) if recovers else line
        if self._persists:
            self._remember(bands, own_value)
        return bands

    def _filter_colours(self, line: list[Band]) -> list[Band]:
        """Return the line of bands with, at each place, the m-th worst colour of its last n.

        Each place of the line and of the memory stays one, also where the colour does not change.
        """
        places = [line[0].low, *(band.high for band in line)]
        colours = [REGIONS.index(band.region) for band in line]
        # Colours to the left and to the right of each place.
        left, right = [_OUTSIDE, *colours], [*colours, _OUTSIDE]
        if self._cyclic:
            left[0], right[-1] = left[-1], right[0]
        if not self._places:
            self._places = list(places)
            self._queues = [
                (self._initial_queue(a), self._initial_queue(b))
                for a, b in zip(left, right, strict=True)
            ]
        self._split_at_common_places(places, left, right)
        result: list[int] = []
        for queues, a, b in zip(self._queues, left, right, strict=True):
            for queue, colour in zip(queues, (a, b), strict=True):
                queue.append(colour)
                del queue[0]
            result.append(sorted(queues[1])[-self._m])
        made = [
            Band(low, high, REGIONS[max(colour, 0)])
            for low, high, colour in zip(places[:-1], places[1:], result[:-1], strict=True)
        ]
        last = len(self._places) - 1
        kept = [
            i for i in range(last + 1) if i in (0, last) or self._queues[i][0] != self._queues[i][1]
        ]
        self._places = [self._places[i] for i in kept]
        self._queues = [self._queues[i] for i in kept]
        return made

    def _initial_queue(self, colour: int) -> list[int]:
        return [colour] * self._m + [_OUTSIDE] * (self._n - self._m)

    def _split_at_common_places(
        self, places: list[float], left: list[int], right: list[int]
    ) -> None:
        """Split new and remembered bands at each other's edges, in place, to match one for one."""
        at = 0
        while at < max(len(places), len(self._places)):
            mine = self._places[at] if at < len(self._places) else math.inf
            other = places[at] if at < len(places) else math.inf
            if not is_same_value(mine, other):
                if mine < other:
                    places.insert(at, mine)
                    left.insert(at, left[at])
                    right.insert(at, left[at + 1])
                else:
                    queue = self._queues[at][0]
                    self._places.insert(at, other)
                    self._queues.insert(at, (list(queue), list(queue)))
            at += 1

    def _paint_remembered(self, now_s: float, line: list[Band], own_value: float) -> list[Band]:
        """Return the line, with the remembered band painted over milder ones while recent."""
        held = self._held
        if held is None:
            self._risen_s = now_s
            return line
        region = _region_at(line, own_value)
        colour, remembered = REGIONS.index(region), REGIONS.index(held.region)
        if colour < remembered and 0.0 <= now_s - self._risen_s < self._persistence_s:
            return _paint_over(line, held, remembered)
        if region in _SEVERE and colour > remembered:
            self._risen_s = now_s
        return line

    def _remember(self, bands: list[Band], own_value: float) -> None:
        at = band_index_at(bands, own_value)
        self._held = None
        if bands[at].region not in _SEVERE:
            return
        self._held = bands[at]
        first, last = bands[0], bands[-1]
        across = self._cyclic and len(bands) > 1 and first.region == last.region
        if across and at in (0, len(bands) - 1):
            # Beyond a full turn where it holds north.
            self._held = Band(last.low, first.high + FULL_TURN, first.region)


def band_index_at(bands: list[Band], value: float) -> int:
    """Return the index of a value's band; where two meet, that of the free or milder one."""
    holding = [
        i
        for i, band in enumerate(bands)
        if band.low <= value <= band.high
        or is_same_value(band.low, value)
        or is_same_value(band.high, value)
    ]
    if not holding:  # beyond the limits
        return 0 if value < bands[0].low else len(bands) - 1

    def mildness(i: int) -> int:
        region = bands[i].region
        return -1 if region == "RECOVERY" else REGIONS.index(region)

    return min(holding, key=mildness)


def _region_at(bands: list[Band], value: float) -> str:
    return bands[band_index_at(bands, value)].region


def _paint_over(line: list[Band], held: Band, remembered: int) -> list[Band]:
    """Return the line with a band painted over those of milder regions."""
    spans = [(held.low, held.high)]
    if held.high > line[-1].high and not is_same_value(held.high, line[-1].high):
        spans = [(held.low, line[-1].high), (line[0].low, held.high - FULL_TURN)]
    places = [line[0].low, *(band.high for band in line)]
    least, most = places[0], places[-1]
    for value in (edge for span in spans for edge in span):
        if least < value < most and not any(is_same_value(known, value) for known in places):
            places.append(value)
    places.sort()
    made = []
    for low, high in pairwise(places):
        middle = 0.5 * (low + high)
        region = next(b.region for b in line if b.low <= middle <= b.high)
        inside = any(a <= middle <= b for a, b in spans)
        if inside and REGIONS.index(region) < remembered:
            region = held.region
        made.append(Band(low, high, region))
    return made


_LOW, _HIGH = 0, 1


class ResolutionMemory:
    """The memory of one kind of resolutions of one ownship, by the values of a configuration.

    An earlier way out is kept while the preferred side is young, while the recovery cylinder was
    larger, or while it is near the new one; and as long as the bands between the two are not red.
    The preferred side changes only when it is no longer young and the other way clearly shorter.
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
        way: Resolution | None,
        bands: list[Band],
        own_value: float,
        recovery: Recovery | None,
    ) -> Resolution | None:
        """Update the memory with the resolution of one instant, and return the one to show."""
        since_s = None if self._last_s is None else now_s - self._last_s
        if since_s is None or not 0.0 < since_s <= self._hysteresis_s:
            self._clear()
        self._last_s = now_s
        if self._hysteresis_s == 0.0:
            return way
        raw = [math.nan, math.nan] if way is None else [way.low, way.high]
        shrinks = -1 if recovery is None else recovery.shrinks
        if self._since_s is None or now_s <= self._since_s or self._near == 0.0:
            self._shown, self._shrinks, self._since_s = list(raw), [shrinks, shrinks], None
        else:
            young = now_s - self._since_s < self._persistence_s
            for side in (_HIGH, _LOW):
                holds = young or self._shrinks[side] < shrinks
                if not self._keeps(side, raw[side], bands, own_value, holds):
                    self._shown[side], self._shrinks[side] = raw[side], shrinks
        self._choose_side(now_s, raw, own_value, shrinks)
        if way is None:
            return None
        return Resolution(self._shown[_LOW], self._shown[_HIGH], self._prefers_high)

    def _keeps(
        self, side: int, raw: float, bands: list[Band], own_value: float, holds: bool
    ) -> bool:
        """Return whether a side's shown resolution stays; with ``holds`` however far the new is."""
        old = self._shown[side]
        if not (math.isfinite(old) and math.isfinite(raw)):
            return False
        beyond = self._distance_outward(side, own_value, old)
        if not (_is_surely_below(beyond, math.pi) if self._cyclic else beyond >= 0.0):
            return False
        if not holds and not _is_surely_below(self._distance_outward(side, raw, old), self._near):
            return False
        return self._is_connected_without_red(
            self._free_band_index_at(side, raw, bands), band_index_at(bands, old), bands
        )

    def _distance_outward(self, side: int, start: float, end: float) -> float:
        """Return the distance from one value to another, counted towards a side."""
        way = end - start if side == _HIGH else start - end
        return way % FULL_TURN if self._cyclic else way

    def _free_band_index_at(self, side: int, edge: float, bands: list[Band]) -> int:
        """Return the index of the band, not red, that begins (lower side: ends) there, or -1."""
        if self._cyclic and (is_same_value(edge, 0.0) or is_same_value(edge, FULL_TURN)):
            return 0 if side == _HIGH else len(bands) - 1
        free = [i for i, band in enumerate(bands) if not is_red(band, self._least_red)]
        if side == _HIGH:
            return next((i for i in free if is_same_value(bands[i].low, edge)), -1)
        return next((i for i in reversed(free) if is_same_value(bands[i].high, edge)), -1)

    def _is_connected_without_red(self, start: int, end: int, bands: list[Band]) -> bool:
        """Return whether a band is reached from another on the preferred side, crossing no red."""
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

    def _choose_side(self, now_s: float, raw: list[float], own_value: float, shrinks: int) -> None:
        low, high = raw
        if not (math.isfinite(low) or math.isfinite(high)):
            self._prefers_high, self._since_s = False, None
        elif not math.isfinite(high):
            if self._prefers_high:
                self._prefer_other_side(now_s, raw, shrinks)
        elif not math.isfinite(low):
            if not self._prefers_high:
                self._prefer_other_side(now_s, raw, shrinks)
        else:
            down, up = (distance_to_edge(own_value, edge, self._cyclic) for edge in (low, high))
            nearer_high = up <= down or is_same_value(up, down)
            other = self._shrinks[_LOW if self._prefers_high else _HIGH]
            mine = self._shrinks[_HIGH if self._prefers_high else _LOW]
            if self._since_s is None:
                self._prefers_high, self._since_s = nearer_high, now_s
            elif now_s - self._since_s < self._persistence_s or abs(up - down) < self._near:
                return
            elif other <= mine and nearer_high != self._prefers_high:
                self._prefer_other_side(now_s, raw, shrinks)

    def _prefer_other_side(self, now_s: float, raw: list[float], shrinks: int) -> None:
        self._prefers_high, self._since_s = not self._prefers_high, now_s
        for side in (_LOW, _HIGH):
            if self._shrinks[side] >= shrinks:
                self._shown[side] = raw[side]


def _is_surely_below(one: float, other: float) -> bool:
    return one < other and not is_same_value(one, other)


class Remembered(NamedTuple):
    """One kind's bands at one instant after memory, and the resolution that leads out of them."""

    bands: list[Band]
    resolution: Resolution | None


class GuidanceMemory:
    """What is remembered of the guidance of one kind (of `KINDS`), for one ownship.

    With `hysteresis_time` 0 of the configuration every instant stands by itself.
    """

    def __init__(self, configuration: Configuration, kind_name: str) -> None:
        self._cyclic = kind_name == "hdir"
        self._corrective: str = configuration["corrective_region"]
        self._bands = BandMemory(configuration, self._cyclic)
        self._resolutions = ResolutionMemory(configuration, kind_name)

    def step(self, now_s: float, guided: Guidance) -> Remembered:
        """Update the memory with one instant's guidance; return bands and resolution to show."""
        own_value, recovery = guided.own_value, guided.recovery
        bands = self._bands.step(now_s, guided.line, own_value, recovery)
        way = nearest_values_outside_red(bands, own_value, self._corrective, self._cyclic)
        shown = self._resolutions.step(now_s, way, bands, own_value, recovery)
        return Remembered(bands, shown)
