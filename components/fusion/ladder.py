"""The ladder of fusions: which detections belong together, by whom, when and where."""

from typing import Any

import numpy as np

from components.geometry import unit_vectors
from components.messages.false_detections import without_false_alarms
from components.sensor.ladder_values import angle_between_vectors_mrad
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.wake import Wake


def fused_line_of_sight_errors(
    block: Component, wake: Wake, reference: Component
) -> dict[str, AnyArray]:
    """Return fused lines of sight's errors by row and target: direction (mrad), range (m).

    Rungs fuse other rows, so they are compared with the truth and not row by row with each other.
    """
    fused: Any = block.run(wake)
    if fused is None:
        return {"direction": np.empty((0, 0)), "range": np.empty((0, 0))}
    fused = without_false_alarms(fused)
    shape = (len(wake), len(fused.roster))
    row = np.searchsorted(wake.ticks, np.repeat(fused.tick, np.diff(fused.offsets)))
    line: FloatArray = np.full(shape, np.nan)
    distance: FloatArray = np.full(shape, np.nan)
    line[row, fused.target] = angle_between_vectors_mrad(
        unit_vectors(fused.azimuth_rad, fused.elevation_rad),
        unit_vectors(fused.true_azimuth_rad, fused.true_elevation_rad),
    )
    distance[row, fused.target] = np.abs(fused.range_m - fused.true_range_m)
    return {"direction": line, "range": distance}


def truth(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return the reference block's fused lines of sight's errors, at given cells (row, target)."""
    row, target = cells.T
    return {
        name: values[row, target]
        for name, values in fused_line_of_sight_errors(block, wake, block).items()
    }


def _errors_to_truth(values: AnyArray, reference: AnyArray) -> FloatArray:
    return values


FUSION_LADDER = Ladder(
    "association",
    (
        Rung("exact_instant", "same target, same instant (Fig. 4.22)", "fusion.pick_best",
             {"coincidence_s": 0}),
        Rung("window", "same target, at most 0.1 s apart", "fusion.pick_best",
             {"coincidence_s": 0.1}),
        Rung("gated", "within 0.1 s, 2 deg and 300 m, whatever the target", "fusion.gated",
             {"time_gate_s": 0.1, "angle_gate_deg": 2.0, "range_gate_m": 300.0}),
    ),
    "exact_instant",
    (
        Quantity("range", "m", _errors_to_truth),
        Quantity("direction", "mrad", _errors_to_truth),
    ),
    fused_line_of_sight_errors,
    truth,
    clears=("model",),
)  # fmt: skip
