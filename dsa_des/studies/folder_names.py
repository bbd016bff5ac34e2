"""The latest of folders whose names count up."""

import re
from pathlib import Path


def latest_folder(parent: Path, stem: str) -> Path | None:
    """Return the ``parent/stem-NNN`` with the highest number; None if there is none."""
    form = re.compile(re.escape(stem) + r"-(\d{3,})")
    try:
        names = [entry.name for entry in parent.iterdir() if form.fullmatch(entry.name)]
    except OSError:
        return None
    return parent / max(names, key=lambda name: int(name[len(stem) + 1 :])) if names else None
