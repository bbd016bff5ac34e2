"""A block as a scene declares it, and the keys of its table that the engine itself understands.

``latency_s`` is the time a block takes to work on what it saw; ``processor`` names a table of
``[processors]`` for which it queues with others.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from pydantic import Field, field_validator

from dsa_des.block.component import Component, NonNegativeRational, Parameters, PositiveRational
from dsa_des.scene.queue_policy import find_policy


class BlockOptions(Parameters):
    """Keys of a block's table for the engine: latency, processor, platform, acknowledged notes."""

    may_change: ClassVar[tuple[str, ...]] = ("latency_s",)

    latency_s: NonNegativeRational = Field(
        default=Fraction(0), description="Time from an instant to the messages about it, s."
    )
    processor: str | None = Field(
        default=None, description="Shared processor that its messages go through."
    )
    platform: str | None = Field(
        default=None,
        description="Name of the aircraft or place that carries it; by default that of the blocks "
        "that feed it, else the ownship.",
    )
    acknowledged: list[str] = Field(
        default=[],
        description="Notes on this block that are known and meant, each by how it begins (a key's "
        "name, mostly), or what it says behind a colon, of a file or an aircraft: they are not "
        "said again.",
    )


def split_engine_and_own_keys(
    table: Mapping[str, Any], parameters: type[Parameters]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a block's table into (the engine's keys, the block's own parameters)."""
    engine = set(BlockOptions.model_fields) - set(parameters.model_fields)
    options = {key: value for key, value in table.items() if key in engine}
    own = {key: value for key, value in table.items() if key not in engine and key != "type"}
    return options, own


class ProcessorParameters(Parameters):
    """Settings of a shared processor, from a table ``[processors.NAME]``."""

    may_change: ClassVar[tuple[str, ...]] = ("service_s", "service_spread_s")

    service_s: PositiveRational = Field(description="Time to work on one message, s.")
    service_spread_s: NonNegativeRational = Field(
        default=Fraction(0),
        description="Largest extra time, s; each message takes a uniformly drawn part of it.",
    )
    when_busy: str = Field(
        default="wait",
        description="'wait', messages wait in line; 'drop_oldest', only the newest waits; 'skip', "
        "a block whose scan finds the processor busy leaves that scan out; or module:Class of a "
        "policy of your own.",
    )

    @field_validator("when_busy", mode="before")
    @classmethod
    def _check_policy(cls, name: Any) -> Any:
        find_policy(name)
        return name


@dataclass(frozen=True)
class Block:
    """A scene's block: name, type as written, class, own parameters, what it tells the engine."""

    name: str
    type_name: str
    cls: type[Component]
    parameters: Parameters
    options: BlockOptions = BlockOptions()

    def to_table(self) -> dict[str, Any]:
        """Return the block's table with every parameter written out, as plain TOML values."""
        return {
            "type": self.type_name,
            **self.options.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
            **self.parameters.model_dump(mode="json", exclude_none=True),
        }
