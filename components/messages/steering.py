"""What an avoidance block tells the ownship to do."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.message import Message


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

    recorded: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "manoeuvres": {"turn_rad": "float64", "rate_rad_s": "float64"}
    }

    turn_rad: FloatArray
    rate_rad_s: FloatArray

    def tables(self) -> dict[str, dict[str, AnyArray]]:  # type: ignore[override]
        """Return the rows of ``manoeuvres``."""
        columns = {"tick": self.tick, "turn_rad": self.turn_rad, "rate_rad_s": self.rate_rad_s}
        return {"manoeuvres": columns}

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Refuse: before the first manoeuvre there is none, ``holds = "nothing"``."""
        raise ValueError("no manoeuvre can be written in a scene; allowed: 'nothing'")
