"""The line of a made page, or section, that names the commit and the command that it is of."""

import re
import subprocess
from pathlib import Path

#: Commit and command of such a line.
STAMP = re.compile(r"^\*Made at `(\w+)` by `(.+)`\.\*$", re.MULTILINE)


def stamped(text: str, command: str) -> str:
    """Return a page with a last line that names the commit of this copy and the command."""
    done = subprocess.run(
        ["git", "rev-parse", "--short=8", "HEAD"],
        cwd=Path(__file__).parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return f"{text.rstrip()}\n\n*Made at `{done.stdout.strip() or 'unknown'}` by `{command}`.*\n"
