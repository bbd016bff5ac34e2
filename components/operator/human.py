"""A person at the console (``operator.human``), while ``dsa-des cdti`` runs the scene."""

from collections.abc import Sequence
from typing import Literal

from pydantic import Field

from components.messages.decisions import OperatorDecision
from components.operator.console import Console, ConsoleParameters
from components.operator.desk import Desk
from dsa_des.block.wake import Wake


class HumanParameters(ConsoleParameters):
    """Parameters of a console with a person at it."""

    unattended: Literal["goes on", "pauses"] = Field(
        default="goes on",
        description="What the run does while no operator's page is connected.",
    )


class Human(Console):
    """Takes in what a person decides, at the instant at which the decision comes.

    Decisions come from a `Desk`, which ``dsa-des cdti`` puts there; without one, in
    ``dsa-des run`` and in studies, nobody sits at the console and nothing is decided.
    """

    Parameters = HumanParameters
    #: Set by the program that has a person at hand.
    desk: Desk | None = None

    def due(self, wake: Wake) -> Sequence[tuple[int, OperatorDecision]]:
        """Take what lies on the desk."""
        if self.desk is None:
            return []
        tick = int(wake.ticks[-1])
        return self.desk.take(tick / self.context.ticks_per_s, tick)

    def warnings(self) -> list[str]:
        """Say that nobody is there."""
        if self.desk is not None:
            return []
        return ["nobody is at the console and nothing is decided: dsa-des cdti puts a person there"]
