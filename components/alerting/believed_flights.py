"""What an alerting block believes of flights at its scans, wherever that comes from."""

from typing import NamedTuple

from components.alert_configuration.configuration import Deviations
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class BelievedFlights(NamedTuple):
    """Flights as they are believed at some scans: a row for each scan, or for each flight.

    Parameters
    ----------
    known : (rows, columns) of bool
    relative : six of (rows, columns)
        East, north, up in m and their rates in m/s, ownship less target.
    scan : (rows,) of int or None
        Which scan each row belongs to; by default, rows are scans.
    target : (rows,) of int or None
        By default, columns are targets; -1 for a track that belongs to none.
    number : (rows,) of int or None
        Of tracks.
    deviations : Deviations of (rows,) or None
    """

    known: BoolArray
    relative: tuple[FloatArray, ...]
    scan: IntArray | None = None
    target: IntArray | None = None
    number: IntArray | None = None
    deviations: Deviations | None = None
