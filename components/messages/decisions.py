"""The message of an operator's console: what a person, or a record of one, decided."""

from dataclasses import dataclass
from typing import NamedTuple

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import PER_ROW, Message, Text, column, static

#: What may be decided, in the order of their numbers: an alert was on screen, was looked at, was
#: judged; the ownship is told to turn, or to climb or descend.
KINDS = ("shown", "looked", "verified", "rejected", "turn", "climb")
SHOWN, LOOKED, VERIFIED, REJECTED, TURN, CLIMB = range(6)


class OperatorDecision(NamedTuple):
    """One decision of an operator: its kind is an index into `KINDS`.

    Parameters
    ----------
    target : str
        Name of the target it is about; empty for none.
    turn_rad, climb_m : float
        Of a turn, positive to the right, and of a climb, positive upward; else 0.
    wall_time_s : float
        Seconds since 1970 by the wall clock, NaN where no person decided.
    """

    kind: int
    target: str = ""
    turn_rad: float = 0.0
    climb_m: float = 0.0
    wall_time_s: float = float("nan")


@dataclass(eq=False)
class Decisions(Message):
    """What an operator decided, each at the instant at which it came to the simulation.

    Parameters
    ----------
    decision, target : (rows,) of int
        Index into `KINDS` and into `targets`, -1 for none.
    turn_rad, climb_m : (rows,)
        0 for what is not such a manoeuvre.
    alert_s, response_s, replaces_s : (rows,)
        NaN without an alert, and where nothing was replaced.
    wall_time_s : (rows,)
        Of a person's decision, else NaN; a replay repeats it.
    """

    row_table = "decisions"

    decision: IntArray = column(
        "", "", "shown, looked, verified, rejected, turn or climb: an alert was on the operator's "
        "screen, was looked at, was judged, or the ownship was told to manoeuvre",
        "text", of=PER_ROW, value=lambda m: Text(m.decision, KINDS),
    )  # fmt: skip
    target: IntArray = column(
        "", "", "name of the target it is about; null for none", "text",
        of=PER_ROW, value=lambda m: Text(m.target, m.targets),
    )  # fmt: skip
    turn_rad: FloatArray = column(
        "rad", "", "commanded change of heading, positive to the right", of=PER_ROW
    )
    climb_m: FloatArray = column(
        "m", "", "commanded change of altitude, positive upward", of=PER_ROW
    )
    level: IntArray = column(
        "", "", "alert level of the target as the operator had it, 0 without an alert", "int64",
        of=PER_ROW,
    )  # fmt: skip
    alert_s: FloatArray = column(
        "s", "", "when that alert came to the operator; null without an alert", of=PER_ROW
    )
    response_s: FloatArray = column(
        "s", "", "time from then to the decision; null without an alert", of=PER_ROW
    )
    wall_time_s: FloatArray = column(
        "s", "", "seconds since 1970-01-01T00:00Z by the wall clock when the decision came from a "
        "person; null where none did",
        of=PER_ROW,
    )  # fmt: skip
    replaces_s: FloatArray = column(
        "s", "", "time_s of the command of the same kind that it replaces, which was still being "
        "flown; null where it replaces none",
        of=PER_ROW,
    )  # fmt: skip
    targets: tuple[str, ...] = static()
