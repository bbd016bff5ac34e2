"""The message of an avoidance block to the ownship."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from dsa_des.arrays.types import FloatArray
from dsa_des.block.message import Message, per_row


@dataclass(eq=False)
class Manoeuvres(Message):
    """Turns that the ownship is told to fly, one per row.

    Parameters
    ----------
    turn_rad : (rows,)
        Change of heading, positive to the right.
    rate_rad_s : (rows,)
        Rate of the turn, above 0.
    """

    row_table = "manoeuvres"

    turn_rad: FloatArray = per_row(column="float64")
    rate_rad_s: FloatArray = per_row(column="float64")

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Refuse: before the first manoeuvre there is none, ``holds = "nothing"``."""
        raise ValueError("no manoeuvre can be written in a scene; allowed: 'nothing'")
