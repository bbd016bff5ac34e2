"""An item of ``[[outages]]``: what fails at random, how, and how it is repaired."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from dsa_des.block.parameters import Parameters
from dsa_des.errors import did_you_mean


class Outage(Parameters):
    """Outages of blocks (``outages``); times between failures and to repair are exponential."""

    name: str | None = Field(
        default=None, description="What fails, as its draws are keyed; by default its blocks."
    )
    blocks: tuple[str, ...] = Field(min_length=1, description="Blocks that are out together.")
    mean_between_s: float = Field(
        gt=0, description="Mean time from the start, or from being back, to the next failure, s."
    )
    mean_repair_s: float = Field(gt=0, description="Mean time from a failure to its repair, s.")
    restart_s: float = Field(
        default=0.0, ge=0, description="Time from the repair to the first output, s."
    )
    mode: Literal["silent", "frozen", "stuck_bit"] = Field(
        default="silent",
        description="What a sensor's failure is: 'silent', it does not run; 'frozen', it sends the "
        "last values that it had, with new time stamps; 'stuck_bit', a bit of a value is set.",
    )
    stuck: dict[str, float] = Field(
        default={},
        description="Of a stuck bit: the quantity, as the sensor's message has it, and what the "
        "bit is worth in its unit.",
    )

    @property
    def key(self) -> str:
        """Name that keys the random draws of the outage: its `name`, or else its blocks."""
        return self.name or ", ".join(self.blocks)

    def sentence(self) -> str:
        """Return, for example, ``radar, eo: out after 600 s up, for 23 s, on average``."""
        out_s = self.mean_repair_s + self.restart_s
        blocks = ", ".join(self.blocks)
        bits = " and ".join(f"{worth:g} of {name}" for name, worth in self.stuck.items())
        how = {"silent": "out", "frozen": "frozen", "stuck_bit": f"the bit of {bits} set"}
        what = how[self.mode]
        return f"{blocks}: {what} after {self.mean_between_s:g} s up, for {out_s:g} s, on average"

    @model_validator(mode="after")
    def _check_blocks(self) -> "Outage":
        if len(set(self.blocks)) < len(self.blocks):
            raise ValueError(f"blocks is {list(self.blocks)}: each stands there once")
        if (self.mode == "stuck_bit") != bool(self.stuck):
            raise ValueError(
                f"mode is {self.mode!r} and stuck is {self.stuck}: the one asks for the other, "
                "mode = 'stuck_bit', stuck = { QUANTITY = WORTH }"
            )
        if wrong := [name for name, worth in self.stuck.items() if worth <= 0.0]:
            raise ValueError(f"stuck.{wrong[0]} must be greater than 0, what the bit is worth")
        return self

    def refusals(self, blocks: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str, Any]]:
        """Yield (key, message, value) for what the outage asks of blocks that cannot do it.

        `blocks` are the classes of the scene's blocks, None where one is not known.
        """
        for name in self.blocks:
            if name not in blocks:
                message = f"the scene has no such block{did_you_mean(name, blocks)}"
                yield ("blocks",), message, str(name)
            if (cls := blocks.get(name)) is None:
                continue
            if cls.process is not None:
                message = "has a process of its own, which an outage cannot stop"
                yield ("blocks",), message, name
            known = [one for out in cls.outputs.values() for one in out.message.may_stick]
            if self.mode != "silent" and not known:
                yield ("mode",), f"{name} sends no values of a sensor: must be 'silent'", self.mode
            for quantity in set(self.stuck).difference(known or self.stuck):
                message = f"{name} has no bits of it{did_you_mean(quantity, known)}"
                yield ("stuck", quantity), message, self.stuck[quantity]
