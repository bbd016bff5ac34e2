"""The message of a guidance block: which directions and altitudes lead to a loss of separation."""

from dataclasses import dataclass

from components.messages.columns import DESCRIBED
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Message, Text, per_entry

#: What bands are of, and the regions they are painted with.
BAND_KINDS = ("direction", "altitude")
BAND_REGIONS = ("NONE", "FAR", "MID", "NEAR", "RECOVERY", "UNKNOWN")


@dataclass(eq=False)
class GuidanceBands(Message):
    """Bands of guidance at each instant with an alert; stretches that are clear are left out.

    Parameters
    ----------
    offsets : (rows + 1,)
    band : (entries,) of int
        Place in `BAND_KINDS`.
    region : (entries,) of int
        Place in `BAND_REGIONS`.
    low_rad, high_rad : (entries,)
        Directions over the ground from north, clockwise; NaN in bands of altitude.
    low_m, high_m : (entries,)
        Altitudes; NaN in bands of direction.
    """

    described = DESCRIBED
    entry_table = "bands"

    offsets: IntArray
    band: IntArray = per_entry(column="text", value=lambda m: Text(m.band, BAND_KINDS))
    region: IntArray = per_entry(column="text", value=lambda m: Text(m.region, BAND_REGIONS))
    low_rad: FloatArray = per_entry(column="float64")
    high_rad: FloatArray = per_entry(column="float64")
    low_m: FloatArray = per_entry(column="float64")
    high_m: FloatArray = per_entry(column="float64")
