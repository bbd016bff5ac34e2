"""The keys of a block's table that the engine itself understands, whatever the block's type.

``latency_s`` is the time a block takes to work on what it saw; ``processor`` names a table of
``[processors]`` for which it queues with others.
"""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from pydantic import Field

from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.scene.wiring import Wire


class BlockOptions(Parameters):
    """Keys of a block's table that belong to the engine."""

    latency_s: NonNegativeRational = Field(
        default=Fraction(0), description="Time from an instant to the messages about it, s."
    )
    processor: str | None = Field(
        default=None, description="Shared processor that its messages go through."
    )


def split_options(
    table: Mapping[str, Any], parameters: type[Parameters]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a block's table into (the engine's keys, the block's own parameters)."""
    engine = set(BlockOptions.model_fields) - set(parameters.model_fields)
    options = {key: value for key, value in table.items() if key in engine}
    own = {key: value for key, value in table.items() if key not in engine and key != "type"}
    return options, own


def with_latencies(wires: list[Wire], options: Mapping[str, BlockOptions]) -> list[Wire]:
    """Return the wires with what their sending blocks add to the delay."""
    return [
        replace(
            wire,
            latency_s=options[wire.source].latency_s,
            queued=options[wire.source].processor is not None,
        )
        if wire.source in options
        else wire
        for wire in wires
    ]
