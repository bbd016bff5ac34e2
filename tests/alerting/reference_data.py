"""Where recorded output of the reference logic lies; tests that need it are left out without it."""

import gzip
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("REFERENCE_DATA", ROOT.parent / "shared" / "data"))


def reference_file(name: str) -> Path:
    """Return a file of the reference data, or skip the test by the file's name."""
    path = FOLDER / name
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    return path


def reference_text(name: str) -> str:
    """Return the text of a compressed file of the reference data, or skip the test."""
    return gzip.decompress(reference_file(name).read_bytes()).decode()


def rows(text: str) -> list[list[str]]:
    """Return the cells of a table."""
    return [[cell.strip() for cell in line.split(",")] for line in text.splitlines()]
