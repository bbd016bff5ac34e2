"""The earliest way out of a violation that cannot be avoided."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.guidance.intervals import Interval
from components.guidance.manoeuvre_kinds import Conflicts, manoeuvres_of_kind
from components.guidance.regions import (
    GuidedIntruders,
    Regions,
    clear_intervals_of_row,
    has_neighbouring_clear_values,
)
from components.guidance.situation import Detector, State
from components.well_clear.tcas import recovery_cylinder_sizes_m
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# The search for the earliest recovery ends when it is known this well, s.
_SEARCHED_S = 0.5


class Recovery(NamedTuple):
    """When a violation no longer avoidable is left, and the cylinder that is clear until then."""

    # From when on the volume is clear; minus infinity where nothing avoids a collision
    time_s: float
    # (float, float): radius and half height that stay clear until then
    cylinder_m: tuple[float, float]
    shrinks: int  # How often the cylinder was made smaller


def find_recoveries(
    kind_name: str, configuration: Configuration, own: State, intruders: list[GuidedIntruders]
) -> list[tuple[Recovery, list[Interval]]]:
    """Return each of r ownships' earliest recovery, and the intervals of values leading to it."""
    return _Search(kind_name, configuration, own, intruders).run()


Sizes = tuple[FloatArray, FloatArray]


def recovery_cylinder(configuration: Configuration, altitude_m: FloatArray) -> Sizes:
    """Return the radius and half height (m) of recovery's cylinder, before it is made smaller.

    Where the configuration has 0, those of the resolution advisories of TCAS II count.
    """
    keys = "min_horizontal_recovery", "min_vertical_recovery"
    given = (configuration[key] for key in keys)
    result = [
        np.full(np.shape(altitude_m), size) if size > 0.0 else table
        for size, table in zip(given, recovery_cylinder_sizes_m(altitude_m), strict=True)
    ]
    return result[0], result[1]


def _sizes_of_row(sizes: FloatArray, row: int) -> tuple[float, float]:
    return float(sizes[0][row]), float(sizes[1][row])


