"""Many runs of one scene that differ by seed and values, apart or in lock step."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsa_des.replicas.replicas import Failed, Recorded, Replica, run_replicas

__all__ = ["Failed", "Recorded", "Replica", "run_replicas"]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Failed": "dsa_des.replicas.replicas",
    "Recorded": "dsa_des.replicas.replicas",
    "Replica": "dsa_des.replicas.replicas",
    "run_replicas": "dsa_des.replicas.replicas",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
