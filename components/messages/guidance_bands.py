"""The message of a guidance block: which directions and altitudes lead to a loss of separation."""

from dataclasses import dataclass

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Message, Text, column

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

    entry_table = "bands"

    offsets: IntArray
    band: IntArray = column(
        "", "", "direction or altitude: what it is a stretch of", "text",
        value=lambda m: Text(m.band, BAND_KINDS),
    )  # fmt: skip
    region: IntArray = column(
        "", "", "FAR, MID or NEAR: whose volumes are met; RECOVERY: what leads out", "text",
        value=lambda m: Text(m.region, BAND_REGIONS),
    )  # fmt: skip
    low_rad: FloatArray = column(
        "rad", "", "direction over the ground from north at which it begins"
    )
    high_rad: FloatArray = column("rad", "", "direction, clockwise, at which it ends")
    low_m: FloatArray = column("m", "", "altitude at which it begins")
    high_m: FloatArray = column("m", "", "altitude at which it ends")