class _Search:
    """The search of r ownships."""

    def __init__(
        self,
        kind_name: str,
        configuration: Configuration,
        own: State,
        intruders: list[GuidedIntruders],
    ) -> None:
        self._kind_name, self._own = kind_name, own
        self._configuration = configuration
        self._lookahead_s: float = configuration["lookahead_time"]
        # Release 2.0.1 finds no recovery that begins later than the early time of its last level:
        # so it was recorded, of altitudes, over one flight.
        self._latest_s = math.inf
        if configuration["daidalus_version"] == "2.0.1":
            last = (one.alerter.levels[-1].early_alerting_time_s for one in intruders)
            self._latest_s = min(last, default=math.inf)
        self._kind = manoeuvres_of_kind(kind_name, own, configuration)
        self._intruders = intruders
        self._sizes = recovery_cylinder(configuration, own.up_m)
        regions = Regions(configuration, self._kind, own, intruders)
        _, self._concerned = regions.has_region_and_concerned(configuration["corrective_region"])
        self._volumes = [regions.conflicts(one.intruder, one.level) for one in self._concerned]
        # Cylinder about each intruder that counts, of the sizes that are tried.
        self._cylinders: list[Conflicts] = []

    def run(self) -> list[tuple[Recovery, list[Interval]]]:
        """Make the cylinder smaller until it leaves a way, and find from when on."""
        values = self._configuration
        nmac = values["horizontal_nmac"], values["vertical_nmac"]
        count = len(self._kind.own_value)
        result: list[tuple[Recovery, list[Interval]] | None] = [None] * count
        sizes, shrinks = np.array(self._sizes), np.zeros(count, dtype=np.int64)

        def smaller(rows: IntArray) -> IntArray:
            """Shrink the cylinders of rows; return the rows for which a smaller one is tried."""
            ends = np.ones(len(rows), dtype=bool)
            if values["ca_bands"]:
                reduced = sizes[:, rows] * (1.0 - values["ca_factor"])
                sizes[:, rows] = np.maximum(np.array(nmac)[:, np.newaxis], reduced)
                shrinks[rows] += 1
                # That of a collision is not looked at again: there is neither a time nor a way.
                ends = (sizes[0, rows] <= nmac[0]) & (sizes[1, rows] <= nmac[1])
            for row in rows[ends].tolist():
                result[row] = Recovery(-math.inf, _sizes_of_row(sizes, row), int(shrinks[row])), []
            return rows[~ends]

        self._set_cylinders(np.repeat(nmac, count).reshape(2, count))
        on = self._has_clear_interval(self._is_clear_of_cylinder())
        for row in np.flatnonzero(~on).tolist():
            result[row] = Recovery(-math.inf, nmac, 0), []
        todo = np.flatnonzero(on)
        while len(todo):
            rows = self._rows_with_recovery(todo, sizes, smaller)
            if not len(rows):
                break
            part = self._select_rows(rows)
            part._set_cylinders(sizes[:, rows])
            time_s = part._earliest_recovery_s()
            clear = part._is_clear_until(time_s[:, np.newaxis])
            found = part._has_clear_interval(clear) & (time_s <= self._latest_s)
            for index in np.flatnonzero(found).tolist():
                row = int(rows[index])
                recovery = Recovery(
                    float(time_s[index]), _sizes_of_row(sizes, row), int(shrinks[row])
                )
                result[row] = recovery, clear_intervals_of_row(part._kind, index, clear)
            todo = smaller(rows[~found])
        return [one for one in result if one is not None]

    def _rows_with_recovery(
        self, rows: IntArray, sizes: FloatArray, smaller: Callable[[IntArray], IntArray]
    ) -> IntArray:
        """Return rows in which some values clear the cylinder, each made as small as that takes."""
        led: list[IntArray] = []
        search, on = self._select_rows(rows), np.ones(len(rows), dtype=bool)
        while on.any():
            if 2 * np.count_nonzero(on) <= len(on):  # what has ended for most is left behind
                rows = rows[on]
                search, on = self._select_rows(rows), on[on]
            search._set_cylinders(sizes[:, rows])
            leads = on & search._has_clear_interval(search._is_clear_of_cylinder())
            led.append(rows[leads])
            on = np.isin(rows, smaller(rows[on & ~leads]))
        return np.sort(np.concatenate([*led, np.empty(0, dtype=np.int64)]))

    def _select_rows(self, rows: IntArray) -> "_Search":
        """Return the search for the given ascending rows; this one itself if they are all."""
        if len(rows) == len(self._kind.own_value):
            return self
        intruders = [intruder.rows(rows) for intruder in self._intruders]
        return _Search(self._kind_name, self._configuration, self._own.rows(rows), intruders)

    def _set_cylinders(self, sizes: Sizes | FloatArray) -> None:
        """Compute and store the conflicts with cylinders of the given sizes (r,)."""
        detector = Detector(cylinder_m=(sizes[0][:, np.newaxis], sizes[1][:, np.newaxis]))
        self._cylinders = [
            self._kind.find_conflicts(self._intruders[one.intruder].state.columns(), detector)
            for one in self._concerned
        ]

    def _has_clear_interval(self, clear: BoolArray) -> BoolArray:
        return has_neighbouring_clear_values(self._kind, clear)

    def _is_clear_of_cylinder(self) -> BoolArray:
        """Return a mask (r, k), True for values clear of the cylinder, whatever the volumes."""
        clear = self._kind.there.copy()
        for one, cylinder in zip(self._concerned, self._cylinders, strict=True):
            unsafe = cylinder.is_in_or_behind_conflict(0.0, one.horizon_s)
            clear &= ~(unsafe & one.of_whom[:, np.newaxis])
        return clear

    def _is_clear_until(self, time_s: FloatArray) -> BoolArray:
        """Return a mask (r, k), True if clear of cylinders before a time (r, 1), then of volumes.

        Beyond the horizon of an intruder only the cylinder counts, as far as that horizon.
        """
        clear = self._kind.there.copy()
        of_all = zip(self._concerned, self._volumes, self._cylinders, strict=True)
        for one, volume, cylinder in of_all:
            unsafe = volume.is_in_or_behind_conflict(time_s, one.horizon_s)
            unsafe |= cylinder.has_conflict_before(time_s, one.horizon_s)
            beyond = time_s > one.horizon_s
            if beyond.any():
                unsafe |= cylinder.is_in_or_behind_conflict(0.0, one.horizon_s) & beyond
            clear &= ~(unsafe & one.of_whom[:, np.newaxis])
        return clear

    def _earliest_recovery_s(self) -> FloatArray:
        """Return the earliest time (s) with values clear of the volumes plus the stability time."""
        count = len(self._kind.own_value)
        red, green = np.zeros(count), np.full(count, self._lookahead_s + 1.0)
        probe = np.full(count, self._lookahead_s)
        on = np.ones(count, dtype=bool)
        while on.any():
            leads = self._has_clear_interval(self._is_clear_until(probe[:, np.newaxis]))
            green = np.where(on & leads, probe, green)
            red = np.where(on & ~leads, probe, red)
            probe = 0.5 * (red + green)
            on = on & (green - red > _SEARCHED_S)
        stable = green + self._configuration["recovery_stability_time"]
        return np.where(green <= self._lookahead_s, np.minimum(self._lookahead_s, stable), red)
