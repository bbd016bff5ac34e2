"""Where published encounter data lie; tests that need them are left out without them."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("REFERENCE_DATA", ROOT.parent / "shared" / "data")) / "encounters"


def reference_file(name: str) -> Path:
    """Return a file of the published data, or skip the test by the file's name."""
    path = FOLDER / name
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    return path
