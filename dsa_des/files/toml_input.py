"""Reading TOML from untrusted files: what the parser chokes on becomes one error."""

import tomllib
from typing import Any

from dsa_des.files.toml_reason import toml_reason

#: Tables and lists inside each other; scenes need about six.
DEEPEST = 64
#: Whole numbers have at most this many digits; clocks and seeds need twenty.
MOST_DIGITS = 100
_LARGEST_WHOLE: int = 10**MOST_DIGITS


class TomlError(ValueError):
    """A text is not TOML that can be used; the message says what is wrong."""


class NotToml(TomlError):
    """A text is not TOML at all."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises
    ------
    TomlError
        If it is not TOML, nested too deeply, or holds a whole number of too many digits.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotToml(f"is not valid TOML: {toml_reason(error)}") from None
    except RecursionError:
        raise TomlError(_too_deep()) from None
    except ValueError:  # Python's own limit on the digits of an integer
        raise TomlError(_too_long()) from None
    _refuse_extremes(tables)
    return tables


def _refuse_extremes(tables: dict[str, Any]) -> None:
    """Refuse what is nested too deeply and whole numbers that are too long, level by level."""
    level: list[Any] = [tables]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for container in level:
            for value in container.values() if isinstance(container, dict) else container:
                if isinstance(value, dict | list):
                    below.append(value)
                elif isinstance(value, int) and abs(value) >= _LARGEST_WHOLE:
                    raise TomlError(_too_long())
        if not below:
            return
        level = below
    raise TomlError(_too_deep())


def _too_deep() -> str:
    return f"tables and lists are nested too deeply: at most {DEEPEST} inside each other"


def _too_long() -> str:
    return f"a whole number has too many digits: at most {MOST_DIGITS} are allowed"
