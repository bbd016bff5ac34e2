"""What a block is told of the replicas that it may serve together, though they differ."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from dsa_des.block.wake import Wake


@dataclass(frozen=True)
class ReplicaRuns:
    """The replicas of one block.

    Parameters
    ----------
    parameters : sequence
        The block's parameters in each replica.
    make : callable
        Given a replica's number, returns the block as that replica has it, not set up.
    """

    parameters: Sequence[Any]
    make: Callable[[int], Any]

    def __len__(self) -> int:
        return len(self.parameters)


class Runner(Protocol):
    """What handles the wakes of a block in place of the block itself."""

    def run(self, wake: Wake) -> Any:
        """Handle rows of many replicas, as `Component.run` does those of one."""
