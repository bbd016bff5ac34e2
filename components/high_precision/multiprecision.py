"""The library that computes at any number of digits, imported where it is needed."""

import importlib
from typing import Any


def mpmath_library() -> Any:
    """Return the library mpmath, which the references are computed with.

    Raises
    ------
    ImportError
        If it is not installed.
    """
    try:
        return importlib.import_module("mpmath")
    except ImportError as error:
        raise ImportError("the references need the library mpmath: pip install mpmath") from error
