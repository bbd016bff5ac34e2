"""Bands of guidance: values that lead to each region's volume, and those that lead out again.

Many states are answered at once: all is arrays over (state, manoeuvre), and only what is painted in
the end is written state by state.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import REGIONS, Alerter, Configuration
from components.guidance.intervals import (
    FULL_TURN,
    Band,
    Interval,
    is_same_value,
    paint_bands,
    rename_none_to_recovery,
)
from components.guidance.manoeuvre_kinds import ManoeuvreKind, manoeuvres_of_kind
from components.guidance.recovery import Recovery, find_recoveries, recovery_cylinder
from components.guidance.regions import GuidedIntruders, Regions, clear_intervals_of_row
from components.guidance.situation import State
from components.well_clear.detection import Bounds, select_bounds
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class Resolution(NamedTuple):
    """The nearest values, to either side, outside the red band around the own value."""

    # The nearest values that are not red to either side: left and right, or down and up;
    # infinite where there is none
    low: float
    high: float
    prefers_high: bool  # Whether the right or upper one is nearer, or no farther


def nearest_values_outside_red(
    bands: list[Band], own_value: float, corrective_region: str, cyclic: bool
) -> Resolution | None:
    """Return the nearest values outside the red band around the own value; None if in none.

    Parameters
    ----------
    bands : list of Band
        From the lowest to the highest value.
    own_value : float
    corrective_region : str
        Bands of at least this region are red, but those of recovery.
    cyclic : bool
        Whether the values are directions, from 0 to 2 pi.
    """
    least = REGIONS.index(corrective_region)
    red = [is_red(one, least) for one in bands]
    turns = (-FULL_TURN, 0.0, FULL_TURN) if cyclic else (0.0,)
    if cyclic and is_same_value(own_value, FULL_TURN):
        # As near to north it lies in the first band, and no way to the left is found.
        if not red[0]:
            return None
        low, high = -math.inf, _red_intervals_over_full_turns(bands, red, (FULL_TURN,))[0][1]
    else:
        for low, high in _red_intervals_over_full_turns(bands, red, turns):
            on_edge = is_same_value(low, own_value) or is_same_value(high, own_value)
            if low < own_value < high and not on_edge:
                break
        else:
            return None
    first, last = bands[0].low + turns[0], bands[-1].high + turns[-1]
    low_end = -math.inf if is_same_value(low, first) else low
    high_end = math.inf if is_same_value(high, last) else high
    if cyclic:
        low_end = _edge_as_direction(own_value, low_end, -math.inf)
        high_end = _edge_as_direction(own_value, high_end, math.inf)
    down, up = (
        distance_to_edge(own_value, low_end, cyclic),
        distance_to_edge(own_value, high_end, cyclic),
    )
    nearer = up <= down or is_same_value(up, down)
    return Resolution(low_end, high_end, bool(math.isfinite(high_end) and nearer))


def _red_intervals_over_full_turns(
    bands: list[Band], red: list[bool], turns: tuple[float, ...]
) -> list[tuple[float, float]]:
    """Return the intervals in which bands are red without a gap, over some turns of a circle.

    Beyond north, places of a stretch are compared with a full turn added to them, where more
    doubles lie in the same distance.
    """
    result: list[tuple[float, float]] = []
    for turn in turns:
        for band, counts in zip(bands, red, strict=True):
            if not counts:
                continue
            low, high = band.low + turn, band.high + turn
            if result:
                start, end = result[-1]
                added = FULL_TURN if start < turn and len(turns) > 1 else 0.0
                if is_same_value(end - turn + added, band.low + added):
                    result[-1] = start, high
                    continue
            result.append((low, high))
    return result


def is_red(band: Band, least: int) -> bool:
    """Return whether a band is of region `least` or worse; a recovery band is not."""
    return band.region != "RECOVERY" and REGIONS.index(band.region) >= least


def _edge_as_direction(own_value: float, edge: float, none: float) -> float:
    """Return an edge as a direction in [0, 2 pi); ``none`` if half a turn or more from the own."""
    way = abs(edge - own_value)
    if not math.isfinite(edge) or way >= math.pi or is_same_value(way, math.pi):
        return none
    wrapped = edge % FULL_TURN
    return 0.0 if is_same_value(wrapped, FULL_TURN) else wrapped


def distance_to_edge(own_value: float, edge: float, cyclic: bool) -> float:
    """Return how far an edge is from the own value, same unit; if `cyclic`, rad, shorter way."""
    way = abs(edge - own_value)
    return min(way, FULL_TURN - way) if cyclic and math.isfinite(way) else way


_PAINTED = ("NEAR", "MID", "FAR")
# States taken together: their arrays stay in the cache.
_MOST_AT_ONCE = {"hdir": 32, "hs": 64, "vs": 64, "alt": 128}
# So many times as many are held until they are painted.
_PARTS_AT_ONCE = 8


class Guidance(NamedTuple):
    """The bands of one kind."""

    own_value: float
    bands: list[Band]  # In SI units and radians, from the lowest to the highest value
    recovery: Recovery | None  # Where one was needed
    # The bands before NONE is called RECOVERY: what `components.guidance.memory` takes
    line: list[Band]

    @property
    def has_recovery(self) -> bool:
        """Return whether there is a recovery, so that free values are shown as RECOVERY bands."""
        return self.recovery is not None and self.recovery.time_s >= 0.0


@dataclass(frozen=True)
class GuidedIntruder:
    """One intruder as guidance needs it: its state, alerter, alert level and error bounds."""

    state: State  # In the ownship's plane
    alerter: Alerter
    early_level: int = 0  # The level whose early alerting time counts; 0 for none
    bounds: Bounds | None = None  # of (), how far the relative state may be wrong


def guidance(
    kind_name: str, configuration: Configuration, own: State, intruders: list[GuidedIntruder]
) -> Guidance:
    """Return bands of a kind (direction, speed, climb, altitude) at an instant, without memory.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    own : State
    intruders : list of GuidedIntruder
    """
    alone = [
        GuidedIntruders(
            _single_row_state(i.state),
            i.alerter,
            np.array([i.early_level]),
            bounds=None if i.bounds is None else select_bounds(i.bounds, np.newaxis),
        )
        for i in intruders
    ]
    return guidance_of_many(kind_name, configuration, _single_row_state(own), alone)[0]


def guidance_of_many(
    kind_name: str,
    configuration: Configuration,
    own: State,
    intruders: Sequence[GuidedIntruders],
) -> list[Guidance]:
    """Return the bands of one kind for the states of many ownships, each computed by itself.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    own : State of (n,)
        Each ownship in its own plane, at its origin.
    intruders : sequence of GuidedIntruders
        One intruder of each ownship at a time, in that plane; intruders of several alerters are
        several items.
    """
    made: list[Guidance] = []
    for block in _blocks_of_rows(
        np.arange(len(own.up_m)), _MOST_AT_ONCE[kind_name] * _PARTS_AT_ONCE
    ):
        parts = []
        for rows in _blocks_of_rows(block, _MOST_AT_ONCE[kind_name]):
            theirs = [intruder.rows(rows) for intruder in intruders]
            parts.append(_Part(kind_name, configuration, own.rows(rows), theirs))
        # A search takes as many steps whatever it holds, so those of all parts are one.
        stuck = np.concatenate([part.saturated for part in parts])
        recoveries: list[tuple[Recovery, list[Interval]]] = []
        if configuration[f"recovery_{kind_name}"]:
            for rows in _blocks_of_rows(block[stuck], _MOST_AT_ONCE[kind_name]):
                theirs = [intruder.rows(rows) for intruder in intruders]
                recoveries += find_recoveries(kind_name, configuration, own.rows(rows), theirs)
        ways = iter(recoveries)
        for part in parts:
            made += part.paint_bands(ways if recoveries else None)
    return made


def _blocks_of_rows(rows: IntArray, most: int) -> list[IntArray]:
    return [rows[start : start + most] for start in range(0, len(rows), most)]


def _single_row_state(state: State) -> State:
    return State(*(np.asarray(part, dtype=np.float64).reshape(1) for part in state))


class _Part:
    """Some ownships, with the manoeuvres clear of the volumes, and which ownships have none."""

    def __init__(
        self,
        kind_name: str,
        configuration: Configuration,
        own: State,
        intruders: list[GuidedIntruders],
    ) -> None:
        kind = manoeuvres_of_kind(kind_name, own, configuration)
        regions = Regions(configuration, kind, own, intruders)
        layers: list[tuple[str, BoolArray, BoolArray]] = []  # region, of whom, clear values
        on = np.ones(len(own.up_m), dtype=bool)
        self.saturated = np.zeros(len(on), dtype=bool)
        corrective = REGIONS.index(configuration["corrective_region"])
        for region in _PAINTED:
            known, clear = regions.has_region_and_safe_values(region)
            layers.append((region, on & known, clear))
            stuck = on & known & ~regions.has_clear_interval(clear)
            if REGIONS.index(region) >= corrective:
                self.saturated |= stuck
            on = on & ~stuck
        self._at_once = np.zeros(len(on), dtype=bool)
        if kind.instantaneous:
            self._at_once = regions.is_in_corrective()
        self._painter = _Painter(configuration, kind, layers, own.up_m)

    def paint_bands(self, ways: Iterator[tuple[Recovery, list[Interval]]] | None) -> list[Guidance]:
        """Return each row's guidance, with the next of ``ways`` where no manoeuvre is clear."""
        return [
            self._painter.guidance(row, next(ways) if stuck and ways else None, at_once)
            for row, (stuck, at_once) in enumerate(
                zip(self.saturated.tolist(), self._at_once.tolist(), strict=True)
            )
        ]


