"""Files as syntax trees, each read once for all tests."""

import ast
from functools import cache
from pathlib import Path


@cache
def parsed(path: Path) -> ast.Module:
    """Return a file's tree; nobody changes it."""
    return ast.parse(path.read_text(encoding="utf-8"))
