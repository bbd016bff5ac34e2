"""Typed inputs and outputs of a block."""

from dataclasses import dataclass
from typing import Literal

from dsa_des.block.message import Message

Mode = Literal["sampled", "queued", "trigger"]


@dataclass(frozen=True)
class Input:
    """One input of a block.

    Parameters
    ----------
    message : type of Message
        What may arrive; a subclass is accepted too.
    mode : {"sampled", "queued", "trigger"}
        ``sampled`` holds the last message, ``queued`` keeps all that came since the block's last
        run, ``trigger`` also makes the block run when a message arrives.
    doc : str
        One sentence for ``dsa-des components``.
    required : bool
        Whether a scene must connect it. A block does not run before every required sampled or
        trigger input with a single writer holds a first message.
    many : bool
        Whether several writers may be connected; they are seen in the order of their names.
    """

    message: type[Message]
    mode: Mode = "sampled"
    doc: str = ""
    required: bool = True
    many: bool = False

    @property
    def held(self) -> bool:
        """Whether the block sees the last message, rather than all that came since its last run."""
        return self.mode != "queued" and not self.many


@dataclass(frozen=True)
class Output:
    """One output of a block.

    Parameters
    ----------
    message : type of Message
    doc : str
        One sentence for ``dsa-des components``.
    """

    message: type[Message]
    doc: str = ""
