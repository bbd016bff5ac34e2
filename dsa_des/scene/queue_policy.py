"""What a shared processor does with messages that find it busy (``when_busy``)."""

from collections.abc import Sequence
from typing import Any, Protocol

from dsa_des.block.foreign import NotAllowed, NotImportable, load_named
from dsa_des.errors import did_you_mean


class Job(Protocol):
    """A message that waits: its block, and the tick at which it came."""

    block: str
    entered: int


class QueuePolicy:
    """Every message waits in line (``wait``); a subclass lets some go.

    It has no state: its answers follow from the jobs in line.
    """

    def skips(self, busy: bool) -> bool:
        """Return whether a scan is left out while the processor is busy or is not.

        Asked when the scan is due, and when its message comes: another block may have been first.
        """
        return False

    def dropped(self, waiting: Sequence[Job], new: Job) -> Sequence[Job]:
        """Return which jobs go, of those that wait in line (the oldest first) and a new one."""
        return ()


class DropOldest(QueuePolicy):
    """Only the newest message waits."""

    def dropped(self, waiting: Sequence[Job], new: Job) -> Sequence[Job]:
        """Let go of what waits."""
        return waiting


class Skip(QueuePolicy):
    """Scans that find the processor busy are left out."""

    def skips(self, busy: bool) -> bool:
        """Leave it out while the processor is busy."""
        return busy


POLICIES: dict[str, type[QueuePolicy]] = {
    "wait": QueuePolicy,
    "drop_oldest": DropOldest,
    "skip": Skip,
}


def find_policy(name: Any) -> type[QueuePolicy]:
    """Return the policy of a name, ``module:Class`` or ``./file.py:Class``, or raise ValueError."""
    if name in POLICIES:
        return POLICIES[name]
    if not isinstance(name, str) or ":" not in name:
        hint, allowed = did_you_mean(str(name), POLICIES), ", ".join(map(repr, POLICIES))
        raise ValueError(f"must be one of {allowed}, or module:Class{hint}")
    try:
        policy = load_named(name, "processors")
    except NotAllowed:
        return QueuePolicy
    except NotImportable as error:
        raise ValueError(str(error)) from error.__cause__
    if not (isinstance(policy, type) and issubclass(policy, QueuePolicy)):
        raise ValueError(f"{name} is not a dsa_des.scene.queue_policy.QueuePolicy")
    return policy
