"""A fault that the tests must notice: code of one definition, and what takes its place.

They are listed in ``faults/``, a file for each kind of mistake:

    Definition.it_is_in: test_nearest another_folder/test_of_a_name_that_is_not_unique::test_one
        what-is-wrong: what stands there once → what takes its place
            = why nothing can tell the two apart, for a fault that is none

What is indented more continues a fault. Code is an expression, or statements; how it is laid out
counts for nothing, here as in the project. `definitions` says how a definition is named.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from textwrap import dedent

from definitions import ROOT, Code, Definition, checked, definition, parsed, replaced, shown

_LISTS = Path(__file__).with_name("faults")


@dataclass(frozen=True)
class Fault:
    """One mistake.

    Attributes
    ----------
    name : str
        Unique among all faults.
    group : str
        What kind of mistake it is: wiring, effects, metrics, ...
    where : str
        The definition that it is in, with as much before its name as makes it unique.
    old, new : str
        What stands there exactly once, and what takes its place.
    near : tuple of str
        Names of the tests that are to notice it, the fastest first.
    equivalent : str
        Why nothing can tell it from the original; empty for a real fault.
    """

    name: str
    group: str
    where: str
    old: str
    new: str
    near: tuple[str, ...]
    equivalent: str = ""

    @cached_property
    def code(self) -> tuple[Code, Code]:
        """Return old and new as expressions, or both as statements."""
        codes = parsed(self.old), parsed(self.new)
        if isinstance(codes[0], list) or isinstance(codes[1], list):
            codes = parsed(self.old, statements=True), parsed(self.new, statements=True)
        return codes

    @cached_property
    def definition(self) -> Definition:
        """Return what it is in; ValueError if that is not there or not the only one."""
        return definition(self.where)

    @property
    def file(self) -> str:
        """Return the path of its file from the root of the project."""
        return self.definition.file

    @cached_property
    def tests(self) -> tuple[str, ...]:
        """Return paths or node ids of its tests; ValueError if there is no such file."""
        return tuple(test_named(name) for name in self.near)

    @property
    def digest(self) -> str:
        """Return a text that changes when the fault does, but not with layout or the file."""
        parts = (self.where, *map(shown, self.code))
        return sha256("\0".join(parts).encode()).hexdigest()[:16]

    def applied(self) -> str:
        """Return the text of its file with the fault in it.

        Raises
        ------
        ValueError
            If the old code does not stand in the definition exactly once, or nothing changes.
        """
        try:
            old, new = self.code
            if shown(old) == shown(new):
                raise ValueError("old and new are the same")
            return checked(replaced(self.definition, old, new))
        except (ValueError, SyntaxError) as error:
            raise ValueError(f"{self.name}: {error}") from None


@cache
def _test_files() -> tuple[str, ...]:
    found = sorted((ROOT / "tests").rglob("test_*.py"))
    return tuple(path.relative_to(ROOT).as_posix() for path in found)


def test_named(name: str) -> str:
    """Return the path of a test that is named without its folder, or with as much as is needed."""
    file, colons, inner = name.partition("::")
    found = [path for path in _test_files() if f"/{path}".endswith(f"/{file}.py")]
    if len(found) != 1:
        several = f"is ambiguous; say which: {', '.join(found)}"
        raise ValueError(f"the test {file} {several if found else 'does not exist'}")
    return found[0] + colons + inner


test_named.__test__ = False  # pytest need not look at it


def read(text: str, group: str) -> Iterator[Fault]:
    """Yield the faults of a list.

    Raises
    ------
    ValueError
        If a line is none of such a list.
    """
    where, near, lines = "", (), []
    for number, line in enumerate([*text.splitlines(), "#"], 1):
        indented = len(line) - len(line.lstrip())
        if indented > 4 and lines:
            lines.append(line)
            continue
        if lines:
            yield _fault(lines, group, where, near)
            lines = []
        if indented == 4 and where:
            lines = [line]
        elif line and not indented and line[0] != "#" and ": " in line:
            where, _, tests = line.partition(": ")
            near = tuple(tests.split())
        elif line and line[0] != "#":
            raise ValueError(f"{group}, line {number}: neither a definition nor a fault: {line}")


def _fault(lines: list[str], group: str, where: str, near: tuple[str, ...]) -> Fault:
    name, _, first = lines[0].strip().partition(":")
    why = [line.strip()[2:] for line in lines[1:] if line.strip().startswith("= ")]
    rest = [line for line in lines[1:] if not line.strip().startswith("= ")]
    old, arrow, new = "\n".join([first, *rest]).partition("→")
    if not arrow or not old.strip() or not new.strip():
        raise ValueError(f"{group}: {name} has no old and new code with → between them")
    old, new = (dedent(each.strip("\n")).strip() for each in (old, new))
    return Fault(name, group, where, old, new, near, " ".join(why))


FAULTS: list[Fault] = [
    fault
    for file in sorted(_LISTS.glob("*.txt"))
    for fault in read(file.read_text(encoding="utf-8"), file.stem.replace("_", " "))
]
