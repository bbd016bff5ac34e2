"""Every look of a sensor, with a detection or without, as a run folder's table ``looks`` has it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from components.messages.columns import TrueLine
from dsa_des.arrays.types import AnyArray
from dsa_des.block.message import Column, Columns, Message, Text, columns_of

_TRUE = TrueLine.__dataclass_fields__
_NUMBERS = (*_TRUE, "confidence", "snr_db", "detection_probability", "pixels")


@dataclass(eq=False)
class EveryLook(Message):
    """What a sensor records where looks are asked for; it goes over no wire."""

    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = {
        "looks": {
            "scan": Column("", "", "number of the scan", "int64"),
            "target": Column("", "", "name of the target", "text"),
            "evaluated": Column(
                "", "", "whether its physics was evaluated: all else is null without", "bool"
            ),
            "detected": Column("", "", "whether it was detected", "bool"),
            **columns_of(TrueLine),
            "confidence": Column(
                "dB or signature", "", "margin that decided, by the kind of sensor"
            ),
            "snr_db": Column(
                "dB", "", "mean signal-to-noise ratio of a radar, or that of a sampled RCS"
            ),
            "detection_probability": Column(
                "", "", "probability with which the detection was drawn"
            ),
            "pixels": Column("pixels", "", "pixels that the target covers in a camera"),
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
