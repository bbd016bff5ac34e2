"""Every look of a sensor, with a detection or without, as a run folder's table ``looks`` has it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from components.messages.columns import DESCRIBED
from dsa_des.arrays.types import AnyArray
from dsa_des.block.message import Message
from dsa_des.block.recorded_columns import Columns, Text

_FLAGS = ("evaluated", "detected")
_NUMBERS = (
    "true_azimuth_rad",
    "true_elevation_rad",
    "true_range_m",
    "confidence",
    "snr_db",
    "detection_probability",
    "pixels",
)


@dataclass(eq=False)
class EveryLook(Message):
    """What a sensor records where looks are asked for; it goes over no wire."""

    described = DESCRIBED
    recorded: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "looks": {
            "scan": "int64",
            "target": "text",
            **dict.fromkeys(_FLAGS, "bool"),
            **dict.fromkeys(_NUMBERS, "float64"),
        }
    }


def looks_of(cells: Any, look: Any, scans: int) -> dict[str, AnyArray]:
    """Return a sensor's looks at all targets of the roster.

    Parameters
    ----------
    cells : Cells
        What was evaluated.
    look : Look
        What came of it.
    scans : int

    Returns
    -------
    dict of (scans, targets) arrays
        Not evaluated: not ``detected``, and NaN.
    """
    shape = (scans, len(cells.roster))
    place = (cells.row, cells.target)
    found: dict[str, AnyArray] = {}
    for name, values in (("evaluated", True), ("detected", look.detected)):
        found[name] = np.zeros(shape, dtype=bool)
        found[name][place] = values
    known = {
        "true_azimuth_rad": cells.body_azimuth_rad,
        "true_elevation_rad": cells.body_elevation_rad,
        "true_range_m": cells.range_m,
        "confidence": look.confidence,
        **look.extras,
    }
    for name in _NUMBERS:
        found[name] = np.full(shape, np.nan)
        if name in known:
            found[name][place] = known[name]
    return found


def look_columns(detections: Any) -> Columns:
    """Return the rows of the looks of a report: every target at every scan."""
    count = len(detections.roster)
    columns: Columns = {
        "tick": np.repeat(detections.tick, count),
        "scan": np.repeat(detections.scan, count),
        "target": Text(np.tile(np.arange(count), len(detections)), detections.roster.names),
    }
    columns.update({name: values.reshape(-1) for name, values in detections.looks.items()})
    return columns
