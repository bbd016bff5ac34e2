"""The message of an avoidance block to the ownship."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import PER_ROW, Message, column, offsets_from_entry_rows

#: Slower turns are none: at 340 m/s their radius is beyond the 200 km that flights can have.
SLOWEST_TURN_DEG_S = 0.1


class Manoeuvre(NamedTuple):
    """One commanded turn, climb, descent or change of speed; fields not commanded are 0.

    Parameters
    ----------
    turn_rad : float
        Change of heading, positive to the right.
    rate_rad_s : float
        Rate of the turn, above 0 where there is one.
    climb_m : float
        Change of altitude, positive upward.
    climb_rate_mps : float
        Vertical speed of it, above 0 where there is one.
    speed_mps : float
        Change of ground speed.
    acceleration_mps2 : float
        Of that change, above 0 where there is one.
    vertical_speed_mps : float
        Change of vertical speed, which is kept then.
    vertical_acceleration_mps2 : float
        Of that change, above 0 where there is one.
    bank_rad : float
        In place of the turn's rate, above 0: the rate is what this bank gives at the speed flown.
    roll_rate_rad_s : float
        How fast the bank of the turn is built up; 0 for at once.
    heading_rad : float
        Track that is turned to, at up to `rate_rad_s`, in place of a change; where it is eased.
    eases_rad : float
        Within so much of that track the rate falls in proportion, and the bank takes its time;
        above 0 where a track is turned to.
    velocity_east_mps, velocity_north_mps : float
        Of a multirotor, in place of all of these: velocity over the ground, level, to which its own
        moves straight by at most `acceleration_mps2`; NaN for none.
    """

    turn_rad: float = 0.0
    rate_rad_s: float = 0.0
    climb_m: float = 0.0
    climb_rate_mps: float = 0.0
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0
    vertical_speed_mps: float = 0.0
    vertical_acceleration_mps2: float = 0.0
    bank_rad: float = 0.0
    roll_rate_rad_s: float = 0.0
    heading_rad: float = 0.0
    eases_rad: float = 0.0
    velocity_east_mps: float = math.nan
    velocity_north_mps: float = math.nan


@dataclass(eq=False)
class Manoeuvres(Message):
    """Turns, climbs and changes of speed that the ownship is to fly, one `Manoeuvre` per row.

    All are (rows,) and 0 for what is not changed; those after `rate_rad_s` are 0 by default.
    """

    row_table = "manoeuvres"

    turn_rad: FloatArray = column(
        "rad", "", "commanded change of heading, positive to the right", of=PER_ROW
    )
    rate_rad_s: FloatArray = column("rad/s", "", "rate of that turn", of=PER_ROW)
    climb_m: FloatArray = column(
        "m", "", "commanded change of altitude, positive upward", of=PER_ROW, default=None
    )
    climb_rate_mps: FloatArray = column(
        "m/s", "", "vertical speed of that climb or descent", of=PER_ROW, default=None
    )
    speed_mps: FloatArray = column(
        "m/s", "", "commanded change of ground speed", of=PER_ROW, default=None
    )
    acceleration_mps2: FloatArray = column(
        "m/s²", "", "acceleration of that change", of=PER_ROW, default=None
    )
    vertical_speed_mps: FloatArray = column(
        "m/s", "", "commanded change of vertical speed, positive upward", of=PER_ROW, default=None
    )
    vertical_acceleration_mps2: FloatArray = column(
        "m/s²", "", "acceleration of that change", of=PER_ROW, default=None
    )
    bank_rad: FloatArray = column(
        "rad", "", "bank of that turn, where it has no rate", of=PER_ROW, default=None
    )
    roll_rate_rad_s: FloatArray = column(
        "rad/s", "", "rate at which the bank is built up; 0: at once", of=PER_ROW, default=None
    )

    heading_rad: FloatArray = column(
        "rad", "NED", "track that is turned to, where the turn is eased", of=PER_ROW, default=None
    )
    eases_rad: FloatArray = column(
        "rad", "", "within so much of it the turn is eased; 0 for none", of=PER_ROW, default=None
    )

    def __post_init__(self) -> None:
        """Fill in what is not changed."""
        super().__post_init__()
        for name in self.manoeuvre_field_names()[2:]:
            if getattr(self, name) is None:
                setattr(self, name, np.zeros(len(self.tick)))

    @classmethod
    def of(cls, ticks: Sequence[int], manoeuvres: Sequence[Manoeuvre]) -> Self:
        """Return the message with one manoeuvre per row, at the given ticks."""
        parts = np.array(manoeuvres, dtype=np.float64).reshape(-1, len(Manoeuvre._fields)).T
        given: dict[str, Any] = dict(zip(Manoeuvre._fields, parts, strict=True))
        return cls(
            np.array(ticks, dtype=np.int64),
            **{name: given[name].copy() for name in cls.manoeuvre_field_names()},
        )

    @classmethod
    def manoeuvre_field_names(cls) -> list[str]:
        """Return the names of those fields of `Manoeuvre` that this message has."""
        return [name for name in Manoeuvre._fields if name in cls.__dataclass_fields__]

    def manoeuvre_array(self) -> FloatArray:
        """Return an array (rows, fields of `Manoeuvre`), NaN for fields the message lacks."""
        none, given = np.full(len(self.tick), math.nan), self.manoeuvre_field_names()
        parts = [getattr(self, name) if name in given else none for name in Manoeuvre._fields]
        return np.stack(parts, axis=-1)

    @classmethod
    def at_rows(cls, instants: RunTicks, manoeuvres: Mapping[int, Manoeuvre]) -> Self | None:
        """Return the message of manoeuvres at positions in `instants`; None if there are none."""
        rows = sorted(manoeuvres)
        if not rows:
            return None
        some = instants.take(np.array(rows))
        return cls.of(some.tick.tolist(), [manoeuvres[row] for row in rows]).with_runs(some.run)

    @classmethod
    def make_initial(cls, values: Mapping[str, object]) -> Self:
        """Raise ValueError: before a first manoeuvre a scene may only say ``holds = 'nothing'``."""
        raise ValueError("no manoeuvre can be written in a scene; allowed: 'nothing'")


@dataclass(eq=False)
class Velocities(Manoeuvres):
    """Velocities that a multirotor is commanded to fly, and the acceleration to reach them."""

    velocity_east_mps: FloatArray = column(
        "m/s", "", "commanded velocity over the ground, east", of=PER_ROW, default=None
    )
    velocity_north_mps: FloatArray = column(
        "m/s", "", "commanded velocity over the ground, north", of=PER_ROW, default=None
    )


@dataclass(eq=False)
class ChosenSides(Message):
    """The side of a manoeuvre that an aircraft has chosen, sent to those it is in conflict with.

    Parameters
    ----------
    address : (entries,) of int
        Whose choice it is; of two, the lower one goes first.
    side : (entries,) of int
        1 to the right or up, -1 to the left or down.
    meant_for : (entries,) of int
        Address of the other one of the conflict; nobody else is bound by it.
    """

    entry_table = "sides"

    offsets: IntArray
    address: IntArray = column("", "", "address of who chose", "int64")
    side: IntArray = column("", "", "1: to the right, or up; -1: to the left, or down", "int64")
    meant_for: IntArray = column(
        "", "", "address of the other one of the conflict, who alone is bound by it", "int64"
    )

    @classmethod
    def at_rows(
        cls, instants: RunTicks, address: int, side: IntArray, row: IntArray, meant_for: IntArray
    ) -> Self | None:
        """Return the message of sides other than 0 at positions in `instants`; None if none.

        None without any.
        """
        told = side[row] != 0
        pairs = np.unique(np.stack([row[told], meant_for[told]]), axis=1)
        if not pairs.size:
            return None
        rows, line = np.unique(pairs[0], return_inverse=True)
        some, offsets = instants.take(rows), offsets_from_entry_rows(line, len(rows))
        return cls(
            some.tick, offsets, np.full(len(line), address), side[pairs[0]], pairs[1], run=some.run
        )
