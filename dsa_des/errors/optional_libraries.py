"""Libraries that only some uses need: imported where they are used, and named where missing."""

from importlib import import_module
from typing import Any

from dsa_des.errors.problems import UsageError


def import_extra(module: str, extra: str, what: str) -> Any:
    """Import and return an optional library; if missing, UsageError says how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise
        raise UsageError(f"{what} needs an extra: pip install 'dsa-des[{extra}]'") from None
