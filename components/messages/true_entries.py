"""Detections without those that have no target."""

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from components.messages.detections import Detections
from components.messages.fused import FusedDetections
from dsa_des.block.message import PER_ENTRY, offsets_of

AnyDetections = TypeVar("AnyDetections", Detections, FusedDetections)


def true_entries(message: AnyDetections) -> AnyDetections:
    """Return the message without false alarms; the message itself where it has none.

    Parameters
    ----------
    message : Detections or FusedDetections

    Returns
    -------
    Detections or FusedDetections
        The same rows.
    """
    if np.count_nonzero(message.target < 0) == 0:
        return message
    keep = np.flatnonzero(message.target >= 0)
    rows = np.arange(len(message) + 1)
    row = np.repeat(rows[:-1], np.diff(message.offsets))[keep]
    kept: dict[str, Any] = {}
    for item in fields(message):
        if item.metadata.get("per") == PER_ENTRY:
            values = getattr(message, item.name)
            if isinstance(values, dict):
                kept[item.name] = {name: column[keep] for name, column in values.items()}
            elif values is not None:
                kept[item.name] = values[keep]
    return replace(message, offsets=offsets_of(row, len(rows) - 1), **kept)
