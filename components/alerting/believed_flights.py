"""What an alerting block believes of flights at its scans, wherever that comes from."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.margins import Deviations
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_NONE: IntArray = np.empty(0, dtype=np.int64)


class BelievedFlights(NamedTuple):
    """Flights as they are believed at some scans.

    Parameters
    ----------
    known : (scans, columns) of bool
    relative : six of (scans, columns)
        East, north, up in m and their rates in m/s, ownship less target.
    target : (scans, columns) of int or None
        By default, columns are targets; -1 for a track that belongs to none.
    number : (columns,) of int or None
        Of tracks.
    deviations : Deviations of (scans, columns) or None
    new : (n,) of int
        Columns that held something else before.
    """

    known: BoolArray
    relative: tuple[FloatArray, ...]
    target: IntArray | None = None
    number: IntArray | None = None
    deviations: Deviations | None = None
    new: IntArray = _NONE
