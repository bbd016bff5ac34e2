"""A fault that the tests must notice: a text in one file, and what it becomes."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path


@dataclass(frozen=True)
class Fault:
    """One wrong line.

    Attributes
    ----------
    name : str
        Unique among all faults.
    group : str
        What kind of mistake it is: wiring, frames, units, ...
    file : str
        Path from the root of the project.
    old, new : str
        What stands there exactly once, and what takes its place.
    tests : tuple of str
        Files or node ids of the tests that are to notice it, the fastest first.
    equivalent : str
        Why nothing can tell it from the original; empty for a real fault.
    """

    name: str
    group: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    equivalent: str = ""

    @property
    def digest(self) -> str:
        """Return a text that changes when the fault does."""
        parts = (self.file, self.old, self.new)
        return sha256("\0".join(parts).encode()).hexdigest()[:16]

    def applied(self, root: Path) -> str:
        """Return the text of the file below `root` with the fault in it.

        Raises
        ------
        ValueError
            If the old text does not stand in the file exactly once.
        """
        text = (root / self.file).read_text(encoding="utf-8")
        found = text.count(self.old)
        if found != 1:
            raise ValueError(f"{self.name}: {self.file} holds the old text {found} times")
        return text.replace(self.old, self.new)


def in_file(
    group: str, file: str, tests: str | tuple[str, ...], *faults: tuple[str, ...]
) -> list[Fault]:
    """Return faults of one file that the same tests are to notice.

    Parameters
    ----------
    group, file, tests
        As of `Fault`; a test is named below ``tests/``.
    *faults : tuple of str
        Name, old text, new text and, where nothing can tell the two apart, why.
    """
    near = tuple(f"tests/{test}" for test in ([tests] if isinstance(tests, str) else tests))
    return [Fault(name, group, file, old, new, near, *why) for name, old, new, *why in faults]