class _Painter:
    """Writes the bands of one state after the other."""

    def __init__(
        self,
        configuration: Configuration,
        kind: ManoeuvreKind,
        layers: list[tuple[str, BoolArray, BoolArray]],
        altitude_m: FloatArray,
    ) -> None:
        self._kind, self._layers = kind, layers
        self._cylinder_m = recovery_cylinder(configuration, altitude_m)
        several = kind.there.sum(axis=1) > 1
        if kind.cyclic:  # steps that do not meet astern leave a gap there
            several &= kind.values[:, -1] - kind.values[:, 0] > FULL_TURN * (1.0 - 1e-6)
        self._all_clear = several & np.logical_and.reduce(
            [~of_whom | (clear | ~kind.there).all(axis=1) for _, of_whom, clear in layers]
        )

    def guidance(
        self, row: int, recovered: tuple[Recovery, list[Interval]] | None, inside_at_once: bool
    ) -> Guidance:
        own_value = float(self._kind.own_value[row])
        least, most = float(self._kind.least[row]), float(self._kind.most[row])
        recovery, ways = recovered if recovered is not None else (None, [])
        if recovery is None and inside_at_once:
            sizes = float(self._cylinder_m[0][row]), float(self._cylinder_m[1][row])
            recovery = Recovery(0.0, sizes, 0)
        if self._all_clear[row] and recovery is None:
            free = [Band(least, most, "NONE")]
            return Guidance(own_value, free, None, free)
        layers: list[tuple[str, list[Interval], bool]] = [
            (region, clear_intervals_of_row(self._kind, row, clear), True)
            for region, of_whom, clear in reversed(self._layers)
            if of_whom[row]
        ]
        if ways:
            layers.append(("RECOVERY", ways, False))
        line = paint_bands(layers, least, most)
        result = Guidance(own_value, line, recovery, line)
        return (
            result._replace(bands=rename_none_to_recovery(line)) if result.has_recovery else result
        )
