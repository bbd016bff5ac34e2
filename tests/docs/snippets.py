"""What the pages show: fenced blocks, what is said of them, and their command lines.

A comment in the line above a block says what a test does with it; it is not shown to readers.

``<!-- not run: REASON -->``
    The block is left alone; ``pytest -rs`` lists it with its reason.
``<!-- file: NAME -->``
    The block is written to that file, behind what earlier blocks wrote there; the page's commands
    find it.
``<!-- file: NAME; begins: TEXT -->``
    The same, with a line that the page does not show.
``<!-- run: COMMAND -->``
    Standing alone: a command that the page does not show.

Blocks without a language hold commands, ``python`` blocks are executed in order in one name space,
``toml`` blocks must at least be TOML, ``text`` blocks are pictures.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (
        ROOT / "README.md",
        *(ROOT / name for name in ("CONTRIBUTING.md",) if (ROOT / name).exists()),
        *(ROOT / "docs").glob("*.md"),
    )
)

_PIECE = re.compile(
    r"^<!-- run: (?P<hidden>.*?) -->$"
    r"|^(?:<!-- (?P<note>[^>]*?) -->\n)?```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
#: The environment of the tests stands for the one that these lines make.
_INSTALL = re.compile(r"^python3 -m venv \S+ && \S+/pip install -e \S+ && (?:\.venv/bin/)?")

#: What is added to a command so that it takes a second: pattern, and options behind the line.
SHORTER = (
    (
        re.compile(r"^dsa-des study (?!show |report |.*--replicas)"),
        "--workers 1 --no-figures --set runs_per_chunk=99",
    ),
    (
        re.compile(r"^dsa-des study (?!show |report |operators|flown_intercepts|.*--replicas)"),
        "--replicas 2",
    ),
    (
        re.compile(r"^dsa-des study (?:operators|flown_intercepts)"),
        "--replicas 1 --set set.duration_s=12",
    ),
    (re.compile(r"^dsa-des study .*--replicas"), "--replicas 2 --workers 1"),
    (re.compile(r"^dsa-des compare .*--swap"), "--replicas 2 --workers 1 --set duration_s=10"),
    (re.compile(r"^dsa-des cost (?!--|.*--answer)"), "--duration 2 --repeats 1"),
    (re.compile(r"^dsa-des cost .*--answer"), "--set replicas=2 --repeats 1 --workers 1"),
    (re.compile(r"^dsa-des cost first_light --out"), "--block radar"),
    # As it stands is run what the README begins with.
    (re.compile(r"^dsa-des run (?!first_light$)"), "--duration 10 --no-figures"),
)


@dataclass(frozen=True)
class Snippet:
    """A block of a page, or a command that stands in a comment.

    Parameters
    ----------
    page : str
    line : int
        Where it begins, from 1.
    language : str
        ``sh`` for commands.
    text : str
    note : str
        What the comment above it says.
    """

    page: str
    line: int
    language: str
    text: str
    note: str = ""

    @property
    def place(self) -> str:
        """Where a reader finds it."""
        return f"{self.page}:{self.line}"

    def commands(self) -> Iterator[str]:
        """Give its command lines as a reader would type them, with `SHORTER` behind."""
        for line in self.text.replace("\\\n", " ").splitlines():
            # Options in square brackets stand for what may be left out.
            bare = re.sub(r"\[[A-Z][A-Z. ]*\]", "", re.sub(r"\s#\s.*$", "", line)).strip()
            bare = _INSTALL.sub("", bare)
            if bare and not bare.startswith("#"):
                yield " ".join((bare, *(more for what, more in SHORTER if what.match(bare))))


def snippets_of(page: str, text: str) -> list[Snippet]:
    """Return all blocks and hidden commands of a page, in order."""
    found = []
    for match in _PIECE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["hidden"] is not None:
            found.append(Snippet(page, line, "sh", match["hidden"]))
        else:
            language = match["language"] or "sh"
            found.append(Snippet(page, line, language, match["text"], match["note"] or ""))
    return found


def read_snippets(page: str) -> list[Snippet]:
    """Return what a page of the project shows."""
    return snippets_of(page, (ROOT / page).read_text(encoding="utf-8"))


def not_run(snippet: Snippet) -> str | None:
    """Return why a snippet is left alone, or None."""
    return snippet.note.removeprefix("not run: ") if snippet.note.startswith("not run: ") else None


def file_of(snippet: Snippet) -> tuple[str, str] | None:
    """Return the file that a snippet is, and what is written before it, or None."""
    match = re.fullmatch(r"file: ([^;]+)(?:; begins: (.*))?", snippet.note)
    return (match[1], f"{match[2]}\n" if match[2] else "") if match else None
