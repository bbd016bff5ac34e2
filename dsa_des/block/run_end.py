"""The message by which a block ends its run before its time."""

from dataclasses import dataclass

from dsa_des.block.component import Component
from dsa_des.block.message import Message


@dataclass(eq=False)
class RunEnd(Message):
    """A run is over: the instant of a row is the first that is no longer part of it.

    Whoever sends one need not be wired to anybody. Nothing of this instant or a later one is
    recorded, and no block runs then; of replicas that run together the others go on. The first row
    counts. As every row it is of an instant at which the block ran, so that the end of a run
    follows from what came before it.
    """


def ends_its_run(block: type[Component]) -> bool:
    """Return whether blocks of a class may end their run."""
    return any(issubclass(output.message, RunEnd) for output in block.outputs.values())
