"""The table of a shared processor in a scene."""

from fractions import Fraction
from typing import Literal

from pydantic import Field

from dsa_des.block.component import NonNegativeRational, Parameters, PositiveRational


class ProcessorParameters(Parameters):
    """A table ``[processors.NAME]``."""

    service_s: PositiveRational = Field(description="Time to work on one message, s.")
    service_spread_s: NonNegativeRational = Field(
        default=Fraction(0),
        description="Largest extra time, s; each message takes a uniformly drawn part of it.",
    )
    when_busy: Literal["wait", "drop_oldest", "skip"] = Field(
        default="wait",
        description="Messages wait in line; or only the newest waits; or a block whose scan finds "
        "the processor busy leaves that scan out.",
    )
