"""A scene whose time belongs to a host program.

`Simulator`, the interface for a host, is registered by a package under the entry-point group
``dsa_des.embed``.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsa_des.embed.host_driven import HostDriven, Step

__all__ = ["HostDriven", "Step"]


def __getattr__(name: str) -> Any:
    from importlib import import_module

    return getattr(import_module("dsa_des.embed.host_driven"), name)
