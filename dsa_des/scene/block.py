"""A block as a scene declares it: its type, its class and what its table says."""

from dataclasses import dataclass

from dsa_des.block.component import Component, Parameters
from dsa_des.scene.options import BlockOptions


@dataclass(frozen=True)
class Block:
    """One block of a scene: its name, its type as written, its class, its own parameters, and
    what its table says to the engine."""

    name: str
    type_name: str
    cls: type[Component]
    parameters: Parameters
    options: BlockOptions = BlockOptions()
