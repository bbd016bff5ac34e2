"""Inputs and outputs of a block, and what its neighbours ask and say over them."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

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
    between_platforms : bool
        Whether writers may be on other platforms than the block (`Component.platforms`): what they
        send says by itself from where it is.
    """

    message: type[Message]
    mode: Mode = "sampled"
    doc: str = ""
    required: bool = True
    many: bool = False
    between_platforms: bool = False

    @property
    def is_held(self) -> bool:
        """Whether the block reads only the latest message, not all since its last run."""
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


@dataclass(frozen=True)
class Consumer:
    """A block that receives one of our outputs, with the request that it makes to us.

    Parameters
    ----------
    block : str
        Its name in the scene.
    port : str
        Its input.
    request : object
        What its `Component.request` returned for that input.
    platform : str
        What carries it (`Component.platforms`); empty where nothing does.
    """

    block: str
    port: str
    request: Any
    platform: str = ""


@dataclass(frozen=True)
class Producer:
    """A block that feeds one of our inputs, with what it declares about its output.

    Parameters
    ----------
    block : str
        Its name in the scene.
    port : str
        Our input.
    offer : object
        What its `Component.offer` returned for the output it feeds us from.
    latest_s : Fraction
        How late its messages come at most: latency, delay and jitter of the wire.
    jitter_s : Fraction
        How much of that is drawn anew for every message.
    unforeseen : bool
        Whether they may come later still: they wait for a processor, or for a number of scans.
    platform : str
        What carries it; empty where nothing does.
    """

    block: str
    port: str
    offer: Any
    latest_s: Fraction = Fraction(0)
    jitter_s: Fraction = Fraction(0)
    unforeseen: bool = False
    platform: str = ""
