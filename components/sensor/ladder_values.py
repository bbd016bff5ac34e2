"""Quantities of blocks' ladders: values per target-scan, over all targets of the run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.geometry import angle_between_vectors, wrap_pi
from components.messages.reach import RANGE
from components.messages.targets import RelativeTargets
from components.sensor.look import Cells
from components.sensor.sensor import Sensor
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Measure
from dsa_des.block.wake import Wake


def angle_between_vectors_mrad(one: AnyArray, other: AnyArray) -> FloatArray:
    """Return the angle between unit vectors in mrad; accurate for tiny angles too."""
    return 1e3 * angle_between_vectors(one, other)


def absolute_angle_difference_mrad(one: AnyArray, other: AnyArray) -> FloatArray:
    """Return two angles' (rad) absolute difference, at most 180°, in mrad; NaN stays NaN."""
    apart = one - other
    known = ~np.isnan(apart)
    result: FloatArray = np.full(apart.shape, np.nan)
    result[known] = 1e3 * np.abs(wrap_pi(apart[known]))
    return result


def spread_over_roster(targets: RelativeTargets, values: FloatArray) -> FloatArray:
    """Return the moved targets' values (rows, roster targets, ...), NaN if absent or left out."""
    shape = (len(values), len(targets.roster), *values.shape[2:])
    wide: FloatArray = np.full(shape, np.nan)
    wide[:, targets.columns] = values
    absent = np.ones(shape[:2], dtype=bool)
    absent[:, targets.columns] = ~targets.present
    wide[absent] = np.nan
    return wide


def over_cells(
    sensor: Sensor,
    wake: Wake,
    values: Callable[[Cells], dict[str, FloatArray]],
    *,
    out_of_range: float = np.nan,
) -> dict[str, FloatArray]:
    """Evaluate a function of a sensor's cells; return its columns by name, (scans, roster targets).

    `out_of_range` where the target was not looked at because it is too far away, NaN where it was
    not for any other reason.
    """
    held = wake.held("targets")
    if held is None:
        return {}
    targets, rows = sensor.observed_targets_and_rows(*held)
    cells, reason = sensor.cells(targets, rows, wake)
    on_roster = len(targets.roster)
    wide_by_name: dict[str, Any] = {}
    for name, of_cell in values(cells).items():
        # Targets that were not even moved were too far away for every sensor.
        wide = np.full((len(wake), on_roster), out_of_range)
        part = np.full(reason.shape, np.nan)
        part[reason == RANGE] = out_of_range
        wide[:, targets.columns] = part
        wide[cells.row, cells.target] = of_cell
        wide_by_name[name] = wide
    return wide_by_name


def make_cell_measure(
    values: Callable[[Any, Cells], dict[str, FloatArray]], *, out_of_range: float = np.nan
) -> Measure:
    """Return `measure(block, wake, reference)`: `values(sensor, cells)` at all scans, targets."""

    def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
        sensor: Any = block
        given = over_cells(
            sensor, wake, lambda cells: values(sensor, cells), out_of_range=out_of_range
        )
        return dict(given)

    return measure
