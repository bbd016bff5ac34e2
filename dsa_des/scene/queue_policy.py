"""What a shared processor does with messages that find it busy (``when_busy``)."""

from collections.abc import Sequence
from typing import Any, Protocol

from dsa_des.block.shadowed_packages import NotAllowed, NotImportable, import_named_object
from dsa_des.errors import did_you_mean


class Job(Protocol):
    """Interface of a message that waits: its block, and the tick at which it entered."""

    block: str
    entered: int


class QueuePolicy:
    """Policy by which every message waits in line (``wait``); subclasses drop or skip some.

    It has no state: its answers follow from the jobs in line.
    """

    def skips(self, busy: bool) -> bool:
        """Return whether a scan is to be skipped, given whether the processor is busy.

        Asked when the scan is due, and when its message comes: another block may have been first.
        """
        return False

    def dropped(self, waiting: Sequence[Job], new: Job) -> Sequence[Job]:
        """Return the jobs to be dropped, given those that wait (oldest first) and a new one."""
        return ()


class DropOldest(QueuePolicy):
    """Policy by which only the newest message waits."""

    def dropped(self, waiting: Sequence[Job], new: Job) -> Sequence[Job]:
        """Return all waiting jobs, so that only the new one stays."""
        return waiting


class Skip(QueuePolicy):
    """Policy by which scans are skipped while the processor is busy."""

    def skips(self, busy: bool) -> bool:
        """Skip the scan while the processor is busy."""
        return busy


POLICIES: dict[str, type[QueuePolicy]] = {
    "wait": QueuePolicy,
    "drop_oldest": DropOldest,
    "skip": Skip,
}


def find_policy(name: Any) -> type[QueuePolicy]:
    """Return the queue policy of a name, ``module:Class`` or ``./file.py:Class``; or ValueError."""
    if name in POLICIES:
        return POLICIES[name]
    if not isinstance(name, str) or ":" not in name:
        hint, allowed = did_you_mean(str(name), POLICIES), ", ".join(map(repr, POLICIES))
        raise ValueError(f"must be one of {allowed}, or module:Class{hint}")
    try:
        policy = import_named_object(name, "processors")
    except NotAllowed:
        return QueuePolicy
    except NotImportable as error:
        raise ValueError(str(error)) from error.__cause__
    if not (isinstance(policy, type) and issubclass(policy, QueuePolicy)):
        raise ValueError(f"{name} is not a dsa_des.scene.queue_policy.QueuePolicy")
    return policy
