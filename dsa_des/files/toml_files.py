"""TOML files: read with their places, and written."""

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

_PLACE = re.compile(r"(.*) \((at (?:line \d+, column \d+|end of document))\)", re.DOTALL)
# Messages of the parser that quote the file: only the kind of error is shown.
_WITH_CONTENT = (
    ("Cannot declare", "a table or key is given twice"),
    ("Cannot mutate", "a table or key is given twice"),
    ("Cannot overwrite", "a table or key is given twice"),
    ("Cannot redefine", "a table or key is given twice"),
    ("Duplicate", "a table or key is given twice"),
    ("Found invalid character", "a character that may not stand there"),
    ("Illegal character", "a character that may not stand there"),
)
_WITHOUT = re.compile(
    r"Expected .{1,60}|Escaped character is .*|Invalid [a-z ]+|Unclosed [a-z ]+|Unterminated "
    r"[a-z ]+|Unescaped '\\' in a string"
)


def toml_reason(error: Exception) -> str:
    """Return the message and line of a ``TOMLDecodeError``, without the line's text.

    A file that is no scene may hold secrets, so it is not quoted.
    """
    match = _PLACE.fullmatch(str(error))
    what, path = (match[1], f" ({match[2]})") if match else (str(error), "")
    for start, meaning in _WITH_CONTENT:
        if what.startswith(start):
            return meaning + path
    return (what if _WITHOUT.fullmatch(what) else "something else stands there") + path


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
    """Return the tables of a TOML text."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotToml(f"is not valid TOML: {toml_reason(error)}") from None
    except RecursionError:
        raise TomlError(_too_deep_message()) from None
    except ValueError:  # Python's own limit on the digits of an integer
        raise TomlError(_too_long_number_message()) from None
    _check_depth_and_numbers(tables)
    return tables


def _check_depth_and_numbers(tables: dict[str, Any]) -> None:
    """Raise TomlError if tables and lists are nested too deeply or a whole number is too long."""
    level: list[Any] = [tables]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for container in level:
            for value in container.values() if isinstance(container, dict) else container:
                if isinstance(value, dict | list):
                    below.append(value)
                elif isinstance(value, int) and abs(value) >= _LARGEST_WHOLE:
                    raise TomlError(_too_long_number_message())
        if not below:
            return
        level = below
    raise TomlError(_too_deep_message())


def _too_deep_message() -> str:
    return f"tables and lists are nested too deeply: at most {DEEPEST} inside each other"


def _too_long_number_message() -> str:
    return f"a whole number has too many digits: at most {MOST_DIGITS} are allowed"


_BARE = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


def to_toml(tables: Mapping[str, Any]) -> str:
    """Return tables as TOML text; in each table the plain values come before its subtables."""
    lines: list[str] = []
    _append_table(tables, (), lines)
    return "\n".join(lines).strip() + "\n"


def _append_table(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    nested = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    for key, value in table.items():
        if key not in nested:
            lines.append(f"{_toml_key(key)} = {inline_toml(value)}")
    for key, value in nested.items():
        inner = (*path, key)
        lines += ["", f"[{'.'.join(_toml_key(part) for part in inner)}]"]
        _append_table(value, inner, lines)


def _toml_key(key: str) -> str:
    return key if key and set(key) <= _BARE else _toml_text(key)


def _toml_text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def inline_toml(value: Any) -> str:
    """Return one value as TOML text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _toml_text(str(value))
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        items = ", ".join(f"{_toml_key(key)} = {inline_toml(item)}" for key, item in value.items())
        return f"{{{items}}}" if items else "{}"
    if isinstance(value, list | tuple):
        texts = [inline_toml(item) for item in value]
        if sum(map(len, texts)) > 80:
            return "[\n" + "".join(f"  {text},\n" for text in texts) + "]"
        return f"[{', '.join(texts)}]"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML: {value!r}")
