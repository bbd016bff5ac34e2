"""Values that an FMU's inputs take from messages: a column, of one target, row by row."""

from dataclasses import fields
from typing import Any

import numpy as np

from components.foreign.signals import Signals
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.errors import did_you_mean


def message_column(message: Any, column: str, which: str | None, key: str) -> FloatArray:
    """Return the value of a column in each row of a message; NaN where a row has none.

    Parameters
    ----------
    message : Message
    column : str
        Its field, or one of its `Signals`.
    which : str or None
        Name of the target, or the place in an array of signals.
    key : str
        Of the scene, for errors.

    Raises
    ------
    ValueError
        If there is no such column or target, or it has more than one value for each row.
    """
    if isinstance(message, Signals):
        return _signal_column(message, column, which, key)
    known = [
        item.name for item in fields(message) if _is_numeric_array(getattr(message, item.name))
    ]
    if column not in known:
        raise ValueError(
            f"{key}: {type(message).__name__} has no column {column!r}{did_you_mean(column, known)}"
        )
    values: AnyArray = getattr(message, column)
    rows = len(message)
    entries = hasattr(message, "offsets") and len(values) == int(message.offsets[-1])
    if which is None:
        if (
            values.ndim == 1
            and len(values) == rows
            and not (entries and _is_per_entry(message, column))
        ):
            return values.astype(np.float64)
        raise ValueError(f"{key}: {column!r} has a value for each target: say {column}[TARGET]")
    names = message.roster.names
    if which not in names:
        raise ValueError(f"{key}: there is no target {which!r}{did_you_mean(which, names)}")
    target = names.index(which)
    found = np.full(rows, np.nan)
    if values.ndim == 2:
        place = np.flatnonzero(message.columns == target)
        if len(place):
            found = np.where(message.present[:, place[0]], values[:, place[0]], np.nan)
        return found
    row = np.repeat(np.arange(rows), np.diff(message.offsets))
    mine = message.target == target
    found[row[mine]] = values[mine]
    return found


def _is_numeric_array(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf"


def _is_per_entry(message: Any, column: str) -> bool:
    found = next(item for item in fields(message) if item.name == column)
    return found.metadata.get("per") == "entry"


def _signal_column(message: Signals, column: str, which: str | None, key: str) -> FloatArray:
    if column not in message.names:
        raise ValueError(
            f"{key}: there is no signal {column!r}{did_you_mean(column, message.names)}"
        )
    mine = message.signal == message.names.index(column)
    if which is not None:
        mine &= message.element == int(which)
    row = message.row_of_entries
    found = np.full(len(message), np.nan)
    found[row[mine]] = message.value[mine]
    return found
