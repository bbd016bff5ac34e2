"""Says which made pages are older than what they measure.

    python tests/docs/older_pages.py

A made page, or a section of one, names the commit and the command that it is of
(`docs/make/stamp.py`). It is older if a file that its maker imports, at any remove, has changed
since; how many have is printed.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT), str(ROOT / "tests" / "support")]

import networkx as nx  # noqa: E402
from import_graph import imports, modules  # noqa: E402

from docs.make.stamp import STAMP  # noqa: E402


def stamps() -> Iterator[tuple[str, str, str]]:
    """Yield page, commit and command of every stamp."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        for commit, command in STAMP.findall(page.read_text(encoding="utf-8")):
            yield page.name, commit, command


def files_of(command: str) -> set[str]:
    """Return the files that a command's module imports, at any remove, from the project's root."""
    words = command.split()
    module = words[words.index("-m") + 1]
    # A package of sections: the section that is named, or its main module.
    section = f"{module}.{words[-1]}"
    start = section if section in modules() else f"{module}.__main__"
    start = start if start in modules() else module
    reached = {start, *nx.descendants(imports(), start)}
    return {modules()[name].relative_to(ROOT).as_posix() for name in reached}


def changed_since(commit: str) -> set[str] | None:
    """Return the files that differ from a commit, or None where it is not known here."""
    words = ["git", "diff", "--name-only", commit]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    return set(done.stdout.splitlines()) if done.returncode == 0 else None


def main() -> int:
    """Print a line for every stamp."""
    for page, commit, command in stamps():
        changed = changed_since(commit)
        if changed is None:
            said = "of a commit that is not known here"
        else:
            count = len(changed & files_of(command))
            said = f"older than {count} files that it is made of" if count else "current"
        print(f"{page}: {command} ({commit}): {said}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
